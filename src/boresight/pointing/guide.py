"""Several guide sources, one target: the filter that every report enters at its own time (kernels.guide)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from boresight.errors import UserError
from boresight.kernels import guide_run as kernel
from boresight.kernels.guide import DIRECTION, POSITION, TRACK, WORK
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

    `sigma_angle` (rad, across the line of sight) and `sigma_range` (m) for a source of directions, `sigma_position`
    (m per axis) for one of positions. `sigma_bias` (m) is the prior of a constant bias along, across and up of the
    motion; 0: it has none (own tracking: the beam itself is the reference). `correlation` (s), instead of a sigma,
    makes it another tracker's track: its reports bring their own covariance, and their errors resemble each other over
    this time (at most exp(-lag / correlation); 0: they are independent).
    """

    id: str
    sigma_angle: float = 0.0
    sigma_range: float = 0.0
    sigma_position: float = 0.0
    sigma_bias: float = 0.0
    correlation: float | None = None

    def __post_init__(self) -> None:
        if self.correlation is not None:
            if not 0.0 <= self.correlation < math.inf:
                raise UserError(f"source '{self.id}': the correlation time of a track must not be negative")
            if self.sigma_angle or self.sigma_range or self.sigma_position:
                raise UserError(f"source '{self.id}': a track brings its own covariance; leave its sigma out")
        elif (self.sigma_angle > 0) == (self.sigma_position > 0):
            raise UserError(
                f"source '{self.id}': give either a sigma of its angles or one of its position, above "
                "zero, or the correlation time of its errors if it is another tracker's track"
            )
        if self.sigma_bias < 0 or self.sigma_range < 0:
            raise UserError(f"source '{self.id}': a sigma is negative")

    @property
    def kind(self) -> int:
        """Whether its reports are directions, positions or tracks."""
        if self.correlation is not None:
            return TRACK
        return DIRECTION if self.sigma_angle > 0 else POSITION

    @property
    def sigma(self) -> FloatArray:
        """The pair (2,) that the kernels take."""
        if self.correlation is not None:
            return np.array([math.sqrt(INFLATION) if self.correlation > 0.0 else 1.0, 0.0])
        if self.kind == POSITION:
            return np.array([self.sigma_position, 0.0])
        return np.array([self.sigma_angle, self.sigma_range])

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
    biased: Fates  # (k,) source that is held to be biased, -1 for none
    fate: Fates


class Reports(NamedTuple):
    """Reports of all sources in order of arrival, as columns."""

    source: Fates  # (n,)
    t: FloatArray  # (n,) s, validity
    t_recv: FloatArray  # (n,) s
    z: FloatArray  # (n, 3) azimuth, elevation (rad), range (m or NaN) in `axes`; or ECEF m
    origin: FloatArray  # (n, 3) ECEF m, where a source of directions stood
    axes: FloatArray  # (n, 3, 3) ECEF from its east/north/up-like axes


@dataclass(frozen=True, slots=True)
class GuideFilter:
    """Extended Kalman filter in an inertial frame, with one hypothesis per source that it is biased.

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
        n, h = (9 if self.orbit else 12), 1 + len(self.sources)
        return GuideState(
            np.zeros(kernel.N_CLOCK), np.zeros((h, n)), np.zeros((h, n, n)), np.zeros(h), np.ones(h - 1),
            np.zeros(h - 1), np.full(h - 1, -math.inf), np.zeros(WORK),
        )  # fmt: skip

    def step(
        self, state: GuideState, source: int, t: float, z: FloatArray, origin: FloatArray = NONE, axes: FloatArray = EYE
    ) -> int:
        """Take in one report, in the state's own arrays; returns its fate (`kernels.guide_run`, or THINNED).

        `z`: azimuth, elevation (rad), range (m or NaN) from `origin` in `axes` (ECEF m; rotation); or ECEF position
        (m) with a covariance of sigma² axes axes'; or a track: position, or position and velocity (6,), with a
        covariance of axes axes' (`GuideSource.axes_of`).
        """
        s = self.sources[source]
        begun = state.clock[kernel.C_STARTED] != 0.0
        if begun and s.correlation is not None and abs(t - state.looked[source]) < s.correlation:
            return THINNED
        fate = int(
            kernel.step(
                *state[:6], self._settings, np.array(self.spread), source, s.kind, t, z, origin, axes, s.sigma,
                self._sigma_bias, state.work,
            )
        )  # fmt: skip
        if fate == kernel.ACCEPTED:
            state.looked[source] = t
        return fate

    def predict(self, state: GuideState, t: float) -> Predicted | None:
        """Return the target at time `t` (s), or None before the start; the state is left alone."""
        out = Predicted(np.empty(3), np.empty(3), np.empty((3, 3)))
        ok = kernel.predict_to(state.clock, state.X, state.P, self._settings, t, *out, state.work)
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
        sigma = np.stack([s.sigma for s in self.sources])[reports.source]
        kind = np.array([s.kind for s in self.sources], dtype=np.int64)[reports.source]
        out = Run(np.empty((k, 3)), np.empty((k, 3)), np.empty((k, 3, 3)), np.empty(k, np.int64), np.empty(n, np.int64))
        kernel.run(
            *state[:6], self._settings, np.array(self.spread), reports.source, kind, *reports[1:], sigma,
            self._sigma_bias, node, aim, *out,
        )  # fmt: skip
        out.biased[:] -= 1
        return out

    @property
    def _settings(self) -> FloatArray:
        return kernel.settings_of(self.orbit, self.q, self.gate, self.forget, self.max_age, self.restart)

    @property
    def _sigma_bias(self) -> FloatArray:
        return np.array([s.sigma_bias for s in self.sources])


def snapshot(state: GuideState) -> GuideState:
    """Return a copy that later steps do not change."""
    clock, X, P, L, scale, run_of, looked = (a.copy() for a in state[:7])
    return GuideState(clock, X, P, L, scale, run_of, looked, state.work)


def merged(reports: tuple[Reports, ...]) -> Reports:
    """Return the sources' reports as one stream in order of arrival."""
    columns = [np.concatenate([r[i] for r in reports]) for i in range(len(Reports._fields))]
    order = np.lexsort((columns[1], columns[2]))
    return Reports(*(np.ascontiguousarray(c[order]) for c in columns))
