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
    ORBIT,
    ROWS,
    TRACK,
    advance,
    look_at,
    spin,
)  # fmt: skip
from boresight.kernels.guide_begin import first_place
from boresight.kernels.guide_update import CLIP, Columns, bring_to, start, update
from boresight.kernels.options import PART
from boresight.types.sensor import FloatArray

# Where a filter's settings and running numbers stand in their arrays.
S_DYNAMICS, S_Q, S_GATE, S_FORGET, S_MAX_AGE, S_RESTART, S_HELD, S_ALL = range(8)
C_TIME, C_STARTED, C_REJECTED, C_BEST, C_RESTARTS, C_COUNT = range(6)
N_CLOCK = 6
FURTHEST = 50.0  # how far one hypothesis may lead another (log-likelihood)
RESTING = -1e9
ASLEEP = -8.0  # one that is further back rests, once the filter has settled …
SETTLED = 60.0  # … after so many reports
DOUBT = 5.0  # log-likelihood by which "all are a little off" begins behind
LONGEST_GAP = 86400.0  # s from one report to the next, and of a prediction; beyond it nothing is known any more
TOO_LATE = 60.0  # s behind the newest: more than any latency
WAKE = 4.0  # rejections of one source in a row that wake the hypothesis that it is biased
ACCEPTED, REJECTED, WAITING, STALE = 0, 1, 2, 3
EMPTY = 5  # nothing in it that its source has a sigma for (4 is `pointing.guide.THINNED`)


@njit(cache=True)
def step(
    clock: FloatArray, X: FloatArray, P: FloatArray, L: FloatArray, scale: FloatArray, run_of: FloatArray,
    seen: FloatArray, settings: FloatArray, spread: FloatArray, source: int, kind: int, t: float, z: FloatArray,
    origin: FloatArray, axes: FloatArray, sigma: FloatArray, columns: Columns,
    priors: FloatArray, sigma_bias: FloatArray, w: FloatArray,
) -> int:  # fmt: skip
    """Take one report into every hypothesis; returns ACCEPTED, REJECTED, WAITING (no start yet), STALE or EMPTY.

    `sigma` (4,) is the report's (`look_at`). `scale` (s,) is the learned factor on each source's variance, `run_of`
    (s,) its run of rejections, `seen` (s, N_SEEN) what it said before the start. Hypothesis 0 has none of the gross
    biases, hypothesis 1 + s one of source s, with the prior `sigma_bias` (s,) (m; 0: the source has none); the last,
    if there is one more, has small ones of all. `columns` and `priors` (2, s, 4) say where states hold the sources'
    constant biases in azimuth, elevation, range and time (-1: not), and their priors: of all hypotheses but the last
    one (those declared), and of the last one.
    """
    dynamics, q = int(settings[S_DYNAMICS]), settings[S_Q]
    if clock[C_STARTED] == 0.0 and not _begin(
        clock, X, P, L, settings, columns, priors, sigma_bias, spread, seen, source, kind, t, z, origin, axes
    ):  # fmt: skip
        return WAITING
    if not t - clock[C_TIME] <= LONGEST_GAP:  # a wrong stamp, or so long after that nothing is known
        _refused(clock, settings)
        return REJECTED
    _bring_all(clock, X, P, L, settings, len(sigma_bias), t, w)
    if t < clock[C_TIME] - settings[S_MAX_AGE]:
        if t < clock[C_TIME] - TOO_LATE:  # no latency: this stamp is wrong, or the one that the time is from
            _refused(clock, settings)
        return STALE
    k = look_at(kind, t, z, origin, axes, sigma, scale[source], w)
    if k == 0:
        return EMPTY
    best, lag, sources = int(clock[C_BEST]), t - clock[C_TIME], len(sigma_bias)
    fate = REJECTED
    nis, share = 0.0, 0.0
    for h in range(len(X)):
        if L[h] <= RESTING:
            continue
        at = columns[1 if h > sources else 0, source]
        n = _size(h, sources, settings)
        e, l, s = update(X[h], P[h], n, lag, h == source + 1, at, dynamics, q, kind, k, settings[S_GATE], w)
        L[h] += l if l - l == 0.0 else -CLIP
        if h == best:
            nis, share = e, s
            fate = ACCEPTED if e <= settings[S_GATE] else REJECTED
    _weigh(clock, L, sources)
    if fate == ACCEPTED:
        # the noise explains `share` of S: learn only as much of the surprise; a track is never better than it says
        gain, least = settings[S_FORGET] * share, (1.0 if kind == TRACK else 0.1)
        scale[source] = min(max(scale[source] * (1.0 + gain * (nis / k - 1.0)), least), 100.0)
        clock[C_REJECTED] = max(clock[C_REJECTED] - 1.0, 0.0)
        run_of[source] = 0.0
    else:
        run_of[source] += 1.0
        if run_of[source] >= WAKE and sigma_bias[source] > 0.0 and L[source + 1] <= RESTING:
            _wake(X, P, L, int(settings[S_HELD]), best, source, sigma_bias[source])
            run_of[source] = 0.0
        _refused(clock, settings)
    return fate


@njit(**PART)
def _refused(clock: FloatArray, settings: FloatArray) -> None:
    """Count a report that does not fit; when such outnumber those that do, the target is forgotten."""
    clock[C_REJECTED] += 1.0
    if clock[C_REJECTED] >= settings[S_RESTART]:
        clock[C_STARTED] = 0.0
        clock[C_RESTARTS] += 1.0


@njit(cache=True)
def surprise(
    clock: FloatArray, X: FloatArray, P: FloatArray, scale: FloatArray, settings: FloatArray, source: int, kind: int,
    t: float, z: FloatArray, origin: FloatArray, axes: FloatArray, sigma: FloatArray, columns: Columns,
    w: FloatArray,
) -> float:  # fmt: skip
    """Return the NIS that a report would have in the likeliest hypothesis, NaN before the start or for an empty one.

    The state is left alone.
    """
    if clock[C_STARTED] == 0.0 or not t - clock[C_TIME] <= LONGEST_GAP:
        return math.nan
    k = look_at(kind, t, z, origin, axes, sigma, scale[source], w)
    if k == 0:
        return math.nan
    dynamics, q = int(settings[S_DYNAMICS]), settings[S_Q]
    best, sources = int(clock[C_BEST]), len(scale)
    n = _size(best, sources, settings)
    x, C = X[best].copy(), P[best].copy()
    bring_to(x, C, n, clock[C_TIME], dynamics, q, t, w)
    at = columns[1 if best > sources else 0, source]
    lag = min(t - clock[C_TIME], 0.0)
    return update(x, C, n, lag, best == source + 1, at, dynamics, q, kind, k, -1.0, w)[0]


@njit(**PART)
def _size(h: int, sources: int, settings: FloatArray) -> int:
    """Return how many numbers hypothesis `h` estimates."""
    held = int(settings[S_HELD])
    if h == 0:
        return held
    return held + 3 if h <= sources else int(settings[S_ALL])


@njit(**PART)
def _begin(
    clock: FloatArray, X: FloatArray, P: FloatArray, L: FloatArray, settings: FloatArray, columns: Columns,
    priors: FloatArray, sigma_bias: FloatArray, spread: FloatArray, seen: FloatArray, source: int, kind: int, t: float,
    z: FloatArray, origin: FloatArray, axes: FloatArray,
) -> bool:  # fmt: skip
    where, here, velocity = np.empty(3), np.empty(3), np.zeros(3)
    if not first_place(seen, source, kind, t, z, origin, axes, settings[S_MAX_AGE], where):
        return False
    spin(t, where, here)
    m = 6
    if int(settings[S_DYNAMICS]) == ACCELERATION:  # at rest on the Earth
        m = 9
        velocity[0], velocity[1] = -EARTH_RATE * here[1], EARTH_RATE * here[0]
    start(X, P, m, int(settings[S_HELD]), here, velocity, spread, columns, priors, sigma_bias)
    seen[:] = math.nan
    L[:] = 0.0
    for h in range(1, len(L)):
        if h > len(sigma_bias):
            L[h] = -DOUBT
        elif sigma_bias[h - 1] == 0.0:
            L[h] = RESTING
    clock[C_TIME], clock[C_STARTED], clock[C_REJECTED], clock[C_BEST], clock[C_COUNT] = t, 1.0, 0.0, 0.0, 0.0
    return True


@njit(**PART)
def _bring_all(
    clock: FloatArray, X: FloatArray, P: FloatArray, L: FloatArray, settings: FloatArray, sources: int, t: float,
    w: FloatArray,
) -> None:  # fmt: skip
    """Advance the hypotheses that do not rest to `t`, if that is later."""
    if t > clock[C_TIME]:
        for h in range(len(X)):
            if L[h] > RESTING:
                n = _size(h, sources, settings)
                bring_to(X[h], P[h], n, clock[C_TIME], int(settings[S_DYNAMICS]), settings[S_Q], t, w)
        clock[C_TIME] = t
    clock[C_COUNT] += 1.0


@njit(**PART)
def _wake(X: FloatArray, P: FloatArray, L: FloatArray, held: int, best: int, source: int, sigma_bias: float) -> None:
    """Start the hypothesis that `source` is biased from the best one, with the bias unknown."""
    h = source + 1
    X[h], P[h] = X[best], P[best]
    X[h, held:] = 0.0
    P[h, held:, :] = 0.0
    P[h, :, held:] = 0.0
    for i in range(held, held + 3):
        P[h, i, i] = sigma_bias**2
    L[h] = 0.5 * ASLEEP


@njit(**PART)
def _weigh(clock: FloatArray, L: FloatArray, sources: int) -> None:
    """Count the log-likelihoods from the best one's, and lay to rest what is far behind.

    The one that all are a little off never rests: what it says may show only when a second source comes.
    """
    best = 0
    for h in range(1, len(L)):
        if L[h] > RESTING and (L[best] <= RESTING or L[h] > L[best]):
            best = h
    top = L[best]
    for h in range(len(L)):
        if L[h] > RESTING:
            L[h] = max(L[h] - top, -FURTHEST)
            if h > sources:
                L[h] = max(L[h], ASLEEP)
            elif L[h] < ASLEEP and clock[C_COUNT] > SETTLED:
                L[h] = RESTING
    clock[C_BEST] = best


@njit(cache=True)
def predict_to(
    clock: FloatArray, X: FloatArray, P: FloatArray, settings: FloatArray, t: float, position: FloatArray,
    velocity: FloatArray, covariance: FloatArray, w: FloatArray,
) -> bool:  # fmt: skip
    """Fill ECEF position, velocity (3,) (against the turning Earth) and covariance (3, 3) at `t`; false before start.

    And further than LONGEST_GAP from the newest report. The state itself is left alone.
    """
    if clock[C_STARTED] == 0.0 or not abs(t - clock[C_TIME]) <= LONGEST_GAP:
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
    columns: Columns, priors: FloatArray, sigma_bias: FloatArray,
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
                origin[row], axes[row], sigma[row], columns, priors, sigma_bias, w,
            )  # fmt: skip
            row += 1
        if not predict_to(clock, X, P, settings, t_aim[k], position[k], velocity[k], covariance[k], w):
            position[k] = velocity[k] = math.nan
            covariance[k] = math.nan
        best[k] = int(clock[C_BEST])


def settings_of(
    orbit: bool, q: float, gate: float, forget: float, max_age: float, restart: int, held: int, all_of_them: int
) -> FloatArray:
    """Return the settings as the kernels take them; `held` and `all_of_them` are sizes of a state (`_size`)."""
    kind = ORBIT if orbit else ACCELERATION
    return np.array([kind, q, gate, forget, max_age, float(restart), float(held), float(all_of_them)])
