"""Another tracker's track as a guide: its full covariance counts, and its errors are not taken for fresh ones."""

from __future__ import annotations

import math

import numpy as np
import pytest

from boresight.errors import UserError
from boresight.frames.local import ecef_from_enu, ecef_from_enu_rotation
from boresight.pointing.guide import THINNED, GuideFilter, GuideSource
from boresight.types import Site

SITE = Site(0.8, 0.15, 400.0)
R = ecef_from_enu_rotation(SITE)
T, STEPS, RUNS = 1.0, 60, 60


def ecef(enu: np.ndarray) -> np.ndarray:
    return np.array(ecef_from_enu(*(float(v) for v in enu), SITE))


def random_covariance(rng: np.random.Generator, n: int, scale: float) -> np.ndarray:
    A = rng.standard_normal((n, n))
    return scale**2 * (A @ A.T + 0.05 * np.eye(n))


def test_two_tracks_combine_as_their_information_adds() -> None:
    """At one time, from a nearly flat prior: P = (C1⁻¹ + C2⁻¹)⁻¹, x = P (C1⁻¹ z1 + C2⁻¹ z2), full covariances."""
    rng = np.random.default_rng(1)
    sources = (GuideSource("a", correlation=0.0), GuideSource("b", correlation=0.0))
    f = GuideFilter(sources, orbit=False, q=1e-9, spread=(1e5, 300.0, 5.0))
    state = f.init()
    C = [random_covariance(rng, 3, 30.0) for _ in sources]
    at = ecef(np.array([5000.0, 3000.0, 1000.0]))
    z = [at + 30.0 * rng.standard_normal(3) for _ in sources]
    for i in range(2):
        assert f.step(state, i, 0.0, z[i], axes=sources[i].axes_of(C[i])) == 0
    out = f.predict(state, 0.0)
    P = np.linalg.inv(np.linalg.inv(C[0]) + np.linalg.inv(C[1]))
    assert out is not None
    np.testing.assert_allclose(out.covariance, P, rtol=1e-5, atol=1e-5)
    expected = P @ (np.linalg.solve(C[0], z[0]) + np.linalg.solve(C[1], z[1]))
    np.testing.assert_allclose(out.position, expected, atol=1e-3)


def test_a_late_track_with_velocity_is_an_ordinary_kalman_update() -> None:
    """Against a dense filter in the inertial frame, position and velocity correlated, one second late."""
    rng = np.random.default_rng(2)
    source = GuideSource("a", correlation=0.0)
    f = GuideFilter((source,), orbit=False, q=1e-12, gate=1e9, spread=(1e3, 300.0, 5.0))
    state, at = f.init(), ecef(np.array([5000.0, 3000.0, 1000.0]))
    C = random_covariance(rng, 6, 20.0)
    v = R @ np.array([100.0, -40.0, 5.0])
    f.step(state, 0, 0.0, np.concatenate([at, v]), axes=source.axes_of(C))
    f.step(state, 0, 2.0, np.concatenate([at + 2.0 * v, v]), axes=source.axes_of(C))
    x, P = state.X[0, :9].copy(), state.P[0, :9, :9].copy()
    f.step(state, 0, 1.0, np.concatenate([at + v + 5.0, v + 1.0]), axes=source.axes_of(C))
    w = 7.2921150e-5
    c, s = math.cos(w), math.sin(w)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    p = turn @ (at + v + 5.0)
    z = np.concatenate([p, turn @ (v + 1.0) + w * np.array([-p[1], p[0], 0.0])])
    H = np.eye(9)[:6] + 0.0
    back = np.eye(9)
    back[:3, 3:6], back[3:6, 6:], back[:3, 6:] = -np.eye(3), -np.eye(3), 0.5 * np.eye(3)
    H = H @ back
    both = np.kron(np.eye(2), turn)
    S = H @ P @ H.T + both @ C @ both.T
    K = P @ H.T @ np.linalg.inv(S)
    np.testing.assert_allclose(state.X[0, :9], x + K @ (z - H @ x), rtol=0, atol=1e-3)
    np.testing.assert_allclose(state.P[0, :9, :9], P - K @ S @ K.T, rtol=1e-6, atol=1e-6)


def nees_of_gauss_markov(correlation: float, declared: float) -> np.ndarray:
    """NEES (runs, steps) of positions of a still target whose error resembles itself over `correlation` (s)."""
    rng = np.random.default_rng(3)
    source = GuideSource("a", correlation=declared)
    C = np.diag([40.0, 10.0, 20.0]) ** 2 + 150.0 * np.array([[0, 1, 0], [1, 0, 0], [0, 0, 0]])
    root, axes = R @ np.linalg.cholesky(C), source.axes_of(R @ C @ R.T)
    f = GuideFilter((source,), orbit=False, q=1e-7, spread=(300.0, 0.5, 0.01))
    at = ecef(np.array([2000.0, 1000.0, 500.0]))
    rho = math.exp(-T / correlation)
    out = np.empty((RUNS, STEPS))
    for run in range(RUNS):
        state, e = f.init(), rng.standard_normal(3)
        for k in range(STEPS):
            f.step(state, 0, k * T, at + root @ e, axes=axes)
            e = rho * e + math.sqrt(1.0 - rho * rho) * rng.standard_normal(3)
            p = f.predict(state, k * T)
            assert p is not None
            off = p.position - at
            out[run, k] = off @ np.linalg.solve(p.covariance, off)
    return out


def test_correlated_errors_are_not_counted_as_fresh_ones() -> None:
    """Three degrees of freedom: the mean over runs stays below 3 + 4·√(6/60) = 4.3; taken at face value it does not."""
    late = slice(20, None)
    treated = nees_of_gauss_markov(8.0, 8.0)[:, late].mean(axis=0)
    assert treated.max() < 3.0 + 4.0 * math.sqrt(6.0 / RUNS)
    assert treated.mean() < 3.0
    assert treated.mean() > 0.5  # careful, not useless
    assert nees_of_gauss_markov(8.0, 0.0)[:, late].mean() > 6.0


def real_tracks(rng: np.random.Generator, q: float, sigma: float) -> tuple[np.ndarray, list[np.ndarray], np.ndarray]:
    """A real tracker (Kalman, white acceleration) on 3-D positions: its estimates, covariances, and the truth."""
    F = np.kron(np.array([[1.0, T], [0.0, 1.0]]), np.eye(3))
    Q = q * np.kron(np.array([[T**3 / 3, T**2 / 2], [T**2 / 2, T]]), np.eye(3))
    root = np.linalg.cholesky(Q)
    H = np.eye(3, 6)
    truth = np.array([4000.0, 2000.0, 1500.0, 60.0, -30.0, 2.0])
    x, P = (
        truth + np.r_[sigma * rng.standard_normal(3), 10.0 * rng.standard_normal(3)],
        np.diag([sigma**2] * 3 + [100.0] * 3),
    )
    found, covariances, true = [], [], []
    for _ in range(STEPS):
        truth = F @ truth + root @ rng.standard_normal(6)
        x, P = F @ x, F @ P @ F.T + Q
        K = P @ H.T @ np.linalg.inv(P[:3, :3] + sigma**2 * np.eye(3))
        x = x + K @ (truth[:3] + sigma * rng.standard_normal(3) - x[:3])
        P = (np.eye(6) - K @ H) @ P
        found.append(x[:3].copy())
        covariances.append(P[:3, :3].copy())
        true.append(truth[:3].copy())
    return np.array(found), covariances, np.array(true)


@pytest.mark.parametrize(("declared", "low", "high"), [(6.0, 0.5, 3.0), (0.0, 5.0, 1e3)])
def test_a_real_trackers_tracks_beside_another_source(declared: float, low: float, high: float) -> None:
    """Mean NEES (3) over runs and steps. Errors of a tracker of gain 0.3 at 1 Hz die out in about 6 s."""
    rng = np.random.default_rng(4)
    track, other = GuideSource("t", correlation=declared), GuideSource("gps", sigma_position=40.0)
    f = GuideFilter((track, other), orbit=False, q=0.02, spread=(1e3, 100.0, 2.0))
    nees = []
    for _ in range(40):
        found, covariances, true = real_tracks(rng, 0.05, 30.0)
        state = f.init()
        for k in range(STEPS):
            f.step(state, 0, k * T, ecef(found[k]), axes=track.axes_of(R @ covariances[k] @ R.T))
            if k % 3 == 0:
                f.step(state, 1, k * T, ecef(true[k]) + 40.0 * rng.standard_normal(3))
            p = f.predict(state, k * T)
            assert p is not None
            off = p.position - ecef(true[k])
            if k >= 20:
                nees.append(off @ np.linalg.solve(p.covariance, off))
    assert low < np.mean(nees) < high


def test_thinned_reports_keep_the_source_fresh_and_snapshots_apart() -> None:
    source = GuideSource("a", correlation=4.0)
    f = GuideFilter((source,), orbit=False, q=0.1, spread=(1e3, 300.0, 5.0))
    state, at = f.init(), ecef(np.array([2000.0, 1000.0, 500.0]))
    fates = [f.step(state, 0, 0.5 * k, at, axes=source.axes_of(100.0 * np.eye(3))) for k in range(17)]
    assert [k for k, fate in enumerate(fates) if fate == 0] == [0, 8, 16]
    assert set(fates) == {0, THINNED}


def test_what_a_track_cannot_be() -> None:
    with pytest.raises(UserError, match="leave its sigma out"):
        GuideSource("a", sigma_position=3.0, correlation=1.0)
    with pytest.raises(UserError, match="must not be negative"):
        GuideSource("a", correlation=-1.0)
    with pytest.raises(np.linalg.LinAlgError):
        GuideSource("a", correlation=1.0).axes_of(np.diag([1.0, -1.0, 1.0]))
