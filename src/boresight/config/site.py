"""SITE.toml of `boresight point`: units in the keys, unknown keys named, to `pointing.Pointer` and `Mount`."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal, NamedTuple

from boresight.errors import UserError, did_you_mean
from boresight.frames.array_face import Pole
from boresight.io.files import read_text
from boresight.io.toml import TableModel, convert, read_toml
from boresight.kernels.guide import DIRECTION
from boresight.pointing.elements import Satellite, label, read_elements
from boresight.pointing.follow import TrackGuide
from boresight.pointing.guide import GuideFilter, GuideSource
from boresight.pointing.mount import Mask, Mount
from boresight.pointing.pointer import Choice, Pointer
from boresight.types import Component, Recording, Sensor, Site

DEG = math.pi / 180.0


class SiteTable(TableModel, frozen=True):
    """`[site]`: where the antenna stands."""

    latitude_deg: float
    longitude_deg: float
    height_m: float = 0.0


class BeamTable(TableModel, frozen=True):
    """`[beam]`: its full width, and the time from now until it is there: computation + link + mechanics."""

    width_deg: float = 1.0
    computation_s: float = 0.01
    link_s: float = 0.04
    mechanics_s: float = 0.45
    rate_hz: float = 10.0


class FaceTable(TableModel, frozen=True):
    """`[face]`: how an array's face is turned, and where the pole of its angles lies."""

    azimuth_deg: float = 0.0
    elevation_deg: float = 90.0
    skew_deg: float = 0.0
    pole: Literal["in_face", "on_normal"] = "on_normal"


class MountTable(TableModel, frozen=True):
    """`[mount]`: mechanical stops and rates; `horizon_deg` is what stands in the way, corner by corner."""

    azimuth_deg: tuple[float, float] = (-270.0, 270.0)
    elevation_deg: tuple[float, float] = (0.0, 90.0)
    azimuth_rate_deg_s: float = 10.0
    elevation_rate_deg_s: float = 10.0
    horizon_deg: tuple[tuple[float, float], ...] = ()


class DynamicsTable(TableModel, frozen=True):
    """`[dynamics]`: kind = "orbit" (q in m²/s³) or "acceleration" (white jerk, q in m²/s⁵)."""

    kind: Literal["orbit", "acceleration"] = "acceleration"
    q: float | None = None
    gate: float = 30.0


class SourceTable(TableModel, frozen=True):
    """`[[source]]`: a guide source or own tracking; with `tle` (a file beside this one) an orbit's elements.

    With `correlation_s` it is another tracker's track; `tracks` is a folder with its tracks.parquet, for a replay.
    """

    id: str
    own: bool = False
    sigma_angle_deg: float = 0.0
    sigma_range_m: float = 0.0
    sigma_position_m: float = 0.0
    sigma_bias_m: float = 0.0
    correlation_s: float | None = None
    sigma_up_m: float = 10.0
    latency_s: float = 0.0
    tracks: str | None = None
    track_id: int | None = None
    axes: Literal["site_enu", "platform_enu", "body"] = "site_enu"
    offset_enu_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    lever_arm_frd_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    tle: str | None = None
    satellite: str | None = None
    max_age_days: float = 30.0
    sigma_azimuth_deg: float = 0.0
    sigma_elevation_deg: float = 0.0
    sigma_bias_azimuth_deg: float = 0.0
    sigma_bias_elevation_deg: float = 0.0
    sigma_bias_range_m: float = 0.0
    sigma_bias_time_s: float = 0.0


class InputTable(TableModel, frozen=True):
    """`[input]`: where JSON lines come from; any of them may be left out."""

    udp: str | None = None
    tcp: str | None = None
    serial: str | None = None
    baud: int = 9600


class OutputTable(TableModel, frozen=True):
    """`[output]`: where commands go."""

    udp: str | None = None
    tcp: str | None = None
    rotctld: str | None = None
    dead_band_deg: float = 0.1
    command_rate_hz: float = 2.0


class SiteFile(TableModel, frozen=True):
    """The whole file."""

    site: SiteTable
    beam: BeamTable = BeamTable()
    face: FaceTable = FaceTable()
    mount: MountTable = MountTable()
    dynamics: DynamicsTable = DynamicsTable()
    choice: Literal["auto", "guide", "own"] = "auto"
    stale_s: float = 3.0
    platform: str | None = None
    attitude_coast_s: float = 1.0
    source: tuple[SourceTable, ...] = ()
    input: InputTable = InputTable()
    output: OutputTable = OutputTable()


class TrackerSite(NamedTuple):
    """What follows a track of a tracker: pointer, mount, rate of commands (Hz), which track, outputs."""

    pointer: Pointer
    mount: Mount
    rate: float
    follow: str
    sigma_up: float
    output: OutputTable


class Station(NamedTuple):
    """A site file, built."""

    file: SiteFile
    site: Site
    mount: Mount
    elements: dict[str, Satellite]  # by source id


def read_site(path: Path) -> Station:
    """Read SITE.toml; raises UserError that names file and key."""
    file = convert(read_toml(path), SiteFile, str(path))
    s, m = file.site, file.mount
    if not abs(s.latitude_deg) <= 90.0:
        raise UserError(f"{path}: site.latitude_deg = {s.latitude_deg:g} must lie between -90 and 90")
    if not (file.beam.rate_hz > 0 and file.beam.width_deg > 0 and file.output.command_rate_hz > 0):
        raise UserError(f"{path}: beam.rate_hz, beam.width_deg and output.command_rate_hz must be above zero")
    if not file.attitude_coast_s >= 0:
        raise UserError(f"{path}: attitude_coast_s = {file.attitude_coast_s:g} must not be negative")
    for one in file.source:
        _check_source(one, path, file.platform)
    try:
        mount = mount_of(m)
    except UserError as error:
        raise UserError(f"{path}: {error}") from None
    elements = {one.id: _satellite(one, path) for one in file.source if one.tle is not None}
    return Station(file, Site(s.latitude_deg * DEG, s.longitude_deg * DEG, s.height_m), mount, elements)


def mount_of(m: MountTable) -> Mount:
    """Return the mount of a `[mount]` table; raises UserError."""
    return Mount(
        (m.azimuth_deg[0] * DEG, m.azimuth_deg[1] * DEG), (m.elevation_deg[0] * DEG, m.elevation_deg[1] * DEG),
        m.azimuth_rate_deg_s * DEG, m.elevation_rate_deg_s * DEG, tuple((a * DEG, e * DEG) for a, e in m.horizon_deg),
    )  # fmt: skip


def track_pointer(site: Site, beam: BeamTable, face: FaceTable, stale: float, horizon: Mask) -> Pointer:
    """Return the pointer that follows a track of the tracker in the same process."""
    return Pointer(TrackGuide(site), site, (False,), **_beam(beam, face), stale=stale, horizon=horizon)


def _beam(beam: BeamTable, face: FaceTable) -> dict[str, Any]:
    """Return the beam and the face as `Pointer` takes them."""
    return {
        "face": (face.azimuth_deg * DEG, face.elevation_deg * DEG, face.skew_deg * DEG),
        "pole": Pole(face.pole),
        "beam_width": beam.width_deg * DEG,
        "lead": beam.computation_s + beam.link_s + beam.mechanics_s,
    }


def _check_source(one: SourceTable, path: Path, platform: str | None) -> None:
    if platform is None and (one.axes != "site_enu" or any(one.lever_arm_frd_m)):
        raise UserError(f"{path}: source '{one.id}': axes and lever_arm_frd_m go with platform = \"…\" of the file")
    if one.correlation_s is None and (one.tracks is not None or one.track_id is not None):
        raise UserError(f"{path}: source '{one.id}': tracks go with correlation_s, over which their errors resemble")
    if not one.max_age_days > 0:
        raise UserError(f"{path}: source '{one.id}': max_age_days must be above zero")
    if not one.sigma_up_m > 0:
        raise UserError(f"{path}: source '{one.id}': sigma_up_m must be above zero")


def _satellite(source: SourceTable, path: Path) -> Satellite:
    where = path.parent / str(source.tle)
    refused: list[str] = []
    found = read_elements(read_text(where), str(where), refused)
    if source.satellite is None:
        wanted = [one for one in found if one.number == found[0].number]
    else:
        name = label(source.satellite)
        wanted = [one for one in found if name in (one.name, one.number)]
    if not wanted:
        why = [reason for reason in refused if str(source.satellite) in reason]
        hint = f": {why[0]}" if why else did_you_mean(str(source.satellite), [one.name for one in found])
        raise UserError(f"{where}: no satellite '{source.satellite}'{hint}")
    return max(wanted, key=lambda one: one.epoch)


def pointer_for(station: Station, recording: Recording | None = None) -> Pointer:
    """Return the chain: its sources are those of the file, or a recording's sensors as they declare themselves.

    A `[[source]]` of a sensor's id replaces what the sensor declares. Raises UserError for a source that the recording
    does not have, and for no source at all.
    """
    file = station.file
    named = {s.id: s for s in file.source}
    if recording is None:
        sources = [_source(s) for s in file.source]
    else:
        known = [s.id for s in recording.sensors]
        for name in named:
            if name not in known and name not in station.elements and named[name].tracks is None:
                raise UserError(f"source '{name}' is not in the recording{did_you_mean(name, known)}")
        sources = [_source(named[s.id]) if s.id in named else _declared(s) for s in recording.sensors]
        sources += [_source(s) for s in file.source if s.id not in known]
    if not sources:
        raise UserError("the site file has no [[source]]: say who reports")
    may_be_off = [s.kind == DIRECTION and not (s.id in named and named[s.id].own) for s in sources]
    if sum(may_be_off) > 1:  # of one alone an error cannot be told from the target's place
        sources = [replace(s, suspect=off) for s, off in zip(sources, may_be_off, strict=True)]
    orbit = file.dynamics.kind == "orbit"
    q = file.dynamics.q if file.dynamics.q is not None else (1e-3 if orbit else 1.0)
    spread = (1e5, 8e3, 50.0) if orbit else (1e3, 300.0, 20.0)
    return Pointer(
        GuideFilter(tuple(sources), orbit, q, file.dynamics.gate, spread=spread),
        station.site,
        tuple(named[s.id].own if s.id in named else False for s in sources),
        **_beam(file.beam, file.face),
        choice=Choice(file.choice),
        stale=file.stale_s,
        horizon=station.mount.mask,
    )


def _source(s: SourceTable) -> GuideSource:
    return GuideSource(
        s.id, s.sigma_angle_deg * DEG, s.sigma_range_m, s.sigma_position_m, s.sigma_bias_m, s.correlation_s,
        s.sigma_azimuth_deg * DEG, s.sigma_elevation_deg * DEG, s.sigma_bias_azimuth_deg * DEG,
        s.sigma_bias_elevation_deg * DEG, s.sigma_bias_range_m, s.sigma_bias_time_s,
    )  # fmt: skip


def _declared(s: Sensor) -> GuideSource:
    """A sensor as a source: of directions if it measures an angle or a range, else of positions."""
    azimuth, elevation, far = (
        float(v) if v > 0 else 0.0 for v in s.sigma[[Component.AZIMUTH, Component.ELEVATION, Component.RANGE]]
    )
    if azimuth or elevation or far:
        return GuideSource(s.id, sigma_azimuth=azimuth, sigma_elevation=elevation, sigma_range=far)
    position = [float(v) for v in s.sigma[[Component.EAST, Component.NORTH, Component.UP]] if v > 0]
    if not position:
        raise UserError(f"sensor '{s.id}' measures neither direction nor position: it cannot guide a beam")
    return GuideSource(s.id, sigma_position=max(position))
