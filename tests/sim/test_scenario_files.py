"""Scenario files: the shipped examples run, mistakes are named."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from boresight.config.scenario import read_scenario
from boresight.errors import UserError
from boresight.io import read_recording, write_recording
from boresight.sim.scenario import simulate

FILES = sorted((Path(__file__).parents[2] / "examples").glob("*.toml"))
EXAMPLES = [p for p in FILES if "duration_s" in p.read_text(encoding="utf-8")]  # scenarios, not stations


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda p: p.stem)
def test_examples_become_recordings(path: Path, tmp_path: Path) -> None:
    scenario, seed = read_scenario(path)
    rec = simulate(scenario, np.random.default_rng(seed))
    write_recording(rec, tmp_path / "rec")
    back = read_recording(tmp_path / "rec")
    assert not back.duplicates.any()
    np.testing.assert_allclose(back.detections.z, rec.detections.z, rtol=1e-13)
    assert len(back.truth) == len(scenario.targets)
    # every sensor sees some target: not all of its rows are empty
    for i, _ in enumerate(back.sensors):
        assert (~np.isnan(back.detections.z[back.detections.sensor == i])).any()


GOOD = """
name = "x"
duration_s = 10.0
dimensions = 2
[[targets]]
id = "a"
kind = "nearly_constant_velocity"
position_enu_m = [0.0, 100.0, 0.0]
velocity_enu_m_s = [1.0, 0.0, 0.0]
q_m2_s3 = 0.1
[[platforms]]
id = "ship"
kind = "fixed"
position_enu_m = [0.0, 0.0, 0.0]
[[sensors]]
id = "radar"
kind = "radar"
platform = "ship"
axes = "platform_enu"
rate_hz = 1.0
sigma_range_m = 5.0
sigma_azimuth_deg = 1.0
coverage = { range_m = [0.0, 1000.0] }
[[groups]]
id = "many"
count = 3
area_enu_m = [[0.0, 1.0], [0.0, 1.0], [0.0, 0.0]]
speed_m_s = [1.0, 2.0]
motion = { kind = "nearly_constant_velocity", q_m2_s3 = 0.1 }
"""

BAD = [
    ("duration_s", "duration", r"unknown key 'duration' \(did you mean 'duration_s'\?\)"),
    ("q_m2_s3 = 0.1\n", "q = 0.1\n", r"targets\['a'\]: unknown key 'q'"),
    ("q_m2_s3 = 0.1\n", "q_m2_s3 = -1.0\n", r"targets\['a'\]: .*q"),
    (
        'kind = "nearly_constant_velocity"\np',
        'kind = "nearly_constant_velocty"\np',
        "did you mean 'nearly_constant_vel",
    ),
    ("position_enu_m = [0.0, 100.0, 0.0]\n", "", r"targets\['a'\]: key 'position_enu_m' is missing"),
    ("rate_hz = 1.0", "rate_hz = 0.0", "rate_hz = 0.0"),
    ("rate_hz = 1.0", "", "give either rate_hz or period_s"),
    ("rate_hz = 1.0", "rate = 1.0", r"unknown key 'rate' in sensors\['radar'\] \(did you mean 'rate_hz'"),
    ("sigma_range_m = 5.0", "sigma_range_m = 0", "sigma_range_m = 0.0"),
    ('platform = "ship"', 'platform = "shp"', r"unknown platform 'shp' \(did you mean 'ship'"),
    ('kind = "fixed"', 'kind = "constant_velocity"', "needs velocity_enu_m_s"),
    ("duration_s = 10.0", "duration_s = 0.0", "duration must be above zero"),
    ("duration_s = 10.0", "duration_s = nan", "duration_s: is NaN"),
    ("dimensions = 2", "dimensions = 1", "give 2 or 3"),
    ("coverage = { range_m = [0.0, 1000.0] }", "", "give coverage.range_m an upper end"),
    ("count = 3", "count = 0", "count = 0; give one or more"),
    ("count = 3", "count = 1.5", r"groups\['many'\].count: expected int"),
]


@pytest.mark.parametrize(("old", "new", "message"), BAD, ids=[b[1].strip()[:30] or "missing" for b in BAD])
def test_bad_scenarios_are_refused_in_one_line(old: str, new: str, message: str, tmp_path: Path) -> None:
    assert old in GOOD
    path = tmp_path / "s.toml"
    path.write_text(GOOD)
    read_scenario(path)
    path.write_text(GOOD.replace(old, new, 1))
    with pytest.raises(UserError, match=message) as error:
        read_scenario(path)
    assert "\n" not in str(error.value)
    assert str(error.value).startswith(str(path))


@pytest.mark.parametrize(
    ("kind", "keys"),
    [
        ("nearly_constant_jerk", "q_m2_s7 = 1e-6"),
        ("singer", "tau_s = 20.0\nsigma_m_s2 = 2.0"),
        ("known_turn", "turn_rate_deg_s = 9.0"),
        ("coordinated_turn", "turn_rate_deg_s = 9.0\nq_rate_deg2_s3 = 1e-6"),
    ],
)
def test_every_motion_model_moves_a_target(kind: str, keys: str, tmp_path: Path) -> None:
    text = GOOD.replace('kind = "nearly_constant_velocity"', f'kind = "{kind}"', 1).replace("q_m2_s3 = 0.1", keys, 1)
    (tmp_path / "s.toml").write_text(text)
    scenario, seed = read_scenario(tmp_path / "s.toml")
    truth = simulate(scenario, np.random.default_rng(seed)).truth[0]
    assert np.isfinite(truth.position).all()
    if "turn" in kind:  # 90° to the right in 10 s: from east to south
        np.testing.assert_allclose(truth.velocity[-1, :2], [0.0, -1.0], atol=0.01)
