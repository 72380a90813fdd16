"""Satellites of mean elements: where they are over the Earth, and when they pass a site (SGP4)."""

from __future__ import annotations

import importlib
import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from boresight.errors import UserError
from boresight.frames.azel import azel_from_enu
from boresight.frames.local import enu_from_ecef
from boresight.pointing.elements import (
    DAY,
    UNIX_EPOCH,
    Satellite,
    read_elements,
    read_omm,
    read_tle,
)  # fmt: skip
from boresight.pointing.mount import Mask, horizon_at
from boresight.types import Site
from boresight.types.sensor import FloatArray

__all__ = [
    "Found", "Pass", "Satellite", "ecef_at", "find_passes", "look", "passes", "read_elements", "read_omm", "read_tle",
    "sidereal_time", "unix_of",
]  # fmt: skip

SAMPLES = 240  # of a turn about the Earth as fast as at perigee; between two of them elevation has one extremum at most
FASTEST, SLOWEST = 2.0, 120.0  # s between samples
TURN_OF_MASK = math.radians(0.5)  # of azimuth between samples where a horizon mask is near
GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)
FINE = 28  # steps of golden section: 120 s to 0.2 ms
HALVES = 28  # bisections: 240 s to a microsecond


class Pass(NamedTuple):
    """One time above the horizon of a site, as far as it lies within the window: Unix seconds (UTC) and rad.

    `rises`, `sets`: it begins, ends at the horizon; else it was, or is, still above at the edge of the window.
    """

    rise: float
    culmination: float
    set: float
    rise_azimuth: float
    max_elevation: float
    set_azimuth: float
    rises: bool = True
    sets: bool = True
    rise_elevation: float = math.nan
    set_elevation: float = math.nan


class Found(NamedTuple):
    """What a search for passes found."""

    passes: tuple[Pass, ...]
    highest: float  # rad, the highest elevation in the window, whether above the horizon or not
    fails: tuple[float, float] | None  # Unix s, from when till when SGP4 cannot propagate the elements
    reason: str  # SGP4's own, why


def ecef_at(satellite: Satellite, t: ArrayLike, dut1: float = 0.0) -> FloatArray:
    """Return ECEF positions (n, 3) (m) at Unix times `t` (n,) (UTC s); `dut1` is UT1 − UTC (s).

    SGP4 gives TEME, which sidereal time (GMST 1982) turns to the Earth; polar motion (below 15 m) is left out.
    Raises UserError where SGP4 gives up: the message is its own.
    """
    times = np.atleast_1d(np.asarray(t, dtype=np.float64))
    x, error = _propagated(satellite, times, dut1)
    if error.any():
        row = int(np.flatnonzero(error)[0])
        raise UserError(f"satellite {satellite.name} at t = {times[row]:.0f} s: {_reason(int(error[row]))}")
    return x


def _propagated(satellite: Satellite, times: FloatArray, dut1: float) -> tuple[FloatArray, NDArray[np.int64]]:
    """Return ECEF positions (n, 3) (m), NaN where SGP4 gives up, and its errors (n,), 0 for none."""
    day = np.floor(times / DAY)
    jd, fraction = UNIX_EPOCH + day, times / DAY - day
    error, r, _ = satellite.record.sgp4_array(jd, fraction)
    angle = sidereal_time(jd, fraction + dut1 / DAY)
    c, s = np.cos(angle), np.sin(angle)
    x, y = 1e3 * r[:, 0], 1e3 * r[:, 1]
    out = np.stack([c * x + s * y, c * y - s * x, 1e3 * r[:, 2]], axis=-1)
    out[error != 0] = np.nan
    return out, np.asarray(error, dtype=np.int64)


def _reason(error: int) -> str:
    return str(importlib.import_module("sgp4.api").SGP4_ERRORS.get(error, f"SGP4's error {error}"))


def sidereal_time(jd: FloatArray, fraction: FloatArray) -> FloatArray:
    """Return Greenwich mean sidereal time of 1982 (rad) at UT1 Julian dates, given in two parts."""
    T = (jd - 2451545.0 + fraction) / 36525.0
    seconds = 67310.54841 + (8640184.812866 + (0.093104 - 6.2e-6 * T) * T) * T
    turns = np.mod(jd, 1.0) + fraction + np.mod(seconds / DAY, 1.0)
    out: FloatArray = 2.0 * np.pi * np.mod(turns, 1.0)
    return out


def look(
    satellite: Satellite, t: ArrayLike, site: Site, dut1: float = 0.0
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return azimuth, elevation (rad) and range (m), (n,), of a satellite from a site, without refraction."""
    x = ecef_at(satellite, t, dut1)
    azimuth, elevation, r = azel_from_enu(*enu_from_ecef(x[:, 0], x[:, 1], x[:, 2], site))
    return azimuth, elevation, r


def passes(
    satellite: Satellite, site: Site, begin: float, end: float, lowest: float = 0.0, dut1: float = 0.0, mask: Mask = ()
) -> list[Pass]:
    """Return the passes above `lowest` (rad) and the horizon `mask` from `begin` to `end` (Unix s); see `find_passes`.

    Raises UserError if SGP4 cannot propagate the elements at any time of the window.
    """
    found = find_passes(satellite, site, begin, end, lowest, dut1, mask)
    if found.fails is not None and not found.fails[0] > begin and not found.fails[1] < end:
        raise UserError(f"satellite {satellite.name} at t = {begin:.0f} s: {found.reason}")
    return list(found.passes)


def find_passes(
    satellite: Satellite, site: Site, begin: float, end: float, lowest: float = 0.0, dut1: float = 0.0, mask: Mask = ()
) -> Found:
    """Return every time above `lowest` (rad) and the horizon `mask` from `begin` to `end` (Unix s), to 1 ms.

    One pass for each unbroken time, however often elevation rises and falls in it; what is above at either edge of the
    window is a pass in progress there. Elevation is sampled as densely as perigee asks, the extremum between samples
    that could hide a rise or a set is found, and then every crossing lies alone between two points.
    """

    def above(t: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Height above the horizon, elevation and azimuth (rad), NaN where SGP4 gives up."""
        x, _ = _propagated(satellite, t, dut1)
        azimuth, elevation, _ = azel_from_enu(*enu_from_ecef(x[:, 0], x[:, 1], x[:, 2], site))
        level = np.maximum(lowest, horizon_at(mask, azimuth)) if mask else lowest
        return elevation - level, elevation, azimuth

    first, last, fails, reason = _usable(satellite, begin, end, dut1)
    if not first < last:
        return Found((), math.nan, fails, reason)
    n = math.ceil((last - first) / _step(satellite)) + 1
    t = np.linspace(first, last, max(n, 5))
    if mask:
        t = _denser(t, *above(t)[1:], mask)
    h, elevation, _ = above(t)
    t = np.union1d(t, _extrema(lambda s: above(s)[0], t, h))
    t = np.union1d(t, _extrema(lambda s: above(s)[1], t, above(t)[1], tops=True))
    h, elevation, _ = above(t)
    up = h >= 0.0
    change = np.flatnonzero(up[1:] != up[:-1])
    edges = _crossings(lambda s: above(s)[0], t[change], t[change + 1], up[change + 1])
    starts = edges[up[change + 1]]
    ends = edges[~up[change + 1]]
    if up[0]:
        starts = np.concatenate([[first], starts])
    if up[-1]:
        ends = np.concatenate([ends, [last]])
    out = []
    for a, b in zip(starts.tolist(), ends.tolist(), strict=True):
        inside = np.flatnonzero((t >= a) & (t <= b))
        best = int(inside[np.argmax(elevation[inside])]) if len(inside) else -1
        _, e, azimuth = above(np.array([a, b]))
        top = max((float(elevation[best]), float(t[best])) if best >= 0 else (-math.inf, a), (e[0], a), (e[1], b))
        edge = (float(azimuth[0]), float(top[0]), float(azimuth[1]))
        out.append(Pass(a, float(top[1]), b, *edge, a > first, b < last, float(e[0]), float(e[1])))
    return Found(tuple(out), float(elevation.max()), fails, reason)


def _step(satellite: Satellite) -> float:
    """Return the time (s) between samples: a fraction of a turn as fast as the satellite is at perigee."""
    e = min(float(satellite.record.ecco), 0.99)
    rate = float(satellite.record.no_kozai) / 60.0 * (1.0 + e) ** 2 / math.pow(1.0 - e * e, 1.5)  # rad/s
    return min(max(2.0 * math.pi / rate / SAMPLES, FASTEST), SLOWEST)


def _usable(
    satellite: Satellite, begin: float, end: float, dut1: float
) -> tuple[float, float, tuple[float, float] | None, str]:
    """Return the part of a window in which SGP4 propagates the elements, the part in which it does not, and why.

    The part that lies nearest to the elements' epoch, if there are several.
    """
    t = np.linspace(begin, end, max(math.ceil((end - begin) / 60.0) + 1, 5))
    error = _propagated(satellite, t, dut1)[1]
    good = error == 0
    if good.all():
        return begin, end, None, ""
    if not good.any():
        return begin, begin, (begin, end), _reason(int(error[0]))
    where = np.flatnonzero(good)
    i = j = int(where[np.argmin(np.abs(t[where] - satellite.epoch))])
    while i > 0 and good[i - 1]:
        i -= 1
    while j < len(t) - 1 and good[j + 1]:
        j += 1
    first, last, fails, reason = begin, end, (begin, end), ""
    if i > 0:
        first = _last_good(satellite, float(t[i]), float(t[i - 1]), dut1)
        fails, reason = (begin, first), _reason(int(error[i - 1]))
    if j < len(t) - 1:
        last = _last_good(satellite, float(t[j]), float(t[j + 1]), dut1)
        fails, reason = (last, end), _reason(int(error[j + 1]))
    return first, last, fails, reason


def _last_good(satellite: Satellite, good: float, bad: float, dut1: float) -> float:
    while abs(bad - good) > 0.1:
        middle = 0.5 * (good + bad)
        if _propagated(satellite, np.array([middle]), dut1)[1][0]:
            bad = middle
        else:
            good = middle
    return good


def _denser(t: FloatArray, elevation: FloatArray, azimuth: FloatArray, mask: Mask) -> FloatArray:
    """Return the samples with more between those across which the horizon may rise and fall with azimuth."""
    corners = np.unique([a % (2.0 * math.pi) for a, _ in mask])
    gaps = np.diff(corners, append=corners[:1] + 2.0 * math.pi)
    apart = min(TURN_OF_MASK, max(0.25 * float(gaps.min()), math.radians(0.02)))
    turn = np.abs(np.diff(np.unwrap(azimuth)))
    low = np.minimum(elevation[1:], elevation[:-1])
    rough = low < max(e for _, e in mask) + math.radians(2.0)
    parts = np.where(rough, np.clip(np.ceil(turn / apart), 1, 400), 1).astype(int)
    step = np.repeat(np.diff(t) / parts, parts)
    inner = np.concatenate([np.arange(n) for n in parts])
    return np.append(np.repeat(t[:-1], parts) + inner * step, t[-1])


def _extrema(of: Callable[[FloatArray], FloatArray], t: FloatArray, h: FloatArray, tops: bool = False) -> FloatArray:
    """Return the times of extrema between samples that could hide a crossing of zero, or with `tops` of all maxima."""
    high = np.flatnonzero((h[1:-1] >= h[:-2]) & (h[1:-1] >= h[2:]) & (tops | (h[1:-1] < 0.0))) + 1
    low = np.flatnonzero((h[1:-1] <= h[:-2]) & (h[1:-1] <= h[2:]) & (h[1:-1] > 0.0)) + 1
    which = high if tops else np.concatenate([high, low])
    if not len(which):
        return np.empty(0)
    sign = np.ones(len(which))
    if not tops:
        sign[len(high) :] = -1.0
    a, b = t[which - 1].copy(), t[which + 1].copy()
    p, q = b - GOLDEN * (b - a), a + GOLDEN * (b - a)
    fp, fq = sign * of(p), sign * of(q)
    for _ in range(FINE):
        left = fp > fq  # the maximum lies in [a, q]
        a, b = np.where(left, a, p), np.where(left, q, b)
        p, q, fp, fq = (
            np.where(left, b - GOLDEN * (b - a), q), np.where(left, p, a + GOLDEN * (b - a)), np.where(left, 0.0, fq),
            np.where(left, fp, 0.0),
        )  # fmt: skip
        new = sign * of(np.where(left, p, q))
        fp, fq = np.where(left, new, fp), np.where(left, fq, new)
    return np.asarray(0.5 * (a + b))


def _crossings(
    of: Callable[[FloatArray], FloatArray], a: FloatArray, b: FloatArray, rises: NDArray[np.bool_]
) -> FloatArray:
    """Return where a function crosses zero between `a` and `b` (n,), which do not share a sign."""
    for _ in range(HALVES if len(a) else 0):
        middle = 0.5 * (a + b)
        before = (of(middle) >= 0.0) != rises
        a, b = np.where(before, middle, a), np.where(before, b, middle)
    return 0.5 * (a + b)


def unix_of(jd: float, fraction: float) -> float:
    """Return Unix seconds of a Julian date in two parts (UTC)."""
    return math.fsum(((jd - UNIX_EPOCH) * DAY, fraction * DAY))
