"""Height that nobody measures: a target on an arc of equal range, as several heights with a state each.

A range and an azimuth leave a target on an arc. One Gaussian cannot follow it: the range that is measured again and
again makes it narrow across its tangent, and the target is elsewhere on the arc. So a track begins with several heights
that share the arc (a Gaussian sum, as range-parametrised filters have it for bearings: Peach 1995), each so narrow that
the arc leaves its tangent by a share of the noise of the range. What follows weighs them: another sensor's range or
elevation, or how the range changes. Those that have become too wide are laid out anew along the arc, within what is
declared; those that have become alike are made one.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from boresight.kernels.options import LEAF, PART
from boresight.kernels.tracker import Look, Models, SensorTable, Settings, Tracks
from boresight.kernels.tracker_models import combine_models, give_up_heights
from boresight.kernels.tracker_place import height_to_up, heights, lacks_height
from boresight.kernels.tracker_state import components, innovation, linearise, log_determinant
from boresight.kernels.tracker_workroom import Workroom

SAG = 0.5  # by how much of the range's standard deviation the arc leaves the tangent of a height, one σ from its middle
TOO_WIDE = 1.6  # times that is laid out anew
ALIKE = 0.1  # variance between heights, as a share of that within them, below which they are one
CELL = math.sqrt(12.0)  # spacing of heights over the standard deviation of each
LEAST_MASS = 1e-6
MUCH_INSIDE = 0.5  # share of a height that must lie where a target may be, for it to stay as it is
LOG_2PI = math.log(2.0 * math.pi)


@njit(**LEAF)
def narrow(look: Look, k: int) -> float:
    """Return the standard deviation (rad) in elevation over which the arc of detection `k` is straight enough."""
    return math.sqrt(2.0 * SAG * math.sqrt(max(look.R[k, 0, 0], 1e-12)) / max(look.z[k, 0], 1e-9))


@njit(**LEAF)
def lift(look: Look, k: int, up: float) -> float:
    """Elevation (rad) above the sensor's horizon at which the range of detection `k` reaches `up` (m, world)."""
    return math.asin(max(-1.0, min(1.0, (up - look.sensor_position[k, 2]) / max(look.z[k, 0], 1e-9))))


@njit(**LEAF)
def how_many(span: float, width: float, most: int) -> int:
    """Return how many heights of standard deviation `width` (rad) share `span` (rad)."""
    return max(1, min(most, math.ceil(span / (CELL * width))))


@njit(**LEAF)
def prior_weight(look: Look, k: int, s: Settings, sensor: SensorTable, up: float, variance: float) -> float:
    """Return the declared density of a height (m up), as far as it says more than a belief of `variance` (m²) has."""
    declared = sensor.height_sigma**2
    if declared <= 0.0 or variance <= declared:
        return 1.0
    off = up - height_to_up(look, k, s, sensor.height)
    return math.exp(-0.5 * off * off * (1.0 / declared - 1.0 / variance))


@njit(**LEAF)
def active_heights(tr: Tracks, i: int, models: Models) -> int:
    """Return how many heights of track `i` are in use."""
    count = 0
    for h in range(models.heights):
        if tr.mode[i, h * models.motions] > 0.0:
            count += 1
    return count


@njit(**LEAF)
def fit(
    tr: Tracks, i: int, d: int, k: int, look: Look, sensor: SensorTable, lag: int, room: Workroom
) -> tuple[float, float, int]:
    """Hold all components of track `i` against detection `k`.

    Returns the NIS of the one that fits best, the log-likelihood of all (but for the components' count), the count.
    """
    best, nis_of_best, m = -math.inf, math.inf, 0
    for c in range(tr.mode.shape[1]):
        room.logs[c] = -math.inf
        if tr.mode[i, c] > 0.0:
            m = components(look.z[k], d, room.mask)
            linearise(tr.mode_x[i, c], d, k, look.dt[k], look, sensor, m, room)
            nis = innovation(tr.mode_P[i, c], look.z[k], look.R[k], m, room, d, lag)
            room.logs[c] = math.log(tr.mode[i, c]) - 0.5 * (nis + log_determinant(m, room))
            if room.logs[c] > best:
                best, nis_of_best = room.logs[c], nis
    total = 0.0
    for c in range(tr.mode.shape[1]):
        if tr.mode[i, c] > 0.0:
            total += math.exp(room.logs[c] - best)
    return nis_of_best, best + math.log(total), m


@njit(**PART)
def settle_heights(tr: Tracks, i: int, s: Settings, sensor: SensorTable, look: Look, k: int, models: Models) -> None:
    """After detection `k` of track `i`: make alike heights one, and lay too wide ones out anew along an arc."""
    if active_heights(tr, i, models) > 1:
        between, within = 0.0, 0.0
        for c in range(tr.mode.shape[1]):
            if tr.mode[i, c] > 0.0:
                between += tr.mode[i, c] * (tr.mode_x[i, c, 2] - tr.x[i, 2]) ** 2
                within += tr.mode[i, c] * tr.mode_P[i, c, 2, 2]
        if between < ALIKE * within:
            make_one(tr, i, models)
    if lacks_height(look.z[k], s):
        lay_out(tr, i, s, sensor, look, k, models)
        keep_within(tr, i, s, sensor, look, k, models)


@njit(**PART)
def make_one(tr: Tracks, i: int, models: Models) -> None:
    """Replace the heights of track `i` by one, for each model of motion by its mean and covariance."""
    n = tr.x.shape[1]
    x, P = np.zeros(n), np.zeros((n, n))
    for j in range(models.motions):
        total = 0.0
        for a in range(n):
            x[a] = 0.0
        for c in range(j, tr.mode.shape[1], models.motions):
            total += tr.mode[i, c]
        for c in range(j, tr.mode.shape[1], models.motions):
            for a in range(n):
                x[a] += tr.mode[i, c] / total * (tr.mode_x[i, c, a] if tr.mode[i, c] > 0.0 else 0.0)
        for a in range(n):
            for b in range(n):
                P[a, b] = 0.0
        for c in range(j, tr.mode.shape[1], models.motions):
            if tr.mode[i, c] > 0.0:
                y = tr.mode_x[i, c]
                for a in range(n):
                    for b in range(n):
                        P[a, b] += tr.mode[i, c] / total * (tr.mode_P[i, c, a, b] + (y[a] - x[a]) * (y[b] - x[b]))
            tr.mode[i, c] = 0.0
        tr.mode[i, j] = total
        for a in range(n):
            tr.mode_x[i, j, a] = x[a]
            for b in range(n):
                tr.mode_P[i, j, a, b] = P[a, b]


@njit(**LEAF)
def inside(low: float, high: float, mean: float, sigma: float) -> float:
    """Return the probability of a Gaussian between two numbers."""
    root = 1.0 / (sigma * math.sqrt(2.0))
    return 0.5 * (math.erf((high - mean) * root) - math.erf((low - mean) * root))


@njit(**LEAF)
def density(u: float) -> float:
    """Return the standard normal density."""
    return math.exp(-0.5 * u * u) / math.sqrt(2.0 * math.pi)


@njit(**LEAF)
def keep_within(tr: Tracks, i: int, s: Settings, sensor: SensorTable, look: Look, k: int, models: Models) -> None:
    """Take from the heights of track `i` what has come to lie where no target of detection `k` may be.

    Where that is much of one, its height becomes mean and variance of the Gaussian cut off there, and the rest of its
    state follows by regression.
    """
    low, high = heights(look, k, s, sensor)
    changed = False
    for c in range(tr.mode.shape[1]):
        variance = tr.mode_P[i, c, 2, 2]
        if tr.mode[i, c] <= 0.0 or variance <= 0.0:
            continue
        sigma, height = math.sqrt(variance), tr.mode_x[i, c, 2]
        mass = inside(low, high, height, sigma)
        if mass > MUCH_INSIDE:
            continue
        changed = True
        a, b = (low - height) / sigma, (high - height) / sigma
        if mass > 1e-6:
            shift = (density(a) - density(b)) / mass
            cut = 1.0 + (a * density(a) - b * density(b)) / mass - shift * shift
        else:  # all of it beyond: to the edge
            shift, cut = (a if a > 0.0 else b), 0.1
        cut = min(max(cut, 0.01), 1.0)
        tr.mode[i, c] *= max(mass, LEAST_MASS)
        n = tr.x.shape[1]
        for p in range(n):
            room_p = tr.mode_P[i, c, p, 2] / sigma
            tr.mode_x[i, c, p] += room_p * shift
        for p in range(n):
            if p != 2:
                for q in range(p + 1):
                    if q != 2:
                        taken = tr.mode_P[i, c, p, 2] * tr.mode_P[i, c, q, 2] / variance * (1.0 - cut)
                        tr.mode_P[i, c, p, q] -= taken
                        tr.mode_P[i, c, q, p] = tr.mode_P[i, c, p, q]
        for p in range(n):
            tr.mode_P[i, c, p, 2] *= cut
            tr.mode_P[i, c, 2, p] = tr.mode_P[i, c, p, 2]
    if changed:
        give_up_heights(tr, i, models)
        combine_models(tr, i)


@njit(**PART)
def lay_out(tr: Tracks, i: int, s: Settings, sensor: SensorTable, look: Look, k: int, models: Models) -> None:
    """Share the arc of detection `k` anew among the heights of track `i`, where one of them has become too wide for it.

    Each new one is the mean and covariance of what the old ones say of its part of the arc; what lies beyond the
    heights at which a target may be is given up.
    """
    n, J, H = tr.x.shape[1], models.motions, models.heights
    own = look.sensor_position[k, 2]
    low, high = heights(look, k, s, sensor)
    spread = math.sqrt(tr.P[i, 2, 2])
    low, high = max(low, tr.x[i, 2] - 3.0 * spread), min(high, tr.x[i, 2] + 3.0 * spread)
    if not low < high:
        return
    begin, span = lift(look, k, low), lift(look, k, high) - lift(look, k, low)
    width = max(narrow(look, k), span / (H * CELL))
    widest = 0.0
    for c in range(tr.mode.shape[1]):
        if tr.mode[i, c] > 0.0:
            x = tr.mode_x[i, c]
            level = math.hypot(x[0] - look.sensor_position[k, 0], x[1] - look.sensor_position[k, 1])
            widest = max(widest, math.sqrt(tr.mode_P[i, c, 2, 2]) / max(level, 1e-3))
    count = how_many(span, width, H)
    if widest <= TOO_WIDE * width or count == 1:
        return
    w, mean, P = np.zeros((H, J)), np.zeros((H, J, n)), np.zeros((H, J, n, n))
    off = np.zeros(n)
    for h in range(count):
        bottom = own + look.z[k, 0] * math.sin(begin + span * h / count)
        top = own + look.z[k, 0] * math.sin(begin + span * (h + 1) / count)
        middle, cell = 0.5 * (top + bottom), (top - bottom) ** 2 / 12.0
        prior = prior_weight(look, k, s, sensor, middle, tr.P[i, 2, 2])
        for c in range(H * J):
            variance = tr.mode_P[i, c, 2, 2]
            if tr.mode[i, c] <= 0.0 or variance <= 0.0:
                continue
            mass = tr.mode[i, c] * prior * inside(bottom, top, tr.mode_x[i, c, 2], math.sqrt(variance))
            if mass < LEAST_MASS:
                continue
            j = c % J
            gain = (middle - tr.mode_x[i, c, 2]) / variance
            keep = (1.0 - min(cell / variance, 1.0)) / variance
            for a in range(n):
                off[a] = tr.mode_x[i, c, a] + tr.mode_P[i, c, a, 2] * gain - tr.x[i, a]
            w[h, j] += mass
            for a in range(n):
                mean[h, j, a] += mass * off[a]
                for b in range(n):
                    rest = tr.mode_P[i, c, a, b] - tr.mode_P[i, c, a, 2] * tr.mode_P[i, c, b, 2] * keep
                    P[h, j, a, b] += mass * (rest + off[a] * off[b])
    total = w.sum()
    if total < 1e-3:  # nearly all lies where no target may be: the arc says nothing of this track
        return
    for h in range(H):
        for j in range(J):
            c = h * J + j
            tr.mode[i, c] = w[h, j]
            if w[h, j] > 0.0:
                for a in range(n):
                    for b in range(n):
                        both = mean[h, j, a] / w[h, j] * mean[h, j, b] / w[h, j]
                        tr.mode_P[i, c, a, b] = P[h, j, a, b] / w[h, j] - both
                for a in range(n):
                    tr.mode_x[i, c, a] = tr.x[i, a] + mean[h, j, a] / w[h, j]
    give_up_heights(tr, i, models)
    combine_models(tr, i)
