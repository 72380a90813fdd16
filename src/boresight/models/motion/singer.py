"""Manoeuvres that come and go: acceleration with a memory."""

from __future__ import annotations

from dataclasses import dataclass

from boresight.kernels.motion import SINGER, move
from boresight.models import check
from boresight.models.motion.base import KernelMotion


@dataclass(frozen=True)
class Singer(KernelMotion):
    """Acceleration of standard deviation `sigma` (m/s²) per axis that forgets with time constant `tau` (s).

    State (position, velocity, acceleration); exact F and Q(dt) (Singer 1970). Raises UserError for values that are
    not positive or `dimensions` other than 2 and 3.
    """

    tau: float
    sigma: float
    dimensions: int = 3
    kernel = staticmethod(move)
    layout = ("position", "velocity", "acceleration")

    def __post_init__(self) -> None:
        check.positive("tau", self.tau)
        check.positive("sigma", self.sigma)
        check.spatial(self.dimensions)
        self.set_parameters(SINGER, self.dimensions, self.tau, self.sigma)
