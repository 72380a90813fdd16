"""What a look says of a track: visible target, hidden, standing still, or nothing; and its update."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from boresight.kernels.registration import TIME
from boresight.kernels.tracker import HIDDEN, STATIC, VISIBLE, IntArray, Look, SensorTable, Settings, Tracks
from boresight.kernels.tracker_place import fix_sensitivity, world_fix
from boresight.kernels.tracker_state import apply_update, components, innovation, linearise
from boresight.types.sensor import FloatArray

LOG_2PI = math.log(2.0 * math.pi)


@njit(cache=True)
def evidence(i: int, start: IntArray, column: IntArray, loglik: FloatArray, row_of_col: IntArray, p_d: float) -> float:
    """Log-likelihood of this look if track `i` is a visible target, over that if it is not: missed, or any of the
    detections in its gate that no other track took (Musicki, Evans, Stankovic 1994, the IPDA likelihood ratio)."""
    total = 1.0 - p_d
    for e in range(start[i], start[i + 1]):
        if row_of_col[column[e]] == i or row_of_col[column[e]] < 0:
            total += p_d * math.exp(min(loglik[e], 100.0))
    return math.log(total)


@njit(cache=True)
def merged(
    tr: Tracks, i: int, s: Settings, sensor: SensorTable, start: IntArray, column: IntArray, row_of_col: IntArray
) -> bool:
    """Whether the detection that track `i` would have had may be one with that of a near shown track."""
    for e in range(start[i], start[i + 1]):
        j = row_of_col[column[e]]
        if j < 0 or j == i or tr.life[j, 2] == 0.0:
            continue
        gap = 0.0
        for a in range(s.d):
            gap += (tr.x[i, a] - tr.x[j, a]) ** 2
        if gap < sensor.resolution**2:
            return True
    return False


@njit(cache=True)
def weigh(tr: Tracks, i: int, log_visible: float, log_static: float, temper: float) -> None:
    """Multiply the weights by the likelihoods of the hypotheses (hidden and nothing: 1) and normalise."""
    w = tr.weight[i]
    w[VISIBLE] *= math.exp(temper * log_visible)
    w[STATIC] *= math.exp(temper * log_static)
    total = w[0] + w[1] + w[2] + w[3]
    for a in range(4):
        w[a] /= total


@njit(cache=True)
def allow_stop(tr: Tracks, i: int, s: Settings) -> None:
    """Let a target that moved begin to stand still where it is now: the anchor is dropped anew."""
    w = tr.weight[i]
    target = w[VISIBLE] + w[HIDDEN]
    if w[STATIC] < s.stop_floor * target:
        w[VISIBLE] -= s.stop_floor * w[VISIBLE]
        w[HIDDEN] -= s.stop_floor * w[HIDDEN]
        w[STATIC] += s.stop_floor * target
        for a in range(s.d):
            tr.anchor[i, a] = tr.x[i, a]
            for b in range(s.d):
                tr.anchor_P[i, a, b] = tr.P[i, a, b]


@njit(cache=True)
def static_likelihood(tr: Tracks, i: int, s: Settings, fix: FloatArray, fix_R: FloatArray, update: bool) -> float:
    """Log-likelihood of a position fix (world ENU) under "it does not move"; with `update`, condition the anchor."""
    d = s.d
    L = np.zeros((3, 3))
    y = np.zeros(3)
    nis = 0.0
    logdet = 0.0
    for a in range(d):
        y[a] = fix[a] - tr.anchor[i, a]
        for b in range(a + 1):
            acc = tr.anchor_P[i, a, b] + fix_R[a, b]
            for k in range(b):
                acc -= L[a, k] * L[b, k]
            L[a, b] = math.sqrt(max(acc, 1e-300)) if a == b else acc / L[b, b]
        logdet += 2.0 * math.log(L[a, a])
    for a in range(d):
        acc = y[a]
        for k in range(a):
            acc -= L[a, k] * y[k]
        y[a] = acc / L[a, a]
        nis += y[a] * y[a]
    if update:
        W = tr.anchor_P[i].copy()
        for c in range(d):
            for a in range(d):
                acc = W[a, c]
                for k in range(c):
                    acc -= W[a, k] * L[c, k]
                W[a, c] = acc / L[c, c]
        for a in range(d):
            for c in range(d):
                tr.anchor[i, a] += W[a, c] * y[c]
        for a in range(d):
            for b in range(d):
                for c in range(d):
                    tr.anchor_P[i, a, b] -= W[a, c] * W[b, c]
    return -0.5 * (nis + logdet + d * math.log(2.0 * math.pi))


@njit(cache=True)
def moving_likelihood(
    tr: Tracks,
    i: int,
    s: Settings,
    sensor: SensorTable,
    look: Look,
    k: int,
    fix: FloatArray,
    fix_R: FloatArray,
    J: FloatArray,
    mask: IntArray,
) -> float:
    """Log-likelihood of a world position under the moving track, biases included: the anchor's rival.

    What the track knows of the sensor's constant errors is taken off `fix`, for the anchor's sake too.
    """
    d = s.d
    n = tr.x.shape[1]
    G = np.zeros((d, n))
    for a in range(d):
        G[a, a] = 1.0
        for e in range(3):
            if sensor.bias[mask[e]] >= 0:
                G[a, sensor.bias[mask[e]]] += J[a, e]
    if sensor.registers:
        velocity = np.zeros(3)
        velocity[:d] = tr.x[i, d : 2 * d]
        C = fix_sensitivity(look, k, sensor, fix, J, mask, velocity)
        for p in range(len(sensor.constant)):
            j = sensor.constant[p]
            if j >= 0:
                G[:, j] = C[:d, p]
                for a in range(d):
                    fix[a] -= C[a, p] * tr.x[i, j]
    GP = G @ tr.P[i]
    L = np.zeros((3, 3))
    y = np.zeros(3)
    value = d * LOG_2PI
    for a in range(d):
        y[a] = fix[a]
        for j in range(n - s.n_constant):  # the constant errors are off already
            y[a] -= G[a, j] * tr.x[i, j]
        for b in range(a + 1):
            acc = fix_R[a, b]
            for j in range(n):
                acc += GP[a, j] * G[b, j]
            for k in range(b):
                acc -= L[a, k] * L[b, k]
            L[a, b] = math.sqrt(max(acc, 1e-300)) if a == b else acc / L[b, b]
        value += 2.0 * math.log(L[a, a])
    for a in range(d):
        acc = y[a]
        for k in range(a):
            acc -= L[a, k] * y[k]
        y[a] = acc / L[a, a]
        value += y[a] * y[a]
    return -0.5 * value


@njit(cache=True)
def take(
    tr: Tracks, i: int, s: Settings, sensor: SensorTable, look: Look, k: int, log_visible: float, temper: float
) -> None:
    """Condition track `i` on detection `k`: state, anchor and hypotheses."""
    n = tr.x.shape[1]
    zhat = np.empty(7)
    H = np.zeros((7, n))
    h6 = np.empty((7, 6))
    y = np.empty(7)
    S = np.empty((7, 7))
    PHt = np.empty((n, 7))
    mask = np.empty(7, np.int64)
    work = np.zeros((2, 3))
    linearise(tr.x[i], s.d, k, look.dt[k], look, sensor, zhat, H, h6, work)
    c = components(look.z[k], s.d, mask)
    innovation(tr.P[i], zhat, H, look.z[k], look.R[k], mask, c, y, S, PHt, s.d, sensor.constant[TIME])
    log_static = log_visible
    fix = np.empty(3)
    fix_R = np.empty((3, 3))
    J = np.zeros((3, 3))
    used = np.empty(3, np.int64)
    if sensor.ranging and world_fix(look, k, s, sensor, fix, fix_R, J, used, np.empty((3, 3))):
        moving = moving_likelihood(tr, i, s, sensor, look, k, fix, fix_R, J, used)
        log_static += static_likelihood(tr, i, s, fix, fix_R, True) - moving
    if sensor.moves_tracks:
        tr.heard[i] |= 1 << (sensor.number % 62)
        # one sensor alone cannot show its own constant errors; where it seems to, linearisation deceives
        alone = tr.heard[i] == 1 << (sensor.number % 62)
        apply_update(tr.x[i], tr.P[i], y, S, PHt, c, n - s.n_constant if alone else n)
    weigh(tr, i, log_visible, log_static, temper)
    if sensor.ranging:
        allow_stop(tr, i, s)
    tr.life[i, 1] = look.t + look.dt[k]
    tr.life[i, 3] += 1.0
