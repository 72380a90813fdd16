"""Nearly constant velocity, acceleration and jerk: chains of integrators driven by white noise."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from boresight.kernels.motion import white_derivative
from boresight.models import check
from boresight.models.motion.base import KernelMotion
from boresight.types.sensor import FloatArray


@dataclass(frozen=True)
class NearlyConstantVelocity(KernelMotion):
    """White acceleration of power spectral density `q` (m²/s³): state (position, velocity), exact F and Q(dt).

    Raises UserError for `q` that is not positive or `dimensions` other than 2 and 3.
    """

    q: float
    dimensions: int = 3
    kernel = staticmethod(white_derivative)

    def __post_init__(self) -> None:
        check.positive("q", self.q)
        check.spatial(self.dimensions)

    @property
    def state_dimension(self) -> int:
        """Length of the state: position and velocity."""
        return 2 * self.dimensions

    @cached_property
    def parameters(self) -> FloatArray:
        """Dimensions, order, q."""
        return np.array([self.dimensions, 1.0, self.q])


@dataclass(frozen=True)
class NearlyConstantAcceleration(KernelMotion):
    """White jerk of power spectral density `q` (m²/s⁵): state (position, velocity, acceleration), exact F and Q(dt).

    Raises UserError for `q` that is not positive or `dimensions` other than 2 and 3.
    """

    q: float
    dimensions: int = 3
    kernel = staticmethod(white_derivative)

    def __post_init__(self) -> None:
        check.positive("q", self.q)
        check.spatial(self.dimensions)

    @property
    def state_dimension(self) -> int:
        """Length of the state: position, velocity and acceleration."""
        return 3 * self.dimensions

    @cached_property
    def parameters(self) -> FloatArray:
        """Dimensions, order, q."""
        return np.array([self.dimensions, 2.0, self.q])
