"""Validation that the models share."""

from __future__ import annotations

import numpy as np

from boresight.errors import UserError
from boresight.types.sensor import FloatArray


def positive(name: str, value: float | None) -> None:
    """Raise UserError unless `value` is None or positive and finite."""
    if value is not None and not (np.isfinite(value) and value > 0.0):
        raise UserError(f"{name} must be a positive number, not {value!r}")


def spatial(dimensions: int) -> None:
    """Raise UserError unless `dimensions` is 2 or 3."""
    if dimensions not in (2, 3):
        raise UserError(f"dimensions must be 2 or 3, not {dimensions!r}")


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
