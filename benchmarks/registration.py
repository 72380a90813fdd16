"""Registration on line against simulated truth: `python -m benchmarks.registration [--runs 200] [--json]`.

Three boats, a radar that is right and one whose stamps, range and azimuth are off by constants drawn anew in every
run (time offset 0–3 s about a declared latency of 1.5 s, range ±10 m, heading ±3°) and whose azimuth wanders by 0.5°
within 20 s for each boat. The tracker is told the spread of each, nothing else. Printed: how often each estimate's own
95 % band holds the truth, its RMS error, its median sigma. A second case has the faulty radar alone: nothing there
shows its errors, and the verdict must say so.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import math
import sys
from collections.abc import Sequence
from typing import Any

import numpy as np

from boresight._version import __version__
from boresight.engine.track import run
from boresight.io.scans import iter_scans
from boresight.models.motion import NearlyConstantVelocity
from boresight.sim.actors import Drawn, Target
from boresight.sim.looks import SimulatedSensor
from boresight.sim.scenario import Scenario, simulate
from boresight.tracking.config import SensorErrors, TrackerConfig
from boresight.tracking.registration import Constant, constants_of
from boresight.tracking.run import tracker_for
from boresight.types import Coverage, Recording, Sensor, SensorKind, Site

DEG = math.pi / 180.0
Q = 0.003  # m²/s³
LATENCY = 1.5  # s, declared
WANDER, WANDER_TIME = 0.5 * DEG, 20.0
SPREAD = {
    "time_offset_s": 3.0 / math.sqrt(12),
    "range_offset_m": 20 / math.sqrt(12),
    "azimuth_offset_deg": 6 / math.sqrt(12),
}
CONFIG = TrackerConfig(
    q=Q,
    speed_sigma=4.0,
    sensors={
        "off": SensorErrors(
            offset_time=SPREAD["time_offset_s"],
            offset_range=SPREAD["range_offset_m"],
            offset_azimuth=SPREAD["azimuth_offset_deg"] * DEG,
            bias_azimuth=WANDER,
            bias_time=WANDER_TIME,
        )
    },
)


def case(seed: int, duration: float = 120.0) -> tuple[Recording, dict[str, float]]:
    """Simulate one recording; returns it and the true constant errors of the sensor "off"."""
    rng = np.random.default_rng([seed, 31])
    truth = {
        "time_offset_s": float(rng.uniform(-1.5, 1.5)),
        "range_offset_m": float(rng.uniform(-10.0, 10.0)),
        "azimuth_offset_deg": float(rng.uniform(-3.0, 3.0)),
    }
    sigma = np.array([3.0, 0.01, *[np.nan] * 5])
    base = {"sigma": sigma, "p_detection": 0.9, "clutter_per_scan": 2.0, "coverage": Coverage(range=(0.0, 700.0))}
    right = Sensor("right", SensorKind.RADAR, None, period=1.0, **base)  # type: ignore[arg-type]
    off = Sensor("off", SensorKind.RADAR, None, period=1.7, latency=LATENCY, **base)  # type: ignore[arg-type]
    bias = (truth["range_offset_m"], truth["azimuth_offset_deg"] * DEG, *[0.0] * 5)
    sensors = (
        SimulatedSensor(right, 1.0),
        SimulatedSensor(off, 1.7, start=0.03, latency=LATENCY + truth["time_offset_s"], bias=bias),
    )
    boats = tuple(Target(f"boat-{k}", Drawn(NearlyConstantVelocity(Q), _start(rng, duration))) for k in range(3))
    scenario = Scenario("registration", duration, 2, Site(1.1, 0.2, 0.0), boats, sensors)
    return _wander(simulate(scenario, rng), rng), truth


def _start(rng: np.random.Generator, duration: float) -> np.ndarray:
    """Draw a straight way that stays 80 m clear of the sensors: nearer, the geometry of any filter is too curved."""
    while True:
        p, v = rng.uniform(-350.0, 350.0, 2), rng.normal(0.0, 3.0, 2)
        way = p + np.linspace(0.0, duration, 60)[:, None] * v
        if np.hypot(*way.T).min() > 80.0:
            return np.array([*p, 0.0, *v, 0.0])


def _wander(recording: Recording, rng: np.random.Generator) -> Recording:
    """Add to the azimuths of "off" a Gauss–Markov error, one for each boat: that of the boat nearest in azimuth."""
    d = recording.detections
    rows = np.flatnonzero((d.sensor == recording.sensor_index("off")) & np.isfinite(d.z[:, 1]))
    paths = [_gauss_markov(d.t[rows], rng) for _ in recording.truth]
    bearing = np.array(
        [
            np.arctan2(*(np.interp(d.t[rows] - LATENCY, truth.t, truth.position[:, a]) for a in range(2)))
            for truth in recording.truth
        ]
    )
    gap = np.abs(np.angle(np.exp(1j * (d.z[rows, 1] - bearing))))
    z = d.z.copy()
    z[rows, 1] += np.array(paths)[gap.argmin(axis=0), np.arange(len(rows))]
    z[:, 1] = np.angle(np.exp(1j * z[:, 1]))
    return dataclasses.replace(recording, detections=dataclasses.replace(d, z=z))


def _gauss_markov(t: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    value, last, out = rng.normal(0.0, WANDER), t[0], []
    for now in t:
        keep = math.exp(-(now - last) / WANDER_TIME)
        value = keep * value + rng.normal(0.0, WANDER) * math.sqrt(1.0 - keep**2)
        last = now
        out.append(value)
    return np.array(out)


def estimate(recording: Recording, sensors: Sequence[str] | None = None) -> list[Constant]:
    """Track a recording and return what the tracker has learned of the constant errors."""
    tracker = tracker_for(recording, CONFIG, sensors)
    state, _, _ = run(tracker, iter_scans(recording, sensors))
    return constants_of(state.window.tracks, tracker.plan, tuple(s.id for s in tracker.sensors))


def rows(runs: int) -> list[dict[str, Any]]:
    """One row for each case and parameter."""
    out = []
    for name, sensors in (("two radars", None), ("alone", ["off"])):
        error: dict[str, list[float]] = {p: [] for p in SPREAD}
        sigma: dict[str, list[float]] = {p: [] for p in SPREAD}
        verdicts: dict[str, list[str]] = {p: [] for p in SPREAD}
        for seed in range(runs if sensors is None else min(runs, 20)):
            recording, truth = case(seed)
            for c in estimate(recording, sensors):
                error[c.parameter].append(c.value - truth[c.parameter])
                sigma[c.parameter].append(c.sigma)
                verdicts[c.parameter].append(c.verdict)
        for p in SPREAD:
            e, s = np.array(error[p]), np.array(sigma[p])
            words = verdicts[p]
            out.append(
                {
                    "case": name,
                    "parameter": p,
                    "runs": len(e),
                    "in_band_95": float(np.mean(np.abs(e) <= 1.96 * s)),
                    "rms_error": float(np.sqrt(np.mean(e**2))),
                    "sigma_median": float(np.median(s)),
                    "declared_sigma": SPREAD[p],
                    "verdict": max(set(words), key=words.count),
                }
            )
    return out


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    arguments = parser.parse_args()
    found = rows(max(1, arguments.runs))
    if arguments.json:
        about = {"command": "registration", "version": __version__, "parameters": {"runs": arguments.runs}}
        print(json.dumps({**about, "rows": found}, indent=1))
        return 0
    for r in found:
        print(
            f"{r['case']:<11}{r['parameter']:<20}in 95 % band {100 * r['in_band_95']:5.1f} % of {r['runs']}, RMS error "
            f"{r['rms_error']:.3f}, sigma {r['sigma_median']:.3f} of {r['declared_sigma']:.2f}: {r['verdict']}"
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
