"""Mean elements of satellites: two-line sets, and orbit mean-elements messages (CCSDS 502) in JSON, XML, CSV and KVN.

Every set is read by itself: one that is damaged, or that SGP4 cannot propagate, is refused with its reason and costs
the others nothing. A catalogue number is a label of any size.
"""

from __future__ import annotations

import importlib
import math
import re
from collections.abc import Mapping
from typing import Any, NamedTuple

from boresight.errors import UserError
from boresight.pointing.messages import Message, messages_of

UNIX_EPOCH = 2440587.5  # Julian date
DAY = 86400.0
TOLD = 5  # reasons in one message
DEG = math.pi / 180.0
TURNS_A_DAY = 2.0 * math.pi / 1440.0  # rad a minute
SGP4 = {"0", "2", "3", ""}  # ephemeris types that are SGP4's elements: it chooses between near and deep space by itself
THEORIES = {"1": "SGP", "4": "SGP4-XP", "5": "SDP8", "6": "a special-perturbation vector"}
MEANT = {"TIME_SYSTEM": "UTC", "REF_FRAME": "TEME", "CENTER_NAME": "EARTH"}
ANGLES = ("INCLINATION", "RA_OF_ASC_NODE", "ARG_OF_PERICENTER", "MEAN_ANOMALY")
UNITS = {"MEAN_MOTION": ("rev/day", "rev/d"), **dict.fromkeys(ANGLES, ("deg", "degree", "degrees"))}
_EPOCH = re.compile(r"(\d{4})-(?:(\d{2})-(\d{2})|(\d{3}))T(\d{2}):(\d{2}):(\d{2})(?:\.(\d*))?Z?", re.ASCII)
_ONE = re.compile(
    r"1 [ \dA-HJ-NP-Z][ \d]{4}. .{8} [ \d]{2}[ \d]{3}\.[ \d]{8} [ +-]\.[ \d]{8} [ +-][ \d]{5}[ +-][ \d] "
    r"[ +-][ \d]{5}[ +-][ \d] . [ \d]{4}[ \d]?",
    re.ASCII,
)
_TWO = re.compile(
    r"2 [ \dA-HJ-NP-Z][ \d]{4} [ \d]{3}\.[ \d]{4} [ \d]{3}\.[ \d]{4} [ \d]{7} [ \d]{3}\.[ \d]{4} [ \d]{3}\.[ \d]{4} "
    r"[ \d]{2}\.[ \d]{8}[ \d]{5}[ \d]?",
    re.ASCII,
)


class Satellite(NamedTuple):
    """A satellite: its name, SGP4's own record, its catalogue number as given, and its elements' epoch (Unix s)."""

    name: str
    record: Any
    number: str = ""
    epoch: float = math.nan


class RefusedError(Exception):
    """Why one set of elements cannot be used."""


def read_elements(text: str, where: str, skipped: list[str] | None = None) -> list[Satellite]:
    """Return the satellites of two-line elements or of OMM messages (JSON, XML, CSV, KVN), whichever the text holds.

    A set that cannot be used is left out; `skipped` is told which and why. Raises UserError if none is left, with the
    reasons; `where` is named in it.
    """
    told: list[str] = []
    text = text.removeprefix("\ufeff")
    messages = messages_of(text)
    found = _two_line(text, told) if messages is None else [s for m in messages if (s := _of_message(m, told))]
    told = [f"{where}, {reason}" for reason in told]
    if skipped is not None:
        skipped += told
    if not found:
        kind = "two-line elements" if messages is None else "orbit mean elements"
        more = f"; and {len(told) - TOLD} more" if len(told) > TOLD else ""
        raise UserError("; ".join(told[:TOLD]) + more if told else f"{where}: no {kind} in it")
    return found


def read_tle(text: str, where: str, skipped: list[str] | None = None) -> list[Satellite]:
    """Return the satellites of two-line elements, with or without a line of names before each.

    Raises UserError for a set that cannot be used, or with `skipped` only if none is left (see `read_elements`).
    """
    told: list[str] = []
    found = _two_line(text.removeprefix("\ufeff"), told)
    told = [f"{where}, {reason}" for reason in told]
    if skipped is not None:
        skipped += told
    if told and (skipped is None or not found):
        raise UserError("; ".join(told[:TOLD]))
    if not found:
        raise UserError(f"{where}: no two-line elements in it")
    return found


def epoch_of(text: str) -> tuple[int, float]:
    """Return days since 1949-12-31 00:00 UTC and the fraction of a day of a time as CCSDS 301 writes it.

    Calendar date or day of year, any number of digits of a second or none, with or without Z. Raises RefusedError.
    """
    from datetime import date

    match = _EPOCH.fullmatch(text.strip())
    if match is None:
        raise RefusedError(f"EPOCH '{label(text)}' is no time like 2026-01-31T12:00:00.123 or 2026-031T12:00:00")
    year, month, day, of_year, hour, minute, second = (int(v) if v else 0 for v in match.groups()[:7])
    fraction = float(f"0.{match[8] or '0'}")
    try:
        ordinal = date(year, month or 1, day or 1).toordinal() + (of_year - 1 if match[4] else 0)
    except ValueError:
        ordinal = 0
    leap = (hour, minute, second) == (23, 59, 60)
    whole = 1 <= of_year <= date(year, 12, 31).timetuple().tm_yday if match[4] and year else ordinal > 0
    if not (whole and hour < 24 and minute < 60 and (second < 60 or leap)):
        raise RefusedError(f"EPOCH '{label(text)}': there is no such time")
    days = ordinal - date(1949, 12, 31).toordinal()
    return days, (3600.0 * hour + 60.0 * minute + second + fraction) / DAY


def label(text: str) -> str:
    """Return a text from outside as one printable line."""
    shown = " ".join(text.split())
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in shown)[:80]


def _sgp4() -> Any:
    try:
        return importlib.import_module("sgp4.api")
    except ImportError:
        raise UserError("orbital elements need the package sgp4: it is missing here") from None


def _checked(name: str, record: Any, number: str) -> Satellite:
    """Return the satellite of a record that SGP4 can propagate at its epoch; raises RefusedError."""
    error, r, _ = record.sgp4(record.jdsatepoch, record.jdsatepochF)
    if error:
        raise RefusedError(f"SGP4 fails at its epoch: {_sgp4().SGP4_ERRORS.get(error, error)}")
    if not all(map(math.isfinite, r)):
        raise RefusedError("SGP4 gives no position at its epoch")
    epoch = math.fsum(((record.jdsatepoch - UNIX_EPOCH) * DAY, record.jdsatepochF * DAY))
    return Satellite(name or number, record, number, epoch)


def _refuse_theory(kind: str) -> None:
    if kind in SGP4:
        return
    name = f", elements of {THEORIES[kind]}" if kind in THEORIES else ""
    raise RefusedError(f"ephemeris type {label(kind)}{name}: SGP4 cannot propagate them")


# ------------------------------------------------------------------------------------------------ two-line elements
def _two_line(text: str, told: list[str]) -> list[Satellite]:
    """Return the sets that can be used; `told` gets the line and the reason of every other."""
    record = _sgp4().Satrec
    lines = [line.rstrip() for line in text.splitlines()]
    found: list[Satellite] = []
    name, i = "", 0
    while i < len(lines):
        line, after = lines[i], lines[i + 1] if i + 1 < len(lines) else ""
        i += 1
        if line.startswith("1 ") and (len(line) >= 50 or after.startswith("2 ")):
            try:
                if not after.startswith("2 "):
                    raise RefusedError("a line 1 without its line 2")
                found.append(_of_lines(record, name, line[:69], after[:69], i))
            except RefusedError as error:
                at = error.line if isinstance(error, _LineError) else i
                told.append(f"line {at}: {error}{_named(name)}")
            i += after.startswith("2 ")
            name = ""
        elif line.startswith("2 ") and len(line) >= 50:
            told.append(f"line {i}: a line 2 without its line 1{_named(name)}")
            name = ""
        elif line and not line.startswith("#"):
            name = label(line.removeprefix("0 "))
    return found


class _LineError(RefusedError):
    """A refusal that belongs to one line."""

    def __init__(self, line: int, reason: str) -> None:
        super().__init__(reason)
        self.line = line


def _named(name: str) -> str:
    return f" ({name})" if name else ""


def _of_lines(record: Any, name: str, one: str, two: str, line: int) -> Satellite:
    for k, (text, form) in enumerate(((one, _ONE), (two, _TWO))):
        if len(text) < 68:
            raise _LineError(line + k, f"{len(text)} characters long, 69 are needed: the line is damaged")
        if not _sound(text):
            raise _LineError(line + k, "the checksum does not fit: the line is damaged")
        if not form.fullmatch(text):
            raise _LineError(line + k, "not in the columns of two-line elements: the line is damaged")
    if one[2:7] != two[2:7]:
        raise RefusedError(f"its two lines are of two satellites, {one[2:7].strip()} and {two[2:7].strip()}")
    _refuse_theory(one[62].strip())
    try:
        made = record.twoline2rv(one, two)
    except ValueError as error:
        raise RefusedError(label(str(error))) from None
    return _checked(name, made, one[2:7].strip())


def _sound(line: str) -> bool:
    total = sum(int(c) if c in "0123456789" else (c == "-") for c in line[:68])
    return len(line) < 69 or line[68] not in "0123456789" or total % 10 == int(line[68])


# ------------------------------------------------------------------------------------- orbit mean-elements messages
def read_omm(text: str, where: str, skipped: list[str] | None = None) -> list[Satellite]:
    """Return the satellites of orbit mean-elements messages (see `read_elements`)."""
    return read_elements(text, where, skipped)


def _of_message(message: Message, told: list[str]) -> Satellite | None:
    """Return the satellite of a message; None if it cannot be used: `told` gets where it stands and the reason."""
    values = message.values
    name = label(values.get("OBJECT_NAME", "") or values.get("OBJECT_ID", ""))
    try:
        if message.fault:
            raise RefusedError(message.fault)
        return _satellite(name, values, message.units)
    except RefusedError as error:
        told.append(f"{message.where}: {error}{_named(name)}")
        return None


def _satellite(name: str, values: Mapping[str, str], units: Mapping[str, str]) -> Satellite:
    theory = values.get("MEAN_ELEMENT_THEORY", "").upper()
    if theory not in ("", "SGP4", "SGP/SGP4", "SGP4/SDP4", "SDP4"):
        raise RefusedError(f"MEAN_ELEMENT_THEORY {label(theory)}: SGP4 cannot propagate its elements")
    _refuse_theory(values.get("EPHEMERIS_TYPE", "").strip())
    for key, meant in MEANT.items():
        if values.get(key, "").upper() not in ("", meant):
            raise RefusedError(f"{key} {label(values[key])}: SGP4 needs {meant}")
    for key, known in UNITS.items():
        if key in units and units[key].lower().replace(" ", "") not in known:
            raise RefusedError(f"{key} in {label(units[key])}: {known[0]} is needed")
    if "MEAN_MOTION" not in values and "SEMI_MAJOR_AXIS" in values:
        raise RefusedError("SEMI_MAJOR_AXIS instead of MEAN_MOTION: SGP4 cannot propagate it")
    if "EPOCH" not in values:
        raise RefusedError("EPOCH is missing: not orbit mean elements")
    days, fraction = epoch_of(values["EPOCH"])
    turns, eccentricity = _number(values, "MEAN_MOTION"), _number(values, "ECCENTRICITY")
    i, node, pericenter, anomaly = (_number(values, key) for key in ANGLES)
    if not (0.0 <= eccentricity < 1.0 and 0.0 < turns < 20.0 and 0.0 <= i <= 180.0):
        raise RefusedError(
            f"MEAN_MOTION {turns:g}, ECCENTRICITY {eccentricity:g} or INCLINATION {i:g} is of no orbit about the Earth"
        )
    dot = _number(values, "MEAN_MOTION_DOT", 0.0) * TURNS_A_DAY / 1440.0
    ddot = _number(values, "MEAN_MOTION_DDOT", 0.0) * TURNS_A_DAY / 1440.0**2
    api = _sgp4()
    record = api.Satrec()
    record.sgp4init(
        api.WGS72, "i", 0, days + fraction, _number(values, "BSTAR", 0.0), dot, ddot, eccentricity, pericenter * DEG,
        i * DEG, anomaly * DEG, turns * TURNS_A_DAY, node * DEG,
    )  # fmt: skip
    return _checked(name, record, label(values.get("NORAD_CAT_ID", "")))


def _number(values: Mapping[str, str], key: str, default: float | None = None) -> float:
    text = values.get(key, "").strip()
    if not text:
        if default is None:
            raise RefusedError(f"{key} is missing: not orbit mean elements")
        return default
    try:
        value = float(text) if "_" not in text else math.nan
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise RefusedError(f"{key} '{label(text)}' is no number")
    return value
