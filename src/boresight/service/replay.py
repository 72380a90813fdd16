"""A recording through the pointing chain: what `boresight point --replay` does."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from boresight.errors import UserError, did_you_mean
from boresight.frames.array_face import enu_from_face
from boresight.frames.local import ecef_from_enu, ecef_from_enu_rotation
from boresight.frames.pose import PoseTrack, pose_track, sensor_pose
from boresight.io.scans import iter_scans
from boresight.kernels.guide import DIRECTION
from boresight.pointing.pointer import Place, Pointer, PointerState, Pointing
from boresight.service.elements import Elements
from boresight.types import Component, FloatArray, Recording, Scan

FRD_FROM_RFU = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
POSITION = slice(Component.EAST, Component.UP + 1)


def replay(
    pointer: Pointer,
    recording: Recording,
    rate: float,
    platform: str | None = None,
    elements: Elements | None = None,
) -> Iterator[tuple[Pointing, PointerState]]:
    """Yield a command at every tick of `rate` (Hz), from what had arrived by then; live and replay are one chain.

    `platform` carries the antenna: its pose is foretold to the aim time from the navigation data known at the tick,
    and the face is turned with it. Raises UserError for a platform that the recording does not have, or one without
    attitude.

    Of a look with several detections the one nearest to the prediction is taken (before there is one: the first).
    """
    tracks = {p.id: pose_track(p, recording.site) for p in recording.platforms}
    carrier = _carrier(tracks, platform)
    state = pointer.init()
    first = recording.detections.t_recv[0] if len(recording.detections) else 0.0
    k, tick = 0, float(first)
    for scan in iter_scans(recording):
        while tick < scan.t_recv:
            if elements is not None:
                elements.report(state, tick)
            state, out = pointer.tick(state, tick, _place(pointer, carrier, tick))
            if out is not None:
                yield out, state
            k += 1
            tick = float(first) + k / rate
        sensor = recording.sensors[scan.sensor]
        track = tracks.get(sensor.platform) if sensor.platform is not None else None
        t = scan.t - sensor.latency
        if not len(t) or (track is not None and not track.usable(t, attitude=track.has_attitude).all()):
            continue
        origin, _, enu_from_sensor = sensor_pose(sensor, track, t)
        report = _chosen(pointer, state, scan, t, origin, enu_from_sensor, recording)
        if report is not None:
            pointer.take(state, scan.sensor, *report)
    state, out = pointer.tick(state, tick, _place(pointer, carrier, tick))
    if out is not None:
        yield out, state


def _carrier(tracks: dict[str, PoseTrack], platform: str | None) -> PoseTrack | None:
    if platform is None:
        return None
    if platform not in tracks:
        raise UserError(f"the recording has no platform '{platform}'{did_you_mean(platform, tracks)}")
    if not tracks[platform].has_attitude:
        raise UserError(f"platform '{platform}' has no attitude: it cannot carry the antenna")
    return tracks[platform]


def _place(pointer: Pointer, carrier: PoseTrack | None, t: float) -> Place | None:
    if carrier is None:
        return None
    pose = carrier.until(t).at(t + pointer.lead)
    e, n, u = (float(v) for v in pose.position)
    enu_from_rfu = pose.enu_from_body @ FRD_FROM_RFU
    return Place(np.array(ecef_from_enu(e, n, u, pointer.site)), enu_from_rfu @ enu_from_face(*pointer.face))


def _chosen(
    pointer: Pointer,
    state: PointerState,
    scan: Scan,
    t: FloatArray,
    origin: FloatArray,
    axes: FloatArray,
    rec: Recording,
) -> tuple[float, FloatArray, FloatArray, FloatArray] | None:
    R = ecef_from_enu_rotation(rec.site)
    where = np.stack(ecef_from_enu(origin[:, 0], origin[:, 1], origin[:, 2], rec.site), axis=-1)
    best, least = None, math.inf
    for i in range(len(t)):
        turn = R @ axes[i]
        z = _report(scan.z[i], pointer.guide.sources[scan.sensor].kind, where[i], turn)
        if z is None:
            continue
        far = _distance(pointer, state, float(t[i]), z, where[i], turn, pointer.guide.sources[scan.sensor].kind)
        if best is None or far < least:
            best, least = (float(t[i]), z, where[i], turn), far
    return best


def _report(z: FloatArray, kind: int, origin: FloatArray, turn: FloatArray) -> FloatArray | None:
    if kind == DIRECTION:
        if math.isnan(z[Component.AZIMUTH]):
            return None
        return np.array([z[Component.AZIMUTH], np.nan_to_num(z[Component.ELEVATION]), z[Component.RANGE]])
    local = np.nan_to_num(z[POSITION], nan=0.0)
    if math.isnan(z[Component.EAST]):
        return None
    out: FloatArray = origin + turn @ local
    return out


def _distance(
    pointer: Pointer, state: PointerState, t: float, z: FloatArray, origin: FloatArray, turn: FloatArray, kind: int
) -> float:
    """Return how far a report lies from the prediction (rad, or m for positions); 0 before there is one."""
    predicted = pointer.guide.predict(state.guide, t)
    if predicted is None:
        return 0.0
    if kind != DIRECTION:
        return float(np.linalg.norm(z - predicted.position))
    d = turn.T @ (predicted.position - origin)
    c = math.cos(z[1])
    u = np.array([c * math.sin(z[0]), c * math.cos(z[0]), math.sin(z[1])])
    return float(np.arccos(np.clip(u @ d / np.linalg.norm(d), -1.0, 1.0)))
