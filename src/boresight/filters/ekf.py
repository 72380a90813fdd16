"""The extended Kalman filter: predict to any time, update with one report of any sensor."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy import empty

from boresight.errors import UserError
from boresight.kernels.gaussian import joseph_update, sandwich
from boresight.kernels.motion import move
from boresight.kernels.observation import DIMENSIONS
from boresight.kernels.space import predict_space, update_space
from boresight.kernels.step import predict_step, update_step
from boresight.models import check
from boresight.models.base import KernelSensor
from boresight.models.motion.base import KernelMotion
from boresight.models.motion.cv import NearlyConstantVelocity
from boresight.models.protocols import MeasurementModel, MotionModel
from boresight.types.sensor import FloatArray
from boresight.types.state import GaussianState, UpdateInfo

SQUARE = (6, 6)
DOUBLE = np.dtype(np.float64)
new = tuple.__new__  # of a named tuple, without the detour through its own
NOTHING = "the measurement has no component that can be used: nothing measured, or zero range"


def init(t: float, x: FloatArray, P: FloatArray) -> GaussianState:
    """Return the state at `t` (s) with mean `x` (n,) and covariance `P` (n, n).

    Raises UserError where they are not finite, do not fit, or `P` is not symmetric positive definite.
    """
    mean = np.array(x, dtype=float)
    if mean.ndim != 1 or not np.all(np.isfinite(mean)) or not math.isfinite(t):
        raise UserError("the prior must be a finite time and a finite vector")
    return GaussianState(float(t), mean, check.covariance("the prior covariance", P, len(mean)))


def predict(state: GaussianState, motion: MotionModel, t: float) -> GaussianState:
    """Move a state to time `t` (s): x⁺ = f(x), P⁺ = FPFᵀ + Q(dt).

    Raises UserError where `t` is not finite or before the state's time: late reports are for `filters.late`.
    """
    try:
        dt = t - state.t
        if not -math.inf < dt < math.inf:
            raise TypeError
    except (TypeError, ValueError, AttributeError):
        _require(state)
        raise UserError(f"predict: t must be a time in seconds, not {t!r}") from None
    if not dt >= 0.0:
        raise UserError(f"cannot predict from t = {state.t!r} to t = {t!r}: time must not run backwards")
    if type(motion) is NearlyConstantVelocity and motion.dimensions == 3:
        x, P = empty(6), empty(SQUARE)
        if predict_space(state.x, state.P, dt, motion.q, x, P):  # False: other arrays, the way for all
            return new(GaussianState, (float(t), x, P))
        _require(state)
    _fits(state, motion)
    if isinstance(motion, KernelMotion) and motion.kernel is move:
        return _sane(state, GaussianState(float(t), *predict_step(state.x, state.P, dt, motion.parameters)))
    if isinstance(motion, KernelMotion):
        x, F, Q = motion.move(state.x, dt)
    else:
        x, F, Q = motion.transition(state.x, dt), motion.F(state.x, dt), motion.Q(state.x, dt)
    P = sandwich(np.ascontiguousarray(F, dtype=float), state.P, np.ascontiguousarray(Q, dtype=float))
    return _sane(state, GaussianState(float(t), x, P))


def update(
    state: GaussianState,
    sensor: MeasurementModel,
    z: FloatArray,
    *,
    n_estimated: int | None = None,
) -> tuple[GaussianState, UpdateInfo]:
    """Condition a state on one report `z` (m,) of a sensor, in Joseph form; NaN components are left out.

    A sensor on a moving platform is given where it was at the report's time: `update(state, radar.at(pose), z)`.
    States from `n_estimated` on are considered (Schmidt): they widen the covariance but are not estimated.
    Raises UserError where the report holds no component that can be used, or S is not positive definite.
    """
    if type(state) is not GaussianState:
        _require(state)
    if n_estimated is None and isinstance(sensor, KernelSensor) and sensor.separable:  # the straight-line kernel
        m = len(sensor.components)
        x, P, y, S = empty(6), empty(SQUARE), empty(m), empty((m, m))
        used, nis, log_likelihood = update_space(state.x, state.P, z, sensor.context, x, P, y, S)
        if used > 0 and nis == nis:
            if used < m:
                y, S = y[:used], S[:used, :used]
            return new(GaussianState, (state.t, x, P)), new(UpdateInfo, (y, S, nis, log_likelihood))
        if used < 0:
            _require(state)
    _fits(state, sensor)
    n = len(state.x) if n_estimated is None else n_estimated
    if not isinstance(n, int | np.integer) or not 0 <= n <= len(state.x):
        raise UserError(f"update: n_estimated must be 0 to {len(state.x)}, the number of states, not {n_estimated!r}")
    if isinstance(sensor, KernelSensor):
        x, P, y, S, nis, log_likelihood = update_step(state.x, state.P, sensor.columns(z), sensor.context, n)
        if not len(y):
            raise UserError(NOTHING)
    else:
        y, H, R = linearised(sensor, z, state.x)
        x, P, S, nis, log_likelihood = joseph_update(state.x, state.P, y, H, R, n)
    if math.isnan(nis):
        _require(state)
        raise UserError("the innovation covariance is not positive definite: check the prior and the sensor's noise")
    return _sane(state, GaussianState(state.t, x, P)), UpdateInfo(y, S, nis, log_likelihood)


def _require(state: Any) -> None:
    """Raise UserError unless the state is a belief."""
    if not isinstance(state, GaussianState):
        raise UserError(f"the state must be a GaussianState, not {type(state).__name__}")
    check.state("the state", *state)


def _fits(state: Any, model: MotionModel | MeasurementModel) -> None:
    """Raise UserError unless the arrays of a state have the shapes that the model's kernels take without looking."""
    if not isinstance(state, GaussianState):
        _require(state)
    x, P = state.x, state.P
    if not isinstance(x, np.ndarray) or not isinstance(P, np.ndarray) or x.ndim != 1 or P.shape != (len(x), len(x)):
        _require(state)
    if x.dtype != DOUBLE or P.dtype != DOUBLE:
        _require(state)
    if isinstance(model, KernelMotion):
        if len(x) != model.state_dimension:
            raise UserError(f"the state has {len(x)} components, the motion model {model.state_dimension}")
    elif isinstance(model, KernelSensor):
        if len(x) < 2 * int(model.context[DIMENSIONS]):
            raise UserError(f"the state has {len(x)} components; the sensor wants position and velocity")
    elif not (hasattr(model, "transition") or hasattr(model, "innovation")):
        raise UserError(f"{type(model).__name__} is no motion or measurement model")


def _sane(before: GaussianState, after: GaussianState) -> GaussianState:
    """Return `after`; raises UserError where it is no belief, because that before was none."""
    if not float(after.P.diagonal().min()) >= 0.0 or not math.isfinite(float(after.x.sum())):
        _require(before)
        raise UserError("the filter gives a covariance that is not positive: check the prior and the noise")
    return after


def linearised(sensor: MeasurementModel, z: FloatArray, x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return innovation, H and R of the components that `z` holds and that are defined at `x`; UserError if none."""
    if isinstance(sensor, KernelSensor):
        y, H = sensor.linearise(z, x)
    else:
        y, H = sensor.innovation(z, x), sensor.H(x)
    R = sensor.R(x)
    seen = np.isfinite(y)
    if not seen.all():
        if not seen.any():
            raise UserError(NOTHING)
        y, H, R = y[seen], H[seen], R[np.ix_(seen, seen)]
    return y, np.ascontiguousarray(H, dtype=float), np.ascontiguousarray(R, dtype=float)
