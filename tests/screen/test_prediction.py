"""The jump screen against theory and on data with jumps and losses."""

from __future__ import annotations

import numpy as np
import pytest

from boresight.errors import UserError
from boresight.screen.prediction import (
    PredictionScreen,
    Verdict,
    fourth_difference_ok,
    line_weights,
    three_sigma_of_five_ok,
)


def verdicts(y: np.ndarray, t: np.ndarray, sigma: float = 1.0) -> list[Verdict]:
    screen = PredictionScreen()
    state, out = screen.init(), []
    for a, b in zip(t, y):
        state, verdict = screen.step(state, float(a), b, sigma)
        out.append(verdict)
    return out


def test_the_line_is_the_papers_predictor() -> None:
    np.testing.assert_allclose(line_weights(np.arange(5.0), 5.0), np.array([-4, -1, 2, 5, 8]) / 10, atol=1e-15)


def test_jumps_are_found_and_good_reports_kept() -> None:
    """1 Hz, 5 % jumps of 8–30σ, 20 % lost: at least 95 % found, at most 0.5 % of the good lost."""
    rng = np.random.default_rng(10)
    n = 20_000
    t = np.arange(float(n))[rng.random(n) >= 0.2]
    jump = rng.random(len(t)) < 0.05
    size = rng.uniform(8, 30, len(t)) * rng.choice([-1, 1], len(t))
    y = 0.02 * t + rng.standard_normal(len(t)) + np.where(jump, size, 0.0)
    got = np.array(verdicts(y[:, None], t)) == Verdict.JUMP
    assert got[jump].mean() >= 0.95
    assert got[~jump].mean() <= 0.005


def test_a_genuine_step_does_not_lock_the_source_out() -> None:
    rng = np.random.default_rng(11)
    t = np.arange(60.0)
    y = rng.standard_normal(60) + np.where(t >= 30, 200.0, 0.0)
    got = verdicts(y[:, None], t)
    assert got[30:33] == [Verdict.JUMP] * 3
    assert got[33] == Verdict.REOPENED
    assert all(v in (Verdict.GOOD, Verdict.UNTESTED) for v in got[34:])


def test_duplicates_and_stale_reports_are_named() -> None:
    got = verdicts(np.zeros((4, 1)), np.array([0.0, 1.0, 1.0, 0.5]))
    assert got[2:] == [Verdict.DUPLICATE, Verdict.STALE]
    with pytest.raises(UserError, match="reopen"):
        PredictionScreen(reopen=1)


def test_three_sigma_of_five_never_fires() -> None:
    """max |y − ȳ|/s = (n − 1)/√n = 1.79 for n = 5: even a jump of a million σ passes."""
    assert three_sigma_of_five_ok([0.0, 0.0, 0.0, 0.0, 1e6])
    rng = np.random.default_rng(12)
    assert all(three_sigma_of_five_ok(rng.standard_normal(5) * 10 ** rng.uniform(-3, 3, 5)) for _ in range(2000))


def test_the_fourth_difference_flags_a_window() -> None:
    """Noise gain √70: 17σ is 2.03 of its standard deviations, 4.2 % false alarms."""
    rng = np.random.default_rng(13)
    false = np.mean([not fourth_difference_ok(rng.standard_normal(5), 1.0) for _ in range(20_000)])
    assert false == pytest.approx(0.042, abs=0.005)  # ± 3.5 sqrt(0.042 · 0.958 / 20000)
