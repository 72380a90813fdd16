"""A large scenario through the whole tracker: `python -m benchmarks.whole_tracker [TRACKS] [SECONDS] [PERIOD]`.

Five radars on one site each look all round every PERIOD (10 s), one after another, 1 % clutter: 4,000 targets give
2,000 reports a second (the published capacity of ARTAS, EUROCONTROL's tracker). Prints how many times
faster than real time it goes.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator

import numpy as np

from boresight.tracking.config import TrackerConfig
from boresight.tracking.tracker import Tracker
from boresight.types import Component, Coverage, FloatArray, Scan, Sensor, SensorKind

RADARS = 5
AREA = 200_000.0  # m, half the side of the square of targets


def sensors(period: float) -> tuple[Sensor, ...]:
    """Return five position-reporting radars that look every `period` seconds."""
    sigma = np.full(7, np.nan)
    sigma[[Component.EAST, Component.NORTH]] = 30.0
    return tuple(
        Sensor(
            f"radar-{i}", SensorKind.RADAR, sigma=sigma, period=period, p_detection=0.95, clutter_per_scan=40.0,
            coverage=Coverage(range=(0.0, 1.5 * AREA)),
        )
        for i in range(RADARS)
    )  # fmt: skip


def looks(targets: int, seconds: float, period: float, rng: np.random.Generator) -> Iterator[Scan]:
    """Yield the looks of all radars: each sees every target once in `period`, the radars one after another."""
    position = rng.uniform(-AREA, AREA, (targets, 2))
    velocity = rng.normal(0.0, 100.0, (targets, 2))
    row = 0
    step = period / RADARS
    for k in range(int(seconds / step)):
        t = k * step
        now = position + t * velocity
        seen = now[rng.random(targets) < 0.95]
        clutter = rng.uniform(-AREA, AREA, (rng.poisson(0.01 * targets), 2))
        points = np.concatenate([seen + rng.normal(0.0, 30.0, seen.shape), clutter])
        n = len(points)
        z = np.full((n, 7), np.nan)
        z[:, Component.EAST : Component.NORTH + 1] = points
        yield Scan(k % RADARS, t, t, np.full(n, t), z, covariance(n), np.arange(row, row + n))
        row += n


def covariance(n: int) -> FloatArray:
    """Return (n, 7, 7) of 30 m per axis."""
    one = np.full((7, 7), np.nan)
    one[4:6, 4:6] = np.diag([900.0, 900.0])
    return np.broadcast_to(one, (n, 7, 7))


def measure(targets: int, seconds: float, period: float = 10.0) -> dict[str, float]:
    """Track `targets` for `seconds` of data and return how many times faster than real time that went."""
    rng = np.random.default_rng(1)
    tracker = Tracker(TrackerConfig(q=1.0, speed_sigma=150.0, merge_distance=10.0), sensors(period), 2)
    state = tracker.init()
    scans = list(looks(targets, seconds, period, rng))
    for scan in scans[:RADARS]:  # kernels loaded, tracks begun
        state, _ = tracker.step(state, scan)
    started = time.process_time()
    rows = 0
    for scan in scans[RADARS:]:
        state, out = tracker.step(state, scan)
        rows += sum(len(r.t) for r in out.rows)
    spent = time.process_time() - started
    reports = sum(len(s.t) for s in scans[RADARS:])
    tracks = state.window.tracks
    return {
        "targets": targets,
        "shown": float((tracks.life[: tracks.live[0], 2] > 0).sum()),
        "reports_per_s_of_data": reports / (seconds - period),
        "cpu_s": spent,
        "times_real_time": (seconds - period) / spent,
        "us_per_report": 1e6 * spent / reports,
        "rows": rows,
    }


if __name__ == "__main__":
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 4000
    seconds, period = (float(sys.argv[i]) if len(sys.argv) > i else v for i, v in ((2, 120.0), (3, 10.0)))
    print(measure(count, seconds, period))
