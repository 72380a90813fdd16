"""What the tracker has learned of its sensors' constant errors, in numbers and in words."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from boresight.kernels.registration import AZIMUTH, ELEVATION, RANGE, SCALE, TIME
from boresight.kernels.tracker import Tracks
from boresight.kernels.tracker_scan import pooled_constants
from boresight.tracking.core import Plan

NAMES = {
    TIME: "time_offset_s",
    RANGE: "range_offset_m",
    SCALE: "range_scale",
    AZIMUTH: "azimuth_offset_rad",
    ELEVATION: "elevation_offset_rad",
}
OBSERVABLE, WEAKLY, NOT = "observable", "weakly observable", "not observable"


class Constant(NamedTuple):
    """One constant error of one sensor: reported minus true, with its standard deviation, SI."""

    sensor: str
    parameter: str  # one of NAMES
    value: float
    sigma: float
    declared: float  # standard deviation before any report
    verdict: str


def verdict_of(sigma: float, declared: float) -> str:
    """Say what the geometry tells: below a third of the declared spread is observable, above 0.8 of it is not."""
    share = sigma / declared
    return OBSERVABLE if share < 1.0 / 3.0 else WEAKLY if share < 0.8 else NOT


def constants_of(tracks: Tracks, plan: Plan, sensor_ids: tuple[str, ...]) -> list[Constant]:
    """Return the pooled estimate of every declared constant error; empty where none is declared."""
    s = plan.settings
    k = s.n_constant
    if k == 0:
        return []
    pooled = pooled_constants(tracks, s)
    covariance = np.linalg.inv(pooled[:, :k])
    mean = covariance @ pooled[:, k]
    first = plan.n_states - k
    out = []
    for table in plan.sensors:
        for parameter, state in enumerate(table.constant.tolist()):
            if state >= 0:
                a = state - first
                declared = float(s.bias_sigma[len(s.bias_sigma) - k + a])
                sigma = float(np.sqrt(covariance[a, a]))
                out.append(
                    Constant(
                        sensor_ids[table.number],
                        NAMES[parameter],
                        float(mean[a]),
                        sigma,
                        declared,
                        verdict_of(sigma, declared),
                    )
                )
    return out
