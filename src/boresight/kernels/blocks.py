"""The algebra of one track in scalars: position and velocity in space, nearly constant velocity, one number at a time.

The belief is five tuples: mean position p and velocity v, and the covariance by blocks

    P = | A  B |     A = (ee, en, eu, nn, nu, uu) of position, symmetric, kept once,
        | Bᵀ C |     B by rows (position e against velocity e, n, u; …), C as A, of velocity.

The same functions make the filter of a single report, of a whole stream (`kernels.packed`) and of many tracks at once
(`kernels.tiles`), where LLVM turns every scalar below into a vector over tracks. A report's components are taken one
after another, so no matrix is inverted, and the covariance cannot lose its symmetry.
"""

from __future__ import annotations

import math

from numba import njit

from boresight.kernels.arctan import INLINE
from boresight.types.sensor import FloatArray

Three = tuple[float, float, float]
Six = tuple[float, float, float, float, float, float]
Nine = tuple[float, float, float, float, float, float, float, float, float]
Belief = tuple[Three, Three, Six, Nine, Six]

Conditioned = tuple[Three, Three, Six, Nine, Six, float, float]  # the belief, NIS, innovation variance

ROWS = 27  # numbers of a belief


@njit(**INLINE)
def load(b: FloatArray, at: int, step: int) -> Belief:
    """Read the belief whose numbers lie `step` apart from index `at` on."""
    return (
        (b[at], b[at + step], b[at + 2 * step]),
        (b[at + 3 * step], b[at + 4 * step], b[at + 5 * step]),
        (
            b[at + 6 * step], b[at + 7 * step], b[at + 8 * step],
            b[at + 9 * step], b[at + 10 * step],
            b[at + 11 * step],
        ),
        (
            b[at + 12 * step], b[at + 13 * step], b[at + 14 * step],
            b[at + 15 * step], b[at + 16 * step], b[at + 17 * step],
            b[at + 18 * step], b[at + 19 * step], b[at + 20 * step],
        ),
        (
            b[at + 21 * step], b[at + 22 * step], b[at + 23 * step],
            b[at + 24 * step], b[at + 25 * step],
            b[at + 26 * step],
        ),
    )  # fmt: skip


@njit(**INLINE)
def store(b: FloatArray, at: int, step: int, p: Three, v: Three, A: Six, B: Nine, C: Six) -> None:
    """Write a belief as `load` reads it."""
    for i in range(3):
        b[at + i * step] = p[i]
        b[at + (3 + i) * step] = v[i]
    for i in range(6):
        b[at + (6 + i) * step] = A[i]
        b[at + (21 + i) * step] = C[i]
    for i in range(9):
        b[at + (12 + i) * step] = B[i]


@njit(**INLINE)
def move(p: Three, v: Three, A: Six, B: Nine, C: Six, dt: float, q: float) -> Belief:
    """Move by `dt` (s) at nearly constant velocity, white acceleration q (m²/s³) (Bar-Shalom 2001, 6.2).

    p⁺ = p + dt v, B⁺ = B + dt C + q dt²/2, A⁺ = A + dt (B + Bᵀ) + dt² C + q dt³/3 = A + dt (B + (B + dt C)ᵀ) + q dt³/3,
    C⁺ = C + q dt, the noise on the diagonals.
    """
    D = (
        B[0] + dt * C[0], B[1] + dt * C[1], B[2] + dt * C[2],
        B[3] + dt * C[1], B[4] + dt * C[3], B[5] + dt * C[4],
        B[6] + dt * C[2], B[7] + dt * C[4], B[8] + dt * C[5],
    )  # fmt: skip
    q1, q2, q3 = q * dt, q * dt * dt * 0.5, q * dt * dt * dt * (1.0 / 3.0)
    return (
        (p[0] + dt * v[0], p[1] + dt * v[1], p[2] + dt * v[2]),
        v,
        (
            A[0] + dt * (B[0] + D[0]) + q3, A[1] + dt * (B[1] + D[3]), A[2] + dt * (B[2] + D[6]),
            A[3] + dt * (B[4] + D[4]) + q3, A[4] + dt * (B[5] + D[7]),
            A[5] + dt * (B[8] + D[8]) + q3,
        ),
        (D[0] + q2, D[1], D[2], D[3], D[4] + q2, D[5], D[6], D[7], D[8] + q2),
        (C[0] + q1, C[1], C[2], C[3] + q1, C[4], C[5] + q1),
    )  # fmt: skip


@njit(**INLINE)
def times(S: Six, h: Three) -> Three:
    """Return S h for symmetric S."""
    return (
        S[0] * h[0] + S[1] * h[1] + S[2] * h[2],
        S[1] * h[0] + S[3] * h[1] + S[4] * h[2],
        S[2] * h[0] + S[4] * h[1] + S[5] * h[2],
    )


@njit(**INLINE)
def dot(a: Three, b: Three) -> float:
    """Return a·b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(**INLINE)
def condition(p: Three, v: Three, A: Six, B: Nine, C: Six, prior: Three, h: Three, y: float, r: float) -> Conditioned:
    """Condition on one number: innovation `y` at the position `prior`, slope `h` by position, noise variance `r`.

    a = A h, b = Bᵀ h, s = h·a + r. Returns the belief, the NIS y²/s, and s. Where y is NaN (not measured) nothing
    changes, NIS is 0 and s is 1; where s is not positive nothing changes and NIS is NaN.
    """
    a = times(A, h)
    b = (
        B[0] * h[0] + B[3] * h[1] + B[6] * h[2],
        B[1] * h[0] + B[4] * h[1] + B[7] * h[2],
        B[2] * h[0] + B[5] * h[1] + B[8] * h[2],
    )
    s = dot(h, a) + r
    y = y - dot(h, (p[0] - prior[0], p[1] - prior[1], p[2] - prior[2]))
    out: Conditioned = _gain(p, v, A, B, C, a, b, s, y)
    return out


@njit(**INLINE)
def spread(A: Six, B: Nine, C: Six, h: Three, g: Three) -> tuple[Three, Three]:
    """Return P (h, g)ᵀ by blocks: a = A h + B g, b = Bᵀ h + C g."""
    Ah, Cg = times(A, h), times(C, g)
    return (
        Ah[0] + B[0] * g[0] + B[1] * g[1] + B[2] * g[2],
        Ah[1] + B[3] * g[0] + B[4] * g[1] + B[5] * g[2],
        Ah[2] + B[6] * g[0] + B[7] * g[1] + B[8] * g[2],
    ), (
        Cg[0] + B[0] * h[0] + B[3] * h[1] + B[6] * h[2],
        Cg[1] + B[1] * h[0] + B[4] * h[1] + B[7] * h[2],
        Cg[2] + B[2] * h[0] + B[5] * h[1] + B[8] * h[2],
    )


@njit(**INLINE)
def condition_rate(
    p: Three, v: Three, A: Six, B: Nine, C: Six, prior: Three, prior_v: Three, h: Three, g: Three, y: float, r: float
) -> Conditioned:
    """As `condition`, for a number that depends on velocity too, with slope `g`."""
    a, b = spread(A, B, C, h, g)
    s = dot(h, a) + dot(g, b) + r
    y = y - dot(h, (p[0] - prior[0], p[1] - prior[1], p[2] - prior[2]))
    y = y - dot(g, (v[0] - prior_v[0], v[1] - prior_v[1], v[2] - prior_v[2]))
    out: Conditioned = _gain(p, v, A, B, C, a, b, s, y)
    return out


@njit(**INLINE)
def _gain(p: Three, v: Three, A: Six, B: Nine, C: Six, a: Three, b: Three, s: float, y: float) -> Conditioned:
    """Return the belief with the gain (a, b)/s applied: x⁺ = x + (a, b) y/s, P⁺ = P - (a, b)(a, b)ᵀ/s."""
    seen = y == y
    good = s > 0.0
    w = 1.0 / s if seen & good else 0.0
    y = y if seen else 0.0
    e = w * y
    k = (w * a[0], w * a[1], w * a[2])
    m = (w * b[0], w * b[1], w * b[2])
    return (
        (p[0] + a[0] * e, p[1] + a[1] * e, p[2] + a[2] * e),
        (v[0] + b[0] * e, v[1] + b[1] * e, v[2] + b[2] * e),
        (
            A[0] - a[0] * k[0], A[1] - a[0] * k[1], A[2] - a[0] * k[2],
            A[3] - a[1] * k[1], A[4] - a[1] * k[2],
            A[5] - a[2] * k[2],
        ),
        (
            B[0] - a[0] * m[0], B[1] - a[0] * m[1], B[2] - a[0] * m[2],
            B[3] - a[1] * m[0], B[4] - a[1] * m[1], B[5] - a[1] * m[2],
            B[6] - a[2] * m[0], B[7] - a[2] * m[1], B[8] - a[2] * m[2],
        ),
        (
            C[0] - b[0] * m[0], C[1] - b[0] * m[1], C[2] - b[0] * m[2],
            C[3] - b[1] * m[1], C[4] - b[1] * m[2],
            C[5] - b[2] * m[2],
        ),
        math.nan if seen & (not good) else e * y,
        s if seen else 1.0,
    )  # fmt: skip
