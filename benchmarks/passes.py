"""Passes of satellites of ten kinds over ten sites against skyfield's positions: `python -m benchmarks.passes`.

Every rise and set in windows of a day, and in windows that begin and end inside passes: none more, none less, and how
far apart the worst pair is (s).
"""

from __future__ import annotations

import math
import time
from datetime import UTC, datetime

import numpy as np
from sgp4 import api as sgp4
from sgp4 import exporter

from boresight.pointing.elements import read_tle
from boresight.pointing.satellite import find_passes, passes
from boresight.types import Site

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
            (rng.uniform(4.0, 10.0), -rng.uniform(0.4, 0.9), rng.uniform(90.0, 145.0), 1e-5),
        )
        turns, e, i, bstar = kinds[k % len(kinds)]
        if e < 0.0:  # a share of what keeps perigee at 300 km
            e = -e * (1.0 - 6678.0 / (398600.4 / (turns * 2.0 * math.pi / DAY) ** 2) ** (1.0 / 3.0))
        pericenter = 270.0 if k % len(kinds) == 7 else turn[1]
        out.append(lines_of(k + 1, turns, e, i, turn[0], pericenter, turn[2], bstar))
    return out


def crossings(
    lines: tuple[str, str], place: tuple[float, float, float], begin: float, end: float, lowest: float
) -> tuple[np.ndarray, np.ndarray, float]:
    """Skyfield's elevation on a dense grid, its crossings by bisection, and its elevation at both edges; degrees."""
    from skyfield import api

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


def agree(
    lines: tuple[str, str], place: tuple[float, float, float], begin: float, end: float, lowest: float
) -> tuple[int, float]:
    """How many passes both find, and the worst difference of a rise or set (s); raises ValueError where they differ."""
    (one,) = read_tle("\n".join(lines), "made")
    site = Site(place[0] * DEG, place[1] * DEG, place[2])
    dut1 = crossings(lines, place, begin, begin + 10.0, lowest)[2]
    found = find_passes(one, site, begin, end, lowest * DEG, dut1)
    if found.fails is not None:  # it decays: up to there
        if found.fails[1] != end:
            raise ValueError(f"{lines}: fails in the middle")
        return agree(lines, place, begin, found.fails[0] - 1.0, lowest)
    times, up, _ = crossings(lines, place, begin, end, lowest)
    ours = [t for p in found.passes for t, edge in ((p.rise, p.rises), (p.set, p.sets)) if edge]
    last = len(found.passes) - 1
    edges = [(not (k == 0 and up[0]), not (k == last and up[-1])) for k in range(last + 1)]
    if len(ours) != len(times) or [(p.rises, p.sets) for p in found.passes] != edges:
        raise ValueError(f"{lines} over {place}: {len(ours)} rises and sets, skyfield {len(times)}")
    return len(found.passes), float(np.abs(np.array(ours) - times).max(initial=0.0))


def windows(lines: tuple[str, str], place: tuple[float, float, float], hours: float) -> list[tuple[float, float]]:
    """A window of so many hours, and one from the middle of its first pass to the middle of its last."""
    (one,) = read_tle("\n".join(lines), "made")
    whole = (EPOCH + 600.0, EPOCH + 600.0 + 3600.0 * hours)
    found = passes(one, Site(place[0] * DEG, place[1] * DEG, place[2]), *whole)
    if len(found) < 2:
        return [whole]
    return [whole, (0.5 * (found[0].rise + found[0].set), 0.5 * (found[-1].rise + found[-1].set))]


def main() -> None:
    """Print what 50 satellites over 10 sites have in common with skyfield."""
    begun, n, worst = time.perf_counter(), 0, 0.0
    for k, lines in enumerate(orbits(50, 2)):
        for place in SITES:
            for window in windows(lines, place, 24.0):
                some, off = agree(lines, place, *window, (0.0, 5.0, 10.0)[k % 3])
                n, worst = n + some, max(worst, off)
        print(f"{k + 1:3d} satellites  {n:6d} passes  worst rise or set {worst:.3f} s", flush=True)
    print(f"{time.perf_counter() - begun:.0f} s")


if __name__ == "__main__":
    main()
