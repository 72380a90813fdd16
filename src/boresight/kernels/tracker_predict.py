"""How a track moves between looks: state, biases, hypotheses."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from boresight.kernels.options import LEAF, PART
from boresight.kernels.tracker import HIDDEN, NOTHING, STATIC, VISIBLE, Models, Settings, Tracks
from boresight.kernels.tracker_models import mix_models
from boresight.types.sensor import FloatArray

LEAST_SHARE = 1e-3  # of a target's probability that must be that of one setting off, for its state to follow


@njit(**PART)
def predict_all(tr: Tracks, s: Settings, t: float, models: Models | None) -> None:
    """Predict every track to time `t`: state (exact white-acceleration CV), biases, hypotheses."""
    dt = t - tr.time[0]
    tr.time[0] = t
    if dt <= 0.0 or tr.live[0] == 0:
        return
    n_bias = tr.x.shape[1] - 2 * s.d
    decay = np.empty(n_bias)
    for k in range(n_bias):
        decay[k] = math.exp(-dt / s.bias_tau[k])
    p_survive = math.exp(-dt / s.survival_time)
    rate = 1.0 / s.hide_time + 1.0 / s.show_time
    settle = 1.0 - math.exp(-dt * rate)
    leaves = 1.0 - math.exp(-dt / s.rest_time)
    to_hidden = settle / (s.hide_time * rate)
    to_visible = settle / (s.show_time * rate)
    for i in range(tr.live[0]):
        q = s.q
        if models is not None:
            q = mix_models(tr, i, s, models, dt)
            for c in range(tr.mode.shape[1]):
                if tr.mode[i, c] > 0.0:
                    noise = models.q if models.motions == 2 and c % 2 == 1 else s.q
                    predict(tr.mode_x[i, c], tr.mode_P[i, c], s, dt, noise, decay)
        predict(tr.x[i], tr.P[i], s, dt, q, decay)
        for a in range(s.d):
            tr.anchor_P[i, a, a] += s.static_q * dt
        w = tr.weight[i]
        v, h = w[VISIBLE] * p_survive, w[HIDDEN] * p_survive
        w[NOTHING] += (1.0 - p_survive) * (w[VISIBLE] + w[HIDDEN])
        w[VISIBLE] = v * (1.0 - to_hidden) + h * to_visible
        w[HIDDEN] = h * (1.0 - to_visible) + v * to_hidden
        set_off(tr, i, s, leaves, models)


@njit(**LEAF)
def set_off(tr: Tracks, i: int, s: Settings, leaves: float, models: Models | None) -> None:
    """Let what does not move set off with probability `leaves`, or be taken away with the same.

    A target's state becomes mean and covariance over what moved before and what sets off now: from where the object
    stands, at a speed that nobody knows yet.
    """
    w = tr.weight[i]
    starts = leaves * w[STATIC]
    moving = w[VISIBLE] + w[HIDDEN]
    w[VISIBLE] += starts
    w[NOTHING] += leaves * (w[STATIC] - starts)
    w[STATIC] -= starts + leaves * (w[STATIC] - starts)
    share = starts / (starts + moving) if starts > 0.0 else 0.0
    if share > LEAST_SHARE and tr.heard[i] > 0:
        start_from(tr.x[i], tr.P[i], tr.anchor[i], tr.anchor_P[i], s, share)
        if models is not None:
            for j in range(tr.mode.shape[1]):
                start_from(tr.mode_x[i, j], tr.mode_P[i, j], tr.anchor[i], tr.anchor_P[i], s, share)


@njit(**LEAF)
def start_from(x: FloatArray, P: FloatArray, place: FloatArray, place_P: FloatArray, s: Settings, share: float) -> None:
    """Mix (x, P) with a target that leaves `place` (3,), of covariance `place_P`, with probability `share`."""
    d, n = s.d, len(x)
    for a in range(2 * d):
        for b in range(n):
            kept = (1.0 - share) * P[a, b]
            if b < 2 * d:
                off_a = x[a] - place[a] if a < d else x[a]
                off_b = x[b] - place[b] if b < d else x[b]
                kept += share * (1.0 - share) * off_a * off_b
                if a < d and b < d:
                    kept += share * place_P[a, b]
                elif a == b:
                    kept += share * s.start_speed**2
            P[a, b] = kept
            if b >= 2 * d:
                P[b, a] = kept
    for a in range(d):
        x[a] += share * (place[a] - x[a])
        x[d + a] -= share * x[d + a]


@njit(**LEAF)
def predict(x: FloatArray, P: FloatArray, s: Settings, dt: float, q: float, decay: FloatArray) -> None:
    """Predict (x, P) over `dt` (s) with process noise `q` (m²/s³); `decay` of the biases, 1 for the constant ones."""
    n = len(x)
    d = s.d
    q3, q2, q1 = q * dt**3 / 3.0, q * dt**2 / 2.0, q * dt
    for a in range(d):
        x[a] += dt * x[d + a]
    for a in range(d):  # rows: F P
        for j in range(n):
            P[a, j] += dt * P[d + a, j]
    for a in range(d):  # columns: (F P) F'
        for j in range(n):
            P[j, a] += dt * P[j, d + a]
    for k in range(len(decay)):
        b = 2 * d + k
        x[b] *= decay[k]
        for j in range(n):
            P[b, j] *= decay[k]
        for j in range(n):
            P[j, b] *= decay[k]
        P[b, b] += s.bias_sigma[k] ** 2 * (1.0 - decay[k] ** 2)
    for a in range(d):
        P[a, a] += q3
        P[d + a, d + a] += q1
        P[a, d + a] += q2
        P[d + a, a] += q2
