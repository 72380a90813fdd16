"""Throw out jumps: a report against what the source's own last reports predict (phased_array §1.3, repaired)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from boresight.errors import UserError
from boresight.types.sensor import FloatArray

FOURTH_DIFFERENCE = np.array([1.0, -4.0, 6.0, -4.0, 1.0])  # phased_array (2); noise gain √70
WINDOW = 5


class Verdict(StrEnum):
    """What a screen says of one report."""

    GOOD = "good"
    UNTESTED = "untested"  # not enough history yet
    JUMP = "jump"
    DUPLICATE = "duplicate"
    STALE = "stale"
    OUT_OF_RANGE = "out_of_range"
    OUT_OF_ELEVATION = "out_of_elevation"
    TOO_FAST = "too_fast"
    REOPENED = "reopened"  # a run of rejections that agree with each other: the target did move


class Screened(NamedTuple):
    """The last good reports of one source, and the run of rejected ones."""

    t: tuple[float, ...] = ()
    y: tuple[FloatArray, ...] = ()
    rejected_t: tuple[float, ...] = ()
    rejected_y: tuple[FloatArray, ...] = ()


@dataclass(frozen=True, slots=True)
class PredictionScreen:
    """|y − ŷ| > gate · σ_ŷ rejects, ŷ from the least-squares line over the last five good reports.

    On even samples ŷ is phased_array (3) and σ_ŷ = √2.1 σ; at any other times both follow from the times. `gate` = 4
    finds 94 % of jumps of 8σ and 99.8 % of 10σ. History older than `memory` (s) is dropped. After `reopen` rejections
    in a row that fit one line among themselves the gate opens again: a source is never locked out.
    """

    gate: float = 4.0
    memory: float = 12.0
    reopen: int = 4

    def __post_init__(self) -> None:
        if not (self.gate > 0 and self.memory > 0 and self.reopen >= 3):
            raise UserError("screen: gate and memory must be above zero, and reopen at least 3")

    def init(self) -> Screened:
        """Return the state before the first report."""
        return Screened()

    def step(self, state: Screened, t: float, y: ArrayLike, sigma: float) -> tuple[Screened, Verdict]:
        """Judge a report `y` (k,) of isotropic standard deviation `sigma` at time `t` (s), and remember it."""
        value = np.asarray(y, dtype=np.float64)
        if state.t and t <= state.t[-1]:
            return state, Verdict.DUPLICATE if t == state.t[-1] else Verdict.STALE
        keep = [i for i, s in enumerate(state.t) if t - s <= self.memory]
        times, values = tuple(state.t[i] for i in keep), tuple(state.y[i] for i in keep)
        if len(times) < 3:
            return _remember(times, values, t, value), Verdict.UNTESTED
        if _fits(times, values, t, value, self.gate * sigma):
            return _remember(times, values, t, value), Verdict.GOOD
        bad_t, bad_y = (*state.rejected_t, t), (*state.rejected_y, value)
        if len(bad_t) >= self.reopen:
            bad_t, bad_y = bad_t[-self.reopen :], bad_y[-self.reopen :]
            if _fits(bad_t[:-1], bad_y[:-1], t, value, self.gate * sigma):
                return Screened(bad_t, bad_y), Verdict.REOPENED
        return Screened(times, values, bad_t, bad_y), Verdict.JUMP


def _remember(t: tuple[float, ...], y: tuple[FloatArray, ...], now: float, value: FloatArray) -> Screened:
    return Screened((*t, now)[-WINDOW:], (*y, value)[-WINDOW:])


def _fits(t: tuple[float, ...], y: tuple[FloatArray, ...], now: float, value: FloatArray, limit: float) -> bool:
    weights = line_weights(t, now)
    off = value - weights @ np.array(y)
    return float(np.abs(off).max()) <= limit * math.sqrt(1.0 + float(weights @ weights))


def line_weights(times: ArrayLike, at: float) -> FloatArray:
    """Return the weights (n,) of the least-squares line through samples at `times` (n,), at one time."""
    t = np.asarray(times, dtype=np.float64)
    d = t - t.mean()
    out: FloatArray = 1.0 / len(t) + (at - t.mean()) * d / (d @ d)
    return out


def fourth_difference_ok(y: ArrayLike, sigma: float, gate: float = 17.0) -> bool:
    """Return whether |Δ⁴y| <= gate · σ over five even samples (phased_array (2)); it judges a window, not a sample."""
    return abs(float(FOURTH_DIFFERENCE @ np.asarray(y, dtype=np.float64))) <= gate * sigma


def three_sigma_of_five_ok(y: ArrayLike) -> bool:
    """Return whether |y − ȳ| < 3s for the newest of five samples (phased_array §1.3, step 2).

    Always true: among five samples the largest possible |y − ȳ|/s is (n − 1)/√n = 1.79. Kept to show that.
    """
    values = np.asarray(y, dtype=np.float64)
    spread = float(values.std(ddof=1))
    return spread == 0.0 or abs(float(values[-1] - values.mean())) < 3.0 * spread
