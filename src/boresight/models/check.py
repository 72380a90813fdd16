"""Validation that the models share."""

from __future__ import annotations

from typing import Any

import numpy as np

from boresight.errors import UserError
from boresight.types.sensor import FloatArray

ROUNDING = 1e-6  # of a correlation matrix: asymmetry and least eigenvalue that rounding explains


def positive(name: str, value: float | None) -> None:
    """Raise UserError unless `value` is None or positive and finite."""
    if value is not None and not (np.isfinite(value) and value > 0.0):
        raise UserError(f"{name} must be a positive number, not {value!r}")


def spatial(dimensions: int) -> None:
    """Raise UserError unless `dimensions` is 2 or 3."""
    if dimensions not in (2, 3):
        raise UserError(f"dimensions must be 2 or 3, not {dimensions!r}")


def state(name: str, t: Any, x: Any, P: Any, size: int | None = None) -> None:
    """Raise UserError unless (t, x, P) is a Gaussian belief: arrays of finite numbers, `P` a covariance.

    `size` is the length that `x` must have; a variance may be zero.
    """
    for what, value in (("x", x), ("P", P)):
        if not isinstance(value, np.ndarray) or value.dtype.kind not in "fiu":
            kind = f"an array of {value.dtype}" if isinstance(value, np.ndarray) else type(value).__name__
            raise UserError(f"{name}: {what} must be an array of real numbers, not {kind}")
    n = len(x) if size is None and x.ndim else size
    if x.shape != (n,) or P.shape != (n, n):
        raise UserError(f"{name}: x must have the shape ({n},) and P ({n}, {n}), not {x.shape} and {P.shape}")
    if not isinstance(t, int | float | np.floating | np.integer) or not np.isfinite(t):
        raise UserError(f"{name}: t must be a time in seconds, not {t!r}")
    if not np.isfinite(x).all() or not np.isfinite(P).all():
        raise UserError(f"{name}: holds a number that is not finite")
    variance = np.diagonal(P)
    if (variance < 0.0).any():
        raise UserError(f"{name}: P holds a negative variance")
    sigma = np.sqrt(np.where(variance > 0.0, variance, 1.0))
    correlation = P / sigma[:, None] / sigma
    if not (np.abs(correlation - correlation.T) <= ROUNDING).all():
        raise UserError(f"{name}: P is not symmetric")
    if np.linalg.eigvalsh(correlation)[0] < -ROUNDING:
        raise UserError(f"{name}: P is not positive")


def measured(name: str, z: Any, size: int) -> None:
    """Raise UserError unless `z` are `size` numbers, NaN or finite."""
    try:
        values = np.asarray(z, dtype=np.float64)
    except (TypeError, ValueError):
        raise UserError(f"{name} must be {size} numbers, not {z!r}") from None
    if values.shape != (size,) or np.isinf(values).any():
        raise UserError(f"{name} must be {size} finite numbers, NaN where nothing was measured, not {z!r}")


def covariance(name: str, P: FloatArray, size: int) -> FloatArray:
    """Return a copy of `P`, exactly symmetric (size, size) array; raises UserError unless it is a covariance."""
    out: FloatArray = np.array(P, dtype=float)
    if out.shape != (size, size):
        raise UserError(f"{name} must have shape ({size}, {size}), not {out.shape}")
    if not np.all(np.isfinite(out)):
        raise UserError(f"{name} holds a value that is not finite")
    if not np.allclose(out, out.T, rtol=1e-8, atol=1e-12 * float(np.max(np.abs(out)))):
        raise UserError(f"{name} is not symmetric")
    out = np.asarray(0.5 * (out + out.T), dtype=float)
    try:
        np.linalg.cholesky(out)
    except np.linalg.LinAlgError:
        raise UserError(f"{name} is not positive definite") from None
    return out
