"""mao2015's sensors and four trajectories (the paper prints none but the noise; these are ours)."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from boresight.types.sensor import FloatArray

STEP = 0.05  # s, infrared
PER_RADAR = 60  # infrared samples in a radar period of 3 s
SAMPLES = 2401  # 120 s
EPOCHS = np.arange(4, 40) * PER_RADAR  # the radar's, 12 to 117 s: 36 with full windows
RADAR_DEG = (1.0, 3.0)  # azimuth, elevation
INFRARED_DEG = 0.5
LAG = 0.7  # s, of the turn rate
SUBSTEPS = 20


def _turning(
    start: tuple[float, float, float],
    heading_deg: float,
    rate_deg_s: float,
    period: float,
    climb: float,
    climb_s: float,
) -> FloatArray:
    """Return positions (SAMPLES, 3): 200 m/s, a square wave of turn rate through a first-order lag, a sine of climb."""
    dt = STEP / SUBSTEPS
    t = np.arange((SAMPLES - 1) * SUBSTEPS) * dt
    wave = math.radians(rate_deg_s) * np.where((t + dt / 2) % period < period / 2, 1.0, -1.0)
    rate, rates, keep = 0.0, np.empty_like(wave), math.exp(-dt / LAG)
    for i, wanted in enumerate(wave):
        rates[i] = rate
        rate = wanted + (rate - wanted) * keep
    heading = math.radians(heading_deg) + np.cumsum(rates) * dt
    velocity = np.stack(
        [200.0 * np.cos(heading), 200.0 * np.sin(heading), climb * np.sin(2 * np.pi * (t + dt / 2) / climb_s)], axis=1
    )
    out: FloatArray = np.asarray(start) + np.vstack([np.zeros(3), np.cumsum(velocity, axis=0) * dt])[::SUBSTEPS]
    return out


def _level(start: tuple[float, float, float], speed: float) -> FloatArray:
    t = STEP * np.arange(SAMPLES)
    out: FloatArray = np.asarray(start) + t[:, None] * np.array([speed, 0.0, 0.0])
    return out


PATHS: dict[str, Callable[[], FloatArray]] = {
    "straight": lambda: _level((-12000.0, 5000.0, 1500.0), 200.0),
    "weave": lambda: _turning((-9000.0, 4000.0, 1500.0), -36.0, 9.0, 24.0, 40.0, 17.0),
    "hard": lambda: _turning((-5000.0, 2500.0, 1200.0), -40.0, 17.0, 14.0, 80.0, 9.0),
    "pass": lambda: _level((-250.0 * 60.7, 400.0, 300.0), 250.0),
}


def angles_deg(positions: FloatArray) -> FloatArray:
    """Return azimuth (unwrapped) and elevation (2, n) in degrees of positions (n, 3), world ENU."""
    e, n, u = positions.T
    return np.asarray(np.degrees(np.stack([np.unwrap(np.arctan2(e, n)), np.arctan2(u, np.hypot(e, n))])))
