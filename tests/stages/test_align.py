"""Values made of several reports: exact on lines, covariance exact, every report in one value at most."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from boresight.errors import UserError
from boresight.stages.align import AlignStage
from boresight.stages.protocol import NOTHING_BELIEVED, Belief, Note
from boresight.stages.scene import Scene
from boresight.types import Fate, Scan
from tests.stages.conftest import BEARING, IR, RADAR, look

SLOW, FAST = 0, 1


def stage(kind: str, fast: Any = IR, **more: Any) -> AlignStage:
    return AlignStage(Scene((RADAR, fast)), kind, SLOW, frozenset({FAST}), rate=0.1, **more)


def play(one: AlignStage, scans: list[Scan], belief: Belief = NOTHING_BELIEVED) -> tuple[list[Scan], list[Note]]:
    state, out, notes = one.init(), [], []
    for scan in scans:
        state, stepped = one.step(state, scan, belief)
        out += stepped.scans
        notes += stepped.notes
    notes += one.finish(state)
    return out, notes


def stream(lines: list[tuple[float, float]], noise: np.ndarray | None = None, fast: Any = IR) -> list[Scan]:
    """Infrared every 0.1 s along az = a + b t (el = az/10); radar at 1, 2, 3 s, after the infrared of that time."""
    out, row = [], 0
    for k in range(1, 36):
        t = 0.1 * k
        reports = []
        for i, (a, b) in enumerate(lines):
            extra = 0.0 if noise is None else float(noise[k, i])
            az = math.remainder(a + b * t + extra, 2 * math.pi)
            reports.append({1: az} if fast is BEARING else {1: az, 2: 0.1 * (a + b * t) + extra})
        out.append(look(FAST, fast, t + fast.latency, reports, row))
        row += len(lines)
        if k % 10 == 0:
            out.append(look(SLOW, RADAR, t, [{0: 1000.0, 1: 0.0, 2: 0.0}], 1000 + k, recv=t + fast.latency))
    return out


@pytest.mark.parametrize("kind", ["interpolate", "compress", "window"])
def test_lines_come_back_at_the_slow_sensors_times(kind: str) -> None:
    """Two targets, one through south where azimuth wraps: values on the line at 1, 2 and 3 s, whatever the kind."""
    lines = [(0.3, 0.05), (3.1, 0.03)]
    out, notes = play(stage(kind, order=1, future=5), stream(lines))
    values = [s for s in out if s.sensor == FAST]
    assert [round(s.t_look, 9) for s in values] == [1.0, 2.0, 3.0]
    for s in values:
        expected = sorted(math.remainder(a + b * s.t_look, 2 * math.pi) for a, b in lines)
        np.testing.assert_allclose(sorted(s.z[:, 1]), expected, atol=1e-12)
        assert s.t_recv >= s.t_look
    told = [n.row for n in notes]
    assert len(told) == len(set(told))  # no report twice
    assert {n.fate for n in notes} <= {Fate.ALIGNED, Fate.UNUSED}
    assert set(told) == set(range(70))  # each of them somewhere
    waits = {"interpolate": 0.1, "compress": 0.0, "window": 0.5}[kind]
    if kind != "window":
        assert all(s.t_recv == pytest.approx(s.t_look + waits) for s in values)


def test_a_known_delay_is_taken_off_before_values_are_read() -> None:
    out, _ = play(stage("compress", BEARING), stream([(0.3, 0.05)], fast=BEARING))
    for s in (s for s in out if s.sensor == FAST):
        np.testing.assert_allclose(s.z[:, 1], 0.3 + 0.05 * (s.t - BEARING.latency), atol=1e-12)
        assert s.t[0] == pytest.approx(round(s.t[0] - 0.3) + 0.3)  # stamped as the sensor would stamp it


@pytest.mark.parametrize(("kind", "order"), [("interpolate", 1), ("compress", 1), ("window", 2)])
def test_the_covariance_is_that_of_the_weights(kind: str, order: int) -> None:
    """Disturb each report in turn: the value moves by its weight, and Σ w²σ² must be the covariance that is given."""
    one = stage(kind, order=order, past=8, future=3)
    base = next(s for s in play(one, stream([(0.3, 0.05)]))[0] if s.sensor == FAST)
    weights = []
    for k in range(1, 36):
        noise = np.zeros((36, 1))
        noise[k] = 1e-3
        moved = next(s for s in play(one, stream([(0.3, 0.05)], noise))[0] if s.sensor == FAST)
        weights.append((moved.z[0, 1] - base.z[0, 1]) / 1e-3)
    w = np.array(weights)
    assert w.sum() == pytest.approx(1.0)
    assert base.covariance[0, 1, 1] == pytest.approx(IR.sigma[1] ** 2 * float(w @ w), rel=1e-9)
    assert base.covariance[0, 2, 2] == pytest.approx(IR.sigma[2] ** 2 * float(w @ w), rel=1e-9)
    assert base.covariance[0, 1, 2] == 0.0
    if kind == "compress":  # shao2012 (5)
        assert float(w @ w) == pytest.approx(2 * 19 / (10 * 11))


def test_compressed_innovations_are_the_mean_of_variance_sigma_squared_over_n() -> None:
    """A target on a straight path, the prediction off by a little: the mean innovation falls back on the true path."""
    path, speed = np.array([1000.0, 2000.0, 300.0]), np.array([20.0, -10.0, 1.0])
    off = np.array([3.0, -2.0, 1.0])
    belief = Belief(0.0, (path + off)[None], speed[None], 25.0 * np.eye(3)[None], np.zeros((1, 3, 3)))
    scans, row = [], 0
    for k in range(1, 11):
        p = path + 0.1 * k * speed
        az, el = math.atan2(p[0], p[1]), math.atan2(p[2], math.hypot(p[0], p[1]))
        scans.append(look(FAST, IR, 0.1 * k, [{1: az, 2: el}, {1: az + 1.0, 2: el}], row))
        row += 2
    scans.append(look(SLOW, RADAR, 1.0, [], 500, recv=1.0))
    out, notes = play(stage("compress_innovations"), scans, belief)
    value = next(s for s in out if s.sensor == FAST)
    assert value.t[0] == pytest.approx(0.55)
    p = path + 0.55 * speed
    expected = [math.atan2(p[0], p[1]), math.atan2(p[2], math.hypot(p[0], p[1]))]
    np.testing.assert_allclose(value.z[0, 1:3], expected, atol=1e-7)
    np.testing.assert_allclose(value.covariance[0, 1:3, 1:3], np.diag([4e-7, 4e-7]), rtol=1e-9)
    strangers = [n for n in notes if n.fate == Fate.UNASSOCIATED]
    assert len(strangers) == 10  # the other direction belongs to no track


def test_a_silent_slow_sensor_does_not_hold_reports_for_ever() -> None:
    scans = [s for s in stream([(0.3, 0.05)]) if s.sensor == FAST]
    out, notes = play(stage("compress", hold=1.0), scans)
    assert len(out) == 3
    assert len(notes) == 35  # three values of eleven or twelve, the rest held when the recording ended
    assert sum(n.fate == Fate.UNUSED for n in notes) < 11


def test_mistakes_are_told() -> None:
    with pytest.raises(UserError, match="order"):
        stage("window", order=4)
    with pytest.raises(UserError, match="past"):
        stage("window", past=1)
