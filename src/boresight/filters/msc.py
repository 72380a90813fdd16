"""The filter in modified spherical coordinates: for targets whose range is poorly known or not known at all.

It is the EKF's update in other coordinates, those in which angle measurements are linear and range enters as 1/r:
any motion model of world ENU, any sensor. The observer (own ship) stands in the state and may accelerate.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from boresight.errors import UserError
from boresight.filters import ekf
from boresight.filters.stream import Filtered, Reports, require_all
from boresight.kernels.gaussian import joseph_update, sandwich
from boresight.kernels.measurement import wrap
from boresight.kernels.msc import EXACT, inverse_jacobian, jacobian, msc_from_world, world_from_msc
from boresight.models import check
from boresight.models.base import KernelSensor
from boresight.models.motion.base import KernelMotion
from boresight.models.protocols import MeasurementModel, MotionModel
from boresight.types.sensor import FloatArray
from boresight.types.state import GaussianState, UpdateInfo

AZIMUTH, INVERSE_RANGE = 2, 5  # indices into y
ITERATIONS = 20
RATES = [4, 3, 1]  # along the line of sight, e_θ, e_β
KNOWN_RANGE = 0.1  # relative sigma of 1/r below which range counts as known


class MscState(NamedTuple):
    """A belief in modified spherical coordinates about an observer."""

    t: float  # s
    y: FloatArray  # (n,) elevation, its rate, azimuth, azimuth rate·cos(elevation), range rate/range, 1/range, …
    Py: FloatArray  # (n, n)
    own: FloatArray  # (6,) position and velocity of the observer, world ENU

    @property
    def x(self) -> FloatArray:
        """World mean (n,): position, velocity, further states."""
        return np.asarray(world_from_msc(self.y, self.own))

    @property
    def P(self) -> FloatArray:
        """World covariance (n, n) to first order: trustworthy only where range is known."""
        J = jacobian(self.y)
        return np.asarray(sandwich(J, self.Py, np.zeros_like(self.Py)))

    @property
    def sigma_log_range(self) -> float:
        """Relative sigma of range, which is also that of 1/r."""
        return float(math.sqrt(self.Py[INVERSE_RANGE, INVERSE_RANGE]) / self.y[INVERSE_RANGE])

    @property
    def range_observable(self) -> bool:
        """Whether the range is known (to better than a tenth): if not, no position may be reported."""
        return self.sigma_log_range < KNOWN_RANGE


@dataclass(frozen=True, slots=True)
class MscFilter:
    """MSC filter: mean through Cartesian, Φ = J(y⁺)⁻¹ F J(y), Q = J(y⁺)⁻¹ Q J(y⁺)⁻ᵀ (shao2012 §2.3 and (23) mended)."""

    def init(self, t: float, x: FloatArray, P: FloatArray, own: FloatArray | None = None) -> MscState:
        """Begin from a world state with covariance `P`; `own` (6,) is the observer, at rest at the origin if None."""
        prior = ekf.init(t, x, P)
        return to_msc(prior, np.zeros(6) if own is None else own)

    def from_direction(
        self,
        t: float,
        azimuth: float,
        elevation: float,
        sigma_angle: float,
        range_m: float,
        sigma_log_range: float,
        sigma_velocity: float,
        own: FloatArray,
        velocity: FloatArray | None = None,
    ) -> MscState:
        """Begin from one direction (rad) and a guess of range: r lognormal with mean `range_m` (m), sigma of ln r.

        The target's velocity over ground is `velocity` (3,) (none: zero) within `sigma_velocity` (m/s) per axis. Mean
        and covariance are those of this prior in MSC, exactly. Raises UserError for values that are not positive.
        """
        for name, value in (("sigma_angle", sigma_angle), ("range_m", range_m), ("sigma_velocity", sigma_velocity)):
            check.positive(name, value)
        check.positive("sigma_log_range", sigma_log_range)
        s2 = sigma_log_range**2
        inverse = math.exp(s2) / range_m  # E[1/r]
        variance = inverse**2 * math.expm1(s2)
        relative = (np.zeros(3) if velocity is None else np.asarray(velocity, dtype=float)) - np.asarray(own)[3:]
        unit = jacobian(np.array([elevation, 0.0, azimuth, 0.0, 0.0, 1.0]))[3:, RATES]  # line of sight, e_θ, e_β
        slope = np.zeros(6)  # rates are velocity times 1/r: what range does not say, they do not say either
        slope[RATES] = unit.T @ relative
        y = inverse * slope
        y[0], y[2], y[INVERSE_RANGE] = elevation, azimuth, inverse
        slope[INVERSE_RANGE] = 1.0
        Py = variance * np.outer(slope, slope)
        spread = sigma_velocity**2 * (inverse**2 + variance)
        Py[RATES, RATES] += spread
        Py[0, 0] = sigma_angle**2
        Py[2, 2] = (sigma_angle / max(math.cos(elevation), 1e-3)) ** 2
        return MscState(float(t), y, Py, np.array(own, dtype=float))

    def predict(self, state: MscState, motion: MotionModel, t: float, own: FloatArray | None = None) -> MscState:
        """Move to time `t` (s), the observer to `own` (6,); None: it keeps its velocity."""
        dt = t - state.t
        if not dt >= 0.0 or not math.isfinite(dt):
            raise UserError(f"cannot predict from t = {state.t!r} to t = {t!r}: time must not run backwards")
        if own is None:
            own = state.own + np.r_[dt * state.own[3:], np.zeros(3)]
        x = state.x
        if isinstance(motion, KernelMotion):
            moved, F, Q = motion.move(x, dt)
        else:
            moved, F, Q = motion.transition(x, dt), motion.F(x, dt), motion.Q(x, dt)
        y = msc_from_world(moved, own)
        inverse = inverse_jacobian(y)
        P = sandwich(inverse @ F @ jacobian(state.y), state.Py, sandwich(inverse, Q, np.zeros_like(Q)))
        return MscState(float(t), y, P, np.array(own, dtype=float))

    def update(self, state: MscState, sensor: MeasurementModel, z: FloatArray) -> tuple[MscState, UpdateInfo]:
        """Condition on one report of any sensor; innovation, S and NIS are those at the prior.

        While range is not known the update is iterated (Gauss-Newton), as a report that tells range moves 1/r far.
        Raises UserError where the report holds nothing that can be used, or S is not positive definite.
        """
        if isinstance(sensor, KernelSensor) and sensor.dimensions != 3:
            raise UserError("modified spherical coordinates need sensors of 3 dimensions")
        y, info, P = state.y, None, state.Py
        for _ in range(1 if state.range_observable else ITERATIONS):
            innovation, H, R = ekf.linearised(sensor, z, np.asarray(world_from_msc(y, state.own)))
            HJ = H @ jacobian(y)
            away = y - state.y
            away[AZIMUTH] = wrap(away[AZIMUTH])
            y_new, P, S, nis, log_likelihood = joseph_update(state.y, state.Py, innovation + HJ @ away, HJ, R, len(y))
            if math.isnan(nis):
                raise UserError("the innovation covariance is not positive definite: check the prior and the noise")
            info = info or UpdateInfo(innovation, S, nis, log_likelihood)
            y_new[INVERSE_RANGE] = max(y_new[INVERSE_RANGE], 0.1 * y[INVERSE_RANGE])
            y_new[AZIMUTH] = wrap(y_new[AZIMUTH])
            settled = abs(y_new[INVERSE_RANGE] - y[INVERSE_RANGE]) < 1e-9 * y[INVERSE_RANGE]
            y = y_new
            if settled:
                break
        assert info is not None
        return MscState(state.t, y, P, state.own), info

    def run(self, state: MscState, motion: KernelMotion, reports: Reports, own: FloatArray) -> Filtered:
        """Filter a whole stream in one call, the observer at `own` (k, 6); all results are in MSC, azimuth unwrapped.

        `stream.smooth` takes the result; `to_world` turns it to world ENU. Updates are not iterated: for a first sharp
        range in the middle of a stream take `update`. Raises UserError as `stream.run`.
        """
        k, n = len(reports.t), len(state.y)
        if own.shape != (k, 6):
            raise UserError(f"the observer needs one position and velocity a report: ({k}, 6), not {own.shape}")
        shapes = ((k, n), (k, n, n), (k, n), (k, n, n), (k, n, n), (k, 2))
        out = [np.zeros(shape) for shape in shapes]
        from boresight.kernels.msc_stream import msc_stream  # compiled when it is imported

        done = msc_stream(
            motion.kernel, motion.parameters, reports.observe, state.y, state.Py, state.t, state.own, reports.t,
            reports.z, reports.context, own, EXACT, *out,
        )  # fmt: skip
        require_all(done, reports)
        y, P, yp, Pp, F, nis = out
        y[:, AZIMUTH] = np.unwrap(y[:, AZIMUTH])
        yp[:, AZIMUTH] = y[:, AZIMUTH] + wrapped(yp[:, AZIMUTH] - y[:, AZIMUTH])
        return Filtered(reports.t, y, P, yp, Pp, F, nis[:, 0].copy(), nis[:, 1].copy())


def wrapped(angle: FloatArray) -> FloatArray:
    """Wrap angles (rad) to [-π, π)."""
    return np.asarray((angle + math.pi) % (2.0 * math.pi) - math.pi)


def to_world(y: FloatArray, P: FloatArray, own: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return world means (k, n) and first-order covariances (k, n, n) of MSC ones about observers `own` (k, 6)."""
    J = np.array([jacobian(row) for row in y])
    return np.array([world_from_msc(row, o) for row, o in zip(y, own)]), J @ P @ J.transpose(0, 2, 1)


def to_msc(state: GaussianState, own: FloatArray) -> MscState:
    """Return a world state in modified spherical coordinates about an observer `own` (6,), to first order.

    Raises UserError where the target is at the observer.
    """
    if not np.any(state.x[:3] != own[:3]):
        raise UserError("the target is at the observer: its direction is not defined")
    y = msc_from_world(state.x, np.array(own, dtype=float))
    return MscState(
        state.t, y, sandwich(inverse_jacobian(y), state.P, np.zeros_like(state.P)), np.array(own, dtype=float)
    )


def to_cartesian(state: MscState) -> GaussianState:
    """Hand over to world coordinates, once range is known: the first-order covariance, NEES unchanged.

    Raises UserError while it is not: the Gaussian would not be one there.
    """
    if not state.range_observable:
        raise UserError(
            f"range is not observable yet (sigma of ln r = {state.sigma_log_range:.2f}): stay in modified spherical "
            f"coordinates until it is below {KNOWN_RANGE}"
        )
    return GaussianState(state.t, state.x, state.P)
