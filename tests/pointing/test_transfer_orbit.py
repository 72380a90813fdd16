"""A transfer orbit followed by five stations with biases in angles and range: near the bound, and honest about it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from boresight.frames.local import ecef_from_enu_rotation
from boresight.kernels.geodesy import ecef_from_geodetic
from boresight.kernels.guide import EARTH_RATE, MU, fly
from boresight.pointing.guide import GuideFilter, GuideSource, biased
from boresight.types import Site

DEG = math.pi / 180.0
PLACES = (
    (5.25, -52.8, 20.0), (-2.9, 40.2, 20.0), (-31.0, 116.2, 250.0), (40.4, -4.3, 800.0), (-17.7, 177.4, 5.0),
)  # fmt: skip
STATIONS = [Site(lat * DEG, east * DEG, h) for lat, east, h in PLACES]
SIGMA = (0.02 * DEG, 0.02 * DEG, 20.0)  # az, el, range
PRIOR = (0.08 * DEG, 0.08 * DEG, 50.0)
EVERY, SPAN, LOWEST = 20.0, 5400.0, 5.0 * DEG


def turned(t: float) -> np.ndarray:
    c, s = math.cos(EARTH_RATE * t), math.sin(EARTH_RATE * t)
    return np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])  # ECEF from inertial


def orbit(rng: np.random.Generator) -> np.ndarray:
    """Position and velocity half an hour after a perigee at 250 km of an orbit up to geostationary height."""
    a, e, i = 24.4e6, 0.728, 6.0 * DEG
    node, pericenter = rng.uniform(0.0, 2.0 * math.pi, 2)
    E = 1.55 + 0.1 * rng.standard_normal()
    x, y = a * (math.cos(E) - e), a * math.sqrt(1.0 - e * e) * math.sin(E)
    n = math.sqrt(MU / a**3) / (1.0 - e * math.cos(E))
    vx, vy = -a * n * math.sin(E), a * n * math.sqrt(1.0 - e * e) * math.cos(E)
    cw, sw, cn, sn, ci, si = (f(v) for v in (pericenter, node, i) for f in (math.cos, math.sin))
    turn = np.array(
        [
            [cn * cw - sn * sw * ci, -cn * sw - sn * cw * ci],
            [sn * cw + cn * sw * ci, -sn * sw + cn * cw * ci],
            [sw * si, cw * si],
        ]
    )
    return np.concatenate([turn @ [x, y], turn @ [vx, vy]])


class Geometry:
    """Stations in ECEF and what each measures of a target."""

    def __init__(self) -> None:
        self.at = [np.array(ecef_from_geodetic(s.latitude, s.longitude, s.height)) for s in STATIONS]
        self.axes = [ecef_from_enu_rotation(s) for s in STATIONS]

    def measure(self, k: int, ecef: np.ndarray) -> np.ndarray:
        e, n, u = self.axes[k].T @ (ecef - self.at[k])
        return np.array([math.atan2(e, n), math.atan2(u, math.hypot(e, n)), math.sqrt(e * e + n * n + u * u)])


GEOMETRY = Geometry()
Looks = list[tuple[float, int]]


def looks(x0: np.ndarray) -> tuple[Looks, dict[float, np.ndarray]]:
    """Which station looks when: each sees the target every 20 s while it stands above 5°."""
    out, states = [], {}
    x = x0.copy()
    t = 0.0
    for step in range(round(SPAN / (EVERY / 5))):
        k = step % 5
        states[t] = x.copy()
        if GEOMETRY.measure(k, turned(t) @ x[:3])[1] > LOWEST:
            out.append((t, k))
        fly(x, EVERY / 5)
        t += EVERY / 5
    states[t] = x.copy()
    return out, states


def transition(x0: np.ndarray, times: list[float]) -> dict[float, np.ndarray]:
    """The derivative (6, 6) of the orbit at each time by the state at first, numerically."""
    out = {t: np.empty((6, 6)) for t in times}
    for j in range(6):
        h = 100.0 if j < 3 else 0.1
        for sign in (1.0, -1.0):
            x = x0.copy()
            x[j] += sign * h
            now = 0.0
            for t in times:
                fly(x, t - now)
                now = t
                out[t][:, j] = x if sign > 0 else (out[t][:, j] - x) / (2.0 * h)
    return out


def bound(x0: np.ndarray, seen: Looks) -> np.ndarray:
    """The Cramér–Rao bound (3, 3) of the position at the end, the biases' priors known: information of all looks.

    Of an orbit without process noise.
    """
    end = max(t for t, _ in seen)
    times = sorted({t for t, _ in seen} | {0.0, end})
    F = transition(x0, times)
    J = np.zeros((21, 21))
    J[range(6, 21), range(6, 21)] = np.tile(np.array(PRIOR) ** -2.0, 5)
    x, now = x0.copy(), 0.0
    for t, k in seen:
        fly(x, t - now)
        now = t
        p = turned(t) @ x[:3]
        h = np.array([(GEOMETRY.measure(k, p + d) - GEOMETRY.measure(k, p - d)) / 200.0 for d in 100.0 * np.eye(3)]).T
        H = np.zeros((3, 21))
        H[:, :6] = h @ turned(t) @ F[t][:3]
        H[:, 6 + 3 * k : 9 + 3 * k] = np.eye(3)
        J += H.T @ np.diag(np.array(SIGMA) ** -2.0) @ H
    C = np.linalg.inv(J)[:6, :6]
    return (F[end] @ C @ F[end].T)[:3, :3]


NOISE = {"sigma_azimuth": SIGMA[0], "sigma_elevation": SIGMA[1], "sigma_range": SIGMA[2]}
DECLARED = {"bias_azimuth": PRIOR[0], "bias_elevation": PRIOR[1], "bias_range": PRIOR[2]}
Q = 1e-6


@pytest.mark.parametrize("told", [DECLARED, {"suspect": True}], ids=["declared", "undeclared"])
def test_five_biased_stations_on_a_transfer_orbit(told: dict[str, float]) -> None:
    """Twenty orbits with three stations or more: RMS error (of 60 numbers: ± 13 %) within 3 × the bound, claimed sigma
    within 0.7–1.5 of it; so it is where nobody has declared a bias. (Nothing done about it: 100 km.)"""
    rng = np.random.default_rng(17)
    f = GuideFilter(tuple(GuideSource(f"s{k}", **NOISE, **told) for k in range(5)), orbit=True, q=Q)
    error, claimed, least = [], [], []
    while len(error) < 20:
        x0 = orbit(rng)
        seen, states = looks(x0)
        if len({k for _, k in seen}) < 3:
            continue
        sign = rng.choice([-1, 1], (5, 3))
        bias = sign * np.column_stack([rng.uniform(0.05, 0.1, (5, 2)) * DEG, np.full(5, 50.0)])
        state = f.init()
        off, C = followed(f, state, seen, states, bias, rng)
        error.append(off @ off)
        claimed.append(np.trace(C))
        least.append(np.trace(bound(x0, seen)))
    rms, sigma, crb = (math.sqrt(np.mean(v)) for v in (error, claimed, least))
    assert rms < 3.0 * crb
    assert 0.7 < sigma / rms < 1.5


def followed(f: GuideFilter, state, seen: Looks, states: dict, bias: np.ndarray, rng: np.random.Generator):
    """The error (3,) of the position at the end of all looks, and its claimed covariance."""
    for t, k in seen:
        z = GEOMETRY.measure(k, turned(t) @ states[t][:3]) + SIGMA * rng.standard_normal(3) + bias[k]
        f.step(state, k, t, z, GEOMETRY.at[k], GEOMETRY.axes[k])
    end = max(t for t, _ in seen)
    out = f.predict(state, end)
    assert out is not None
    return out.position - turned(end) @ states[end][:3], out.covariance


def test_stations_without_a_bias_are_not_held_to_have_one() -> None:
    """Ten orbits: suspected or not, the same estimate; the hypothesis of none steers at the end."""
    plain, wary = (
        GuideFilter(tuple(GuideSource(f"s{k}", **NOISE, suspect=s) for k in range(5)), orbit=True, q=Q)
        for s in (False, True)
    )
    rng, n = np.random.default_rng(18), 0
    while n < 10:
        seen, states = looks(orbit(rng))
        if len({k for _, k in seen}) < 3:
            continue
        n += 1
        seed, none = int(rng.integers(1 << 30)), np.zeros((5, 3))
        a, b = plain.init(), wary.init()
        off, C = followed(plain, a, seen, states, none, np.random.default_rng(seed))
        other, _ = followed(wary, b, seen, states, none, np.random.default_rng(seed))
        np.testing.assert_allclose(other, off, atol=0.05 * math.sqrt(np.trace(C)))
        assert biased(wary.sources, b.clock) == ""
