"""Where pointing commands go: lines on UDP and TCP, and a rotator; each may fail, none stops another."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any, Protocol

import msgspec
import numpy as np

from boresight.config.site import OutputTable
from boresight.engine.guide import GuideOutput
from boresight.pointing.guide import biased
from boresight.pointing.mount import Mount
from boresight.pointing.pointer import Mode, Pointer, PointerState, Pointing
from boresight.service.navigation import Navigation
from boresight.service.rotctld import SPACING, Rotator
from boresight.service.sockets import Broadcast, UdpOut

FURTHEST = 120.0  # s that a pass is looked ahead


class LineOut(Protocol):
    """Somewhere that lines go."""

    name: str
    counts: dict[str, int]
    error: str

    def send(self, lines: list[bytes], now: float) -> None:
        """Send lines, each with its end; what fails is counted, never raised."""
        ...

    def close(self) -> None:
        """Give it back."""
        ...


class Commands:
    """A sink for commands; `last` is the newest."""

    def __init__(
        self, out: OutputTable, mount: Mount, pointer: Pointer, clock: Callable[[], float], carrier: Navigation | None
    ) -> None:
        self.outs: list[LineOut] = []
        if out.udp:
            self.outs.append(UdpOut(out.udp))
        if out.tcp:
            self.outs.append(Broadcast(out.tcp))
        self.rotator = None
        if out.rotctld:
            self.rotator = Rotator(out.rotctld, mount, math.radians(out.dead_band_deg), 1.0 / out.command_rate_hz)
        # half a turn: more is never to be made good
        self.ahead = np.arange(0.0, min(math.pi / mount.azimuth_rate, FURTHEST) + SPACING, SPACING)
        self.pointer, self.clock, self.carrier = pointer, clock, carrier
        self.last: Pointing | None = None
        self.state: PointerState | None = None
        self.ticks = 0

    def take(self, output: GuideOutput) -> None:
        """Send the newest command; older ones of the same step are past."""
        self.state = output.state
        if not output.pointings:
            return
        self.last = pointing = output.pointings[-1]
        self.ticks += len(output.pointings)
        now = self.clock()
        line = [encode(pointing)]
        for out in self.outs:
            out.send(line, now)
        if self.rotator is not None:
            path = partial(self.pointer.path, output.state, now, self.ahead) if self._steady(pointing) else None
            self.rotator.follow(pointing.mount_azimuth, pointing.mount_elevation, now, path)

    def close(self) -> None:
        """Close all outputs."""
        for out in self.outs:
            out.close()
        if self.rotator is not None:
            self.rotator.close()

    def counts(self) -> dict[str, Any]:
        """Return what was sent, what failed, and the last error of each output."""
        found: dict[str, Any] = {"ticks": self.ticks, "outputs": outputs(self.outs)}
        return found | (self.rotator.summary(self.clock()) if self.rotator else {})

    def _steady(self, p: Pointing) -> bool:
        """Return whether the mount's way can be foretold: it stands on the ground and does not search."""
        return self.carrier is None and p.mode in (Mode.FUSED, Mode.OWN, Mode.COAST, Mode.BELOW_HORIZON)


def outputs(outs: list[LineOut]) -> dict[str, Any]:
    """Return the counts of outputs by name, with the last error of those that fail."""
    return {out.name: {**out.counts, **({"error": out.error} if out.error else {})} for out in outs}


def encode(p: Pointing) -> bytes:
    """Return a command as one JSON line."""
    a = p.aim
    degrees = {
        "az_deg": a.azimuth, "el_deg": a.elevation, "face_az_deg": a.face_azimuth, "face_el_deg": a.face_elevation,
        "az_rate_deg_s": a.azimuth_rate, "el_rate_deg_s": a.elevation_rate, "sigma_deg": a.sigma,
        "mount_az_deg": p.mount_azimuth, "mount_el_deg": p.mount_elevation,
    }  # fmt: skip
    row = {"t_s": p.t, "t_aim_s": p.t_aim, **{k: math.degrees(v) for k, v in degrees.items()}}
    row |= {"face_u": a.cosine_right, "face_v": a.cosine_up}
    return msgspec.json.encode({**row, "p_in_beam": a.p_in_beam, "mode": str(p.mode)}) + b"\n"


def status_line(
    pointer: Pointer, state: PointerState, p: Pointing, rotator: Rotator | None, carrier: Navigation | None = None
) -> str:
    """Return the line that says how it goes: mode, aim, error, each source's age, weight and learned sigma factor."""
    ages, weights = pointer.ages(state, p.t), pointer.weights(state, p)
    rows = zip(pointer.guide.sources, ages, weights, state.guide.scale, strict=True)
    sources = "  ".join(
        f"{s.id} {'–' if math.isinf(age) else f'{age:.1f}s'} {100.0 * weight:.0f}% ×{math.sqrt(scale):.2f}"
        for s, age, weight, scale in rows
    )
    who = biased(pointer.guide.sources, state.guide.clock)
    where = "" if rotator is None else f"  {rotator.told(p.t)}"
    aim = f"az {math.degrees(p.aim.azimuth):8.3f} el {math.degrees(p.aim.elevation):7.3f}"
    error = f"σ {math.degrees(p.aim.sigma):.3f}° P {p.aim.p_in_beam:.2f}"
    turned = "" if carrier is None else f"  {carrier.name} {carrier.age(p.t):.1f}s"
    return f"{p.mode:6s} {aim} {error}  {sources}{turned}{who and f'  {who}'}{where}   "
