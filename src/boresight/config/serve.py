"""SITE.toml of `boresight serve`: a recording.toml with inputs, outputs, the log, the tracker and the pointer."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal, NamedTuple

from boresight.config.pipeline import take_pipeline
from boresight.config.site import BeamTable, FaceTable, MountTable, OutputTable, TrackerSite, mount_of, track_pointer
from boresight.config.tracker import TrackerTable, tracker_config_of
from boresight.errors import UserError
from boresight.io.declaration import Declaration, RecordingTable, declaration_of
from boresight.io.files import read_text
from boresight.io.livelog import LogTable, PlatformTable
from boresight.io.toml import TableModel, convert, read_toml, toml_of, write_toml
from boresight.tracking.config import TrackerConfig

FORMATS = ("json",)


class InputTable(TableModel, frozen=True):
    """`[input]`, or one of several `[[input]]`: where lines come from.

    `arrival` = "recorded" takes the times of arrival that lines carry (`t_recv_s`, else `t_s`), as when a recording is
    sent again faster than it was made. `oldest_s` is how old a stamp may be when it arrives, `clock_tolerance_s` how
    far ahead of its arrival. What waits longer than `most_wait_s`, or beyond `most_lines`, is dropped and counted.
    """

    format: str = "json"
    udp: str | None = None
    tcp: str | None = None
    serial: str | None = None
    listen: str | None = None
    baud: int = 9600
    arrival: Literal["clock", "recorded"] = "clock"
    oldest_s: float = 30.0
    clock_tolerance_s: float = 0.25
    most_lines: int = 50_000
    most_wait_s: float = 1.0


class TracksTable(TableModel, frozen=True):
    """`[output]`: where tracks go, as JSON lines; one that nobody reports is sent every `every_s`."""

    udp: str | tuple[str, ...] = ()
    tcp: str | tuple[str, ...] = ()
    every_s: float = 1.0


class TimesTable(TableModel, frozen=True):
    """`[log]`: how often it is written to the system and to the disk, and the state saved beside it."""

    flush_s: float = 0.2
    sync_s: float = 5.0
    state_s: float = 10.0


class SettingsTable(TrackerTable, frozen=True):
    """`[tracker]`: the keys of a tracker.toml's [tracker], or the file that has them."""

    config: str | None = None


class PointingTable(TableModel, frozen=True):
    """`[pointing]`: which track the pointer follows ("track:ID", "nearest", "strongest"), and with what."""

    follow: str
    beam: BeamTable = BeamTable()
    face: FaceTable = FaceTable()
    mount: MountTable = MountTable()
    output: OutputTable = OutputTable()
    stale_s: float = 5.0
    sigma_up_m: float = 10.0


class ServeTable(RecordingTable, frozen=True):
    """The whole file."""

    input: tuple[InputTable, ...] = ()
    output: TracksTable = TracksTable()
    log: TimesTable = TimesTable()
    tracker: SettingsTable = SettingsTable()
    pointing: PointingTable | None = None
    platform: tuple[PlatformTable, ...] = ()


class Service(NamedTuple):
    """A site file of `serve`, built."""

    file: ServeTable
    declaration: Declaration
    config: TrackerConfig
    stages: dict[str, Any]
    settings: str  # text of the tracker.toml that makes the same tracker
    text: str  # of the site file
    pointing: TrackerSite | None

    @property
    def recorded(self) -> bool:
        """Whether lines carry their own arrival."""
        return any(one.arrival == "recorded" for one in self.file.input)

    @property
    def logged(self) -> LogTable:
        """How lines become reports, as the log keeps it."""
        first = self.file.input[0] if self.file.input else InputTable()
        return LogTable(
            recorded_arrivals=self.recorded,
            oldest_s=first.oldest_s,
            clock_tolerance_s=first.clock_tolerance_s,
            platform=self.file.platform,
        )


def read_service(path: Path) -> Service:
    """Read SITE.toml of `serve`; raises UserError that names file and key."""
    return service_of(read_text(path), str(path), path.parent)


def service_of(text: str, where: str, folder: Path, settings: str | None = None) -> Service:
    """Build a service of the text of a site file; `settings` (of tracker.toml) replaces its [tracker]."""
    raw = toml_of(text, where)
    if isinstance(raw.get("input"), dict):
        raw["input"] = [raw["input"]]
    file = convert(raw, ServeTable, where)
    declared = declaration_of(file, where)
    for i, one in enumerate(file.input):
        _check_input(one, f"{where}: input[{i}]")
    if len({one.arrival for one in file.input}) > 1:
        raise UserError(f'{where}: input: arrival = "recorded" goes for all inputs or for none')
    ids = [s.id for s in declared.sensors]
    if settings is None:
        settings = _settings(file.tracker, folder)
    tables = toml_of(settings, f"{where}: [tracker]") if settings.strip() else {}
    stages = take_pipeline(tables, where)
    config = tracker_config_of(tables, f"{where}: [tracker]" if file.tracker.config is None else where, ids)
    pointing = None
    if file.pointing is not None:
        pointing = _pointing(file.pointing, declared, where)
    for key in ("flush_s", "sync_s", "state_s"):
        if not getattr(file.log, key) > 0.0:
            raise UserError(f"{where}: log.{key} must be above zero")
    return Service(file, declared, config, stages, settings, text, pointing)


def _settings(table: SettingsTable, folder: Path) -> str:
    """Return the text of the tracker.toml that a `[tracker]` table stands for."""
    given = {k: getattr(table, k) for k in TrackerTable.__struct_fields__ if getattr(table, k) is not None}
    if table.config is None:
        return write_toml({"tracker": given}) if given else ""
    if given:
        raise UserError(f'tracker: {", ".join(given)}: with config = "{table.config}" settings stand in that file')
    path = folder / table.config
    read_toml(path)
    return read_text(path)


def _check_input(one: InputTable, where: str) -> None:
    if one.format not in FORMATS:
        raise UserError(f"{where}: format = '{one.format}' is not known; give one of {', '.join(FORMATS)}")
    if not (one.oldest_s > 0.0 and one.clock_tolerance_s >= 0.0 and one.most_lines > 0 and one.most_wait_s > 0.0):
        raise UserError(f"{where}: oldest_s, most_lines and most_wait_s must be above zero")
    if one.listen is not None and not one.listen.startswith(("udp://", "tcp://")):
        raise UserError(f"{where}: listen = '{one.listen}'; give udp://host:port or tcp://host:port")
    if not (one.udp or one.tcp or one.serial or one.listen):
        raise UserError(f"{where}: give udp, tcp, serial or listen")


def _pointing(table: PointingTable, declared: Declaration, where: str) -> TrackerSite:
    follow = table.follow
    if follow not in ("nearest", "strongest") and not (
        follow.startswith("track:") and follow.removeprefix("track:").isdigit()
    ):
        raise UserError(f'{where}: pointing.follow = "{follow}"; give "track:ID", "nearest" or "strongest"')
    if not (table.beam.rate_hz > 0 and table.beam.width_deg > 0 and table.output.command_rate_hz > 0):
        raise UserError(f"{where}: pointing: beam.rate_hz, beam.width_deg and command_rate_hz must be above zero")
    mount = mount_of(table.mount)
    pointer = track_pointer(declared.site, table.beam, table.face, table.stale_s, mount.mask)
    return TrackerSite(pointer, mount, table.beam.rate_hz, follow, table.sigma_up_m, table.output)
