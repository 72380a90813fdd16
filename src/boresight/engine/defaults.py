"""Settings for a recording that comes without any: from what its sensors declare, and from its own first part.

The declared noise and the rates say how far two fixes of one target may lie apart; how fast targets are and how they
manoeuvre, the innovations say. A few trackers, each for targets of another speed, run over the first part of the
recording; the one that makes most of the reports into the fewest tracks tells the speed. Along its tracks the process
noise is the one under which the innovations are most probable, as `boresight tune` has it; where some stretches
want much more of it than most, targets move by two models.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from boresight.engine.track import run
from boresight.io.scans import iter_scans, selected
from boresight.tracking.config import TrackerConfig
from boresight.tracking.run import decision_rows, track_rows, tracker_for
from boresight.tracking.tuning import Thread, likelihoods, threads
from boresight.types import (
    FATES,
    NO_TRACK,
    Component,
    DecisionRows,
    Fate,
    FloatArray,
    Recording,
    Reporting,
    Scan,
    Sensor,
)

SURE = 0.1  # probability of a moving target below which one that reports itself is hidden
FIRST_REPORTS, FIRST_LOOKS = 6000, 4000  # at most, that the settings are made from
SPEEDS = (1.5, 8.0, 40.0, 150.0, 600.0)  # m/s per axis: pedestrians, boats, cars, aircraft, missiles
TURN_TIME = 15.0  # s in which a target may change its speed by as much as that, as a first guess
FRAGMENT = 5.0  # reports that a track more must explain, to be worth it
FASTER = 0.02  # share of the reports that faster targets must explain more, to be believed
NOISES = np.exp(np.linspace(math.log(1e-4), math.log(1e5), 22))  # m²/s³
STRETCH = 8  # reports over which a target is taken to move in one way
FEW_STRETCHES = 12
MANOEUVRING = 20.0  # times the quiet process noise, from which on two models are worth their time
BAND = (0.5, 2.0)  # mean NIS per component that the declared noise may be said to explain
ENOUGH = 100  # components of NIS to say otherwise


def defaults_for(recording: Recording, sensors: Sequence[str] | None = None) -> tuple[TrackerConfig, list[str]]:
    """Return settings for a recording that has none, and lines that say what was chosen and from what.

    Args:
        recording: any; where no sensor gives positions, or nothing is tracked in its first part, what the sensors
            declare decides alone.
        sensors: the ids of those to use (all).
    """
    used = [recording.sensors[i] for i in selected(recording, sensors).tolist()]
    scans = _first_part(recording, sensors)
    spread = _spread(recording, scans, used)
    base = declared(used, spread, recording.dimensions)
    if not scans or spread is None:
        return base, ["settings: as declared by the sensors; no position in the first part to learn more from"]
    best: tuple[float, TrackerConfig, DecisionRows, float] | None = None
    for speed in SPEEDS:
        config = with_speed(base, speed, recording.dimensions)
        value, decisions, moved = _explained(recording, scans, config, sensors)
        if best is None or value > best[0] + FASTER * abs(best[0]):
            best = value, config, decisions, moved
    assert best is not None
    value, config, decisions, moved = best
    if value <= 0.0:
        return base, ["settings: as declared by the sensors; nothing that moves in the first part to learn more from"]
    span = scans[-1].t_recv - scans[0].t_recv
    lines = []
    found = _threads(recording, decisions, config, sensors)
    if found:
        for _ in range(2):
            config = replace(learned(config, found, recording.dimensions), speed_sigma=max(moved, SPEEDS[0]))
            value, decisions, moved = _explained(recording, scans, config, sensors)
            found = _threads(recording, decisions, config, sensors) or found
        for wilder in livelier(config):  # tracks that were lost in a turn taught nothing of it
            again, rows, _ = _explained(recording, scans, wilder, sensors)
            if again > value and _tracks(rows) < _tracks(decisions):
                value, config, decisions = again, wilder, rows
        lines.append(f"settings from the innovations of {len(found)} tracks in the first {span:.0f} s:")
    else:
        lines.append(f"settings for the speed that fits the first {span:.0f} s best (no track long enough for more):")
    return config, [*lines, *told(config)]


def told(config: TrackerConfig) -> list[str]:
    """Return what was chosen, in the keys of the configuration file."""
    q = f"process_noise_m2_s3 = {config.q:.3g}"
    if config.q_manoeuvre is not None:
        q += f", manoeuvre_noise_m2_s3 = {config.q_manoeuvre:.3g}"
    return [
        f"  {q}, speed_sigma_m_s = {config.speed_sigma:.3g}",
        f"  merge_distance_m = {config.merge_distance:.3g}, static_wander_m2_s = {config.static_q:.3g}, "
        f"survival_time_s = {config.survival_time:.3g}, coast_after_s = {config.coast_after:.3g}",
    ]


def declared(sensors: Sequence[Sensor], spread: float | None, dimensions: int) -> TrackerConfig:
    """Return the settings that follow from noise and rates alone; `spread` (m) of a position, None where none is given.

    What stands wanders by a share of the noise in a period; two tracks nearer than the noise are one; what reports
    seldom lives and is hidden for longer; what reports itself is no clutter, and is shown for longer while it stops.
    """
    flat = dimensions == 2
    config = TrackerConfig(
        q=0.1 if flat else 1.0, speed_sigma=8.0 if flat else 150.0, merge_distance=10.0 if flat else 30.0
    )
    if spread is None:
        return config
    periods = [s.period for s in sensors if s.period is not None] or [1.0]
    quick, slow = min(periods), max(periods)
    return replace(
        config,
        static_q=min((0.2 * spread) ** 2 / quick, config.static_q),
        merge_distance=min(max(1.5 * spread, 0.3), 300.0),
        survival_time=max(120.0, 20.0 * slow),
        hide_time=max(120.0, 20.0 * slow),
        show_time=max(10.0, 2.0 * slow),
        coast_after=max(4.0, 2.5 * slow),
        hide_below=SURE if any(s.reporting is Reporting.SINGLE for s in sensors) else config.hide_below,
    )


def with_speed(config: TrackerConfig, speed: float, dimensions: int) -> TrackerConfig:
    """Return the settings for targets of some `speed` (m/s per axis) that may change it within `TURN_TIME`."""
    climb = 0.1 * speed if dimensions == 3 and speed > 15.0 else None
    return replace(config, q=speed**2 / TURN_TIME**2, speed_sigma=speed, climb_sigma=climb)


def learned(config: TrackerConfig, found: list[Thread], dimensions: int) -> TrackerConfig:
    """Return the settings with the process noise under which the innovations along these tracks are most probable.

    One for all; or, where it explains them better, one for quiet stretches and one for manoeuvres.
    """
    table = likelihoods(found, dimensions, NOISES, STRETCH)  # (stretches, noises)
    whole = table.sum(axis=0)
    q = _peak(whole)
    config = replace(config, q=q, q_manoeuvre=None, manoeuvre_every=None, manoeuvre_lasts=None)
    if len(table) < FEW_STRETCHES:
        return config
    one = float(whole.max())
    # a mixture of two: every stretch is quiet or not
    best = (one + math.log(len(table)) * 3.0, -1, -1, 0.0)
    for a in range(len(NOISES)):
        for b in range(a + 1, len(NOISES)):
            if NOISES[b] < MANOEUVRING * NOISES[a]:
                continue
            for share in (0.05, 0.15, 0.3, 0.5):
                value = float(np.logaddexp(np.log1p(-share) + table[:, a], math.log(share) + table[:, b]).sum())
                if value > best[0]:
                    best = value, a, b, share
    _, quiet, wild, share = best
    if quiet < 0:
        return config
    lasts = STRETCH * float(np.median([np.median(np.diff(np.unique(f.reports.t))) for f in found]))
    return replace(
        config, q=float(NOISES[quiet]), q_manoeuvre=float(NOISES[wild]), manoeuvre_lasts=lasts,
        manoeuvre_every=lasts * (1.0 - share) / share,
    )  # fmt: skip


def livelier(config: TrackerConfig) -> list[TrackerConfig]:
    """Return settings with more process noise in manoeuvres."""
    if config.q_manoeuvre is not None:
        lasts = 3.0 * (config.manoeuvre_lasts or 10.0)
        return [replace(config, q_manoeuvre=f * config.q_manoeuvre, manoeuvre_lasts=lasts) for f in (5.0, 25.0)]
    q = config.q or NOISES[0]
    return [replace(config, q_manoeuvre=f * q, manoeuvre_every=60.0, manoeuvre_lasts=10.0) for f in (50.0, 500.0)]


def consistency(recording: Recording, decisions: DecisionRows) -> list[str]:
    """Return a line for each sensor whose innovations refute the covariances: mean NIS per component outside `BAND`."""
    updated = decisions.fate == FATES.index(Fate.UPDATED)
    rows = decisions.row[updated]
    measured = np.isfinite(recording.detections.z[rows])
    if recording.dimensions == 2:
        measured[:, [Component.ELEVATION, Component.UP]] = False
    count, nis = measured.sum(axis=1), decisions.nis[updated]
    lines = []
    for i, sensor in enumerate(recording.sensors):
        of = (recording.detections.sensor[rows] == i) & np.isfinite(nis)
        total = int(count[of].sum())
        if total < ENOUGH:
            continue
        mean = float(nis[of].sum() / total)
        if not BAND[0] <= mean <= BAND[1]:
            more, size = ("more", "small") if mean > 1.0 else ("less", "large")
            lines.append(
                f"{sensor.id}: NIS per component {mean:.2f} where 1 is right: it errs {more} than is declared, or "
                f"targets manoeuvre {more}; the tracks' covariances are too {size} (`boresight tune` finds what fits)"
            )
    return lines


def _first_part(recording: Recording, sensors: Sequence[str] | None) -> list[Scan]:
    scans: list[Scan] = []
    reports = 0
    for scan in iter_scans(recording, sensors):
        scans.append(scan)
        reports += len(scan.t)
        if len(scans) >= FIRST_LOOKS or reports >= FIRST_REPORTS:
            break
    return scans


def _spread(recording: Recording, scans: Sequence[Scan], sensors: Sequence[Sensor]) -> float | None:
    """Return the standard deviation (m, per axis) of a position by the best sensor; None where none gives one."""
    out = []
    for sensor in sensors:
        number = recording.sensor_index(sensor.id)
        own = [scan for scan in scans if scan.sensor == number and len(scan.t)]
        if not own:
            continue
        z, variance = np.concatenate([s.z for s in own]), np.concatenate([s.covariance for s in own])
        variance = np.diagonal(variance, axis1=1, axis2=2)
        across = variance[:, Component.AZIMUTH] * z[:, Component.RANGE] ** 2
        polar = np.sqrt(0.5 * (variance[:, Component.RANGE] + across))
        point = np.sqrt(0.5 * (variance[:, Component.EAST] + variance[:, Component.NORTH]))
        both: FloatArray = np.where(np.isfinite(point), point, polar)
        if np.isfinite(both).any():
            out.append(float(np.nanmedian(both)))
    return min(out, default=None)


def _explained(
    recording: Recording, scans: Sequence[Scan], config: TrackerConfig, sensors: Sequence[str] | None
) -> tuple[float, DecisionRows, float]:
    """Return how many reports shown tracks explain, each track at the price of a few; decisions; speed (m/s per axis).

    The speed is half as much again as the root mean square of the tracks' velocities in the plane: few are faster.
    """
    tracker = tracker_for(recording, config, sensors)
    state, made, decisions = run(tracker, scans)
    rows = decision_rows(recording, tracker, decisions, state.names)
    taken = np.isin(rows.fate, [FATES.index(Fate.UPDATED), FATES.index(Fate.INITIATED)]) & (rows.track_id != NO_TRACK)
    velocity = track_rows(made).velocity[:, :2]
    speed = 1.5 * math.sqrt(float((velocity**2).mean())) if len(velocity) else 0.0
    return float(taken.sum()) - FRAGMENT * len(np.unique(rows.track_id[taken])), rows, speed


def _tracks(rows: DecisionRows) -> int:
    """Return how many tracks were shown."""
    return len(np.unique(rows.track_id[rows.track_id != NO_TRACK]))


def _threads(
    recording: Recording, decisions: DecisionRows, config: TrackerConfig, sensors: Sequence[str] | None
) -> list[Thread]:
    poses = tracker_for(recording, config, sensors).poses
    return threads(recording, decisions, poses, config.speed_sigma or 1.0)


def _peak(whole: FloatArray) -> float:
    """Return the process noise (m²/s³) at the top of the parabola through the best of `NOISES` and its neighbours."""
    i = int(np.argmax(whole))
    if 0 < i < len(NOISES) - 1 and np.isfinite(whole[i - 1 : i + 2]).all():
        left, middle, right = whole[i - 1 : i + 2]
        bend = left - 2.0 * middle + right
        shift = 0.5 * (left - right) / bend if bend < 0.0 else 0.0
        return float(NOISES[i] * (NOISES[1] / NOISES[0]) ** shift)
    return float(NOISES[i])
