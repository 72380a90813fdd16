"""Where bytes come from and go to: UDP datagrams, TCP connections, a serial port; nothing here waits."""

from __future__ import annotations

import contextlib
import errno
import importlib
import math
import selectors
import socket
import struct
import sys
import threading
import time
from collections.abc import Iterable
from typing import Any, Protocol

from boresight.errors import UserError
from boresight.io.jsonlines import LONGEST

PER_READ = 2000  # datagrams or reads of a connection at once: then the others have their turn
DATAGRAM = 1 << 16  # bytes
CHUNK = 1 << 16  # bytes read from a connection at once
RECEIVE = 8 << 20  # bytes that the system is asked to hold for a UDP port
CONNECTIONS = 1000  # senders on one port; beyond, the one that has been silent longest goes
SPARE = 64  # files that are left to the rest of the process
RETRY = 0.5  # s between attempts to open a serial port that has gone
RESOLVE = 10.0  # s between attempts to find the host's address
UNSENT = 1 << 20  # bytes that wait for one receiver; one that reads no more is hung up on
MEMINFO, DROPS, FORCE = 55, 8, 33  # Linux: SO_MEMINFO, and where in its nine numbers the drops stand; SO_RCVBUFFORCE


class Input(Protocol):
    """Something that has bytes, or not."""

    name: str

    def attach(self, selector: selectors.BaseSelector) -> bool:
        """Register what can be waited for; false if it can only be asked."""
        ...

    def read(self, ready: Iterable[Any]) -> list[bytes]:
        """Return whole datagrams or lines that have arrived on the `ready` files, without waiting."""
        ...

    def lost(self) -> dict[str, int]:
        """Return what was lost, by reason, in lines (`overflow`; of datagrams that the system dropped an estimate)."""
        ...

    def close(self) -> None:
        """Give it back."""
        ...


def address(text: str, key: str) -> tuple[str, int]:
    """Return (host, port) of "host:port"; raises UserError."""
    host, _, port = text.removeprefix("udp://").removeprefix("tcp://").rpartition(":")
    if not port.isdigit() or not 0 <= int(port) < 65536:
        raise UserError(f"{key} = '{text}': give host:port")
    return host.strip("[]") or "127.0.0.1", int(port)


def _bound(text: str, key: str, kind: socket.SocketKind) -> socket.socket:
    """Return a socket bound to an address; raises UserError with the system's words."""
    host, port = address(text, key)
    try:
        family, _, _, _, where = socket.getaddrinfo(host, port, type=kind, flags=socket.AI_PASSIVE)[0]
        s = socket.socket(family, kind)
    except OSError as error:
        raise UserError(f"{key} = '{text}': {error.strerror or error}") from None
    try:
        if kind == socket.SOCK_STREAM or _is_multicast(host):
            s.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        s.bind(where)
        if kind == socket.SOCK_DGRAM and _is_multicast(host):
            group = struct.pack("4s4s", socket.inet_aton(host), socket.inet_aton("0.0.0.0"))
            s.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, group)
    except OSError as error:
        s.close()
        raise UserError(f"{key} = '{text}': {error.strerror or error}") from None
    s.setblocking(False)
    return s


def _is_multicast(host: str) -> bool:
    first = host.split(".")[0]
    return first.isdigit() and 224 <= int(first) <= 239


class Udp:
    """Datagrams on a port."""

    def __init__(self, text: str, key: str = "input.udp") -> None:
        self.name = f"udp:{text}"
        self.socket = _bound(text, key, socket.SOCK_DGRAM)
        for option in (FORCE, socket.SO_RCVBUF):
            with contextlib.suppress(OSError):
                self.socket.setsockopt(socket.SOL_SOCKET, option, RECEIVE)
                break
        self.datagrams = self.lines = 0

    def attach(self, selector: selectors.BaseSelector) -> bool:
        """Register the socket."""
        selector.register(self.socket, selectors.EVENT_READ, self)
        return True

    def dropped(self) -> int:
        """Return how many datagrams the system has dropped since its buffer was full; 0 where it does not say."""
        if sys.platform != "linux":
            return 0
        told = self.socket.getsockopt(socket.SOL_SOCKET, MEMINFO, 4 * (DROPS + 1))
        return int(struct.unpack(f"{len(told) // 4}I", told)[DROPS])

    def read(self, ready: Iterable[Any] = ()) -> list[bytes]:
        """Return datagrams: a flood waits in the system's buffer, which drops and counts."""
        out: list[bytes] = []
        with contextlib.suppress(BlockingIOError, ConnectionError):
            while len(out) < PER_READ:
                out.append(self.socket.recv(DATAGRAM))
        self.datagrams += len(out)
        self.lines += sum(map(lines_in, out))
        return out

    def lost(self) -> dict[str, int]:
        """Return the datagrams that the system dropped, in lines: as many in each as in those that came."""
        gone = self.dropped()
        return {"overflow": round(gone * max(self.lines, 1) / max(self.datagrams, 1))} if gone else {}

    def close(self) -> None:
        """Close the socket."""
        self.socket.close()


def _open_files() -> int:
    """Return how many files this process may have open."""
    try:
        import resource
    except ImportError:  # not everywhere
        return CONNECTIONS
    limit = resource.getrlimit(resource.RLIMIT_NOFILE)[0]
    return CONNECTIONS + SPARE if limit == resource.RLIM_INFINITY else limit


def lines_in(data: bytes) -> int:
    """Return how many lines a datagram holds."""
    return max(data.count(b"\n") + (not data.endswith(b"\n")), 1)


class Tcp:
    """Lines from whoever connects."""

    def __init__(self, text: str, key: str = "input.tcp", most: int = CONNECTIONS) -> None:
        self.name = f"tcp:{text}"
        self.server = _bound(text, key, socket.SOCK_STREAM)
        self.server.listen(128)
        self.most = min(most, max(_open_files() - SPARE, 1))
        self.peers: dict[socket.socket, bytes] = {}  # in the order in which they were last heard
        self.selector: selectors.BaseSelector | None = None
        self.gone: dict[str, int] = {}

    def attach(self, selector: selectors.BaseSelector) -> bool:
        """Register the port; connections as they come."""
        self.selector = selector
        selector.register(self.server, selectors.EVENT_READ, self)
        return True

    def read(self, ready: Iterable[Any] | None = None) -> list[bytes]:
        """Return whole lines of the connections that are `ready` (all); one that is too long is dropped and counted."""
        files = [self.server, *self.peers] if ready is None else list(ready)
        if self.server in files:
            self._accept()
        out: list[bytes] = []
        for peer in files:
            if peer is not self.server and peer in self.peers:
                self._read(peer, out)
        return out

    def lost(self) -> dict[str, int]:
        """Return lines that were too long or unfinished, and senders that were hung up on for others."""
        return dict(self.gone)

    def close(self) -> None:
        """Close all connections and the port."""
        for peer in list(self.peers):
            self._hang_up(peer)
        if self.selector is not None:
            with contextlib.suppress(KeyError, ValueError):
                self.selector.unregister(self.server)
        self.server.close()

    def _accept(self) -> None:
        for _ in range(128):
            try:
                peer, _ = self.server.accept()
            except BlockingIOError:
                return
            except OSError as error:  # a connection that is gone again, or no file left for it
                if error.errno not in (errno.EMFILE, errno.ENFILE) or not self.peers:
                    return
                self._displace()
                continue
            peer.setblocking(False)
            if len(self.peers) >= self.most:
                self._displace()
            self.peers[peer] = b""
            if self.selector is not None:
                self.selector.register(peer, selectors.EVENT_READ, self)

    def _displace(self) -> None:
        """Hang up on the sender that has been silent longest."""
        self._hang_up(next(iter(self.peers)))
        self._count("silent_senders_closed")

    def _read(self, peer: socket.socket, out: list[bytes]) -> None:
        try:
            data = peer.recv(CHUNK)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        if not data:
            if self.peers[peer].strip():
                out.append(self.peers[peer])  # the last line need not end
            self._hang_up(peer)
            return
        *lines, rest = (self.peers.pop(peer) + data).split(b"\n")
        if len(rest) > LONGEST:
            self._count("oversized")
            rest = b""
        self.peers[peer] = rest
        out += [line for line in lines if line]

    def _hang_up(self, peer: socket.socket) -> None:
        self.peers.pop(peer, None)
        if self.selector is not None:
            with contextlib.suppress(KeyError, ValueError):
                self.selector.unregister(peer)
        peer.close()

    def _count(self, why: str) -> None:
        self.gone[why] = self.gone.get(why, 0) + 1


class Serial:
    """Lines from a serial port (pyserial); a port that goes away is opened again."""

    def __init__(self, port: str, baud: int, key: str = "input.serial") -> None:
        try:
            self.serial: Any = importlib.import_module("serial")
        except ImportError:
            raise UserError(f"{key} needs pyserial: install boresight[serial]") from None
        self.name = f"serial:{port}"
        self.port, self.baud, self.rest = port, baud, b""
        self.device: Any = None
        self.gone, self.tried = 0, -math.inf
        if not self._open():
            raise UserError(f"{key} = '{port}': cannot be opened")

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

    def attach(self, selector: selectors.BaseSelector) -> bool:
        """Register nothing: a serial port is asked."""
        return False

    def lost(self) -> dict[str, int]:
        """Return how many lines were too long, or were cut off when the port went."""
        return {"overflow": self.gone} if self.gone else {}

    def read(self, ready: Iterable[Any] = ()) -> list[bytes]:
        """Return whole lines."""
        if self.device is None and not self._open():
            return []
        try:
            data = self.device.read(CHUNK)
        except (OSError, TypeError):  # unplugged; pyserial's own error is an OSError, a port closed under it no number
            self._unplugged()
            return []
        lines: list[bytes] = (self.rest + bytes(data)).split(b"\n")
        rest = lines.pop()
        self.gone += len(rest) > LONGEST
        self.rest = rest if len(rest) <= LONGEST else b""
        return [line for line in lines if line]

    def close(self) -> None:
        """Close the port."""
        if self.device is not None:
            with contextlib.suppress(OSError):
                self.device.close()
        self.device = None

    def _unplugged(self) -> None:
        """Give the port back, with the beginning of a line whose end will not come."""
        self.close()
        self.gone += bool(self.rest)
        self.rest = b""


class Host:
    """A host's address, asked for once and in the background: the name service may take seconds."""

    def __init__(self, host: str, port: int, kind: socket.SocketKind = socket.SOCK_STREAM) -> None:
        self.host, self.port, self.kind = host, port, kind
        self.why = f"looking for {host}"
        self.named = True
        self._found: tuple[socket.AddressFamily, tuple[object, ...]] | None = None
        self._asked = -math.inf
        self._thread: threading.Thread | None = None
        for family in (socket.AF_INET, socket.AF_INET6):
            with contextlib.suppress(OSError):
                socket.inet_pton(family, host)
                self._found, self.named = (family, (host, port)), False

    def found(self, now: float) -> tuple[socket.AddressFamily, tuple[object, ...]] | None:
        """Return family and address, None while they are not known."""
        busy = self._thread is not None and self._thread.is_alive()
        if self._found is None and now - self._asked >= RESOLVE and not busy:
            self._asked = now
            self._thread = threading.Thread(target=self._resolve, daemon=True)
            self._thread.start()
            self._thread.join(0.05)  # names of this machine are known at once
        return self._found

    def forget(self) -> None:
        """Look a name up again before the next attempt: nothing answered at its address."""
        if self.named:
            self._found = None

    def _resolve(self) -> None:
        try:
            first = socket.getaddrinfo(self.host, self.port, type=self.kind)[0]
            self._found = (first[0], first[4])
        except (OSError, UnicodeError) as error:
            self.why = f"{self.host}: {getattr(error, 'strerror', None) or error}"


class UdpOut:
    """Datagrams to one address; what the network refuses is counted and told, and the next one is tried."""

    MOST = 1400  # bytes of lines that are put into one datagram

    def __init__(self, text: str, key: str = "output.udp") -> None:
        self.name = f"udp:{text}"
        self.host = Host(*address(text, key), socket.SOCK_DGRAM)
        self.socket: socket.socket | None = None
        self.counts = {"sent": 0, "failed": 0}
        self.error = ""

    def send(self, lines: list[bytes], now: float) -> None:
        """Send lines (each with its end), as many in a datagram as fit."""
        found = self.host.found(now)
        if found is None:
            self.counts["failed"] += len(lines)
            self.error = self.host.why
            return
        some: list[bytes] = []
        size = 0
        for line in lines:
            if some and size + len(line) > self.MOST:
                self._send(b"".join(some), len(some), *found)
                some, size = [], 0
            some.append(line)
            size += len(line)
        if some:
            self._send(b"".join(some), len(some), *found)

    def _send(self, data: bytes, n: int, family: socket.AddressFamily, where: tuple[Any, ...]) -> None:
        try:
            if self.socket is None or self.socket.family != family:
                self.close()
                self.socket = socket.socket(family, socket.SOCK_DGRAM)
                self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
                self.socket.setblocking(False)
            self.socket.sendto(data, where)
        except OSError as error:  # no route, not permitted, buffer full
            self.counts["failed"] += n
            self.error = error.strerror or str(error)
            self.host.forget()
            return
        self.counts["sent"] += n
        self.error = ""

    def close(self) -> None:
        """Close the socket."""
        if self.socket is not None:
            self.socket.close()
        self.socket = None


class Broadcast:
    """A TCP port that sends every line to whoever is connected; one that does not read is hung up on.

    Lines wait for a receiver that is slow, up to a limit. A receiver that has closed its own direction still reads.
    """

    def __init__(self, text: str, key: str = "output.tcp") -> None:
        self.name = f"tcp:{text}"
        self.server = _bound(text, key, socket.SOCK_STREAM)
        self.server.listen(128)
        self.peers: dict[socket.socket, bytearray] = {}
        self.counts = {"sent": 0, "failed": 0, "receivers_closed": 0}
        self.error = ""

    def send(self, lines: list[bytes], now: float = 0.0) -> None:
        """Send lines to all, without waiting."""
        with contextlib.suppress(OSError):
            while len(self.peers) < CONNECTIONS:
                peer, _ = self.server.accept()
                peer.setblocking(False)
                self.peers[peer] = bytearray()
        data = b"".join(lines)
        for peer, waiting in list(self.peers.items()):
            waiting += data
            try:
                while waiting:
                    n = peer.send(waiting)
                    del waiting[:n]
            except BlockingIOError:
                if len(waiting) <= UNSENT:
                    continue
                self._hang_up(peer, "a receiver that reads no more was hung up on")
                continue
            except OSError as error:
                self._hang_up(peer, error.strerror or str(error))
                continue
            self.counts["sent"] += len(lines)
            with contextlib.suppress(OSError):  # what receivers say is read, so that it does not pile up
                peer.recv(CHUNK)

    def close(self) -> None:
        """Close all connections and the port."""
        for peer in self.peers:
            peer.close()
        self.peers.clear()
        self.server.close()

    def _hang_up(self, peer: socket.socket, why: str) -> None:
        self.counts["failed"] += self.peers[peer].count(b"\n")
        self.counts["receivers_closed"] += 1
        self.error = why
        del self.peers[peer]
        peer.close()
