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
    position: FloatArray  # (M + L, 3) m
    velocity: FloatArray  # (M + L, 3) m/s
    axes: FloatArray  # (M + L, 3, 3) enu_from_sensor


@njit(**LEAF)
def look_at(looks: Looks, k: int) -> Look:
    """Return one look; its arrays are views."""
    a, b = looks.first[k], looks.first[k + 1]
    p, q = a + k, b + k + 1
    return Look(
        looks.t[k], looks.dt[a:b], looks.z[a:b], looks.R[a:b], looks.row[a:b],
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
        sensors.report_range[i],
        sensors.moves_tracks[i],
        sensors.joint[i],
    )


def no_looks() -> Looks:
    """Return none."""
    return Looks(
        np.zeros(0), np.zeros(0), np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(1, np.int64), np.zeros(0),
        np.zeros((0, 7)), np.zeros((0, 7, 7)), np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 3)),
        np.zeros((0, 3, 3)),
    )  # fmt: skip


def moment(t_recv: float) -> Looks:
    """Return an arrival (s) without a look."""
    return no_looks()._replace(
        t=np.full(1, np.nan), arrival=np.full(1, t_recv), sensor=np.full(1, NO_SENSOR), number=np.zeros(1, np.int64),
        first=np.zeros(2, np.int64), position=np.zeros((1, 3)), velocity=np.zeros((1, 3)), axes=np.zeros((1, 3, 3)),
    )  # fmt: skip


def joined(parts: list[Looks]) -> Looks:
    """Return the looks of all parts, in their order."""
    out = [np.concatenate(columns) for columns in zip(*parts, strict=True)]
    shift = np.cumsum([0] + [len(p.dt) for p in parts])
    first = [p.first[:-1] + s for p, s in zip(parts, shift)] + [shift[-1:]]
    out[Looks._fields.index("first")] = np.concatenate(first)
    return Looks(*out)


def chosen(looks: Looks, which: IntArray) -> tuple[Looks, IntArray]:
    """Return the looks `which` (k,), in that order, and the places that their detections had."""
    at, poses, first = places_of_looks(looks, which)
    per_look = {name: getattr(looks, name)[which] for name in ("t", "arrival", "sensor", "number")}
    per_detection = {name: getattr(looks, name)[at] for name in ("dt", "z", "R", "row")}
    per_pose = {name: getattr(looks, name)[poses] for name in ("position", "velocity", "axes")}
    return Looks(first=first, **per_look, **per_detection, **per_pose), at


def places_of_looks(looks: Looks, which: IntArray) -> tuple[IntArray, IntArray, IntArray]:
    """Return where the detections and the poses of the looks `which` (k,) stand, and `first` (k + 1,) for these."""
    if len(which) == len(looks.t) and (which[1:] > which[:-1]).all():
        return np.arange(len(looks.dt)), np.arange(len(looks.position)), looks.first
    count = looks.first[which + 1] - looks.first[which]
    first = np.concatenate([[0], np.cumsum(count)])
    detections = _ranges(looks.first[which], count, first)
    return detections, _ranges(looks.first[which] + which, count + 1, first + np.arange(len(first))), first


def _ranges(start: NDArray[np.int64], count: NDArray[np.int64], first: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return start[k], start[k] + 1 … for every k, `count[k]` of each; `first` are the sums of the counts."""
    return np.arange(first[-1]) + np.repeat(start - first[:-1], count)
