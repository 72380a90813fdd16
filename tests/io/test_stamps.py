"""Stamps that are wrong: what is refused, what is said, and what stays as it was."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from boresight.io.stamps import Stamps, examine
from boresight.types import Sensor, SensorKind

UNIX = 1764547200.0
RADAR, LIDAR = Sensor("radar", SensorKind.RADAR, period=2.0), Sensor("lidar", SensorKind.LIDAR, period=1.0)


@dataclasses.dataclass
class Log:
    """Rows of a radar every 2 s and a lidar every second, in order of time."""

    t: np.ndarray
    sensor: np.ndarray
    scan: np.ndarray
    recv: np.ndarray

    def examine(self, others: tuple[tuple[str, float, float], ...] = ()) -> Stamps:
        return examine(self.t, self.recv, self.sensor, self.scan, (RADAR, LIDAR), others)

    def rows(self, sensor: int) -> np.ndarray:
        return np.flatnonzero(self.sensor == sensor)


def log(duration: float = 240.0, start: float = UNIX) -> Log:
    radar, lidar = np.arange(0.0, duration, 2.0), np.arange(0.0, duration, 1.0) + 0.01
    t = np.r_[radar, lidar]
    order = np.argsort(t)
    sensor = np.r_[np.zeros(len(radar), np.int64), np.ones(len(lidar), np.int64)][order]
    scan = np.r_[np.arange(len(radar)), np.arange(len(lidar))][order]
    return Log(start + t[order], sensor, scan, np.full(len(t), np.nan))


def test_good_stamps_say_nothing() -> None:
    good = log()
    told = good.examine()
    assert not told.findings
    assert not told.refused
    np.testing.assert_array_equal(told.arrival, np.maximum.accumulate(good.t))


@pytest.mark.parametrize("row", [0, 1, 57, 100, -2, -1])
@pytest.mark.parametrize("wild", [2147483647.0, 0.0, "hour", -1e12, 1e300, "month ago", 4e18])
def test_one_wild_stamp_is_refused_wherever_it_stands(row: int, wild: float | str) -> None:
    bad = log()
    clean = bad.examine().arrival
    row %= len(bad.t)
    bad.t[row] = bad.t[row] + {"hour": 3600.0, "month ago": -2.6e6}[wild] if isinstance(wild, str) else wild
    told = bad.examine()
    assert list(told.refused) == [row]
    assert [(f.cause, f.rows) for f in told.findings] == [("wild", 1)]
    assert f"row {row} is refused" in told.findings[0].text
    others = np.arange(len(bad.t)) != row
    np.testing.assert_allclose(told.arrival[others], clean[others], atol=1.1)  # what arrives then keeps its time


def test_a_whole_wild_scan_and_several_wild_rows_are_refused() -> None:
    t = np.repeat(UNIX + np.arange(100.0), 20) + np.tile(np.arange(20) * 0.01, 100)
    scan = np.repeat(np.arange(100), 20)
    t[scan == 40] += 86400.0
    t[777] = 5.0
    told = examine(t, np.full(len(t), np.nan), np.zeros(len(t), np.int64), scan, (LIDAR,))
    assert sorted(told.refused) == sorted([*range(800, 820), 777])


def test_what_real_links_do_is_not_wild() -> None:
    """Reports up to 8 s late, a silence of two hours, two sessions days apart, a sensor of three reports."""
    rng = np.random.default_rng(4)
    late = log()
    order = np.argsort(late.t + rng.exponential(2.0, len(late.t)).clip(0.0, 8.0), kind="stable")
    shuffled = Log(*(a[order] for a in (late.t, late.sensor, late.scan, late.recv)))
    assert not shuffled.examine().refused
    assert not shuffled.examine().findings
    for gap in (7200.0, 5.0 * 86400.0):
        one, two = log(), log(start=UNIX + 240.0 + gap)
        both = Log(*(np.r_[a, b] for a, b in zip(dataclasses.astuple(one), dataclasses.astuple(two), strict=True)))
        both.scan[len(one.t) :] += 1000
        assert not both.examine().findings
    few = log()
    few.sensor[:] = 1
    few.sensor[[10, 200, 300]] = 0
    assert not few.examine().findings


@pytest.mark.parametrize(("factor", "word"), [(1e3, "milliseconds"), (1e6, "microseconds"), (1e9, "nanoseconds")])
@pytest.mark.parametrize("start", [UNIX, 0.0])
def test_units_are_named_by_their_size_and_by_the_declared_period(factor: float, word: str, start: float) -> None:
    bad = log(start=start)
    bad.t *= factor
    told = bad.examine()
    assert [(f.sensor, f.cause) for f in told.findings] == [("radar", "unit"), ("lidar", "unit")]
    assert all(word in f.text and "--time-unit" in f.text for f in told.findings)


def test_one_sensor_in_milliseconds() -> None:
    bad = log()
    bad.t[bad.rows(1)] *= 1e3
    told = bad.examine()
    assert [(f.sensor, f.cause) for f in told.findings] == [("lidar", "unit")]


@pytest.mark.parametrize(
    ("offset", "why"), [(UNIX, "switched on"), (315964782.0, "GPS epoch"), (2208988800.0 * -1.0, "1900")]
)
def test_another_epoch_is_named_with_its_offset(offset: float, why: str) -> None:
    bad = log()
    lidar = bad.rows(1)
    bad.t[lidar] -= offset
    told = bad.examine((("target 'a' of the truth", UNIX, UNIX + 240.0),))
    assert sorted(told.refused) == lidar.tolist()
    (found,) = told.findings
    assert (found.sensor, found.cause, found.rows) == ("lidar", "epoch", 240)
    assert found.offset == pytest.approx(offset, abs=1.0)
    assert why in found.text
    assert "--time-offset lidar=" in found.text


def test_mixed_epochs_within_one_sensor() -> None:
    bad = log()
    early = bad.rows(1)[:30]  # until the clock was set by GPS
    bad.t[early] -= UNIX
    told = bad.examine()
    assert sorted(told.refused) == early.tolist()
    assert told.findings[0].offset == pytest.approx(UNIX, abs=2.0)
    assert "30 of its 240 stamps" in told.findings[0].text


def test_detections_in_another_epoch_than_the_navigation() -> None:
    told = log(start=0.0).examine((("platform 'ship'", UNIX, UNIX + 240.0),))
    assert "another epoch than platform 'ship'" in told.findings[0].text
    assert told.findings[0].offset == pytest.approx(UNIX)


@pytest.mark.parametrize(
    ("offset", "sensor", "word"),
    [
        (18.0, 1, "GPS time"),
        (18.0, 0, "GPS time"),
        (-3600.0, 1, "time zone"),
        (37.0, 0, "TAI"),
        (26.0, 1, "not synchron"),
    ],
)
def test_a_constant_offset_is_named(offset: float, sensor: int, word: str) -> None:
    bad = log()
    bad.t[bad.rows(sensor)] += offset
    told = bad.examine()
    (found,) = told.findings
    assert found.cause == "offset"
    assert word in found.text
    right = offset if found.sensor == (RADAR, LIDAR)[sensor].id else -offset
    assert found.offset == pytest.approx(-right, abs=1.0)
    assert not told.refused


def test_an_offset_in_a_file_sorted_by_stamp_shows_at_both_ends() -> None:
    bad = log()
    bad.t[bad.rows(1)] += 18.0
    order = np.argsort(bad.t, kind="stable")
    told = Log(*(a[order] for a in (bad.t, bad.sensor, bad.scan, bad.recv))).examine()
    assert [f.cause for f in told.findings] == ["offset"]
    assert "--time-offset" in told.findings[0].text


@pytest.mark.parametrize(("step", "cause"), [(86400.0, "midnight"), (40.0, "set_back"), (604800.0, "week")])
def test_a_clock_set_back_is_named_at_its_row(step: float, cause: str) -> None:
    t = 80000.0 + np.arange(0.0, 400.0, 2.0)
    t[150:] -= step
    n = np.arange(len(t))
    told = examine(t, np.full(len(t), np.nan), np.zeros(len(t), np.int64), n, (RADAR,))
    (found,) = told.findings
    assert found.cause == cause
    assert found.offset == pytest.approx(step, abs=4.0)
    assert "row 150" in found.text
    assert found.rows in range(10, 51)


def test_logs_laid_end_to_end_are_merged_by_stamp() -> None:
    good = log()
    order = np.r_[good.rows(0), good.rows(1)]
    laid = Log(*(a[order] for a in (good.t, good.sensor, good.scan, good.recv)))
    told = laid.examine()
    assert [(f.sensor, f.cause) for f in told.findings] == [("lidar", "end_to_end")]
    np.testing.assert_array_equal(told.arrival, laid.t)
    pieces = np.concatenate([p for k in range(4) for p in (good.rows(0)[30 * k :][:30], good.rows(1)[60 * k :][:60])])
    hours = Log(*(a[pieces] for a in (good.t, good.sensor, good.scan, good.recv)))
    np.testing.assert_array_equal(hours.examine().arrival, hours.t)


def test_arrival_times_order_the_reports_whatever_the_file() -> None:
    good = log()
    good.recv = good.t + 0.3
    order = np.r_[good.rows(0), good.rows(1)]
    laid = Log(*(a[order] for a in (good.t, good.sensor, good.scan, good.recv)))
    told = laid.examine()
    np.testing.assert_array_equal(told.arrival, laid.recv)
    assert not told.findings


@pytest.mark.parametrize("wild", [1e18, 0.0, -5.0, UNIX * 1e3, UNIX + 4e4])
def test_one_wild_arrival_counts_as_that_of_its_neighbours(wild: float) -> None:
    bad = log()
    bad.recv = bad.t + 0.3
    clean = bad.recv.copy()
    bad.recv[77] = wild
    told = bad.examine()
    assert [(f.column, f.cause, f.rows) for f in told.findings] == [("t_recv_s", "wild", 1)]
    np.testing.assert_allclose(told.arrival, clean, atol=1.0)
    assert not told.refused


@pytest.mark.parametrize("change", [lambda r: r - UNIX, lambda r: r * 1e3, lambda r: r * 1e9, lambda r: r + 7200.0])
def test_arrivals_on_another_clock_are_not_used(change) -> None:
    bad = log()
    bad.recv = change(bad.t + 0.3)
    told = bad.examine()
    assert {(f.column, f.cause) for f in told.findings} == {("t_recv_s", "arrival")}
    np.testing.assert_array_equal(told.arrival, np.maximum.accumulate(bad.t))


def test_reports_that_arrive_before_they_are_valid() -> None:
    bad = log()
    bad.recv = bad.t + 0.2 - 18.0
    told = bad.examine()
    assert {f.cause for f in told.findings} == {"arrival_before"}
    assert all("GPS time against UTC" in f.text for f in told.findings)
