"""The fixed-lag smoother: where tracks were `lag` seconds ago, given everything up to now.

The window keeps copies of all tracks, each conditioned on the looks before it. Dynamics are linear, so one backward
pass over the copies (Rauch, Tung, Striebel 1965) gives their smoothed states exactly, whatever the sensors were.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from boresight.kernels.tracker import Settings, Tracks
from boresight.tracking.core import Plan
from boresight.tracking.output import Rows
from boresight.tracking.window import Window, copies_of
from boresight.types import FloatArray


def smoothed_rows(window: Window, plan: Plan, after: float, until: float, t_known: float, coast: float) -> list[Rows]:
    """Return the smoothed rows of the shown tracks at the copies' times t (s) with `after` < t <= `until`, in order.

    Rows carry `t_known`, the arrival (s) of the newest look used. A track that began after a copy has no row there.
    """
    copies = copies_of(window, after)
    if not copies or float(copies[0].time[0]) > until:
        return []
    now = window.tracks
    shown = np.flatnonzero(now.life[: int(now.live[0]), 2] > 0.0)
    birth, x, P, t = now.birth[shown], now.x[shown], now.P[shown], float(now.time[0])
    hit = now.life[shown, 1]
    out: list[Rows] = []
    for tracks in reversed(copies):
        birth, here, there = np.intersect1d(
            tracks.birth[: int(tracks.live[0])], birth, assume_unique=True, return_indices=True
        )
        if len(birth) == 0:
            break
        hit = hit[there]
        x, P = _back(tracks, here, plan.settings, t, x[there], P[there])
        t = float(tracks.time[0])
        if t <= until:
            out.append(_rows(birth, x, P, t, t_known, t - hit > coast, plan.settings.d))
    return out[::-1]


def _back(
    tracks: Tracks, rows: NDArray[np.int64], s: Settings, t: float, x: FloatArray, P: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Smooth the states in a copy with those (x, P) at the later time `t`."""
    F, Q = _transition(s, t - float(tracks.time[0]), x.shape[1])
    x0, P0 = tracks.x[rows], tracks.P[rows]
    predicted = F @ P0 @ F.T + Q
    gain = np.linalg.solve(predicted, F @ P0).transpose(0, 2, 1)
    smoothed = P0 + gain @ (P - predicted) @ gain.transpose(0, 2, 1)
    return x0 + np.einsum("nij,nj->ni", gain, x - x0 @ F.T), 0.5 * (smoothed + smoothed.transpose(0, 2, 1))


def _transition(s: Settings, dt: float, n: int) -> tuple[FloatArray, FloatArray]:
    """Return F and Q (n, n) over `dt`: what `predict_all` does to one track."""
    d = s.d
    F, Q = np.eye(n), np.zeros((n, n))
    for a in range(d):
        F[a, d + a] = dt
        Q[a, a], Q[d + a, d + a] = s.q * dt**3 / 3.0, s.q * dt
        Q[a, d + a] = Q[d + a, a] = s.q * dt**2 / 2.0
    for k, (sigma, tau) in enumerate(zip(s.bias_sigma, s.bias_tau, strict=True)):
        decay = math.exp(-dt / tau)
        F[2 * d + k, 2 * d + k] = decay
        Q[2 * d + k, 2 * d + k] = sigma**2 * (1.0 - decay**2)
    # times that coincide make the prediction singular where a state is known exactly: nothing moves then
    return F, Q + 1e-12 * np.eye(n)


def _rows(
    birth: NDArray[np.int64],
    x: FloatArray,
    P: FloatArray,
    t: float,
    t_known: float,
    coasting: NDArray[np.bool_],
    d: int,
) -> Rows:
    n = len(birth)
    return Rows(
        t=np.full(n, t),
        t_known=np.full(n, t_known),
        track_id=np.zeros(n, np.int64),
        birth=birth,
        coasting=coasting,
        position=x[:, :d].copy(),
        velocity=x[:, d : 2 * d].copy(),
        covariance=P[:, :d, :d].copy(),
    )
