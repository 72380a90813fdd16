"""Combining estimates of one thing: independent, correlated in a known way, or in an unknown one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from boresight.errors import UserError
from boresight.types.sensor import FloatArray

GOLDEN = (5.0**0.5 - 1.0) / 2.0


class Fused(NamedTuple):
    """A combined estimate."""

    x: FloatArray  # (n,)
    P: FloatArray  # (n, n)


def weighted_least_squares(z: ArrayLike, H: ArrayLike, R: ArrayLike) -> Fused:
    """Return (HᵀR⁻¹H)⁻¹HᵀR⁻¹z and its covariance (n, n) from z (m,), H (m, n), R (m, m), correlated or not.

    Raises UserError where the reports do not fix all n unknowns, or R is not positive definite.
    """
    h, y = np.asarray(H, dtype=np.float64), np.asarray(z, dtype=np.float64)
    try:
        root = np.linalg.cholesky(np.asarray(R, dtype=np.float64))
    except np.linalg.LinAlgError:
        raise UserError("least squares needs a positive definite covariance of the reports") from None
    A, b = np.linalg.solve(root, h), np.linalg.solve(root, y)
    if np.linalg.matrix_rank(A) < h.shape[1]:
        raise UserError(f"{h.shape[0]} reports do not fix all {h.shape[1]} unknowns")
    Q, T = np.linalg.qr(A)
    inverse = np.linalg.inv(T)
    return Fused(inverse @ (Q.T @ b), inverse @ inverse.T)


def fuse_tracks(x1: ArrayLike, P1: ArrayLike, x2: ArrayLike, P2: ArrayLike, cross: ArrayLike | None = None) -> Fused:
    """Return the best linear combination of two tracks (n,), (n, n) whose errors have E[e₁e₂ᵀ] = `cross` (n, n).

    Bar-Shalom & Campo 1986: weighted least squares with H = [I I]ᵀ. None means independent; where neither is known,
    `covariance_intersection`. Raises UserError as `weighted_least_squares`.
    """
    a, b = np.asarray(x1, dtype=np.float64), np.asarray(x2, dtype=np.float64)
    C = np.zeros((len(a), len(b))) if cross is None else np.asarray(cross, dtype=np.float64)
    R = np.block([[np.asarray(P1, dtype=np.float64), C], [C.T, np.asarray(P2, dtype=np.float64)]])
    return weighted_least_squares(np.concatenate([a, b]), np.vstack([np.eye(len(a))] * 2), R)


def covariance_intersection(x: Sequence[ArrayLike], P: Sequence[ArrayLike]) -> Fused:
    """Combine estimates (n,), (n, n) of unknown correlation, two at a time: never optimistic, whatever it is.

    P⁻¹ = ωP₁⁻¹ + (1 − ω)P₂⁻¹ with the ω that gives the smallest determinant (Julier & Uhlmann 1997). Raises UserError
    for no estimate, or a covariance that is not positive definite.
    """
    if not x or len(x) != len(P):
        raise UserError("covariance intersection needs at least one estimate, and a covariance for each")
    means = [np.asarray(v, dtype=np.float64) for v in x]
    informations: list[FloatArray] = []
    for p in P:
        C = np.asarray(p, dtype=np.float64)
        if not (np.linalg.eigvalsh(C) > 0).all():
            raise UserError("covariance intersection needs positive definite covariances")
        informations.append(np.asarray(np.linalg.inv(C)))
    J: FloatArray = informations[0]
    y: FloatArray = J @ means[0]
    for I2, m in zip(informations[1:], means[1:]):
        w = _best_share(J, I2)
        J, y = w * J + (1.0 - w) * I2, w * y + (1.0 - w) * I2 @ m
    covariance = np.linalg.inv(J)
    return Fused(covariance @ y, 0.5 * (covariance + covariance.T))


def _best_share(A: FloatArray, B: FloatArray) -> float:
    """Return ω of [0, 1] with the largest det(ωA + (1 − ω)B), whose logarithm is concave: golden section."""

    def height(w: float) -> float:
        return float(np.linalg.slogdet(w * A + (1.0 - w) * B)[1])

    low, high = 0.0, 1.0
    for _ in range(40):
        a, b = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
        low, high = (a, high) if height(a) < height(b) else (low, b)
    best = 0.5 * (low + high)
    return max((0.0, 1.0, best), key=height)
