"""Passes of satellites of every kind over many sites, against skyfield's positions; windows that cut passes."""

from __future__ import annotations

import math

import numpy as np
import pytest
from benchmarks.passes import EPOCH, SITES, agree, lines_of, orbits, windows

from boresight.pointing.elements import Satellite, read_tle
from boresight.pointing.satellite import Found, find_passes, look, passes
from boresight.types import Site

DEG = math.pi / 180.0
DAY = 86400.0


def test_ten_kinds_of_orbits_against_skyfield() -> None:
    """Every rise and set within 1 s, none more and none less, of each kind over two sites."""
    pytest.importorskip("skyfield.api")
    n = 0
    for k, lines in enumerate(orbits(10, 1)):
        for place in (SITES[k % len(SITES)], SITES[(k + 3) % len(SITES)]):
            for window in windows(lines, place, 12.0):
                some, worst = agree(lines, place, *window, 0.0)
                assert worst < 1.0
                n += some
    assert n > 50


def of(lines: tuple[str, str], place: tuple[float, float, float], hours: float, lowest: float = 0.0) -> Found:
    (one,) = read_tle("\n".join(lines), "made")
    return find_passes(one, Site(place[0] * DEG, place[1] * DEG, place[2]), EPOCH, EPOCH + 3600.0 * hours, lowest * DEG)


def stationary(east: float) -> tuple[str, str]:
    """A geostationary satellite over a longitude (deg): node + pericenter + anomaly − sidereal angle."""
    (one,) = read_tle("\n".join(lines_of(77, 1.00271, 1e-5, 0.01, 0.0, 0.0, 0.0)), "made")
    return lines_of(77, 1.00271, 1e-5, 0.01, 0.0, 0.0, (east - _longitude(one)) % 360.0)


def _longitude(one: Satellite) -> float:
    from boresight.pointing.satellite import ecef_at

    x = ecef_at(one, [EPOCH])[0]
    return math.degrees(math.atan2(x[1], x[0]))


def test_what_never_sets_and_what_never_rises() -> None:
    above = of(stationary(8.0), (47.0, 8.0, 0.0), 48.0)
    (only,) = above.passes
    assert (only.rise, only.set, only.rises, only.sets) == (EPOCH, EPOCH + 48 * 3600.0, False, False)
    assert only.max_elevation == pytest.approx(35.8 * DEG, abs=0.3 * DEG)  # textbook: 36° at 47° of latitude
    below = of(stationary(-172.0), (47.0, 8.0, 0.0), 48.0)
    assert below.passes == ()
    assert below.highest == pytest.approx(-48.7 * DEG, abs=0.3 * DEG)  # atan((cos 133° − 1/6.61) / sin 133°)


def test_one_pass_however_often_it_rises_and_falls() -> None:
    """Molniya, whose elevation has two maxima in one time above the horizon."""
    seen = 0
    for anomaly in range(0, 360, 20):
        lines = lines_of(9, 2.0057, 0.72, 63.4, 30.0, 270.0, float(anomaly))
        (one,) = read_tle("\n".join(lines), "made")
        for place in SITES[:6]:
            found = of(lines, place, 24.0)
            for p in found.passes:
                t = np.arange(p.rise, p.set, 20.0)
                e = look(one, t, Site(place[0] * DEG, place[1] * DEG, place[2]))[1]
                assert (e[1:] > 0.0).all()
                assert p.max_elevation >= e.max()
                seen += int(np.sum((e[1:-1] > e[:-2]) & (e[1:-1] > e[2:])) > 1)
    assert seen > 5  # passes of several maxima, one row each


def test_a_pass_of_seconds_is_found() -> None:
    """The horizon raised to just under the highest point: passes of down to a second, at any place among samples."""
    lines = lines_of(5, 15.2, 0.0005, 51.6, 10.0, 0.0, 20.0)
    high = of(lines, (47.0, 8.0, 0.0), 12.0).passes
    assert len(high) >= 2
    for p in high:
        for below in (1e-2, 1e-4, 1e-6):
            (one,) = read_tle("\n".join(lines), "made")
            level = p.max_elevation - below * DEG
            found = passes(one, Site(47.0 * DEG, 8.0 * DEG, 0.0), EPOCH, EPOCH + 12 * 3600.0, level)
            short = [q for q in found if abs(q.culmination - p.culmination) < 5.0]
            assert len(short) == 1
            assert short[0].rise < p.culmination < short[0].set


def test_a_window_inside_a_pass() -> None:
    lines = lines_of(5, 15.2, 0.0005, 51.6, 10.0, 0.0, 20.0)
    (one,) = read_tle("\n".join(lines), "made")
    site = Site(47.0 * DEG, 8.0 * DEG, 0.0)
    whole = max(of(lines, (47.0, 8.0, 0.0), 12.0).passes, key=lambda p: p.max_elevation)
    (inner,) = passes(one, site, whole.rise + 60.0, whole.set - 60.0)
    assert (inner.rises, inner.sets) == (False, False)
    (first,) = passes(one, site, whole.rise - 60.0, whole.culmination - 30.0)
    assert (first.rises, first.sets) == (True, False)
    assert first.rise == pytest.approx(whole.rise, abs=0.01)
    assert first.culmination == pytest.approx(whole.culmination - 30.0, abs=0.01)  # still rising there
    assert first.set_elevation == pytest.approx(first.max_elevation, abs=1e-6)
    (rest,) = passes(one, site, whole.culmination + 30.0, whole.set + 60.0)
    assert (rest.rises, rest.sets) == (False, True)
    assert rest.set == pytest.approx(whole.set, abs=0.01)


def test_a_wall_and_a_gap_in_it_decide() -> None:
    """A wall of 60° but for 8° of azimuth: seen in the gap only, against every tenth of a second of the day."""
    lines = lines_of(5, 15.2, 0.0005, 51.6, 10.0, 0.0, 20.0)
    (one,) = read_tle("\n".join(lines), "made")
    site = Site(47.0 * DEG, 8.0 * DEG, 0.0)
    mask = tuple((a * DEG, e * DEG) for a, e in ((0, 60), (99.9, 60), (100, 2), (108, 2), (108.1, 60)))
    found = passes(one, site, EPOCH, EPOCH + DAY, 0.0, 0.0, mask)
    t = np.arange(EPOCH, EPOCH + DAY, 0.1)
    azimuth, elevation, _ = look(one, t, site)
    corners = np.array(mask)
    up = elevation >= np.interp(azimuth % (2 * np.pi), corners[:, 0], corners[:, 1], period=2 * np.pi)
    edges = t[1:][up[1:] != up[:-1]]
    assert len(edges) >= 4
    ours = np.array([x for p in found for x in (p.rise, p.set)])
    np.testing.assert_allclose(ours, edges, atol=0.2)


def test_a_satellite_that_decays_says_when_and_why() -> None:
    lines = lines_of(6, 16.41, 0.0001, 52.0, 17.0, 140.0, 131.0, 2e-3)
    found = of(lines, (47.45, 8.56, 430.0), 48.0)
    assert found.fails is not None
    begin, end = found.fails
    assert EPOCH < begin < end == EPOCH + 48 * 3600.0
    assert found.reason  # SGP4's own: what gives up first may be the eccentricity
    assert found.passes
    assert max(p.set for p in found.passes) <= begin
    (one,) = read_tle("\n".join(lines), "made")
    assert one.record.sgp4(*_julian(begin - 1.0))[0] == 0
    assert one.record.sgp4(*_julian(begin + 1.0))[0] != 0


def _julian(t: float) -> tuple[float, float]:
    return 2440587.5 + math.floor(t / DAY), t / DAY - math.floor(t / DAY)
