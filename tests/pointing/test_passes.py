"""Passes of satellites of every kind over many sites, against skyfield's positions; windows that cut passes."""

from __future__ import annotations

import math
from datetime import UTC, datetime

import numpy as np
import pytest

from boresight.pointing.elements import read_tle
from boresight.pointing.satellite import find_passes, passes
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
