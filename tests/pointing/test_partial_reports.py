"""Reports of any subset of azimuth, elevation and range, and sources with biases of their own."""

from __future__ import annotations

import numpy as np
import pytest

from boresight.errors import UserError
from boresight.frames.local import ecef_from_enu, ecef_from_enu_rotation
from boresight.kernels.guide_run import ACCEPTED, EMPTY, WAITING
from boresight.pointing.guide import GuideFilter, GuideSource, Reports
from boresight.types import Site

DEG = np.pi / 180
SITE = Site(47 * DEG, 8 * DEG, 400.0)
R = ecef_from_enu_rotation(SITE)
NO = np.nan
FLAT = (1e5, 300.0, 5.0)


def ecef(enu: np.ndarray) -> np.ndarray:
    return np.array(ecef_from_enu(*(float(v) for v in enu), SITE))


def azel(enu: np.ndarray) -> np.ndarray:
    e, n, u = enu
    return np.array([np.arctan2(e, n), np.arctan2(u, np.hypot(e, n)), np.linalg.norm(enu)])


def angle(a: float) -> float:
    return float((a + np.pi) % (2 * np.pi) - np.pi)


HERE = ecef(np.zeros(3))


@pytest.mark.parametrize("measured", [(0,), (1,), (2,), (0, 1), (0, 2), (1, 2), (0, 1, 2)])
def test_a_report_of_any_subset_is_an_ordinary_kalman_update(measured: tuple[int, ...]) -> None:
    """Against a dense update with a numerical Jacobian in the report's own angles; a target at 40° of elevation."""
    sigma = np.array([0.3 * DEG, 0.2 * DEG, 15.0])
    source = GuideSource("s", sigma_azimuth=sigma[0], sigma_elevation=sigma[1], sigma_range=sigma[2])
    f = GuideFilter((GuideSource("gps", sigma_position=30.0), source), orbit=False, q=1e-9, spread=FLAT)
    state, at = f.init(), np.array([-4000.0, 6000.0, 6000.0])
    assert f.step(state, 0, 0.0, ecef(at)) == ACCEPTED
    before = f.predict(state, 0.0)
    assert before is not None
    x, P = R.T @ (before.position - HERE), R.T @ before.covariance @ R
    z = azel(x) + np.array([0.2 * DEG, -0.15 * DEG, 12.0])
    rows = list(measured)
    report = np.where(np.isin(np.arange(3), rows), z, NO)
    H = np.array([[angle(a) for a in (azel(x + d) - azel(x - d))] for d in np.eye(3)]).T[rows] / 2.0
    H = H if 2 not in rows else np.array([(azel(x + d) - azel(x - d))[rows] for d in np.eye(3)]).T / 2.0
    S = H @ P @ H.T + np.diag(sigma[rows] ** 2)
    K = P @ H.T @ np.linalg.inv(S)
    assert f.surprise(state, 1, 0.0, report, HERE, R) == pytest.approx(
        (z - azel(x))[rows] @ np.linalg.solve(S, (z - azel(x))[rows]), rel=2e-2
    )
    assert f.step(state, 1, 0.0, report, HERE, R) == ACCEPTED
    after = f.predict(state, 0.0)
    assert after is not None
    moved = K @ (z - azel(x))[rows]
    np.testing.assert_allclose(R.T @ (after.position - before.position), moved, atol=0.02 * np.linalg.norm(moved))
    np.testing.assert_allclose(R.T @ after.covariance @ R, P - K @ S @ K.T, atol=0.01 * P[0, 0])


def test_nothing_measured_changes_nothing() -> None:
    f = GuideFilter((GuideSource("s", sigma_azimuth=1e-3),), orbit=False, spread=FLAT)
    state = f.init()
    assert f.step(state, 0, 0.0, np.array([0.3, 0.2, 5000.0]), HERE, R) == ACCEPTED
    kept = [a.copy() for a in state[:6]]
    assert f.step(state, 0, 0.0, np.array([NO, 0.2, 5000.0]), HERE, R) == EMPTY  # no sigma for these two
    assert np.isnan(f.surprise(state, 0, 0.0, np.full(3, NO), HERE, R))
    for a, b in zip(kept[1:], state[1:6], strict=True):
        np.testing.assert_array_equal(a, b)


def test_an_azimuth_at_the_zenith_says_little_and_breaks_nothing() -> None:
    f = GuideFilter(
        (GuideSource("gps", sigma_position=30.0), GuideSource("s", sigma_azimuth=1e-3)),
        orbit=False,
        q=1e-9,
        spread=FLAT,
    )
    for east in (0.0, 1e-3, 5.0):
        state = f.init()
        f.step(state, 0, 0.0, ecef(np.array([east, 0.0, 8000.0])))
        before = f.predict(state, 0.0)
        for _ in range(5):
            f.step(state, 1, 0.0, np.array([2.0, NO, NO]), HERE, R)
        after = f.predict(state, 0.0)
        assert before is not None
        assert after is not None
        assert np.linalg.norm(after.position - before.position) < 30.0
        assert np.sqrt(np.linalg.eigvalsh(after.covariance)).min() > 15.0


def sources(sigma: float = 1e-4) -> GuideFilter:
    both = GuideSource("both", sigma_angle=sigma, sigma_range=5.0)
    return GuideFilter(
        (both, GuideSource("angles", sigma_angle=sigma), GuideSource("range", sigma_range=5.0)),
        orbit=False, q=1e-3, spread=(1e3, 50.0, 1.0),
    )  # fmt: skip


def aside(at: np.ndarray) -> np.ndarray:
    """Where a second station stands, 6 km east."""
    return at - np.array([6000.0, 0.0, 0.0])


def test_range_and_angles_in_separate_reports_begin_and_guide() -> None:
    """One source that sends them apart; angles of one and the range of another; two directions that cross."""
    at = np.array([3000.0, 9000.0, 2500.0])
    a, b, there = azel(at), azel(aside(at)), ecef(np.array([6000.0, 0.0, 0.0]))
    apart = [(0, np.array([a[0], a[1], NO]), HERE), (0, np.array([NO, NO, a[2]]), HERE)]
    ways = {
        "one source": apart,
        "range first": apart[::-1],
        "angle by angle": [(0, np.array([a[0], NO, NO]), HERE), (0, np.array([NO, a[1], NO]), HERE), apart[1]],
        "two sources": [(1, np.array([a[0], a[1], NO]), HERE), (2, np.array([NO, NO, b[2]]), there)],
        "crossing": [(0, np.array([a[0], a[1], NO]), HERE), (1, np.array([b[0], b[1], NO]), there)],
    }
    for name, reports in ways.items():
        f, fates = sources(), []
        state = f.init()
        for k in range(20):
            for source, z, origin in reports:
                fates.append(f.step(state, source, 0.1 * k, z, origin, R))
        n = len(reports)
        assert fates[: n - 1] == [WAITING] * (n - 1), name
        assert fates[n - 1 :] == [ACCEPTED] * (19 * n + 1), name
        out = f.predict(state, 2.0)
        assert out is not None
        assert np.linalg.norm(out.position - ecef(at)) < 1.0, name


def test_what_does_not_belong_together_does_not_begin() -> None:
    at = azel(np.array([3000.0, 9000.0, 2500.0]))
    f = sources()
    state = f.init()
    assert f.step(state, 0, 0.0, np.array([at[0], at[1], NO]), HERE, R) == WAITING
    assert f.step(state, 0, 6.0, np.array([NO, NO, at[2]]), HERE, R) == WAITING  # six seconds later
    beside = ecef(np.array([100.0, 0.0, 0.0]))
    assert f.step(state, 0, 6.1, np.array([at[0], at[1], NO]), HERE, R) == ACCEPTED
    state = f.init()
    assert f.step(state, 0, 0.0, np.array([at[0], at[1], NO]), HERE, R) == WAITING
    assert f.step(state, 1, 0.1, np.array([at[0], at[1], NO]), beside, R) == WAITING  # nearly the same line


def test_several_biases_at_once_are_estimated_with_an_honest_sigma() -> None:
    """Three stations, biases of azimuth, elevation, range and time drawn from their priors.

    NEES of the position (3 where right) and of each bias (1): means over 40 targets and biases, so that of 3 stays
    within 3 ± 4·√(6/40) = ±1.6; error over claimed sigma of 480 biases within 1 ± 4·√(1/960) = ±0.13, the four of a
    station being correlated: ±0.25.
    """
    rng = np.random.default_rng(7)
    sigma, prior = (0.02 * DEG, 0.02 * DEG, 10.0), (0.1 * DEG, 0.08 * DEG, 50.0, 0.05)
    noise = {"sigma_azimuth": sigma[0], "sigma_elevation": sigma[1], "sigma_range": sigma[2]}
    offs = {"bias_azimuth": prior[0], "bias_elevation": prior[1], "bias_range": prior[2], "bias_time": prior[3]}
    f = GuideFilter(
        tuple(GuideSource(f"s{i}", **noise, **offs) for i in range(3)), orbit=False, q=1e-4, spread=(1e3, 300.0, 0.5)
    )
    stand = np.array([[0.0, 0.0, 0.0], [15e3, 2e3, 0.0], [-3e3, 18e3, 100.0]])
    nees, ratios, claimed, wrong = [], [], [], []
    for _ in range(40):
        bias = rng.standard_normal((3, 4)) * prior
        p0, v = np.array([9e3, -6e3, 5e3]) + 2e3 * rng.standard_normal(3), np.array([-60.0, 140.0, 5.0])
        state = f.init()
        for k in range(200):
            i, t = k % 3, 0.2 * k
            z = azel(p0 + v * t - stand[i]) + sigma * rng.standard_normal(3) + bias[i, :3]
            f.step(state, i, t + bias[i, 3], z, ecef(stand[i]), R)
        t = 40.0
        out = f.predict(state, t)
        assert out is not None
        off = out.position - ecef(p0 + v * t)
        nees.append(off @ np.linalg.solve(out.covariance, off))
        claimed.append(np.trace(out.covariance))
        wrong.append(off @ off)
        mean, known = f.biases(state)
        ratios.append((mean - bias) / known)
    assert abs(np.mean(nees) - 3.0) < 1.6
    assert 0.7 < np.sqrt(np.mean(wrong) / np.mean(claimed)) < 1.4
    assert abs(np.sqrt(np.mean(np.square(ratios))) - 1.0) < 0.25


def test_declared_biases_that_are_not_there_cost_little() -> None:
    """A bias of 0.1° allowed and none there: an estimate within it, and a sigma that does not shrink below it."""
    rng = np.random.default_rng(8)
    f = GuideFilter(
        (GuideSource("s", sigma_angle=0.01 * DEG, sigma_range=10.0, bias_azimuth=0.1 * DEG, bias_elevation=0.1 * DEG),),
        orbit=False, q=1e-6, spread=(1e3, 300.0, 0.5),
    )  # fmt: skip
    state, at = f.init(), np.array([9e3, 6e3, 3e3])
    for k in range(300):
        f.step(state, 0, 0.1 * k, azel(at) + [1e-4, 1e-4, 10.0] * rng.standard_normal(3), HERE, R)
    out = f.predict(state, 30.0)
    assert out is not None
    assert np.linalg.norm(out.position - ecef(at)) < 30.0
    across = np.sqrt(np.trace(out.covariance))
    assert across > 0.09 * DEG * np.linalg.norm(at)


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"sigma_angle": 0.1, "sigma_azimuth": 0.1}, "not both"),
        ({"sigma_position": 1.0, "bias_range": 5.0}, "source of directions"),
        ({"sigma_azimuth": np.nan}, "no finite number"),
        ({"sigma_range": 1.0, "bias_time": -1.0}, "negative"),
    ],
)
def test_sources_that_cannot_be(given: dict[str, float], says: str) -> None:
    with pytest.raises(UserError, match=says):
        GuideSource("x", **given)


@pytest.mark.parametrize(
    ("source", "t", "z", "origin", "axes", "says"),
    [
        (3, 0.0, np.zeros(3), HERE, R, "there are 3"),
        (-1, 0.0, np.zeros(3), HERE, R, "from 0 on"),
        (0, np.nan, np.zeros(3), HERE, R, "time is nan"),
        (0, np.inf, np.zeros(3), HERE, R, "time is inf"),
        (0, 0.0, np.zeros(2), HERE, R, r"z has shape \(2,\)"),
        (0, 0.0, np.zeros(6), HERE, R, r"z has shape \(6,\)"),
        (0, 0.0, np.zeros((3, 1)), HERE, R, "z has shape"),
        (0, 0.0, np.zeros(3), np.zeros(1), R, "origin has shape"),
        (0, 0.0, np.zeros(3), HERE, np.eye(2), "axes has shape"),
        (0, 0.0, ["a", 1, 2], HERE, R, "z is no array of numbers"),
        (0, 0.0, None, HERE, R, "z"),
    ],
)
def test_misuse_is_one_clear_error(source: int, t: float, z, origin, axes, says: str) -> None:
    f = sources()
    state = f.init()
    assert f.step(state, 0, 0.0, [0.3, 0.2, 5000.0], HERE, R) == ACCEPTED  # lists are taken
    kept = [a.copy() for a in state]
    with pytest.raises(UserError, match=says):
        f.step(state, source, t, z, origin, axes)
    with pytest.raises(UserError, match=says):
        f.surprise(state, source, t, z, origin, axes)
    for a, b in zip(kept, state, strict=True):
        np.testing.assert_array_equal(a, b)
    with pytest.raises(UserError, match="another guide filter"):
        f.step(GuideFilter((GuideSource("x", sigma_range=1.0),)).init(), 0, 0.0, np.zeros(3), HERE, R)
    column = np.zeros(4)
    good = Reports(np.zeros(4, np.int64), column, column, np.zeros((4, 3)), np.zeros((4, 3)), np.zeros((4, 3, 3)))
    for bad in ({"source": np.full(4, 3)}, {"source": np.full(4, -1)}, {"z": np.zeros((4, 2))}, {"t": np.zeros(3)}):
        with pytest.raises(UserError, match="reports: "):
            f.run(good._replace(**bad), [0.0], [1.0])
    with pytest.raises(UserError, match="as many aims"):
        f.run(good, [0.0], [1.0, 2.0])


def test_stamps_of_another_age_end_nothing() -> None:
    """One of the year 2038, or one of an hour ago first: no hang, and the target is found again."""
    at = azel(np.array([3000.0, 9000.0, 2500.0]))
    f = sources()
    for wrong in (1e18, 2.1e9, 3600.0, 100.0):
        state = f.init()
        for k in range(10):
            f.step(state, 0, 0.1 * k, at, HERE, R)
        f.step(state, 0, wrong, at, HERE, R)
        for k in range(10, 40):
            f.step(state, 0, 0.1 * k, at, HERE, R)
        out = f.predict(state, 4.0)
        assert out is not None
        assert np.linalg.norm(out.position - ecef(np.array([3000.0, 9000.0, 2500.0]))) < 10.0
        for t in (np.nan, np.inf, -np.inf, 1e18, 2e5):
            assert f.predict(state, t) is None
