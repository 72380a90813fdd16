"""Where a sensor looks, and where in the world a detection lies, with its covariance and its constant errors' share."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from boresight.kernels.measurement import measure
from boresight.kernels.registration import N_PARAMETERS, sensitivity
from boresight.kernels.tracker import IntArray, Look, SensorTable, Settings
from boresight.types.sensor import FloatArray


@njit(cache=True)
def coverage_of(z: FloatArray, sensor: SensorTable, margin: float) -> bool:
    """Whether a direction and range (z[0:3], sensor axes) lies within the declared coverage, widened by `margin`."""
    slack_r = margin * max(50.0, 0.02 * sensor.range_high) if math.isfinite(sensor.range_high) else 0.0
    if math.isfinite(z[0]) and not (sensor.range_low - slack_r <= z[0] <= sensor.range_high + slack_r):
        return False
    slack_a = margin * 0.035
    if math.isfinite(z[1]) and sensor.azimuth_span < 2.0 * math.pi - 1e-9:
        a = z[1] - sensor.azimuth_low + slack_a
        a -= 2.0 * math.pi * math.floor(a / (2.0 * math.pi))
        if a > sensor.azimuth_span + 2.0 * slack_a:
            return False
    return not math.isfinite(z[2]) or sensor.elevation_low - slack_a <= z[2] <= sensor.elevation_high + slack_a


@njit(cache=True)
def volume_of(mask: IntArray, m: int, sensor: SensorTable, range_high: float, d: int, speed: float) -> float:
    """Volume of the coverage in the measured components: what clutter is uniform in (m, rad, m/s)."""
    r1, r2 = sensor.range_low, range_high
    volume = 1.0
    cartesian = False
    for j in range(m):
        if mask[j] == 0:
            volume *= r2 - r1
        elif mask[j] == 1:
            volume *= sensor.azimuth_span
        elif mask[j] == 2:
            volume *= sensor.elevation_high - sensor.elevation_low
        elif mask[j] == 3:
            volume *= 4.0 * speed
        else:
            cartesian = True
    if cartesian:
        if d == 2:
            volume *= 0.5 * (r2 * r2 - r1 * r1) * sensor.azimuth_span
        else:
            lift = math.sin(sensor.elevation_high) - math.sin(sensor.elevation_low)
            volume *= (r2**3 - r1**3) / 3.0 * sensor.azimuth_span * lift
    return volume


@njit(cache=True)
def position_fix(
    look: Look, k: int, s: Settings, sensor: SensorTable, fix: FloatArray, J: FloatArray, mask: IntArray
) -> int:
    """Turn a ranging detection into a world position `fix` (3,) and `J` (3, m), its Jacobian by the components.

    Returns the number m of components used (written to `mask`), or 0 where the detection gives no position. Where
    elevation is not measured, the middle of the sensor's elevation coverage stands for it, with its spread.
    """
    z = look.z[k]
    R = look.enu_from_sensor[k]
    if math.isfinite(z[4]) and math.isfinite(z[5]):
        e, n, u = z[4], z[5], z[6] if math.isfinite(z[6]) else 0.0
        for a in range(3):
            mask[a] = 4 + a
            for b in range(3):
                J[a, b] = R[a, b]
    elif math.isfinite(z[0]) and math.isfinite(z[1]):
        el = z[2]
        if not math.isfinite(el):
            el = 0.0
            if s.d == 2:  # the target is in the plane up = 0: take the depression that follows from the range
                drop = -look.sensor_position[k, 2]
                el = math.asin(max(-1.0, min(1.0, drop / max(z[0], 1.0))))
            else:
                el = 0.5 * (sensor.elevation_low + sensor.elevation_high)
        ce, se, ca, sa = math.cos(el), math.sin(el), math.cos(z[1]), math.sin(z[1])
        e, n, u = z[0] * ce * sa, z[0] * ce * ca, z[0] * se
        for a in range(3):
            mask[a] = a
            J[a, 0] = R[a, 0] * ce * sa + R[a, 1] * ce * ca + R[a, 2] * se
            J[a, 1] = R[a, 0] * n - R[a, 1] * e
            J[a, 2] = -R[a, 0] * z[0] * se * sa - R[a, 1] * z[0] * se * ca + R[a, 2] * z[0] * ce
    else:
        return 0
    for a in range(3):
        fix[a] = look.sensor_position[k, a] + R[a, 0] * e + R[a, 1] * n + R[a, 2] * u
    return 3


@njit(cache=True)
def component_covariance(look: Look, k: int, s: Settings, sensor: SensorTable, mask: IntArray, R: FloatArray) -> None:
    """Fill the covariance (3, 3) of the components in `mask`; what is not measured has its prior spread."""
    for a in range(3):
        for b in range(3):
            value = look.R[k, mask[a], mask[b]]
            R[a, b] = value if math.isfinite(value) else 0.0
        if not math.isfinite(look.R[k, mask[a], mask[a]]):
            spread = 500.0
            if mask[a] == 2:
                spread = min((sensor.elevation_high - sensor.elevation_low) / math.sqrt(12.0), 0.35)
            if s.d == 2:
                spread = 1e-6
            R[a, a] = spread * spread


@njit(cache=True)
def world_fix(
    look: Look,
    k: int,
    s: Settings,
    sensor: SensorTable,
    fix: FloatArray,
    fix_R: FloatArray,
    J: FloatArray,
    mask: IntArray,
    work: FloatArray,
) -> bool:
    """Fill a detection's world position (3,) and its white covariance (3, 3); False where it gives no position.

    `work` is (3, 3).
    """
    if position_fix(look, k, s, sensor, fix, J, mask) == 0:
        return False
    component_covariance(look, k, s, sensor, mask, work)
    for a in range(3):
        for b in range(3):
            acc = 0.0
            for e in range(3):
                for f in range(3):
                    acc += J[a, e] * work[e, f] * J[b, f]
            fix_R[a, b] = acc
    return True


@njit(cache=True)
def fix_sensitivity(
    look: Look, k: int, sensor: SensorTable, fix: FloatArray, J: FloatArray, mask: IntArray, velocity: FloatArray
) -> FloatArray:
    """Return (3, 5): how the world position of detection `k` changes with the sensor's constant errors."""
    z = np.empty(7)
    h6 = np.empty((7, 6))
    S = np.empty((7, N_PARAMETERS))
    measure(fix, velocity, look.sensor_position[k], look.sensor_velocity[k], look.enu_from_sensor[k], z, h6)
    sensitivity(z, h6, velocity - look.sensor_velocity[k], S)
    out = np.zeros((3, N_PARAMETERS))
    for a in range(3):
        for p in range(N_PARAMETERS):
            for e in range(3):
                out[a, p] += J[a, e] * S[mask[e], p]
    return out
