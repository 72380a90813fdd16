"""The live loop: what arrives goes in at once, a command goes out at every tick."""

from __future__ import annotations

import math
import select
import socket
import time
from collections.abc import Callable
from functools import partial
from typing import Any, TextIO

import msgspec
import numpy as np

from boresight.config.site import Station
from boresight.errors import UserError
from boresight.kernels.guide import DIRECTION
from boresight.pointing.pointer import Mode, Pointer, PointerState, Pointing
from boresight.service.elements import Elements
from boresight.service.feed import PER_READ, Feed, Stand
from boresight.service.navigation import Navigation
from boresight.service.rotctld import SPACING, Rotator
from boresight.service.sockets import Broadcast, Input, Serial, Tcp, Udp, address
from boresight.types import Axes

POLL = 0.005  # s between looks at inputs that cannot be waited for
FURTHEST = 120.0  # s that a pass is looked ahead
SHOW = 0.1  # s between status lines


def run_live(
    station: Station,
    pointer: Pointer,
    duration: float | None,
    status: TextIO | None,
    clock: Callable[[], float] = time.time,
    stop: Callable[[], bool] = lambda: False,
) -> dict[str, Any]:
    """Point until `duration` (s) has passed, `stop` says so or the user interrupts; returns the counts.

    Raises UserError if the site file names no input, or one that cannot be opened.
    """
    file = station.file
    inputs = _inputs(station)
    elements = Elements(pointer, station.elements, {s.id: s.max_age_days for s in file.source})
    if not inputs and not elements.usable(clock()):
        raise UserError(f"no [input], and no elements to guide: {elements.told(clock())}: see max_age_days")
    stands = {s.id: Stand(Axes(s.axes), s.offset_enu_m, s.lever_arm_frd_m) for s in file.source}
    carrier = None if file.platform is None else Navigation(file.platform, pointer, file.attitude_coast_s)
    feed = Feed(pointer, stands, carrier)
    out = socket.socket(socket.AF_INET, socket.SOCK_DGRAM) if file.output.udp else None
    goal = address(file.output.udp, "output.udp") if file.output.udp else ("", 0)
    stream = Broadcast(file.output.tcp) if file.output.tcp else None
    rotator = _rotator(station)
    # half a turn: more is never to be made good
    ahead = np.arange(0.0, min(math.pi / station.mount.azimuth_rate, FURTHEST) + SPACING, SPACING)
    state, begun = _warm(pointer), clock()
    tick, ticks, latency, total, answers, busy = begun, 0, 0.0, 0.0, 0, time.process_time()
    arrived, shown = math.nan, -math.inf
    try:
        while not stop() and (duration is None or clock() - begun < duration):
            now = clock()
            for source in inputs:
                for data in source.read():
                    for report in feed.parse(data, now):
                        pointer.take(state, *report)
                        arrived = now
            if now < tick:
                _wait(inputs, tick - now)
                continue
            elements.report(state, now)
            state, pointing = pointer.tick(state, now, None if carrier is None else carrier.place(now))
            if pointing is not None:
                if out is not None:
                    out.sendto(encode(pointing), goal)
                if stream is not None:
                    stream.send(encode(pointing))
                if rotator is not None:
                    path = partial(pointer.path, state, now, ahead) if steady(carrier, pointing) else None
                    rotator.follow(pointing.mount_azimuth, pointing.mount_elevation, now, path)
                if not math.isnan(arrived):
                    took = clock() - arrived if ticks else 0.0
                    latency, total, answers = max(latency, took), total + took, answers + (ticks > 0)
                ticks += 1
                arrived = math.nan
            if status is not None and pointing is not None and now >= shown + SHOW:
                shown = now
                status.write("\r" + status_line(pointer, state, pointing, rotator, carrier) + elements.told(now))
                status.flush()
            tick = max(tick + 1.0 / file.beam.rate_hz, now)
    except KeyboardInterrupt:
        pass
    finally:
        for source in inputs:
            feed.counts["overflow"] += source.overflow()
            source.close()
        if out is not None:
            out.close()
        if stream is not None:
            stream.close()
        if rotator is not None:
            rotator.close()
        if status is not None:
            status.write("\n")
    spent, wall = time.process_time() - busy, max(clock() - begun, 1e-9)
    told = {"latency_mean_s": total / max(answers, 1), "latency_max_s": latency, "core_share": spent / wall}
    found: dict[str, Any] = {
        "ticks": ticks,
        **told,
        **feed.counts,
        **elements.counts,
        "faults": dict(elements.faults),
    }
    return found | (rotator.summary(clock()) if rotator else {})


def _rotator(station: Station) -> Rotator | None:
    out = station.file.output
    if not out.rotctld:
        return None
    return Rotator(out.rotctld, station.mount, math.radians(out.dead_band_deg), 1.0 / out.command_rate_hz)


def steady(carrier: Navigation | None, p: Pointing) -> bool:
    """Return whether the mount's way can be foretold: it stands on the ground and does not search."""
    return carrier is None and p.mode in (Mode.FUSED, Mode.OWN, Mode.COAST, Mode.BELOW_HORIZON)


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
    best = int(state.guide.clock[3])
    biased = f"  {pointer.guide.sources[best - 1].id} is biased" if best else ""
    where = "" if rotator is None else f"  {rotator.told(p.t)}"
    aim = f"az {math.degrees(p.aim.azimuth):8.3f} el {math.degrees(p.aim.elevation):7.3f}"
    error = f"σ {math.degrees(p.aim.sigma):.3f}° P {p.aim.p_in_beam:.2f}"
    turned = "" if carrier is None else f"  {carrier.name} {carrier.age(p.t):.1f}s"
    return f"{p.mode:6s} {aim} {error}  {sources}{turned}{biased}{where}   "


def _inputs(station: Station) -> list[Input]:
    wanted = station.file.input
    inputs: list[Input] = []
    if wanted.udp:
        inputs.append(Udp(wanted.udp, PER_READ))
    if wanted.tcp:
        inputs.append(Tcp(wanted.tcp, PER_READ))
    if wanted.serial:
        inputs.append(Serial(wanted.serial, wanted.baud, PER_READ))
    if not inputs and not station.elements:
        raise UserError("the site file has no [input]: give udp, tcp or serial, or use --replay")
    return inputs


def _wait(inputs: list[Input], longest: float) -> None:
    """Sleep until something arrives or `longest` (s) has passed."""
    files = [f for source in inputs for f in source.files()]
    asked = any(not source.files() for source in inputs)
    select.select(files, [], [], min(longest, POLL) if asked else longest)


def _warm(pointer: Pointer) -> PointerState:
    """Compile the kernels before the first report, on a filter that is thrown away."""
    scratch = pointer.init()
    here = np.array([7e6, 0.0, 0.0])
    for source, s in enumerate(pointer.guide.sources):
        z = np.array([0.1, 0.2, 1e5]) if s.kind == DIRECTION else here
        pointer.take(scratch, source, 0.0, z, 0.9 * here, np.eye(3))
        pointer.tick(scratch, 0.5)
    return pointer.init()
