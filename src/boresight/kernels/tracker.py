"""What the tracker's kernels work on: tracks, one look, sensors and settings as arrays and numbers.

A track is a row of the arrays in `Tracks`. Its state is position (d), velocity (d), one Gauss–Markov bias for each
component of each sensor whose errors are declared to be coloured, then the sensors' constant errors that are to be
learned. Where manoeuvres are followed, each of two levels of process noise has such a state of its own too. Beside it
stand four weights, the probabilities that the track is (0) a target that the sensors can see, (1) a
target hidden from them, (2) an object that does not move, (3) nothing at all.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from boresight.types.sensor import FloatArray

IntArray = NDArray[np.int64]
# of constant errors, shared detections, second bearings: None leaves what few recordings need out of the compiled code,
# which takes half as long then
Extras = bool | None
PerModel = Any  # FloatArray; None where targets move by one model, which leaves it out of the compiled code

VISIBLE, HIDDEN, STATIC, NOTHING = 0, 1, 2, 3
# codes of what became of a detection
UNASSOCIATED, UPDATED, INITIATED, OUTSIDE, GATED = 0, 1, 2, 3, 4
AZIMUTH_BINS = 120
NO_ADDRESS = -1
LAST, INTERVAL, ADDRESS, VOTES = 0, 1, 2, 3  # columns of `Tracks.spoken`
SPACING, EVERY, PASSED, MESSAGES = 0, 1, 2, 3  # columns of `Tracks.pace`


class Tracks(NamedTuple):
    """All live tracks, structure of arrays; the first `live[0]` rows are in use."""

    live: IntArray  # (2,) live tracks; scans so far
    time: FloatArray  # (1,) s, the one time to which all tracks are predicted
    birth: IntArray  # (cap,) row of the detection that began the track: its lasting name
    x: FloatArray  # (cap, n)
    P: FloatArray  # (cap, n, n)
    weight: FloatArray  # (cap, 4) probabilities of the four hypotheses
    anchor: FloatArray  # (cap, 3) the position of the object if it does not move, m
    anchor_P: FloatArray  # (cap, 3, 3)
    life: FloatArray  # (cap, 4) time of birth, time of last hit, shown (0 or 1), hits
    last_look: FloatArray  # (n_sensors, 4) its time, s, and where the sensor stood, m
    clutter: FloatArray  # (n_sensors, AZIMUTH_BINS + 1) mean false detections of a look, per azimuth bin and in all
    heard: IntArray  # (cap,) bit i set: sensor i has moved the track
    beside: IntArray  # (cap,) birth of the track beside which bearings began this one; its anchor is relative to that
    told: FloatArray  # (cap, k, k + 1) what a track was told of the k constant sensor errors: information, vector
    bank: FloatArray  # (k, k + 1) what ended tracks had learned of them
    undetected: FloatArray  # (1,) expected number of targets that no track follows yet
    seen_range: FloatArray  # (n_sensors,) m, longest range so far (stands in for a coverage without end)
    witness: FloatArray  # (cap, w, 2) by w sensors, probabilities, -1 before its first look: it reports this
    # target at all; were the track nothing, something else would stand in its direction
    spoken: FloatArray  # (cap, u, 4) of u sensors that give addresses or report one target a message: time of the last
    # message (s), mean time between two (s, 0: unknown), address (NO_ADDRESS: none yet), how many more had it than not
    pace: FloatArray  # (n_sensors, 4) of such sensors: mean time between two messages, and between two of one target
    # (s, 0: unknown); the time and the messages in the former
    mode: PerModel = None  # (cap, M) probabilities of the components of a target's state, 0: not in use. Component
    # h J + j is that of height h and motion j of J; and
    mode_x: PerModel = None  # (cap, M, n) their states, of which x and P are the moments
    mode_P: PerModel = None  # (cap, M, n, n)


class Look(NamedTuple):
    """One scan, ready for the kernel; poses are those of the sensor at each detection's own time."""

    t: float  # s, validity of the look
    dt: FloatArray  # (m,) own time of each detection minus t
    z: FloatArray  # (m, 7)
    R: FloatArray  # (m, 7, 7)
    row: IntArray  # (m,)
    address: IntArray  # (m,) code of the `source_id`, NO_ADDRESS where there is none
    sensor_position: FloatArray  # (m + 1, 3), the last for the look itself
    sensor_velocity: FloatArray  # (m + 1, 3)
    enu_from_sensor: FloatArray  # (m + 1, 3, 3)


class SensorTable(NamedTuple):
    """What the kernel knows of the sensor that looked."""

    number: int  # its place among the recording's sensors
    p_detection: float
    clutter_per_scan: float
    range_low: float
    range_high: float
    azimuth_low: float
    azimuth_span: float
    elevation_low: float
    elevation_high: float
    ranging: bool  # can begin tracks
    bias: IntArray  # (7,) state index of the bias of each component, -1 for none
    registers: bool  # has constant errors among the states
    constant: IntArray  # (5,) state index of time offset, range, scale, azimuth and elevation error, -1 for none
    decorrelation: float  # s: looks closer in time than this are not independent evidence of existence
    fade_range: float  # m: where p_detection has fallen to half
    resolution: float  # m: nearer targets may give one detection together
    moves_tracks: bool  # False: its detections are evidence that a track exists, but do not move it
    sees_static: float  # detection probability of an object that does not move, as a share of a target's
    sees_targets: float  # share of targets that the sensor reports at all
    witness: int  # its place in `Tracks.witness`, -1 for none
    gate_width: float  # rad, azimuth that the gate of a track covers whose place is known
    joint: bool  # tracks share its detections (JPDA) instead of taking one each
    single: bool  # a look is a message of one target and says nothing of others
    interval: float  # s, declared mean time between two messages of one target; 0: not declared
    spoken: int  # its place in `Tracks.spoken`, -1 for none
    wrong_id: float  # probability that an address is not the target's own
    height: float  # m above the ellipsoid, prior mean of what a target's height is where it is not measured, and
    height_sigma: float  # m, its standard deviation; 0: anything that the elevation coverage allows


class Settings(NamedTuple):
    """Everything else that a scan needs to know."""

    d: int  # dimensions, 2 or 3
    q: float  # m²/s³
    gates: FloatArray  # (8,) chi-square gate by number of components
    speed_sigma: float  # m/s, prior of a new track
    birth_rate: float  # new targets a look
    survival_time: float  # s
    hide_time: float  # s, mean time visible
    show_time: float  # s, mean time hidden
    static_share: float  # of a new track's existence
    static_q: float  # m²/s
    stop_floor: float  # least weight of "it does not move": a target may stop
    rest_time: float  # s, mean time for which what does not move stays so
    start_speed: float  # m/s, of what stood and sets off, per axis
    targets_at_start: float  # expected number of targets before the first look
    doubt: float  # least existence with which a track competes for detections
    delete_below: float
    show_above: float
    hide_below: float
    bias_sigma: FloatArray  # (n - 2d,)
    bias_tau: FloatArray  # (n - 2d,), infinite for the constant errors, which come last
    n_constant: int  # states that are constant errors of sensors
    report_range: FloatArray  # (n_sensors,) m: targets farther from all sensors are tracked but not shown
    merge_distance: float
    apart: float  # m: a track nearer than this to a shown one is not shown beside it
    lonely_bearings: bool  # bearings update only where nobody else could claim them
    clutter_memory: float  # looks
    blob: float  # m, the largest resolution of the ranging sensors in use
    blob_share: float  # probability that a second bearing beside a shown track is a second target in its blob
    hide_after: float  # s without a hit after which a track is shown no more
    climb_sigma: float  # m/s, prior vertical velocity of a new track whose height was not measured
    site_height: float  # m, of the site above the ellipsoid
    extent: float  # m, per axis: from the point of a target that is reported to the one that is meant; in rows


class Models(NamedTuple):
    """Of how many components a target's state is the mixture: motions (quiet, manoeuvring) by heights.

    None in its place, where one of each will do, leaves it out of the compiled code.
    """

    q: float  # m²/s³, process noise during a manoeuvre (`Settings.q`: between them)
    every: float  # s, mean time from one's end to the next
    lasts: float  # s, mean time it lasts
    motions: int = 2  # 1: nothing manoeuvres
    heights: int = 1  # at most, along the arc on which a range and an azimuth leave a target
