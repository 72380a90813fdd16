"""Batch least squares over a recording: smooth paths of the targets and constant errors of the sensors, together.

Unknown are, for every track, position and velocity at knots (white acceleration between them, its density `q`), a
first-order Gauss–Markov error of each component that is declared to be coloured, and, for every sensor but the
reference, time offset, range offset, range scale, azimuth and elevation offset. Gauss–Newton with Cauchy's weights; the
normal equations are sparse. A time offset moves the report along the path and the platform's way. A sensor whose
residuals are larger than declared has its variance multiplied accordingly, and the covariance is at least what the
scatter of the scores between stretches of 20 s says (clustered sandwich, Liang & Zeger 1986): colour not modelled.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import splu

from boresight.errors import UserError
from boresight.kernels.registration import AZIMUTH, ELEVATION, N_PARAMETERS, RANGE, SCALE, TIME
from boresight.register.paths import KNOT, Path, first_path
from boresight.register.residuals import Lines, Observed, cluster_of, linearise
from boresight.types import Component, FloatArray, Sensor

# paths first rest on ranges (bearings' variances × COARSE), then on all as declared, then as the residuals say
FIRST, SECOND, COARSE = 4, 10, 400.0
MEDIAN_CHI2 = 0.4549  # of one degree of freedom
COLOURED = (Component.RANGE, Component.AZIMUTH, Component.ELEVATION, Component.EAST, Component.NORTH, Component.UP)


@dataclass(frozen=True, slots=True)
class Coloured:
    """A sensor's slowly varying errors, separately for each target: standard deviations (7,) and correlation time."""

    sigma: FloatArray  # (7,) m, rad; 0 for none
    tau: float  # s


@dataclass(frozen=True, slots=True)
class BatchConfig:
    """What is believed before any report.

    `prior` (5,) are the standard deviations of time (s), range (m), scale, azimuth, elevation (rad) offsets;
    `coloured` by sensor index.
    """

    q: float  # m²/s³
    prior: FloatArray
    coloured: Mapping[int, Coloured] = field(default_factory=dict)
    robust: float = 3.0  # whitened residuals beyond this (times √components) count less
    speed_sigma: float = 200.0  # m/s
    extent: float = 0.0  # m: a target's half length, which directions to it may be off by
    iterations: int = 60
    tolerance: float = 0.03  # of a standard deviation: when to stop


class Estimate(NamedTuple):
    """Constant errors of sensors and their joint covariance; one entry per column of `covariance`."""

    sensor: NDArray[np.int64]  # (k,) index
    parameter: NDArray[np.int64]  # (k,) TIME, RANGE, SCALE, AZIMUTH or ELEVATION
    value: FloatArray  # (k,) s, m, 1, rad
    covariance: FloatArray  # (k, k)
    prior: FloatArray  # (k,) standard deviation before any report
    iterations: int
    reports: NDArray[np.int64]  # (sensors,) reports of each sensor on tracks that were used
    scale: FloatArray  # (sensors,) variance of the residuals over the declared one, at least 1


def parameters_of(sensors: Sequence[Sensor], used: Sequence[int], reference: int, flat: bool) -> list[tuple[int, int]]:
    """Return the (sensor, parameter) pairs that have a meaning: what a sensor does not measure has no error."""
    out = []
    for i in used:
        if i == reference:
            continue
        s = sensors[i].sigma
        box, polar = math.isfinite(s[Component.EAST]), math.isfinite(s[Component.RANGE])
        out.append((i, TIME))
        if box or polar:
            out += [(i, RANGE), (i, SCALE)]
        if box or math.isfinite(s[Component.AZIMUTH]):
            out.append((i, AZIMUTH))
        if not flat and (math.isfinite(s[Component.UP]) or math.isfinite(s[Component.ELEVATION])):
            out.append((i, ELEVATION))
    return out


def estimate(
    observed: Observed, sensors: Sequence[Sensor], config: BatchConfig, reference: int, flat: bool
) -> Estimate:
    """Fit paths and constant errors to the reports of tracks.

    Raises UserError where nothing can be fitted: no track with reports of two sensors, or only the reference reports.
    """
    used = sorted({int(s) for s in observed.sensor})
    pairs = parameters_of(sensors, used, reference, flat)
    if not pairs:
        raise UserError("nothing to register: no track was seen by a sensor other than the reference")
    d = 2 if flat else 3
    errors = np.zeros((len(sensors), N_PARAMETERS))
    paths = [first_path(observed, k, d, config.q) for k in range(observed.tracks)]
    layout = _Layout(paths, observed, config, d)
    prior = np.array([config.prior[p] for _, p in pairs])
    value = np.zeros(len(pairs))
    slow = np.zeros(layout.n_coloured)
    covariance, done, damping, last = np.diag(prior**2), 0, 1.0, np.zeros(len(pairs))
    ranging = np.array(
        [math.isfinite(s.sigma[Component.EAST]) or math.isfinite(s.sigma[Component.RANGE]) for s in sensors]
    )
    scale = np.where(ranging, 1.0, COARSE)
    while done < config.iterations:
        done += 1
        system = _system(observed, sensors, config, pairs, value, errors, paths, layout, slow, scale)
        dx, dv, covariance = _solve(system)
        sigma = np.sqrt(np.diag(covariance))
        swings = float((dv / sigma) @ last) < 0.0  # weights that come and go with the step make it swing
        damping = max(0.5 * damping, 0.2) if swings else min(1.2 * damping, 1.0)
        last = dv / sigma
        settled = bool((np.abs(dv) <= config.tolerance * sigma).all())
        dv, dx = _shortened(damping * dv, damping * dx, 0.5 * prior)
        value = value + dv
        for (sensor, parameter), v in zip(pairs, value, strict=True):
            errors[sensor, parameter] = v
        slow = slow + dx[layout.first_coloured :]
        paths = [p._replace(x=p.x + dx[a:z].reshape(p.x.shape)) for p, a, z in layout.slices(paths)]
        if done < FIRST:
            continue
        before, scale = scale, _scales(system.lines, scale, done)
        if settled and np.allclose(before, scale, rtol=0.05):
            break
    of = np.array(pairs, dtype=np.int64)
    count = np.bincount(observed.sensor, minlength=len(sensors))
    covariance = _inflated(system, covariance)
    return Estimate(of[:, 0], of[:, 1], value, covariance, prior, done, count, scale)


def _shortened(dv: FloatArray, dx: FloatArray, limit: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Shorten a step whose constants move farther than the linearisation can be trusted."""
    share = min(1.0, float(np.min(limit / np.maximum(np.abs(dv), 1e-300))))
    return share * dv, share * dx


def _scales(lines: Lines, before: FloatArray, done: int) -> FloatArray:
    """Variance of each sensor's residuals over the declared one, by the median, never below 1; in small steps up."""
    out = np.ones(len(before))
    if done < SECOND:
        return out
    for s in range(len(before)):
        mine = lines.raw[lines.sensor == s]
        mine = mine[np.isfinite(mine)]
        if len(mine):
            out[s] = np.clip(float(np.median(mine**2)) / MEDIAN_CHI2, 1.0, 1.5 * before[s])
    return out


class _Layout:
    """Where each unknown stands: paths first, then the coloured errors of every (track, sensor, component)."""

    def __init__(self, paths: list[Path], observed: Observed, config: BatchConfig, d: int) -> None:
        self.start = np.cumsum([0, *(p.x.size for p in paths)])
        self.first_coloured = int(self.start[-1])
        self.channels: dict[tuple[int, int, int], tuple[int, int]] = {}
        at = 0
        for k, path in enumerate(paths):
            mine = observed.track == k
            for s in sorted({int(v) for v in observed.sensor[mine]}):
                c = config.coloured.get(s)
                for component in COLOURED:
                    rows = mine & (observed.sensor == s)
                    flat_out = d == 2 and component in (Component.ELEVATION, Component.UP)
                    seen = np.isfinite(observed.z[rows, component]).any()
                    if c is not None and c.sigma[component] > 0.0 and seen and not flat_out:
                        self.channels[k, s, int(component)] = (at, len(path.t))
                        at += len(path.t)
        self.n_coloured = at
        self.n = self.first_coloured + at

    def slices(self, paths: list[Path]) -> list[tuple[Path, int, int]]:
        """Each path with the span of its unknowns."""
        return [(p, int(self.start[k]), int(self.start[k + 1])) for k, p in enumerate(paths)]


class _System(NamedTuple):
    """All residuals, linearised and whitened: r ≈ J dx + T dv, and the prior of the constants."""

    J: sparse.csr_matrix  # (rows, n) by paths and coloured errors
    T: FloatArray  # (lines, k) by the constants; the rows after have none
    r: FloatArray  # (rows,)
    cluster: NDArray[np.int64]  # (rows,)
    prior: FloatArray  # (k,)
    value: FloatArray  # (k,)
    lines: Lines


def _system(
    observed: Observed,
    sensors: Sequence[Sensor],
    config: BatchConfig,
    pairs: list[tuple[int, int]],
    value: FloatArray,
    errors: FloatArray,
    paths: list[Path],
    layout: _Layout,
    slow: FloatArray,
    scale: FloatArray,
) -> _System:
    rows = _Rows()
    lines = linearise(
        observed,
        paths,
        errors,
        sensors,
        layout.channels,
        layout.first_coloured,
        slow,
        config.robust,
        scale,
        config.extent,
    )
    T = np.zeros((lines.lines, len(pairs)))
    for i, (sensor, parameter) in enumerate(pairs):
        mine = lines.sensor == sensor
        T[mine, i] = lines.S[mine, parameter]
    rows.add(lines.row, lines.place([int(v) for v in layout.start[:-1]]), lines.value)
    rows.end(lines.y, lines.cluster)
    for k, path in enumerate(paths):
        _motion(rows, path, k, int(layout.start[k]), config)
    for (k, s, component), (first, size) in layout.channels.items():
        c = config.coloured[s]
        part = slow[first : first + size]
        _colour(rows, part, cluster_of(k, paths[k].t), layout.first_coloured + first, c.sigma[component], c.tau)
    r = np.concatenate(rows.r)
    entries = (np.concatenate(rows.v), (np.concatenate(rows.i), np.concatenate(rows.j)))
    J = sparse.csr_matrix(entries, shape=(len(r), layout.n))
    prior = np.array([config.prior[p] for _, p in pairs])
    return _System(J, T, r, np.concatenate(rows.cluster), prior, value, lines)


class _Rows:
    """Triplets of a sparse matrix, and what stands on the right."""

    def __init__(self) -> None:
        self.i: list[NDArray[np.int64]] = []
        self.j: list[NDArray[np.int64]] = []
        self.v: list[FloatArray] = []
        self.r: list[FloatArray] = []
        self.cluster: list[NDArray[np.int64]] = []
        self.at = 0

    def add(self, i: NDArray[np.int64], j: NDArray[np.int64], v: FloatArray) -> None:
        """Add entries; rows count from the end of what is there."""
        self.i.append(self.at + np.asarray(i, dtype=np.int64).ravel())
        self.j.append(np.asarray(j, dtype=np.int64).ravel())
        self.v.append(np.asarray(v, dtype=np.float64).ravel())

    def end(self, r: FloatArray, cluster: NDArray[np.int64]) -> None:
        """Say what stands on the right of the rows begun."""
        self.r.append(r)
        self.cluster.append(cluster)
        self.at += len(r)


def _motion(rows: _Rows, path: Path, track: int, start: int, config: BatchConfig) -> None:
    """White acceleration between knots, and a loose prior of the first velocity."""
    n, width = path.x.shape
    d = width // 2
    h = KNOT
    L = np.linalg.cholesky(np.linalg.inv(config.q * np.array([[h**3 / 3, h**2 / 2], [h**2 / 2, h]]))).T
    left = -L @ np.array([[1.0, h], [0.0, 1.0]])
    i, here = np.arange(n - 1), start + width * np.arange(n - 1)
    cluster = cluster_of(track, path.t)
    for a in range(d):
        state = path.x[:, [a, a + d]]
        for e in range(2):
            for c in range(2):
                rows.add(i, here + a + c * d, np.full(n - 1, left[e, c]))
                rows.add(i, here + width + a + c * d, np.full(n - 1, L[e, c]))
            rows.end(-(state[:-1] @ left[e] + state[1:] @ L[e]), cluster[1:])
        rows.add(np.zeros(1, np.int64), np.array([start + d + a]), np.array([1.0 / config.speed_sigma]))
        rows.end(-path.x[:1, d + a] / config.speed_sigma, cluster[:1])


def _colour(rows: _Rows, b: FloatArray, cluster: NDArray[np.int64], first: int, sigma: float, tau: float) -> None:
    """A Gauss–Markov process on the knots, stationary from the first."""
    n = len(b)
    keep = math.exp(-KNOT / tau)
    w = 1.0 / (sigma * math.sqrt(1.0 - keep**2))
    i = np.arange(n - 1)
    rows.add(i, first + i, np.full(n - 1, -keep * w))
    rows.add(i, first + 1 + i, np.full(n - 1, w))
    rows.end(-w * (b[1:] - keep * b[:-1]), cluster[1:])
    rows.add(np.zeros(1, np.int64), np.array([first]), np.array([1.0 / sigma]))
    rows.end(-b[:1] / sigma, cluster[:1])


def _reduced(system: _System) -> tuple[object, FloatArray, FloatArray, FloatArray]:
    """Eliminate the paths: factor, what the constants do to them (n, k), and covariance of the constants alone."""
    N = (system.J.T @ system.J).tocsc()
    lines = len(system.T)
    C = np.asarray(system.J[:lines].T @ system.T)
    factor = splu(N + 1e-9 * sparse.identity(N.shape[0], format="csc"), permc_spec="MMD_AT_PLUS_A")
    NC = factor.solve(C)
    information = system.T.T @ system.T + np.diag(system.prior**-2.0) - C.T @ NC
    return factor, C, NC, np.asarray(np.linalg.inv(0.5 * (information + information.T)))


def _solve(system: _System) -> tuple[FloatArray, FloatArray, FloatArray]:
    """One step of Gauss–Newton: paths and coloured errors (n,), constants (k,), and their covariance (k, k)."""
    factor, C, NC, covariance = _reduced(system)
    Ng = factor.solve(np.asarray(system.J.T @ system.r))  # type: ignore[attr-defined]
    gc = system.T.T @ system.r[: len(system.T)] - system.value / system.prior**2
    dv = covariance @ (gc - C.T @ Ng)
    return Ng - NC @ dv, dv, covariance


def _inflated(system: _System, covariance: FloatArray) -> FloatArray:
    """Raise variances to what the scores' scatter between stretches of time says."""
    _, _, NC, _ = _reduced(system)
    U = -np.asarray(system.J @ NC)
    U[: len(system.T)] += system.T
    _, group = np.unique(system.cluster, return_inverse=True)
    scores = np.zeros((int(group.max()) + 1, U.shape[1]))
    np.add.at(scores, group, U * system.r[:, None])
    few = len(scores) / max(len(scores) - 1.0, 1.0)
    sandwich = few * covariance @ (scores.T @ scores) @ covariance
    root = np.sqrt(np.maximum(1.0, np.diag(sandwich) / np.diag(covariance)))
    return np.asarray(np.minimum(root, 1e6)[:, None] * covariance * np.minimum(root, 1e6))
