"""The median screen and the plausibility limits."""

from __future__ import annotations

import numpy as np
import pytest

from boresight.errors import UserError
from boresight.screen.hampel import HampelScreen
from boresight.screen.plausible import PlausibilityScreen
from boresight.screen.prediction import Verdict


def hampel(y: np.ndarray, t: np.ndarray) -> np.ndarray:
    screen = HampelScreen()
    state, out = screen.init(), []
    for a, b in zip(t, y):
        state, verdict = screen.step(state, float(a), [b], 1.0)
        out.append(verdict)
    return np.array(out)


def test_jumps_are_found_and_good_reports_kept() -> None:
    """1 Hz, 5 % jumps of 8–30σ, 20 % lost: at least 95 % found, at most 0.5 % of the good lost."""
    rng = np.random.default_rng(20)
    t = np.arange(20_000.0)[rng.random(20_000) >= 0.2]
    jump = rng.random(len(t)) < 0.05
    size = rng.uniform(8, 30, len(t)) * rng.choice([-1, 1], len(t))
    got = hampel(0.02 * t + rng.standard_normal(len(t)) + np.where(jump, size, 0.0), t) == Verdict.JUMP
    assert got[jump].mean() >= 0.95
    assert got[~jump].mean() <= 0.005


def test_a_step_is_let_through_after_half_a_window() -> None:
    rng = np.random.default_rng(21)
    t = np.arange(60.0)
    got = hampel(rng.standard_normal(60) + np.where(t >= 30, 200.0, 0.0), t)
    assert (got[30:34] == Verdict.JUMP).all()
    assert (got[36:] == Verdict.GOOD).all()
    assert list(hampel(np.zeros(3), np.array([0.0, 0.0, -1.0]))[1:]) == [Verdict.DUPLICATE, Verdict.STALE]


def test_limits_name_what_they_reject() -> None:
    screen = PlausibilityScreen((100.0, 20e3), (0.0, 1.5), speed_limit=500.0, slack=50.0)
    state, out = screen.init(), []
    walk = [
        (0.0, [5000.0, 0, 1000]),
        (1.0, [5400.0, 0, 1000]),
        (2.0, [50.0, 0, 10]),
        (2.5, [30e3, 0, 1000]),
        (3.0, [5000.0, 0, -10]),
        (4.0, [9000.0, 0, 1000]),
        (4.0, [9000.0, 0, 1000]),
        (3.5, [5500.0, 0, 1000]),
        (5.0, [5900.0, 0, 1000]),
    ]
    for t, p in walk:
        state, verdict = screen.step(state, t, p)
        out.append(verdict)
    v = Verdict
    range_, down, fast = v.OUT_OF_RANGE, v.OUT_OF_ELEVATION, v.TOO_FAST
    assert out == [v.UNTESTED, v.GOOD, range_, range_, down, fast, v.DUPLICATE, v.STALE, v.GOOD]


def test_a_run_of_fast_reports_that_agree_reopens() -> None:
    screen = PlausibilityScreen(speed_limit=300.0, slack=10.0)
    state, _ = screen.step(screen.init(), 0.0, [0.0, 0.0, 1000.0])
    out = []
    for k in range(1, 7):
        state, verdict = screen.step(state, float(k), [50e3 + 200.0 * k, 0.0, 1000.0])
        out.append(verdict)
    assert out == [Verdict.TOO_FAST] * 3 + [Verdict.REOPENED] + [Verdict.GOOD] * 2
    state, _ = screen.step(screen.init(), 0.0, [0.0, 0.0, 1000.0])
    for k in range(1, 10):  # wild reports never agree
        state, verdict = screen.step(state, float(k), [50e3 * (-1) ** k, 0.0, 1000.0])
        assert verdict == Verdict.TOO_FAST


def test_mistakes_are_told() -> None:
    with pytest.raises(UserError, match="window"):
        HampelScreen(window=3)
    with pytest.raises(UserError, match="range"):
        PlausibilityScreen(range_limits=(5.0, 1.0))
    with pytest.raises(UserError, match="speed_limit"):
        PlausibilityScreen(speed_limit=0.0)
