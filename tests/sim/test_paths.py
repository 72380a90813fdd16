"""Waypoint paths against geometry, drawn paths against the model's own covariance."""

from __future__ import annotations

import numpy as np
import pytest

from boresight.errors import UserError
from boresight.models.motion import NearlyConstantVelocity
from boresight.sim.actors import Attitude, Drawn, Target, fine_clock
from boresight.sim.paths import Straight, Waypoints

CORNER = np.array([[0.0, 0.0, 0.0], [100.0, 0.0, 0.0], [100.0, 100.0, 0.0]])


def test_a_corner_is_an_arc_of_the_wanted_radius_at_constant_speed() -> None:
    path = Waypoints(CORNER, speeds=np.full(3, 10.0), turn_radius=20.0)
    length = 200.0 - 2 * 20.0 + 20.0 * np.pi / 2
    t = np.linspace(0.0, length / 10.0, 2001)
    out = path.at(t)
    np.testing.assert_allclose(np.linalg.norm(out.velocity, axis=1), 10.0, rtol=1e-12)
    turning = (out.position[:, 0] > 80.001) & (out.position[:, 1] < 19.999)
    radius = np.linalg.norm(out.position[turning, :2] - [80.0, 20.0], axis=1)
    np.testing.assert_allclose(radius, 20.0, atol=1e-9)
    np.testing.assert_allclose(out.position[-1], [100.0, 100.0, 0.0], atol=1e-9)
    # velocity is the derivative of position
    np.testing.assert_allclose(np.gradient(out.position, t, axis=0)[1:-1], out.velocity[1:-1], atol=2e-2)


def test_without_a_radius_the_path_goes_through_every_point_at_its_time() -> None:
    times = np.array([0.0, 5.0, 30.0])
    out = Waypoints(CORNER, times=times).at(times)
    np.testing.assert_allclose(out.position, CORNER, atol=1e-9)


def test_speeds_change_evenly_on_a_leg() -> None:
    line = np.array([[0.0, 0.0, 0.0], [0.0, 300.0, 0.0]])
    path = Waypoints(line, speeds=np.array([10.0, 20.0]), start=2.0)  # 300 m at a mean of 15 m/s: 20 s
    out = path.at(np.array([0.0, 2.0, 12.0, 22.0, 24.0]))
    np.testing.assert_allclose(out.velocity[:, 1], [10.0, 10.0, 15.0, 20.0, 20.0])
    np.testing.assert_allclose(out.position[:, 1], [-20.0, 0.0, 125.0, 300.0, 340.0])


def test_short_legs_shrink_the_radius_and_a_way_back_is_possible() -> None:
    there_and_back = np.array([[0.0, 0.0, 0.0], [10.0, 0.0, 0.0], [0.0, 0.1, 0.0]])
    out = Waypoints(there_and_back, speeds=np.full(3, 1.0), turn_radius=1000.0).at(np.linspace(0.0, 30.0, 301))
    assert np.isfinite(out.position).all()
    steps = np.linalg.norm(np.diff(out.position, axis=0), axis=1)
    assert (steps < 0.1 + 1e-9).all()  # a chord across the sharp corner is shorter than its arc
    assert (steps > 0.099).sum() > 295


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"points": CORNER[:1], "speeds": np.ones(1)}, "at least two points"),
        ({"points": CORNER[[0, 0]], "speeds": np.ones(2)}, "are the same"),
        ({"points": CORNER}, "either speeds or times"),
        ({"points": CORNER, "speeds": np.array([1.0, 0.0, 1.0])}, "one speed above zero"),
        ({"points": CORNER, "times": np.array([0.0, 2.0, 1.0])}, "ascending"),
    ],
)
def test_bad_waypoints_are_refused(arguments: dict[str, np.ndarray], message: str) -> None:
    with pytest.raises(UserError, match=message):
        Waypoints(**arguments)


def test_drawn_paths_spread_as_the_model_says() -> None:
    motion = NearlyConstantVelocity(2.0)
    x0 = np.array([1.0, 2.0, 3.0, 10.0, 0.0, -1.0])
    t = np.linspace(0.0, 4.0, 9)
    rng = np.random.default_rng(11)
    runs = 2000
    ends = np.empty((runs, 6))
    for i in range(runs):
        out = Drawn(motion, x0).at(t, rng)
        ends[i] = np.concatenate([out.position[-1], out.velocity[-1]])
    mean, Q = motion.transition(x0, 4.0), motion.Q(x0, 4.0)
    # standard errors: of a mean sqrt(Q/runs), of a variance Q sqrt(2/runs); 5 of each
    assert (abs(ends.mean(axis=0) - mean) < 5 * np.sqrt(np.diag(Q) / runs)).all()
    scale = np.sqrt(np.outer(np.diag(Q), np.diag(Q)))
    assert (abs(np.cov(ends.T) - Q) < 5 * scale * np.sqrt(2 / runs)).all()


def test_attitude_follows_the_course_and_sways() -> None:
    path = Straight(np.zeros(3), np.array([1.0, 1.0, 0.0])).at(np.array([0.0, 2.5]))
    ypr = Attitude(sway=(0.0, 0.0, 0.1), sway_period=(10.0, 10.0, 10.0)).at(path)
    np.testing.assert_allclose(ypr, [[np.pi / 4, 0.0, 0.0], [np.pi / 4, 0.0, 0.1]])


def test_a_lifetime_must_go_forward() -> None:
    with pytest.raises(UserError, match="must come after birth"):
        Target("a", Waypoints(CORNER, speeds=np.ones(3)), birth=5.0, death=4.0)
    assert fine_clock(1.0, 2.0, 0.3).tolist() == pytest.approx([1.0, 1.25, 1.5, 1.75, 2.0])
