"""phased_array repaired, and the filter: the ways of steering the beam that `boresight paper phased_array` compares."""

from __future__ import annotations

import numpy as np

from boresight.align.smooth import polynomial_weights
from boresight.frames.local import ecef_from_enu_rotation
from boresight.frames.tangent import separation, unit
from boresight.fuse.weights import inverse_variance, three_cornered_hat
from boresight.kernels.guide import DIRECTION, EARTH_RATE
from boresight.papers.phased_array.printed import as_printed, own_tracking
from boresight.papers.phased_array.scenario import (
    KINDS,
    LEAD,
    SIGMA_ANGLE,
    SIGMA_POSITION,
    SIGMA_RANGE,
    STATION,
    Pass,
    Source,
)  # fmt: skip
from boresight.pointing.guide import GuideFilter, GuideSource, Reports, merged
from boresight.screen.prediction import PredictionScreen, Screened, Verdict
from boresight.types import FloatArray

GUIDES = (
    GuideSource("topocentric", sigma_angle=SIGMA_ANGLE[0], sigma_range=SIGMA_RANGE, sigma_bias=1e3),
    GuideSource("geodetic", sigma_position=SIGMA_POSITION, sigma_bias=20e3),
    GuideSource("own", sigma_angle=SIGMA_ANGLE[2]),
)
FILTER = GuideFilter(GUIDES)
SPAN = 20.0  # s of good reports that the quadratic of `repaired` sees
MEMORY = 40  # nodes over which sources are compared with each other
LEFT_OUT = 6.0  # σ beyond which a report leaves the fit again
LOST = 6.0  # s without a report after which a source has no say


def beams(p: Pass) -> dict[str, FloatArray]:
    """Return each mode's beam (k, 3), where it really points one second after each node: unit, station ENU."""
    enu = {"repaired": repaired(p), "filter": filtered(p), "self": own_tracking(p)}
    face = {"as_printed": as_printed(p), "fixed": as_printed(p, fixed=True)}
    face |= {name: np.einsum("nji,nj->ni", p.face_measured, d) for name, d in enu.items()}
    order = ("as_printed", "fixed", "repaired", "filter", "self")
    return {name: np.einsum("nij,nj->ni", p.face, face[name]) for name in order}


def reports_of(p: Pass) -> Reports:
    """Return all sources' reports as the filter takes them."""
    return merged(tuple(Reports(np.full(len(s.t), i), *s) for i, s in enumerate(p.sources)))


def filtered(p: Pass) -> FloatArray:
    """Return the filter's direction (k, 3): every report at its own time (`pointing.guide`)."""
    out = FILTER.run(reports_of(p), p.node, p.node + LEAD)
    return _directions(out.position - p.array)


def repaired(p: Pass) -> FloatArray:
    """Return the paper's chain, repaired (k, 3): no Kalman filter.

    Each source's reports are screened at their own times, as positions (or directions) in a frame that does not turn;
    a quadratic over the last good ones, fitted at their own times, is the alignment, the smoothing and the predictor
    in one; sources are weighted by their mean square distance from each other (three-cornered hat).
    """
    tracks = [_Line(s, i) for i, s in enumerate(p.sources)]
    R = ecef_from_enu_rotation(STATION)
    k = len(p.node)
    ahead = np.full((3, k, 3), np.nan)
    declared = np.full((3, k), np.nan)
    out = np.full((k, 3), np.nan)
    square: list[FloatArray] = []
    for n in range(k):
        for i, track in enumerate(tracks):
            track.take(p.node[n])
            value = track.ahead(p.node[n] + LEAD)
            if value is None:
                continue
            at, gain = value
            to_target = at if i == 2 else _earth(at, p.node[n] + LEAD) - p.array[n]
            length = float(np.linalg.norm(to_target))
            ahead[i, n] = (to_target / length) if i == 2 else (R.T @ to_target) / length
            declared[i, n] = (gain * (SIGMA_POSITION / length if i == 1 else SIGMA_ANGLE[i])) ** 2
        there = np.flatnonzero(np.isfinite(declared[:, n]))
        if not len(there):
            continue
        if len(there) == 3:
            square.append(_square(ahead[:, n]))
        variance = declared[there, n]
        if len(square) >= 5:
            typical = np.median(square[-MEMORY:], axis=0)  # one bad stretch is not to speak for all
            variance = three_cornered_hat(typical, declared_floor(declared[:, n]))[there]
        out[n] = unit(inverse_variance(variance) @ ahead[there, n])
    return out


def declared_floor(declared: FloatArray) -> FloatArray:
    """Return the declared variances (3,), with something for a source that is missing."""
    return np.where(np.isfinite(declared), declared, 1e-8)


class _Line:
    """One source of `repaired`: what has arrived, what the screen kept."""

    def __init__(self, source: Source, which: int) -> None:
        self.source, self.which, self.row = source, which, 0
        self.screen = PredictionScreen()
        self.state: Screened = self.screen.init()
        self.t: list[float] = []
        self.y: list[FloatArray] = []
        self.order = np.argsort(source.t_recv, kind="stable")
        self.values, self.sigma = _still(source, which)

    def take(self, now: float) -> None:
        s = self.source
        while self.row < len(s.t) and s.t_recv[self.order[self.row]] <= now:
            i = self.order[self.row]
            self.row += 1
            self.state, verdict = self.screen.step(self.state, float(s.t[i]), self.values[i], self.sigma[i])
            if verdict == Verdict.REOPENED:
                self.t, self.y = list(self.state.t), list(self.state.y)
            elif verdict in (Verdict.GOOD, Verdict.UNTESTED):
                self.t.append(float(s.t[i]))
                self.y.append(self.values[i])

    def ahead(self, at: float) -> tuple[FloatArray, float] | None:
        first = next((i for i, t in enumerate(self.t) if t > at - LEAD - SPAN), len(self.t))
        t, y = self.t[first:], self.y[first:]
        if len(t) < 4 or at - t[-1] > LOST:
            return None
        times, values = np.array(t), np.array(y)
        while True:  # what came in before the screen had a history to judge by
            rows = polynomial_weights(times, [*times, at], 2)
            off = np.abs(values - rows[:-1] @ values).max(axis=1)
            worst = int(np.argmax(off))
            if off[worst] <= LEFT_OUT * self.sigma[-1]:
                return rows[-1] @ values, float(np.sqrt(rows[-1] @ rows[-1]))
            if len(times) <= 5:
                return None
            times, values = np.delete(times, worst), np.delete(values, worst, axis=0)


def _still(s: Source, which: int) -> tuple[FloatArray, FloatArray]:
    """Return a source's reports (n, 3) in a frame that does not turn with the Earth or the array, and their sigma.

    Positions in the inertial frame for the guides; directions in the station's ENU for own tracking.
    """
    R = ecef_from_enu_rotation(STATION)
    if KINDS[which] != DIRECTION:
        return _inertial(s.z, s.t), np.full(len(s.t), SIGMA_POSITION)
    c = np.cos(s.z[:, 1])
    local = np.stack([c * np.sin(s.z[:, 0]), c * np.cos(s.z[:, 0]), np.sin(s.z[:, 1])], axis=-1)
    ecef = np.einsum("nij,nj->ni", s.axes, local)
    if which == 2:
        return ecef @ R, np.full(len(s.t), SIGMA_ANGLE[2])
    return _inertial(s.origin + s.z[:, 2:] * ecef, s.t), s.z[:, 2] * SIGMA_ANGLE[0]


def _inertial(ecef: FloatArray, t: FloatArray) -> FloatArray:
    c, s = np.cos(EARTH_RATE * t), np.sin(EARTH_RATE * t)
    return np.stack([c * ecef[:, 0] - s * ecef[:, 1], s * ecef[:, 0] + c * ecef[:, 1], ecef[:, 2]], axis=-1)


def _earth(inertial: FloatArray, t: float) -> FloatArray:
    c, s = np.cos(EARTH_RATE * t), np.sin(EARTH_RATE * t)
    return np.array([c * inertial[0] + s * inertial[1], c * inertial[1] - s * inertial[0], inertial[2]])


def _square(directions: FloatArray) -> FloatArray:
    out: FloatArray = separation(directions[:, None, :], directions[None, :, :]) ** 2
    return out


def _directions(to_target: FloatArray) -> FloatArray:
    """Return unit ENU directions (k, 3) of ECEF vectors, NaN kept."""
    enu = to_target @ ecef_from_enu_rotation(STATION)
    out: FloatArray = enu / np.linalg.norm(enu, axis=1, keepdims=True)
    return out
