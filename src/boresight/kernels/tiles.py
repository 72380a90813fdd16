"""Many tracks that share one schedule of reports (a Monte Carlo study): the algebra of `kernels.blocks` over tiles.

A tile is WIDTH tracks. Every number of the belief is a row of WIDTH, so that number i of track l lies at i·WIDTH + l
and the track index is innermost. Each pass below is one loop over the tile that calls the scalar functions; LLVM turns
it into vector instructions (the benchmark reports the share of the core's measured peak: it falls where that is lost).
A tile stays in the first-level cache from the first report to the last.
"""

# Numba caches by file and compiles kernels.blocks and kernels.sight into these: clear __pycache__ when those change.
from __future__ import annotations

import numpy as np
from numba import njit, types

from boresight.kernels.arctan import WIDE, WIDE_PASS, near
from boresight.kernels.blocks import (
    ROWS,
    Nine,
    Three,
    condition,
    condition_rate,
    condition_three,
    condition_two,
    load,
    move,
    store,
)
from boresight.kernels.observation import NOISE, POSITION, ROTATION, VELOCITY, IntArray
from boresight.kernels.options import COUNTED
from boresight.kernels.sight import polar, range_rate, turned_polar
from boresight.kernels.signatures import MATRIX, STACK, VECTOR
from boresight.kernels.write import write_vector
from boresight.types.sensor import FloatArray

WIDTH = 64
PRIOR = ROWS  # rows 27 … 32 of the work space: position and velocity before the report
NIS, DET = ROWS + 6, ROWS + 7  # of the last report: normalised innovation squared, determinant of S
SCORE = ROWS + 8  # rows 35, 36: sum of NIS of the reports before, number of components used
WORK = (SCORE + 2) * WIDTH
SLOPE = 4  # rows of one component in `seen`: value, slope by position; range rate has three more, by velocity
SEEN = (7 * SLOPE + 3) * WIDTH
RATE_SLOPE = 7 * SLOPE


@njit(**WIDE_PASS)
def move_tile(b: FloatArray, dt: float, q: float) -> None:
    """Move every track, and count the NIS of the report before."""
    for l in range(WIDTH):
        p, v, A, B, C = load(b, l, WIDTH)
        p, v, A, B, C = move(p, v, A, B, C, dt, q)
        store(b, l, WIDTH, p, v, A, B, C)
        b[SCORE * WIDTH + l] += b[NIS * WIDTH + l]


@njit(**WIDE_PASS)
def note_tile(b: FloatArray) -> None:
    """Note every track's state before the report, and begin its NIS and determinant."""
    for l in range(WIDTH):
        for i in range(6):
            b[(PRIOR + i) * WIDTH + l] = b[i * WIDTH + l]
        b[NIS * WIDTH + l] = 0.0
        b[DET * WIDTH + l] = 1.0


@njit(**WIDE_PASS)
def see_polar(b: FloatArray, seen: FloatArray, s0: float, s1: float, s2: float) -> None:
    """Fill rows of range, azimuth and elevation as seen from (s0, s1, s2) in north-aligned axes."""
    for l in range(WIDTH):
        d = (b[l] - s0, b[WIDTH + l] - s1, b[2 * WIDTH + l] - s2)
        r, azimuth, elevation, h_r, h_a, h_e = polar(d)
        seen[l], seen[SLOPE * WIDTH + l], seen[2 * SLOPE * WIDTH + l] = r, azimuth, elevation
        for i in range(3):
            seen[(1 + i) * WIDTH + l] = h_r[i]
            seen[(SLOPE + 1 + i) * WIDTH + l] = h_a[i]
            seen[(2 * SLOPE + 1 + i) * WIDTH + l] = h_e[i]


@njit(**WIDE_PASS)
def see_turned(b: FloatArray, seen: FloatArray, s0: float, s1: float, s2: float, R: Nine) -> None:
    """As `see_polar` for a sensor whose axes are turned by R (enu_from_sensor by rows)."""
    for l in range(WIDTH):
        d = (b[l] - s0, b[WIDTH + l] - s1, b[2 * WIDTH + l] - s2)
        r, azimuth, elevation, h_r, h_a, h_e = turned_polar(R, d)
        seen[l], seen[SLOPE * WIDTH + l], seen[2 * SLOPE * WIDTH + l] = r, azimuth, elevation
        for i in range(3):
            seen[(1 + i) * WIDTH + l] = h_r[i]
            seen[(SLOPE + 1 + i) * WIDTH + l] = h_a[i]
            seen[(2 * SLOPE + 1 + i) * WIDTH + l] = h_e[i]


@njit(**WIDE_PASS)
def see_rate(b: FloatArray, seen: FloatArray, s: Three, u: Three) -> None:
    """Fill the rows of range rate as seen from `s`, moving at `u`."""
    row = 3 * SLOPE
    for l in range(WIDTH):
        d = (b[l] - s[0], b[WIDTH + l] - s[1], b[2 * WIDTH + l] - s[2])
        v = (b[3 * WIDTH + l], b[4 * WIDTH + l], b[5 * WIDTH + l])
        w = (v[0] - u[0], v[1] - u[1], v[2] - u[2])
        rate, h, g = range_rate(d, w)
        seen[row * WIDTH + l] = rate
        for i in range(3):
            seen[(row + 1 + i) * WIDTH + l] = h[i]
            seen[(RATE_SLOPE + i) * WIDTH + l] = g[i]


@njit(**WIDE_PASS)
def see_axis(b: FloatArray, component: FloatArray, s: Three, h: Three) -> None:
    """Fill one component's rows with the coordinate along `h` from `s`."""
    for l in range(WIDTH):
        d0, d1, d2 = b[l] - s[0], b[WIDTH + l] - s[1], b[2 * WIDTH + l] - s[2]
        component[l] = h[0] * d0 + h[1] * d1 + h[2] * d2
        for i in range(3):
            component[(1 + i) * WIDTH + l] = h[i]


@njit(**WIDE_PASS)
def condition_tile(b: FloatArray, seen: FloatArray, z: FloatArray, r: float, turn: bool) -> None:
    """Condition every track on one component, `seen` (4·WIDTH,), measured as `z` (WIDTH,); `turn` for an angle."""
    for l in range(WIDTH):
        p, v, A, B, C = load(b, l, WIDTH)
        prior = (b[PRIOR * WIDTH + l], b[(PRIOR + 1) * WIDTH + l], b[(PRIOR + 2) * WIDTH + l])
        y = z[l] - seen[l]
        y = near(y) if turn else y
        h = (seen[WIDTH + l], seen[2 * WIDTH + l], seen[3 * WIDTH + l])
        p, v, A, B, C, nis, s = condition(p, v, A, B, C, prior, h, y, r)
        store(b, l, WIDTH, p, v, A, B, C)
        b[NIS * WIDTH + l] += nis
        b[DET * WIDTH + l] *= s
        b[(SCORE + 1) * WIDTH + l] += 1.0 if y == y else 0.0


@njit(**WIDE_PASS)
def condition_angles_tile(b: FloatArray, seen: FloatArray, z: FloatArray, r_a: float, r_e: float) -> None:
    """Condition on azimuth and elevation, before anything else: `seen` (8·WIDTH,), `z` (2·WIDTH,)."""
    for l in range(WIDTH):
        p, v, A, B, C = load(b, l, WIDTH)
        y_a, y_e = near(z[l] - seen[l]), near(z[WIDTH + l] - seen[SLOPE * WIDTH + l])
        h_a = (seen[WIDTH + l], seen[2 * WIDTH + l], seen[3 * WIDTH + l])
        h_e = (seen[5 * WIDTH + l], seen[6 * WIDTH + l], seen[7 * WIDTH + l])
        p, v, A, B, C, nis, s = condition_two(p, v, A, B, C, h_a, y_a, r_a, h_e, y_e, r_e)
        store(b, l, WIDTH, p, v, A, B, C)
        b[NIS * WIDTH + l] = nis
        b[DET * WIDTH + l] = s
        b[(SCORE + 1) * WIDTH + l] += (1.0 if y_a == y_a else 0.0) + (1.0 if y_e == y_e else 0.0)


@njit(**WIDE_PASS)
def condition_polar_tile(b: FloatArray, seen: FloatArray, z: FloatArray, r: float, r_a: float, r_e: float) -> None:
    """Condition on range, azimuth and elevation, before anything else: `seen` (12·WIDTH,), `z` (3·WIDTH,)."""
    for l in range(WIDTH):
        p, v, A, B, C = load(b, l, WIDTH)
        y = z[l] - seen[l]
        y_a = near(z[WIDTH + l] - seen[SLOPE * WIDTH + l])
        y_e = near(z[2 * WIDTH + l] - seen[2 * SLOPE * WIDTH + l])
        h = (seen[WIDTH + l], seen[2 * WIDTH + l], seen[3 * WIDTH + l])
        h_a = (seen[5 * WIDTH + l], seen[6 * WIDTH + l], seen[7 * WIDTH + l])
        h_e = (seen[9 * WIDTH + l], seen[10 * WIDTH + l], seen[11 * WIDTH + l])
        p, v, A, B, C, nis, s = condition_three(p, v, A, B, C, h, y, r, h_a, y_a, r_a, h_e, y_e, r_e)
        store(b, l, WIDTH, p, v, A, B, C)
        b[NIS * WIDTH + l] = nis
        b[DET * WIDTH + l] = s
        used = (1.0 if y == y else 0.0) + (1.0 if y_a == y_a else 0.0) + (1.0 if y_e == y_e else 0.0)
        b[(SCORE + 1) * WIDTH + l] += used


@njit(**WIDE_PASS)
def condition_rate_tile(b: FloatArray, seen: FloatArray, z: FloatArray, r: float) -> None:
    """As `condition_tile` for range rate, `seen` (31·WIDTH,) being all components."""
    row = 3 * SLOPE
    for l in range(WIDTH):
        p, v, A, B, C = load(b, l, WIDTH)
        prior = (b[PRIOR * WIDTH + l], b[(PRIOR + 1) * WIDTH + l], b[(PRIOR + 2) * WIDTH + l])
        prior_v = (b[(PRIOR + 3) * WIDTH + l], b[(PRIOR + 4) * WIDTH + l], b[(PRIOR + 5) * WIDTH + l])
        h = (seen[(row + 1) * WIDTH + l], seen[(row + 2) * WIDTH + l], seen[(row + 3) * WIDTH + l])
        g = (seen[RATE_SLOPE * WIDTH + l], seen[(RATE_SLOPE + 1) * WIDTH + l], seen[(RATE_SLOPE + 2) * WIDTH + l])
        y = z[l] - seen[row * WIDTH + l]
        p, v, A, B, C, nis, s = condition_rate(p, v, A, B, C, prior, prior_v, h, g, y, r)
        store(b, l, WIDTH, p, v, A, B, C)
        b[NIS * WIDTH + l] += nis
        b[DET * WIDTH + l] *= s
        b[(SCORE + 1) * WIDTH + l] += 1.0 if y == y else 0.0


@njit(**WIDE_PASS)
def see_tile(b: FloatArray, seen: FloatArray, c: FloatArray) -> None:
    """Fill the rows of every component that the sensor with context `c` (66,) measures."""
    s = (c[POSITION], c[POSITION + 1], c[POSITION + 2])
    R = c[ROTATION : ROTATION + 9]
    if c[NOISE] > 0.0 or c[NOISE + 8] > 0.0 or c[NOISE + 16] > 0.0:
        if R[0] + R[4] + R[8] == 3.0:
            see_polar(b, seen, s[0], s[1], s[2])
        else:
            see_turned(b, seen, s[0], s[1], s[2], (R[0], R[1], R[2], R[3], R[4], R[5], R[6], R[7], R[8]))
    if c[NOISE + 24] > 0.0:
        see_rate(b, seen, s, (c[VELOCITY], c[VELOCITY + 1], c[VELOCITY + 2]))
    for a in range(3):
        if c[NOISE + 32 + 8 * a] > 0.0:
            rows = (4 + a) * SLOPE * WIDTH
            see_axis(b, seen[rows : rows + SLOPE * WIDTH], s, (R[a], R[3 + a], R[6 + a]))


@njit(**WIDE_PASS)
def report_tile(b: FloatArray, seen: FloatArray, z: FloatArray, c: FloatArray) -> None:
    """Condition every track on its report: `z` (m·WIDTH,) the sensor's measured components in ascending order."""
    see_tile(b, seen, c)
    angles = c[NOISE + 8] > 0.0 and c[NOISE + 16] > 0.0
    others = c[NOISE + 24] > 0.0 or c[NOISE + 32] > 0.0 or c[NOISE + 40] > 0.0 or c[NOISE + 48] > 0.0
    if others or not angles:  # what is taken later, or alone, needs it
        note_tile(b)
    row, i = 0, 0
    while i < 7:
        r = c[NOISE + 8 * i]
        if r > 0.0:
            part, rows = z[row * WIDTH :], seen[SLOPE * i * WIDTH :]
            if i == 0 and angles:
                condition_polar_tile(b, rows, part, r, c[NOISE + 8], c[NOISE + 16])
                row, i = row + 2, 2
            elif i == 1 and angles:
                condition_angles_tile(b, rows, part, r, c[NOISE + 16])
                row, i = row + 1, 2
            elif i == 3:
                condition_rate_tile(b, seen, part, r)
            else:
                condition_tile(b, rows, part, r, i == 1 or i == 2)
            row += 1
        i += 1


@njit(**COUNTED)
def aligned(size: int) -> FloatArray:
    """Return an array (size,) that begins on a cache line: vectors across two lines cost a third of the speed."""
    raw = np.empty(size + 7)
    skip = (-(raw.ctypes.data // 8)) % 8
    return raw[skip : skip + size]


@njit(**WIDE_PASS)
def run_tile(
    work: FloatArray,
    seen: FloatArray,
    tile: FloatArray,
    t0: float,
    q: float,
    t: FloatArray,
    z: FloatArray,
    contexts: FloatArray,
    sensor: IntArray,
    score: FloatArray,
    kept: FloatArray,
) -> None:
    """Filter the reports of one tile (27·WIDTH,), see `run_tiles`; `work` (WORK,) and `seen` (SEEN,) are scratch."""
    write_vector(work, tile)
    work[NIS * WIDTH :] = 0.0
    now = t0
    for k in range(t.shape[0]):
        move_tile(work, t[k] - now, q)
        now = t[k]
        report_tile(work, seen, z[k], contexts[sensor[k]])
        if kept.shape[0] > 0:
            write_vector(kept[0, k], work[: ROWS * WIDTH])
    write_vector(tile, work[: ROWS * WIDTH])
    write_vector(score, work[SCORE * WIDTH :])
    for l in range(WIDTH):
        score[l] += work[NIS * WIDTH + l]


@njit(
    types.void(
        MATRIX, types.float64, types.float64, VECTOR, types.float64[:, :, ::1], MATRIX, types.int64[::1], MATRIX, STACK
    ),
    nogil=True,
    **WIDE,
)  # fmt: skip
def run_tiles(
    tiles: FloatArray,
    t0: float,
    q: float,
    t: FloatArray,
    z: FloatArray,
    contexts: FloatArray,
    sensor: IntArray,
    score: FloatArray,
    kept: FloatArray,
) -> None:
    """Filter k reports of every track of `tiles` (m, 27·WIDTH), in place, from `t0` (s) at nearly constant velocity.

    z (m, k, c·WIDTH): of each report the components that its sensor measures, NaN where a track has none; `sensor` (k,)
    says which row of `contexts` (s, 66) it is. `score` (m, 2·WIDTH) is filled with the sum of NIS and of the components
    used (NaN where an innovation variance was not positive); `kept` (m, k, 27·WIDTH), unless empty, with every belief.
    """
    room = aligned(WORK + SEEN)
    work, seen = room[:WORK], room[WORK:]
    for i in range(tiles.shape[0]):
        run_tile(work, seen, tiles[i], t0, q, t, z[i], contexts, sensor, score[i], kept[i : i + 1])
