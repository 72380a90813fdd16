"""Throw out jumps against the median of the last reports (Hampel 1974)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from boresight.errors import UserError
from boresight.screen.prediction import Verdict
from boresight.types.sensor import FloatArray

MAD_TO_SIGMA = 1.4826  # of a Gaussian


class Recent(NamedTuple):
    """The last reports of one source, rejected ones too: the median does not mind them."""

    t: tuple[float, ...] = ()
    y: tuple[FloatArray, ...] = ()


@dataclass(frozen=True, slots=True)
class HampelScreen:
    """|y − median| > gate · max(1.4826 MAD, σ) rejects, over the last `window` reports no older than `memory` (s).

    For what moves by less than σ from report to report: the median lags by half a window. Rejected reports stay in
    the window, so a genuine step is let through once most of the window lies beyond it: no source is locked out.
    """

    gate: float = 4.0
    window: int = 9
    memory: float = 30.0

    def __post_init__(self) -> None:
        if not (self.gate > 0 and self.memory > 0 and self.window >= 5):
            raise UserError("screen: gate and memory must be above zero, and window at least 5")

    def init(self) -> Recent:
        """Return the state before the first report."""
        return Recent()

    def step(self, state: Recent, t: float, y: ArrayLike, sigma: float) -> tuple[Recent, Verdict]:
        """Judge a report `y` (k,) of standard deviation `sigma` at time `t` (s), and remember it."""
        value = np.asarray(y, dtype=np.float64)
        if state.t and t <= state.t[-1]:
            return state, Verdict.DUPLICATE if t == state.t[-1] else Verdict.STALE
        keep = [i for i, s in enumerate(state.t) if t - s <= self.memory]
        times, values = tuple(state.t[i] for i in keep), tuple(state.y[i] for i in keep)
        after = Recent((*times, t)[-self.window :], (*values, value)[-self.window :])
        if len(times) < 5:
            return after, Verdict.UNTESTED
        past = np.array(values)
        median = np.median(past, axis=0)
        scale = np.maximum(MAD_TO_SIGMA * np.median(np.abs(past - median), axis=0), sigma)
        good = bool((np.abs(value - median) <= self.gate * scale).all())
        return after, Verdict.GOOD if good else Verdict.JUMP
