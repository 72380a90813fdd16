"""The paper's sensors as it lists them: radar with range, azimuth and range rate, infrared with a temperature.

Two targets meet 400 m away, fly side by side less than a metre apart for some seconds, and part again on the sides
they came from; one is 10 K warmer. No report says which target it is of: each look's two reports are given to the two
tracks by their likelihood. The radar tells no elevation; the temperature (sigma 0.7 K) has a belief of its own and no
part in the kinematic state. Scored over 5-30 s; `swapped` is the share of that time with the tracks on each other's
target.
"""

from __future__ import annotations

from math import radians
from typing import Any, NamedTuple

import numpy as np

from boresight.filters import ekf
from boresight.filters.attribute import Attribute, AttributeState
from boresight.models import Infrared, NearlyConstantAcceleration, Radar
from boresight.papers.montecarlo import finite, nees, rms
from boresight.types.sensor import FloatArray
from boresight.types.state import GaussianState

DURATION, SCORED_FROM = 30.0, 5.0  # s
MEETING, CLOSEST, CURVE = 15.0, 0.3, 0.02  # s, m, m/s²: half the separation's second derivative
TEMPERATURES = (300.0, 310.0)  # K
TEMPERATURE = Attribute(sigma=0.5**0.5, spread=30.0, mean=300.0)
RADAR = Radar(1.0, radians(0.2), sigma_range_rate=0.2)
RADAR_WITHOUT = Radar(1.0, radians(0.2))
IR = Infrared(radians(0.1), radians(0.1))
MOTION = NearlyConstantAcceleration(0.01)
MOST_RUNS = 50  # each takes some tenths of a second


def paths(t: float) -> FloatArray:
    """Return the true states (2, 9) at `t`: position, velocity, acceleration."""
    s = t - MEETING
    out = np.zeros((2, 9))
    for target, side in enumerate((-0.5, 0.5)):
        out[target] = [side * (CLOSEST + CURVE * s * s), 400.0 + 3.0 * s, 40.0, side * 2 * CURVE * s, 3.0, 0.0,
                       side * 2 * CURVE, 0.0, 0.0]  # fmt: skip
    return out


class Look(NamedTuple):
    """One look of one sensor: a report of each target, in an order that says nothing."""

    t: float
    is_radar: bool
    z: FloatArray  # (2, 3): range, azimuth, range rate, or azimuth, elevation, temperature


def simulate(rng: np.random.Generator) -> tuple[FloatArray, list[Look]]:
    """Draw the filters' first means (2, 9) and all looks."""
    times = [(0.1 * k, True) for k in range(1, round(10 * DURATION) + 1)]
    times += [(0.05 * k + 0.025, False) for k in range(round(20 * DURATION))]
    looks = []
    for t, is_radar in sorted(times):
        z = np.empty((2, 3))
        for target, x in enumerate(paths(t)):
            if is_radar:
                z[target] = RADAR.h(x) + rng.normal(size=3) * [1.0, radians(0.2), 0.2]
            else:
                z[target, :2] = IR.h(x) + rng.normal(size=2) * radians(0.1)
                z[target, 2] = TEMPERATURES[target] + TEMPERATURE.sigma * rng.normal()
        looks.append(Look(t, is_radar, z[rng.permutation(2)]))
    return paths(0.0) + rng.normal(size=(2, 9)) * ([0.5] * 3 + [0.2] * 3 + [0.02] * 3), looks


def track(
    first: FloatArray, looks: list[Look], use_doppler: bool, use_temperature: bool
) -> tuple[list[float], FloatArray, FloatArray]:
    """Track both targets; return times of the radar's looks, means (k, 2, 9) and covariances (k, 2, 9, 9)."""
    P0 = np.diag([0.25] * 3 + [0.04] * 3 + [0.0004] * 3)
    states = [GaussianState(0.0, x.copy(), P0.copy()) for x in first]
    warmth = [TEMPERATURE.init(0.0) for _ in states]
    times, means, covariances = [], [], []
    for look in looks:
        sensor = (RADAR if use_doppler else RADAR_WITHOUT) if look.is_radar else IR
        z = look.z[:, : sensor.dimension]
        heat = look.z[:, 2] if use_temperature and not look.is_radar else np.full(2, np.nan)
        states = [ekf.predict(s, MOTION, look.t) for s in states]
        warmth = [TEMPERATURE.predict(w, look.t) for w in warmth]
        states, warmth = _assign(states, warmth, sensor, z, heat)
        if look.is_radar:
            times.append(look.t)
            means.append([s.x for s in states])
            covariances.append([s.P for s in states])
    return times, np.array(means), np.array(covariances)


def _assign(
    states: list[GaussianState], warmth: list[AttributeState], sensor: Radar | Infrared, z: FloatArray, heat: FloatArray
) -> tuple[list[GaussianState], list[AttributeState]]:
    """Give two reports to two tracks, whichever way round is the likelier, and update."""
    options = [[ekf.update(s, sensor, row) for row in z] for s in states]
    score = np.array([[info.log_likelihood for _, info in row] for row in options])
    score += [[TEMPERATURE.log_likelihood(w, value) for value in heat] for w in warmth]
    straight = score[0, 0] + score[1, 1] >= score[0, 1] + score[1, 0]
    given = (0, 1) if straight else (1, 0)
    return (
        [options[i][j][0] for i, j in enumerate(given)],
        [TEMPERATURE.update(w, heat[j]) for w, j in zip(warmth, given)],
    )


METHODS = {
    "no_doppler": (False, False),
    "doppler": (True, False),
    "doppler_temperature": (True, True),
}


def table(runs: int, seed: int) -> list[dict[str, Any]]:
    """Return the rows of scenario `doppler` over at most 50 runs; errors are to the target that a track began on."""
    runs = min(runs, MOST_RUNS)
    data = [simulate(np.random.default_rng([seed, run])) for run in range(runs)]
    rows = []
    for method, (use_doppler, use_temperature) in METHODS.items():
        errors, consistency, swapped = [], [], []
        for first, looks in data:
            times, x, P = track(first, looks, use_doppler, use_temperature)
            late = np.array(times) > SCORED_FROM
            truth = np.array([paths(t) for t in times])
            own = np.linalg.norm((x - truth)[late][..., :3], axis=-1).sum(axis=1)
            other = np.linalg.norm((x - truth[:, ::-1])[late][..., :3], axis=-1).sum(axis=1)
            swapped.append(np.mean(other < own))
            error = (x - truth)[late][..., :6]
            errors.append(error)
            consistency.append(nees(error, P[late][..., :6, :6]).mean())
        e = np.array(errors)
        rows.append(
            {
                "scenario": "doppler",
                "method": method,
                "position_m": finite(rms(np.linalg.norm(e[..., :3], axis=-1))),
                "velocity_m_s": finite(rms(np.linalg.norm(e[..., 3:], axis=-1))),
                "position_ratio": None,
                "anees_per_dim": finite(float(np.mean(consistency)) / 6.0),
                "swapped": float(np.mean(swapped)),
                "runs": runs,
            }
        )
    return rows
