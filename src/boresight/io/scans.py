"""The looks of a recording, in the order in which they arrived."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from boresight.errors import UserError, did_you_mean
from boresight.types import Detections, FloatArray, Recording, Scan, address_code


def iter_scans(recording: Recording, sensors: Sequence[str] | None = None) -> Iterator[Scan]:
    """Yield every scan in order of arrival (all sensors, or those with the given ids).

    Rows that share (sensor, scan) are one scan, wherever they stand; it arrives with its last row, duplicates and
    refused rows left out. Looks that saw nothing are yielded with their rows in `empty_rows`. Raises UserError for an
    unknown sensor.
    """
    d = recording.detections
    rows = np.flatnonzero(~recording.duplicates & recording.usable & np.isin(d.sensor, selected(recording, sensors)))
    if len(rows) == 0:
        return
    _, group = np.unique(np.stack([d.sensor[rows], d.scan[rows]], axis=1), axis=0, return_inverse=True)
    last = np.zeros(int(group.max()) + 1, dtype=np.int64)
    np.maximum.at(last, group, rows)
    arrival = np.full(len(last), -np.inf)
    np.maximum.at(arrival, group, d.t_recv[rows])
    rows = rows[np.lexsort((rows, last[group], arrival[group]))]
    yield from _cut(d, rows, _starts(d, rows))


def selected(recording: Recording, sensors: Sequence[str] | None) -> NDArray[np.int64]:
    """Return the indices of the sensors with the given ids (all for None); raises UserError for an unknown one."""
    known = [s.id for s in recording.sensors]
    if sensors is None:
        return np.arange(len(known))
    for name in sensors:
        if name not in known:
            raise UserError(f"unknown sensor '{name}'{did_you_mean(name, known)}; the recording has {', '.join(known)}")
    return np.array([known.index(name) for name in sensors], dtype=np.int64)


def _starts(d: Detections, rows: NDArray[np.int64]) -> NDArray[np.int64]:
    """Where a new scan begins in rows that are grouped by scan, and the end of the last."""
    new = np.ones(len(rows) + 1, dtype=bool)
    new[1:-1] = (np.diff(d.sensor[rows]) != 0) | (np.diff(d.scan[rows]) != 0)
    return np.flatnonzero(new)


def _cut(d: Detections, rows: NDArray[np.int64], starts: NDArray[np.int64]) -> Iterator[Scan]:
    z, t, covariance = d.z[rows], d.t[rows], covariances(d, rows)
    address = addresses(d, rows)
    empty: NDArray[np.bool_] = np.all(np.isnan(z), axis=1)
    first = starts[:-1]
    n_empty = np.add.reduceat(empty.astype(np.int64), first)
    # the looks' stamps: of the detections where there are any, else of the empty rows
    mixed = np.repeat((n_empty > 0) & (n_empty < np.diff(starts)), np.diff(starts)) & empty
    low = np.minimum.reduceat(np.where(mixed, np.inf, t), first)
    high = np.maximum.reduceat(np.where(mixed, -np.inf, t), first)
    columns = (first, starts[1:], n_empty, d.sensor[rows[first]], 0.5 * (low + high))
    arrived = np.maximum.reduceat(d.t_recv[rows], first).tolist()
    for begin, end, blank, sensor, t_look, t_recv in zip(*(c.tolist() for c in columns), arrived, strict=True):
        part: slice | NDArray[np.int64] = slice(begin, end)
        empty_rows: tuple[int, ...] = ()
        if blank:
            here = empty[begin:end]
            empty_rows = tuple(rows[begin:end][here].tolist())
            part = begin + np.flatnonzero(~here)
        own = None if address is None else address[part]
        yield Scan(sensor, t_look, t_recv, t[part], z[part], covariance[part], rows[part], empty_rows, own)


def addresses(d: Detections, rows: NDArray[np.int64]) -> NDArray[np.int64] | None:
    """Return the codes of the given rows' `source_id`, -1 where they have none; None where no row has one."""
    if d.source_id is None:
        return None
    return np.array([address_code(d.source_id[row]) for row in rows.tolist()], np.int64)


def covariances(d: Detections, rows: NDArray[np.int64]) -> FloatArray:
    """Return (n, 7, 7) covariances of the given rows: zero between independent components, NaN where not measured."""
    sigma = d.sigma[rows]
    missing = np.isnan(sigma)
    out = np.zeros((len(rows), *sigma.shape[1:], *sigma.shape[1:]))
    index = np.arange(sigma.shape[1])
    out[:, index, index] = sigma**2
    out[missing[:, :, None] | missing[:, None, :]] = np.nan
    if d.covariance:
        place = {int(row): i for i, row in enumerate(rows)}
        for row, full in d.covariance.items():
            if row in place:
                out[place[row]] = full
    return out
