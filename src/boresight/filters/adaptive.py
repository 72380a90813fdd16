"""Noise that is learned while tracking: process noise by a bank of levels, measurement noise per sensor.

Process noise: one motion model at several levels of `q` runs as an IMM; the likelihood of the innovations weighs the
levels, so a manoeuvre is answered within a few reports and a wrong `q` within some tens. Measurement noise: a scale per
sensor and component, learned from what updates leave over (kernels.imm.adapt). The two are told apart because noise
changes sign from report to report and a manoeuvre does not. Nothing is locked out: levels and scales have limits, and
no level's weight reaches zero.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from boresight.errors import UserError
from boresight.filters.imm import InteractingModels, MixtureRun, MixtureState
from boresight.filters.stream import Reports
from boresight.kernels import imm
from boresight.kernels.observation import NOISE
from boresight.models import check
from boresight.models.base import KernelSensor
from boresight.models.motion.cv import NearlyConstantAcceleration, NearlyConstantVelocity
from boresight.types.sensor import FloatArray
from boresight.types.state import UpdateInfo

HALF_DECADES = tuple(10.0 ** (0.5 * i) for i in range(-4, 7))  # 0.01 … 1000 times the declared q


class AdaptiveState(NamedTuple):
    """The mixture over levels of q, and what has been learned of the sensors' noise."""

    mixture: MixtureState
    scale: FloatArray  # (s, 7) by which each sensor's noise variances are multiplied
    bias: FloatArray  # (s, 7) running mean of the residuals
    seen: FloatArray  # (s, 7) reports


@dataclass(frozen=True)
class AdaptiveNoise:
    """A motion model whose `q`, and sensors whose noise, are learned from the reports.

    `q_factors` are the levels, as multiples of the declared `q` ((1,) keeps it); `sojourn` (s) how long a level lasts.
    `memory` is in reports per sensor (0 keeps the declared noise), `limit` how far variances may go from the declared.
    Raises UserError.
    """

    motion: NearlyConstantVelocity | NearlyConstantAcceleration
    q_factors: tuple[float, ...] = HALF_DECADES
    sojourn: float = 20.0
    memory: int = 200
    limit: float = 100.0
    bank: InteractingModels = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if not self.q_factors:
            raise UserError("give at least one q factor")
        for factor in self.q_factors:
            check.positive("q factor", factor)
        if self.memory < 0 or 0 < self.memory < 10:
            raise UserError(f"memory must be 0 or at least 10 reports, not {self.memory}")
        if not self.limit >= 1.0:
            raise UserError(f"limit must be at least 1, not {self.limit!r}")
        models = tuple(replace(self.motion, q=self.motion.q * f) for f in self.q_factors)
        object.__setattr__(self, "bank", InteractingModels(models, self.sojourn))

    def init(self, t: float, x: FloatArray, P: FloatArray, sensors: int, extra_sigma: float = 1.0) -> AdaptiveState:
        """Begin at `t` from position and velocity; `sensors` is how many there are; see `InteractingModels.init`."""
        mixture = self.bank.init(t, x, P, [extra_sigma] * len(self.q_factors))
        return AdaptiveState(mixture, np.ones((sensors, 7)), np.zeros((sensors, 7)), np.zeros((sensors, 7)))

    def q(self, state: AdaptiveState) -> float:
        """Return the level of q as the reports have it: the geometric mean over the weights."""
        levels = np.log([m.q for m in self.bank.motions])  # type: ignore[attr-defined]
        return float(np.exp(state.mixture.weights @ levels))

    def predict(self, state: AdaptiveState, t: float) -> AdaptiveState:
        """Move to time `t` (s)."""
        return state._replace(mixture=self.bank.predict(state.mixture, t))

    def update(
        self, state: AdaptiveState, index: int, sensor: KernelSensor, z: FloatArray
    ) -> tuple[AdaptiveState, tuple[UpdateInfo, ...]]:
        """Condition on one report of sensor number `index` and learn its noise; one info per level of q."""
        scale, bias, seen = state.scale.copy(), state.bias.copy(), state.seen.copy()
        mixture, infos = self.bank.update(state.mixture, scaled(sensor, scale[index]), z)
        if self.memory:
            e, H = sensor.linearise(z, mixture.x)
            known = np.isfinite(e)
            rows = np.array([c for c, k in zip(sensor.components, known) if k], dtype=np.int64)
            spread = np.einsum("ia,ab,ib->i", H[known], mixture.P, H[known])
            nominal = np.diag(sensor.R(mixture.x))[known].copy()
            imm.adapt(scale[index], bias[index], seen[index], rows, e[known], spread, nominal, self.memory, self.limit)
        return AdaptiveState(mixture, scale, bias, seen), infos

    def run(self, state: AdaptiveState, reports: Reports, sensor: NDArray[np.int64]) -> tuple[MixtureRun, FloatArray]:
        """Filter a whole stream in one call; `sensor` (k,) numbers the reports' sensors. Also returns the scales."""
        scale = state.scale.copy()
        out = self.bank.run(state.mixture, reports, sensor, scale, float(self.memory), self.limit)
        return out, scale


def scaled(sensor: KernelSensor, scale: FloatArray) -> KernelSensor:
    """Return the sensor with its noise variances multiplied by `scale` (7,), by component."""
    out = sensor.at(sensor.pose)
    root = np.sqrt(scale)
    out.context[NOISE:] *= np.outer(root, root).ravel()
    return out
