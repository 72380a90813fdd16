"""Columns for the kernels, and the one way in which a bad row is told."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from boresight.errors import UserError
from boresight.types.sensor import FloatArray

Input = float | ArrayLike  # what a transform takes for one coordinate
Value = Any  # a float for scalar input, a float64 array for arrays
Values = tuple[Value, Value, Value]


def columns(*values: ArrayLike) -> tuple[list[FloatArray], tuple[int, ...]]:
    """Return the values broadcast against each other as flat float64 columns, and their common shape."""
    arrays = [_own(v) for v in values]
    shape = np.broadcast_shapes(*(a.shape for a in arrays))
    if all(a.shape == shape for a in arrays):
        return [np.ascontiguousarray(a).reshape(-1) for a in arrays], shape
    return [np.broadcast_to(a, shape).flatten() for a in arrays], shape


def _own(values: ArrayLike) -> FloatArray:
    """Return float64 that the kernels take: a read-only view would make them compile once more."""
    a = np.asarray(values, dtype=np.float64)
    return a if a.flags.owndata or a.flags.writeable else a.copy()


def rows(values: ArrayLike, *tail: int, what: str) -> tuple[FloatArray, tuple[int, ...]]:
    """Return (..., *tail) as (n, *tail) float64 with the leading shape; raises UserError for another shape."""
    a = _own(values)
    if a.shape[a.ndim - len(tail) :] != tail:
        raise UserError(f"{what} has shape {a.shape}; it must end in {tail}")
    lead = a.shape[: a.ndim - len(tail)]
    return np.ascontiguousarray(a.reshape(-1, *tail)), lead


def triple(
    scalar: Callable[..., tuple[float, float, float]],
    many: Callable[..., tuple[FloatArray, FloatArray, FloatArray]],
    values: Sequence[ArrayLike],
    extra: tuple[float, ...],
    bounds: str,
) -> Values:
    """Run a kernel of three in, three out on scalars or on arrays; a NaN in the result is a UserError."""
    cols, shape = columns(*values)
    if shape == ():
        out: tuple[Any, Any, Any] = scalar(*(float(c[0]) for c in cols), *extra)
    else:
        out = many(*cols, *extra)
    total = out[0] + out[1] + out[2]
    if not np.isfinite(total).all():
        row = int(np.flatnonzero(~np.isfinite(np.atleast_1d(total)))[0])
        raise UserError(bad(bounds, row, [float(c[row]) for c in cols]))
    if shape == () or len(shape) == 1:
        return out
    return out[0].reshape(shape), out[1].reshape(shape), out[2].reshape(shape)


def bad(bounds: str, row: int, values: Sequence[float]) -> str:
    """Return the message for a row that is out of bounds."""
    shown = ", ".join(f"{v:.10g}" for v in values)
    return f"row {row}: ({shown}) is out of bounds: {bounds}"
