"""Two models that interact (IMM) over tiles of tracks: mixing, two filters of `kernels.tiles`, weighing.

Both move at nearly constant velocity, with process noise of their own: one for quiet flight, one for manoeuvres. It is
the filter of `kernels.imm` for these models.
"""

# Numba caches by file and compiles kernels.tiles and what it calls into these: clear __pycache__ when those change.
from __future__ import annotations

import math

import numpy as np
from numba import njit, types

from boresight.kernels.arctan import FAST, INLINE, WIDE, WIDE_PASS, exponential
from boresight.kernels.blocks import ROWS, Belief, Nine, Six, Three, load, store
from boresight.kernels.observation import IntArray
from boresight.kernels.signatures import MATRIX, STACK, VECTOR
from boresight.kernels.tiles import DET, NIS, SCORE, SEEN, WIDTH, WORK, aligned, move_tile, report_tile
from boresight.kernels.write import write_vector
from boresight.types.sensor import FloatArray

LEAST = 1e-12  # weight below which no model falls, as in kernels.imm.reweigh
STATE = (2 * ROWS + 1) * WIDTH  # of a tile: both beliefs, and the weight of the first model


@njit(**INLINE)
def between(s: float, a: Belief, b: Belief) -> Belief:
    """Return the moment-matched mixture s·a + (1 - s)·b: means, and covariances with the spread of the means."""
    u = s * (1.0 - s)
    d = (a[0][0] - b[0][0], a[0][1] - b[0][1], a[0][2] - b[0][2])
    e = (a[1][0] - b[1][0], a[1][1] - b[1][1], a[1][2] - b[1][2])
    f, g = (u * d[0], u * d[1], u * d[2]), (u * e[0], u * e[1], u * e[2])
    A, B, C, P, Q, R = a[2], a[3], a[4], b[2], b[3], b[4]
    position: Three = (b[0][0] + s * d[0], b[0][1] + s * d[1], b[0][2] + s * d[2])
    velocity: Three = (b[1][0] + s * e[0], b[1][1] + s * e[1], b[1][2] + s * e[2])
    of_position: Six = (
        P[0] + s * (A[0] - P[0]) + f[0] * d[0], P[1] + s * (A[1] - P[1]) + f[0] * d[1],
        P[2] + s * (A[2] - P[2]) + f[0] * d[2], P[3] + s * (A[3] - P[3]) + f[1] * d[1],
        P[4] + s * (A[4] - P[4]) + f[1] * d[2], P[5] + s * (A[5] - P[5]) + f[2] * d[2],
    )  # fmt: skip
    cross: Nine = (
        Q[0] + s * (B[0] - Q[0]) + f[0] * e[0], Q[1] + s * (B[1] - Q[1]) + f[0] * e[1],
        Q[2] + s * (B[2] - Q[2]) + f[0] * e[2], Q[3] + s * (B[3] - Q[3]) + f[1] * e[0],
        Q[4] + s * (B[4] - Q[4]) + f[1] * e[1], Q[5] + s * (B[5] - Q[5]) + f[1] * e[2],
        Q[6] + s * (B[6] - Q[6]) + f[2] * e[0], Q[7] + s * (B[7] - Q[7]) + f[2] * e[1],
        Q[8] + s * (B[8] - Q[8]) + f[2] * e[2],
    )  # fmt: skip
    of_velocity: Six = (
        R[0] + s * (C[0] - R[0]) + g[0] * e[0], R[1] + s * (C[1] - R[1]) + g[0] * e[1],
        R[2] + s * (C[2] - R[2]) + g[0] * e[2], R[3] + s * (C[3] - R[3]) + g[1] * e[1],
        R[4] + s * (C[4] - R[4]) + g[1] * e[2], R[5] + s * (C[5] - R[5]) + g[2] * e[2],
    )  # fmt: skip
    return position, velocity, of_position, cross, of_velocity


@njit(**WIDE_PASS)
def mix_tile(b: FloatArray, other: FloatArray, weight: FloatArray, stay: float, come: float) -> None:
    """Mix two tiles; `weight` (WIDTH,) of the first becomes its predicted one.

    `stay` is the probability that the first model follows itself, `come` that it follows the second.
    """
    for l in range(WIDTH):
        w = weight[l]
        predicted = stay * w + come * (1.0 - w)
        first, second = load(b, l, WIDTH), load(other, l, WIDTH)
        from_first = stay * w / predicted
        from_first_to_second = (1.0 - stay) * w / (1.0 - predicted)
        p, v, A, B, C = between(from_first, first, second)
        store(b, l, WIDTH, p, v, A, B, C)
        p, v, A, B, C = between(from_first_to_second, first, second)
        store(other, l, WIDTH, p, v, A, B, C)
        weight[l] = predicted


@njit(**WIDE_PASS)
def weigh_tile(b: FloatArray, other: FloatArray, weight: FloatArray) -> None:
    """Weigh the two models of every track by their likelihoods of the last report, N(y; 0, S)."""
    for l in range(WIDTH):
        ratio = exponential(0.5 * (other[NIS * WIDTH + l] - b[NIS * WIDTH + l])) * math.sqrt(
            other[DET * WIDTH + l] / b[DET * WIDTH + l]
        )
        better = ratio > 1.0
        first = max(weight[l] * (1.0 if better else ratio), LEAST)
        second = max((1.0 - weight[l]) * (1.0 / ratio if better else 1.0), LEAST)
        weight[l] = first / (first + second)


@njit(**WIDE_PASS)
def run_imm_tile(
    b: FloatArray,
    other: FloatArray,
    weight: FloatArray,
    seen: FloatArray,
    tile: FloatArray,
    t0: float,
    q: FloatArray,
    transitions: FloatArray,
    t: FloatArray,
    z: FloatArray,
    contexts: FloatArray,
    sensor: IntArray,
    score: FloatArray,
) -> None:
    """Filter the reports of one tile, see `run_imm_tiles`; the first four arrays are scratch."""
    size = ROWS * WIDTH
    write_vector(b, tile[:size])
    write_vector(other, tile[size : 2 * size])
    write_vector(weight, tile[2 * size :])
    b[NIS * WIDTH :] = 0.0
    other[NIS * WIDTH :] = 0.0
    now = t0
    for k in range(t.shape[0]):
        dt = t[k] - now
        if dt > 0.0:
            mix_tile(b, other, weight, transitions[k, 0, 0], transitions[k, 1, 0])
        now = t[k]
        context = contexts[sensor[k]]
        move_tile(b, dt, q[0])
        report_tile(b, seen, z[k], context)
        move_tile(other, dt, q[1])
        report_tile(other, seen, z[k], context)
        weigh_tile(b, other, weight)
    write_vector(tile[:size], b[:size])
    write_vector(tile[size : 2 * size], other[:size])
    write_vector(tile[2 * size :], weight)
    write_vector(score, b[SCORE * WIDTH :])
    for l in range(WIDTH):
        score[l] += b[NIS * WIDTH + l]


@njit(
    types.void(
        MATRIX, types.float64, VECTOR, STACK, VECTOR, STACK, MATRIX, types.int64[::1], MATRIX,
    ),
    nogil=True,
    **WIDE,
)  # fmt: skip
def run_imm_tiles(
    tiles: FloatArray,
    t0: float,
    q: FloatArray,
    transitions: FloatArray,
    t: FloatArray,
    z: FloatArray,
    contexts: FloatArray,
    sensor: IntArray,
    score: FloatArray,
) -> None:
    """Filter k reports of every track of `tiles` (m, 55·WIDTH: belief, other belief, weight of the first), in place.

    `q` (2,) is the models' process noise, `transitions` (k, 2, 2) the Markov chain's probabilities over each interval;
    the rest as `tiles.run_tiles`, `score` being that of the first model.
    """
    room = aligned(2 * WORK + SEEN + WIDTH)
    b, other, seen, weight = (
        room[:WORK],
        room[WORK : 2 * WORK],
        room[2 * WORK : 2 * WORK + SEEN],
        room[2 * WORK + SEEN :],
    )
    for i in range(tiles.shape[0]):
        run_imm_tile(b, other, weight, seen, tiles[i], t0, q, transitions, t, z[i], contexts, sensor, score[i])


@njit(**FAST)
def transitions_of(stay: FloatArray, dt: FloatArray) -> FloatArray:
    """Return exp(G·dt) (k, 2, 2) of two models that are left after `stay` (2,) s on average: a closed form."""
    out = np.empty((len(dt), 2, 2))
    a, b = 1.0 / stay[0], 1.0 / stay[1]
    for k in range(len(dt)):
        gone = -math.expm1(-(a + b) * dt[k]) / (a + b)
        out[k, 0, 1], out[k, 1, 0] = a * gone, b * gone
        out[k, 0, 0], out[k, 1, 1] = 1.0 - a * gone, 1.0 - b * gone
    return out
