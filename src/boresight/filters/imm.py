"""Interacting multiple models (IMM): several motion models at once, of any dimensions, weighed by likelihood."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from boresight.errors import UserError
from boresight.filters import ekf
from boresight.filters.stream import Reports, require_all
from boresight.kernels import imm
from boresight.models import check
from boresight.models.motion.base import SCALARS, KernelMotion
from boresight.models.protocols import MeasurementModel
from boresight.types.sensor import FloatArray
from boresight.types.state import GaussianState, UpdateInfo


class MixtureState(NamedTuple):
    """An IMM's belief: each model's own, packed to the largest dimension N; `x` and `P` are what all have in common."""

    t: float  # s
    x: FloatArray  # (n,) moment-matched position and velocity
    P: FloatArray  # (n, n)
    weights: FloatArray  # (r,) probability of each model
    X: FloatArray  # (r, N)
    PP: FloatArray  # (r, N, N)


class MixtureRun(NamedTuple):
    """A stream's results: `x` (k, n), `P` (k, n, n), `weights` (k, r); where kept, each model's own `X`, `PP`."""

    t: FloatArray
    x: FloatArray
    P: FloatArray
    weights: FloatArray
    X: FloatArray  # (k, r, N), or empty
    PP: FloatArray  # (k, r, N, N), or empty


@dataclass(frozen=True)
class InteractingModels:
    """IMM over any set of models: EKFs that are mixed before every prediction (Blom and Bar-Shalom 1988).

    `sojourn` (s) is how long the target stays with a model on average, for all or one each; it then takes any other
    with equal probability. Models need the same space; components are matched by `layout`, and a model that lacks one
    takes part with the other's own belief of it. Raises UserError.
    """

    motions: tuple[KernelMotion, ...]
    sojourn: float | tuple[float, ...] = 10.0
    rates: FloatArray = field(init=False, repr=False, compare=False)  # (r, r) 1/s
    sizes: NDArray[np.int64] = field(init=False, repr=False, compare=False)  # (r,)
    labels: NDArray[np.int64] = field(init=False, repr=False, compare=False)  # (r, N)

    def __post_init__(self) -> None:
        r = len(self.motions)
        if not r:
            raise UserError("give at least one motion model")
        if len({m.dimensions for m in self.motions}) > 1:
            raise UserError("the motion models must have the same number of dimensions")
        stays = (self.sojourn,) * r if isinstance(self.sojourn, int | float) else self.sojourn
        if len(stays) != r:
            raise UserError(f"give one sojourn time, or one for each of the {r} models, not {len(stays)}")
        for stay in stays:
            check.positive("sojourn", stay)
        rates = np.zeros((r, r))
        if r > 1:
            for i, stay in enumerate(stays):
                rates[i] = 1.0 / (stay * (r - 1))
                rates[i, i] = -1.0 / stay
        names = sorted({block for m in self.motions for block in m.layout})
        sizes = np.array([m.state_dimension for m in self.motions], dtype=np.int64)
        labels = np.full((r, int(sizes.max())), -1, dtype=np.int64)
        for i, m in enumerate(self.motions):
            row = [
                3 * names.index(block) + a for block in m.layout for a in range(1 if block in SCALARS else m.dimensions)
            ]
            labels[i, : len(row)] = row
        for name, value in (("rates", rates), ("sizes", sizes), ("labels", labels)):
            object.__setattr__(self, name, value)

    def init(
        self, t: float, x: FloatArray, P: FloatArray, extra_sigma: Sequence[float], weights: FloatArray | None = None
    ) -> MixtureState:
        """Begin every model from position and velocity (2d,) with covariance (2d, 2d) at `t`.

        Further components begin at zero with the model's `extra_sigma` (one per model; unused where it has none).
        """
        prior = ekf.init(t, x, P)
        r, N, n = len(self.motions), int(self.sizes.max()), 2 * self.motions[0].dimensions
        if len(prior.x) != n or len(extra_sigma) != r:
            raise UserError(f"the prior must hold {n} components, and extra_sigma one value for each of {r} models")
        X, PP = np.zeros((r, N)), np.zeros((r, N, N))
        for j, size in enumerate(self.sizes):
            X[j, :n], PP[j, :n, :n] = prior.x, prior.P
            for a in range(n, size):
                PP[j, a, a] = extra_sigma[j] ** 2
        w = np.full(r, 1.0 / r) if weights is None else np.array(weights, dtype=float)
        return MixtureState(prior.t, prior.x, prior.P, w, X, PP)

    def predict(self, state: MixtureState, t: float) -> MixtureState:
        """Mix, then move every model to time `t` (s)."""
        dt = t - state.t
        if not dt >= 0.0 or not math.isfinite(dt):
            raise UserError(f"cannot predict from t = {state.t!r} to t = {t!r}: time must not run backwards")
        weights, X, PP = state.weights, state.X, state.PP
        if dt > 0.0:
            weights, X, PP = imm.mix(weights, imm.markov(self.rates, dt), X, PP, self.sizes, self.labels)
        X_out, P_out = np.zeros_like(X), np.zeros_like(PP)
        for j, (motion, n) in enumerate(zip(self.motions, self.sizes)):
            moved = ekf.predict(GaussianState(state.t, X[j, :n].copy(), PP[j, :n, :n].copy()), motion, t)
            X_out[j, :n], P_out[j, :n, :n] = moved.x, moved.P
        return self._joined(t, weights, X_out, P_out)

    def update(
        self, state: MixtureState, sensor: MeasurementModel, z: FloatArray
    ) -> tuple[MixtureState, tuple[UpdateInfo, ...]]:
        """Condition every model on one report and weigh it by its likelihood; one info per model."""
        X, PP, infos = np.zeros_like(state.X), np.zeros_like(state.PP), []
        for j, n in enumerate(self.sizes):
            own = GaussianState(state.t, state.X[j, :n].copy(), state.PP[j, :n, :n].copy())
            after, info = ekf.update(own, sensor, z)
            X[j, :n], PP[j, :n, :n] = after.x, after.P
            infos.append(info)
        weights = imm.reweigh(state.weights, np.array([info.log_likelihood for info in infos]))
        return self._joined(state.t, weights, X, PP), tuple(infos)

    def run(
        self,
        state: MixtureState,
        reports: Reports,
        sensor: NDArray[np.int64] | None = None,
        scale: FloatArray | None = None,
        memory: float = 0.0,
        limit: float = 1.0,
        keep: bool = False,
    ) -> MixtureRun:
        """Filter a whole stream in one call; the models must share one kernel, as the built-in ones do.

        `keep` keeps each model's belief after every report, as `smooth` needs. The four before are for
        `filters.adaptive`: which sensor each report is of (k,), the scales (s, 7) of their noise variances (changed in
        place), how many reports the adaptation remembers (0: none), and its limit.
        """
        k, n, r = len(reports.t), 2 * self.motions[0].dimensions, len(self.motions)
        sensor = np.zeros(k, dtype=np.int64) if sensor is None else sensor
        scale = np.ones((1, 7)) if scale is None else scale
        x, P, weights = np.empty((k, n)), np.empty((k, n, n)), np.empty((k, r))
        N, kept = int(self.sizes.max()), k if keep else 0
        X, PP = np.empty((kept, r, N)), np.empty((kept, r, N, N))
        from boresight.kernels.imm_stream import imm_stream  # compiled when it is imported

        done = imm_stream(
            self.motions[0].kernel, self._parameters(), self.sizes, self.labels, self.rates, reports.observe,
            state.weights, state.X, state.PP, state.t, reports.t, reports.z, reports.context, sensor, scale, memory,
            limit, n, x, P, weights, X, PP,
        )  # fmt: skip
        require_all(done, reports)
        return MixtureRun(reports.t, x, P, weights, X, PP)

    def smooth(self, run: MixtureRun, lag: float | None = None) -> MixtureRun:
        """Return mean, covariance and weights given all reports, or those up to `lag` (s) later (fixed lag).

        A Rauch-Tung-Striebel step for every pair of models that follow each other (`kernels.imm_smoothing`); with one
        model it is that model's smoother. `run` must have been made with `keep`; raises UserError.
        """
        if len(run.X) != len(run.t):
            raise UserError("each model's belief is needed to smooth: filter with run(…, keep=True)")
        if lag is not None and not lag >= 0.0:
            raise UserError(f"lag must be at least 0 s, not {lag!r}")
        x, P, weights = np.empty_like(run.x), np.empty_like(run.P), np.empty_like(run.weights)
        from boresight.kernels.imm_smoothing import imm_smooth  # compiled when it is imported

        imm_smooth(
            self.motions[0].kernel, self._parameters(), self.sizes, self.labels, self.rates, run.t, run.weights, run.X,
            run.PP, math.inf if lag is None else lag, run.x.shape[1], x, P, weights,
        )  # fmt: skip
        return MixtureRun(run.t, x, P, weights, run.X[:0], run.PP[:0])

    def _parameters(self) -> FloatArray:
        """Return the models' parameters (r, p), padded, for a stream kernel."""
        if len({id(m.kernel) for m in self.motions}) > 1:
            raise UserError("a stream needs motion models of one kernel: give your kernel a code in its parameters")
        widest = max(len(m.parameters) for m in self.motions)
        return np.array([np.pad(m.parameters, (0, widest - len(m.parameters))) for m in self.motions])

    def _joined(self, t: float, weights: FloatArray, X: FloatArray, PP: FloatArray) -> MixtureState:
        x, P = imm.combine(weights, X, PP, 2 * self.motions[0].dimensions)
        return MixtureState(float(t), x, P, weights, X, PP)
