"""What recording.toml may say of how a sensor reports, and of the heights that it does not measure."""

from __future__ import annotations

from pathlib import Path

import pytest

from boresight.errors import UserError
from boresight.io.declaration import read_declaration, write_declaration
from boresight.types import Reporting
from tests.io.conftest import TOML

SINGLE = 'id = "lidar"\nreporting = "single"\np_wrong_id = 0.05\nheight_m = [3000.0, 1500.0]'


def test_one_target_a_message_and_a_prior_height_are_read_and_written(tmp_path: Path) -> None:
    path = tmp_path / "recording.toml"
    path.write_text(TOML.replace('id = "lidar"', SINGLE), encoding="utf-8")
    for _ in range(2):
        declared = read_declaration(path)
        radar, lidar, _ = declared.sensors
        assert (radar.reporting, radar.p_wrong_id, radar.height) == (Reporting.SCAN, None, None)
        assert (lidar.reporting, lidar.p_wrong_id, lidar.height) == (Reporting.SINGLE, 0.05, (3000.0, 1500.0))
        path.write_text(write_declaration(declared), encoding="utf-8")


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ('reporting = "singel"', "did you mean 'single'"),
        ("p_wrong_id = 1.0", "p_wrong_id = 1.0; give a probability in (0, 1)"),
        ("height_m = [100.0, 0.0]", "sigma above zero"),
    ],
)
def test_what_cannot_be_is_refused(line: str, message: str, tmp_path: Path) -> None:
    path = tmp_path / "recording.toml"
    path.write_text(TOML.replace('id = "lidar"', f'id = "lidar"\n{line}'), encoding="utf-8")
    with pytest.raises(UserError) as error:
        read_declaration(path)
    assert message in str(error.value)
    assert "sensor 'lidar'" in str(error.value)
