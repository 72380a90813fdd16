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
Gain = tuple[Three, Three, float, float]  # a, b, 1/s and y/s of one number: see `condition`
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
def across(B: Nine, h: Three) -> Three:
    """Return Bᵀ h."""
    return (
        B[0] * h[0] + B[3] * h[1] + B[6] * h[2],
        B[1] * h[0] + B[4] * h[1] + B[7] * h[2],
        B[2] * h[0] + B[5] * h[1] + B[8] * h[2],
    )


@njit(**INLINE)
def less(a: Three, f: float, b: Three) -> Three:
    """Return a - f·b."""
    return a[0] - f * b[0], a[1] - f * b[1], a[2] - f * b[2]


@njit(**INLINE)
def weigh(s: float, y: float) -> tuple[float, float, float, float]:
    """Return 1/s, y/s, the NIS y²/s and s; zeros and 1 where y is NaN; zeros, a NaN and s where s is not positive."""
    seen = y == y
    good = s > 0.0
    w = 1.0 / s if seen & good else 0.0
    y = y if seen else 0.0
    e = w * y
    return w, e, math.nan if seen & (not good) else e * y, s if seen else 1.0


@njit(**INLINE)
def condition(p: Three, v: Three, A: Six, B: Nine, C: Six, prior: Three, h: Three, y: float, r: float) -> Conditioned:
    """Condition on one number: innovation `y` at the position `prior`, slope `h` by position, noise variance `r`.

    a = A h, b = Bᵀ h, s = h·a + r. Returns the belief, the NIS y²/s, and s. Where y is NaN (not measured) nothing
    changes, NIS is 0 and s is 1; where s is not positive nothing changes and NIS is NaN.
    """
    a, b = times(A, h), across(B, h)
    y = y - dot(h, (p[0] - prior[0], p[1] - prior[1], p[2] - prior[2]))
    w, e, nis, s = weigh(dot(h, a) + r, y)
    p, v, A, B, C = apply(p, v, A, B, C, (a, b, w, e))
    return p, v, A, B, C, nis, s


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
    y = y - dot(h, (p[0] - prior[0], p[1] - prior[1], p[2] - prior[2]))
    y = y - dot(g, (v[0] - prior_v[0], v[1] - prior_v[1], v[2] - prior_v[2]))
    w, e, nis, s = weigh(dot(h, a) + dot(g, b) + r, y)
    p, v, A, B, C = apply(p, v, A, B, C, (a, b, w, e))
    return p, v, A, B, C, nis, s


@njit(**INLINE)
def apply(p: Three, v: Three, A: Six, B: Nine, C: Six, gain: Gain) -> Belief:
    """Return the belief with a gain applied: x⁺ = x + (a, b) y/s, P⁺ = P - (a, b)(a, b)ᵀ/s."""
    a, b, w, e = gain
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
    )  # fmt: skip


@njit(**INLINE)
def condition_two(
    p: Three, v: Three, A: Six, B: Nine, C: Six, h1: Three, y1: float, r1: float, h2: Three, y2: float, r2: float
) -> Conditioned:
    """Condition on two numbers, innovations and slopes at `p`: as `condition` on one and then the other.

    With A⁺ after the first number, a₂ = A⁺h₂ is A h₂ - a₁ (h₂·a₁)/s₁, and so for b₂, s₂ and y₂: the products with the
    belief come before the first division, not each behind the one before, and the processor waits less. Returns the
    sum of NIS and the product of s.
    """
    a1, b1, a2, b2 = times(A, h1), across(B, h1), times(A, h2), across(B, h2)
    c12 = dot(h2, a1)
    w1, e1, n1, s1 = weigh(dot(h1, a1) + r1, y1)
    f12 = w1 * c12
    w2, e2, n2, s2 = weigh(dot(h2, a2) + r2 - f12 * c12, y2 - c12 * e1)
    a2, b2 = less(a2, f12, a1), less(b2, f12, b1)
    p, v, A, B, C = apply(p, v, A, B, C, (a1, b1, w1, e1))
    p, v, A, B, C = apply(p, v, A, B, C, (a2, b2, w2, e2))
    return p, v, A, B, C, n1 + n2, s1 * s2


@njit(**INLINE)
def condition_three(
    p: Three, v: Three, A: Six, B: Nine, C: Six,
    h1: Three, y1: float, r1: float, h2: Three, y2: float, r2: float, h3: Three, y3: float, r3: float,
) -> Conditioned:  # fmt: skip
    """As `condition_two`, on three numbers."""
    a1, b1, a2, b2, a3, b3 = times(A, h1), across(B, h1), times(A, h2), across(B, h2), times(A, h3), across(B, h3)
    c12, c13, c23 = dot(h2, a1), dot(h3, a1), dot(h3, a2)
    w1, e1, n1, s1 = weigh(dot(h1, a1) + r1, y1)
    f12, f13 = w1 * c12, w1 * c13
    c23 = c23 - f12 * c13
    w2, e2, n2, s2 = weigh(dot(h2, a2) + r2 - f12 * c12, y2 - c12 * e1)
    f23 = w2 * c23
    w3, e3, n3, s3 = weigh(dot(h3, a3) + r3 - f13 * c13 - f23 * c23, y3 - c13 * e1 - c23 * e2)
    a2, b2 = less(a2, f12, a1), less(b2, f12, b1)
    a3, b3 = less(less(a3, f13, a1), f23, a2), less(less(b3, f13, b1), f23, b2)
    p, v, A, B, C = apply(p, v, A, B, C, (a1, b1, w1, e1))
    p, v, A, B, C = apply(p, v, A, B, C, (a2, b2, w2, e2))
    p, v, A, B, C = apply(p, v, A, B, C, (a3, b3, w3, e3))
    return p, v, A, B, C, n1 + n2 + n3, s1 * s2 * s3
