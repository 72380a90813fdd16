"""The fixed-lag smoother: where tracks were `lag` seconds ago, given everything up to now.

The window keeps copies of all tracks, each conditioned on the looks before it. Dynamics are linear, so one backward
pass over the copies (Rauch, Tung, Striebel 1965) gives their smoothed states exactly, whatever the sensors were. Where
targets manoeuvre it is that of the moments: the probability of a manoeuvre between two copies, given everything, comes
from a backward pass too (Kim 1994) and says how far the target may have been driven there.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from boresight.kernels.tracker import Models, Settings, Tracks
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
    mode: Any = None if plan.models is None or plan.models.motions == 1 else _motions(now.mode[shown])
    out: list[Rows] = []
    for tracks in reversed(copies):
        birth, here, there = np.intersect1d(
            tracks.birth[: int(tracks.live[0])], birth, assume_unique=True, return_indices=True
        )
        if len(birth) == 0:
            break
        hit = hit[there]
        dt = t - float(tracks.time[0])
        q = np.full(len(birth), plan.settings.q)
        if plan.models is not None and plan.models.motions == 2:
            q, mode = _modes_back(_motions(tracks.mode[here]), plan.models, plan.settings, dt, mode[there])
        x, P = _back(tracks, here, plan.settings, dt, q, x[there], P[there])
        t -= dt
        if t <= until:
            heard = t - hit <= plan.settings.hide_after
            parts = birth[heard], x[heard], P[heard]
            out.append(_rows(*parts, t, t_known, (t - hit > coast)[heard], plan.settings))
    return out[::-1]


def _back(
    tracks: Tracks, rows: NDArray[np.int64], s: Settings, dt: float, q: FloatArray, x: FloatArray, P: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Smooth the states in a copy with those (x, P) `dt` (s) later, driven by process noise `q` (k,) in between."""
    F, Q = _transition(s, dt, q, x.shape[1])
    x0, P0 = tracks.x[rows], tracks.P[rows]
    predicted = F @ P0 @ F.T + Q
    gain = np.linalg.solve(predicted, F @ P0).transpose(0, 2, 1)
    smoothed = P0 + gain @ (P - predicted) @ gain.transpose(0, 2, 1)
    return x0 + np.einsum("nij,nj->ni", gain, x - x0 @ F.T), 0.5 * (smoothed + smoothed.transpose(0, 2, 1))


def _motions(mode: FloatArray) -> FloatArray:
    """Return the probabilities (k, 2) of the two models of motion, whatever the height."""
    out: FloatArray = mode.reshape(len(mode), -1, 2).sum(axis=1)
    return out


def _modes_back(
    mode: FloatArray, models: Models, s: Settings, dt: float, after: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Smooth the models' probabilities (k, 2) with those `dt` (s) later; returns the process noise (k,) between too."""
    rate = 1.0 / models.every + 1.0 / models.lasts
    settle = 1.0 - math.exp(-dt * rate)
    begins, ends = settle / (models.every * rate), settle / (models.lasts * rate)
    change = np.array([[1.0 - begins, begins], [ends, 1.0 - ends]])
    return after @ np.array([s.q, models.q]), mode * ((after / (mode @ change)) @ change.T)


def _transition(s: Settings, dt: float, q: FloatArray, n: int) -> tuple[FloatArray, FloatArray]:
    """Return F (n, n), and Q (k, n, n) for process noises `q` (k,), over `dt`: what `predict` does to one track."""
    d = s.d
    F, Q = np.eye(n), np.zeros((len(q), n, n))
    for a in range(d):
        F[a, d + a] = dt
        Q[:, a, a], Q[:, d + a, d + a] = q * dt**3 / 3.0, q * dt
        Q[:, a, d + a] = Q[:, d + a, a] = q * dt**2 / 2.0
    for k, (sigma, tau) in enumerate(zip(s.bias_sigma, s.bias_tau, strict=True)):
        decay = math.exp(-dt / tau)
        F[2 * d + k, 2 * d + k] = decay
        Q[:, 2 * d + k, 2 * d + k] = sigma**2 * (1.0 - decay**2)
    # times that coincide make the prediction singular where a state is known exactly: nothing moves then
    return F, Q + 1e-12 * np.eye(n)


def _rows(
    birth: NDArray[np.int64],
    x: FloatArray,
    P: FloatArray,
    t: float,
    t_known: float,
    coasting: NDArray[np.bool_],
    s: Settings,
) -> Rows:
    n, d = len(birth), s.d
    return Rows(
        t=np.full(n, t),
        t_known=np.full(n, t_known),
        track_id=np.zeros(n, np.int64),
        birth=birth,
        coasting=coasting,
        position=x[:, :d].copy(),
        velocity=x[:, d : 2 * d].copy(),
        covariance=P[:, :d, :d] + s.extent**2 * np.eye(d),
    )
