"""Screening, smoothing and fusing as stages."""

from __future__ import annotations

import math
from collections import Counter

import numpy as np
import pytest

from boresight.screen.hampel import HampelScreen
from boresight.screen.plausible import PlausibilityScreen
from boresight.screen.prediction import PredictionScreen
from boresight.stages.fuse import FuseStage
from boresight.stages.protocol import NOTHING_BELIEVED
from boresight.stages.scene import Scene
from boresight.stages.screen import ScreenStage
from boresight.stages.smooth import SmoothStage
from boresight.types import Fate, Scan, SensorKind
from tests.stages.conftest import IR, RADAR, look, sensor

SCENE = Scene((RADAR, IR))
GUIDE = sensor("guide", SensorKind.RADAR, {0: 5.0, 1: 0.001, 2: 0.001})  # range is the coarser: σ = 5 m up to 5 km
SIGMA = np.array([5.0, 0.01, 0.01])


def guide(seed: int, targets: int, seconds: int) -> tuple[list[Scan], np.ndarray, np.ndarray]:
    """1 Hz radar of slow targets 2 km apart in range; 5 % jumps of 8–30σ in range, either sign; 20 % lost.

    Returns looks, and per row: whether it jumps, and whose it is.
    """
    rng = np.random.default_rng(seed)
    looks, jump, owner = [], [], []
    for k in range(seconds):
        reports = []
        for i in range(targets):
            if rng.random() < 0.2:
                continue
            jumps = rng.random() < 0.05
            r = 500.0 + 2000.0 * i + 0.5 * k + 5.0 * rng.standard_normal()
            r += rng.uniform(8, 30) * rng.choice([-1, 1]) * 5.0 if jumps else 0.0
            reports.append({0: r, 1: 0.001 * rng.standard_normal(), 2: 0.001 * rng.standard_normal()})
            jump.append(jumps)
            owner.append(i)
        looks.append(look(0, GUIDE, float(k), reports, len(jump) - len(reports)))
    return looks, np.array(jump), np.array(owner)


def screened(stage: ScreenStage, looks: list[Scan], n: int) -> np.ndarray:
    state, out = stage.init(), np.zeros(n, dtype=bool)
    kept = 0
    for one in looks:
        state, stepped = stage.step(state, one, NOTHING_BELIEVED)
        for note in stepped.notes:
            assert note.fate == Fate.SCREENED
            assert note.reason.split(":")[0] == "jump"
            out[note.row] = True
        kept += len(stepped.scans[0].t)
    assert kept + out.sum() == n
    return out


@pytest.mark.parametrize("screen", [PredictionScreen(), HampelScreen()])
def test_jumps_are_found_and_good_reports_kept(screen: PredictionScreen | HampelScreen) -> None:
    """One target: at least 95 % of the jumps out, at most 0.5 % of the good lost, 4000 s."""
    looks, jump, _ = guide(1, 1, 4000)
    stage = ScreenStage(Scene((GUIDE,)), screen, frozenset({0}), speed=5.0, rate=0.05, memory=screen.memory)
    out = screened(stage, looks, len(jump))
    assert out[jump].mean() >= 0.95
    assert out[~jump].mean() <= 0.005


def test_several_targets_do_not_reject_each_other() -> None:
    looks, jump, _ = guide(2, 3, 1500)
    stage = ScreenStage(SCENE, PredictionScreen(), frozenset({0}), speed=5.0, rate=0.05)
    out = screened(stage, looks, len(jump))
    assert out[~jump].mean() <= 0.01
    assert out[jump].mean() >= 0.85  # one that comes while another's report is lost may begin a history


def test_a_step_of_the_target_is_let_through() -> None:
    stage = ScreenStage(SCENE, PredictionScreen(), frozenset({0}), speed=5.0, rate=0.05)
    state = stage.init()
    seen = []
    for k in range(40):
        one = look(0, RADAR, float(k), [{0: 1000.0 + (900.0 if k >= 20 else 0.0), 1: 0.0, 2: 0.0}], k)
        state, stepped = stage.step(state, one, NOTHING_BELIEVED)
        seen.append(len(stepped.scans[0].t))
    assert seen[:20] == [1] * 20
    assert sum(seen[20:24]) == 1  # rejected three times, then it did move
    assert seen[24:] == [1] * 16


def test_plausibility_names_what_it_rejects() -> None:
    limits = PlausibilityScreen((100.0, 5000.0), (0.0, 1.0), speed_limit=300.0, slack=50.0)
    stage = ScreenStage(SCENE, limits, frozenset({0, 1}), speed=300.0, rate=0.05)
    state, why = stage.init(), Counter()
    for k in range(8):
        good = {0: 1000.0 + 100.0 * k, 1: 0.0, 2: 0.1}
        bad = {0: {0: 9000.0, 1: 1.0, 2: 0.1}, 1: {0: 2000.0, 1: 1.0, 2: -0.2}}.get(k % 2, good)
        state, stepped = stage.step(state, look(0, RADAR, float(k), [good, bad], 2 * k), NOTHING_BELIEVED)
        why.update(n.reason.split(":")[0] for n in stepped.notes)
        assert 2 * k in stepped.scans[0].row
    assert why == {"out_of_range": 4, "out_of_elevation": 4}
    state, stepped = stage.step(state, look(1, IR, 9.0, [{1: 0.0, 2: -0.1}, {1: 0.0, 2: 0.1}], 90), NOTHING_BELIEVED)
    assert [n.row for n in stepped.notes] == [90]
    state, stepped = stage.step(state, look(0, RADAR, 9.0, [{0: 4500.0, 1: 0.0, 2: 0.1}], 95), NOTHING_BELIEVED)
    assert [n.reason.split(":")[0] for n in stepped.notes] == ["too_fast"]


def test_smoothed_values_claim_no_more_than_is_new_in_them() -> None:
    """A cubic goes through unchanged; the noise's mean over 350 values is that of the reports, in claim and in fact."""
    stage = SmoothStage(SCENE, frozenset({0}), speed=100.0, rate=0.1, samples=7, order=1)
    rng = np.random.default_rng(3)
    means, first = [], None
    for _ in range(150):
        state, values = stage.init(), []
        for k in range(70):
            one = look(0, RADAR, float(k), [{0: 3000.0 + 20.0 * k + 5.0 * rng.standard_normal(), 1: 0.2, 2: 0.1}], k)
            state, stepped = stage.step(state, one, NOTHING_BELIEVED)
            values.append(stepped.scans[0].z[0, 0] - 3000.0 - 20.0 * k)
            R = stepped.scans[0].covariance[0]
            assert R[0, 0] >= 25.0 - 1e-9
        means.append(np.mean(values[10:]))
        first = values
    assert first is not None
    claimed = 5.0 / math.sqrt(60)
    # 150 runs: standard error of a deviation 1/√300 = 6 %, and ends add up to 6/60
    assert np.std(means) <= claimed * 1.25
    state = stage.init()
    exact = []
    for k in range(20):
        one = look(0, RADAR, float(k), [{0: 3000.0 + 20.0 * k, 1: 3.14, 2: 0.1}], k)
        state, stepped = stage.step(state, one, NOTHING_BELIEVED)
        exact.append(stepped.scans[0].z[0])
    np.testing.assert_allclose([z[0] for z in exact], 3000.0 + 20.0 * np.arange(20), atol=1e-6)
    np.testing.assert_allclose([z[1] for z in exact], 3.14, atol=1e-9)


@pytest.mark.parametrize("kind", ["inverse_variance", "dynamic", "covariance_intersection"])
def test_fused_reports_are_consistent(kind: str) -> None:
    """Radar and infrared of one target, 1500 looks: normalised error 3 for least squares, ≤ 3 for intersection."""
    stage = FuseStage(SCENE, kind, 0, frozenset({1}))
    rng = np.random.default_rng(4)
    truth = np.array([2000.0, 0.7, 0.2])
    state, nees, notes, sigma = stage.init(), [], [], []
    for k in range(1500):
        z = truth + SIGMA * rng.standard_normal(3)
        b = truth[1:] + 0.002 * rng.standard_normal(2)
        state, held = stage.step(state, look(0, RADAR, float(k), [dict(enumerate(z))], 2 * k), NOTHING_BELIEVED)
        assert held.scans == ()
        far = {1: b[0], 2: b[1]}
        state, out = stage.step(state, look(1, IR, float(k), [far, {1: 2.5, 2: 0.0}], 2 * k + 1), NOTHING_BELIEVED)
        (fused,) = out.scans
        e = fused.z[0, :3] - truth
        nees.append(float(e @ np.linalg.solve(fused.covariance[0, :3, :3], e)))
        sigma.append(math.sqrt(fused.covariance[0, 1, 1]))
        notes += out.notes
    assert Counter(n.fate for n in notes) == {Fate.ALIGNED: 1500, Fate.UNUSED: 1500}
    if kind == "covariance_intersection":
        assert np.mean(nees) <= 3.0
    else:
        assert np.mean(nees) == pytest.approx(3.0, abs=4 * math.sqrt(6 / 1500))
        expected = 1.0 / math.sqrt(1 / 0.01**2 + 1 / 0.002**2)
        assert np.mean(sigma[100:]) == pytest.approx(expected, rel=0.08)


def test_dynamic_weights_find_a_source_worse_than_declared() -> None:
    """Infrared ten times worse than declared: plain least squares is optimistic, learned weights nearly honest."""
    nees = {}
    for kind in ("inverse_variance", "dynamic"):
        stage = FuseStage(SCENE, kind, 0, frozenset({1}), gate=6.0)
        rng = np.random.default_rng(5)
        state, errors = stage.init(), []
        for k in range(800):
            z = np.array([2000.0, 0.7, 0.2]) + SIGMA * rng.standard_normal(3)
            b = np.array([0.7, 0.2]) + 0.02 * rng.standard_normal(2)
            state, _ = stage.step(state, look(0, RADAR, float(k), [dict(enumerate(z))], 2 * k), NOTHING_BELIEVED)
            state, out = stage.step(state, look(1, IR, float(k), [{1: b[0], 2: b[1]}], 2 * k + 1), NOTHING_BELIEVED)
            fused = out.scans[-1]
            e = fused.z[0, 1:3] - [0.7, 0.2]
            errors.append(float(e @ np.linalg.solve(fused.covariance[0, 1:3, 1:3], e)))
        nees[kind] = np.mean(errors[200:]) / 2
    assert nees["inverse_variance"] > 20.0
    assert nees["dynamic"] < 1.6


def test_a_slow_report_without_partner_goes_on_after_the_wait() -> None:
    stage = FuseStage(SCENE, "inverse_variance", 0, frozenset({1}), wait=0.5)
    state, out = stage.step(stage.init(), look(0, RADAR, 1.0, [{0: 900.0, 1: 0.0, 2: 0.0}], 0), NOTHING_BELIEVED)
    assert out.scans == ()
    state, out = stage.step(state, look(1, IR, 1.7, [{1: 0.0, 2: 0.0}], 1), NOTHING_BELIEVED)
    assert [s.sensor for s in out.scans] == [1, 0]
    state, _ = stage.step(state, look(0, RADAR, 2.0, [{0: 900.0, 1: 0.0, 2: 0.0}], 2), NOTHING_BELIEVED)
    assert [n.row for n in stage.finish(state)] == [2]
