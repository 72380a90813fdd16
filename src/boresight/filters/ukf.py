"""The unscented Kalman filter, cubature among its settings, over any models: no Jacobian is asked for."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from boresight.errors import UserError
from boresight.filters import ekf
from boresight.filters.stream import Filtered, Reports, require_all
from boresight.kernels.gaussian import joseph_update, sandwich
from boresight.kernels.unscented import linearise, sigma_points
from boresight.models.motion.base import KernelMotion
from boresight.models.protocols import MeasurementModel, MotionModel
from boresight.types.sensor import FloatArray
from boresight.types.state import GaussianState, UpdateInfo


@dataclass(frozen=True, slots=True)
class UnscentedKalman:
    """Unscented filter as statistical linearisation, in Joseph form, so that P stays positive definite.

    Points spread by `alpha`, `beta`, `kappa` (Wan and van der Merwe 2000); the default (1, 0, 0) is the cubature filter
    (Arasaratnam and Haykin 2009), whose weights are all positive. Raises UserError where alpha²(n + kappa) ≤ 0.
    """

    alpha: float = 1.0
    beta: float = 0.0
    kappa: float = 0.0

    def __post_init__(self) -> None:
        if not self.alpha > 0.0 or not all(map(math.isfinite, (self.alpha, self.beta, self.kappa))):
            raise UserError("alpha must be positive, beta and kappa finite")

    def init(self, t: float, x: FloatArray, P: FloatArray) -> GaussianState:
        """See `ekf.init`."""
        if len(x) + self.kappa <= 0.0:
            raise UserError(f"kappa = {self.kappa!r} leaves no spread for a state of length {len(x)}")
        return ekf.init(t, x, P)

    def predict(self, state: GaussianState, motion: MotionModel, t: float) -> GaussianState:
        """Move the points to time `t` (s) and take their mean and covariance, plus Q."""
        dt = t - state.t
        if not dt >= 0.0 or not math.isfinite(dt):
            raise UserError(f"cannot predict from t = {state.t!r} to t = {t!r}: time must not run backwards")
        X, L = self._points(state)
        x, A, Omega = linearise(L, np.array([motion.transition(point, dt) for point in X]), self.scaling)
        return GaussianState(float(t), x, sandwich(A, state.P, Omega + motion.Q(state.x, dt)))

    def update(self, state: GaussianState, sensor: MeasurementModel, z: FloatArray) -> tuple[GaussianState, UpdateInfo]:
        """Condition on one report; raises UserError as `ekf.update`."""
        X, L = self._points(state)
        Y = np.array([sensor.innovation(z, point) for point in X])
        seen = np.isfinite(Y).all(axis=0)
        if not seen.any():
            raise UserError(ekf.NOTHING)
        y, A, Omega = linearise(L, np.ascontiguousarray(Y[:, seen]), self.scaling)
        R = sensor.R(state.x)[np.ix_(seen, seen)]
        x, P, S, nis, log_likelihood = joseph_update(state.x, state.P, y, -A, R + Omega, len(state.x))
        if math.isnan(nis):
            raise UserError("the innovation covariance is not positive definite: check the prior and the noise")
        return GaussianState(state.t, x, P), UpdateInfo(y, S, nis, log_likelihood)

    def run(self, state: GaussianState, motion: KernelMotion, reports: Reports) -> Filtered:
        """Filter a whole stream in one call; raises UserError as `stream.run`. `stream.smooth` takes the result."""
        k, n = len(reports.t), motion.state_dimension
        shapes = ((k, n), (k, n, n), (k, n), (k, n, n), (k, n, n), (k, 2))
        out = [np.zeros(shape) for shape in shapes]
        from boresight.kernels.unscented_stream import ukf_stream  # compiled when it is imported

        done = ukf_stream(
            motion.kernel, motion.parameters, reports.observe, state.x, state.P, state.t, reports.t, reports.z,
            reports.context, self.scaling, *out,
        )  # fmt: skip
        require_all(done, reports)
        x, P, xp, Pp, F, nis = out
        return Filtered(reports.t, x, P, xp, Pp, F, nis[:, 0].copy(), nis[:, 1].copy())

    @property
    def scaling(self) -> FloatArray:
        """Return (alpha, beta, kappa) (3,)."""
        return np.array([self.alpha, self.beta, self.kappa])

    def _points(self, state: GaussianState) -> tuple[FloatArray, FloatArray]:
        X, L = sigma_points(state.x, state.P, self.scaling)
        if np.isnan(X[0, 0]):
            raise UserError("the covariance is not positive definite: the unscented filter cannot draw its points")
        return X, L
