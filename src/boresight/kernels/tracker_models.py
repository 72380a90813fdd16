"""Two models of how a target moves: with the process noise of quiet motion, and with that of manoeuvres.

The interacting multiple model (Blom and Bar-Shalom 1988) as in `kernels.imm`, for two models of the same states and in
place: moments of two Gaussians need no room but their own. A track's x and P are the moments of both; whatever asks
where the track is uses these, and whatever moves the track moves the models and takes the moments anew.
"""

from __future__ import annotations

import math

from numba import njit

from boresight.kernels.options import LEAF
from boresight.kernels.tracker import Look, Models, SensorTable, Settings, Tracks
from boresight.kernels.tracker_state import condition
from boresight.kernels.tracker_workroom import Workroom

LEAST_MODE = 1e-12  # probability that a model keeps whatever a look says, so that it is not lost for good


@njit(**LEAF)
def switching(models: Models, dt: float) -> tuple[float, float]:
    """Return the probabilities that a manoeuvre has begun, and ended, `dt` (s) later."""
    rate = 1.0 / models.every + 1.0 / models.lasts
    settle = 1.0 - math.exp(-dt * rate)
    return settle / (models.every * rate), settle / (models.lasts * rate)


@njit(**LEAF)
def expected_noise(tr: Tracks, i: int, s: Settings, models: Models, dt: float) -> float:
    """Process noise (m²/s³) with which the moments of both models move over `dt` (s).

    Both models share their transition matrix, and mixing leaves the moments as they are: x and P follow exactly.
    """
    begins, ends = switching(models, dt)
    manoeuvre = tr.mode[i, 1] * (1.0 - ends) + tr.mode[i, 0] * begins
    return float((1.0 - manoeuvre) * s.q + manoeuvre * models.q)


@njit(**LEAF)
def begin_models(tr: Tracks, i: int, models: Models) -> None:
    """Give both models of a new track its state, and the probabilities of a target of which nothing else is known."""
    tr.mode[i, 1] = models.lasts / (models.every + models.lasts)
    tr.mode[i, 0] = 1.0 - tr.mode[i, 1]
    for j in range(2):
        for a in range(tr.x.shape[1]):
            tr.mode_x[i, j, a] = tr.x[i, a]
            for b in range(tr.x.shape[1]):
                tr.mode_P[i, j, a, b] = tr.P[i, a, b]


@njit(**LEAF)
def mix_models(tr: Tracks, i: int, s: Settings, models: Models, dt: float) -> float:
    """Let the models of track `i` change into each other over `dt` (s); returns `expected_noise`.

    Each model's state becomes mean and covariance over what it may have been before.
    """
    begins, ends = switching(models, dt)
    w, x, P = tr.mode[i], tr.mode_x[i], tr.mode_P[i]
    q = expected_noise(tr, i, s, models, dt)
    quiet, manoeuvre = w[0] * (1.0 - begins) + w[1] * ends, w[1] * (1.0 - ends) + w[0] * begins
    other0, other1 = w[1] * ends / quiet, w[0] * begins / manoeuvre  # share of the other one in each
    w[0], w[1] = quiet, manoeuvre
    n = tr.x.shape[1]
    for a in range(n):
        for b in range(n):
            apart = (x[0, a] - x[1, a]) * (x[0, b] - x[1, b])
            P0, P1 = P[0, a, b], P[1, a, b]
            P[0, a, b] = (1.0 - other0) * P0 + other0 * (P1 + (1.0 - other0) * apart)
            P[1, a, b] = (1.0 - other1) * P1 + other1 * (P0 + (1.0 - other1) * apart)
    for a in range(n):
        x0, x1 = x[0, a], x[1, a]
        x[0, a] = (1.0 - other0) * x0 + other0 * x1
        x[1, a] = (1.0 - other1) * x1 + other1 * x0
    return float(q)


@njit(**LEAF)
def condition_models(
    tr: Tracks, i: int, s: Settings, k: int, look: Look, sensor: SensorTable, room: Workroom, considered: int
) -> None:
    """Condition both models of track `i` on detection `k`, weigh them by its likelihood, and take the moments."""
    log0 = condition(tr.mode_x[i, 0], tr.mode_P[i, 0], s.d, k, look, sensor, room, considered)
    log1 = condition(tr.mode_x[i, 1], tr.mode_P[i, 1], s.d, k, look, sensor, room, considered)
    tr.mode[i, 1] = manoeuvring(tr.mode[i, 1], log1 - log0)
    tr.mode[i, 0] = 1.0 - tr.mode[i, 1]
    combine_models(tr, i)


@njit(**LEAF)
def manoeuvring(before: float, log_ratio: float) -> float:
    """Return the probability of a manoeuvre after a look with log-likelihood ratio (manoeuvre over quiet)."""
    quiet = max((1.0 - before) * math.exp(min(-log_ratio, 0.0)), LEAST_MODE)
    manoeuvre = max(before * math.exp(min(log_ratio, 0.0)), LEAST_MODE)
    return manoeuvre / (quiet + manoeuvre)


@njit(**LEAF)
def combine_models(tr: Tracks, i: int) -> None:
    """Set x and P of track `i` to the moments of its models."""
    w, x, P = tr.mode[i], tr.mode_x[i], tr.mode_P[i]
    n = tr.x.shape[1]
    for a in range(n):
        tr.x[i, a] = w[0] * x[0, a] + w[1] * x[1, a]
        for b in range(n):
            apart = (x[0, a] - x[1, a]) * (x[0, b] - x[1, b])
            tr.P[i, a, b] = w[0] * P[0, a, b] + w[1] * P[1, a, b] + w[0] * w[1] * apart
