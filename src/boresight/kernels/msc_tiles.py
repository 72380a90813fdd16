"""Modified spherical coordinates over tiles of tracks, for sensors at the observer with north-aligned axes.

The belief is kept as in `blocks`, with q = (azimuth θ, elevation β, 1/r) in place of position and w = (ω, β̇, ρ = ṙ/r)
in place of velocity (see kernels.msc). In the local axes (e_θ, e_β, u) of the line of sight the Jacobian of Cartesian
position and velocity is

    | D  0  |     D = diag(r cos β, r, -r²),     G = r | ρ cos β - β̇ sin β   0   -r ω |
    | G  rI |                                         | ω sin β             ρ   -r β̇ |
                                                      | -ω cos β           -β̇   -r ρ |

so that the covariance goes to Cartesian and back cheaply. Nearly constant velocity is the same in all axes: it is
applied in the old local axes, and what is left is one rotation into the new ones. The filter of `kernels.msc_stream`.
"""

# Numba caches by file and compiles kernels.tiles and what it calls into these: clear __pycache__ when those change.
from __future__ import annotations

import math

from numba import njit, types

from boresight.kernels.arctan import INLINE, WIDE, WIDE_PASS, arctan2, near
from boresight.kernels.blocks import ROWS, Nine, Six, Three, condition_three, dot, load, move, store
from boresight.kernels.observation import NOISE, IntArray
from boresight.kernels.signatures import MATRIX, STACK, VECTOR
from boresight.kernels.tiles import DET, NIS, SCORE, WIDTH, WORK, aligned
from boresight.kernels.trig import sincos_of_small
from boresight.kernels.write import write_vector
from boresight.types.sensor import FloatArray

Blocks = tuple[Six, Nine, Six]


@njit(**INLINE)
def axes(se: float, ce: float, sa: float, ca: float) -> Nine:
    """Return rows e_θ, e_β, u in ENU from sines and cosines of elevation and azimuth."""
    return ca, -sa, 0.0, -se * sa, -se * ca, ce, ce * sa, ce * ca, se


@njit(**INLINE)
def times(A: Nine, B: Nine) -> Nine:
    """Return A B."""
    return (
        A[0] * B[0] + A[1] * B[3] + A[2] * B[6], A[0] * B[1] + A[1] * B[4] + A[2] * B[7],
        A[0] * B[2] + A[1] * B[5] + A[2] * B[8],
        A[3] * B[0] + A[4] * B[3] + A[5] * B[6], A[3] * B[1] + A[4] * B[4] + A[5] * B[7],
        A[3] * B[2] + A[4] * B[5] + A[5] * B[8],
        A[6] * B[0] + A[7] * B[3] + A[8] * B[6], A[6] * B[1] + A[7] * B[4] + A[8] * B[7],
        A[6] * B[2] + A[7] * B[5] + A[8] * B[8],
    )  # fmt: skip


@njit(**INLINE)
def transposed(A: Nine) -> Nine:
    """Return Aᵀ."""
    return A[0], A[3], A[6], A[1], A[4], A[7], A[2], A[5], A[8]


@njit(**INLINE)
def whole(S: Six) -> Nine:
    """Return a symmetric matrix with both halves."""
    return S[0], S[1], S[2], S[1], S[3], S[4], S[2], S[4], S[5]


@njit(**INLINE)
def half(M: Nine) -> Six:
    """Return the upper half of a matrix that is symmetric."""
    return M[0], M[1], M[2], M[4], M[5], M[8]


@njit(**INLINE)
def slope(se: float, ce: float, r: float, w: Three) -> tuple[Three, Nine]:
    """Return the diagonal of D, and G (rows e_θ, e_β, u)."""
    return (r * ce, r, -r * r), (
        r * (w[2] * ce - w[1] * se), 0.0, -r * r * w[0],
        r * w[0] * se, r * w[2], -r * r * w[1],
        -r * w[0] * ce, -r * w[1], -r * r * w[2],
    )  # fmt: skip


@njit(**INLINE)
def local_from_msc(D: Three, G: Nine, r: float, A: Six, B: Nine, C: Six) -> Blocks:
    """Return the Cartesian covariance in local axes: with K = A Gᵀ + r B, it is DAD, DK, GK + r BᵀGᵀ + r² C."""
    M = times(whole(A), transposed(G))
    K = (
        M[0] + r * B[0], M[1] + r * B[1], M[2] + r * B[2], M[3] + r * B[3], M[4] + r * B[4], M[5] + r * B[5],
        M[6] + r * B[6], M[7] + r * B[7], M[8] + r * B[8],
    )  # fmt: skip
    U, V = times(G, K), times(transposed(B), transposed(G))
    return (
        (D[0] * D[0] * A[0], D[0] * D[1] * A[1], D[0] * D[2] * A[2], D[1] * D[1] * A[3], D[1] * D[2] * A[4],
         D[2] * D[2] * A[5]),
        (D[0] * K[0], D[0] * K[1], D[0] * K[2], D[1] * K[3], D[1] * K[4], D[1] * K[5], D[2] * K[6], D[2] * K[7],
         D[2] * K[8]),
        (U[0] + r * (V[0] + r * C[0]), U[1] + r * (V[1] + r * C[1]), U[2] + r * (V[2] + r * C[2]),
         U[4] + r * (V[4] + r * C[3]), U[5] + r * (V[5] + r * C[4]), U[8] + r * (V[8] + r * C[5])),
    )  # fmt: skip


@njit(**INLINE)
def msc_from_local(D: Three, G: Nine, r: float, A: Six, B: Nine, C: Six) -> Blocks:
    """Undo `local_from_msc`: q = D⁻¹p, w = (v - Gq)/r, so with T = D⁻¹B - (D⁻¹AD⁻¹)Gᵀ: T/r, (C - GT - BᵀD⁻¹Gᵀ)/r²."""
    d, w = (1.0 / D[0], 1.0 / D[1], 1.0 / D[2]), 1.0 / r
    q = (d[0] * d[0] * A[0], d[0] * d[1] * A[1], d[0] * d[2] * A[2], d[1] * d[1] * A[3], d[1] * d[2] * A[4],
         d[2] * d[2] * A[5])  # fmt: skip
    F = (d[0] * B[0], d[0] * B[1], d[0] * B[2], d[1] * B[3], d[1] * B[4], d[1] * B[5], d[2] * B[6], d[2] * B[7],
         d[2] * B[8])  # fmt: skip
    M = times(whole(q), transposed(G))
    T = (F[0] - M[0], F[1] - M[1], F[2] - M[2], F[3] - M[3], F[4] - M[4], F[5] - M[5], F[6] - M[6], F[7] - M[7],
         F[8] - M[8])  # fmt: skip
    U, V = times(G, T), times(transposed(F), transposed(G))
    return (
        q,
        (w * T[0], w * T[1], w * T[2], w * T[3], w * T[4], w * T[5], w * T[6], w * T[7], w * T[8]),
        (w * w * (C[0] - U[0] - V[0]), w * w * (C[1] - U[1] - V[1]), w * w * (C[2] - U[2] - V[2]),
         w * w * (C[3] - U[4] - V[4]), w * w * (C[4] - U[5] - V[5]), w * w * (C[5] - U[8] - V[8])),
    )  # fmt: skip


@njit(**WIDE_PASS)
def move_msc_tile(b: FloatArray, dt: float, q: float, shift: Three, push: Three) -> None:
    """Move every track by `dt`; `shift` (m) and `push` (m/s) are what the observer's own acceleration does to it."""
    for l in range(WIDTH):
        place, rates, A, B, C = load(b, l, WIDTH)
        sa, ca = sincos_of_small(place[0])
        se, ce = sincos_of_small(place[1])
        r = 1.0 / place[2]
        E = axes(se, ce, sa, ca)
        D, G = slope(se, ce, r, rates)
        A, B, C = local_from_msc(D, G, r, A, B, C)
        p, v, A, B, C = move((0.0, 0.0, r), (r * rates[0], r * rates[1], r * rates[2]), A, B, C, dt, q)
        position = (
            E[0] * p[0] + E[3] * p[1] + E[6] * p[2] + shift[0],
            E[1] * p[0] + E[4] * p[1] + E[7] * p[2] + shift[1],
            E[2] * p[0] + E[5] * p[1] + E[8] * p[2] + shift[2],
        )
        velocity = (
            E[0] * v[0] + E[3] * v[1] + E[6] * v[2] + push[0],
            E[1] * v[0] + E[4] * v[1] + E[7] * v[2] + push[1],
            E[2] * v[0] + E[5] * v[1] + E[8] * v[2] + push[2],
        )
        flat2 = position[0] * position[0] + position[1] * position[1]
        flat, r = math.sqrt(flat2), math.sqrt(flat2 + position[2] * position[2])
        w = 1.0 / (r * flat)
        sa, ca, se, ce = position[0] * w * r, position[1] * w * r, position[2] * w * flat, flat * w * flat
        N = axes(se, ce, sa, ca)
        b_new = w * flat
        rates = (
            b_new * dot((N[0], N[1], N[2]), velocity),
            b_new * dot((N[3], N[4], N[5]), velocity),
            b_new * dot((N[6], N[7], N[8]), velocity),
        )
        R = times(N, transposed(E))
        A = half(times(times(R, whole(A)), transposed(R)))
        B = times(times(R, B), transposed(R))
        C = half(times(times(R, whole(C)), transposed(R)))
        D, G = slope(se, ce, r, rates)
        A, B, C = msc_from_local(D, G, r, A, B, C)
        place = (arctan2(position[0], position[1]), arctan2(position[2], flat), b_new)
        store(b, l, WIDTH, place, rates, A, B, C)
        b[SCORE * WIDTH + l] += b[NIS * WIDTH + l]


@njit(**WIDE_PASS)
def report_msc_tile(b: FloatArray, z: FloatArray, noise: Three, ranged: float) -> None:
    """Condition every track on range (if `ranged` is 1), azimuth and elevation: z (3·WIDTH,).

    A step that would take 1/r to zero or below is cut at a tenth of it: range stays positive.
    """
    for l in range(WIDTH):
        q, w, A, B, C = load(b, l, WIDTH)
        r, least = 1.0 / q[2], 0.1 * q[2]
        y0 = z[l] - r if ranged > 0.0 else math.nan
        y1, y2 = near(z[WIDTH + l] - q[0]), near(z[2 * WIDTH + l] - q[1])
        h_r, h_a, h_e = (0.0, 0.0, -r * r), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)
        q, w, A, B, C, nis, s = condition_three(q, w, A, B, C, h_r, y0, noise[0], h_a, y1, noise[1], h_e, y2, noise[2])
        q = (near(q[0]), q[1], max(q[2], least))
        store(b, l, WIDTH, q, w, A, B, C)
        b[NIS * WIDTH + l] = nis
        b[DET * WIDTH + l] = s
        used = (1.0 if y0 == y0 else 0.0) + (1.0 if y1 == y1 else 0.0) + (1.0 if y2 == y2 else 0.0)
        b[(SCORE + 1) * WIDTH + l] += used


@njit(**WIDE_PASS)
def run_msc_tile(
    b: FloatArray,
    tile: FloatArray,
    t0: float,
    q: float,
    own0: FloatArray,
    own: FloatArray,
    t: FloatArray,
    z: FloatArray,
    contexts: FloatArray,
    sensor: IntArray,
    score: FloatArray,
) -> None:
    """Filter the reports of one tile, see `run_msc_tiles`; `b` (WORK,) is scratch."""
    write_vector(b, tile)
    b[NIS * WIDTH :] = 0.0
    now, before = t0, own0
    for k in range(t.shape[0]):
        dt, here = t[k] - now, own[k]
        shift = (
            before[0] + dt * before[3] - here[0],
            before[1] + dt * before[4] - here[1],
            before[2] + dt * before[5] - here[2],
        )
        move_msc_tile(b, dt, q, shift, (before[3] - here[3], before[4] - here[4], before[5] - here[5]))
        now, before = t[k], here
        c = contexts[sensor[k]]
        noise = (c[NOISE], c[NOISE + 8], c[NOISE + 16])
        report_msc_tile(b, z[k], noise, 1.0 if c[NOISE] > 0.0 else 0.0)
    write_vector(tile, b[: ROWS * WIDTH])
    write_vector(score, b[SCORE * WIDTH :])
    for l in range(WIDTH):
        score[l] += b[NIS * WIDTH + l]


@njit(
    types.void(
        MATRIX, types.float64, types.float64, VECTOR, MATRIX, VECTOR, STACK, MATRIX, types.int64[::1], MATRIX,
    ),
    nogil=True,
    **WIDE,
)  # fmt: skip
def run_msc_tiles(
    tiles: FloatArray,
    t0: float,
    q: float,
    own0: FloatArray,
    own: FloatArray,
    t: FloatArray,
    z: FloatArray,
    contexts: FloatArray,
    sensor: IntArray,
    score: FloatArray,
) -> None:
    """As `tiles.run_tiles`, beliefs in MSC about an observer at `own0` (6,) and `own` (k, 6); z (m, k, 3·WIDTH)."""
    b = aligned(WORK)
    for i in range(tiles.shape[0]):
        run_msc_tile(b, tiles[i], t0, q, own0, own, t, z[i], contexts, sensor, score[i])
