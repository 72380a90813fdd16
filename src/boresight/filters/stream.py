"""A whole stream of reports in one call, and the smoother over it: the filter of `filters.ekf` at kernel speed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from boresight.errors import UserError
from boresight.kernels import smoothing
from boresight.kernels.observation import observe
from boresight.kernels.packed import UNFIT, space_stream
from boresight.models import check
from boresight.models.base import KernelSensor
from boresight.models.motion.base import KernelMotion
from boresight.models.motion.cv import NearlyConstantVelocity
from boresight.types.sensor import FloatArray
from boresight.types.state import GaussianState


class Reports(NamedTuple):
    """k reports in order of time, as the stream kernels want them."""

    t: FloatArray  # (k,) s
    z: FloatArray  # (k, 7) by Component, NaN where not measured
    context: FloatArray  # (k, c) one sensor context a report
    observe: Callable[..., Any]  # the observation kernel that all share


class Filtered(NamedTuple):
    """What a forward pass leaves behind, one entry a report."""

    t: FloatArray  # (k,) s
    x: FloatArray  # (k, n) given the reports so far
    P: FloatArray  # (k, n, n)
    x_predicted: FloatArray  # (k, n) before the report
    P_predicted: FloatArray  # (k, n, n)
    F: FloatArray  # (k, n, n) of the prediction to this report
    nis: FloatArray  # (k,) normalised innovation squared
    dof: FloatArray  # (k,) its dimension; zero where the report held nothing that could be used

    def state(self, k: int) -> GaussianState:
        """Return the filtered state after report k."""
        return GaussianState(float(self.t[k]), self.x[k], self.P[k])


def stack(t: Sequence[float] | FloatArray, sensors: Sequence[KernelSensor], z: Sequence[FloatArray]) -> Reports:
    """Lay out reports: times (s), the sensor of each (at its pose at that time) and its measurement (m,).

    Raises UserError where the lengths differ, times run backwards, or the sensors have different kernels.
    """
    if not len(t) == len(sensors) == len(z) or not len(t):
        raise UserError("give one time, one sensor and one measurement per report, and at least one report")
    kernels = {id(s.kernel): s.kernel for s in sensors}
    if len(kernels) > 1:
        raise UserError("a stream needs one observation kernel: let it call the others, by a code in its context")
    try:
        times = np.array(t, dtype=float)
    except (TypeError, ValueError):
        raise UserError("the reports' times must be numbers (s)") from None
    if times.shape != (len(t),) or not np.isfinite(times).all() or not np.all(np.diff(times) >= 0.0):
        raise UserError("the reports' times must be finite and must not run backwards: sort them, or use filters.late")
    columns = np.array([s.columns(row) for s, row in zip(sensors, z)])
    return Reports(times, columns, np.array([s.context for s in sensors]), next(iter(kernels.values())))


def run(state: GaussianState, motion: KernelMotion, reports: Reports, iterations: int = 1) -> Filtered:
    """Filter a whole stream from `state`: the EKF, or with `iterations` > 1 the iterated EKF with step control.

    Raises UserError where the first report is before the state, or the filter cannot go on (S not positive definite).
    """
    k, n = len(reports.t), motion.state_dimension
    check.state("the state before the stream", *state, size=n)
    if np.shape(reports.z) != (k, 7) or np.ndim(reports.context) != 2 or len(reports.context) != k:
        raise UserError("run: reports of other shapes than stack makes")
    x, P, xp, Pp, F = np.empty((k, n)), np.empty((k, n, n)), np.empty((k, n)), np.empty((k, n, n)), np.empty((k, n, n))
    nis, done = np.zeros((k, 2)), UNFIT
    in_space = type(motion) is NearlyConstantVelocity and motion.dimensions == 3 and state.x.shape == (6,)
    if in_space and iterations == 1 and reports.observe is observe:
        done = space_stream(motion.q, state.x, state.P, state.t, *reports[:3], x, P, xp, Pp, F, nis)  # type: ignore[attr-defined]
    if done == UNFIT:
        from boresight.kernels.stream import ekf_stream  # compiled when it is imported

        done = ekf_stream(
            motion.kernel, motion.parameters, reports.observe, state.x, state.P, state.t, *reports[:3], iterations,
            x, P, xp, Pp, F, nis,
        )  # fmt: skip
    require_all(done, reports)
    return Filtered(reports.t, x, P, xp, Pp, F, nis[:, 0].copy(), nis[:, 1].copy())


def require_all(done: int, reports: Reports) -> None:
    """Raise UserError unless a stream kernel did every report."""
    if done < len(reports.t):
        raise UserError(
            f"the filter cannot go past report {done} at t = {reports.t[done]!r}: it is before the state's time, "
            "or the innovation covariance is not positive definite (check the prior and the noise)"
        )


def smooth(filtered: Filtered, lag: float | None = None) -> tuple[FloatArray, FloatArray]:
    """Return means (k, n) and covariances (k, n, n) given all reports, or those up to `lag` (s) later (fixed lag).

    Rauch-Tung-Striebel, over whatever filter left `filtered` behind.
    """
    x, P = np.empty_like(filtered.x), np.empty_like(filtered.P)
    if lag is None:
        smoothing.smooth_back(*filtered[1:6], 0, len(filtered.t) - 1, x, P)
    else:
        smoothing.smooth_lagged(filtered.t, *filtered[1:6], lag, x, P)
    return x, P
