"""A scalar that a sensor reports beside the kinematics (temperature, brightness, length): a belief of its own.

It helps to say which report belongs to which track, and is no part of the kinematic state, which it would only slow.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from boresight.errors import UserError
from boresight.models import check


class AttributeState(NamedTuple):
    """What is believed of one attribute at `t` (s); variance infinite before the first report."""

    t: float
    mean: float
    variance: float


@dataclass(frozen=True, slots=True)
class Attribute:
    """A slowly changing scalar: a random walk of spectral density `q` (unit²/s), reported with `sigma` (unit).

    `spread` is the sigma over all targets and clutter, which is what a report says of a track that has none yet.
    Raises UserError for values that are not positive.
    """

    sigma: float
    spread: float
    mean: float = 0.0
    q: float = 1e-6

    def __post_init__(self) -> None:
        for name in ("sigma", "spread", "q"):
            check.positive(name, getattr(self, name))

    def init(self, t: float) -> AttributeState:
        """Begin with the population's mean and spread."""
        return AttributeState(t, self.mean, self.spread**2)

    def predict(self, state: AttributeState, t: float) -> AttributeState:
        """Move to time `t` (s); raises UserError where time runs backwards."""
        if not t >= state.t:
            raise UserError(f"cannot predict from t = {state.t!r} to t = {t!r}: time must not run backwards")
        return AttributeState(t, state.mean, min(state.variance + self.q * (t - state.t), self.spread**2))

    def log_likelihood(self, state: AttributeState, z: float) -> float:
        """Return log N(z; mean, variance + sigma²); 0 for a report without the attribute (NaN)."""
        if math.isnan(z):
            return 0.0
        s = state.variance + self.sigma**2
        return -0.5 * ((z - state.mean) ** 2 / s + math.log(2.0 * math.pi * s))

    def update(self, state: AttributeState, z: float) -> AttributeState:
        """Condition on one report; a report without the attribute (NaN) changes nothing."""
        if math.isnan(z):
            return state
        gain = state.variance / (state.variance + self.sigma**2)
        return AttributeState(state.t, state.mean + gain * (z - state.mean), (1.0 - gain) * state.variance)
