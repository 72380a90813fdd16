"""How well any filter can do: Cramér-Rao recursions from the same models that filter and simulate."""

from __future__ import annotations

import numpy as np

from boresight.errors import UserError
from boresight.filters.stream import Filtered, Reports, require_all, smooth
from boresight.models.motion.base import KernelMotion
from boresight.types.sensor import FloatArray
from boresight.types.state import GaussianState


def trajectory_bound(
    prior: GaussianState, motion: KernelMotion, reports: Reports, truth: FloatArray, lag: float | None = 0.0
) -> FloatArray:
    """Return the bound (k, n, n) on the error covariance after each report, on one given true path.

    The Riccati recursion of the filter with every Jacobian taken on the path: `prior` holds the true state at its
    time and the prior covariance, `truth` (k, n) the true state at each report; which of the reports' components are
    NaN matters, their values do not. `lag` 0 bounds filters, a positive lag (s) fixed-lag smoothers, None
    fixed-interval smoothers. Average over the runs of a Monte Carlo for its bound. Raises UserError as `stream.run`.
    """
    from boresight.kernels.stream import bound_stream  # compiled when it is imported

    k, n = len(reports.t), motion.state_dimension
    if truth.shape != (k, n):
        raise UserError(f"the true path must have one state of length {n} per report: ({k}, {n}), not {truth.shape}")
    P, P_predicted, F = np.empty((k, n, n)), np.empty((k, n, n)), np.empty((k, n, n))
    truth = np.ascontiguousarray(truth, dtype=float)
    done = bound_stream(
        motion.kernel, motion.parameters, reports.observe, truth, prior.P, prior.t, prior.x, *reports[:3],
        P, P_predicted, F,
    )  # fmt: skip
    require_all(done, reports)
    if lag == 0.0:
        return P
    return smooth(Filtered(reports.t, truth, P, truth, P_predicted, F, np.zeros(k), np.zeros(k)), lag)[1]


def unconditional_bound(
    prior: GaussianState, motion: KernelMotion, reports: Reports, truths: FloatArray, start: FloatArray
) -> FloatArray:
    """Return the posterior Cramér-Rao lower bound (k, n, n): Jacobians averaged over true paths (Tichavský 1998).

    `truths` (runs, k, n) are paths drawn from the prior and the motion model, `start` (runs, n) their states at the
    prior's time. With E over the runs: J⁺ = Q⁻¹ - Q⁻¹E[F](J + E[FᵀQ⁻¹F])⁻¹E[F]ᵀQ⁻¹ + E[HᵀR⁻¹H]. It lies below the
    average of `trajectory_bound`, by about 2 where the geometry differs much from run to run.
    """
    runs, k, n = truths.shape
    J = np.linalg.inv(prior.P)
    out = np.empty((k, n, n))
    now, here = prior.t, start
    y, H, R = np.empty(7), np.empty((7, n)), np.empty((7, 7))
    for i, t in enumerate(reports.t):
        if t > now:
            moved = [motion.move(x, t - now) for x in here]
            F = np.mean([f for _, f, _ in moved], axis=0)
            Q_inverse = np.linalg.inv(np.mean([q for _, _, q in moved], axis=0))
            D11 = np.mean([f.T @ Q_inverse @ f for _, f, _ in moved], axis=0)
            J = Q_inverse - Q_inverse @ F @ np.linalg.solve(J + D11, F.T @ Q_inverse)
        information = np.zeros((n, n))
        for x in truths[:, i]:
            m = reports.observe(np.ascontiguousarray(x), reports.z[i], reports.context[i], y, H, R)
            information += H[:m].T @ np.linalg.solve(R[:m, :m], H[:m]) / runs
        J = 0.5 * (J + J.T) + information
        out[i] = np.linalg.inv(J)
        now, here = t, truths[:, i]
    return out
