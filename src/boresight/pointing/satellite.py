"""Satellites of two-line elements: where they are over the Earth, and when they pass a site (SGP4)."""

from __future__ import annotations

import importlib
import io
import json
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq, minimize_scalar

from boresight.errors import UserError
from boresight.frames.azel import azel_from_enu
from boresight.frames.local import enu_from_ecef
from boresight.types import Site
from boresight.types.sensor import FloatArray

UNIX_EPOCH = 2440587.5  # Julian date
DAY = 86400.0
STEP = 20.0  # s between the samples among which a culmination is looked for


class Satellite(NamedTuple):
    """A satellite: its name and SGP4's own record."""

    name: str
    record: Any


class Pass(NamedTuple):
    """One pass over a site: Unix seconds (UTC) and rad."""

    rise: float
    culmination: float
    set: float
    rise_azimuth: float
    max_elevation: float
    set_azimuth: float


def read_tle(text: str, where: str, skipped: list[str] | None = None) -> list[Satellite]:
    """Return the satellites of two-line elements, with or without a line of names before each.

    Raises UserError for a line 1 without its line 2, a wrong checksum, and for none at all; `where` is named in it.
    With `skipped` a satellite whose checksum is wrong is left out and told there instead.
    """
    try:
        record = importlib.import_module("sgp4.api").Satrec
    except ImportError:
        raise UserError("two-line elements need the package sgp4: it is missing here") from None
    lines = [line.rstrip() for line in text.splitlines()]
    out, name = [], ""
    for i, line in enumerate(lines):
        if line.startswith("1 ") and len(line) >= 68:
            after = lines[i + 1] if i + 1 < len(lines) else ""
            if not (after.startswith("2 ") and len(after) >= 68):
                raise UserError(f"{where}, line {i + 1}: a line 1 without its line 2")
            damaged = [k for k, one in enumerate((line, after)) if not _sound(one)]
            if damaged:
                told = f"{where}, line {i + 1 + damaged[0]}: the checksum does not fit: the line is damaged"
                if skipped is None:
                    raise UserError(told)
                skipped.append(told)
                name = ""
                continue
            try:
                satellite = record.twoline2rv(line[:69], after[:69])
            except ValueError as error:
                raise UserError(f"{where}, line {i + 1}: {error}") from None
            out.append(Satellite(name or str(satellite.satnum), satellite))
            name = ""
        elif not line.startswith(("2 ", "#")) and line:
            name = line.removeprefix("0 ").strip()
    if not out:
        raise UserError(f"{where}: no two-line elements in it")
    return out


def read_omm(text: str, where: str) -> list[Satellite]:
    """Return the satellites of orbit mean-elements messages: JSON (a list of objects), CSV or XML.

    Raises UserError for a message that lacks an element, and for none at all; `where` is named in it.
    """
    try:
        omm, api = importlib.import_module("sgp4.omm"), importlib.import_module("sgp4.api")
    except ImportError:
        raise UserError("orbital elements need the package sgp4: it is missing here") from None
    start = text.lstrip()[:1]
    try:
        if start in "[{":
            found = json.loads(text)
            messages = found if isinstance(found, list) else [found]
        elif start == "<":
            messages = list(omm.parse_xml(io.StringIO(text)))
        else:
            messages = list(omm.parse_csv(io.StringIO(text)))
        out = []
        for message in messages:
            record = api.Satrec()
            omm.initialize(record, {k: str(v) for k, v in message.items()})
            out.append(Satellite(str(message.get("OBJECT_NAME", record.satnum)), record))
    except (KeyError, ValueError, SyntaxError, TypeError, AttributeError) as error:
        raise UserError(f"{where}: not orbit mean elements ({type(error).__name__}: {error})") from None
    if not out:
        raise UserError(f"{where}: no orbit mean elements in it")
    return out


def read_elements(text: str, where: str, skipped: list[str] | None = None) -> list[Satellite]:
    """Return the satellites of two-line elements or OMM messages, whichever the text holds (see `read_tle`)."""
    first = next((line for line in text.splitlines() if line.strip()), "")
    if first.lstrip()[:1] in "[{<" or "MEAN_MOTION" in first:
        return read_omm(text, where)
    return read_tle(text, where, skipped)


def ecef_at(satellite: Satellite, t: ArrayLike, dut1: float = 0.0) -> FloatArray:
    """Return ECEF positions (n, 3) (m) at Unix times `t` (n,) (UTC s); `dut1` is UT1 − UTC (s).

    SGP4 gives TEME, which sidereal time (GMST 1982) turns to the Earth; polar motion (below 15 m) is left out.
    Raises UserError where SGP4 gives up: the message is its own.
    """
    times = np.atleast_1d(np.asarray(t, dtype=np.float64))
    day = np.floor(times / DAY)
    jd, fraction = UNIX_EPOCH + day, times / DAY - day
    error, r, _ = satellite.record.sgp4_array(jd, fraction)
    if error.any():
        reasons = importlib.import_module("sgp4.api").SGP4_ERRORS
        row = int(np.flatnonzero(error)[0])
        raise UserError(f"satellite {satellite.name} at t = {times[row]:.0f} s: {reasons[int(error[row])]}")
    angle = sidereal_time(jd, fraction + dut1 / DAY)
    c, s = np.cos(angle), np.sin(angle)
    x, y = 1e3 * r[:, 0], 1e3 * r[:, 1]
    return np.stack([c * x + s * y, c * y - s * x, 1e3 * r[:, 2]], axis=-1)


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
    satellite: Satellite, site: Site, begin: float, end: float, lowest: float = 0.0, dut1: float = 0.0
) -> list[Pass]:
    """Return the passes above `lowest` (rad) culminating from `begin` to `end` (Unix s); rise and set to 1 ms."""

    def elevation(t: float) -> float:
        return float(look(satellite, t, site, dut1)[1][0])

    t = np.arange(begin - STEP, end + 2 * STEP, STEP)
    e = look(satellite, t, site, dut1)[1]
    tops = np.flatnonzero((e[1:-1] >= e[:-2]) & (e[1:-1] > e[2:])) + 1
    out = []
    for i in tops:
        best = minimize_scalar(
            lambda s: -elevation(s), bounds=(t[i - 1], t[i + 1]), method="bounded", options={"xatol": 1e-3}
        )
        if not (-best.fun > lowest and begin <= best.x <= end):
            continue
        rise = _edge(elevation, float(best.x), -1.0, lowest)
        fall = _edge(elevation, float(best.x), 1.0, lowest)
        if rise is None or fall is None:  # never sets within a day: no pass
            continue
        azimuth = look(satellite, [rise, fall], site, dut1)[0]
        out.append(Pass(rise, float(best.x), fall, float(azimuth[0]), float(-best.fun), float(azimuth[1])))
    return out


def _edge(elevation: Callable[[float], float], top: float, way: float, lowest: float) -> float | None:
    inside, at = top, top
    while abs(at - top) < DAY:
        at += way * STEP
        if elevation(at) < lowest:
            return float(brentq(lambda s: elevation(s) - lowest, *sorted((inside, at)), xtol=1e-4))
        inside = at
    return None


def _sound(line: str) -> bool:
    total = sum(int(c) if c.isdigit() else (c == "-") for c in line[:68])
    return len(line) < 69 or not line[68].isdigit() or total % 10 == int(line[68])


def unix_of(jd: float, fraction: float) -> float:
    """Return Unix seconds of a Julian date in two parts (UTC)."""
    return math.fsum(((jd - UNIX_EPOCH) * DAY, fraction * DAY))
