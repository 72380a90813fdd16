"""Passes of satellites of every kind over many sites, against skyfield's positions; windows that cut passes."""

from __future__ import annotations

import math
from datetime import UTC, datetime

import numpy as np
import pytest

from boresight.pointing.elements import Satellite, read_tle
from boresight.pointing.satellite import Found, find_passes, look, passes
from boresight.types import Site

sgp4 = pytest.importorskip("sgp4.api")
exporter = pytest.importorskip("sgp4.exporter")
DEG = math.pi / 180.0
DAY = 86400.0
EPOCH = datetime(2024, 3, 5, 4, 30, tzinfo=UTC).timestamp()
SITES = (
    (47.45, 8.56, 430.0), (0.0, -78.5, 2850.0), (-33.9, 18.4, 10.0), (69.65, 18.95, 100.0), (-77.85, 166.7, 10.0),
    (35.7, 139.7, 40.0), (-22.9, -43.2, 0.0), (89.9, 0.0, 0.0), (19.8, -155.5, 4200.0), (51.5, 179.9, 0.0),
)  # fmt: skip


def lines_of(
    number: int, turns: float, e: float, i: float, node: float, pericenter: float, anomaly: float, bstar: float = 1e-5
) -> tuple[str, str]:
    """Two lines of an orbit: revolutions a day, degrees, 1/Earth radii."""
    record = sgp4.Satrec()
    days = EPOCH / DAY + 7306.0  # days from 1949-12-31 to 1970
    record.sgp4init(
        sgp4.WGS72, "i", number, days, bstar, 0.0, 0.0, e, pericenter * DEG, i * DEG, anomaly * DEG,
        turns * 2.0 * math.pi / 1440.0, node * DEG,
    )  # fmt: skip
    one, two = exporter.export_tle(record)
    return one, two


def orbits(n: int, seed: int) -> list[tuple[str, str]]:
    """Orbits of ten kinds in turn: low, sun-synchronous, polar, decaying, medium, geostationary and near it, Molniya,
    transfer, a long ellipse of low perigee, retrograde."""
    rng = np.random.default_rng(seed)
    out = []
    for k in range(n):
        turn = rng.uniform(0.0, 360.0, 3)
        kinds = (
            (rng.uniform(14.5, 15.6), rng.uniform(0.0, 0.003), rng.uniform(20.0, 60.0), 3e-5),
            (rng.uniform(14.1, 14.9), rng.uniform(0.0, 0.002), rng.uniform(97.5, 99.0), 3e-5),
            (rng.uniform(12.0, 14.0), rng.uniform(0.0, 0.02), rng.uniform(80.0, 92.0), 1e-5),
            (rng.uniform(16.25, 16.42), rng.uniform(0.0, 0.001), rng.uniform(40.0, 98.0), 2e-3),
            (rng.uniform(1.9, 6.0), rng.uniform(0.0, 0.02), rng.uniform(45.0, 65.0), 0.0),
            (1.0027, rng.uniform(0.0, 4e-4), rng.uniform(0.01, 0.1), 0.0),
            (rng.uniform(0.98, 1.02), rng.uniform(0.0, 0.05), rng.uniform(2.0, 16.0), 0.0),
            (2.0057, rng.uniform(0.68, 0.74), rng.uniform(62.0, 64.5), 0.0),
            (rng.uniform(2.2, 2.3), rng.uniform(0.715, 0.73), rng.uniform(0.5, 28.0), 1e-4),
            (rng.uniform(4.0, 10.0), rng.uniform(0.3, 0.45), rng.uniform(90.0, 145.0), 1e-5),
        )
        turns, e, i, bstar = kinds[k % len(kinds)]
        pericenter = 270.0 if k % len(kinds) == 7 else turn[1]
        out.append(lines_of(k + 1, turns, e, i, turn[0], pericenter, turn[2], bstar))
    return out


def crossings(lines: tuple[str, str], place: tuple[float, float, float], begin: float, end: float, lowest: float):
    """Skyfield's elevation on a dense grid, its crossings by bisection, and its elevation at both edges; degrees."""
    api = pytest.importorskip("skyfield.api")
    ts = api.load.timescale(builtin=True)
    theirs = api.EarthSatellite(*lines, ts=ts) - api.wgs84.latlon(*place)

    def altitude(t: np.ndarray) -> np.ndarray:
        days = np.asarray(t) / DAY
        whole = np.floor(days)
        # Unix time counts no leap seconds; skyfield's UTC does
        return theirs.at(ts.utc(1970, 1, 1 + whole, 0, 0, (days - whole) * DAY)).altaz()[0].degrees

    t = np.linspace(begin, end, math.ceil((end - begin) / 5.0) + 1)
    up = altitude(t) >= lowest
    k = np.flatnonzero(up[1:] != up[:-1])
    a, b = t[k], t[k + 1]
    for _ in range(12 if len(k) else 0):  # 5 s to 1.2 ms
        middle = 0.5 * (a + b)
        same = (altitude(middle) >= lowest) == up[k]
        a, b = np.where(same, middle, a), np.where(same, b, middle)
    dut1 = float(ts.utc(1970, 1, 1, 0, 0, begin).dut1)
    return 0.5 * (a + b), up, dut1


def agree(lines: tuple[str, str], place: tuple[float, float, float], begin: float, end: float, lowest: float) -> int:
    (one,) = read_tle("\n".join(lines), "made")
    site = Site(place[0] * DEG, place[1] * DEG, place[2])
    times, up, dut1 = crossings(lines, place, begin, end, lowest)
    found = find_passes(one, site, begin, end, lowest * DEG, dut1)
    if found.fails is not None:  # it decays: up to there
        assert found.fails[1] == end
        return agree(lines, place, begin, found.fails[0] - 1.0, lowest)
    ours = [t for p in found.passes for t, edge in ((p.rise, p.rises), (p.set, p.sets)) if edge]
    assert len(ours) == len(times), (lines, place)
    np.testing.assert_allclose(ours, times, rtol=0.0, atol=1.0)
    assert [p.rises for p in found.passes] == [not (k == 0 and up[0]) for k in range(len(found.passes))]
    last = len(found.passes) - 1
    assert [p.sets for p in found.passes] == [not (k == last and up[-1]) for k in range(last + 1)]
    return len(found.passes)


def windows(lines: tuple[str, str], place: tuple[float, float, float], hours: float) -> list[tuple[float, float]]:
    """A window of so many hours, and one from the middle of its first pass to the middle of its last."""
    (one,) = read_tle("\n".join(lines), "made")
    whole = (EPOCH + 600.0, EPOCH + 600.0 + 3600.0 * hours)
    found = passes(one, Site(place[0] * DEG, place[1] * DEG, place[2]), *whole)
    if len(found) < 2:
        return [whole]
    return [whole, (0.5 * (found[0].rise + found[0].set), 0.5 * (found[-1].rise + found[-1].set))]


def test_ten_kinds_of_orbits_against_skyfield() -> None:
    """Every rise and set within 1 s, none more and none less, of each kind over two sites."""
    n = 0
    for k, lines in enumerate(orbits(10, 1)):
        for place in (SITES[k % len(SITES)], SITES[(k + 3) % len(SITES)]):
            n += sum(agree(lines, place, a, b, 0.0) for a, b in windows(lines, place, 18.0))
    assert n > 60


@pytest.mark.slow
def test_fifty_satellites_over_ten_sites_against_skyfield() -> None:
    n = 0
    for k, lines in enumerate(orbits(50, 2)):
        for place in SITES:
            n += sum(agree(lines, place, a, b, (0.0, 5.0, 10.0)[k % 3]) for a, b in windows(lines, place, 24.0))
    assert n > 3000


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
