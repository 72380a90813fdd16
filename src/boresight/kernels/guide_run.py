"""The guide filter over reports in order of arrival: one step, one prediction, or a whole run in one call."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from boresight.kernels.guide import (
    ACCELERATION,
    EARTH_RATE,
    LEAST_WIDTH,
    N_BIAS,
    ORBIT,
    ROWS,
    TRACK,
    advance,
    look_at,
    spin,
)  # fmt: skip
from boresight.kernels.guide_begin import first_place
from boresight.kernels.guide_update import CLIP, bring_to, start, update
from boresight.kernels.options import PART
from boresight.types.sensor import FloatArray

# Where a filter's settings and running numbers stand in their arrays.
S_DYNAMICS, S_Q, S_GATE, S_FORGET, S_MAX_AGE, S_RESTART = range(6)
C_TIME, C_STARTED, C_REJECTED, C_BEST, C_RESTARTS, C_COUNT = range(6)
N_CLOCK = 6
FURTHEST = 50.0  # how far one hypothesis may lead another (log-likelihood)
RESTING = -1e9
ASLEEP = -8.0  # one that is further back rests, once the filter has settled …
SETTLED = 60.0  # … after so many reports
WAKE = 4.0  # rejections of one source in a row that wake the hypothesis that it is biased
ACCEPTED, REJECTED, WAITING, STALE = 0, 1, 2, 3
EMPTY = 5  # nothing in it that its source has a sigma for (4 is `pointing.guide.THINNED`)


@njit(cache=True)
def step(
    clock: FloatArray, X: FloatArray, P: FloatArray, L: FloatArray, scale: FloatArray, run_of: FloatArray,
    seen: FloatArray, settings: FloatArray, spread: FloatArray, source: int, kind: int, t: float, z: FloatArray,
    origin: FloatArray, axes: FloatArray, sigma: FloatArray, offsets: FloatArray, sigma_bias: FloatArray, w: FloatArray,
) -> int:  # fmt: skip
    """Take one report into every hypothesis; returns ACCEPTED, REJECTED, WAITING (no start yet), STALE or EMPTY.

    `sigma` (4,) is the report's (`look_at`). `scale` (s,) is the learned factor on each source's variance, `run_of`
    (s,) its run of rejections, `seen` (s, N_SEEN) what it said before the start. Hypothesis 0 has none of the gross
    biases, hypothesis 1 + s one of source s, with the prior `sigma_bias` (s,) (m; 0: the source has none). `offsets`
    (s, 4) are priors of constant biases in azimuth, elevation, range and time, that every hypothesis holds (0: none).
    """
    dynamics, q = int(settings[S_DYNAMICS]), settings[S_Q]
    if clock[C_STARTED] == 0.0 and not _begin(
        clock, X, P, L, dynamics, settings[S_MAX_AGE], offsets, sigma_bias, spread, seen, source, kind, t, z, origin,
        axes,
    ):  # fmt: skip
        return WAITING
    _bring_all(clock, X, P, L, dynamics, q, t, w)
    if t < clock[C_TIME] - settings[S_MAX_AGE]:
        return STALE
    k = look_at(kind, t, z, origin, axes, sigma, scale[source], w)
    if k == 0:
        return EMPTY
    best, m, lag = int(clock[C_BEST]), X.shape[1] - 3, t - clock[C_TIME]
    first = _first(dynamics, source, offsets)
    fate = REJECTED
    nis, share = 0.0, 0.0
    for h in range(len(X)):
        if L[h] <= RESTING:
            continue
        n = m if h == 0 else m + 3
        e, l, s = update(
            X[h], P[h], n, lag, h == source + 1, first, offsets[source], dynamics, q, kind, k, settings[S_GATE], w
        )
        L[h] += l if l - l == 0.0 else -CLIP
        if h == best:
            nis, share = e, s
            fate = ACCEPTED if e <= settings[S_GATE] else REJECTED
    _weigh(clock, L)
    if fate == ACCEPTED:
        # the noise explains `share` of S: learn only as much of the surprise; a track is never better than it says
        gain, least = settings[S_FORGET] * share, (1.0 if kind == TRACK else 0.1)
        scale[source] = min(max(scale[source] * (1.0 + gain * (nis / k - 1.0)), least), 100.0)
        clock[C_REJECTED] = max(clock[C_REJECTED] - 1.0, 0.0)
        run_of[source] = 0.0
    else:
        clock[C_REJECTED] += 1.0
        run_of[source] += 1.0
        if run_of[source] >= WAKE and sigma_bias[source] > 0.0 and L[source + 1] <= RESTING:
            _wake(X, P, L, best, source, sigma_bias[source])
            run_of[source] = 0.0
        if clock[C_REJECTED] >= settings[S_RESTART]:
            clock[C_STARTED] = 0.0
            clock[C_RESTARTS] += 1.0
    return fate


@njit(cache=True)
def surprise(
    clock: FloatArray, X: FloatArray, P: FloatArray, scale: FloatArray, settings: FloatArray, source: int, kind: int,
    t: float, z: FloatArray, origin: FloatArray, axes: FloatArray, sigma: FloatArray, offsets: FloatArray,
    w: FloatArray,
) -> float:  # fmt: skip
    """Return the NIS that a report would have in the likeliest hypothesis, NaN before the start or for an empty one.

    The state is left alone.
    """
    if clock[C_STARTED] == 0.0:
        return math.nan
    k = look_at(kind, t, z, origin, axes, sigma, scale[source], w)
    if k == 0:
        return math.nan
    dynamics, q = int(settings[S_DYNAMICS]), settings[S_Q]
    best, m = int(clock[C_BEST]), X.shape[1] - 3
    n = m if best == 0 else m + 3
    x, C = X[best].copy(), P[best].copy()
    bring_to(x, C, n, clock[C_TIME], dynamics, q, t, w)
    first = _first(dynamics, source, offsets)
    lag = min(t - clock[C_TIME], 0.0)
    return update(x, C, n, lag, best == source + 1, first, offsets[source], dynamics, q, kind, k, -1.0, w)[0]


@njit(**PART)
def _first(dynamics: int, source: int, offsets: FloatArray) -> int:
    """Return the number in a state of a source's first bias."""
    first = 6 if dynamics == ORBIT else 9
    for s in range(source):
        for j in range(N_BIAS):
            if offsets[s, j] > 0.0:
                first += 1
    return first


@njit(**PART)
def _begin(
    clock: FloatArray, X: FloatArray, P: FloatArray, L: FloatArray, dynamics: int, held: float, offsets: FloatArray,
    sigma_bias: FloatArray, spread: FloatArray, seen: FloatArray, source: int, kind: int, t: float, z: FloatArray,
    origin: FloatArray, axes: FloatArray,
) -> bool:  # fmt: skip
    where, here, velocity = np.empty(3), np.empty(3), np.zeros(3)
    if not first_place(seen, source, kind, t, z, origin, axes, held, where):
        return False
    spin(t, where, here)
    if dynamics == ACCELERATION:  # at rest on the Earth
        velocity[0], velocity[1] = -EARTH_RATE * here[1], EARTH_RATE * here[0]
    start(X, P, 6 if dynamics == ORBIT else 9, here, velocity, spread, offsets, sigma_bias)
    seen[:] = math.nan
    L[:] = 0.0
    for h in range(1, len(L)):
        if sigma_bias[h - 1] == 0.0:
            L[h] = RESTING
    clock[C_TIME], clock[C_STARTED], clock[C_REJECTED], clock[C_BEST], clock[C_COUNT] = t, 1.0, 0.0, 0.0, 0.0
    return True


@njit(**PART)
def _bring_all(
    clock: FloatArray, X: FloatArray, P: FloatArray, L: FloatArray, dynamics: int, q: float, t: float, w: FloatArray,
) -> None:  # fmt: skip
    """Advance the hypotheses that do not rest to `t`, if that is later."""
    m = X.shape[1] - 3
    if t > clock[C_TIME]:
        for h in range(len(X)):
            if L[h] > RESTING:
                bring_to(X[h], P[h], m if h == 0 else m + 3, clock[C_TIME], dynamics, q, t, w)
        clock[C_TIME] = t
    clock[C_COUNT] += 1.0


@njit(**PART)
def _wake(X: FloatArray, P: FloatArray, L: FloatArray, best: int, source: int, sigma_bias: float) -> None:
    """Start the hypothesis that `source` is biased from the best one, with the bias unknown."""
    h, m = source + 1, X.shape[1] - 3
    X[h], P[h] = X[best], P[best]
    X[h, m:] = 0.0
    P[h, m:, :] = 0.0
    P[h, :, m:] = 0.0
    for i in range(m, m + 3):
        P[h, i, i] = sigma_bias**2
    L[h] = 0.5 * ASLEEP


@njit(**PART)
def _weigh(clock: FloatArray, L: FloatArray) -> None:
    """Count the log-likelihoods from the best one's, and lay to rest what is far behind."""
    best = 0
    for h in range(1, len(L)):
        if L[h] > RESTING and (L[best] <= RESTING or L[h] > L[best]):
            best = h
    top = L[best]
    for h in range(len(L)):
        if L[h] > RESTING:
            L[h] = max(L[h] - top, -FURTHEST)
            if L[h] < ASLEEP and clock[C_COUNT] > SETTLED:
                L[h] = RESTING
    clock[C_BEST] = best


@njit(cache=True)
def predict_to(
    clock: FloatArray, X: FloatArray, P: FloatArray, settings: FloatArray, t: float, position: FloatArray,
    velocity: FloatArray, covariance: FloatArray, w: FloatArray,
) -> bool:  # fmt: skip
    """Fill ECEF position, velocity (3,) (against the turning Earth) and covariance (3, 3) at `t`; false before start.

    The state itself is left alone.
    """
    if clock[C_STARTED] == 0.0:
        return False
    best = int(clock[C_BEST])
    dynamics, q = int(settings[S_DYNAMICS]), settings[S_Q]
    m = 6 if dynamics == ORBIT else 9
    x = X[best].copy()
    C = P[best].copy()
    if t >= clock[C_TIME]:
        bring_to(x, C, m, clock[C_TIME], dynamics, q, t, w)
    else:
        advance(x, dynamics, t - clock[C_TIME], w)
    c, s = math.cos(EARTH_RATE * t), math.sin(EARTH_RATE * t)
    position[0], position[1], position[2] = c * x[0] + s * x[1], c * x[1] - s * x[0], x[2]
    velocity[0] = c * x[3] + s * x[4] + EARTH_RATE * position[1]
    velocity[1] = c * x[4] - s * x[3] - EARTH_RATE * position[0]
    velocity[2] = x[5]
    for i in range(3):
        for j in range(3):
            covariance[i, j] = C[i, j]
    for j in range(3):
        a, b = covariance[0, j], covariance[1, j]
        covariance[0, j], covariance[1, j] = c * a + s * b, c * b - s * a
    for i in range(3):
        a, b = covariance[i, 0], covariance[i, 1]
        covariance[i, 0], covariance[i, 1] = c * a + s * b, c * b - s * a
    return True


@njit(cache=True)
def run(
    clock: FloatArray, X: FloatArray, P: FloatArray, L: FloatArray, scale: FloatArray, run_of: FloatArray,
    seen: FloatArray, settings: FloatArray, spread: FloatArray, source: NDArray[np.int64], kind: NDArray[np.int64],
    t: FloatArray, t_recv: FloatArray, z: FloatArray, origin: FloatArray, axes: FloatArray, sigma: FloatArray,
    offsets: FloatArray, sigma_bias: FloatArray,
    t_node: FloatArray, t_aim: FloatArray, position: FloatArray, velocity: FloatArray, covariance: FloatArray,
    best: NDArray[np.int64], fate: NDArray[np.int64],
) -> None:  # fmt: skip
    """Step through reports in order of arrival; at each node predict to its aim time from what had arrived.

    Fills (k, 3), (k, 3), (k, 3, 3) per node, NaN before the start, the hypothesis in use, and each report's fate.
    """
    row = 0
    w = np.zeros((ROWS, max(X.shape[1], LEAST_WIDTH)))
    for k in range(len(t_node)):
        while row < len(t) and t_recv[row] <= t_node[k]:
            fate[row] = step(
                clock, X, P, L, scale, run_of, seen, settings, spread, source[row], kind[row], t[row], z[row],
                origin[row], axes[row], sigma[row], offsets, sigma_bias, w,
            )  # fmt: skip
            row += 1
        if not predict_to(clock, X, P, settings, t_aim[k], position[k], velocity[k], covariance[k], w):
            position[k] = velocity[k] = math.nan
            covariance[k] = math.nan
        best[k] = int(clock[C_BEST])


def settings_of(orbit: bool, q: float, gate: float, forget: float, max_age: float, restart: int) -> FloatArray:
    """Return the settings as the kernels take them."""
    return np.array([ORBIT if orbit else ACCELERATION, q, gate, forget, max_age, float(restart)])
