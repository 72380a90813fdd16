"""A target's state as a mixture: how it moves, and how high it may be.

Two models of motion, with the process noise of quiet motion and with that of manoeuvres, are the interacting multiple
model (Blom and Bar-Shalom 1988) as in `kernels.imm`, for two models of the same states and in place: moments of two
Gaussians need no room but their own. Where no height is measured, each height along the arc has them
(`tracker_heights`). A track's x and P are the moments of all; whatever asks where the track is uses these, and
whatever moves the track moves the components and takes the moments anew.
"""

from __future__ import annotations

import math

from numba import njit

from boresight.kernels.options import LEAF
from boresight.kernels.tracker import Look, Models, SensorTable, Settings, Tracks
from boresight.kernels.tracker_state import condition
from boresight.kernels.tracker_workroom import Workroom

LEAST_MODE = 1e-12  # probability that a model of motion keeps whatever a look says, so that it is not lost for good
LEAST_HEIGHT = 1e-4  # probability below which a height is given up


@njit(**LEAF)
def switching(models: Models, dt: float) -> tuple[float, float]:
    """Return the probabilities that a manoeuvre has begun, and ended, `dt` (s) later."""
    rate = 1.0 / models.every + 1.0 / models.lasts
    settle = 1.0 - math.exp(-dt * rate)
    return settle / (models.every * rate), settle / (models.lasts * rate)


@njit(**LEAF)
def expected_noise(tr: Tracks, i: int, s: Settings, models: Models, dt: float) -> float:
    """Process noise (m²/s³) with which the moments of all components move over `dt` (s).

    They share their transition matrix, and mixing leaves the moments as they are: x and P follow exactly.
    """
    if models.motions == 1:
        return s.q
    begins, ends = switching(models, dt)
    manoeuvre = 0.0
    for h in range(models.heights):
        manoeuvre += tr.mode[i, 2 * h + 1] * (1.0 - ends) + tr.mode[i, 2 * h] * begins
    return float((1.0 - manoeuvre) * s.q + manoeuvre * models.q)


@njit(**LEAF)
def begin_component(tr: Tracks, i: int, h: int, share: float, models: Models) -> None:
    """Give height `h` of track `i` the track's state, with probability `share`, which its models of motion share."""
    for j in range(models.motions):
        c = h * models.motions + j
        tr.mode[i, c] = share
        if models.motions == 2:
            manoeuvre = models.lasts / (models.every + models.lasts)
            tr.mode[i, c] = share * (manoeuvre if j == 1 else 1.0 - manoeuvre)
        for a in range(tr.x.shape[1]):
            tr.mode_x[i, c, a] = tr.x[i, a]
            for b in range(tr.x.shape[1]):
                tr.mode_P[i, c, a, b] = tr.P[i, a, b]


@njit(**LEAF)
def begin_models(tr: Tracks, i: int, models: Models) -> None:
    """Give a new track one height, and its models of motion the probabilities of a target of which nothing is known."""
    for c in range(tr.mode.shape[1]):
        tr.mode[i, c] = 0.0
    begin_component(tr, i, 0, 1.0, models)


@njit(**LEAF)
def mix_models(tr: Tracks, i: int, s: Settings, models: Models, dt: float) -> float:
    """Let the models of motion of track `i` change into each other over `dt` (s); returns `expected_noise`.

    Each model's state becomes mean and covariance over what it may have been before.
    """
    q = expected_noise(tr, i, s, models, dt)
    if models.motions == 2:
        begins, ends = switching(models, dt)
        for h in range(models.heights):
            if tr.mode[i, 2 * h] > 0.0:
                mix_pair(tr, i, 2 * h, begins, ends)
    return float(q)


@njit(**LEAF)
def mix_pair(tr: Tracks, i: int, c: int, begins: float, ends: float) -> None:
    """Mix component `c` (quiet) and the next (manoeuvring), one of which becomes the other with these probabilities."""
    w, x, P = tr.mode[i], tr.mode_x[i], tr.mode_P[i]
    d = c + 1
    quiet, manoeuvre = w[c] * (1.0 - begins) + w[d] * ends, w[d] * (1.0 - ends) + w[c] * begins
    other0, other1 = w[d] * ends / quiet, w[c] * begins / manoeuvre  # share of the other one in each
    w[c], w[d] = quiet, manoeuvre
    n = tr.x.shape[1]
    for a in range(n):
        for b in range(n):
            apart = (x[c, a] - x[d, a]) * (x[c, b] - x[d, b])
            P0, P1 = P[c, a, b], P[d, a, b]
            P[c, a, b] = (1.0 - other0) * P0 + other0 * (P1 + (1.0 - other0) * apart)
            P[d, a, b] = (1.0 - other1) * P1 + other1 * (P0 + (1.0 - other1) * apart)
    for a in range(n):
        x0, x1 = x[c, a], x[d, a]
        x[c, a] = (1.0 - other0) * x0 + other0 * x1
        x[d, a] = (1.0 - other1) * x1 + other1 * x0


@njit(**LEAF)
def condition_models(
    tr: Tracks,
    i: int,
    s: Settings,
    k: int,
    look: Look,
    sensor: SensorTable,
    room: Workroom,
    considered: int,
    models: Models,
) -> None:
    """Condition all components of track `i` on detection `k`, weigh them by its likelihood, and take the moments."""
    best = -math.inf
    for c in range(tr.mode.shape[1]):
        if tr.mode[i, c] > 0.0:
            log = condition(tr.mode_x[i, c], tr.mode_P[i, c], s.d, k, look, sensor, room, considered)
            room.logs[c] = math.log(tr.mode[i, c]) + log
            best = max(best, room.logs[c])
    for c in range(tr.mode.shape[1]):
        if tr.mode[i, c] > 0.0:
            tr.mode[i, c] = max(math.exp(max(room.logs[c] - best, -700.0)), LEAST_MODE)
    give_up_heights(tr, i, models)
    combine_models(tr, i)


@njit(**LEAF)
def give_up_heights(tr: Tracks, i: int, models: Models) -> None:
    """Make the probabilities of the components of track `i` add to one, without those of hardly any."""
    w = tr.mode[i]
    total = 0.0
    for c in range(len(w)):
        total += w[c]
    left = 0.0
    for h in range(models.heights):
        share = 0.0
        for c in range(h * models.motions, (h + 1) * models.motions):
            w[c] /= total
            share += w[c]
        if share < LEAST_HEIGHT:
            for c in range(h * models.motions, (h + 1) * models.motions):
                w[c] = 0.0
        else:
            left += share
    for c in range(len(w)):
        w[c] /= left


@njit(**LEAF)
def combine_models(tr: Tracks, i: int) -> None:
    """Set x and P of track `i` to the moments of its components."""
    w, x, P = tr.mode[i], tr.mode_x[i], tr.mode_P[i]
    n = tr.x.shape[1]
    for a in range(n):
        mean = 0.0
        for c in range(len(w)):
            if w[c] > 0.0:
                mean += w[c] * x[c, a]
        tr.x[i, a] = mean
    for a in range(n):
        for b in range(a + 1):
            total = 0.0
            for c in range(len(w)):
                if w[c] > 0.0:
                    total += w[c] * (P[c, a, b] + (x[c, a] - tr.x[i, a]) * (x[c, b] - tr.x[i, b]))
            tr.P[i, a, b] = total
            tr.P[i, b, a] = total
