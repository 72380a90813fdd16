"""detections.parquet (or a CSV with its column names) to and from `types.Detections`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from boresight.errors import did_you_mean
from boresight.io import limits
from boresight.io.declaration import DEG, SIGMA_KEYS
from boresight.io.stamps import examine
from boresight.io.table import LIST, NUMBER, TEXT, WHOLE, Table, in_unit, nullable
from boresight.types import N_COMPONENTS, Axes, Component, Detections, FloatArray, Recording, Sensor

POLAR = ("range_m", "azimuth_deg", "elevation_deg", "range_rate_m_s")
CARTESIAN = ("x_m", "y_m", "z_m")
MEASURED = (*POLAR, *CARTESIAN)  # in the order of Component, and of the `covariance` column
SCHEMA: dict[str, str] = {
    "t_s": NUMBER,
    "t_recv_s": NUMBER,
    "sensor": TEXT,
    "scan": WHOLE,
    **dict.fromkeys(MEASURED, NUMBER),
    **dict.fromkeys(SIGMA_KEYS, NUMBER),
    "covariance": LIST,
    "source_id": TEXT,
    "attributes": TEXT,
}
REQUIRED = ("t_s", "sensor", "scan")
UNITS = np.array([1.0, DEG, DEG, 1.0, 1.0, 1.0, 1.0])
SIGMA_KEY_OF = {component: key for key, (components, _) in SIGMA_KEYS.items() for component in components}

# forward, right, down (as filed for body and mount axes) to the east/north/up-like columns: right, forward, -down
ENU_FROM_FRD = np.eye(N_COMPONENTS)
ENU_FROM_FRD[4:, 4:] = [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]]

FRD_ORDER = [0, 1, 2, 3, 5, 4, 6]


def is_frd(sensor: Sensor) -> bool:
    return sensor.axes in (Axes.BODY, Axes.MOUNT)


def detections_of(
    table: Table, sensors: tuple[Sensor, ...], others: Sequence[tuple[str, float, float]] = ()
) -> tuple[Detections, NDArray[np.bool_], dict[int, str]]:
    """Return the detections of a table, which rows repeat an earlier one, and which are refused with the reason.

    `others` are name, first and last stamp (s) of platforms and targets. What the user is to know goes to the notes.

    Raises UserError for an unknown sensor, a value that cannot be, or a measured component without any sigma.
    """
    if not any(name in table for name in MEASURED):
        table.fail(None, f"no measured column; give at least one of {', '.join(MEASURED)}")
    if len(table) == 0:
        table.fail(None, "the table has no rows")
    t = table.numbers("t_s", required=True)
    sensor = _sensors(table, sensors)
    filed, emptied = _measured(table)
    z = turned(filed, sensors, sensor)
    sigma = _sigmas(table, sensors, sensor, z)
    covariance = _covariances(table, sensors, sensor, z, sigma)
    _check_noise(table, sensors, sensor, z, sigma)
    scan = table.whole("scan")
    stamps = examine(t, table.numbers("t_recv_s"), sensor, scan, sensors, others, table.place)
    refused = stamps.refused | dict.fromkeys(emptied, 'all that it measures says "not available"')
    table.notes.extend(f"{table.path}: {f.text}" for f in stamps.findings)
    detections = Detections(
        t=t,
        t_recv=stamps.arrival,
        sensor=sensor,
        scan=scan,
        z=z,
        sigma=sigma,
        covariance=covariance,
        source_id=table.objects("source_id"),
        attributes=table.objects("attributes"),
    )
    return detections, find_duplicates(detections), dict(sorted(refused.items()))


def _sensors(table: Table, sensors: tuple[Sensor, ...]) -> NDArray[np.int64]:
    codes, words = table.codes("sensor")
    known = [s.id for s in sensors]
    index = np.array([known.index(w) if w in known else -1 for w in words], dtype=np.int64)
    sensor: NDArray[np.int64] = index[codes]
    if (sensor < 0).any():
        row = int(np.argmax(sensor < 0))
        word = words[codes[row]]
        table.fail(row, f"unknown sensor '{word}'{did_you_mean(word, known)}; declare it as a [[sensor]]")
    return sensor


def _measured(table: Table) -> tuple[FloatArray, list[int]]:
    """What was measured (n, 7), and the rows in which all of it says "not available"."""
    given = np.stack([table.numbers(name) for name in MEASURED], axis=1)
    far = given[:, Component.RANGE]
    table.fail_where((far < 0) & ~limits.absent("range_m", far), "range_m is {}; a range is not negative", far)
    z = np.stack([table.checked(name) for name in MEASURED], axis=1)
    emptied = np.flatnonzero(np.isnan(z).all(axis=1) & ~np.isnan(given).all(axis=1)).tolist()
    azimuth = z[:, Component.AZIMUTH]
    outside = (azimuth > 180.0) | (azimuth <= -180.0)
    azimuth[outside] = 180.0 - np.mod(180.0 - azimuth[outside], 360.0)  # into (-180, 180]
    out: FloatArray = z * UNITS
    return out, emptied


def _sigmas(table: Table, sensors: tuple[Sensor, ...], sensor: NDArray[np.int64], z: FloatArray) -> FloatArray:
    """The row's own sigma where it has one, else the sensor's; NaN where not measured."""
    sigma: FloatArray = np.stack([s.sigma for s in sensors])[sensor]
    for key, (components, unit) in SIGMA_KEYS.items():
        own = table.numbers(key)
        table.fail_where(own <= 0, f"{key} is {{}}; a standard deviation is above zero", own)
        given = ~np.isnan(own)
        for component in components:
            sigma[given, component] = own[given] * unit
    sigma[np.isnan(z)] = np.nan
    return sigma


def turned(z: FloatArray, sensors: tuple[Sensor, ...], sensor: NDArray[np.int64]) -> FloatArray:
    """Forward/right/down to the east/north/up-like columns, and back: the turn is its own inverse."""
    frd = np.array([is_frd(s) for s in sensors])[sensor]
    z[frd, 4:] = z[frd][:, [5, 4, 6]] * [1.0, 1.0, -1.0]
    return z


def _covariances(
    table: Table, sensors: tuple[Sensor, ...], sensor: NDArray[np.int64], z: FloatArray, sigma: FloatArray
) -> dict[int, FloatArray]:
    """Full covariances by row, turned like the measurement; their diagonal also becomes the row's sigma."""
    out: dict[int, FloatArray] = {}
    for row, upper in enumerate(table.objects("covariance") or ()):
        if upper is None:
            continue
        frd = is_frd(sensors[sensor[row]])
        filed = z[row, FRD_ORDER] if frd else z[row]
        index = np.flatnonzero(~np.isnan(filed))
        m = len(index)
        if len(upper) != m * (m + 1) // 2:
            table.fail(row, f"covariance has {len(upper)} numbers; {m} measured components need {m * (m + 1) // 2}")
        block = np.zeros((m, m))
        block[np.triu_indices(m)] = [np.nan if v is None else v for v in upper]
        block = np.triu(block) + np.triu(block, 1).T
        if not np.isfinite(block).all():
            table.fail(row, "covariance holds a number that is not finite")
        if m and np.linalg.eigvalsh(block)[0] <= 0.0:
            table.fail(row, "covariance is not positive definite")
        full = np.zeros((N_COMPONENTS, N_COMPONENTS))
        full[np.ix_(index, index)] = block
        if frd:
            full = ENU_FROM_FRD @ full @ ENU_FROM_FRD.T
        missing = np.isnan(z[row])
        full[missing] = np.nan
        full[:, missing] = np.nan
        sigma[row] = np.sqrt(np.diag(full))
        out[row] = full
    return out


def _check_noise(
    table: Table, sensors: tuple[Sensor, ...], sensor: NDArray[np.int64], z: FloatArray, sigma: FloatArray
) -> None:
    bad = ~np.isnan(z) & np.isnan(sigma)
    if bad.any():
        row = int(np.argmax(bad.any(axis=1)))
        component = Component(int(np.argmax(bad[row])))
        key, name = SIGMA_KEY_OF[component], sensors[sensor[row]].id
        table.fail(row, f"{MEASURED[component]} has no noise: add {key} to [[sensor]] '{name}', or a column {key}")


def find_duplicates(detections: Detections) -> NDArray[np.bool_]:
    """Return (n,) True where an earlier row has the same sensor, stamp and measured content (scan left aside)."""
    n = len(detections)
    columns = [detections.t, detections.sensor.astype(np.float64), *detections.z.T, *detections.sigma.T]
    if detections.source_id is not None:
        ids = {word: i for i, word in enumerate(dict.fromkeys(detections.source_id))}
        columns.append(np.array([ids[word] for word in detections.source_id], dtype=np.float64))
    keys = np.nan_to_num(np.stack(columns, axis=1), nan=np.inf)
    _, first, inverse = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    twins: NDArray[np.bool_] = first[inverse.reshape(n)] != np.arange(n)
    for row in detections.covariance:  # equal variances, yet perhaps other correlations
        other = detections.covariance.get(int(first[inverse.reshape(n)[row]]))
        if twins[row] and (other is None or not np.array_equal(other, detections.covariance[row], equal_nan=True)):
            twins[row] = False
    return twins


def in_order(detections: Detections, order: NDArray[np.int64]) -> Detections:
    """Return the rows in another order (n,)."""
    place = {int(row): i for i, row in enumerate(order)}
    parts = {name: getattr(detections, name)[order] for name in ("t", "t_recv", "sensor", "scan", "z", "sigma")}
    texts = [detections.source_id, detections.attributes]
    source, attributes = (None if one is None else [one[i] for i in order.tolist()] for one in texts)
    covariance = {place[row]: full for row, full in detections.covariance.items()}
    return Detections(**parts, covariance=covariance, source_id=source, attributes=attributes)


def reordered(recording: Recording) -> Recording:
    """Return a recording whose detections stand in order of arrival."""
    order = np.argsort(recording.detections.t_recv, kind="stable")
    place = {int(row): i for i, row in enumerate(order)}
    refused = {place[row]: why for row, why in recording.refused.items()}
    rows = in_order(recording.detections, order)
    return replace(recording, detections=rows, duplicates=find_duplicates(rows), refused=dict(sorted(refused.items())))


def columns_of(detections: Detections, sensors: tuple[Sensor, ...]) -> dict[str, Any]:
    """Return the columns of detections.parquet; only columns that hold something."""
    sensor = detections.sensor
    ids = np.array([s.id for s in sensors], dtype=object)
    out: dict[str, Any] = {
        "t_s": detections.t,
        "t_recv_s": detections.t_recv,
        "sensor": pa.array(ids[sensor], pa.string()),
        "scan": detections.scan,
    }
    z = in_unit(turned(detections.z.copy(), sensors, sensor), UNITS)
    for i, name in enumerate(MEASURED):
        if not np.isnan(z[:, i]).all() or name == "range_m":
            out[name] = nullable(z[:, i])
    declared = np.stack([s.sigma for s in sensors])[sensor]
    full = np.zeros(len(detections), dtype=bool)
    full[list(detections.covariance)] = True
    for key, (components, unit) in SIGMA_KEYS.items():
        own = detections.sigma[:, list(components)]
        first = own[:, 0]
        for other in own.T[1:]:  # of east, north, up the first that is measured
            first = np.where(np.isnan(first), other, first)
        first = np.where((first == declared[:, components[0]]) | full, np.nan, first)
        if not np.isnan(first).all():
            out[key] = nullable(in_unit(first, unit))
    if detections.covariance:
        out["covariance"] = pa.array(_upper(detections, sensors), pa.list_(pa.float64()))
    for name in ("source_id", "attributes"):
        if (values := getattr(detections, name)) is not None:
            out[name] = pa.array(values, pa.string())
    return out


def _upper(detections: Detections, sensors: tuple[Sensor, ...]) -> list[list[float] | None]:
    out: list[list[float] | None] = [None] * len(detections)
    for row, full in detections.covariance.items():
        known = ~np.isnan(np.diag(full))
        filed = np.nan_to_num(full)
        if is_frd(sensors[detections.sensor[row]]):
            filed = ENU_FROM_FRD.T @ filed @ ENU_FROM_FRD
            known = known[FRD_ORDER]
        block = filed[np.ix_(known, known)]
        out[row] = [float(v) for v in block[np.triu_indices(len(block))]]
    return out
