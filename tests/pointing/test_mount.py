"""The mount: never beyond a stop, never faster than it can, through the keyhole with the least error."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from boresight.errors import UserError
from boresight.frames.tangent import separation
from boresight.pointing.mount import Mount, MountState

DEG = np.pi / 180
MOUNT = Mount(
    azimuth=(-200 * DEG, 200 * DEG), elevation=(5 * DEG, 88 * DEG), azimuth_rate=6 * DEG, elevation_rate=4 * DEG
)
ANY = st.floats(allow_nan=True, allow_infinity=True)


@given(st.lists(st.tuples(ANY | st.floats(-10, 10), ANY | st.floats(-4, 4), st.floats(0, 5)), max_size=40))
def test_no_command_leaves_the_limits(targets: list[tuple[float, float, float]]) -> None:
    state = MountState(0.0, 10 * DEG)
    for azimuth, elevation, dt in targets:
        after = MOUNT.step(state, azimuth, elevation, dt)
        assert MOUNT.azimuth[0] <= after.azimuth <= MOUNT.azimuth[1]
        assert MOUNT.elevation[0] <= after.elevation <= MOUNT.elevation[1]
        assert abs(after.azimuth - state.azimuth) <= MOUNT.azimuth_rate * dt + 1e-12
        assert abs(after.elevation - state.elevation) <= MOUNT.elevation_rate * dt + 1e-12
        state = after


def test_it_winds_on_and_unwinds_at_the_stop() -> None:
    assert MOUNT.reach(-175 * DEG, 0.5, 170 * DEG).azimuth == pytest.approx(185 * DEG)
    assert MOUNT.reach(-150 * DEG, 0.5, 190 * DEG).azimuth == pytest.approx(-150 * DEG)  # 210° lies beyond the stop
    narrow = Mount(azimuth=(-90 * DEG, 90 * DEG))
    assert narrow.reach(170 * DEG, 0.5, 0.0).azimuth == pytest.approx(90 * DEG)


def zenith_pass(rate: float = 0.8 * DEG) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    t = np.arange(-100.0, 101.0)
    along, off = np.tan(rate * t * 0.9), np.tan(0.6 * DEG)
    return t, np.arctan2(off, along), np.arctan2(1.0, np.hypot(along, off))


def test_the_keyhole_is_split_evenly() -> None:
    t, azimuth, elevation = zenith_pass()
    mount = Mount(elevation=(0.0, 90 * DEG), azimuth_rate=10 * DEG, elevation_rate=5 * DEG)
    plan = mount.plan(t, azimuth, elevation)
    assert plan.keyhole.any()
    assert (np.abs(np.diff(plan.azimuth)) <= mount.azimuth_rate + 1e-12).all()
    late = azimuth.copy()
    state = MountState(azimuth[0], elevation[0])
    for i in range(1, len(t)):
        state = mount.step(state, azimuth[i], elevation[i], 1.0)
        late[i] = state.azimuth
    behind = np.cos(elevation) * np.abs(np.unwrap(azimuth) - late)
    assert plan.error.max() < 0.75 * behind.max()
    before, after = plan.error[t < -0.5].max(), plan.error[t > 0.5].max()
    assert before == pytest.approx(after, rel=0.05)


def test_a_pass_is_wound_so_that_it_fits() -> None:
    t = np.arange(0.0, 100.0)
    azimuth = np.mod(100 * DEG + 2 * DEG * t + np.pi, 2 * np.pi) - np.pi  # 100° … 298°, through south
    plan = MOUNT.plan(t, azimuth, np.full(100, 0.5))
    assert not plan.wound or plan.azimuth.max() <= MOUNT.azimuth[1]
    wide = Mount(azimuth=(-270 * DEG, 270 * DEG))
    plan = wide.plan(t, azimuth, np.full(100, 0.5))
    assert plan.wound
    np.testing.assert_allclose(plan.error, 0.0, atol=1e-7)


def test_the_mask_is_not_a_stop() -> None:
    mount = Mount(mask=((0.0, 10 * DEG), (np.pi / 2, 20 * DEG), (np.pi, 10 * DEG)))
    np.testing.assert_array_equal(
        mount.visible(np.array([np.pi / 4, np.pi / 4]), np.array([14 * DEG, 16 * DEG])), [False, True]
    )
    assert mount.reach(np.pi / 4, 5 * DEG, 0.0).elevation == pytest.approx(5 * DEG)
    with pytest.raises(UserError, match="stop"):
        Mount(elevation=(1.0, 0.0))


def beside_zenith(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A straight line at 500 km, 20 km beside the zenith at 7.5 km/s: azimuth swings by 180° in seconds."""
    x, y = 7.5 * t, np.full_like(t, 20.0)
    return np.arctan2(x, y), np.arctan2(500.0, np.hypot(x, y))


def test_foreseeing_halves_the_error_of_the_keyhole() -> None:
    """Tick by tick it is `plan`; without looking ahead the mount is as late afterwards as both errors together."""
    mount = Mount(azimuth_rate=np.radians(4.0), elevation_rate=np.radians(4.0))
    t = np.arange(-60.0, 60.0, 0.5)
    azimuth, elevation = beside_zenith(t)
    plan = mount.plan(t, azimuth, elevation)
    ahead = np.arange(0.0, 46.0, 0.5)
    here = late = blind = MountState(float(azimuth[0]), float(elevation[0]))
    worst, worst_blind, made = 0.0, 0.0, []
    for k, now in enumerate(t):
        late, aim = mount.foresee(late, *beside_zenith(now + ahead), 0.5, 0.5)
        new = mount.step(here, aim.azimuth, aim.elevation, 0.5)
        assert abs(new.azimuth - here.azimuth) <= mount.azimuth_rate * 0.5 + 1e-12
        here, blind = new, mount.step(blind, float(azimuth[k]), float(elevation[k]), 0.5)
        wanted = direction(azimuth[k], elevation[k])
        worst = max(worst, float(separation(direction(*here), wanted)))
        worst_blind = max(worst_blind, float(separation(direction(*blind), wanted)))
        made.append(here.azimuth)
    assert worst < 0.75 * worst_blind
    assert worst < 1.1 * plan.error.max()
    np.testing.assert_allclose(made[60:180], plan.azimuth[60:180], atol=np.radians(4.0))


def direction(azimuth: float, elevation: float) -> np.ndarray:
    c = np.cos(elevation)
    return np.array([c * np.sin(azimuth), c * np.cos(azimuth), np.sin(elevation)])


def test_foreseeing_keeps_the_stops() -> None:
    rng = np.random.default_rng(9)
    mount = Mount((-2.0, 2.0), (0.1, 1.4), 0.1, 0.1)
    late = here = MountState(0.0, 0.5)
    for _ in range(500):
        azimuth = np.cumsum(rng.normal(0.0, rng.choice([0.01, 0.5]), 30)) + rng.uniform(-9, 9)
        if rng.random() < 0.1:
            azimuth[rng.integers(30)] = np.nan
        late, aim = mount.foresee(late, azimuth, rng.uniform(-2, 2, 30), 0.5, 0.5)
        new = mount.step(here, aim.azimuth, aim.elevation, 0.5)
        assert -2.0 <= new.azimuth <= 2.0
        assert 0.1 <= new.elevation <= 1.4
        assert abs(new.azimuth - here.azimuth) <= 0.05 + 1e-12
        here = new
