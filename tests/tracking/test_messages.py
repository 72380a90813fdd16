"""Sensors that report one target a message, and the addresses that they give."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from boresight.engine.track import run
from boresight.kernels.tracker import ADDRESS, INTERVAL, NOTHING, VISIBLE
from boresight.tracking.config import TrackerConfig
from boresight.tracking.output import Rows
from boresight.tracking.tracker import Tracker
from boresight.types import Coverage, FloatArray, Reporting, Scan, Sensor, address_code
from tests.tracking.test_rules import points, sensor

SEA = Coverage(range=(0.0, 5000.0))
SETTINGS = TrackerConfig(q=0.1, static_share=0.0, stop_floor=0.0, rest_time=1e12, merge_distance=5.0)


def ais(**extra: object) -> Sensor:
    """A sensor whose targets each send their position once in ten seconds."""
    return replace(sensor("ais"), coverage=SEA, reporting=Reporting.SINGLE, period=10.0, clutter_per_scan=0.02, **extra)


def tracker(one: Sensor, config: TrackerConfig = SETTINGS) -> Tracker:
    return Tracker(config, (one,), 2)


def message(t: float, place: FloatArray | list[float], row: int, address: str | None = None) -> Scan:
    scan = points(t, [list(map(float, place))], first=row)
    return replace(scan, address=np.array([address_code(address)]))


def traffic(
    targets: list[tuple[list[float], list[float]]], until: float, seed: int = 0, wrong: float = 0.0, same: bool = False
) -> list[Scan]:
    """Messages of targets (place, velocity), each every ten seconds; a share with the address of another one."""
    rng = np.random.default_rng(seed)
    sent = []
    for i, (place, velocity) in enumerate(targets):
        for t in np.arange(rng.uniform(0.0, 10.0), until, 10.0):
            name = str(rng.integers(len(targets))) if rng.random() < wrong else str(0 if same else i)
            sent.append((float(t), np.array(place) + t * np.array(velocity) + rng.normal(0.0, 5.0, 2), name))
    return [message(t, place, row, name) for row, (t, place, name) in enumerate(sorted(sent, key=lambda m: m[0]))]


def held(
    rows: list[Rows], targets: list[tuple[list[float], list[float]]], after: float
) -> tuple[FloatArray, list[int]]:
    """How much of the time after `after` (s) each target has a track within 40 m, and how many ids it had."""
    t = np.concatenate([r.t for r in rows])
    place = np.concatenate([r.position for r in rows])
    number = np.concatenate([r.track_id for r in rows])
    share, ids = [], []
    times = np.unique(t[t > after])
    for start, velocity in targets:
        near = np.hypot(*(place - np.array(start) - np.outer(t, velocity)).T) < 40.0
        share.append(np.isin(times, t[near]).mean())
        ids.append(len(np.unique(number[near & (t > after)])))
    return np.array(share), ids


FLEET = [([400.0 * k - 1800.0, 300.0 * (k % 3)], [3.0, 2.0]) for k in range(10)]


@pytest.mark.parametrize("period", [10.0, None])
def test_targets_that_each_send_a_message_are_held(period: float | None) -> None:
    """Declared or learned, ten targets' messages are no misses of the nine others; taken as whole looks, they are."""
    scans = traffic(FLEET, 300.0)
    _, rows, _ = run(tracker(replace(ais(), period=period)), scans)
    share, ids = held(rows, FLEET, 60.0)
    assert (share > 0.97).all()
    assert ids == [1] * 10
    _, rows, _ = run(tracker(replace(ais(), reporting=Reporting.SCAN)), scans)
    assert held(rows, FLEET, 60.0)[0].mean() < 0.5


def test_a_silent_sensor_says_nothing_and_a_silent_target_is_given_up() -> None:
    used = tracker(ais(), replace(SETTINGS, survival_time=1e9, hide_time=1e9))
    state = used.init()
    for scan in traffic(FLEET[:3], 100.0):
        state, _ = used.step(state, scan)
    tr = state.window.tracks
    assert tr.live[0] == 3
    np.testing.assert_allclose(tr.spoken[:3, 0, INTERVAL], 10.0, rtol=0.2)
    tr.weight[:3] = 0.9, 0.0, 0.0, 0.1
    first = np.array(FLEET[0][0])
    state, _ = used.step(state, message(1000.0, first + 1000.0 * np.array(FLEET[0][1]), 900))
    w = state.window.tracks.weight
    spacing = float(tr.pace[0, 0])
    odds = 9.0 * (1.0 - 0.9 * spacing / tr.spoken[1, 0, INTERVAL])
    assert w[1, VISIBLE] / w[1, NOTHING] == pytest.approx(odds, rel=1e-3)  # as any message of another, after 900 s too
    for k in range(60):  # a minute of messages of the first alone, one a second
        t = 1001.0 + k
        state, _ = used.step(state, message(t, first + t * np.array(FLEET[0][1]), 901 + k))
    tr = state.window.tracks
    left = [i for i in range(int(tr.live[0])) if tr.weight[i, NOTHING] < 0.5]
    assert len(left) == 1


def test_addresses_keep_apart_what_goes_side_by_side() -> None:
    """Four times two targets 20 m apart, 5 m of noise, 7 m of drift between messages; 4 % of the addresses wrong."""
    pairs = [([1000.0 * k + 20.0 * j, 0.0], [0.0, 4.0]) for k in range(-2, 2) for j in range(2)]
    for share, wanted in ((None, 8), (0.04, 8)):
        scans = traffic(pairs, 600.0, seed=4, wrong=0.04)
        if share is None:
            scans = [replace(scan, address=None) for scan in scans]
        state, _, _ = run(tracker(ais(p_wrong_id=0.04)), scans)
        tr = state.window.tracks
        confused = 0
        for start, velocity in pairs:
            gap = np.hypot(*(tr.x[: tr.live[0], :2] - np.array(start) - tr.time[0] * np.array(velocity)).T)
            confused += int(gap.min() > 15.0)
        if share is None:
            assert confused > 0  # without addresses some have drifted together or changed places
        else:
            assert confused == 0
            assert len(np.unique(tr.spoken[: tr.live[0], 0, ADDRESS])) == wanted


def test_an_address_is_never_a_command() -> None:
    """A message from 1 km away with a track's address does not move it; two targets with one address are two tracks."""
    used = tracker(ais())
    state = used.init()
    scans = traffic(FLEET[:2], 100.0)
    for scan in scans:
        state, _ = used.step(state, scan)
    before = state.window.tracks.x[: state.window.tracks.live[0]].copy()
    state, _ = used.step(state, message(scans[-1].t_look, before[0, :2] + [1000.0, 0.0], 900, "0"))
    np.testing.assert_array_equal(state.window.tracks.x[: len(before)], before)
    _, rows, _ = run(tracker(ais()), traffic(FLEET[:6], 300.0, same=True))
    share, ids = held(rows, FLEET[:6], 90.0)
    assert (share > 0.95).all()
    assert ids == [1] * 6


def test_a_source_id_has_the_same_code_in_every_process() -> None:
    assert address_code(None) == -1
    assert address_code("257012345") == address_code("257012345") == 904747617468370
    assert 0 <= address_code("") < 2**52
