"""A proposal of recording.toml for files of which nothing is declared yet."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import msgspec
import numpy as np

from boresight.errors import UserError
from boresight.io import limits
from boresight.io.columns import like_name
from boresight.io.declaration import DEG, Declaration, write_declaration
from boresight.io.detections import MEASURED
from boresight.io.mapping import EACH, FileMap, Raw, converted, guess_map, north_mark, read_raw
from boresight.types import Axes, Component, FloatArray, Sensor, SensorKind, Site

SHORTEST, LONGEST = 0.4, 60.0  # s, turns of a rotating sensor
AGREE = 0.9  # of the rows' phases
ROWS = 60  # that find the turn; all refine it
# Noise that is put down where nothing is known: to be replaced.
NOISE = {Component.RANGE: 20.0, Component.AZIMUTH: 0.5 * DEG, Component.ELEVATION: 0.5 * DEG, Component.RANGE_RATE: 1.0}
POSITION = 20.0  # m
HEAD = """\
# A proposal from the files: put in what is known of the sensors (noise, period_s, p_detection, clutter_per_scan,
# coverage) and of the site, then: boresight import csv FILES --guess --sensors THIS -o REC
"""


def propose(paths: Sequence[Path], time_unit: str | None = None) -> tuple[str, Declaration]:
    """Return a recording.toml for CSV files, as text and read: one sensor for each file of detections.

    Raises UserError for files that cannot be understood.
    """
    if not paths:
        raise UserError("import csv --guess: name CSV files")
    raws = [read_raw(path) for path in paths]
    site = next((s for raw in raws if (s := _first_place(raw)) is not None), Site(0.0, 0.0, 0.0))
    maps: list[tuple[Raw, FileMap]] = []
    for raw in raws:
        of, _ = guess_map(raw, Declaration("", 3, site, (_stand_in(raw),)), time_unit)
        maps.append((raw, of))
    carrier = "platform" if any(of.table == "platform" for _, of in maps) else None
    sensors = tuple(_sensor(raw, of, site, carrier) for raw, of in maps if of.table == "detections")
    if not sensors:
        raise UserError(f"{paths[0]}: no file holds detections (ranges, bearings or positions of targets)")
    dimensions = (
        3 if any(math.isfinite(s.sigma[k]) for s in sensors for k in (Component.ELEVATION, Component.UP)) else 2
    )
    declared = Declaration(paths[0].stem, dimensions, site, sensors)
    return HEAD + write_declaration(declared), declared


def _stand_in(raw: Raw) -> Sensor:
    """A sensor that takes whatever a file holds, on the one platform there is."""
    return Sensor(raw.path.stem, SensorKind.POSITION, "platform")


def _first_place(raw: Raw) -> Site | None:
    """The first latitude and longitude of a file that can be one."""
    named = {c.name: raw.cells[i] for i, h in enumerate(raw.header) if (c := like_name(h)) is not None}
    if "latitude_deg" not in named or "longitude_deg" not in named:
        return None
    for cells in zip(named["latitude_deg"], named["longitude_deg"], strict=True):
        try:
            place = [float(c.replace(raw.decimal, ".")) for c in cells]
        except ValueError:
            continue
        names = ("latitude_deg", "longitude_deg")
        if all(limits.problem(n, v) is None for n, v in zip(names, place, strict=True)):
            return Site(round(place[0], 3) * DEG, round(place[1], 3) * DEG, 0.0)
    return None


def _sensor(raw: Raw, of: FileMap, site: Site, carrier: str | None) -> Sensor:
    declared = Declaration("", 3, site, (_stand_in(raw),))
    table = converted(raw, msgspec.structs.replace(of, scan=EACH, sensor=raw.path.stem), declared)
    sigma = np.full(len(Component), np.nan)
    for component, name in ((c, n) for c, n in zip(Component, MEASURED, strict=True) if c in NOISE):
        if name in table:
            sigma[component] = NOISE[component]
    if "x_m" in table:
        sigma[Component.EAST :] = POSITION
    ranged, seen = "range_m" in table, "azimuth_deg" in table
    kind = SensorKind.RADAR if ranged else SensorKind.OPTICAL if seen and "x_m" not in table else SensorKind.POSITION
    period = turn_of(table.numbers("t_s"), table.numbers("azimuth_deg")) if ranged and seen else None
    rides = carrier if kind != SensorKind.POSITION else None
    axes = Axes.PLATFORM_ENU if rides else Axes.SITE_ENU
    return Sensor(raw.path.stem, kind, rides, axes, sigma=sigma, period=period)


def turn_of(t: FloatArray, azimuth: FloatArray) -> float | None:
    """Return the time of one turn (s) of a sensor whose azimuths (n,) (deg) follow its stamps (n,) (s), None if not."""
    good = np.isfinite(t) & np.isfinite(azimuth)
    t, azimuth = t[good], azimuth[good]
    if len(t) < 8:
        return None
    some = slice(0, ROWS)
    fine = math.log(LONGEST / SHORTEST)
    span = float(np.ptp(t[some]))
    n = int(np.clip(8.0 * fine * span / SHORTEST, 500, 20000))
    trial = SHORTEST * np.exp(np.linspace(0.0, fine, n))
    best = max(trial.tolist(), key=lambda p: north_mark(t[some], azimuth[some], p)[1])
    width = best * best / max(span, best)
    while width > 1e-5 * best:
        near = np.linspace(best - width, best + width, 41)
        best = max(near.tolist(), key=lambda p: north_mark(t, azimuth, p)[1])
        width *= 0.2
    return float(f"{best:.4g}") if north_mark(t, azimuth, best)[1] > AGREE else None
