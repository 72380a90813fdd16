"""Looks laid end to end and sensors as columns: how many of either reach the kernel in one call."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from boresight.kernels.options import LEAF
from boresight.kernels.tracker import IntArray, Look, SensorTable
from boresight.types.sensor import FloatArray

NO_SENSOR = -1  # an arrival without a look: time has gone on
NO_LOOK = -2  # no arrival either: only the rows due until then are wanted
PER_LOOK = ("t", "arrival", "sensor", "number")  # fields of `Looks`, and what one place in each stands for
PER_DETECTION = ("dt", "z", "R", "row", "address")
PER_POSE = ("position", "velocity", "axes")


class Looks(NamedTuple):
    """L looks with M detections in all; those of look k are `first[k]` to `first[k + 1]`.

    Poses: one for every detection and after them one for the look itself, from `first[k] + k` on.
    """

    t: FloatArray  # (L,) s, validity of the look; NaN where the sensor's pose is not known
    arrival: FloatArray  # (L,) s
    sensor: IntArray  # (L,) NO_SENSOR for none
    number: IntArray  # (L,) in order of arrival, for ever
    first: IntArray  # (L + 1,)
    dt: FloatArray  # (M,) s, own time of each detection minus t
    z: FloatArray  # (M, 7)
    R: FloatArray  # (M, 7, 7)
    row: IntArray  # (M,)
    address: IntArray  # (M,)
    position: FloatArray  # (M + L, 3) m
    velocity: FloatArray  # (M + L, 3) m/s
    axes: FloatArray  # (M + L, 3, 3) enu_from_sensor


@njit(**LEAF)
def look_at(looks: Looks, k: int) -> Look:
    """Return one look; its arrays are views."""
    a, b = looks.first[k], looks.first[k + 1]
    p, q = a + k, b + k + 1
    return Look(
        looks.t[k], looks.dt[a:b], looks.z[a:b], looks.R[a:b], looks.row[a:b], looks.address[a:b],
        looks.position[p:q], looks.velocity[p:q], looks.axes[p:q],
    )  # fmt: skip


def columns_of(tables: tuple[SensorTable, ...]) -> SensorTable:
    """Return all sensors in one table whose fields have a leading axis; `sensor_at` takes one out."""
    return SensorTable._make(np.array([table[i] for table in tables]) for i in range(len(SensorTable._fields)))


@njit(**LEAF)
def sensor_at(sensors: Any, i: int) -> SensorTable:
    """Return sensor i of a table made by `columns_of`."""
    return SensorTable(
        sensors.number[i],
        sensors.p_detection[i],
        sensors.clutter_per_scan[i],
        sensors.range_low[i],
        sensors.range_high[i],
        sensors.azimuth_low[i],
        sensors.azimuth_span[i],
        sensors.elevation_low[i],
        sensors.elevation_high[i],
        sensors.ranging[i],
        sensors.bias[i],
        sensors.registers[i],
        sensors.constant[i],
        sensors.decorrelation[i],
        sensors.fade_range[i],
        sensors.resolution[i],
        sensors.moves_tracks[i],
        sensors.sees_static[i],
        sensors.sees_targets[i],
        sensors.witness[i],
        sensors.gate_width[i],
        sensors.joint[i],
        sensors.single[i],
        sensors.interval[i],
        sensors.spoken[i],
        sensors.wrong_id[i],
        sensors.height[i],
        sensors.height_sigma[i],
    )


def no_looks() -> Looks:
    """Return none."""
    return Looks(
        np.zeros(0), np.zeros(0), np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(1, np.int64), np.zeros(0),
        np.zeros((0, 7)), np.zeros((0, 7, 7)), np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros((0, 3)),
        np.zeros((0, 3)), np.zeros((0, 3, 3)),
    )  # fmt: skip


def moment(t_recv: float, sensor: int = NO_SENSOR) -> Looks:
    """Return a time (s) without a look: of an arrival (`NO_SENSOR`), or at which rows are wanted (`NO_LOOK`)."""
    return no_looks()._replace(
        t=np.full(1, np.nan), arrival=np.full(1, t_recv), sensor=np.full(1, sensor), number=np.zeros(1, np.int64),
        first=np.zeros(2, np.int64), position=np.zeros((1, 3)), velocity=np.zeros((1, 3)), axes=np.zeros((1, 3, 3)),
    )  # fmt: skip


def room_for(looks: int, detections: int) -> Looks:
    """Return room for so many looks with so many detections in all; nothing is filled in but `first[0]`."""
    one = no_looks()
    count = dict.fromkeys(PER_LOOK, looks) | dict.fromkeys(PER_DETECTION, detections) | {"first": looks + 1}
    count |= dict.fromkeys(PER_POSE, looks + detections)
    out = Looks(**{name: np.empty((count[name], *a.shape[1:]), a.dtype) for name, a in one._asdict().items()})
    out.first[0] = 0
    return out


def front(looks: Looks, n: int) -> Looks:
    """Return the first `n` looks; the arrays are views."""
    m = int(looks.first[n])
    count = dict.fromkeys(PER_LOOK, n) | dict.fromkeys(PER_DETECTION, m) | dict.fromkeys(PER_POSE, n + m)
    return Looks(first=looks.first[: n + 1], **{name: getattr(looks, name)[:c] for name, c in count.items()})


def put_behind(room: Looks, n: int, more: Looks) -> None:
    """Write looks behind the first `n` of a table with room for them."""
    k, a, m = len(more.t), int(room.first[n]), len(more.dt)
    for name in PER_LOOK:
        getattr(room, name)[n : n + k] = getattr(more, name)
    for name in PER_DETECTION:
        getattr(room, name)[a : a + m] = getattr(more, name)
    for name in PER_POSE:
        getattr(room, name)[a + n : a + n + m + k] = getattr(more, name)
    room.first[n : n + k + 1] = a + more.first


def chosen(looks: Looks, which: IntArray, room: Looks) -> IntArray:
    """Write the looks `which` (k,), in that order, into `room`; returns the places that their detections had."""
    at, poses, first = places_of_looks(looks, which)
    room.first[: len(first)] = first
    for names, places in ((PER_LOOK, which), (PER_DETECTION, at), (PER_POSE, poses)):
        for name in names:  # "clip": without it, Numpy makes the array apart and copies it
            np.take(getattr(looks, name), places, axis=0, out=getattr(room, name)[: len(places)], mode="clip")
    return at


def places_of_looks(looks: Looks, which: IntArray) -> tuple[IntArray, IntArray, IntArray]:
    """Return where the detections and the poses of the looks `which` (k,) stand, and `first` (k + 1,) for these."""
    if len(which) == len(looks.t) and (which[1:] > which[:-1]).all():
        m = int(looks.first[-1])
        return np.arange(m), np.arange(m + len(which)), looks.first
    count = looks.first[which + 1] - looks.first[which]
    first = np.concatenate([[0], np.cumsum(count)])
    detections = _ranges(looks.first[which], count, first)
    return detections, _ranges(looks.first[which] + which, count + 1, first + np.arange(len(first))), first


def _ranges(start: NDArray[np.int64], count: NDArray[np.int64], first: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return start[k], start[k] + 1 … for every k, `count[k]` of each; `first` are the sums of the counts."""
    return np.arange(first[-1]) + np.repeat(start - first[:-1], count)
