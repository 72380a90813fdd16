"""The unscented filter over tiles of tracks, for sensors of range, azimuth and elevation.

Nearly constant velocity is linear, so the prediction of the points is `blocks.move` exactly. What is measured depends
on position alone, and the Cholesky factor is lower triangular: of the 13 points of six states the six of the velocity's
columns share the mean's position. Seven points are looked at, with the weights of all 13: the filter of
`kernels.unscented`, to rounding. The residual covariance Ω joins the noise, R + Ω = L D Lᵀ; L⁻¹ makes the components
independent, to be taken one after another as everywhere.
"""

# Numba caches by file and compiles kernels.tiles and what it calls into these: clear __pycache__ when those change.
from __future__ import annotations

import math

from numba import njit, types

from boresight.kernels.arctan import INLINE, WIDE, WIDE_PASS, near
from boresight.kernels.blocks import ROWS, Nine, Six, Three, condition_three, less, load, store
from boresight.kernels.observation import NOISE, POSITION, ROTATION, IntArray
from boresight.kernels.sight import into, polar
from boresight.kernels.signatures import MATRIX, STACK, VECTOR
from boresight.kernels.tiles import DET, NIS, SCORE, WIDTH, WORK, aligned, move_tile
from boresight.kernels.write import write_vector
from boresight.types.sensor import FloatArray

Points = tuple[Three, Three, Three, Three, Three, Three, Three]


@njit(**INLINE)
def factor(A: Six) -> Six:
    """Return the lower Cholesky factor (00, 10, 20, 11, 21, 22) of symmetric A (00, 01, 02, 11, 12, 22)."""
    a = math.sqrt(A[0])
    w = 1.0 / a
    b, c = A[1] * w, A[2] * w
    d = math.sqrt(A[3] - b * b)
    e = (A[4] - b * c) / d
    return a, b, c, d, e, math.sqrt(A[5] - c * c - e * e)


@njit(**INLINE)
def values(R: Nine, d: Three) -> Three:
    """Return range, azimuth and elevation of `d` (world axes) in the sensor's axes, turned by R."""
    r, azimuth, elevation, _, _, _ = polar(into(R, d))
    return r, azimuth, elevation


@njit(**INLINE)
def off(a: Three, b: Three) -> Three:
    """Return a - b, angles wrapped."""
    return a[0] - b[0], near(a[1] - b[1]), near(a[2] - b[2])


@njit(**INLINE)
def seven(R: Nine, d: Three, L: Six, s: float) -> tuple[Three, Points]:
    """Return what the mean shows, and what the points d ± s·(columns of L) show beyond it: (0, +, +, +, -, -, -)."""
    middle = values(R, d)
    p, q, r = (s * L[0], s * L[1], s * L[2]), (s * L[3], s * L[4]), s * L[5]
    return middle, (
        (0.0, 0.0, 0.0),
        off(values(R, (d[0] + p[0], d[1] + p[1], d[2] + p[2])), middle),
        off(values(R, (d[0], d[1] + q[0], d[2] + q[1])), middle),
        off(values(R, (d[0], d[1], d[2] + r)), middle),
        off(values(R, (d[0] - p[0], d[1] - p[1], d[2] - p[2])), middle),
        off(values(R, (d[0], d[1] - q[0], d[2] - q[1])), middle),
        off(values(R, (d[0], d[1], d[2] - r)), middle),
    )


@njit(**INLINE)
def slope(Y: Points, a: int, L: Six, k: float) -> tuple[Three, Three]:
    """Return component a's statistical slope by position, L⁻ᵀc, and c = k (Y₊ - Y₋)."""
    c = (k * (Y[1][a] - Y[4][a]), k * (Y[2][a] - Y[5][a]), k * (Y[3][a] - Y[6][a]))
    h2 = c[2] / L[5]
    h1 = (c[1] - L[4] * h2) / L[3]
    return ((c[0] - L[1] * h1 - L[2] * h2) / L[0], h1, h2), c


@njit(**INLINE)
def residual(Y: Points, a: int, b: int, ma: float, mb: float, ca: Three, cb: Three, w: float, rest: float) -> float:
    """Return Ω_ab: the points' covariance about their means less what the slope explains; `rest` weighs the mean."""
    total = rest * ma * mb
    total += w * ((Y[1][a] - ma) * (Y[1][b] - mb) + (Y[2][a] - ma) * (Y[2][b] - mb) + (Y[3][a] - ma) * (Y[3][b] - mb))
    total += w * ((Y[4][a] - ma) * (Y[4][b] - mb) + (Y[5][a] - ma) * (Y[5][b] - mb) + (Y[6][a] - ma) * (Y[6][b] - mb))
    return total - (ca[0] * cb[0] + ca[1] * cb[1] + ca[2] * cb[2])


@njit(**WIDE_PASS)
def unscented_tile(
    b: FloatArray, z: FloatArray, position: Three, R: Nine, noise: Three, ranged: float, total: float, rest: float
) -> None:
    """Condition every track on range (if `ranged` is 1), azimuth and elevation: z (3·WIDTH,), range 0 where not ranged.

    `total` is α²(n + κ), `rest` the covariance weight of the mean and of the points that share its position.
    """
    s, w = math.sqrt(total), 0.5 / total
    for l in range(WIDTH):
        p, v, A, B, C = load(b, l, WIDTH)
        L = factor(A)
        middle, Y = seven(R, (p[0] - position[0], p[1] - position[1], p[2] - position[2]), L, s)
        m0 = w * (Y[1][0] + Y[2][0] + Y[3][0] + Y[4][0] + Y[5][0] + Y[6][0])
        m1 = w * (Y[1][1] + Y[2][1] + Y[3][1] + Y[4][1] + Y[5][1] + Y[6][1])
        m2 = w * (Y[1][2] + Y[2][2] + Y[3][2] + Y[4][2] + Y[5][2] + Y[6][2])
        (h0, c0), (h1, c1), (h2, c2) = slope(Y, 0, L, w * s), slope(Y, 1, L, w * s), slope(Y, 2, L, w * s)
        y1 = near(z[WIDTH + l] - middle[1]) - m1
        y2 = near(z[2 * WIDTH + l] - middle[2]) - m2
        r11 = noise[1] + residual(Y, 1, 1, m1, m1, c1, c1, w, rest)
        r22 = noise[2] + residual(Y, 2, 2, m2, m2, c2, c2, w, rest)
        f = residual(Y, 2, 1, m2, m1, c2, c1, w, rest) / r11
        g2, x2, d2 = less(h2, f, h1), y2 - f * y1, r22 - f * f * r11
        o1 = residual(Y, 0, 1, m0, m1, c0, c1, w, rest)
        e1 = o1 / r11
        e2 = (residual(Y, 0, 2, m0, m2, c0, c2, w, rest) - f * o1) / d2
        r00 = noise[0] + residual(Y, 0, 0, m0, m0, c0, c0, w, rest) - e1 * e1 * r11 - e2 * e2 * d2
        y0 = z[l] - middle[0] - m0 - e1 * y1 - e2 * x2
        y0 = y0 if ranged > 0.0 else math.nan
        h0 = less(less(h0, e1, h1), e2, g2)
        p, v, A, B, C, nis, det = condition_three(p, v, A, B, C, h1, y1, r11, g2, x2, d2, h0, y0, r00)
        store(b, l, WIDTH, p, v, A, B, C)
        b[NIS * WIDTH + l] = nis
        b[DET * WIDTH + l] = det
        b[(SCORE + 1) * WIDTH + l] += (2.0 + ranged) if y1 == y1 else 0.0


@njit(**WIDE_PASS)
def run_ukf_tile(
    b: FloatArray,
    tile: FloatArray,
    t0: float,
    q: float,
    total: float,
    rest: float,
    t: FloatArray,
    z: FloatArray,
    contexts: FloatArray,
    sensor: IntArray,
    score: FloatArray,
) -> None:
    """Filter the reports of one tile, see `run_ukf_tiles` and `unscented_tile`; `b` (WORK,) is scratch."""
    write_vector(b, tile)
    b[NIS * WIDTH :] = 0.0
    now = t0
    for k in range(t.shape[0]):
        move_tile(b, t[k] - now, q)
        now = t[k]
        c = contexts[sensor[k]]
        e = ROTATION
        R = (c[e], c[e + 1], c[e + 2], c[e + 3], c[e + 4], c[e + 5], c[e + 6], c[e + 7], c[e + 8])
        position = (c[POSITION], c[POSITION + 1], c[POSITION + 2])
        noise = (c[NOISE], c[NOISE + 8], c[NOISE + 16])
        unscented_tile(b, z[k], position, R, noise, 1.0 if c[NOISE] > 0.0 else 0.0, total, rest)
    write_vector(tile, b[: ROWS * WIDTH])
    write_vector(score, b[SCORE * WIDTH :])
    for l in range(WIDTH):
        score[l] += b[NIS * WIDTH + l]


@njit(
    types.void(
        MATRIX, types.float64, types.float64, VECTOR, VECTOR, STACK, MATRIX, types.int64[::1], MATRIX,
    ),
    nogil=True,
    **WIDE,
)  # fmt: skip
def run_ukf_tiles(
    tiles: FloatArray,
    t0: float,
    q: float,
    scaling: FloatArray,
    t: FloatArray,
    z: FloatArray,
    contexts: FloatArray,
    sensor: IntArray,
    score: FloatArray,
) -> None:
    """As `tiles.run_tiles` with the unscented update; `scaling` = (alpha, beta, kappa), z (m, k, 3·WIDTH) always."""
    b = aligned(WORK)
    total = scaling[0] ** 2 * (6.0 + scaling[2])
    rest = 1.0 - 6.0 / total + 1.0 - scaling[0] ** 2 + scaling[1] + 6.0 * 0.5 / total
    for i in range(tiles.shape[0]):
        run_ukf_tile(b, tiles[i], t0, q, total, rest, t, z[i], contexts, sensor, score[i])
