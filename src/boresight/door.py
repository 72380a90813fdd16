"""The library's door: a recording to tracks in one call, and a tracker for a loop of one's own."""

from __future__ import annotations

import math
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from boresight._version import __version__
from boresight.config.stages import make_pipeline
from boresight.config.tracker import parameters_of
from boresight.engine.defaults import defaults_for
from boresight.engine.loop import run
from boresight.engine.pipeline import Pipeline, with_notes
from boresight.engine.portions import MOST_LOOKS, Portions
from boresight.engine.track import Collected, Tracking, TrackOutput
from boresight.errors import UserError, did_you_mean
from boresight.io.declaration import SensorTable, sensor_of
from boresight.io.jsonlines import LookDecoder, Measured, Refused
from boresight.io.recording import read_recording
from boresight.io.scans import iter_scans
from boresight.metrics.losses import losses
from boresight.tracking import tracker as core
from boresight.tracking.config import TrackerConfig
from boresight.tracking.output import Rows
from boresight.tracking.registration import Diary
from boresight.tracking.run import decision_rows, track_rows, tracker_for
from boresight.tracking.warm import warm_poses, warm_tracker
from boresight.types import FATES, DecisionRows, FloatArray, Recording, Results, Scan, Sensor, Site

__all__ = ["Prepared", "Track", "Tracker", "defaults_for", "prepare", "read_recording", "sensor", "track"]


def track(
    recording: Recording,
    config: TrackerConfig | None = None,
    *,
    sensors: Sequence[str] | None = None,
    stages: Mapping[str, Any] | None = None,
    progress: Callable[[Scan], None] | None = None,
) -> Results:
    """Track the targets of a recording in memory: what `boresight track` does, without files.

    Args:
        recording: as `read_recording` gives it.
        config: settings of the tracker, in SI and radians; None takes what `defaults_for` makes of the recording.
        sensors: ids of the sensors to use (all).
        stages: the pipeline before the tracker, as `config.pipeline.take_pipeline` gives it (none).
        progress: called with every look that was taken.

    Returns tracks, decisions and a summary; `results.tracks.to_arrow()`, `results.tracks.to_pandas()` are the tables
    of tracks.parquet and decisions.parquet. Raises UserError for an unknown sensor, or stages that do not fit.
    """
    return prepare(recording, config or defaults_for(recording, sensors)[0], sensors, stages).run(progress)


def prepare(
    recording: Recording,
    config: TrackerConfig,
    sensors: Sequence[str] | None = None,
    stages: Mapping[str, Any] | None = None,
    where: str = "",
) -> Prepared:
    """Check everything and load (or compile) the kernels; `where` names the file of the stages in errors."""
    tracker = tracker_for(recording, config, sensors)
    before = make_pipeline(stages or {}, recording, tracker.poses, tracker.used, where)  # mistakes before compiling
    scans = list(iter_scans(recording, sensors))
    warm_poses(tracker, scans)
    warm_tracker(tracker)
    return Prepared(recording, tracker, before, scans, dict(stages or {}))


@dataclass(frozen=True, slots=True, eq=False)
class Prepared:
    """A recording and a tracker whose kernels are loaded."""

    recording: Recording
    tracker: core.Tracker
    pipeline: Pipeline
    scans: list[Scan]
    stages: dict[str, Any]

    def run(self, progress: Callable[[Scan], None] | None = None) -> Results:
        """Track; `progress` is called with every look that was taken."""
        recording, tracker, config = self.recording, self.tracker, self.tracker.config
        started = time.perf_counter()
        registers = tracker.plan.settings.n_constant > 0
        kept, diary = Collected(), Diary(tracker)
        noted = [_Noted(diary)] if registers else []
        each = config.smoothing_lag is not None or registers
        source = Portions(self.scans, 1 if each else MOST_LOOKS, progress)
        state = run(source, Tracking(tracker, self.pipeline), [kept, *noted]).tracker
        seconds = time.perf_counter() - started
        tracks = track_rows(kept.rows)
        fates = decision_rows(recording, tracker, kept.decisions, state.names)
        if self.pipeline.stages:
            fates = with_notes(fates, kept.notes)
        summary: dict[str, Any] = {
            "version": __version__,
            "sensors": [recording.sensors[i].id for i in tracker.used],
            "counts": {
                "reports": len(recording.detections),
                "scans": len(self.scans),
                "tracks": state.names.given,
                "rows": len(tracks),
                "fates": counted(fates),
            },
            "seconds": seconds,
            "lost": losses(recording, fates),
            "notes": list(recording.notes),
            "t_first_s": recording.span[0],
            "t_last_s": recording.span[1],
            "window_s": tracker.length,
            "parameters": parameters_of(config) | ({"pipeline": pipeline_of(self.stages)} if self.stages else {}),
            "versions": versions(),
        }
        if words := tracker.cannot_begin():
            summary["warnings"] = [words]
        past = track_rows(kept.smoothed) if config.smoothing_lag is not None else None
        if not registers:
            return Results(tracks, fates, summary, past)
        diary.note(state, last=True)
        summary["registration"] = [c._asdict() for c in diary.known[-1]]
        return Results(tracks, fates, summary, past, diary.rows())


@dataclass(frozen=True, slots=True)
class _Noted:
    """A sink that keeps what is known of the sensors' constant errors."""

    diary: Diary

    def take(self, output: TrackOutput) -> None:
        self.diary.note(output.state)


def counted(rows: DecisionRows) -> dict[str, int]:
    """Return how many rows had each fate."""
    found = Counter(rows.fate.tolist())
    return {str(FATES[code]): n for code, n in sorted(found.items())}


def pipeline_of(stages: Mapping[str, Any]) -> dict[str, Any]:
    """Return the pipeline as a summary shows it: kinds and options, and whether values share reports."""
    return {**stages, "values_correlated": "smooth" in stages}


def versions() -> dict[str, str]:
    """Return the versions of Python and of what the numbers depend on."""
    import numba
    import scipy

    python = ".".join(str(v) for v in sys.version_info[:3])
    return {
        "boresight": __version__,
        "python": python,
        "numpy": np.__version__,
        "scipy": scipy.__version__,
        "numba": numba.__version__,
    }


def sensor(id: str, kind: str, **declared: Any) -> Sensor:
    """Declare a sensor with the keys of a `[[sensor]]` table: `sigma_range_m`, `sigma_azimuth_deg`, `p_detection`, …

    Units are in the names. Raises UserError for an unknown key, or a value that cannot be.
    """
    from boresight.io.toml import convert

    return sensor_of(convert({"id": id, "kind": kind, **declared}, SensorTable, "sensor()"), "sensor()")


class Track(NamedTuple):
    """One track at one time: site ENU, m and m/s, the covariance of the position in m²; two dimensions or three."""

    id: int
    t: float  # s
    coasting: bool
    position: FloatArray  # (d,) m
    velocity: FloatArray  # (d,) m/s
    covariance: FloatArray  # (d, d) m²


@dataclass(slots=True)
class Tracker:
    """A tracker for a loop of one's own: give it every look as it comes, ask it for the tracks.

    Args:
        sensors: as `boresight.sensor` declares them; fixed at the site.
        dimensions: 2 or 3.
        config: settings; None takes the defaults.
        site_latitude_deg, site_longitude_deg, site_height_m: needed only for looks with latitude and longitude.

    Looks go in by order of arrival. `take` refuses what cannot be, by name and before anything changes (UserError).
    """

    sensors: Sequence[Sensor]
    dimensions: int = 2
    config: TrackerConfig | None = None
    site_latitude_deg: float = 0.0
    site_longitude_deg: float = 0.0
    site_height_m: float = 0.0
    _core: core.Tracker = field(init=False, repr=False)
    _state: core.TrackerState = field(init=False, repr=False)
    _decoder: LookDecoder = field(init=False, repr=False)
    _arrival: float = field(default=-math.inf, repr=False)
    _rows: list[Rows] = field(default_factory=list, repr=False)

    def __post_init__(self) -> None:
        if self.dimensions not in (2, 3):
            raise UserError(f"Tracker: dimensions = {self.dimensions}; give 2 or 3")
        if not self.sensors or not all(isinstance(s, Sensor) for s in self.sensors):
            raise UserError("Tracker: give sensors = [boresight.sensor(…), …]")
        ids = [s.id for s in self.sensors]
        for name in ids:
            if ids.count(name) > 1:
                raise UserError(f"Tracker: sensor id '{name}' stands twice; give each sensor its own id")
        riding = [s.id for s in self.sensors if s.platform is not None]
        if riding:
            raise UserError(f"Tracker: sensor '{riding[0]}' rides on a platform; track a recording, or use serve")
        site = Site(math.radians(self.site_latitude_deg), math.radians(self.site_longitude_deg), self.site_height_m)
        self._core = core.Tracker(
            self.config or TrackerConfig(), tuple(self.sensors), self.dimensions, site_height=self.site_height_m
        )
        self._state = self._core.init()
        self._decoder = LookDecoder(tuple(self.sensors), site, self.dimensions)

    def take(self, sensor: str, t_s: float, *, t_recv_s: float | None = None, **columns: ArrayLike) -> None:
        """Take one look of a sensor; without columns it saw nothing.

        Args:
            sensor: its id.
            t_s: time of validity (s).
            t_recv_s: time of arrival (s), not before that of the look before; None takes the later of the two.
            columns: `range_m`, `azimuth_deg`, `elevation_deg`, `range_rate_m_s`, `x_m`, `y_m`, `z_m`, `latitude_deg`,
                `longitude_deg`, `height_m`, `t_s_each`, `sigma_range_m`, …: one number for each detection, NaN where it
                was not measured.

        Raises UserError for an unknown sensor or column, columns of different lengths, numbers that cannot be, and
        arrivals that go back.
        """
        index = {s.id: i for i, s in enumerate(self.sensors)}
        if sensor not in index:
            raise UserError(f"take: unknown sensor '{sensor}'{did_you_mean(sensor, index)}")
        arrival = max(float(t_s), self._arrival) if t_recv_s is None else float(t_recv_s)
        if not (abs(arrival) < 1e12 and abs(float(t_s)) < 1e12):
            raise UserError(f"take: t_s = {t_s}, t_recv_s = {t_recv_s}: not times in seconds")
        if arrival < self._arrival:
            raise UserError(f"take: t_recv_s = {arrival} is before {self._arrival}, that of the look before")
        try:
            scan = self._decoder.look(index[sensor], float(t_s), _measured(columns), arrival)
        except Refused as error:
            raise UserError(f"take: sensor '{sensor}': {error}") from None
        self._decoder.duplicates.clear()
        self._decoder.ids.clear()
        self._arrival = arrival
        if scan is not None:
            self._state, out = self._core.step(self._state, scan)
            self._keep(out.rows)

    def tracks(self, t_s: float | None = None) -> list[Track]:
        """Return the tracks that are shown, as they were known at `t_s` (s, not before the newest look; None: then)."""
        t = self._arrival if t_s is None else float(t_s)
        if not t >= self._arrival:
            raise UserError(f"tracks: t_s = {t} is before the newest look, at {self._arrival}")
        if not math.isfinite(t):
            return []
        self._keep(self._core.due(self._state, math.nextafter(t, math.inf)).rows)
        newest: dict[int, Track] = {}
        for rows in self._rows:
            for i in np.flatnonzero(rows.t <= t):
                one = int(rows.track_id[i])
                newest[one] = Track(
                    one, float(rows.t[i]), bool(rows.coasting[i]), rows.position[i], rows.velocity[i],
                    rows.covariance[i],
                )  # fmt: skip
        return [one for one in newest.values() if one.t > t - 1.0]

    def _keep(self, rows: Iterable[Rows]) -> None:
        self._rows += rows
        while len(self._rows) > 1 and self._rows[0].t[-1] < self._arrival - 2.0:
            self._rows.pop(0)


def _measured(columns: Mapping[str, ArrayLike]) -> list[Measured]:
    """Turn columns into detections; raises UserError."""
    names = set(Measured.__struct_fields__) - {"t_s", "covariance", "attributes"} | {"t_s_each"}
    out: dict[str, list[Any]] = {}
    for name, values in columns.items():
        if name not in names:
            raise UserError(f"take: unknown column '{name}'{did_you_mean(name, names)}")
        if name == "source_id":
            out[name] = [values] if isinstance(values, str) else list(values)  # type: ignore[arg-type]
            continue
        try:
            array = np.atleast_1d(np.asarray(values, dtype=np.float64))
        except (TypeError, ValueError):
            raise UserError(f"take: {name} is not a column of numbers") from None
        if array.ndim != 1:
            raise UserError(f"take: {name} has shape {array.shape}; give one number for each detection")
        if np.isinf(array).any():
            raise UserError(f"take: {name} holds an infinite number; NaN says that it was not measured")
        out["t_s" if name == "t_s_each" else name] = [None if math.isnan(v) else v for v in array.tolist()]
    lengths = {name: len(values) for name, values in out.items()}
    if len(set(lengths.values())) > 1:
        raise UserError(f"take: columns of different lengths: {', '.join(f'{k} {n}' for k, n in lengths.items())}")
    n = next(iter(lengths.values()), 0)
    return [Measured(**{name: values[i] for name, values in out.items()}) for i in range(n)]
