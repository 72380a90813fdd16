"""Where lines come from: UDP datagrams, TCP connections, a serial port; nothing here waits."""

from __future__ import annotations

import contextlib
import importlib
import math
import socket
import struct
import sys
import time
from typing import Any, Protocol

from boresight.errors import UserError

BUFFER = 1 << 16  # bytes kept of an unfinished line, then it is dropped
CONNECTIONS = 32
RETRY = 0.5  # s between attempts to open a serial port that has gone
MEMINFO, DROPS = 55, 8  # Linux: SO_MEMINFO, and where in its nine numbers the drops stand


class Input(Protocol):
    """Something that has bytes, or not."""

    def overflow(self) -> int:
        """Return how many datagrams or lines came faster than they were taken, and are lost."""
        ...

    def read(self) -> list[bytes]:
        """Return whole datagrams or lines that have arrived, without waiting."""
        ...

    def files(self) -> list[socket.socket]:
        """Return what to wait on; empty if it can only be asked."""
        ...

    def close(self) -> None:
        """Give it back."""
        ...


def address(text: str, key: str) -> tuple[str, int]:
    """Return (host, port) of "host:port"; raises UserError."""
    host, _, port = text.rpartition(":")
    if not port.isdigit() or not 0 <= int(port) < 65536:
        raise UserError(f"{key} = '{text}': give host:port")
    return host or "127.0.0.1", int(port)


class Udp:
    """Datagrams on a port."""

    def __init__(self, text: str, most: int) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self.socket.bind(address(text, "input.udp"))
        except OSError as error:
            self.socket.close()
            raise UserError(f"input.udp = '{text}': {error.strerror}") from None
        self.socket.setblocking(False)
        self.most = most

    def overflow(self) -> int:
        """Return how many datagrams the system has dropped since its buffer was full; 0 where it does not say."""
        if sys.platform != "linux":
            return 0
        told = self.socket.getsockopt(socket.SOL_SOCKET, MEMINFO, 4 * (DROPS + 1))
        return int(struct.unpack(f"{len(told) // 4}I", told)[DROPS])

    def read(self) -> list[bytes]:
        """Return at most `most` datagrams: a flood waits in the system's buffer, which drops and counts."""
        out: list[bytes] = []
        with contextlib.suppress(BlockingIOError, ConnectionError):
            while len(out) < self.most:
                out.append(self.socket.recv(BUFFER))
        return out

    def files(self) -> list[socket.socket]:
        """Return the socket."""
        return [self.socket]

    def close(self) -> None:
        """Close the socket."""
        self.socket.close()


class Tcp:
    """Lines from whoever connects."""

    def __init__(self, text: str, most: int) -> None:
        self.server = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        self.server.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            self.server.bind(address(text, "input.tcp"))
        except OSError as error:
            self.server.close()
            raise UserError(f"input.tcp = '{text}': {error.strerror}") from None
        self.server.listen(CONNECTIONS)
        self.server.setblocking(False)
        self.peers: dict[socket.socket, bytes] = {}
        self.most, self.lost = most, 0

    def overflow(self) -> int:
        """Return how many lines were beyond `most` in one read, or longer than the buffer."""
        return self.lost

    def read(self) -> list[bytes]:
        """Return whole lines; an unfinished one longer than the buffer is dropped with its beginning."""
        with contextlib.suppress(BlockingIOError):
            while len(self.peers) < CONNECTIONS:
                peer, _ = self.server.accept()
                peer.setblocking(False)
                self.peers[peer] = b""
        out: list[bytes] = []
        for peer in list(self.peers):
            try:
                data = peer.recv(BUFFER)
            except BlockingIOError:
                continue
            except OSError:
                data = b""
            if not data:
                peer.close()
                del self.peers[peer]
                continue
            *lines, rest = (self.peers[peer] + data).split(b"\n")
            self.lost += len(rest) >= BUFFER
            self.peers[peer] = rest if len(rest) < BUFFER else b""
            out += lines
        self.lost += max(len(out) - self.most, 0)
        return out[: self.most]

    def files(self) -> list[socket.socket]:
        """Return the port and the connections."""
        return [self.server, *self.peers]

    def close(self) -> None:
        """Close all connections and the port."""
        for peer in self.peers:
            peer.close()
        self.server.close()


class Serial:
    """Lines from a serial port (pyserial); a port that goes away is opened again."""

    def __init__(self, port: str, baud: int, most: int) -> None:
        try:
            self.serial: Any = importlib.import_module("serial")
        except ImportError:
            raise UserError("input.serial needs pyserial: install boresight[serial]") from None
        self.port, self.baud, self.most, self.rest = port, baud, most, b""
        self.device: Any = None
        self.lost, self.tried = 0, -math.inf
        if not self._open():
            raise UserError(f"input.serial = '{port}': cannot be opened")

    def _open(self) -> bool:
        now = time.monotonic()
        if now - self.tried < RETRY:
            return False
        self.tried = now
        try:
            self.device = self.serial.Serial(self.port, self.baud, timeout=0)
        except (OSError, ValueError):
            self.device = None
        return self.device is not None

    def overflow(self) -> int:
        """Return how many lines were beyond `most` in one read, or longer than the buffer."""
        return self.lost

    def read(self) -> list[bytes]:
        """Return whole lines."""
        if self.device is None and not self._open():
            return []
        try:
            data = self.device.read(BUFFER)
        except (OSError, TypeError):  # unplugged; pyserial's own error is an OSError, a port closed under it no number
            self._unplugged()
            return []
        lines: list[bytes] = (self.rest + bytes(data)).split(b"\n")
        rest = lines.pop()
        self.lost += (len(rest) >= BUFFER) + max(len(lines) - self.most, 0)
        self.rest = rest if len(rest) < BUFFER else b""
        return lines[: self.most]

    def files(self) -> list[socket.socket]:
        """Return nothing: a serial port is asked."""
        return []

    def close(self) -> None:
        """Close the port."""
        if self.device is not None:
            with contextlib.suppress(OSError):
                self.device.close()
        self.device = None

    def _unplugged(self) -> None:
        """Give the port back, with the beginning of a line whose end will not come."""
        self.close()
        self.lost += bool(self.rest)
        self.rest = b""


class Broadcast:
    """A TCP port that sends every line to whoever is connected; one that does not read is dropped."""

    def __init__(self, text: str) -> None:
        self.tcp = Tcp(text, 0)

    def send(self, line: bytes) -> None:
        """Send a line to all, without waiting."""
        self.tcp.read()
        for peer in list(self.tcp.peers):
            try:
                if peer.send(line) == len(line):
                    continue
            except OSError:
                pass
            peer.close()
            del self.tcp.peers[peer]

    def close(self) -> None:
        """Close all connections and the port."""
        self.tcp.close()
