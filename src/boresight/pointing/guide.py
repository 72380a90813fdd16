"""Several guide sources, one target: the filter that every report enters at its own time (kernels.guide)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from boresight.errors import UserError
from boresight.kernels import guide_run as kernel
from boresight.kernels.guide import DIRECTION, LEAST_WIDTH, POSITION, ROWS, TRACK
from boresight.kernels.guide_begin import N_SEEN
from boresight.types.sensor import FloatArray

Fates = NDArray[np.int64]
NONE: FloatArray = np.zeros(3)
EYE: FloatArray = np.eye(3)
THINNED = 4  # the fate of a track that came within the correlation time of the last one taken
# Looks a correlation time or more apart, each counted with this much of its covariance, are never counted for more
# than they say: the rows of their correlation matrix, exp(-lag / time), add up to at most this.
INFLATION = (1.0 + math.exp(-1.0)) / (1.0 - math.exp(-1.0))


@dataclass(frozen=True, slots=True)
class GuideSource:
    """One source: its noise and how far it may be off.

    A source of directions has `sigma_azimuth` and `sigma_elevation` (rad, about its own axes) or, the same in every
    direction across the line of sight, `sigma_angle` (rad); and `sigma_range` (m). What has no sigma is not used, but
    for a range to begin with. A source of positions has `sigma_position` (m per axis).

    `bias_azimuth`, `bias_elevation` (rad), `bias_range` (m), `bias_time` (s, stamp minus validity) are the standard
    deviations of constant errors that it surely has; they are estimated beside the target. `suspect`: where it declares
    none, its angles and range may be off all the same, by several sigma; one hypothesis more holds that of all such
    sources, and steers where what they say together asks for it. `sigma_bias` (m) is the
    prior of a gross error along, across and up of the motion, that it may have; 0: it never has one (own tracking: the
    beam itself is the reference). `correlation` (s), instead of a sigma, makes it another tracker's track: its reports
    bring their own covariance, and their errors resemble each other over this time (at most exp(-lag / correlation);
    0: they are independent). Raises UserError for values that do not go together.
    """

    id: str
    sigma_angle: float = 0.0
    sigma_range: float = 0.0
    sigma_position: float = 0.0
    sigma_bias: float = 0.0
    correlation: float | None = None
    sigma_azimuth: float = 0.0
    sigma_elevation: float = 0.0
    bias_azimuth: float = 0.0
    bias_elevation: float = 0.0
    bias_range: float = 0.0
    bias_time: float = 0.0
    suspect: bool = False

    def __post_init__(self) -> None:
        directions = (self.sigma_angle, self.sigma_azimuth, self.sigma_elevation, self.sigma_range)
        all_of_them = (*directions, self.sigma_position, self.sigma_bias, *self.offsets)
        if not all(0.0 <= v < math.inf for v in all_of_them):
            raise UserError(f"source '{self.id}': a sigma or bias is negative or no finite number")
        if self.correlation is not None:
            if not 0.0 <= self.correlation < math.inf:
                raise UserError(f"source '{self.id}': the correlation time of a track must not be negative")
            if any(directions) or self.sigma_position:
                raise UserError(f"source '{self.id}': a track brings its own covariance; leave its sigma out")
        elif any(directions) == (self.sigma_position > 0):
            raise UserError(
                f"source '{self.id}': give either a sigma of its angles or range, or one of its position, above "
                "zero, or the correlation time of its errors if it is another tracker's track"
            )
        if self.sigma_angle and (self.sigma_azimuth or self.sigma_elevation):
            raise UserError(f"source '{self.id}': give sigma_angle, or sigma_azimuth and sigma_elevation, not both")
        if self.kind != DIRECTION and any(self.offsets[:3]):
            raise UserError(
                f"source '{self.id}': biases of azimuth, elevation and range go with a source of directions"
            )

    @property
    def kind(self) -> int:
        """Whether its reports are directions, positions or tracks."""
        if self.correlation is not None:
            return TRACK
        return POSITION if self.sigma_position > 0 else DIRECTION

    @property
    def sigma(self) -> FloatArray:
        """The noise (4,) as the kernels take it (`kernels.guide.look_at`)."""
        if self.correlation is not None:
            return np.array([math.sqrt(INFLATION) if self.correlation > 0.0 else 1.0, 0.0, 0.0, 0.0])
        if self.kind == POSITION:
            return np.array([self.sigma_position, 0.0, 0.0, 0.0])
        if self.sigma_angle:
            return np.array([self.sigma_angle, self.sigma_angle, self.sigma_range, 1.0])
        return np.array([self.sigma_azimuth, self.sigma_elevation, self.sigma_range, 0.0])

    @property
    def offsets(self) -> tuple[float, float, float, float]:
        """The priors of its constant errors in azimuth, elevation (rad), range (m) and time (s)."""
        return self.bias_azimuth, self.bias_elevation, self.bias_range, self.bias_time

    @property
    def suspected(self) -> tuple[float, float, float, float]:
        """Priors of errors that it does not declare, 0 for none: four sigma, and 0.06° or 30 m more."""
        if not self.suspect or self.kind != DIRECTION or any(self.offsets):
            return 0.0, 0.0, 0.0, 0.0
        more = (math.radians(0.06), math.radians(0.06), 30.0)
        azimuth, elevation, far = (
            math.hypot(4.0 * s, far) if s > 0.0 else 0.0 for s, far in zip(self.sigma, more, strict=False)
        )
        return azimuth, elevation, far, 0.0

    @property
    def sigma_across(self) -> float:
        """The noise of its directions across the line of sight (rad), in the mean; 0 where it measures none."""
        angles = [v for v in (self.sigma_angle, self.sigma_azimuth, self.sigma_elevation) if v > 0.0]
        return math.sqrt(sum(v * v for v in angles) / len(angles)) if angles else 0.0

    def axes_of(self, covariance: FloatArray) -> FloatArray:
        """Return the `axes` (k, k) by which a position or track carries a covariance (k, k) (ECEF, m²) of its own.

        Raises numpy.linalg.LinAlgError for one that is not positive definite.
        """
        root: FloatArray = np.linalg.cholesky(np.asarray(covariance, dtype=np.float64))
        return root if self.correlation is not None else root / self.sigma_position


class GuideState(NamedTuple):
    """All that changes; `GuideFilter.step` works in its arrays. Copy with `snapshot`."""

    clock: FloatArray
    X: FloatArray
    P: FloatArray
    L: FloatArray
    scale: FloatArray  # (s,) learned factor on each source's variance
    run_of: FloatArray
    seen: FloatArray  # (s, N_SEEN) what sources of directions said before the start
    looked: FloatArray  # (s,) s, validity of the last track taken of each source
    work: FloatArray


class Predicted(NamedTuple):
    """The target at one time, in ECEF (m, m/s against the turning Earth, m²)."""

    position: FloatArray  # (3,)
    velocity: FloatArray  # (3,)
    covariance: FloatArray  # (3, 3)


class Run(NamedTuple):
    """A whole run: per node (k, …) the prediction to its aim time, NaN before the start, and each report's fate."""

    position: FloatArray
    velocity: FloatArray
    covariance: FloatArray
    biased: Fates  # (k,) source that is held to be biased, -1 for none, their number for several
    fate: Fates


class Reports(NamedTuple):
    """Reports of all sources in order of arrival, as columns."""

    source: Fates  # (n,)
    t: FloatArray  # (n,) s, validity
    t_recv: FloatArray  # (n,) s
    z: FloatArray  # (n, 3) azimuth, elevation (rad), range (m) in `axes`, NaN where not measured; or ECEF m
    origin: FloatArray  # (n, 3) ECEF m, where a source of directions stood
    axes: FloatArray  # (n, 3, 3) ECEF from its east/north/up-like axes


@dataclass(frozen=True, slots=True)
class GuideFilter:
    """Extended Kalman filter in an inertial frame, with one hypothesis per source that it is grossly biased.

    Every hypothesis also estimates the constant biases that sources declare, several at once.

    `orbit`: two bodies and J2, with white acceleration q (m²/s³); else near-constant acceleration, with white jerk q
    (m²/s⁵). A report whose NIS exceeds `gate` is rejected; after `restart` rejections more than acceptances the filter
    starts anew. The variance of every source is learned with `forget` per report. Reports more than `max_age` (s)
    behind the newest are left out.
    """

    sources: tuple[GuideSource, ...]
    orbit: bool = True
    q: float = 1e-3
    gate: float = 30.0
    forget: float = 0.02
    max_age: float = 5.0
    restart: int = 8
    spread: tuple[float, float, float] = (1e5, 8e3, 50.0)  # m, m/s, m/s² at the start

    def __post_init__(self) -> None:
        if not self.sources:
            raise UserError("a guide filter needs at least one source")
        if not (self.q > 0 and self.gate > 0 and self.max_age > 0 and self.restart >= 2):
            raise UserError("guide filter: q, gate and max_age must be above zero, and restart at least 2")

    def init(self) -> GuideState:
        """Return the state before the first report."""
        tables = _tables(self)
        held, whole = (int(v) for v in tables.settings[-2:])
        sources = len(self.sources)
        n, h = max(held + 3, whole), 1 + sources + (whole > held)
        return GuideState(
            np.zeros(kernel.N_CLOCK), np.zeros((h, n)), np.zeros((h, n, n)), np.zeros(h), np.ones(sources),
            np.zeros(sources), np.full((sources, N_SEEN), math.nan), np.full(sources, -math.inf),
            np.zeros((ROWS, max(n, LEAST_WIDTH))),
        )  # fmt: skip

    def step(
        self, state: GuideState, source: int, t: float, z: FloatArray, origin: FloatArray = NONE, axes: FloatArray = EYE
    ) -> int:
        """Take in one report, in the state's own arrays; returns its fate (`kernels.guide_run`, or THINNED).

        Raises UserError for a source that is not there and arrays of other shapes, before anything is changed.

        `z`: azimuth, elevation (rad), range (m) from `origin` in `axes` (ECEF m; rotation), any of them NaN where it
        was not measured; or ECEF position (m) with a covariance of sigma² axes axes'; or a track: position, or position
        and velocity (6,), with a covariance of axes axes' (`GuideSource.axes_of`).
        """
        z, origin, axes = self._checked(state, source, t, z, origin, axes)
        s, tables = self.sources[source], _tables(self)
        begun = state.clock[kernel.C_STARTED] != 0.0
        if begun and s.correlation is not None and abs(t - state.looked[source]) < s.correlation:
            return THINNED
        fate = int(
            kernel.step(
                *state[:7], tables.settings, tables.spread, source, s.kind, t, z, origin, axes, tables.sigma[source],
                tables.columns, tables.priors, tables.sigma_bias, state.work,
            )
        )  # fmt: skip
        if fate == kernel.ACCEPTED:
            state.looked[source] = t
        return fate

    def _checked(
        self, state: GuideState, source: int, t: float, z: FloatArray, origin: FloatArray, axes: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return a report's arrays as the kernels take them; raises UserError for what they would read beyond."""
        if not 0 <= source < len(self.sources):
            raise UserError(f"source {source}: there are {len(self.sources)}, from 0 on")
        name = self.sources[source].id
        if not math.isfinite(t):
            raise UserError(f"source '{name}': the report's time is {t}")
        if state.X.shape[0] <= len(self.sources) or len(state.scale) != len(self.sources):
            raise UserError("the state is of another guide filter: begin with init()")
        z, origin, axes = _array(z, "z", name), _array(origin, "origin", name), _array(axes, "axes", name)
        k = len(z) if self.sources[source].kind == TRACK and z.shape == (6,) else 3
        for one, what, shape in ((z, "z", (k,)), (origin, "origin", (3,)), (axes, "axes", (k, k))):
            if one.shape != shape:
                raise UserError(f"source '{name}': {what} has shape {one.shape}, {shape} is needed")
        return z, origin, axes

    def surprise(
        self, state: GuideState, source: int, t: float, z: FloatArray, origin: FloatArray = NONE, axes: FloatArray = EYE
    ) -> float:
        """Return the NIS that a report would have; NaN before the start. The state is left alone.

        Of several detections of a look the least is the likeliest to be the target.
        """
        z, origin, axes = self._checked(state, source, t, z, origin, axes)
        s, tables = self.sources[source], _tables(self)
        return float(
            kernel.surprise(
                state.clock, state.X, state.P, state.scale, tables.settings, source, s.kind, t, z, origin, axes,
                tables.sigma[source], tables.columns, state.work,
            )
        )  # fmt: skip

    def biases(self, state: GuideState) -> tuple[FloatArray, FloatArray]:
        """Return each source's estimated biases (s, 4) in azimuth, elevation (rad), range (m), time (s), and sigmas.

        0 and 0 for what a source does not declare.
        """
        tables, begun = _tables(self), state.clock[kernel.C_STARTED] != 0.0
        best = int(state.clock[kernel.C_BEST])
        table = int(best > len(self.sources))
        at = tables.columns[table]
        mean, sigma = np.zeros(at.shape), np.zeros(at.shape)
        held = at >= 0
        mean[held] = state.X[best, at[held]] if begun else 0.0
        sigma[held] = np.sqrt(state.P[best, at[held], at[held]]) if begun else tables.priors[table][held]
        return mean, sigma

    def predict(self, state: GuideState, t: float) -> Predicted | None:
        """Return the target at time `t` (s), None before the start and a day after; the state is left alone."""
        out = Predicted(np.empty(3), np.empty(3), np.empty((3, 3)))
        ok = kernel.predict_to(state.clock, state.X, state.P, _tables(self).settings, t, *out, state.work)
        return out if ok else None

    def restart_now(self, state: GuideState) -> None:
        """Forget the target, in the state's own arrays: the next report with a position begins anew."""
        state.clock[kernel.C_STARTED] = 0.0
        state.clock[kernel.C_RESTARTS] += 1.0

    def run(self, reports: Reports, node: ArrayLike, aim: ArrayLike) -> Run:
        """Step through reports, predicting at each `node` (k,) (s) to its `aim` time (k,) from what had arrived.

        Raises UserError if a source is another tracker's track: these are stepped one by one.
        """
        if any(s.correlation is not None for s in self.sources):
            raise UserError("tracks of another tracker are thinned as they come: use step")
        node, aim = np.asarray(node, dtype=np.float64), np.asarray(aim, dtype=np.float64)
        state, k, n = self.init(), len(node), len(reports.t)
        rows = len(reports.t)
        shapes = ((rows,), (rows,), (rows,), (rows, 3), (rows, 3), (rows, 3, 3))
        if any(np.shape(a) != shape for a, shape in zip(reports, shapes, strict=True)) or aim.shape != node.shape:
            raise UserError("reports: columns of one length, z, origin (n, 3), axes (n, 3, 3); as many aims as nodes")
        if rows and not 0 <= np.min(reports.source) <= np.max(reports.source) < len(self.sources):
            raise UserError(f"reports: a source is not one of the {len(self.sources)}")
        tables = _tables(self)
        sigma = tables.sigma[reports.source]
        kind = np.array([s.kind for s in self.sources], dtype=np.int64)[reports.source]
        out = Run(np.empty((k, 3)), np.empty((k, 3)), np.empty((k, 3, 3)), np.empty(k, np.int64), np.empty(n, np.int64))
        kernel.run(
            *state[:7], tables.settings, tables.spread, reports.source, kind, *reports[1:], sigma,
            tables.columns, tables.priors, tables.sigma_bias, node, aim, *out,
        )  # fmt: skip
        out.biased[:] -= 1
        return out


def _array(a: ArrayLike, what: str, name: str) -> FloatArray:
    """Return contiguous float64; the array itself if it is that."""
    if type(a) is np.ndarray and a.dtype == np.float64 and a.flags.c_contiguous:
        return a
    try:
        return np.ascontiguousarray(a, dtype=np.float64)
    except (TypeError, ValueError):
        raise UserError(f"source '{name}': {what} is no array of numbers") from None


class _Tables(NamedTuple):
    """A filter's configuration as the kernels take it (`kernels.guide_run.step`)."""

    settings: FloatArray
    spread: FloatArray
    sigma: FloatArray  # (s, 4)
    columns: Fates  # (2, s, 4)
    priors: FloatArray  # (2, s, 4)
    sigma_bias: FloatArray  # (s,)


@lru_cache(maxsize=64)
def _tables(f: GuideFilter) -> _Tables:
    declared = np.array([s.offsets for s in f.sources])
    suspected = np.array([s.suspected for s in f.sources])
    priors = np.stack([declared, np.where(declared > 0.0, declared, suspected)])
    columns = np.full(priors.shape, -1, dtype=np.int64)
    m = 6 if f.orbit else 9
    held = m + int(np.sum(declared > 0.0))
    columns[:, declared > 0.0] = np.arange(m, held)
    whole = held + int(np.sum(suspected > 0.0))
    columns[1, suspected > 0.0] = np.arange(held, whole)
    settings = kernel.settings_of(f.orbit, f.q, f.gate, f.forget, f.max_age, f.restart, held, whole)
    sigma = np.stack([s.sigma for s in f.sources])
    return _Tables(settings, np.array(f.spread), sigma, columns, priors, np.array([s.sigma_bias for s in f.sources]))


def biased(sources: tuple[GuideSource, ...], clock: FloatArray) -> str:
    """Return who is held to be biased, in words; empty for nobody."""
    best = int(clock[kernel.C_BEST])
    return "" if not best else ("several are biased" if best > len(sources) else f"{sources[best - 1].id} is biased")


def snapshot(state: GuideState) -> GuideState:
    """Return a copy that later steps do not change."""
    return GuideState._make(a if a is state.work else a.copy() for a in state)


def merged(reports: tuple[Reports, ...]) -> Reports:
    """Return the sources' reports as one stream in order of arrival."""
    columns = [np.concatenate([r[i] for r in reports]) for i in range(len(Reports._fields))]
    order = np.lexsort((columns[1], columns[2]))
    return Reports(*(np.ascontiguousarray(c[order]) for c in columns))
