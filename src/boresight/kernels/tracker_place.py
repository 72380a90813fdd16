"""Where a sensor looks, and where in the world a detection lies, with its covariance and its constant errors' share."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from boresight.kernels.measurement import measure
from boresight.kernels.options import LEAF, PART
from boresight.kernels.registration import N_PARAMETERS, sensitivity
from boresight.kernels.tracker import IntArray, Look, SensorTable, Settings
from boresight.kernels.tracker_workroom import Workroom
from boresight.types.sensor import FloatArray

TOP = 14_000.0  # m above the site: hardly an aircraft flies higher
WIDE = 2.5  # standard deviations of a declared height, on either side
EARTH = 6.371e6  # m


class Places(NamedTuple):
    """Where in the world the detections of a look lie, if they say so."""

    there: NDArray[np.bool_]  # (m,) whether a detection gives a position
    mask: IntArray  # (m, 3) the components that give it
    fix: FloatArray  # (m, 3) m, world ENU
    J: FloatArray  # (m, 3, 3) its Jacobian by the components
    R: FloatArray  # (m, 3, 3) white covariance of the components
    covariance: FloatArray  # (m, 3, 3) m², white part, world ENU


@njit(**LEAF)
def within(range_m: float, azimuth: float, elevation: float, sensor: SensorTable, margin: float) -> bool:
    """Whether range (m) and direction (rad, sensor axes) lie within the declared coverage, widened by `margin`.

    NaN is not looked at.
    """
    slack_r = margin * max(50.0, 0.02 * sensor.range_high) if math.isfinite(sensor.range_high) else 0.0
    if math.isfinite(range_m) and not (sensor.range_low - slack_r <= range_m <= sensor.range_high + slack_r):
        return False
    slack_a = margin * 0.035
    if math.isfinite(azimuth) and sensor.azimuth_span < 2.0 * math.pi - 1e-9:
        a = azimuth - sensor.azimuth_low + slack_a
        a -= 2.0 * math.pi * math.floor(a / (2.0 * math.pi))
        if a > sensor.azimuth_span + 2.0 * slack_a:
            return False
    return (
        not math.isfinite(elevation) or sensor.elevation_low - slack_a <= elevation <= sensor.elevation_high + slack_a
    )


@njit(**LEAF)
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


@njit(**LEAF)
def position_fix(
    look: Look, k: int, s: Settings, sensor: SensorTable, fix: FloatArray, J: FloatArray, mask: IntArray
) -> int:
    """Turn a ranging detection into a world position `fix` (3,) and `J` (3, m), its Jacobian by the components.

    Returns the number m of components used (written to `mask`), or 0 where the detection gives no position. Where
    elevation is not measured, that of the middle of the heights at which the target may be stands for it.
    """
    z = look.z[k]
    R = look.enu_from_sensor[k]
    if math.isfinite(z[4]) and math.isfinite(z[5]):
        e, n, u = z[4], z[5], z[6] if math.isfinite(z[6]) else 0.0
        if s.d == 3 and not math.isfinite(z[6]) and sensor.height_sigma > 0.0:
            u = sensor.height - s.site_height - look.sensor_position[k, 2]
        for a in range(3):
            mask[a] = 4 + a
            for b in range(3):
                J[a, b] = R[a, b]
    elif math.isfinite(z[0]) and math.isfinite(z[1]):
        el = z[2]
        if not math.isfinite(el):
            if s.d == 2:  # the target is in the plane up = 0: take the depression that follows from the range
                drop = -look.sensor_position[k, 2]
                el = math.asin(max(-1.0, min(1.0, drop / max(z[0], 1.0))))
            elif math.isfinite(z[6]):  # a height beside range and azimuth, as transponders give it
                el = math.asin(max(-1.0, min(1.0, z[6] / max(z[0], 1e-9))))
            else:
                low, high = heights(look, k, s, sensor)
                el = elevation_at(look, k, 0.5 * (low + high))
        polar_fix(look, k, el, fix, J, mask)
        return 3
    else:
        return 0
    for a in range(3):
        fix[a] = look.sensor_position[k, a] + R[a, 0] * e + R[a, 1] * n + R[a, 2] * u
    return 3


@njit(**LEAF)
def polar_fix(look: Look, k: int, el: float, fix: FloatArray, J: FloatArray, mask: IntArray) -> None:
    """Fill the world position of a range and an azimuth at elevation `el` (rad, sensor axes), and its Jacobian."""
    z, R = look.z[k], look.enu_from_sensor[k]
    ce, se, ca, sa = math.cos(el), math.sin(el), math.cos(z[1]), math.sin(z[1])
    e, n, u = z[0] * ce * sa, z[0] * ce * ca, z[0] * se
    for a in range(3):
        mask[a] = a
        J[a, 0] = R[a, 0] * ce * sa + R[a, 1] * ce * ca + R[a, 2] * se
        J[a, 1] = R[a, 0] * n - R[a, 1] * e
        J[a, 2] = -R[a, 0] * z[0] * se * sa - R[a, 1] * z[0] * se * ca + R[a, 2] * z[0] * ce
        fix[a] = look.sensor_position[k, a] + R[a, 0] * e + R[a, 1] * n + R[a, 2] * u


@njit(**LEAF)
def lacks_height(z: FloatArray, s: Settings) -> bool:
    """Whether a detection leaves its target on an arc of equal range: range and azimuth, in three dimensions."""
    height = math.isfinite(z[2]) or math.isfinite(z[4]) or math.isfinite(z[6])
    return bool(s.d == 3 and math.isfinite(z[0]) and math.isfinite(z[1]) and not height)


@njit(**LEAF)
def elevation_at(look: Look, k: int, up: float) -> float:
    """Elevation (rad, sensor axes) at which the range and azimuth of detection `k` reach the height `up` (m, world)."""
    z, R = look.z[k], look.enu_from_sensor[k]
    level = R[2, 0] * math.sin(z[1]) + R[2, 1] * math.cos(z[1])  # level cos(el) + R22 sin(el) = (up - own) / range
    steep = math.hypot(level, R[2, 2])
    lift = (up - look.sensor_position[k, 2]) / max(z[0] * steep, 1e-9)
    turn = math.acos(max(-1.0, min(1.0, lift)))
    middle = math.atan2(R[2, 2], level)
    return middle - turn if R[2, 2] >= 0.0 else middle + turn


@njit(**LEAF)
def height_to_up(look: Look, k: int, s: Settings, height: float) -> float:
    """Return how far up (m, world) a height above the ellipsoid is where detection `k` is: the earth curves."""
    own, far = look.sensor_position[k], look.z[k, 0]
    up = height - s.site_height
    level = max(far * far - (up - own[2]) ** 2, 0.0)
    return float(up - level / (2.0 * EARTH))


@njit(**LEAF)
def heights(look: Look, k: int, s: Settings, sensor: SensorTable) -> tuple[float, float]:
    """Return between which heights (m up, world) the target of a detection without elevation may be.

    Within `WIDE` standard deviations of what is declared and not below the ground, as far as that leaves one of them;
    else from the ground, or the sensor if that is lower, to where no aircraft flies, within the elevation coverage.
    """
    own, far = look.sensor_position[k, 2], look.z[k, 0]
    reach = 0.999 * far
    if sensor.height_sigma > 0.0:
        middle = height_to_up(look, k, s, sensor.height)
        low, high = middle - WIDE * sensor.height_sigma, middle + WIDE * sensor.height_sigma
        ground = min(height_to_up(look, k, s, s.site_height), own)
        low = max(low, min(ground, middle - sensor.height_sigma))
    else:
        low = min(height_to_up(look, k, s, s.site_height), own)
        high = height_to_up(look, k, s, s.site_height + max(TOP, own + 0.25 * TOP))
        low = max(low, own + far * math.sin(sensor.elevation_low))
        high = min(high, own + far * math.sin(sensor.elevation_high))
    low, high = max(low, own - reach), min(high, own + reach)
    return (low, high) if low < high else (min(max(low, own - reach), own + reach) - 1.0, min(low, own + reach))


@njit(**LEAF)
def put_at_height(look: Look, k: int, s: Settings, sensor: SensorTable, at: Places, up: float) -> None:
    """Put detection `k`, of range and azimuth, at the height `up` (m, world) in `at`."""
    polar_fix(look, k, elevation_at(look, k, up), at.fix[k], at.J[k], at.mask[k])
    component_covariance(look, k, s, sensor, at.mask[k], at.R[k])
    place_covariance(at, k)


@njit(**LEAF)
def component_covariance(look: Look, k: int, s: Settings, sensor: SensorTable, mask: IntArray, R: FloatArray) -> None:
    """Fill the covariance (3, 3) of the components in `mask`; what is not measured has its prior spread."""
    for a in range(3):
        for b in range(3):
            value = look.R[k, mask[a], mask[b]]
            R[a, b] = value if math.isfinite(value) else 0.0
        if not math.isfinite(look.R[k, mask[a], mask[a]]):
            spread = sensor.height_sigma if mask[a] == 6 and sensor.height_sigma > 0.0 else 500.0
            if mask[a] == 2 and s.d == 3 and math.isfinite(look.z[k, 6]):
                level = math.sqrt(max(look.z[k, 0] ** 2 - look.z[k, 6] ** 2, 1e-9))
                spread = math.sqrt(look.R[k, 6, 6]) / level
            elif mask[a] == 2 and s.d == 3:
                low, high = heights(look, k, s, sensor)
                spread = min((elevation_at(look, k, high) - elevation_at(look, k, low)) / math.sqrt(12.0), 0.35)
                spread = max(spread, 1e-4)
            if s.d == 2:
                spread = 1e-6
            R[a, a] = spread * spread


@njit(**LEAF)
def covered(z: FloatArray, sensor: SensorTable) -> bool:
    """Whether a detection lies within the declared coverage, with some margin for its noise."""
    range_m, azimuth = z[0], z[1]
    if math.isfinite(z[4]) and math.isfinite(z[5]):
        up = z[6] if math.isfinite(z[6]) else 0.0
        range_m = math.sqrt(z[4] * z[4] + z[5] * z[5] + up * up)
        azimuth = math.atan2(z[4], z[5]) if sensor.azimuth_span < 2.0 * math.pi else math.nan
    return bool(within(range_m, azimuth, z[2], sensor, 1.0))


@njit(**PART)
def places_of(look: Look, s: Settings, sensor: SensorTable, usable: NDArray[np.bool_]) -> Places:
    """Return where all usable detections of a look lie; no room for places if its sensor gives none."""
    there = np.zeros(len(look.dt), np.bool_)
    m = len(look.dt) if sensor.ranging else 0
    mask = np.zeros((m, 3), np.int64)
    fix, matrices = np.zeros((m, 3)), np.zeros((3, m, 3, 3))
    J, R, cov = matrices[0], matrices[1], matrices[2]
    at = Places(there, mask, fix, J, R, cov)
    for k in range(m):
        if not usable[k] or position_fix(look, k, s, sensor, fix[k], J[k], mask[k]) == 0:
            continue
        there[k] = True
        component_covariance(look, k, s, sensor, mask[k], R[k])
        place_covariance(at, k)
    return at


@njit(**LEAF)
def place_covariance(at: Places, k: int) -> None:
    """Fill the world covariance of detection `k`, J R J'."""
    J, R, cov = at.J, at.R, at.covariance
    for a in range(3):
        j0, j1, j2 = J[k, a, 0], J[k, a, 1], J[k, a, 2]
        r0 = j0 * R[k, 0, 0] + j1 * R[k, 1, 0] + j2 * R[k, 2, 0]
        r1 = j0 * R[k, 0, 1] + j1 * R[k, 1, 1] + j2 * R[k, 2, 1]
        r2 = j0 * R[k, 0, 2] + j1 * R[k, 1, 2] + j2 * R[k, 2, 2]
        for b in range(3):
            cov[k, a, b] = r0 * J[k, b, 0] + r1 * J[k, b, 1] + r2 * J[k, b, 2]


@njit(**LEAF)
def fix_sensitivity(
    look: Look,
    k: int,
    fix: FloatArray,
    J: FloatArray,
    mask: IntArray,
    velocity: tuple[float, float, float],
    room: Workroom,
) -> None:
    """Fill `room.C` (3, 5): how the world position of detection `k` changes with the sensor's constant errors."""
    moving = look.sensor_velocity[k]
    for a in range(3):
        room.v[a] = velocity[a]
    measure(fix, room.v, look.sensor_position[k], moving, look.enu_from_sensor[k], room.z, room.h6)
    for a in range(3):
        room.v[a] -= moving[a]
    sensitivity(room.z, room.h6, room.v, room.errors)
    for a in range(3):
        for p in range(N_PARAMETERS):
            room.C[a, p] = 0.0
            for e in range(3):
                room.C[a, p] += J[a, e] * room.errors[mask[e], p]
