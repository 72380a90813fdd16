"""Two targets in one detection: a second bearing begins a track beside a shown one, and a blob places what is in it."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from boresight.kernels.measurement import measure, wrap
from boresight.kernels.options import LEAF, PART
from boresight.kernels.tracker import (
    INITIATED,
    NOTHING,
    UPDATED,
    VISIBLE,
    IntArray,
    Look,
    Models,
    SensorTable,
    Settings,
    Tracks,
)
from boresight.kernels.tracker_begin import new_track, pooled_constants, tell
from boresight.kernels.tracker_models import begin_models
from boresight.kernels.tracker_place import within
from boresight.kernels.tracker_workroom import Workroom
from boresight.types.sensor import FloatArray

BELIEVED = 0.2  # least probability to be something with which a track accounts for a second bearing
OFFSET_LEAST = 5.0  # m: bearings of one target err by as much together, however many there are
VELOCITY_SHARE = 0.25  # of the prior speed: how two targets in one blob may differ


@njit(**LEAF)
def unplaced(tr: Tracks) -> bool:
    """Whether there is a track that only bearings have told of."""
    found = False
    for i in range(tr.live[0]):
        found = found or tr.heard[i] == 0
    return found


@njit(**PART)
def begin_beside(
    tr: Tracks,
    s: Settings,
    sensor: SensorTable,
    look: Look,
    fate: IntArray,
    owner: IntArray,
    usable: NDArray[np.bool_],
    room: Workroom,
    models: Models | None,
) -> None:
    """Begin a track where two bearings stand within the angular extent that a shown track's blob may have.

    The nearer one is the shown track's; the other's place is as far from it as the two bearings are apart, at the
    blob's range with half its size as spread. Nothing begins where another track nearby accounts for the bearing.
    """
    last = len(look.dt)
    z = room.z
    for host in range(tr.live[0]):
        if tr.life[host, 2] == 0.0 or tr.heard[host] == 0 or accompanied(tr, host, s):
            continue
        see(tr, host, s, look, room)
        if not within(z[0], z[1], z[2], sensor, 0.0):
            continue
        extent = math.atan2(s.blob, z[0])
        own = nearest_bearing(look, usable, z[1], extent)
        if own < 0:
            continue
        for k in range(last):
            gap = wrap(look.z[k, 1] - look.z[own, 1])
            noise = math.sqrt(look.R[k, 1, 1] + look.R[own, 1, 1])
            least = max(4.0 * noise, s.merge_distance / z[0])
            free = usable[k] and fate[k] != INITIATED and fate[k] != UPDATED
            if free and least < abs(gap) <= extent + 2.0 * noise:
                place_beside(tr, host, s, sensor, look, k, z, gap, noise, models)
                fate[k] = INITIATED
                owner[k] = look.row[k]
                break


@njit(**LEAF)
def see(tr: Tracks, i: int, s: Settings, look: Look, room: Workroom) -> None:
    """Fill `room.z` with where track `i` stands in the sensor's axes."""
    last = len(look.dt)
    for a in range(s.d):
        room.sight[0, a] = tr.x[i, a]
    own, moving, axes = look.sensor_position[last], look.sensor_velocity[last], look.enu_from_sensor[last]
    measure(room.sight[0], room.sight[1], own, moving, axes, room.z, room.h6)


@njit(**LEAF)
def accompanied(tr: Tracks, host: int, s: Settings) -> bool:
    """Whether a track that may be something stands where a second target in the blob of `host` could be."""
    for j in range(tr.live[0]):
        if j == host or (tr.heard[j] > 0 and 1.0 - tr.weight[j, NOTHING] < BELIEVED):
            continue
        gap = 0.0
        for a in range(s.d):
            gap += (tr.x[j, a] - tr.x[host, a]) ** 2
        if gap < 4.0 * s.blob**2:
            return True
    return False


@njit(**LEAF)
def nearest_bearing(look: Look, usable: NDArray[np.bool_], azimuth: float, reach: float) -> int:
    """Return the detection whose azimuth is nearest to `azimuth`, -1 where none is within `reach` (rad)."""
    best = -1
    for k in range(len(look.dt)):
        gap = abs(wrap(look.z[k, 1] - azimuth))
        if usable[k] and gap <= reach:
            best, reach = k, gap
    return best


@njit(**PART)
def place_beside(
    tr: Tracks,
    host: int,
    s: Settings,
    sensor: SensorTable,
    look: Look,
    k: int,
    z: FloatArray,
    gap: float,
    noise: float,
    models: Models | None,
) -> None:
    """Add a track `gap` (rad) in azimuth from `host`, which is at `z` (range, azimuth, elevation, sensor axes)."""
    d = s.d
    E = look.enu_from_sensor[k]
    along = np.empty(3)
    across = np.empty(3)
    az, ce, se = z[1] + gap, math.cos(z[2]), math.sin(z[2])
    for a in range(3):
        along[a] = E[a, 0] * ce * math.sin(az) + E[a, 1] * ce * math.cos(az) + E[a, 2] * se
        across[a] = E[a, 0] * math.cos(az) - E[a, 1] * math.sin(az)
    wide = OFFSET_LEAST**2 + (z[0] * noise) ** 2
    deep = (0.5 * s.blob) ** 2
    i = new_track(tr, s, look, k, 0)
    tell(tr, i, s, pooled_constants(tr, s))
    tr.beside[i] = tr.birth[host]
    for a in range(d):
        tr.anchor[i, a] = look.sensor_position[k, a] + z[0] * along[a] - tr.x[host, a]
        for b in range(d):
            tr.anchor_P[i, a, b] = deep * along[a] * along[b] + wide * across[a] * across[b]
    join(tr, i, host, s)
    if models is not None:
        begin_models(tr, i, models)
        join_models(tr, i, host, s)
    w = tr.weight[i]
    w[:] = 0.0
    w[VISIBLE] = s.blob_share
    w[NOTHING] = 1.0 - s.blob_share


@njit(**PART)
def keep_beside(
    tr: Tracks,
    s: Settings,
    sensor: SensorTable,
    look: Look,
    col_of_row: IntArray,
    usable: NDArray[np.bool_],
    room: Workroom,
    models: Models | None,
) -> None:
    """Move the tracks that only bearings tell of along with the track beside which they stand, and end lost ones.

    Their place relative to it (`anchor`) is measured by the difference of two bearings of one look, in which what both
    have in common cancels. One that is not beside it any more, or would be one with it, is nothing.
    """
    z = room.z
    for i in range(tr.live[0]):
        if tr.heard[i] != 0:
            continue
        host = -1
        for j in range(tr.live[0]):
            if tr.birth[j] == tr.beside[i] and tr.life[j, 2] > 0.0:
                host = j
        if host >= 0 and not sensor.ranging and i < len(col_of_row) and col_of_row[i] >= 0:
            see(tr, host, s, look, room)
            own = nearest_bearing(look, usable, z[1], math.atan2(s.blob, z[0]))
            if own >= 0 and own != col_of_row[i]:
                shift(tr, i, s, sensor, look, col_of_row[i], own, z)
        gap = 0.0
        for a in range(s.d):
            gap += tr.anchor[i, a] ** 2
        if host < 0 or not s.merge_distance**2 <= gap <= (1.5 * s.blob) ** 2:
            tr.weight[i, :] = 0.0
            tr.weight[i, NOTHING] = 1.0
        else:
            join(tr, i, host, s)
            if models is not None:
                join_models(tr, i, host, s)


@njit(**PART)
def shift(tr: Tracks, i: int, s: Settings, sensor: SensorTable, look: Look, k: int, own: int, z: FloatArray) -> None:
    """Measure how far track `i` stands across the line of sight from the one at `z` that has bearing `own`."""
    E = look.enu_from_sensor[k]
    across = np.zeros(s.d)
    Pa = np.zeros(s.d)
    measured = z[0] * math.sin(wrap(look.z[k, 1] - look.z[own, 1]))
    for a in range(s.d):
        across[a] = E[a, 0] * math.cos(z[1]) - E[a, 1] * math.sin(z[1])
        measured -= across[a] * tr.anchor[i, a]
    variance = 0.0
    for a in range(s.d):
        for b in range(s.d):
            Pa[a] += tr.anchor_P[i, a, b] * across[b]
        variance += across[a] * Pa[a]
    # errors that wander slowly: together these looks are worth no more than OFFSET_LEAST
    gain = 1.0 / (variance + 10.0 * OFFSET_LEAST**2)
    for a in range(s.d):
        tr.anchor[i, a] += gain * Pa[a] * measured
    if variance > OFFSET_LEAST**2:
        for a in range(s.d):
            for b in range(s.d):
                tr.anchor_P[i, a, b] -= gain * Pa[a] * Pa[b]


@njit(**LEAF)
def join(tr: Tracks, i: int, host: int, s: Settings) -> None:
    """Put track `i` at its place beside `host`, moving as that does."""
    join_state(tr.x[i], tr.P[i], tr.x[host], tr.P[host], tr.anchor[i], tr.anchor_P[i], s)


@njit(**LEAF)
def join_models(tr: Tracks, i: int, host: int, s: Settings) -> None:
    """The same for the states of the models; track `i` manoeuvres as `host` does."""
    for j in range(tr.mode.shape[1]):
        tr.mode[i, j] = tr.mode[host, j]
        x, P = tr.mode_x[host, j], tr.mode_P[host, j]
        join_state(tr.mode_x[i, j], tr.mode_P[i, j], x, P, tr.anchor[i], tr.anchor_P[i], s)


@njit(**LEAF)
def join_state(
    x: FloatArray,
    P: FloatArray,
    host_x: FloatArray,
    host_P: FloatArray,
    offset: FloatArray,
    offset_P: FloatArray,
    s: Settings,
) -> None:
    """Give (x, P) the place `offset` (d,) from the host's, and its velocity."""
    d = s.d
    for a in range(d):
        x[a] = host_x[a] + offset[a]
        x[d + a] = host_x[d + a]
        for b in range(d):
            P[a, b] = host_P[a, b] + offset_P[a, b]
            P[d + a, d + b] = host_P[d + a, d + b]
            P[a, d + b] = host_P[a, d + b]
            P[d + b, a] = host_P[a, d + b]
        P[d + a, d + a] += (VELOCITY_SHARE * s.speed_sigma) ** 2
