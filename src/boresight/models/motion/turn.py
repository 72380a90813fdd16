"""Coordinated turns, of known rate and of a rate that is estimated."""

from __future__ import annotations

import math
from dataclasses import dataclass

from boresight.errors import UserError
from boresight.kernels.motion import TURN, TURNING, move
from boresight.models import check
from boresight.models.motion.base import KernelMotion


@dataclass(frozen=True)
class KnownTurn(KernelMotion):
    """Horizontal turn at a known `rate` (rad/s, positive from east towards north) with white acceleration `q` (m²/s³).

    State (position, velocity); exact F and Q(dt). Raises UserError for a rate that is not finite, `q` that is not
    positive, `dimensions` other than 2 and 3.
    """

    rate: float
    q: float
    dimensions: int = 3
    kernel = staticmethod(move)
    layout = ("position", "velocity")

    def __post_init__(self) -> None:
        if not math.isfinite(self.rate):
            raise UserError(f"rate must be a finite number, not {self.rate!r}")
        check.positive("q", self.q)
        check.spatial(self.dimensions)
        self.set_parameters(TURN, self.dimensions, self.rate, self.q)


@dataclass(frozen=True)
class CoordinatedTurn(KernelMotion):
    """Horizontal turn whose rate is estimated: state (position, velocity, turn rate).

    White acceleration `q` (m²/s³); the rate (rad/s, positive from east towards north) walks with `q_rate` (rad²/s³).
    The mean is exact at the present rate. Raises UserError for values that are not positive.
    """

    q: float
    q_rate: float
    dimensions: int = 3
    kernel = staticmethod(move)
    layout = ("position", "velocity", "turn_rate")

    def __post_init__(self) -> None:
        check.positive("q", self.q)
        check.positive("q_rate", self.q_rate)
        check.spatial(self.dimensions)
        self.set_parameters(TURNING, self.dimensions, self.q, self.q_rate)
