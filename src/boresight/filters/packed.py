"""The fastest way through the extended Kalman filter: one array a track, in place, and thousands of tracks at once.

For nearly constant velocity in space and sensors with uncorrelated noise (`fits` says whether): the filter of
`filters.ekf`, to rounding. A loop over live reports fills one `report` array per sensor and calls `step`; a recording
goes through `run` in one call; runs of a Monte Carlo study that share times and sensors go through `run_many`.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from boresight.errors import UserError
from boresight.kernels import tiles
from boresight.kernels.observation import CONTEXT_SIZE
from boresight.kernels.packed import (
    BELIEF_SIZE,
    CONTEXT,
    MEASURED,
    MISFIT,
    NUMBERS,
    POWER,
    REPORT_SIZE,
    TIME,
    packed_step,
)
from boresight.kernels.packed import packed_stream as _stream
from boresight.models import check
from boresight.models.base import KernelSensor
from boresight.models.motion import NearlyConstantVelocity
from boresight.types.sensor import FloatArray
from boresight.types.state import GaussianState

__all__ = ["BatchResult", "Table", "fits", "pack", "report", "run", "run_many", "step", "table", "unpack"]

_HALF = np.triu_indices(3)  # ee, en, eu, nn, nu, uu
NONE_KEPT, NO_NIS = np.empty((0, 27)), np.empty(0)
NO_TILES = np.empty((0, 0, 0))
NOT_PACKED = (
    "step takes a belief and a report as pack and report make them: contiguous, writeable arrays of float64, of their "
    "length"
)


class Table(NamedTuple):
    """k reports in order of time, each of one of s sensors."""

    t: FloatArray  # (k,) s
    z: FloatArray  # (k, 7) by Component, NaN where not measured
    contexts: FloatArray  # (s, 66)
    sensor: NDArray[np.int64]  # (k,) row of `contexts`


class BatchResult(NamedTuple):
    """What `run_many` leaves of N tracks."""

    x: FloatArray  # (N, 6) after the last report
    P: FloatArray  # (N, 6, 6)
    nis: FloatArray  # (N,) sum of normalised innovations squared; NaN where an S was not positive
    dof: FloatArray  # (N,) number of components used: what `nis` is to be compared with
    kept: FloatArray  # (k, N, 6) means after every report, or empty


def fits(motion: Any, sensors: Sequence[Any]) -> bool:
    """Return whether motion and sensors are those of this module: otherwise take `filters.stream`."""
    return (
        type(motion) is NearlyConstantVelocity
        and motion.dimensions == 3
        and all(isinstance(s, KernelSensor) and s.separable for s in sensors)
    )


def _require(motion: Any, sensors: Sequence[Any]) -> None:
    if not fits(motion, sensors):
        raise UserError(
            "the packed filter is for NearlyConstantVelocity in 3 dimensions and built-in sensors with uncorrelated "
            "noise, not in the tangent form: take filters.ekf or filters.stream for others"
        )


def pack(state: GaussianState, motion: NearlyConstantVelocity) -> FloatArray:
    """Return the packed belief (29,) of a state of 6 components; raises UserError where `fits` is false."""
    _require(motion, ())
    check.state("the state to pack, of 6 components", *state, size=6)
    b = np.empty(BELIEF_SIZE)
    b[TIME], b[POWER] = state.t, motion.q
    b[NUMBERS:] = _numbers(state.x[None], state.P[None])[0]
    return b


def unpack(belief: FloatArray) -> GaussianState:
    """Return the state that a packed belief (29,) holds."""
    x, P = dense(belief[None, NUMBERS:])
    return GaussianState(float(belief[TIME]), x[0], P[0])


def _numbers(x: FloatArray, P: FloatArray) -> FloatArray:
    """Return the 27 numbers of `kernels.blocks` of N beliefs (N, 27)."""
    upper = P[:, :3, :3][:, *_HALF], P[:, :3, 3:].reshape(-1, 9), P[:, 3:, 3:][:, *_HALF]
    return np.concatenate((x, *upper), axis=1)


def dense(numbers: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return means (N, 6) and covariances (N, 6, 6) of (N, 27) numbers."""
    P = np.empty((len(numbers), 6, 6))
    i, j = _HALF
    P[:, i, j] = P[:, j, i] = numbers[:, 6:12]
    P[:, :3, 3:] = numbers[:, 12:21].reshape(-1, 3, 3)
    P[:, 3:, :3] = P[:, :3, 3:].transpose(0, 2, 1)
    P[:, 3 + i, 3 + j] = P[:, 3 + j, 3 + i] = numbers[:, 21:27]
    return numbers[:, :6].copy(), P


def report(sensor: KernelSensor, t: float = np.nan, z: FloatArray | None = None) -> FloatArray:
    """Return a packed report (74,) of a sensor: time, 7 components, context; to be filled and given to `step`.

    The components are `report[1:8]`, by `Component`; those not measured stay NaN. Raises UserError where `fits` is
    false for the sensor.
    """
    if not isinstance(sensor, KernelSensor) or not sensor.separable:
        _require(None, ())
    out = np.full(REPORT_SIZE, np.nan)
    out[TIME], out[CONTEXT:] = t, sensor.context
    if z is not None:
        out[MEASURED:CONTEXT] = sensor.columns(z)
    return out


def table(t: Sequence[float] | FloatArray, sensors: Sequence[KernelSensor], z: Sequence[FloatArray]) -> Table:
    """Lay out reports: times (s), the sensor of each (at its pose at that time) and its measurement (m,).

    A sensor given again is kept once. Raises UserError where the lengths differ, or a sensor does not fit.
    """
    if not len(t) == len(sensors) == len(z) or not len(t):
        raise UserError("give one time, one sensor and one measurement per report, and at least one report")
    contexts, which = schedule(sensors)
    return Table(times_of(t), np.array([s.columns(row) for s, row in zip(sensors, z)]), contexts, which)


def times_of(t: Sequence[float] | FloatArray) -> FloatArray:
    """Return times (k,) as an array; raises UserError where they are no finite numbers."""
    try:
        times: FloatArray = np.array(t, dtype=float)
    except (TypeError, ValueError):
        raise UserError("the reports' times must be numbers (s)") from None
    if times.shape != (len(t),) or not np.isfinite(times).all():
        raise UserError("the reports' times must be finite numbers (s)")
    return times


def schedule(sensors: Sequence[KernelSensor]) -> tuple[FloatArray, NDArray[np.int64]]:
    """Return the different contexts (s, 66) of k reports' sensors, and which of them each report has (k,)."""
    rows: dict[int, int] = {}
    different = []
    for sensor in sensors:
        if id(sensor) not in rows:
            rows[id(sensor)] = len(rows)
            different.append(sensor)
    if not all(isinstance(s, KernelSensor) and s.separable for s in different):
        _require(None, ())
    return np.array([s.context for s in different]), np.array([rows[id(s)] for s in sensors], dtype=np.int64)


def step(belief: FloatArray, report: FloatArray) -> float:
    """Move a packed belief (29,) to the time of a report (74,) and condition it on it, in place; returns the NIS.

    NaN where an innovation variance was not positive; BACKWARDS (-1), with nothing changed, where the report is before
    the belief or its time is not a number. Raises UserError for arrays that are not as `pack` and `report` make them.
    """
    nis: float = packed_step(belief, report)
    if nis == MISFIT:
        raise UserError(NOT_PACKED)
    return nis


def run(belief: FloatArray, reports: Table, kept: FloatArray = NONE_KEPT, nis: FloatArray = NO_NIS) -> None:
    """Filter a whole stream, in place: `belief` (29,) is that after the last report.

    Filled unless they are empty: `kept` (k, 27) with the numbers of the belief after every report (see
    kernels.blocks), `nis` (k,). Raises UserError where time runs backwards or an innovation variance is not positive.
    """
    require_table(belief, reports, kept, nis, BELIEF_SIZE, CONTEXT_SIZE)
    done = _stream(belief, *reports, kept, nis)
    if done < len(reports.t):
        raise UserError(
            f"the filter cannot go past report {done} at t = {reports.t[done]!r}: it is before the one before, or the "
            "innovation covariance is not positive definite (check the prior and the noise)"
        )


def require_table(
    belief: FloatArray, reports: Table, kept: FloatArray, nis: FloatArray, size: int | None, context: int | None
) -> None:
    """Raise UserError unless the arrays of a stream fit each other; `size` and `context` are lengths (None: any)."""
    arrays = {"belief": belief, "kept": kept, "nis": nis, **reports._asdict()}
    for name, array in arrays.items():
        kind = np.int64 if name == "sensor" else np.float64
        if not isinstance(array, np.ndarray) or array.dtype != kind:
            raise UserError(f"run: {name} must be an array of {np.dtype(kind)}: take what pack and table make")
    k = len(reports.t)
    numbers = 27 if size is not None else 42
    fits = (
        belief.ndim == 1
        and (size is None or len(belief) == size)
        and belief.flags.writeable
        and reports.t.shape == (k,)
        and reports.z.shape == (k, 7)
        and reports.sensor.shape == (k,)
        and reports.contexts.ndim == 2
        and (context is None or reports.contexts.shape[1] == context)
        and (kept.size == 0 or kept.shape == (k, numbers))
        and (nis.size == 0 or nis.shape == (k,))
    )
    if not fits:
        raise UserError(f"run: arrays of other shapes than pack and table make, or kept is not ({k}, {numbers})")
    if k and not (reports.sensor.min() >= 0 and reports.sensor.max() < len(reports.contexts)):
        raise UserError(f"run: sensor holds an index outside the {len(reports.contexts)} contexts")


def run_many(
    motion: NearlyConstantVelocity,
    t0: float,
    x0: FloatArray,
    P0: FloatArray,
    t: FloatArray,
    sensors: Sequence[KernelSensor],
    z: Sequence[FloatArray],
    *,
    keep: bool = False,
    threads: int = 0,
) -> BatchResult:
    """Filter N tracks that share the times `t` (k,) and the sensor of each report, each with measurements of its own.

    x0 (N, 6) at `t0` (s), P0 (6, 6) or (N, 6, 6); z holds for each report (N, m), NaN where a track was not detected.
    Tracks are worked on in tiles of 64, over `threads` (0: one per core). With `keep`, the means after every report are
    kept. Raises UserError where `fits` is false, times run backwards or shapes do not fit.
    """
    _require(motion, sensors)
    checked(t0, x0, t, sensors, z)
    n, k, width = len(x0), len(t), tiles.WIDTH
    contexts, which = schedule(sensors)
    blocks, measured = layout(x0, P0, z)
    m = len(blocks)
    score = np.empty((m, 2 * width))
    kept = np.empty((m, k, 27 * width)) if keep else NO_TILES
    times = np.ascontiguousarray(t, dtype=float)

    def part(rows: slice) -> None:
        own = kept[rows] if keep else kept
        tiles.run_tiles(
            blocks[rows], t0, motion.q, times, measured[rows], contexts, which, score[rows], own
        )  # fmt: skip

    spread(part, m, threads)
    x, P = dense(out_of_tiles(blocks, n))
    sums = out_of_tiles(score, n)
    path = kept.reshape(m, k, 27, width)[:, :, :6].transpose(1, 0, 3, 2).reshape(k, -1, 6)[:, :n] if keep else NO_TILES
    return BatchResult(x, P, sums[:, 0], sums[:, 1], path)


def checked(t0: float, x0: FloatArray, t: FloatArray, sensors: Sequence[KernelSensor], z: Sequence[FloatArray]) -> None:
    """Raise UserError unless there is one sensor and one (N, m) per time, and times do not run backwards."""
    n, k = len(x0), len(t)
    if np.shape(x0) != (n, 6) or not np.isfinite(np.asarray(x0, dtype=float)).all() or not np.isfinite(t0):
        raise UserError(f"the tracks' states must be finite and of shape (N, 6), not {np.shape(x0)}, at a finite time")
    if not len(sensors) == len(z) == k or not k or not n:
        raise UserError("give one sensor and one set of measurements per time, at least one time and one track")
    if not np.all(np.diff(t, prepend=t0) >= 0.0) or not np.isfinite(t).all():
        raise UserError("the reports' times must be finite, and none before t0 or the one before it")
    if any(np.shape(row) != (n, s.dimension) for s, row in zip(sensors, z)):
        raise UserError(f"measurements must be (N, m) with N = {n} tracks and m the components of the report's sensor")


def out_of_tiles(blocks: FloatArray, n: int) -> FloatArray:
    """Return N rows (N, c) of tiles (m, c·WIDTH): what `in_tiles` took apart."""
    rows = blocks.reshape(len(blocks), -1, tiles.WIDTH).transpose(0, 2, 1)
    return np.ascontiguousarray(rows).reshape(-1, rows.shape[2])[:n]


def layout(x0: FloatArray, P0: FloatArray, z: Sequence[FloatArray]) -> tuple[FloatArray, FloatArray]:
    """Return the beliefs (m, 27·WIDTH) and measurements (m, k, c·WIDTH) of N tracks as `kernels.tiles` has them."""
    n, width = len(x0), tiles.WIDTH
    m = -(-n // width)
    priors = np.asarray(P0, dtype=float)
    if priors.shape not in ((6, 6), (n, 6, 6)):
        raise UserError(f"the tracks' covariances must have the shape (6, 6) or (N, 6, 6), not {priors.shape}")
    variance = np.diagonal(priors, axis1=-2, axis2=-1)
    tolerance = 1e-6 * np.sqrt(np.abs(variance[..., :, None] * variance[..., None, :]))
    if not (variance >= 0.0).all() or not (np.abs(priors - np.swapaxes(priors, -1, -2)) <= tolerance).all():
        raise UserError("the tracks' covariances must be finite and symmetric, without negative variances")
    b = _numbers(np.asarray(x0, dtype=float), np.broadcast_to(P0, (n, 6, 6)))
    measured = np.full((m, len(z), max(row.shape[1] for row in z) * width), np.nan)
    for i, row in enumerate(z):
        measured[:, i, : row.shape[1] * width] = in_tiles(np.asarray(row, dtype=float), m).reshape(m, -1)
    return in_tiles(b, m).reshape(m, -1), measured


def in_tiles(rows: FloatArray, m: int) -> FloatArray:
    """Return (m, c, width) of N rows (N, c), the last one repeated to fill the last tile."""
    width = tiles.WIDTH
    full = np.concatenate((rows, np.repeat(rows[-1:], m * width - len(rows), axis=0)))
    return np.ascontiguousarray(full.reshape(m, width, -1).transpose(0, 2, 1))


def spread(part: Any, m: int, threads: int) -> None:
    """Call `part` on slices of m tiles, one slice a thread; the kernel runs without Python's lock."""
    workers = min(m, threads or os.cpu_count() or 1)
    if workers <= 1:
        part(slice(0, m))
        return
    cuts = np.linspace(0, m, workers + 1).astype(int)
    with ThreadPoolExecutor(workers) as pool:
        for done in [pool.submit(part, slice(int(a), int(b))) for a, b in pairwise(cuts)]:
            done.result()
