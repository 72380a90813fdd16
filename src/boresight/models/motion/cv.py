"""Nearly constant velocity, acceleration and jerk: chains of integrators driven by white noise."""

from __future__ import annotations

from dataclasses import dataclass

from boresight.kernels.motion import CHAIN, move
from boresight.models import check
from boresight.models.motion.base import KernelMotion


@dataclass(frozen=True)
class NearlyConstantVelocity(KernelMotion):
    """White acceleration of power spectral density `q` (m²/s³): state (position, velocity), exact F and Q(dt).

    Raises UserError for `q` that is not positive or `dimensions` other than 2 and 3.
    """

    q: float
    dimensions: int = 3
    kernel = staticmethod(move)
    layout = ("position", "velocity")

    def __post_init__(self) -> None:
        check.positive("q", self.q)
        check.spatial(self.dimensions)
        self.set_parameters(CHAIN, self.dimensions, 1, self.q)


@dataclass(frozen=True)
class NearlyConstantAcceleration(KernelMotion):
    """White jerk of power spectral density `q` (m²/s⁵): state (position, velocity, acceleration), exact F and Q(dt).

    Raises UserError for `q` that is not positive or `dimensions` other than 2 and 3.
    """

    q: float
    dimensions: int = 3
    kernel = staticmethod(move)
    layout = ("position", "velocity", "acceleration")

    def __post_init__(self) -> None:
        check.positive("q", self.q)
        check.spatial(self.dimensions)
        self.set_parameters(CHAIN, self.dimensions, 2, self.q)


@dataclass(frozen=True)
class NearlyConstantJerk(KernelMotion):
    """White snap of power spectral density `q` (m²/s⁷): state (position, velocity, acceleration, jerk).

    Raises UserError for `q` that is not positive or `dimensions` other than 2 and 3.
    """

    q: float
    dimensions: int = 3
    kernel = staticmethod(move)
    layout = ("position", "velocity", "acceleration", "jerk")

    def __post_init__(self) -> None:
        check.positive("q", self.q)
        check.spatial(self.dimensions)
        self.set_parameters(CHAIN, self.dimensions, 3, self.q)
