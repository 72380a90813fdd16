"""The log of a live run as a recording: what arrived is decoded again, by the same code, into the same looks."""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import Any

import numpy as np

from boresight.errors import UserError
from boresight.io.declaration import Declaration, RecordingTable, declaration_of
from boresight.io.jsonlines import Fix, LookDecoder
from boresight.io.livelog import SITE, Kind, LogReader, LogTable, read_about, site_text
from boresight.io.toml import convert, toml_of
from boresight.types import Detections, PlatformTrack, Recording, Scan


def decoder_of(declared: Declaration, about: LogTable) -> LookDecoder:
    """Return the decoder of a live run, before its first line."""
    platforms = {s.platform for s in declared.sensors if s.platform is not None} | {p.id for p in about.platform}
    return LookDecoder(
        declared.sensors, declared.site, declared.dimensions, frozenset(platforms), about.recorded_arrivals,
        about.oldest_s, about.clock_tolerance_s,
    )  # fmt: skip


def sigmas_of(about: LogTable) -> dict[str, tuple[float, float]]:
    """Return the declared errors of navigation by platform: position (m), attitude (rad), NaN where not declared."""
    out = {}
    for p in about.platform:
        position = math.nan if p.sigma_position_m is None else p.sigma_position_m
        attitude = math.nan if p.sigma_attitude_deg is None else math.radians(p.sigma_attitude_deg)
        out[p.id] = (position, attitude)
    return out


def platform_track(name: str, fixes: list[Fix], sigmas: tuple[float, float] | None) -> PlatformTrack:
    """Return stamps of navigation as the track of a platform."""
    rows = np.stack([f.row for f in fixes])
    position, attitude = sigmas if sigmas is not None else (np.nan, np.nan)
    own = np.array([[f.sigma_position, f.sigma_attitude] for f in fixes])
    sigma = np.where(np.isnan(own), [position, attitude], own)
    return PlatformTrack(
        name, np.array([f.t for f in fixes]), rows[:, :3], rows[:, 3:6], rows[:, 6:], sigma[:, 0], sigma[:, 1],
        np.array([f.t_recv for f in fixes]),
    )  # fmt: skip


def declaration_of_log(folder: Path) -> Declaration:
    """Return what a log's site file declares of site and sensors; raises UserError."""
    where = str(folder / SITE)
    raw = toml_of(site_text(folder), where)
    known = {k: v for k, v in raw.items() if k in RecordingTable.__struct_fields__}
    return declaration_of(convert(known, RecordingTable, where), where)


def recording_of_log(folder: Path) -> Recording:
    """Return a log as the recording that gives the same tracks and decisions, bit for bit; raises UserError.

    What of the log cannot be read is told on standard error.
    """
    about, declared = read_about(folder), declaration_of_log(folder)
    decoder = decoder_of(declared, about)
    reader = LogReader(folder)
    scans: list[Scan] = []
    fixes: dict[str, list[Fix]] = {}
    repeats: dict[int, int] = {}  # row of a duplicate, and which it repeats
    for record in reader:
        if record.kind != Kind.TAKEN:
            continue
        for item in decoder.decode(record.data, record.t):
            if isinstance(item, Scan):
                scans.append(item)
            else:
                fixes.setdefault(item.platform, []).append(item)
        repeats.update(decoder.duplicates)
        decoder.duplicates.clear()
    for words in reader.damage:
        print(f"boresight: {folder}: {words}", file=sys.stderr)
    if not decoder.rows:
        raise UserError(f"{folder}: no detections were logged")
    sigmas = sigmas_of(about)
    platforms = tuple(platform_track(name, rows, sigmas.get(name)) for name, rows in fixes.items())
    twice = np.zeros(decoder.rows, np.bool_)
    twice[list(repeats)] = True
    name = declared.name or folder.resolve().name
    detections = _detections(scans, decoder, repeats)
    return Recording(
        name, declared.dimensions, declared.site, declared.sensors, detections, platforms, duplicates=twice
    )


def _detections(scans: list[Scan], decoder: LookDecoder, repeats: dict[int, int]) -> Detections:
    """Lay looks end to end as rows of detections; a duplicate, which was in no look, is the row that it repeats."""
    n = decoder.rows
    t, arrived = np.zeros(n), np.zeros(n)
    sensor, look = np.zeros(n, np.int64), np.zeros(n, np.int64)
    z, sigma = np.full((n, 7), np.nan), np.full((n, 7), np.nan)
    full: dict[int, Any] = {}
    ids: list[str | None] = [None] * n
    for k, scan in enumerate(scans):
        rows = scan.row if len(scan.t) else np.array(scan.empty_rows)
        t[rows] = scan.t if len(scan.t) else scan.t_look
        arrived[rows], sensor[rows], look[rows] = scan.t_recv, scan.sensor, k
        if len(scan.t):
            z[rows] = scan.z
            diagonal = np.diagonal(scan.covariance, axis1=1, axis2=2)
            sigma[rows] = np.sqrt(diagonal)  # of a square: exactly the number that was squared
            plain = np.nan_to_num(sigma[rows] ** 2)[:, :, None] * np.eye(7)
            for i in np.flatnonzero((np.nan_to_num(scan.covariance) != plain).any(axis=(1, 2))).tolist():
                full[int(rows[i])] = scan.covariance[i]
    for row, name in decoder.ids.items():
        ids[row] = name
    for row, first in repeats.items():
        for column in (t, arrived, sensor, look, z, sigma):
            column[row] = column[first]
        ids[row] = ids[first]
        if first in full:
            full[row] = full[first]
    return Detections(t, arrived, sensor, look, z, sigma, full, ids if any(ids) else None)
