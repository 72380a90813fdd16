"""How dense false detections are: what is declared, what the looks so far have taught."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from boresight.kernels.options import LEAF, PART
from boresight.kernels.tracker import AZIMUTH_BINS, NOTHING, STATIC, IntArray, Look, SensorTable, Settings, Tracks
from boresight.kernels.tracker_place import volume_of
from boresight.kernels.tracker_state import components
from boresight.types.sensor import FloatArray


@njit(**LEAF)
def azimuth_bin(azimuth: float) -> int:
    """Return the clutter-map bin of an azimuth (rad)."""
    return int((azimuth + math.pi) / (2.0 * math.pi) * AZIMUTH_BINS) % AZIMUTH_BINS


@njit(**LEAF)
def clutter_density(tr: Tracks, s: Settings, sensor: SensorTable, z: FloatArray, mask: IntArray, m: int) -> float:
    """Expected false detections per unit volume of the measured components around `z`, as learned so far."""
    known = tr.clutter[sensor.number]
    high = sensor.range_high
    if not math.isfinite(high):  # nothing declared: twice what was seen, at least 100 s at the prior speed
        high = max(2.0 * tr.seen_range[sensor.number], 100.0 * s.speed_sigma)
    volume = volume_of(mask, m, sensor, high, s.d, s.speed_sigma)
    if sensor.ranging:
        return float(known[AZIMUTH_BINS] / volume)
    share = 2.0 * math.pi / AZIMUTH_BINS / max(sensor.azimuth_span, 1e-9)
    b = azimuth_bin(z[1])
    local = (known[(b - 1) % AZIMUTH_BINS] + 2.0 * known[b] + known[(b + 1) % AZIMUTH_BINS]) / 4.0
    return float(local / (volume * share))


@njit(**PART)
def log_densities(tr: Tracks, s: Settings, sensor: SensorTable, look: Look, out: FloatArray) -> int:
    """Fill the log clutter density at every detection (m,); returns the largest number of components."""
    most = 0
    mask = np.full(7, -1, np.int64)
    before = np.full(7, -1, np.int64)
    count = -1  # of the components before
    value = 0.0
    for k in range(len(look.dt)):
        c = components(look.z[k], s.d, mask)
        most = max(most, c)
        # for ranging sensors it depends on which components are measured alone
        same = sensor.ranging and c == count
        for j in range(c):
            same = same and mask[j] == before[j]
            before[j] = mask[j]
        count = c
        if not same:
            value = math.log(max(clutter_density(tr, s, sensor, look.z[k], mask, c), 1e-300))
        out[k] = value
    return most


@njit(**PART)
def learn_clutter(
    tr: Tracks,
    s: Settings,
    sensor: SensorTable,
    look: Look,
    claims: IntArray,
    row_of_col: IntArray,
    usable: NDArray[np.bool_],
) -> None:
    """Let the detections that no shown track took teach the mean number of false detections of a look."""
    known = tr.clutter[sensor.number]
    m = len(look.dt)
    forget = 1.0 / s.clutter_memory
    for b in range(AZIMUTH_BINS + 1):
        known[b] *= 1.0 - forget
    floor = 0.05 * sensor.clutter_per_scan
    for k in range(m):
        i = row_of_col[k]
        far = look.z[k, 0] if math.isfinite(look.z[k, 0]) else math.hypot(look.z[k, 4], look.z[k, 5])
        if far > tr.seen_range[sensor.number]:
            tr.seen_range[sensor.number] = far
        if not usable[k]:
            continue
        share = 1.0
        if i < 0 and claims[k] > 0:
            share = 0.0
        elif i >= 0:
            share = tr.weight[i, NOTHING]
            if sensor.ranging and not sensor.single:  # what stands and does not send is fixed clutter
                share += tr.weight[i, STATIC]
        if not math.isnan(look.z[k, 1]):
            known[azimuth_bin(look.z[k, 1])] += forget * share
        known[AZIMUTH_BINS] += forget * share
    known[AZIMUTH_BINS] = max(known[AZIMUTH_BINS], floor)
    for b in range(AZIMUTH_BINS):
        known[b] = max(known[b], floor / AZIMUTH_BINS)
