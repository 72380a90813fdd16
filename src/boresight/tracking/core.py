"""Packs configuration and sensors for the kernel."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import gammaincinv

from boresight.errors import UserError
from boresight.kernels.registration import AZIMUTH, ELEVATION, N_PARAMETERS, RANGE, SCALE, TIME
from boresight.kernels.tracker import AZIMUTH_BINS, Extras, IntArray, Models, SensorTable, Settings, Tracks
from boresight.kernels.tracker_copies import WHOLE, Copies, each_of, no_copies
from boresight.kernels.tracker_looks import columns_of
from boresight.tracking.config import SensorErrors, TrackerConfig
from boresight.types import N_COMPONENTS, Component, FloatArray, Reporting, Sensor

MOST_SENSORS = 62  # bits of what each track was seen by
START_SHARE = 0.25  # of the prior speed: with that, what stood sets off where nothing is said
CLIMB_SHARE = 0.1  # of the prior speed: vertical, where no height was measured and nothing is said
HEIGHTS = 10  # at most, along the arc on which a sensor without elevation leaves a target
WRONG_ID = 0.02  # probability that an address is not the target's own, where nothing is said
_BIASED = {
    Component.RANGE: "bias_range",
    Component.AZIMUTH: "bias_azimuth",
    Component.ELEVATION: "bias_elevation",
    Component.EAST: "bias_position",
    Component.NORTH: "bias_position",
    Component.UP: "bias_position",
}


class Plan(NamedTuple):
    """Configuration and sensors as the kernel wants them; made once."""

    settings: Settings
    sensors: tuple[SensorTable, ...]
    n_states: int
    columns: SensorTable  # all sensors in one table, with a leading axis
    empty: Copies  # one: the tracks before the first look
    extras: Extras  # None where the kernel can do without what takes long to compile
    models: Models | None  # None where targets move by one model


def make_plan(
    config: TrackerConfig,
    sensors: tuple[Sensor, ...],
    dimensions: int,
    used: Sequence[int] | None = None,
    site_height: float = 0.0,
) -> Plan:
    """Pack a configuration for `sensors` in `dimensions` (2 or 3); biases are planned for those in `used` (all).

    `site_height` is that of the site above the ellipsoid (m).
    """
    d = dimensions
    flat = d == 2
    taking = range(len(sensors)) if used is None else used
    if len({i % MOST_SENSORS for i in taking}) < len(taking):
        raise UserError(
            f"{len(sensors)} sensors: the tracker tells at most {MOST_SENSORS} apart; use fewer (--sensors)"
        )
    sigma: list[float] = []
    tau: list[float] = []
    tables = []
    gate = math.sqrt(2.0 * gammaincinv(0.5, config.gate_probability))
    constants = [np.full(N_PARAMETERS, -1, np.int64) for _ in sensors]  # filled when the number of biases is known
    report_range = np.zeros(len(sensors))
    known: list[tuple[float, tuple[int, int]]] = []  # sigma, (sensor, parameter) of the constant errors
    for index, sensor in enumerate(sensors):
        errors = config.sensors.get(sensor.id, SensorErrors())
        bias = np.full(N_COMPONENTS, -1, np.int64)
        if used is None or index in used:
            for component, value in _biases(sensor, errors, flat):
                bias[component] = 2 * d + len(sigma)
                sigma.append(value)
                tau.append(errors.bias_time)
            known += [(v, (index, p)) for p, v in _constants(sensor, errors, flat)]
        joint = (errors.association or config.association) == "jpda"
        tables.append(_table(index, sensor, errors, bias, constants[index], joint, gate))
    sigma += [value for value, _ in known]
    tau += [math.inf] * len(known)
    for place, (_, (index, parameter)) in enumerate(known):
        constants[index][parameter] = 2 * d + len(sigma) - len(known) + place
    witnesses = [t.number for t in tables if _bears_witness(t)]
    spoken = [t.number for t in tables if t.single or t.wrong_id > 0.0]
    tables = [
        t._replace(
            spoken=spoken.index(t.number) if t.number in spoken else -1,
            registers=bool((t.constant >= 0).any()),
            witness=witnesses.index(t.number) if t.number in witnesses else -1,
        )
        for t in tables
    ]
    ranging = [t for t in tables if t.ranging and (used is None or t.number in used)]
    for table in ranging:
        report_range[table.number] = config.sensors.get(sensors[table.number].id, SensorErrors()).report_range
    settings = _settings(config, d, np.array(sigma), np.array(tau), len(known), ranging, report_range, site_height)
    n = 2 * d + len(sigma)
    extras = bool(known or config.blob_share > 0.0 or any(t.joint for t in tables)) or None
    used_sensors = [sensor for index, sensor in enumerate(sensors) if used is None or index in used]
    several = d == 3 and any(leaves_height_open(sensor) for sensor in used_sensors)
    models = _models(config, settings.q, HEIGHTS if several else 1)
    parts = 0 if models is None else models.motions * models.heights
    empty = _before_all(settings, tables, n, len(witnesses), len(spoken), parts)
    return Plan(settings, tuple(tables), n, columns_of(tuple(tables)), empty, extras, models)


def _bears_witness(sensor: SensorTable) -> bool:
    """Whether each track keeps what this sensor tells of it: it may pass it over, or its bearings only confirm."""
    return sensor.sees_targets < 1.0 or not (sensor.ranging or sensor.moves_tracks)


def _table(
    number: int, sensor: Sensor, errors: SensorErrors, bias: IntArray, constant: IntArray, joint: bool, gate: float
) -> SensorTable:
    """Pack one sensor; `registers`, `witness` and `spoken` are set once their places are known. `gate` is in σ."""
    c = sensor.coverage
    single = sensor.reporting is Reporting.SINGLE
    sigma = sensor.sigma[Component.AZIMUTH]
    span = c.azimuth[1] - c.azimuth[0]
    if span <= 0.0:
        span += 2.0 * math.pi
    return SensorTable(
        number=number,
        p_detection=min(sensor.p_detection, 0.999),
        clutter_per_scan=sensor.clutter_per_scan,
        range_low=c.range[0],
        range_high=c.range[1],
        azimuth_low=c.azimuth[0],
        azimuth_span=min(span, 2.0 * math.pi),
        elevation_low=c.elevation[0],
        elevation_high=c.elevation[1],
        ranging=sensor.ranging,
        bias=bias,
        registers=False,
        constant=constant,
        decorrelation=errors.decorrelation,
        fade_range=errors.fade_range,
        resolution=errors.resolution,
        moves_tracks=errors.moves_tracks,
        sees_static=errors.sees_static,
        sees_targets=errors.sees_targets,
        witness=-1,
        gate_width=2.0 * gate * math.hypot(sigma if math.isfinite(sigma) else 0.0, errors.bias_azimuth),
        joint=joint,
        single=single,
        interval=(sensor.period or 0.0) if single else 0.0,
        spoken=-1,
        height=sensor.height[0] if sensor.height is not None else 0.0,
        height_sigma=sensor.height[1] if sensor.height is not None else 0.0,
        wrong_id=sensor.p_wrong_id if sensor.p_wrong_id is not None else (WRONG_ID if single else 0.0),
    )


def _settings(
    config: TrackerConfig,
    d: int,
    bias_sigma: FloatArray,
    bias_tau: FloatArray,
    n_constant: int,
    ranging: Sequence[SensorTable],
    report_range: FloatArray,
    site_height: float,
) -> Settings:
    """Pack the settings; `ranging` are the ranging sensors in use, `report_range` (n_sensors,) theirs, 0 of others."""
    flat = d == 2
    speed = config.speed_sigma if config.speed_sigma is not None else (8.0 if flat else 150.0)
    return Settings(
        d=d,
        q=config.q if config.q is not None else (0.1 if flat else 1.0),
        gates=np.array([0.0, *(2.0 * gammaincinv(0.5 * np.arange(1, 8), config.gate_probability))]),
        speed_sigma=speed,
        birth_rate=config.birth_rate,
        survival_time=config.survival_time,
        hide_time=config.hide_time,
        show_time=config.show_time,
        static_share=config.static_share,
        static_q=config.static_q,
        stop_floor=config.stop_floor,
        rest_time=config.rest_time,
        start_speed=config.start_speed if config.start_speed is not None else START_SHARE * speed,
        targets_at_start=config.targets_at_start,
        doubt=config.doubt,
        delete_below=config.delete_below,
        show_above=config.confirm_above,
        hide_below=config.hide_below,
        bias_sigma=bias_sigma,
        bias_tau=bias_tau,
        n_constant=n_constant,
        report_range=report_range,
        merge_distance=config.merge_distance if config.merge_distance is not None else (10.0 if flat else 30.0),
        apart=config.apart,
        lonely_bearings=config.lonely_bearings,
        clutter_memory=config.clutter_memory,
        blob=max([t.resolution for t in ranging], default=0.0),
        blob_share=config.blob_share,
        hide_after=config.hide_after,
        climb_sigma=config.climb_sigma if config.climb_sigma is not None else CLIMB_SHARE * speed,
        site_height=site_height,
        extent=config.extent,
    )


def leaves_height_open(sensor: Sensor) -> bool:
    """Whether a sensor measures range and azimuth without elevation: in 3-D, its targets lie anywhere on an arc."""
    measured = np.isfinite(sensor.sigma)
    return bool(measured[Component.RANGE] and measured[Component.AZIMUTH] and not measured[Component.ELEVATION])


def _models(config: TrackerConfig, q: float, heights: int) -> Models | None:
    """Pack the components of a target's state, if there are several; `q` is the process noise between manoeuvres."""
    if config.q_manoeuvre is None:
        return None if heights == 1 else Models(q=q, every=1.0, lasts=1.0, motions=1, heights=heights)
    if not q < config.q_manoeuvre < math.inf:
        told = f"finite and larger than {q:g}, the process noise between manoeuvres"
        raise UserError(f"tracker: q_manoeuvre must be {told}, not {config.q_manoeuvre:g}")
    every, lasts = config.manoeuvre_every or 60.0, config.manoeuvre_lasts or 10.0
    return Models(q=config.q_manoeuvre, every=every, lasts=lasts, motions=2, heights=heights)


def _biases(sensor: Sensor, errors: SensorErrors, flat: bool) -> list[tuple[Component, float]]:
    """Return (component, sigma) of the wandering biases that are declared and of which the sensor measures anything."""
    return [
        (component, value)
        for component, key in _BIASED.items()
        if not (flat and component in (Component.ELEVATION, Component.UP))
        and (value := getattr(errors, key)) > 0.0
        and math.isfinite(sensor.sigma[component])
    ]


def _constants(sensor: Sensor, errors: SensorErrors, flat: bool) -> list[tuple[int, float]]:
    """Return (parameter, sigma) of the constant errors that are declared and that what the sensor measures can show."""
    measured = np.isfinite(sensor.sigma)
    point = bool(measured[Component.EAST])
    ranges = point or bool(measured[Component.RANGE])
    return [
        (parameter, value)
        for parameter, value, shows in (
            (TIME, errors.offset_time, True),
            (RANGE, errors.offset_range, ranges),
            (SCALE, errors.offset_scale, ranges),
            (AZIMUTH, errors.offset_azimuth, point or bool(measured[Component.AZIMUTH])),
            (ELEVATION, errors.offset_elevation, not flat and (point or bool(measured[Component.ELEVATION]))),
        )
        if value > 0.0 and shows
    ]


def _before_all(
    settings: Settings, sensors: Sequence[SensorTable], n: int, witnesses: int, spoken: int, parts: int
) -> Copies:
    """Return one copy of a table without tracks of `n` states, which `parts` components have too (0: none)."""
    k = settings.n_constant
    clutter = np.zeros((len(sensors), AZIMUTH_BINS + 1))
    for table in sensors:
        clutter[table.number, :AZIMUTH_BINS] = table.clutter_per_scan / AZIMUTH_BINS
        clutter[table.number, AZIMUTH_BINS] = table.clutter_per_scan
    tracks = Tracks(
        live=np.zeros(2, np.int64),
        time=np.full(1, -np.inf),
        birth=np.zeros(0, np.int64),
        x=np.zeros((0, n)),
        P=np.zeros((0, n, n)),
        weight=np.zeros((0, 4)),
        anchor=np.zeros((0, 3)),
        anchor_P=np.zeros((0, 3, 3)),
        life=np.zeros((0, 4)),
        last_look=np.full((len(sensors), 4), -np.inf),
        clutter=clutter,
        heard=np.zeros(0, np.int64),
        beside=np.zeros(0, np.int64),
        told=np.zeros((0, k, k + 1)),
        witness=np.zeros((0, witnesses, 2)),
        spoken=np.zeros((0, spoken, 4)),
        pace=np.zeros((len(sensors), 4)),
        bank=np.zeros((k, k + 1)),
        undetected=np.full(1, settings.targets_at_start),
        seen_range=np.zeros(len(sensors)),
    )
    if parts:
        mode_x, mode_P = np.zeros((0, parts, n)), np.zeros((0, parts, n, n))
        tracks = tracks._replace(mode=np.zeros((0, parts)), mode_x=mode_x, mode_P=mode_P)
    one = no_copies(tracks)
    whole = {name: getattr(tracks, name)[None] for name in WHOLE}
    return one._replace(
        used=np.ones(1, np.int64), t=np.zeros(1), number=np.zeros(1, np.int64), first=np.zeros(2, np.int64), **whole
    )


def copy_tracks(tr: Tracks, capacity: int | None = None) -> Tracks:
    """Copy the live rows (and the room for `capacity`, by default as much as there was)."""
    n = int(tr.live[0])
    size = len(tr.birth) if capacity is None else capacity
    parts = {name: getattr(tr, name).copy() for name in WHOLE}
    for name in each_of(tr):
        array = getattr(tr, name)
        parts[name] = np.zeros((size, *array.shape[1:]), array.dtype)
        parts[name][:n] = array[:n]
    return Tracks(**parts)
