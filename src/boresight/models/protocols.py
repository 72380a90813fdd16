"""What a motion model and a measurement model are: implement these methods and every filter runs."""

from __future__ import annotations

from typing import Protocol

from boresight.types.sensor import FloatArray


class MotionModel(Protocol):
    """How a state moves. States hold position first (`dimensions` components), then velocity, then the rest."""

    @property
    def dimensions(self) -> int:
        """Dimension of space, 2 or 3."""

    @property
    def state_dimension(self) -> int:
        """Length n of the state."""

    def transition(self, x: FloatArray, dt: float) -> FloatArray:
        """Return the mean (n,) of the state `x` (n,) moved by `dt` (s)."""

    def F(self, x: FloatArray, dt: float) -> FloatArray:
        """Return the Jacobian (n, n) of `transition` at `x`."""

    def Q(self, x: FloatArray, dt: float) -> FloatArray:
        """Return the covariance (n, n) that the process noise adds over `dt`."""


class MeasurementModel(Protocol):
    """What a sensor sees of a state."""

    @property
    def dimension(self) -> int:
        """Number m of measured components."""

    def innovation(self, z: FloatArray, x: FloatArray) -> FloatArray:
        """Return z - h(x) (m,), angles wrapped; NaN where `z` is NaN (not measured) or `x` has no such component."""

    def H(self, x: FloatArray) -> FloatArray:
        """Return the Jacobian ∂h/∂x (m, n)."""

    def R(self, x: FloatArray) -> FloatArray:
        """Return the noise covariance (m, m)."""
