"""The EKF and the iterated EKF as configured objects (see `filters.ekf` for the plain functions)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from boresight.errors import UserError
from boresight.filters import ekf
from boresight.kernels.gaussian import joseph_update
from boresight.models.protocols import MeasurementModel, MotionModel
from boresight.types.sensor import FloatArray
from boresight.types.state import GaussianState, UpdateInfo


@dataclass(frozen=True, slots=True)
class ExtendedKalman:
    """EKF; with `iterations` > 1 the iterated EKF: Gauss-Newton on the posterior, each step halved until it helps.

    Raises UserError for fewer than one iteration.
    """

    iterations: int = 1

    def __post_init__(self) -> None:
        if self.iterations < 1:
            raise UserError(f"iterations must be at least 1, not {self.iterations}")

    def init(self, t: float, x: FloatArray, P: FloatArray) -> GaussianState:
        """See `ekf.init`."""
        return ekf.init(t, x, P)

    def predict(self, state: GaussianState, motion: MotionModel, t: float) -> GaussianState:
        """See `ekf.predict`."""
        return ekf.predict(state, motion, t)

    def update(self, state: GaussianState, sensor: MeasurementModel, z: FloatArray) -> tuple[GaussianState, UpdateInfo]:
        """See `ekf.update`; the innovation and its covariance are those at the prior."""
        once, info = ekf.update(state, sensor, z)
        if self.iterations == 1:
            return once, info
        return GaussianState(state.t, *self._iterated(state, sensor, z)), info

    def _iterated(self, state: GaussianState, sensor: MeasurementModel, z: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The steps of kernels.iterated over models written in plain NumPy too."""
        x, here = state.x, state.x.copy()
        y, H, R = ekf.linearised(sensor, z, here)
        cost = float(y @ np.linalg.solve(R, y))
        for _ in range(self.iterations):
            aim = joseph_update(x, state.P, y + H @ (here - x), H, R, len(x))[0]
            step, before = 1.0, cost
            for _ in range(8):
                trial = here + step * (aim - here)
                y_t, H_t, R_t = ekf.linearised(sensor, z, trial)
                away = trial - x
                trial_cost = float(y_t @ np.linalg.solve(R_t, y_t) + away @ np.linalg.solve(state.P, away))
                if len(y_t) == len(y) and trial_cost <= cost:
                    here, y, H, R, cost = trial, y_t, H_t, R_t, trial_cost
                    break
                step *= 0.5
            if before - cost < 1e-9:
                break
        return here, joseph_update(x, state.P, y, H, R, len(x))[1]
