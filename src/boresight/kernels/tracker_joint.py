"""Joint association inside the tracker: every track takes its share of every detection in its gate (JIPDA).

With r the probability that a track is there to be detected, a pair weighs r p_D N/λ and a miss 1 - r p_D; the marginals
of all joint events (`kernels.jpda`) say how likely each detection is a track's own (Musicki and Evans 2004).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from boresight.kernels.jpda import marginals
from boresight.kernels.options import PART
from boresight.kernels.tracker import HIDDEN, VISIBLE, IntArray, Look, Models, SensorTable, Settings, Tracks
from boresight.kernels.tracker_models import LEAST_MODE, combine_models, give_up_heights
from boresight.kernels.tracker_place import Places
from boresight.kernels.tracker_state import condition, existence, learners, look_along
from boresight.kernels.tracker_weigh import note_hit, still_over_moving, weigh
from boresight.kernels.tracker_workroom import Workroom
from boresight.kernels.write import write_matrix, write_vector
from boresight.types.sensor import FloatArray

MOST_STATES = 300_000.0  # of a cluster of tracks that is worked out exactly
LEAST_SHARE = 1e-6


@njit(cache=True)
def shares(
    tr: Tracks,
    s: Settings,
    sensor: SensorTable,
    start: IntArray,
    column: IntArray,
    loglik: FloatArray,
    p_d: FloatArray,
    m: int,
) -> FloatArray:
    """Return (pairs,) each pair's likelihood ratio p_D N/λ, lowered by what other tracks claim of the detection.

    For a track alone it is p_D N/λ itself; in general p_j / p_miss · (1 - r p_D) / r, so that 1 - p_D plus the sum over
    a track's pairs is the evidence of this look for it (the JIPDA existence update).
    """
    n = len(start) - 1
    weight = np.empty(len(column))
    miss = np.ones(n)
    there = np.empty(n)
    for i in range(n):
        there[i] = existence(tr, i, s, sensor)
        miss[i] = 1.0 - there[i] * p_d[i]
        for e in range(start[i], start[i + 1]):
            weight[e] = there[i] * p_d[i] * math.exp(min(loglik[e], 100.0))
    p = np.zeros(len(column))
    p_miss = np.ones(n)
    marginals(start, column, weight, miss, m, MOST_STATES, p, p_miss, np.zeros(n, np.int64))
    for i in range(n):
        for e in range(start[i], start[i + 1]):
            p[e] *= miss[i] / (max(p_miss[i], 1e-12) * there[i])
    return p


@njit(**PART)
def take_shares(
    tr: Tracks,
    i: int,
    s: Settings,
    sensor: SensorTable,
    look: Look,
    at: Places,
    room: Workroom,
    start: IntArray,
    column: IntArray,
    share: FloatArray,
    own: int,
    p_d: float,
    temper: float,
    models: Models | None,
) -> None:
    """Condition track `i` on its shares of a look: hypotheses, and state as the mixture of what could have happened.

    `own` is the detection that is most likely its own (-1: none): it counts as a hit and conditions the anchor.
    """
    visible = 1.0 - p_d
    still = 1.0 - p_d * sensor.sees_static
    for e in range(start[i], start[i + 1]):
        visible += share[e]
        still += (
            sensor.sees_static * share[e] * still_ratio(tr, i, s, sensor, look, column[e], at, room, column[e] == own)
        )
    moves = sensor.moves_tracks and (sensor.ranging or tr.heard[i] > 0)
    if moves:
        mix(tr, i, s, sensor, look, room, start, column, share, visible, models)
    weigh(tr, i, math.log(visible), math.log(still), temper)
    if own >= 0:
        note_hit(tr, i, s, sensor, look.t + look.dt[own], moves)


@njit(**PART)
def still_ratio(
    tr: Tracks,
    i: int,
    s: Settings,
    sensor: SensorTable,
    look: Look,
    k: int,
    at: Places,
    room: Workroom,
    update: bool,
) -> float:
    """Likelihood of detection `k` if track `i` does not move, over that if it does; 1 for sensors without range.

    With `update` the anchor is conditioned on it.
    """
    if not at.there[k]:
        return 1.0
    anchor, anchor_P = tr.anchor[i].copy(), tr.anchor_P[i].copy()
    ratio = math.exp(min(still_over_moving(tr, i, s, sensor, look, k, at, room), 100.0))
    if not update:
        write_vector(tr.anchor[i], anchor)
        write_matrix(tr.anchor_P[i], anchor_P)
    return ratio


@njit(cache=True)
def mix(
    tr: Tracks,
    i: int,
    s: Settings,
    sensor: SensorTable,
    look: Look,
    room: Workroom,
    start: IntArray,
    column: IntArray,
    share: FloatArray,
    visible: float,
    models: Models | None,
) -> None:
    """Replace a track's state by mean and covariance over what its target may have caused: a detection, or none."""
    w = tr.weight[i]
    total = w[VISIBLE] * visible + w[HIDDEN]
    considered = learners(tr, i, s, sensor)
    mine = column[start[i] : start[i + 1]]
    beta = np.empty(len(mine))
    for e in range(len(mine)):
        beta[e] = w[VISIBLE] * share[start[i] + e] / max(total, 1e-300)
        if beta[e] < LEAST_SHARE:
            beta[e] = 0.0
    if models is None:
        mixture(tr.x[i], tr.P[i], s.d, look, sensor, room, mine, beta, considered)
    else:
        mix_by_model(tr, i, s.d, look, sensor, room, mine, beta, considered, models)


@njit(cache=True)
def mix_by_model(
    tr: Tracks,
    i: int,
    d: int,
    look: Look,
    sensor: SensorTable,
    room: Workroom,
    mine: IntArray,
    beta: FloatArray,
    considered: int,
    models: Models,
) -> None:
    """The same for all components: each detection weighs them by its likelihood, a miss leaves them."""
    n, parts = len(mine), tr.mode.shape[1]
    own = np.zeros((parts, n))  # probability of each component and detection together
    left = 1.0
    for e in range(n):
        if beta[e] > 0.0:
            best = -math.inf
            for c in range(parts):
                if tr.mode[i, c] > 0.0:
                    _, log = look_along(tr.mode_x[i, c], tr.mode_P[i, c], d, mine[e], look, sensor, room)
                    room.logs[c] = math.log(tr.mode[i, c]) + log
                    best = max(best, room.logs[c])
            total = 0.0
            for c in range(parts):
                if tr.mode[i, c] > 0.0:
                    own[c, e] = max(math.exp(max(room.logs[c] - best, -700.0)), LEAST_MODE)
                    total += own[c, e]
            for c in range(parts):
                own[c, e] *= beta[e] / total
            left -= beta[e]
    for c in range(parts):
        if tr.mode[i, c] == 0.0:
            continue
        total = max(left, 0.0) * tr.mode[i, c]
        for e in range(n):
            total += own[c, e]
        for e in range(n):
            own[c, e] /= total
        mixture(tr.mode_x[i, c], tr.mode_P[i, c], d, look, sensor, room, mine, own[c], considered)
        tr.mode[i, c] = total
    give_up_heights(tr, i, models)
    combine_models(tr, i)


@njit(**PART)
def mixture(
    x: FloatArray,
    P: FloatArray,
    d: int,
    look: Look,
    sensor: SensorTable,
    room: Workroom,
    mine: IntArray,
    beta: FloatArray,
    considered: int,
) -> None:
    """Replace (x, P) by its moments over being conditioned on detection mine[e] with probability beta[e], or not."""
    n = len(x)
    prior, prior_P = x.copy(), P.copy()
    after, after_P = x.copy(), P.copy()
    mean = np.zeros(n)
    square = np.zeros((n, n))  # second moments about the prior mean: no cancellation of large coordinates
    left = 1.0
    for e in range(len(mine)):
        if beta[e] == 0.0:
            continue
        write_vector(after, prior)
        write_matrix(after_P, prior_P)
        condition(after, after_P, d, mine[e], look, sensor, room, considered)
        for a in range(n):  # written out: expressions with whole arrays take seconds to compile
            mean[a] += beta[e] * (after[a] - prior[a])
            for b in range(a + 1):
                both = (after[a] - prior[a]) * (after[b] - prior[b])
                square[a, b] += beta[e] * (0.5 * (after_P[a, b] + after_P[b, a]) + both)
        left -= beta[e]
    for a in range(n):
        x[a] = prior[a] + mean[a]
        for b in range(a + 1):
            before = 0.5 * (prior_P[a, b] + prior_P[b, a])
            P[a, b] = square[a, b] + max(left, 0.0) * before - mean[a] * mean[b]
            P[b, a] = P[a, b]
