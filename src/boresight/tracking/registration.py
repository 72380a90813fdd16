"""What the tracker has learned of its sensors' constant errors, in numbers and in words."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from boresight.kernels.registration import AZIMUTH, ELEVATION, RANGE, SCALE, TIME
from boresight.kernels.tracker import Tracks
from boresight.kernels.tracker_begin import pooled_constants
from boresight.tracking.core import Plan
from boresight.tracking.tracker import Tracker, TrackerState
from boresight.types import RegistrationRows

# name with its unit, and SI units in one of it
PARAMETERS = {
    TIME: ("time_offset_s", 1.0),
    RANGE: ("range_offset_m", 1.0),
    SCALE: ("range_scale", 1.0),
    AZIMUTH: ("azimuth_offset_deg", math.pi / 180.0),
    ELEVATION: ("elevation_offset_deg", math.pi / 180.0),
}
INTERVAL = 1.0  # s between two rows of one parameter
OBSERVABLE, WEAKLY, NOT = "observable", "weakly observable", "not observable"


class Constant(NamedTuple):
    """One constant error of one sensor: reported minus true, with its standard deviation, in the parameter's unit."""

    sensor: str
    parameter: str  # one of PARAMETERS, the unit at its end
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
                name, unit = PARAMETERS[parameter]
                verdict = verdict_of(sigma, declared)
                value = float(mean[a]) / unit
                out.append(Constant(sensor_ids[table.number], name, value, sigma / unit, declared / unit, verdict))
    return out


@dataclass(slots=True)
class Diary:
    """What is known of the constant errors every second; call `note` from the `watch` of `run`."""

    tracker: Tracker
    times: list[float] = field(default_factory=list)
    known: list[list[Constant]] = field(default_factory=list)

    def note(self, state: TrackerState, last: bool = False) -> None:
        """Remember what the state holds, at most once a second (`last`: in any case)."""
        t = state.arrival
        if not self.times or t - self.times[-1] >= INTERVAL or last:
            ids = tuple(s.id for s in self.tracker.sensors)
            self.times.append(t)
            self.known.append(constants_of(state.window.tracks, self.tracker.plan, ids))

    def rows(self) -> RegistrationRows:
        """Return everything noted as columns."""
        flat = [(t, *c) for t, known in zip(self.times, self.known, strict=True) for c in known]
        columns = list(zip(*flat, strict=True)) if flat else [()] * 7
        t, sensor, parameter, value, sigma, declared, verdict = columns
        words = [np.array(c, dtype=object) for c in (sensor, parameter, verdict)]
        return RegistrationRows(
            np.array(t), words[0], words[1], np.array(value), np.array(sigma), np.array(declared), words[2]
        )
