"""What can be chosen of the tracker. SI and radians."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from boresight.errors import UserError, did_you_mean

ASSOCIATIONS = ("nearest", "jpda")
# what values may be; None is left out
POSITIVE = ("survival_time", "hide_time", "show_time", "speed_sigma", "climb_sigma", "rest_time", "hide_after")
TIMES = ("manoeuvre_every", "manoeuvre_lasts")
SHARES = ("static_share", "stop_floor", "doubt", "delete_below", "blob_share")
NOT_NEGATIVE = (
    "q", "birth_rate", "static_q", "targets_at_start", "apart", "merge_distance", "coast_after", "smoothing_lag",
    "window", "start_speed",
)  # fmt: skip
SPREADS = (  # of a sensor
    "bias_range", "bias_azimuth", "bias_elevation", "bias_position", "offset_time", "offset_range", "offset_scale",
    "offset_azimuth", "offset_elevation", "decorrelation", "resolution",
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class SensorErrors:
    """What a sensor's errors are beyond the white noise that the recording declares.

    A bias that wanders slowly, separately for each target, is a first-order Gauss–Markov process with standard
    deviation `bias_…` and correlation time `bias_time`; 0 leaves it out.
    """

    bias_range: float = 0.0  # m
    bias_azimuth: float = 0.0  # rad
    bias_elevation: float = 0.0  # rad
    bias_position: float = 0.0  # m, per axis
    bias_time: float = 20.0  # s
    offset_time: float = 0.0  # s: standard deviations of constant errors, estimated on line (0: taken as exact)
    offset_range: float = 0.0  # m
    offset_scale: float = 0.0  # of range, 1
    offset_azimuth: float = 0.0  # rad
    offset_elevation: float = 0.0  # rad
    decorrelation: float = 0.0  # s: looks closer in time are not independent evidence that a target exists
    fade_range: float = float("inf")  # m: where the detection probability has fallen to half
    resolution: float = 0.0  # m: targets nearer to each other may give one detection together (ranging sensors)
    moves_tracks: bool = True  # False: its detections are evidence that a track exists, but do not move it
    sees_static: float = 1.0  # detection probability of objects that do not move, as a share of that of targets
    sees_targets: float = 1.0  # share of targets that this sensor reports at all
    association: str | None = None  # "nearest" or "jpda" for this sensor's detections (None: as the tracker's)
    report_range: float = float("inf")  # m: targets farther from all ranging sensors are not shown


@dataclass(frozen=True, slots=True)
class TrackerConfig:
    """Settings of the multi-target tracker; None takes the value that fits the recording's dimensions.

    Raises:
        UserError: a value outside its range, named by its key.
    """

    q: float | None = None  # m²/s³, white-acceleration power spectral density (2-D: 0.1, 3-D: 1)
    q_manoeuvre: float | None = None  # m²/s³, the same during a manoeuvre: targets move by two models (None: by one)
    manoeuvre_every: float | None = None  # s, mean time from the end of a manoeuvre to the next (60)
    manoeuvre_lasts: float | None = None  # s, mean time that one lasts (10)
    speed_sigma: float | None = None  # m/s, prior velocity of a new track per axis (2-D: 8, 3-D: 150)
    climb_sigma: float | None = None  # m/s, the same vertically where height is not measured (a tenth of speed_sigma)
    gate_probability: float = 0.999
    association: str = "nearest"  # or "jpda": tracks share the detections in their gates instead of taking one each
    birth_rate: float = 0.01  # new targets a look
    survival_time: float = 120.0  # s
    hide_time: float = 120.0  # s, mean time for which a target stays visible
    show_time: float = 10.0  # s, mean time for which it stays hidden
    static_share: float = 0.3  # of new objects do not move (and are not reported)
    static_q: float = 0.05  # m²/s, how an object that does not move may still wander
    stop_floor: float = 0.02  # least weight of "it stands still" beside that of a moving target
    rest_time: float = 300.0  # s, mean time for which what stands stays so, until it sets off (inf: for ever)
    start_speed: float | None = None  # m/s, per axis, at about which it does (None: a quarter of speed_sigma)
    targets_at_start: float = 5.0  # expected number of targets before the first look
    apart: float = 0.0  # m: a track nearer than this to a shown one is not shown beside it
    doubt: float = 0.1  # least probability of existence with which a track competes for detections
    confirm_above: float = 0.9  # probability of a moving target above which a track is shown
    hide_below: float = 0.4  # and below which it is shown no more
    delete_below: float = 1e-4
    merge_distance: float | None = None  # m (2-D: 10, 3-D: 30)
    lonely_bearings: bool = True  # bearings update only where nobody else could claim them
    blob_share: float = 0.0  # probability that a second bearing beside a shown track is a target in the same blob
    clutter_memory: float = 30.0  # looks
    extent: float = 0.0  # m, per axis: how far the point of a target that is reported lies from the one that is meant
    coast_after: float = 4.0  # s without a hit after which a shown track counts as coasting
    hide_after: float = math.inf  # s without a hit after which it is shown no more, however probable
    smoothing_lag: float | None = None  # s: also give the tracks of so long ago, smoothed with all that came since
    window: float | None = (
        None  # s, how late a report may be (None: spread of the declared latencies + half the longest period + 1 s)
    )
    sensors: dict[str, SensorErrors] = field(default_factory=dict)  # by sensor id

    def __post_init__(self) -> None:
        _check(self, "tracker", POSITIVE, lambda v: v > 0.0, "must be positive")
        _check(self, "tracker", SHARES, lambda v: 0.0 <= v <= 1.0, "must lie in [0, 1]")
        _check(self, "tracker", NOT_NEGATIVE, lambda v: v >= 0.0, "must not be negative")
        _check(self, "tracker", ("clutter_memory",), lambda v: v >= 1.0, "must be 1 or more")
        _check(self, "tracker", ("extent",), lambda v: 0.0 <= v < math.inf, "must be finite and not negative")
        _check(self, "tracker", TIMES, lambda v: 0.0 < v < math.inf, "must be positive and finite")
        if not 0.5 <= self.gate_probability < 1.0:
            raise UserError("tracker: gate_probability must lie in [0.5, 1)")
        if not 0.0 <= self.hide_below <= self.confirm_above <= 1.0:
            raise UserError("tracker: need 0 <= hide_below <= confirm_above <= 1")
        if self.q_manoeuvre is None:
            for name in ("manoeuvre_every", "manoeuvre_lasts"):
                if getattr(self, name) is not None:
                    raise UserError(f"tracker: {name} says nothing without q_manoeuvre; give that too")
        _check_association(self.association, "tracker")
        for sensor, errors in self.sensors.items():
            where = f"sensor['{sensor}']"
            _check(errors, where, ("bias_time", "fade_range"), lambda v: v > 0.0, "must be positive")
            _check(errors, where, SPREADS, lambda v: 0.0 <= v < math.inf, "must be finite and not negative")
            _check(errors, where, ("sees_static", "sees_targets"), lambda v: 0.0 <= v <= 1.0, "must lie in [0, 1]")
            if errors.association is not None:
                _check_association(errors.association, where)


def _check(item: object, where: str, names: Sequence[str], fits: Callable[[float], bool], rule: str) -> None:
    for name in names:
        value = getattr(item, name)
        if value is not None and not fits(value):
            raise UserError(f"{where}: {name} {rule}, not {value:g}")


def _check_association(word: str, where: str) -> None:
    if word not in ASSOCIATIONS:
        known = "', '".join(ASSOCIATIONS)
        raise UserError(f"{where}: association is '{known}', not '{word}'{did_you_mean(word, ASSOCIATIONS)}")
