"""The guide filter and the chain above it: who steers, what happens when all fall silent."""

from __future__ import annotations

import numpy as np
import pytest

from boresight.errors import UserError
from boresight.frames.local import ecef_from_enu, ecef_from_enu_rotation
from boresight.frames.tangent import separation
from boresight.kernels import guide
from boresight.pointing.guide import GuideFilter, GuideSource, snapshot
from boresight.pointing.pointer import Choice, Mode, Pointer
from boresight.types import Site

DEG = np.pi / 180
SITE = Site(47 * DEG, 8 * DEG, 400.0)
R = ecef_from_enu_rotation(SITE)
SOURCES = (
    GuideSource("radar", sigma_angle=0.2 * DEG, sigma_range=20.0, sigma_bias=500.0),
    GuideSource("gps", sigma_position=10.0, sigma_bias=1000.0),
    GuideSource("own", sigma_angle=0.1 * DEG),
)
FILTER = GuideFilter(SOURCES, orbit=False, q=0.1, spread=(1e3, 300.0, 5.0))
POINTER = Pointer(FILTER, SITE, (False, False, True), lead=0.5)


def enu(t: float) -> np.ndarray:
    return np.array([8000.0 - 150.0 * t, 3000.0 + 40.0 * t, 2000.0])


def ecef(t: float) -> np.ndarray:
    return np.array(ecef_from_enu(*(float(v) for v in enu(t)), SITE))


def angles(t: float, rng: np.random.Generator, sigma: float) -> np.ndarray:
    e, n, u = enu(t)
    s = sigma * rng.standard_normal(2)
    return np.array([np.arctan2(e, n) + s[0], np.arctan2(u, np.hypot(e, n)) + s[1], np.linalg.norm(enu(t))])


HERE = np.array(ecef_from_enu(0.0, 0.0, 0.0, SITE))


def feed(pointer: Pointer, state, times: np.ndarray, which: str, rng: np.random.Generator, bias: float = 0.0) -> None:
    for t in times.tolist():
        if "r" in which:
            pointer.take(state, 0, t, angles(t, rng, 0.2 * DEG), HERE, R)
        if "g" in which:
            pointer.take(state, 1, t, ecef(t) + 10.0 * rng.standard_normal(3) + bias * R[:, 0])
        if "o" in which:
            z = angles(t, rng, 0.1 * DEG)
            z[2] = np.nan
            pointer.take(state, 2, t, z, HERE, R)


def test_it_points_ahead_of_time() -> None:
    rng, state = np.random.default_rng(30), POINTER.init()
    assert POINTER.tick(state, 0.0)[1] is None
    feed(POINTER, state, np.arange(0.0, 20.0, 0.5), "rgo", rng)
    state, out = POINTER.tick(state, 20.0)
    assert out is not None
    assert out.t_aim == 20.5
    off = separation(out.aim.direction, enu(20.5))
    assert off < 4 * out.aim.sigma
    assert out.mode == Mode.FUSED
    assert out.aim.p_in_beam > 0.99


def test_silence_is_coasted_then_searched() -> None:
    rng, state = np.random.default_rng(31), POINTER.init()
    feed(POINTER, state, np.arange(0.0, 20.0, 0.5), "rgo", rng)
    modes, sigmas, offsets = [], [], []
    for t in np.arange(20.0, 80.0, 0.5):
        state, out = POINTER.tick(state, float(t))
        assert out is not None
        modes.append(out.mode)
        sigmas.append(out.aim.sigma)
        offsets.append(out.aim.direction)
    order = [m for i, m in enumerate(modes) if i == 0 or m != modes[i - 1]]
    assert order == [Mode.FUSED, Mode.COAST, Mode.SEARCH]
    assert np.isfinite(sigmas).all()
    assert sigmas[-1] > 10 * sigmas[0]
    feed(POINTER, state, np.arange(80.0, 82.0, 0.5), "g", rng)
    assert POINTER.tick(state, 82.0)[1].mode == Mode.FUSED  # type: ignore[union-attr]


def test_own_tracking_takes_over_with_hysteresis_and_by_hand() -> None:
    rng, state = np.random.default_rng(32), POINTER.init()
    feed(POINTER, state, np.arange(0.0, 10.0, 0.5), "go", rng)
    feed(POINTER, state, np.arange(10.0, 20.0, 0.5), "o", rng)
    state, out = POINTER.tick(state, 20.0)
    assert out.mode == Mode.OWN  # type: ignore[union-attr]
    feed(POINTER, state, np.array([20.0, 20.5]), "go", rng)
    state, out = POINTER.tick(state, 20.6)
    assert out.mode == Mode.OWN  # type: ignore[union-attr]  # back only after two seconds of guides
    feed(POINTER, state, np.arange(21.0, 23.0, 0.5), "go", rng)
    assert POINTER.tick(state, 23.0)[1].mode == Mode.FUSED  # type: ignore[union-attr]
    by_hand = Pointer(FILTER, SITE, (False, False, True), choice=Choice.OWN)
    assert by_hand.take(by_hand.init(), 1, 0.0, ecef(0.0)) == -1


def test_a_biased_source_is_found_and_reported() -> None:
    """The radar and own tracking hold the truth; gps is 800 m off."""
    rng, state = np.random.default_rng(33), POINTER.init()
    feed(POINTER, state, np.arange(0.0, 40.0, 0.5), "rgo", rng, bias=800.0)
    state, out = POINTER.tick(state, 40.0)
    best = int(state.guide.clock[3])
    assert best == 2  # hypothesis 1 + source 1
    m = state.guide.X.shape[1] - 3
    assert np.linalg.norm(state.guide.X[best, m:]) == pytest.approx(800.0, rel=0.1)
    assert separation(out.aim.direction, enu(40.5)) < 0.3 * DEG  # type: ignore[union-attr]


def test_stepping_a_snapshot_changes_nothing_else() -> None:
    rng, state = np.random.default_rng(34), FILTER.init()
    for t in range(5):
        FILTER.step(state, 1, float(t), ecef(t))
    kept = snapshot(state)
    FILTER.step(state, 1, 6.0, ecef(6.0))
    FILTER.step(kept, 1, 6.0, ecef(6.0))
    np.testing.assert_array_equal(state.X, kept.X)
    FILTER.step(state, 1, 7.0, ecef(7.0) + rng.standard_normal(3))
    assert not np.array_equal(state.X, kept.X)


def test_the_orbit_is_keplers() -> None:
    """Energy and angular momentum along the pole hold under J2; a quarter turn of a circle without it to 1 m."""
    r = 6928e3
    v = np.sqrt(guide.MU / r)
    x = np.array([r, 0.0, 0.0, 0.0, v * np.cos(1.0), v * np.sin(1.0)])
    before = np.cross(x[:3], x[3:])[2]
    guide.fly(x, 1500.0)
    assert np.cross(x[:3], x[3:])[2] == pytest.approx(before, rel=1e-9)
    guide.fly(x, -1500.0)
    np.testing.assert_allclose(x[:3], [r, 0.0, 0.0], atol=1e-2)


def test_the_transition_is_the_flows_derivative() -> None:
    x = np.array([6.9e6, 1e5, 2e5, 100.0, 5e3, 5.5e3, 0.0, 0.0, 0.0])
    w = np.zeros((guide.ROWS, guide.LEAST_WIDTH))
    guide.advance(x.copy(), guide.ORBIT, 2.0, w)
    F = w[guide.ROW_F : guide.ROW_F + 6, :6]
    for j in range(6):
        h = 10.0 if j < 3 else 0.1
        a, b = x[:6].copy(), x[:6].copy()
        a[j] += h
        b[j] -= h
        guide.fly(a, 2.0)
        guide.fly(b, 2.0)
        np.testing.assert_allclose(F[:, j], (a - b) / (2 * h), atol=2e-8 if j < 3 else 2e-7)


def test_sources_that_say_nothing_are_refused() -> None:
    with pytest.raises(UserError, match="either a sigma"):
        GuideSource("x")
    with pytest.raises(UserError, match="at least one"):
        GuideFilter(())


def test_weights_are_shares_of_information() -> None:
    """Radar at 8.4 km: 29 m across; own tracking 15 m; gps 10 m: shares by the inverse squares."""
    rng, state = np.random.default_rng(36), POINTER.init()
    feed(POINTER, state, np.arange(0.0, 5.0, 0.5), "rgo", rng)
    state, out = POINTER.tick(state, 5.0)
    assert out is not None
    state.guide.scale[:] = 1.0
    sigma = np.array([0.2 * DEG * out.aim.distance, 10.0, 0.1 * DEG * out.aim.distance])
    np.testing.assert_allclose(POINTER.weights(state, out), sigma**-2 / np.sum(sigma**-2), rtol=1e-9)
    late = out._replace(t=7.8)
    feed(POINTER, state, np.array([7.0]), "g", rng)
    state.guide.scale[:] = 1.0
    np.testing.assert_allclose(POINTER.weights(state, late), [0.0, 1.0, 0.0])


def test_no_report_however_wrong_ends_it() -> None:
    """A target at the antenna, at its sensor, at the Earth's centre, or anywhere: a command or none; then it heals."""
    rng, state = np.random.default_rng(37), POINTER.init()
    wild = [HERE, np.zeros(3), 1e12 * np.ones(3), -HERE, np.full(3, 1e-300)]
    for k in range(600):
        t = 0.1 * k
        where = wild[k % len(wild)] if k % 3 else ecef(t) * rng.uniform(0.5, 2.0)
        POINTER.take(state, 1, t, where)
        POINTER.take(
            state, 0, t, np.array([rng.uniform(-9, 9), rng.uniform(-1.6, 1.6), 10.0 ** rng.uniform(-3, 12)]), where, R
        )
        state, out = POINTER.tick(state, t)
        assert out is None or np.isfinite([out.aim.azimuth, out.aim.elevation, out.aim.sigma, out.aim.p_in_beam]).all()
    feed(POINTER, state, np.arange(60.0, 90.0, 0.25), "rgo", rng)
    state, out = POINTER.tick(state, 90.0)
    assert out is not None
    assert separation(out.aim.direction, enu(90.5)) < 1.0 * DEG


def mode_at(where: np.ndarray, horizon: tuple[tuple[float, float], ...] = (), own: bool = False) -> Mode:
    """The mode for a still target at a place (ENU m), reported by gps, maybe seen by own tracking too."""
    p = Pointer(FILTER, SITE, (False, False, True), lead=0.5, horizon=horizon)
    state = p.init()
    at = np.array(ecef_from_enu(*(float(v) for v in where), SITE))
    for t in np.arange(0.0, 5.0, 0.5).tolist():
        p.take(state, 1, t, at)
        if own:
            e, n, u = where
            p.take(state, 2, t, np.array([np.arctan2(e, n), np.arctan2(u, np.hypot(e, n)), np.nan]), HERE, R)
    out = p.tick(state, 5.0)[1]
    assert out is not None
    return out.mode


def test_below_the_horizon_is_a_mode_of_its_own() -> None:
    """The antenna is 400 m above the ellipsoid: the sea at 20 km (-1.2°) is before the horizon, at 200 km not."""

    def sea(far: float) -> np.ndarray:
        r = 6371e3
        return np.array([0.0, r * np.sin(far / r), r * (np.cos(far / r) - 1.0) - 400.0])

    assert mode_at(sea(20e3)) == Mode.FUSED
    assert mode_at(sea(60e3)) == Mode.FUSED
    assert mode_at(sea(200e3)) == Mode.BELOW_HORIZON
    assert mode_at(np.array([0.0, 2e6, -1e4])) == Mode.BELOW_HORIZON  # a satellite 0.3° below
    assert mode_at(np.array([0.0, 2e6, 1e4])) == Mode.FUSED
    wall = ((0.0, 30 * DEG), (90 * DEG, 30 * DEG), (91 * DEG, 0.0), (359 * DEG, 0.0))
    assert mode_at(np.array([0.0, 1e4, 5e3]), wall) == Mode.BELOW_HORIZON  # 26.6° in the north, behind 30° of wall
    assert mode_at(np.array([0.0, 1e4, 6e3]), wall) == Mode.FUSED  # 31°
    assert mode_at(np.array([-1e4, 0.0, 5e3]), wall) == Mode.FUSED  # in the west there is no wall
    assert mode_at(np.array([0.0, 1e4, 5e3]), wall, own=True) == Mode.FUSED  # the antenna itself sees it


def test_nobody_searches_below_the_horizon() -> None:
    """A target last seen when it went below: its uncertainty outgrows the beam, and still the beam waits."""
    p = Pointer(FILTER, SITE, (False, False, True), lead=0.5, horizon=((0.0, 45 * DEG),))
    state = p.init()
    feed(p, state, np.arange(0.0, 10.0, 0.5), "g", np.random.default_rng(39))
    modes = set()
    for t in np.arange(10.0, 80.0, 1.0):
        state, out = p.tick(state, float(t))
        assert out is not None
        modes.add(out.mode)
    assert modes == {Mode.BELOW_HORIZON}
    assert out.aim.p_in_beam < 0.5
