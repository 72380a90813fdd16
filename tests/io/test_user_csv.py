"""A user's own CSV."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from boresight.errors import UserError
from boresight.io.user_csv import import_csv

TOML = """
dimensions = 2
[site]
latitude_deg = 50.0
longitude_deg = 8.0
[[sensor]]
id = "radar"
kind = "radar"
sigma_range_m = 5.0
sigma_azimuth_deg = 1.0
"""
GOOD = "t_s,sensor,scan,range_m,azimuth_deg\n1.0,radar,0,100,10\n2.0,radar,1,,\n3.0,radar,2,110,-350\n"


def files(folder: Path, text: str | bytes = GOOD) -> tuple[Path, Path]:
    (folder / "s.toml").write_text(TOML)
    (folder / "d.csv").write_bytes(text if isinstance(text, bytes) else text.encode())
    return folder / "d.csv", folder / "s.toml"


def test_cells_become_rows(tmp_path: Path) -> None:
    rec, _ = import_csv(*files(tmp_path, "\ufeff" + GOOD + "\n"))
    np.testing.assert_allclose(rec.detections.z[:, 0], [100.0, np.nan, 110.0])
    np.testing.assert_allclose(rec.detections.z[[0, 2], 1], np.radians([10.0, 10.0]))


def test_truth_and_platform_files(tmp_path: Path) -> None:
    detections, sensors = files(tmp_path)
    (tmp_path / "t.csv").write_text("t_s,target,east_m,north_m\n0,a,1,2\n1,a,2,3\n")
    (tmp_path / "p.csv").write_text("t_s,platform,east_m,north_m,yaw_deg\n0,ship,0,0,\n9,ship,0,9,\n")
    rec, _ = import_csv(detections, sensors, platform=tmp_path / "p.csv", truth=tmp_path / "t.csv")
    assert rec.truth[0].position.tolist() == [[1.0, 2.0, 0.0], [2.0, 3.0, 0.0]]
    assert rec.platforms[0].id == "ship"


BAD = [
    ("", "d.csv: the file is empty"),
    (b"\x00\x01\x02\xff", "d.csv: not a text file"),
    (GOOD.replace("t_s", "time_s"), "unknown column 'time_s'"),
    (GOOD.replace("range_m", "rangem"), r"unknown column 'rangem' \(did you mean 'range_m'\?\)"),
    (GOOD.replace("scan", "range_m", 1), "column 'range_m' stands twice"),
    (GOOD.replace("100,", "x,"), "line 2: range_m is 'x', not a number"),
    (GOOD.replace("100,", "nan,"), "line 2: range_m is nan; leave it empty"),
    (GOOD.replace("3.0,", "inf,"), "line 4: t_s is inf"),
    (GOOD.replace("3.0,", ","), "line 4: t_s is null"),
    (GOOD.replace("3.0,radar", "3.0,radr"), r"line 4: unknown sensor 'radr' \(did you mean 'radar'\?\)"),
    (GOOD.replace("110,-350", "110"), "line 4: 4 cells where the header has 5"),
    (GOOD.replace("radar,1", "radar,1.5"), "line 3: scan is '1.5', not a whole number"),
    ("t_s,sensor,scan,range_m,azimuth_deg\n", "the table has no rows"),
    (GOOD.replace(",scan", "").replace(",0,", ",").replace(",1,", ",").replace(",2,", ","), "'scan' is missing"),
]


@pytest.mark.parametrize(("text", "message"), BAD, ids=[b[1][:40] for b in BAD])
def test_bad_csv_is_refused_in_one_line(text: str | bytes, message: str, tmp_path: Path) -> None:
    with pytest.raises(UserError, match=message) as error:
        import_csv(*files(tmp_path, text))
    assert "\n" not in str(error.value)
