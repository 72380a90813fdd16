"""A small simulated harbour: two boats, a radar and an IR on a moving ferry, clutter, drop-outs, a late radar."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numba import njit

from boresight.types import (
    Axes,
    Coverage,
    Detections,
    PlatformTrack,
    Recording,
    Sensor,
    SensorKind,
    Site,
    Truth,
)

NAN = float("nan")


def whole(part: Any) -> Any:
    """Return a part of a kernel so that it can be called from here."""
    return njit(getattr(part, "py_func", part))


def _sensor(name: str, kind: SensorKind, sigma: dict[int, float], **extra: object) -> Sensor:
    values = np.full(7, np.nan)
    for component, value in sigma.items():
        values[component] = value
    return Sensor(name, kind, "ferry", Axes.PLATFORM_ENU, sigma=values, **extra)  # type: ignore[arg-type]


def make_recording(seed: int = 1, duration: float = 60.0, latency: float = 1.0, clutter: float = 3.0) -> Recording:
    rng = np.random.default_rng(seed)
    start = np.array([[150.0, 200.0], [-250.0, 120.0]])
    speed = np.array([[3.0, -2.0], [4.0, 1.0]])
    ferry_v = np.array([1.0, 0.5])
    radar = _sensor(
        "radar", SensorKind.RADAR, {0: 3.0, 1: 0.01}, latency=latency, p_detection=0.9, clutter_per_scan=clutter,
        coverage=Coverage(range=(0.0, 500.0)),
    )  # fmt: skip
    ir = _sensor("ir", SensorKind.INFRARED, {1: 0.005}, p_detection=0.8, clutter_per_scan=1.0)
    looks = [(t, 0) for t in np.arange(0.0, duration, 1.5)] + [(t, 1) for t in np.arange(0.05, duration, 0.2)]
    rows: list[tuple[float, int, int, dict[int, float]]] = []
    for number, (stamp, sensor) in enumerate(sorted(looks)):
        t = stamp - latency if sensor == 0 else stamp
        found: list[dict[int, float]] = []
        for p, v in zip(start, speed, strict=True):
            d = p + v * t - ferry_v * t
            r, az = float(np.hypot(*d)), float(np.arctan2(d[0], d[1]))
            if rng.random() > (0.9 if sensor == 0 else 0.8):
                continue
            noise = rng.normal(size=2)
            found.append(
                {0: r + 3.0 * noise[0], 1: az + 0.01 * noise[1]} if sensor == 0 else {1: az + 0.005 * noise[1]}
            )
        for _ in range(rng.poisson(clutter if sensor == 0 else 1.0)):
            az = float(rng.uniform(-np.pi, np.pi))
            found.append({0: float(rng.uniform(0.0, 500.0)), 1: az} if sensor == 0 else {1: az})
        rows += [(stamp, sensor, number, z) for z in found] or [(stamp, sensor, number, {})]
    n = len(rows)
    z = np.full((n, 7), np.nan)
    for i, row in enumerate(rows):
        for component, value in row[3].items():
            z[i, component] = value
    z[:, 1] = (z[:, 1] + np.pi) % (2 * np.pi) - np.pi
    t = np.array([row[0] for row in rows])
    sensor_of = np.array([row[1] for row in rows])
    sigma = np.where(np.isfinite(z), np.stack([radar.sigma, ir.sigma])[sensor_of], np.nan)
    nav_t = np.arange(-2.0, duration + 1.0, 0.1)
    position = np.column_stack([np.outer(nav_t, ferry_v), np.zeros(len(nav_t))])
    velocity = np.tile([*ferry_v, 0.0], (len(nav_t), 1))
    platform = PlatformTrack(
        "ferry", nav_t, position, velocity, np.full((len(nav_t), 3), NAN), np.full(len(nav_t), NAN),
        np.full(len(nav_t), NAN),
    )  # fmt: skip
    truth = tuple(
        Truth(
            f"boat-{i}",
            nav_t,
            np.column_stack([p + np.outer(nav_t, v), np.zeros(len(nav_t))]),
            np.tile([*v, 0.0], (len(nav_t), 1)),
        )
        for i, (p, v) in enumerate(zip(start, speed, strict=True))
    )
    detections = Detections(t, np.maximum.accumulate(t), sensor_of, np.array([row[2] for row in rows]), z, sigma, {})
    return Recording(
        "harbour", 2, Site(1.1, 0.18, 0.0), (radar, ir), detections, (platform,), truth, (), np.zeros(n, dtype=bool)
    )


@pytest.fixture(scope="session")
def harbour() -> Recording:
    return make_recording()
