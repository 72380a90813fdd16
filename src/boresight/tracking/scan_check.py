"""Whether what a caller hands to the tracker is what compiled code can take: one line of error, nothing changed."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from boresight.errors import UserError
from boresight.frames.pose import PoseTrack
from boresight.tracking.config import TrackerConfig
from boresight.types import N_COMPONENTS, Component, FloatArray, Scan, Sensor

LATEST = 1e12  # s: no time is farther from zero than this
NOISE = 6.0  # standard deviations
SYMMETRIC = 1e-6  # of the variances, as rounding may leave a covariance
RULES: tuple[tuple[str, Callable[[Any], bool], str], ...] = (
    ("latency", lambda v: abs(v) < LATEST, "finite"),
    ("period", lambda v: v is None or 0.0 < v < LATEST, "above zero, or None"),
    ("p_detection", lambda v: 0.0 < v <= 1.0, "above 0 and at most 1"),
    ("clutter_per_scan", lambda v: 0.0 <= v < LATEST, "finite and not negative"),
    ("p_wrong_id", lambda v: v is None or 0.0 <= v <= 1.0, "within [0, 1], or None"),
)
COLUMNS = {"t": (), "z": (N_COMPONENTS,), "covariance": (N_COMPONENTS, N_COMPONENTS)}


def check_setup(
    config: Any, sensors: Any, dimensions: Any, poses: Any, use: Sequence[int] | None, site_height: float
) -> None:
    """Raise UserError unless these are what a tracker is made of."""
    if not isinstance(config, TrackerConfig):
        raise UserError(f"tracker: config must be a TrackerConfig, not {type(config).__name__}")
    if not (isinstance(dimensions, int) and not isinstance(dimensions, bool) and dimensions in (2, 3)):
        raise UserError(f"tracker: dimensions must be 2 or 3, not {dimensions!r}")
    if not isinstance(sensors, tuple) or not all(isinstance(s, Sensor) for s in sensors):
        raise UserError("tracker: sensors must be a tuple of Sensor")
    ids = [s.id for s in sensors]
    twice = sorted({i for i in ids if ids.count(i) > 1})
    if twice:
        raise UserError(f"tracker: two sensors have the id '{twice[0]}'")
    for sensor in sensors:
        _sensor(sensor)
    if not isinstance(poses, Mapping) or not all(isinstance(p, PoseTrack) for p in poses.values()):
        raise UserError("tracker: poses must map the platforms' ids to PoseTrack")
    if use is not None:
        good = all(isinstance(i, int | np.integer) and 0 <= i < len(sensors) for i in use)
        if not good or len(set(use)) < len(use):
            raise UserError(f"tracker: use must be indices of the {len(sensors)} sensors, each once, not {use!r}")
    if not (isinstance(site_height, int | float) and math.isfinite(site_height)):
        raise UserError(f"tracker: site_height must be finite, not {site_height!r}")


def _sensor(sensor: Sensor) -> None:
    where, sigma = f"tracker: sensor '{sensor.id}'", sensor.sigma
    if not isinstance(sigma, np.ndarray) or sigma.shape != (N_COMPONENTS,) or sigma.dtype != np.float64:
        raise UserError(f"{where}: sigma must be an array of {N_COMPONENTS} float64")
    for name, fits, rule in RULES:
        value = getattr(sensor, name)
        try:
            good = fits(value)
        except TypeError:
            good = False
        if not good:
            raise UserError(f"{where}: {name} must be {rule}, not {value!r}")
    bad = ~np.isnan(sigma) & ~((sigma > 0.0) & np.isfinite(sigma))
    if bad.any():
        name = Component(int(np.argmax(bad))).name.lower()
        raise UserError(f"{where}: the sigma of {name} must be above zero and finite, NaN where it is not measured")


def check_scans(scans: Sequence[Scan], sensors: int, arrival: float) -> None:
    """Raise UserError unless looks can be taken: their shapes, types, sensors (a number of them) and times.

    `arrival` (s) is the newest before them.
    """
    for scan in scans:
        if not isinstance(scan, Scan):
            raise UserError(f"tracker: a look must be a Scan, not {type(scan).__name__}")
        try:
            n = scan.t.shape[0]
            good = (
                scan.t.shape == scan.row.shape == (n,)
                and scan.z.shape == (n, 7)
                and scan.covariance.shape == (n, 7, 7)
                and (scan.address is None or (scan.address.shape == (n,) and scan.address.dtype.kind == "i"))
                and scan.t.dtype.kind == scan.z.dtype.kind == scan.covariance.dtype.kind == "f"
                and scan.row.dtype.kind in "iu"
                and -1 < scan.sensor < sensors
                and -LATEST < scan.t_look < LATEST
                and arrival <= scan.t_recv < LATEST
            )
        except (AttributeError, TypeError, IndexError):
            good = False
        if not good:
            _explain(scan, sensors, arrival)
        arrival = scan.t_recv


def _explain(scan: Any, sensors: int, arrival: float) -> None:
    """Raise the UserError that says what of a look is wrong."""
    if not isinstance(scan.sensor, int | np.integer) or not 0 <= scan.sensor < sensors:
        raise UserError(f"tracker: a look's sensor must be an index into its {sensors} sensors, not {scan.sensor!r}")
    where = f"tracker: a look of sensor {scan.sensor}"
    for name in ("t_look", "t_recv"):
        value: Any = getattr(scan, name)
        if not isinstance(value, int | float | np.floating | np.integer) or not -LATEST < float(value) < LATEST:
            raise UserError(f"{where}: {name} must be a time in seconds, not {value!r}")
    if not scan.t_recv >= arrival:
        raise UserError(f"{where}: t_recv = {scan.t_recv!r} is before {arrival!r}, that of the look before")
    n = len(scan.t) if isinstance(scan.t, np.ndarray) and scan.t.ndim else 0
    for name, kinds, shape in (
        *((name, "f", (n, *rest)) for name, rest in COLUMNS.items()),
        ("row", "iu", (n,)),
        ("address", "i", (n,)),
    ):
        value = getattr(scan, name)
        if name == "address" and value is None:
            continue
        if not isinstance(value, np.ndarray) or value.dtype.kind not in kinds:
            kind = "float64" if kinds == "f" else "int64"
            found = value.dtype if isinstance(value, np.ndarray) else type(value).__name__
            raise UserError(f"{where}: {name} must be an array of {kind}, not {found}")
        if value.shape != shape:
            raise UserError(f"{where}: {name} must have the shape {shape}, not {value.shape}")


def check_detections(sensor: Any, t: FloatArray, z: FloatArray, R: FloatArray, sigma_range: FloatArray) -> None:
    """Raise UserError unless detections (M,), each of the sensor with its index, have possible times, values, noise.

    `sigma_range` (M,) is what each one's sensor declares (m), NaN for nothing.
    """
    if not len(t):
        return
    measured = ~np.isnan(z)
    variance = np.diagonal(R, axis1=1, axis2=2)
    fine = (np.abs(t) < LATEST).all() and not _negative(z, R, sigma_range).any() and not np.isinf(z).any()
    fine = fine and bool((variance[measured] > 0.0).all())
    if fine:
        pairs = measured[:, :, None] & measured[:, None, :]
        pairs[:, np.arange(N_COMPONENTS), np.arange(N_COMPONENTS)] = False
        between = R[pairs]
        fine = bool((variance[measured] < np.inf).all()) and not between.any()
        if fine:
            return
    for i in range(len(t)):
        _detection(f"tracker: a look of sensor {int(sensor[i])}: detection {i}", t[i], z[i], R[i], sigma_range[i])


def _negative(z: FloatArray, R: FloatArray, sigma_range: FloatArray) -> NDArray[np.bool_]:
    """Whether a range is negative beyond what noise explains, as it does beside the sensor."""
    with np.errstate(invalid="ignore"):
        sigma = np.fmax(sigma_range, np.sqrt(R[..., Component.RANGE, Component.RANGE]))
        return np.asarray(z[..., Component.RANGE] < -NOISE * sigma)


def _detection(where: str, t: float, z: FloatArray, R: FloatArray, sigma_range: FloatArray) -> None:
    if not abs(t) < LATEST:
        raise UserError(f"{where}: t must be a time in seconds, not {float(t)!r}")
    seen = np.flatnonzero(~np.isnan(z))
    for c in seen:
        name = Component(int(c)).name.lower()
        if np.isinf(z[c]) or (c == Component.RANGE and _negative(z, R, sigma_range)):
            raise UserError(f"{where}: {name} = {float(z[c])!r}; NaN says that it was not measured")
        if not 0.0 < R[c, c] < np.inf:
            raise UserError(f"{where}: the variance of {name} must be above zero and finite, not {float(R[c, c])!r}")
    sub = R[np.ix_(seen, seen)]
    if len(seen) < 2 or np.count_nonzero(sub) == len(seen):
        return
    sigma = np.sqrt(np.diagonal(sub))
    correlation = sub / sigma[:, None] / sigma
    if not np.isfinite(correlation).all() or not (np.abs(correlation - correlation.T) <= SYMMETRIC).all():
        raise UserError(f"{where}: the covariance is not symmetric and finite")
    if np.linalg.eigvalsh(correlation)[0] < -SYMMETRIC:
        raise UserError(f"{where}: the covariance is not positive")
