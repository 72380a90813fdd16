"""What every filter is, so that a tracker, a test or a user can take any of them."""

from __future__ import annotations

from typing import Any, Protocol, TypeVar

from boresight.models.protocols import MeasurementModel, MotionModel
from boresight.types.sensor import FloatArray

S = TypeVar("S")


class Filter(Protocol[S]):
    """A filter is frozen configuration; its state goes in and comes out. `S` holds at least `t`, `x` and `P`."""

    def init(self, t: float, x: FloatArray, P: FloatArray) -> S:
        """Begin at `t` (s) from mean `x` and covariance `P` in world ENU; raises UserError for a bad prior."""

    def predict(self, state: S, motion: MotionModel, t: float) -> S:
        """Move to time `t` (s); raises UserError where time runs backwards."""

    def update(self, state: S, sensor: MeasurementModel, z: FloatArray) -> tuple[S, Any]:
        """Condition on one report; the second result says what was seen (innovation, S, NIS, log likelihood)."""
