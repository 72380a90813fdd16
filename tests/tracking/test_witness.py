"""What sensors bear witness to: confirmation that counts once, targets that a sensor passes over, who claims what."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from scipy.stats import chi2

from boresight.kernels.tracker import AZIMUTH_BINS, NOTHING, STATIC, VISIBLE
from boresight.kernels.tracker_witness import LEAST_CHANCE, MEMORY, PASSING
from boresight.tracking.config import SensorErrors, TrackerConfig
from boresight.tracking.tracker import Tracker, TrackerState
from boresight.types import FATES, Coverage, Fate, SensorKind
from tests.tracking.test_life import FOR_EVER, P_EYE, P_RADAR, after, doubted, glance, odds, tracker
from tests.tracking.test_rules import points, sensor

TOWARDS = float(np.arctan2(300.0, 400.0))  # rad, from the origin to the track of these tests
WAVERING = 0.02  # rad, of the eye's bearings, slowly


def confirming(delete_below: float = 1e-4, **errors: float) -> Tracker:
    eye = SensorErrors(moves_tracks=False, bias_azimuth=WAVERING, **errors)
    return tracker({"eye": eye}, delete_below=delete_below)


def chance_of(state: TrackerState) -> float:
    """Probability of a false detection that lasts within a gate, from how many a look has on average."""
    width = 2.0 * np.sqrt(chi2.ppf(TrackerConfig().gate_probability, 1)) * np.hypot(0.01, WAVERING)
    expected = state.window.tracks.clutter[1, AZIMUTH_BINS] * width / (2.0 * np.pi)
    return max(1.0 - float(np.exp(-expected)), LEAST_CHANCE)


def images(used: Tracker, state: TrackerState, azimuth: list[float], count: int, t: float) -> TrackerState:
    for k in range(count):
        state, _ = used.step(state, glance(t + 0.1 * k, azimuth))
    return state


@pytest.mark.parametrize("clutter", [0.0, 8.0])
@pytest.mark.parametrize("there", [True, False])
def test_one_look_is_bayes_rule_over_all_that_could_be(there: bool, clutter: float) -> None:
    """Summed over whether the sensor reports the track at all, and whether something else stands in its direction."""
    reports, still = 0.8, 0.1
    used = confirming(sees_targets=reports, sees_static=still)
    state = after(used, [[300.0, 400.0]])
    tr = state.window.tracks
    tr.weight[0] = 0.4, 0.0, 0.3, 0.3
    tr.clutter[1, AZIMUTH_BINS] = clutter
    stands = chance_of(state)
    likelihood = {}
    for hypothesis, seen in ((VISIBLE, reports), (STATIC, still * reports), (NOTHING, 0.0)):
        total = 0.0
        for mine, other in itertools.product((True, False), repeat=2):
            weight = (seen if mine else 1.0 - seen) * (stands if other else 1.0 - stands)
            found = 1.0 - (1.0 - P_EYE * mine) * (1.0 - (P_EYE if other else PASSING))
            total += weight * (found if there else 1.0 - found)
        likelihood[hypothesis] = total
    expected = np.array([0.4, 0.3, 0.3]) * [likelihood[h] for h in (VISIBLE, STATIC, NOTHING)]
    state, _ = used.step(state, glance(10.0, [TOWARDS] if there else []))
    w = state.window.tracks.weight[0]
    np.testing.assert_allclose(w[[VISIBLE, STATIC, NOTHING]], expected / expected.sum(), rtol=1e-6)


def test_one_bearing_does_not_confirm_all_that_lie_in_its_direction() -> None:
    """What speaks for a doubtful track is what the others in that direction do not account for."""
    doubtful = 0.3
    used = confirming()
    state = after(used, [[300.0, 400.0], [600.0, 800.0]])
    tr = state.window.tracks
    tr.weight[:2], tr.life[:2, 2] = (doubtful, 0.0, 0.0, 1.0 - doubtful), 0.0
    stands, before = chance_of(state), odds(state)
    by_others = 1.0 - doubtful * P_EYE  # that the other track is not what is seen
    none = 1.0 - by_others * (1.0 - stands * P_EYE - (1.0 - stands) * PASSING)
    target = 1.0 - (1.0 - P_EYE) * (1.0 - none)
    state, _ = used.step(state, glance(10.0, [TOWARDS]))
    assert odds(state, 0) == pytest.approx(before * target / none, rel=1e-6)
    assert odds(state, 1) == pytest.approx(before * target / none, rel=1e-6)


@pytest.mark.parametrize("order", [1, -1])
def test_of_several_bearings_the_one_that_others_claim_least_counts(order: int) -> None:
    """One bearing lies in the direction of two doubtful tracks, another beside it within the gate of one alone."""
    used = confirming()
    gained = []
    for bearings in ([TOWARDS], [TOWARDS, TOWARDS - 0.07][::order]):
        state = after(used, [[300.0, 400.0], [640.0, 770.0]])
        tr = state.window.tracks
        tr.weight[:2], tr.life[:2, 2] = (0.3, 0.0, 0.0, 0.7), 0.0
        heard, before = tr.heard[:2].copy(), odds(state)
        state, _ = used.step(state, glance(10.0, bearings))
        gained.append(odds(state) / before)
        np.testing.assert_array_equal(
            state.window.tracks.heard[:2], heard
        )  # a bearing that only confirms moved nothing
    assert gained[1] > 1.2 * gained[0]


def test_what_an_eye_sees_in_a_direction_counts_once() -> None:
    """Images with a detection as often as there would be one of a target are worth what chance makes improbable."""
    gained = []
    for seed in range(20):
        used = confirming(delete_below=0.0)
        state = after(used, [[300.0, 400.0]])
        tr = state.window.tracks
        tr.weight[0], tr.clutter[1, AZIMUTH_BINS] = (1e-3, 0.0, 0.0, 1.0 - 1e-3), 4.0
        stands, before = chance_of(state), odds(state)
        rng = np.random.default_rng(seed)
        there = rng.random(300) < P_EYE
        each = []
        for k in range(300):
            state, _ = used.step(state, glance(10.0 + 0.1 * k, [TOWARDS] if there[k] else []))
            each.append(np.log(odds(state) / before))
        assert state.window.tracks.live[0] == 1
        gained.append([each[29], each[-1]])
    early, late = np.mean(gained, axis=0)
    # the logarithm of 1 / chance; over 20 runs the mean of either wanders by 0.3. Independent images: 30 times as much
    assert early == pytest.approx(-np.log(stands), abs=1.0)
    assert late == pytest.approx(-np.log(stands), abs=1.5)


def test_looks_close_in_time_teach_as_much_as_one() -> None:
    """Twenty tempered looks over a decorrelation time weigh a track, and what is learned of it, as one look does."""
    kept, weighed = [], []
    for step, looks in ((2.0, 1), (0.1, 20)):
        used = confirming(sees_targets=0.8, decorrelation=2.0)
        state = after(used, [[300.0, 400.0]])
        state, _ = used.step(state, glance(10.0, []))
        state = doubted(state)
        for k in range(looks):
            state, _ = used.step(state, glance(10.0 + step * (k + 1), []))
        kept.append(state.window.tracks.witness[0, 0].copy())
        weighed.append(odds(state))
    np.testing.assert_allclose(kept[1], kept[0], rtol=0.05)  # a little is forgotten in between
    assert weighed[1] == pytest.approx(weighed[0], rel=0.02)


def test_what_is_contested_neither_confirms_nor_refutes() -> None:
    """All that the eye shows near a doubtful boat may be the shown one's: no hit, no miss, and nobody's detection."""
    used = confirming()
    state = doubted(after(used, [[300.0, 400.0], [600.0, 800.0]]))
    tr = state.window.tracks
    tr.weight[1], tr.life[1, 2] = (0.3, 0.0, 0.0, 0.7), 0.0
    before, hits = odds(state, 1), tr.life[:2, 3].copy()
    state, _ = used.step(state, glance(10.0, [TOWARDS]))
    assert odds(state, 1) == before
    np.testing.assert_array_equal(state.window.tracks.life[:2, 3] - hits, [1.0, 0.0])  # it was the shown one's


def test_a_buoy_that_the_eye_reports_like_a_boat_is_no_more_refuted_than_a_boat() -> None:
    """With sees_static 1 an eye tells nothing of what moves from what does not, however many images."""
    used = confirming(sees_targets=0.8)
    state = after(used, [[300.0, 400.0]])
    state.window.tracks.weight[0] = 0.4, 0.0, 0.4, 0.2
    state = images(used, state, [], 30, 10.0)
    w = state.window.tracks.weight[0]
    assert w[STATIC] == pytest.approx(w[VISIBLE])


def test_a_sensor_that_does_not_ask_forgets_all_the_same() -> None:
    """An eye that looks elsewhere for a minute knows as little as one that was closed."""
    found = []
    for busy in (False, True):
        south = Coverage(azimuth=(np.pi / 2.0, -np.pi / 2.0))
        eye = sensor("eye", SensorKind.OPTICAL, p_detection=P_EYE, coverage=south)
        radar = sensor("radar", coverage=Coverage(range=(0.0, 2000.0)), p_detection=P_RADAR, clutter_per_scan=2.0)
        settings = {"q": 0.1, "static_share": 0.0, "stop_floor": 0.0, **FOR_EVER}
        used = Tracker(TrackerConfig(sensors={"eye": SensorErrors(moves_tracks=False)}, **settings), (radar, eye), 2)
        state = after(used, [[300.0, 400.0]])
        state, _ = used.step(state, glance(10.0, []))
        state.window.tracks.witness[0, 0, 0] = 0.001
        for t in range(11, 71) if busy else [70]:
            state, _ = used.step(state, glance(float(t), []))
        found.append(state.window.tracks.witness[0, 0, 0])
    assert found == pytest.approx([1.0 - 0.999 * np.exp(-60.0 / MEMORY)] * 2)


def test_an_unused_sensor_touches_nothing() -> None:
    radar = sensor("radar", coverage=Coverage(range=(0.0, 2000.0)), p_detection=P_RADAR, clutter_per_scan=2.0)
    eye = sensor("eye", SensorKind.OPTICAL, p_detection=P_EYE)
    used = Tracker(TrackerConfig(sensors={"eye": SensorErrors(moves_tracks=False)}), (radar, eye), 2, use=(0,))
    state = after(used, [[300.0, 400.0]])
    state, _ = used.step(state, glance(10.0, [TOWARDS]))
    assert state.window.tracks.witness.shape[1:] == (1, 2)


@pytest.mark.parametrize("share", [0.8, 1.0])
def test_images_without_a_target_cannot_refute_one_that_the_eye_may_pass_over(share: float) -> None:
    used = confirming(sees_targets=share)
    state = doubted(after(used, [[300.0, 400.0]]))
    before = odds(state)
    state = images(used, state, [], 50, 10.0)
    assert odds(state) < before
    assert (odds(state) > 0.1 * before) == (share < 1.0)


@pytest.mark.parametrize("share", [0.75, 1.0])
def test_a_lidar_that_may_never_report_a_boat_does_not_hide_it(share: float) -> None:
    """What its 40 misses leave is the share of boats that it passes over, less what two seconds make doubtful."""
    radar = sensor("radar", coverage=Coverage(range=(0.0, 2000.0)), p_detection=P_RADAR, clutter_per_scan=2.0)
    lidar = sensor("lidar", coverage=Coverage(range=(0.0, 2000.0)), p_detection=0.5)
    config = TrackerConfig(
        q=0.1, static_share=0.0, stop_floor=0.0, sensors={"lidar": SensorErrors(sees_targets=share)}, **FOR_EVER
    )
    used = Tracker(config, (radar, lidar), 2)
    state = doubted(after(used, [[300.0, 400.0]]))
    before = odds(state)
    for k in range(40):
        state, _ = used.step(state, points(10.0 + 0.05 * k, [], 1))
    assert (odds(state) > 0.2 * before) == (share < 1.0)


def test_what_a_sensor_has_reported_it_does_report() -> None:
    """A lidar's own track: its misses count in full at once, and as any other's after a while."""
    radar = sensor("radar", coverage=Coverage(range=(0.0, 2000.0)), clutter_per_scan=2.0)
    lidar = sensor("lidar", coverage=Coverage(range=(0.0, 2000.0)), p_detection=0.5)
    config = TrackerConfig(
        q=0.1, static_share=0.0, stop_floor=0.0, sensors={"lidar": SensorErrors(sees_targets=0.6)}, **FOR_EVER
    )
    used = Tracker(config, (radar, lidar), 2)
    state = used.init()
    state, _ = used.step(state, points(0.0, [[300.0, 400.0]], 1))
    assert state.window.tracks.witness[0, 0, 0] == 1.0
    for k in range(1, 6):
        state, _ = used.step(state, points(2.0 * k, [[300.0, 400.0]], 1, first=100 * k))
    for pause in (1.0, MEMORY):
        state = doubted(state)
        before, t = odds(state), state.window.tracks.time[0]
        state, _ = used.step(state, points(t + pause, [], 1))
        reports = 0.6 + 0.4 * np.exp(-pause / MEMORY)
        assert odds(state) == pytest.approx(before * (1.0 - 0.5 * reports), rel=0.02)
        for k in range(3):
            state, _ = used.step(state, points(t + pause + 0.2 * (k + 1), [[300.0, 400.0]], 1, first=int(1e4 * t) + k))


@pytest.mark.parametrize(
    ("errors", "second", "weight"),
    [
        ({"sees_static": 0.02}, [600.0, 800.0], (0.03, 0.0, 0.96, 0.01)),  # a buoy behind the boat
        ({"fade_range": 600.0}, [600.0, 800.0], (0.9, 0.0, 0.0, 0.1)),  # a boat too far to be seen
    ],
)
def test_a_bearing_is_not_contested_by_what_the_sensor_does_not_see(
    errors: dict[str, float], second: list[float], weight: tuple[float, ...]
) -> None:
    for seen_by, fate in ((errors, Fate.UPDATED), ({}, Fate.UNASSOCIATED)):
        used = tracker({"eye": SensorErrors(**seen_by)})
        state = doubted(after(used, [[300.0, 400.0], second]))
        tr = state.window.tracks
        tr.weight[1], tr.life[1, 2] = weight, 0.0
        before = odds(state)
        state, _ = used.step(state, glance(10.0, [TOWARDS]))
        assert (odds(state) > 2.0 * before) == (fate == Fate.UPDATED)
        _, out = used.finish(state)
        found = {int(r): FATES[f] for d in out.decisions for r, f in zip(d.row, d.fate, strict=True)}
        assert found[9000] == fate
