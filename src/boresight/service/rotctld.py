"""A real rotator: client of Hamlib's `rotctld`, which never waits and connects again by itself."""

from __future__ import annotations

import errno
import math
import socket
from collections.abc import Callable

from boresight.frames.tangent import separation
from boresight.pointing.mount import Mount, MountState
from boresight.service.sockets import address
from boresight.types.sensor import FloatArray

Path = Callable[[], tuple[FloatArray, FloatArray] | None]

RETRY = 1.0  # s between attempts to connect
SPACING = 0.5  # s between the directions of a path
SILENT = 3.0  # s without an answer after which the connection is given up


class Rotator:
    """Sends positions within the mount's stops and rates, and reads back where the rotator is.

    A command is sent when it differs from the last one by more than `dead_band` (rad) and at most every `period` (s).
    Time comes in from outside (`now`, s), so that tests can drive it.
    """

    def __init__(self, text: str, mount: Mount, dead_band: float, period: float) -> None:
        self.address = address(text, "output.rotctld")
        self.mount, self.dead_band, self.period = mount, dead_band, period
        self.socket: socket.socket | None = None
        self.ready = False
        self.tried = self.sent_at = self.heard = -math.inf
        self.buffer = b""
        self.waiting: list[str] = []
        self.half: list[float] = []
        self.position: MountState | None = None  # read back
        self.commanded: MountState | None = None
        self.stepped = -math.inf
        self.late: MountState | None = None  # where a follower that does not look ahead would be
        self.counts = {"sent": 0, "refused": 0, "connects": 0, "lost": 0}

    def follow(self, azimuth: float, elevation: float, now: float, path: Path | None = None) -> MountState | None:
        """Go on towards a direction (rad); returns the position last commanded, None while there is no rotator.

        `path` tells the directions from now on, `SPACING` apart, when a command is due: so that azimuth begins to turn
        in time for what it cannot follow, a pass near the zenith.
        """
        if not self._connected(now):
            return None
        self._listen(now)
        if self.socket is None:
            return None
        if self.position is None:
            self._ask(now)
            return None
        if now - self.sent_at < self.period:
            return self.commanded
        here = self.commanded or self.mount.reach(self.position.azimuth, self.position.elevation, self.position.azimuth)
        dt = min(now - self.stepped, 5.0) if math.isfinite(self.stepped) else self.period
        goal = self._goal(here, azimuth, elevation, dt, path)
        self.stepped = now
        self._ask(now)  # first: Hamlib's dummy forgets what it has slewed when a new goal comes unasked
        moved = max(abs(goal.azimuth - here.azimuth), abs(goal.elevation - here.elevation))
        if self.commanded is None or moved > self.dead_band:
            self.commanded = goal
            self._send(f"P {math.degrees(goal.azimuth):.4f} {math.degrees(goal.elevation):.4f}\n", "P")
            self.counts["sent"] += 1
        return self.commanded

    def _goal(self, here: MountState, azimuth: float, elevation: float, dt: float, path: Path | None) -> MountState:
        told = path() if path is not None else None
        if told is None:
            self.late = None
            return self.mount.step(here, azimuth, elevation, dt)
        self.late, aim = self.mount.foresee(self.late or here, *told, SPACING, dt)
        return self.mount.step(here, aim.azimuth, aim.elevation, dt)

    def close(self) -> None:
        """Hang up."""
        if self.socket is not None:
            self.socket.close()
        self.socket = None

    def _connected(self, now: float) -> bool:
        if self.socket is not None and self.ready:
            return True
        if self.socket is None:
            if now - self.tried < RETRY:
                return False
            self.tried = now
            self.socket = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
            self.socket.setblocking(False)
            if self.socket.connect_ex(self.address) not in (0, errno.EINPROGRESS, errno.EWOULDBLOCK):
                self._drop()
                return False
        error = self.socket.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR)
        if error:
            self._drop()
            return False
        try:
            self.socket.getpeername()
        except OSError:  # still on its way
            if now - self.tried > SILENT:
                self._drop()
            return False
        self.ready, self.heard, self.buffer, self.waiting = True, now, b"", []
        self.position = self.commanded = self.late = None
        self.stepped = self.sent_at = -math.inf
        self.counts["connects"] += 1
        return True

    def _drop(self) -> None:
        if self.socket is not None:
            self.socket.close()
        if self.ready:
            self.counts["lost"] += 1
        self.socket, self.ready = None, False

    def _ask(self, now: float) -> None:
        if "p" not in self.waiting:
            self._send("p\n", "p")
        self.sent_at = now

    def _send(self, text: str, kind: str) -> None:
        if self.socket is None:
            return
        try:
            self.socket.sendall(text.encode("ascii"))
            self.waiting.append(kind)
        except OSError:
            self._drop()

    def _listen(self, now: float) -> None:
        assert self.socket is not None
        try:
            data = self.socket.recv(4096)
            if not data:
                self._drop()
                return
            self.buffer += data
            self.heard = now
        except BlockingIOError:
            if self.waiting and now - self.heard > SILENT:
                self._drop()
        except OSError:
            self._drop()
        lines = self.buffer.split(b"\n")
        self.buffer = lines.pop()[-4096:]
        self._answers([line.strip().decode("ascii", "replace") for line in lines])

    def _answers(self, lines: list[str]) -> None:
        """Match answers to questions: `P` gives RPRT n; `p` gives azimuth and elevation, or RPRT n if it failed."""
        half = self.half
        for line in lines:
            if line.startswith("RPRT"):
                if self.waiting:
                    self.waiting.pop(0)
                half.clear()
                if line != "RPRT 0":
                    self.counts["refused"] += 1
                continue
            try:
                half.append(math.radians(float(line)))
            except ValueError:
                continue
            if len(half) == 2:
                self.position = MountState(half[0], half[1])
                half.clear()
                if "p" in self.waiting:
                    self.waiting.remove("p")


def off_target(position: MountState, azimuth: float, elevation: float) -> float:
    """Return the angle (rad) between where a rotator is and a direction."""
    return float(separation(_unit(position.azimuth, position.elevation), _unit(azimuth, elevation)))


def _unit(azimuth: float, elevation: float) -> list[float]:
    c = math.cos(elevation)
    return [c * math.sin(azimuth), c * math.cos(azimuth), math.sin(elevation)]
