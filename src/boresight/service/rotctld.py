"""A real rotator: client of Hamlib's `rotctld`, which never waits and connects again by itself.

One question is open at a time, so that every answer has its question; whatever does not fit ends the connection, and
nothing of an answer outlives it. What the rotator reads back is compared with what was sent: a command that was
refused, lost or undone by hand is sent again, and what cannot be mended is told.
"""

from __future__ import annotations

import errno
import math
import socket
from collections.abc import Callable
from dataclasses import replace

from boresight.frames.tangent import separation
from boresight.pointing.mount import TURN, Mount, MountState
from boresight.service.sockets import Host, address
from boresight.types.sensor import FloatArray

Path = Callable[[], tuple[FloatArray, FloatArray] | None]

RETRY = 1.0  # s between attempts to connect
SPACING = 0.5  # s between the directions of a path
SILENT = 3.0  # s without an answer after which the connection is given up
SETTLE = 2.0  # s off its command without coming nearer after which the command is sent again
REFUSALS, IDLE = 3, 5  # refusals, or commands without effect, in a row after which another winding is tried
LEARNED = 60.0  # s that a stop learned so is believed
LONGEST = 4096  # bytes of an answer
NEARER = math.radians(0.005)  # what counts as coming nearer between two readings
FURTHEST = math.radians(1080.0)  # beyond this a position is none
ERRORS = {
    -1: "invalid parameter", -2: "invalid configuration", -3: "out of memory", -4: "not implemented", -5: "timed out",
    -6: "input/output error", -7: "internal error", -8: "protocol error", -9: "command rejected", -10: "bad argument",
    -11: "not available", -16: "rejected by the rotator", -17: "out of range",
}  # fmt: skip


class Rotator:
    """Sends positions within the mount's stops and rates, and reads back where the rotator is.

    A command is sent when it differs from the last one by more than `dead_band` (rad), or when the rotator is further
    than that from the last one and does not come nearer, at most every `period` (s). `counts` says how often what
    happened, `told` what there is to say now. Time comes in from outside (`now`, s), so that tests can drive it.
    """

    def __init__(self, text: str, mount: Mount, dead_band: float, period: float) -> None:
        self.host = Host(*address(text, "output.rotctld"))
        self.mount, self.dead_band, self.period = mount, dead_band, period
        self.socket: socket.socket | None = None
        self.counts = dict.fromkeys(
            ("sent", "refused", "resent", "connects", "lost", "garbage", "silent", "windings"), 0
        )
        self.tried = -math.inf
        self.why = "not connected yet"
        self._forget(-math.inf)

    def _forget(self, now: float) -> None:
        """Begin as after a connect: of an earlier connection nothing is left."""
        self.ready = False
        self.buffer = b""
        self.open: str | None = None  # the question that has no answer yet: "p" or "P"
        self.half: list[float] = []
        self.asked = self.heard = self.near_since = now
        self.sent_at = self.stepped = -math.inf
        self.position: MountState | None = None  # read back, its azimuth in the winding nearest to the command's
        self.commanded: MountState | None = None
        self.late: MountState | None = None  # where a follower that does not look ahead would be
        self.answer = 0  # to the last command
        self.refusals = self.idle = 0  # commands in a row that were refused, or had no effect
        self.again = -math.inf  # s, when the last command was refused: it has to be sent again
        self.learned: tuple[float, float, float] | None = None  # azimuth stops that the rotator showed, until when
        self.winding = 0
        self.fresh = False  # a position has been read since the last command
        self.odd = ""

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
        if self.open is None and self.position is not None and self.fresh:
            self.fresh = False
            self._command(azimuth, elevation, now, path)
        elif self.open is None and now - self.asked >= self.period:
            # the position first: Hamlib's dummy forgets what it has slewed when a new goal comes unasked
            self._ask("p\n", now)
            self.asked = now
        return self.commanded

    def told(self, now: float) -> str:
        """Return what there is to say of the rotator at `now` (s), in a few words."""
        if not self.ready:
            return f"rotator away: {self.why}"
        if self.position is None:
            return f"rotator gives no position{self.odd and f': {self.odd}'}"
        fault = self.fault(now)
        turned = f", {self.winding:+d} turn" if self.winding else ""
        return f"rotator {fault}" if fault else f"rotator on{turned}"

    def fault(self, now: float) -> str:
        """Return why the rotator is not where it was sent, empty if it is, or is on its way."""
        at, to = self.position, self.commanded
        if at is None or to is None:
            return ""
        where = f"{math.degrees(at.azimuth):.1f} {math.degrees(at.elevation):.1f}"
        if self.answer:
            why = ERRORS.get(self.answer, "an error")
            return f"refuses {_degrees(to)} (RPRT {self.answer}, {why}), stands at {where}"
        off = self.off()
        if off > self.dead_band and (self.idle or now - self.near_since > SETTLE):
            return f"is {math.degrees(off):.2f}° off and comes no nearer: sent to {_degrees(to)}, stands at {where}"
        return f"{self.odd}" if self.odd else ""

    def off(self) -> float:
        """Return the angle (rad) between the last command and where the rotator is, NaN before there are both."""
        if self.position is None or self.commanded is None:
            return math.nan
        return off_target(self.position, self.commanded.azimuth, self.commanded.elevation)

    def summary(self, now: float) -> dict[str, object]:
        """Return what a run tells of the rotator at its end: counts, where it stands, how far off, and why."""
        at, off = self.position, self.off()
        found: dict[str, object] = {f"rotator_{k}": v for k, v in self.counts.items()}
        found["rotator_azimuth_deg"] = None if at is None else math.degrees(at.azimuth)
        found["rotator_elevation_deg"] = None if at is None else math.degrees(at.elevation)
        found["rotator_off_deg"] = None if math.isnan(off) else math.degrees(off)
        found["rotator_told"] = self.told(now)
        return found

    def close(self) -> None:
        """Hang up; what there was to say of the rotator stays."""
        if self.socket is not None:
            self.socket.close()
        self.socket = None

    # ------------------------------------------------------------------------------------------------------- commands
    def _command(self, azimuth: float, elevation: float, now: float, path: Path | None) -> None:
        """Send the next command if there is one to send; the position has just been read."""
        assert self.position is not None
        mount = self._mount(now)
        here = self.commanded
        if here is None:
            here = mount.reach(self.position.azimuth, self.position.elevation, self.position.azimuth)
        dt = min(now - self.stepped, 5.0) if math.isfinite(self.stepped) else self.period
        goal = self._goal(mount, here, azimuth, elevation, dt, path)
        self.stepped = now
        moved = max(abs(goal.azimuth - here.azimuth), abs(goal.elevation - here.elevation))
        stuck = self.commanded is not None and self.off() > self.dead_band and now - self.near_since > SETTLE
        again = self.again > -math.inf and (self.refusals < REFUSALS or now - self.again >= SETTLE)
        if self.commanded is not None and moved <= self.dead_band and not (again or stuck):
            return
        if again or stuck:
            self.counts["resent"] += 1
        if stuck:
            self.idle += 1
            self.near_since = now - 0.5 * SETTLE
        if self.refusals >= REFUSALS or self.idle >= IDLE:
            self._learn(goal, now)
        self.commanded = goal
        self.again = -math.inf
        self.counts["sent"] += 1
        self._ask(f"P {_text(goal.azimuth, self.mount.azimuth)} {_text(goal.elevation, self.mount.elevation)}\n", now)

    def _goal(
        self, mount: Mount, here: MountState, azimuth: float, elevation: float, dt: float, path: Path | None
    ) -> MountState:
        told = path() if path is not None else None
        if told is None:
            self.late = None
            return mount.step(here, azimuth, elevation, dt)
        self.late, aim = mount.foresee(self.late or here, *told, SPACING, dt)
        return mount.step(here, aim.azimuth, aim.elevation, dt)

    def _mount(self, now: float) -> Mount:
        """Return the mount within the stops that the rotator has shown of late; they only ever lie further in."""
        if self.learned is not None and now > self.learned[2]:
            self.learned, self.refusals, self.idle = None, 0, 0
        if self.learned is None:
            return self.mount
        return replace(self.mount, azimuth=self.learned[:2])

    def _learn(self, goal: MountState, now: float) -> None:
        """Take a stop to be where the rotator stands, if another winding then reaches what this one does not."""
        assert self.position is not None
        low, high = self.mount.azimuth
        at = min(max(self.position.azimuth, low), high)
        beyond = goal.azimuth - at
        if abs(beyond) <= self.dead_band or self.learned is not None:
            return
        stops = (low, at) if beyond > 0.0 else (at, high)
        other = goal.azimuth - math.copysign(TURN, beyond)
        if stops[0] < stops[1] and stops[0] <= other <= stops[1]:
            self.learned = (*stops, now + LEARNED)
            self.refusals = self.idle = 0
            self.counts["windings"] += 1

    # ------------------------------------------------------------------------------------------------------ connection
    def _connected(self, now: float) -> bool:
        if self.socket is not None and self.ready:
            return True
        if self.socket is None and not self._dial(now):
            return False
        assert self.socket is not None
        error = self.socket.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR)
        if error:
            self._drop(_why(error))
            return False
        try:
            self.socket.getpeername()
        except OSError:  # still on its way
            if now - self.tried > SILENT:
                self._drop("no answer to the connection")
            return False
        self._forget(now)
        self.ready, self.asked = True, -math.inf
        self.counts["connects"] += 1
        return True

    def _dial(self, now: float) -> bool:
        if now - self.tried < RETRY:
            return False
        self.tried = now
        found = self.host.found(now)
        if found is None:
            self.why = self.host.why
            return False
        family, where = found
        try:
            self.socket = socket.socket(family, socket.SOCK_STREAM)
            self.socket.setblocking(False)
            self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            error = self.socket.connect_ex(where)
        except OSError as failed:
            error = failed.errno or errno.EIO
        if error not in (0, errno.EINPROGRESS, errno.EWOULDBLOCK):
            self._drop(_why(error))
            return False
        return True

    def _drop(self, why: str) -> None:
        if self.socket is not None:
            self.socket.close()
        if self.ready:
            self.counts["lost"] += 1
        else:
            self.host.forget()
        self.socket = None
        self._forget(-math.inf)
        self.why = why

    def _ask(self, text: str, now: float) -> None:
        if self.socket is None:
            return
        try:
            self.socket.sendall(text.encode("ascii"))
        except OSError as error:
            self._drop(_why(error.errno or errno.EIO))
            return
        self.open, self.heard = text[0], now
        self.half = []

    def _listen(self, now: float) -> None:
        assert self.socket is not None
        try:
            data = self.socket.recv(LONGEST)
        except BlockingIOError:
            data = None
        except OSError as error:
            self._drop(_why(error.errno or errno.EIO))
            return
        if data == b"":
            self._drop("it hung up")
            return
        *lines, self.buffer = (self.buffer + (data or b"")).split(b"\n")
        for line in lines:
            self._answered(line.strip().decode("ascii", "replace"), now)
            if not self.ready:
                return
        if len(self.buffer) >= LONGEST:
            self.counts["garbage"] += 1
            self._drop("an endless line")
        elif self.open is not None and now - self.heard > SILENT:
            self.counts["silent"] += 1
            self._drop(f"no answer to {self.open} within {SILENT:g} s")

    def _answered(self, line: str, now: float) -> None:
        """Take one line: `P` is answered by RPRT n; `p` by azimuth and elevation, or RPRT n if it failed."""
        code = _code(line)
        if code is not None and self.open is not None:
            if self.open == "P":
                self._set(code, now)
            else:
                self.odd = f"RPRT {code} ({ERRORS.get(code, 'an error')}) instead of a position"
                self.counts["refused"] += code != 0
                if code == 0:  # no answer to p: which question it belongs to is not known
                    self._drop("an answer that fits no question")
                    return
            self.open, self.half = None, []
            return
        value = _number(line)
        if value is None:
            self.counts["garbage"] += bool(line)
            return
        if self.open != "p":
            self.counts["garbage"] += 1
            self._drop("an answer that fits no question")
            return
        self.half.append(value)
        if len(self.half) == 2:
            self.open = None
            self._read(self.half[0], self.half[1], now)
            self.half = []

    def _set(self, code: int, now: float) -> None:
        self.answer = code
        if code:
            self.counts["refused"] += 1
            self.again = now
            self.refusals += 1
        else:
            self.refusals = 0

    def _read(self, azimuth_deg: float, elevation_deg: float, now: float) -> None:
        """Take a position read back: how far it is off, and whether it has come nearer to the command."""
        azimuth, elevation = math.radians(azimuth_deg), math.radians(elevation_deg)
        if not (abs(azimuth) <= FURTHEST and abs(elevation) <= FURTHEST):
            self.counts["garbage"] += 1
            self.odd = f"its position is {azimuth_deg:g} {elevation_deg:g}"
            return
        self.odd, self.fresh = "", True
        before = self.position
        self.winding = 0
        if self.commanded is not None:
            self.winding = round((azimuth - self.commanded.azimuth) / TURN)
            azimuth -= TURN * self.winding
        self.position = MountState(azimuth, elevation)
        if self.commanded is None or before is None:
            self.near_since = now
            return
        off = self.off()
        towards = off_target(before, self.commanded.azimuth, self.commanded.elevation) - off
        if off <= self.dead_band or towards > NEARER:
            self.near_since, self.idle = now, 0


def off_target(position: MountState, azimuth: float, elevation: float) -> float:
    """Return the angle (rad) between where a rotator is and a direction."""
    return float(separation(_unit(position.azimuth, position.elevation), _unit(azimuth, elevation)))


def _unit(azimuth: float, elevation: float) -> list[float]:
    c = math.cos(elevation)
    return [c * math.sin(azimuth), c * math.cos(azimuth), math.sin(elevation)]


def _text(angle: float, stops: tuple[float, float]) -> str:
    """Return an angle (rad) in degrees, rounded towards the inside of the stops where rounding would leave them."""
    low, high = (math.degrees(s) for s in stops)
    value = round(math.degrees(angle), 4)
    if value > high:
        value = math.floor(high * 1e4) / 1e4
    elif value < low:
        value = math.ceil(low * 1e4) / 1e4
    return f"{value:.4f}"


def _degrees(at: MountState) -> str:
    return f"{math.degrees(at.azimuth):.1f} {math.degrees(at.elevation):.1f}"


def _code(line: str) -> int | None:
    """Return n of `RPRT n`."""
    word = line.split()
    if len(word) != 2 or word[0] != "RPRT":
        return None
    try:
        return int(word[1]) if len(word[1]) < 10 else None
    except ValueError:
        return None


def _number(line: str) -> float | None:
    """Return a number as Hamlib prints it (also nan); None if the line is none."""
    try:
        return float(line) if len(line) < 64 and "_" not in line else None
    except ValueError:
        return None


def _why(error: int) -> str:
    import os

    return os.strerror(error).lower()
