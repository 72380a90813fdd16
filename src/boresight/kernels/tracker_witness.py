"""What sensors bear witness to: that something is there in a track's direction, and which targets they report at all.

A bearing that errs slowly, as camera bearings do, tells of a target once: the next image repeats it. And what a camera
sees in a direction may be something else that stands there, in every image too. So each track keeps, for each such
sensor, two probabilities beside its hypotheses: that the sensor reports this target at all, and that, were the track
none, something else that the sensor reports would stand in its direction. A hundred images with a detection there then
speak for the track by one over the chance of that other thing, and a hundred without one speak against it by the share
of targets that the sensor passes over.
"""

from __future__ import annotations

import math

from numba import njit

from boresight.kernels.options import LEAF
from boresight.kernels.tracker import AZIMUTH_BINS, HIDDEN, STATIC, VISIBLE, IntArray, SensorTable, Tracks
from boresight.kernels.tracker_weigh import weigh
from boresight.types.sensor import FloatArray

MEMORY = 30.0  # s, time constant with which what was learned of either is forgotten
PASSING = 0.05  # probability of a detection in the gate of a track where nothing that lasts stands
LEAST_CHANCE = 0.01  # that something else stands there, where no false detection was ever seen
UNKNOWN = -1.0  # the sensor has not looked yet
REPORTS, ELSE = 0, 1  # columns of `Tracks.witness`


@njit(**LEAF)
def in_view(tr: Tracks, i: int, sensor: SensorTable, p_d: float) -> float:
    """Probability that track `i` is something that this sensor sees; `p_d` of its detection where it stands."""
    w = tr.weight[i]
    return float((w[VISIBLE] + w[HIDDEN] + sensor.sees_static * w[STATIC]) * p_d / sensor.p_detection)


@njit(**LEAF)
def presence(
    first: int, end: int, column: IntArray, claims: IntArray, rivals: FloatArray, credible: bool, own: float
) -> tuple[int, float]:
    """Return whether a look has a detection in a track's gate (edges `first` to `end`) that no other could claim.

    1 if so, 0 if it has none at all, -1 where all are another credible track's too. With it comes how much of that
    detection the doubtful tracks claim: `rivals` (m,) holds what all do, `own` is what this one does.
    """
    found = -1 if end > first else 0
    least = 1.0
    for e in range(first, end):
        if claims[column[e]] <= int(credible):
            found = 1
            least = min(least, max(rivals[column[e]] - own, 0.0))
    return found, least


@njit(**LEAF)
def recalled(value: float, prior: float, elapsed: float) -> float:
    """Return a probability `elapsed` (s) after it was `value` (UNKNOWN: never), on its way back to what it was."""
    if value < 0.0:
        return prior
    return value + (prior - value) * (1.0 - math.exp(-elapsed / MEMORY))


@njit(**LEAF)
def recall(tr: Tracks, sensor: SensorTable, elapsed: float) -> float:
    """Let all tracks forget some of what they know of a sensor that last looked `elapsed` (s) ago.

    Returns the probability that, by chance, something else stands in a track's direction.
    """
    by_chance = chance(tr, sensor)
    if sensor.witness >= 0:
        for i in range(tr.live[0]):
            kept = tr.witness[i, sensor.witness]
            kept[REPORTS] = recalled(kept[REPORTS], sensor.sees_targets, elapsed)
            kept[ELSE] = recalled(kept[ELSE], by_chance, elapsed)
    return float(by_chance)


@njit(**LEAF)
def reports(tr: Tracks, i: int, sensor: SensorTable) -> float:
    """Return the probability that a sensor reports track `i` at all."""
    return float(tr.witness[i, sensor.witness, REPORTS]) if sensor.witness >= 0 else 1.0


@njit(**LEAF)
def learn_reports(tr: Tracks, i: int, sensor: SensorTable, log_visible: float, temper: float) -> None:
    """Condition that probability a on a look of log-likelihood `log_visible` = log(1 - a + a L), L where it reports.

    `temper` is how much of the look is new, 0 to 1.
    """
    if sensor.witness >= 0:
        kept = tr.witness[i, sensor.witness]
        a = kept[REPORTS]
        if a > 0.0:
            seen = max((math.exp(log_visible) - 1.0) / a + 1.0, 0.0)
            kept[REPORTS] = share_of(a * seen**temper, 1.0 - a)


@njit(**LEAF)
def chance(tr: Tracks, sensor: SensorTable) -> float:
    """Probability that something that is no track stands in the gate of one, as false detections are dense."""
    expected = tr.clutter[sensor.number, AZIMUTH_BINS] * sensor.gate_width / max(sensor.azimuth_span, 1e-9)
    return max(1.0 - math.exp(-expected), LEAST_CHANCE)


@njit(**LEAF)
def corroborate(
    tr: Tracks, i: int, sensor: SensorTable, p_d: float, there: bool, rival: float, temper: float, by_chance: float
) -> None:
    """Weigh track `i` by whether a sensor that only confirms has a detection in its gate (`there`).

    Args:
        tr: the tracks, as all arguments of their names.
        i: the track.
        sensor: the sensor.
        p_d: probability that it reports the track in this look, where it reports it at all and nothing else is there.
        there: what it shows.
        rival: how much of what it shows other tracks claim, 0 to 1.
        temper: how much of the look is new, 0 to 1: likelihoods to this power.
        by_chance: probability that something else stands in a track's direction where nothing is known of it.
    """
    kept = tr.witness[i, sensor.witness]
    a, u = kept[REPORTS], kept[ELSE]
    # the probabilities that something is seen if the track is none and something else stands there, or not; and if it
    # is a target that the sensor reports: then what was seen so far was its own, and taught nothing of anything else
    left = 1.0 - rival * sensor.p_detection if there else 1.0
    stands, passing = 1.0 - (1.0 - sensor.p_detection) * left, 1.0 - (1.0 - PASSING) * left
    seen = 1.0 - (1.0 - p_d) * (1.0 - by_chance * stands - (1.0 - by_chance) * passing)
    if not there:
        stands, passing, seen = 1.0 - stands, 1.0 - passing, 1.0 - seen
    stands, passing, seen = stands**temper, passing**temper, seen**temper
    empty = u * stands + (1.0 - u) * passing
    target = a * seen + (1.0 - a) * empty
    still = sensor.sees_static * target + (1.0 - sensor.sees_static) * empty
    weigh(tr, i, math.log(target / empty), math.log(still / empty), 1.0)
    kept[REPORTS] = share_of(a * seen, (1.0 - a) * empty)
    kept[ELSE] = share_of(u * stands, (1.0 - u) * passing)


@njit(**LEAF)
def share_of(one: float, other: float) -> float:
    """Return what `one` is of both, 0 of nothing."""
    return one / (one + other) if one > 0.0 else 0.0
