"""The extended Kalman filter of `filters.packed` for a user's own models of six states, in place or a stream at a time.

The models are kernels (see `models.own`); the filter's own kernels are compiled once and cached, and call them by
address. Other numbers of states go through `filters.stream`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from boresight.errors import UserError
from boresight.filters.packed import NOT_PACKED, Table, require_table, times_of
from boresight.kernels import config
from boresight.kernels.address import address_of
from boresight.kernels.own import (
    CONTEXT,
    COVARIANCE,
    MEAN,
    MEASURED,
    MISFIT,
    PARAMETERS,
    TIME,
    N,
    own_step,
    own_stream,
)
from boresight.kernels.signatures import MOTION, OBSERVATION
from boresight.models import check
from boresight.models.base import KernelSensor
from boresight.models.motion.base import KernelMotion
from boresight.models.own import OwnSensor
from boresight.types.sensor import FloatArray
from boresight.types.state import GaussianState

__all__ = ["Models", "models", "pack", "report", "run", "step", "table", "unpack"]

NONE_KEPT, NO_NIS = np.empty((0, PARAMETERS - MEAN)), np.empty(0)


class Models(NamedTuple):
    """A motion and an observation kernel by address, as `step` takes them; keep this as long as they are used."""

    motion: int
    observe: int
    kernels: tuple[Any, Any]


def models(motion: KernelMotion, sensor: KernelSensor | OwnSensor) -> Models:
    """Return the addresses of a motion model's and a sensor's kernel; raises UserError for other than six states."""
    if motion.state_dimension != N:
        raise UserError(f"this filter is for {N} states, not {motion.state_dimension}: take filters.stream")
    if config.DISABLE_JIT:
        raise UserError("kernels have no address with NUMBA_DISABLE_JIT=1: unset it, or take filters.ekf or stream")
    return Models(
        address_of(motion.kernel, MOTION), address_of(sensor.kernel, OBSERVATION), (motion.kernel, sensor.kernel)
    )


def pack(state: GaussianState, motion: KernelMotion) -> FloatArray:
    """Return the packed belief (43 and the motion's parameters): time, mean, covariance, parameters."""
    if np.shape(state.x) != (N,):
        raise UserError(f"this filter is for {N} states, not {np.size(state.x)}: take filters.stream")
    check.state("the state to pack", *state, size=N)
    return np.concatenate(([state.t], state.x, state.P.ravel(), motion.parameters))


def unpack(belief: FloatArray) -> GaussianState:
    """Return the state that a packed belief holds."""
    P = belief[COVARIANCE:PARAMETERS].reshape(N, N).copy()
    return GaussianState(float(belief[TIME]), belief[MEAN:COVARIANCE].copy(), P)


def report(sensor: KernelSensor | OwnSensor, t: float = np.nan, z: FloatArray | None = None) -> FloatArray:
    """Return a packed report of a sensor, to be filled and given to `step`: time, columns (7), context."""
    out = np.full(CONTEXT + len(sensor.context), np.nan)
    out[TIME], out[CONTEXT:] = t, sensor.context
    if z is not None:
        out[MEASURED:CONTEXT] = sensor.columns(z)
    return out


def table(t: Sequence[float] | FloatArray, sensors: Sequence[Any], z: Sequence[FloatArray]) -> Table:
    """Lay out reports as `packed.table`, for sensors that share one kernel and so one length of context."""
    if not len(t) == len(sensors) == len(z) or not len(t):
        raise UserError("give one time, one sensor and one measurement per report, and at least one report")
    different = {id(s): s for s in sensors}
    if len({id(s.kernel) for s in different.values()}) > 1:
        raise UserError("a stream needs one observation kernel: let it call the others, by a code in its context")
    rows = {key: i for i, key in enumerate(different)}
    which = np.array([rows[id(s)] for s in sensors], dtype=np.int64)
    columns = np.array([s.columns(row) for s, row in zip(sensors, z)])
    return Table(times_of(t), columns, np.array([s.context for s in different.values()]), which)


def step(belief: FloatArray, report: FloatArray, motion: int, observe: int) -> float:
    """Move a packed belief to the time of a report and condition it on it, in place; returns as `packed.step`.

    `motion` and `observe` are the addresses that `models` gives. Raises UserError for arrays that are not as `pack` and
    `report` make them.
    """
    nis: float = own_step(belief, report, motion, observe)
    if nis == MISFIT:
        raise UserError(NOT_PACKED)
    return nis


def run(
    belief: FloatArray, used: Models, reports: Table, kept: FloatArray = NONE_KEPT, nis: FloatArray = NO_NIS
) -> None:
    """Filter a whole stream in place; `kept` (k, 42), unless empty, gets mean and covariance. As `packed.run`."""
    if not isinstance(used, Models):
        raise UserError("run: the models must be what filters.own.models gives")
    require_table(belief, reports, kept, nis, None, None)
    if len(belief) < PARAMETERS:
        raise UserError(f"run: the belief must hold {PARAMETERS} numbers and the motion's parameters: take pack")
    done = own_stream(belief, used.motion, used.observe, *reports, kept, nis)
    if done < len(reports.t):
        raise UserError(
            f"the filter cannot go past report {done} at t = {reports.t[done]!r}: it is before the one before, or the "
            "innovation covariance is not positive definite (check the prior and the noise)"
        )
