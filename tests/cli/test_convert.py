"""`boresight convert` and `boresight paper wang2009`, as a user types them."""

from __future__ import annotations

import csv
import json
import math
from pathlib import Path

import numpy as np
import pymap3d
import pytest

from tests.cli.conftest import Run

CAMERA = ("--size-px", 256, 256, "--focal-px", 128, "--center-px", 128, 128, "--mount-deg", 45, 0, 0)
SITE = ("--site", 63.44, 10.39, 40)


def row(run: Run, *words: object) -> dict[str, float]:
    done = run("convert", *words, "--json")
    assert done.code == 0, done.err
    told = json.loads(done.out)
    assert told["command"] == "convert"
    (only,) = told["rows"]
    return only


def test_a_pixel_to_azimuth_and_elevation(run: Run) -> None:
    """The first frame of wang2009: α_g = −azimuth."""
    got = row(run, "pixel", 75, 111, "--to", "azel", *CAMERA, "--attitude-deg", -0.7, -0.1, 0.2)
    assert got["azimuth_deg"] == pytest.approx(21.825, abs=1e-3)
    assert got["elevation_deg"] == pytest.approx(6.827, abs=1e-3)
    back = row(
        run,
        "azel",
        got["azimuth_deg"],
        got["elevation_deg"],
        "--to",
        "pixel",
        *CAMERA,
        "--attitude-deg",
        -0.7,
        -0.1,
        0.2,
    )
    assert (back["px"], back["py"]) == pytest.approx((75, 111), abs=1e-9)


def test_noise_becomes_sigmas(run: Run) -> None:
    got = row(run, "pixel", 128, 128, "--to", "azel", *CAMERA, "--sigma-pixel-px", 1.0)
    assert got["sigma_azimuth_deg"] == pytest.approx(math.degrees(1 / 128), rel=1e-9)
    assert got["sigma_elevation_deg"] == pytest.approx(math.degrees(1 / 128), rel=1e-9)


@pytest.mark.parametrize("kind", ["azel", "enu", "ned", "ecef"])
def test_there_and_back(run: Run, kind: str) -> None:
    out = row(run, "geodetic", 63.45, 10.40, 1000, "--to", kind, *SITE)
    back = row(run, kind, *out.values(), "--to", "geodetic", *SITE)
    assert list(back.values()) == pytest.approx([63.45, 10.40, 1000], abs=1e-8)
    if kind == "azel":
        assert list(out.values()) == pytest.approx(pymap3d.geodetic2aer(63.45, 10.40, 1000, 63.44, 10.39, 40))


def test_a_line_of_sight_to_the_ground(run: Run) -> None:
    high = ("--site", 63.44, 10.39, 3000)
    got = row(run, "azel", -120.5, -3.2, "--to", "geodetic", *high, "--height-m", 50, "--sigma-attitude-deg", 0.1)
    assert got["height_m"] == pytest.approx(50, abs=1e-6)
    assert got["ellipse_major_m"] > 10 * got["ellipse_minor_m"]
    assert got["ellipse_azimuth_deg"] == pytest.approx(180 - 120.5, abs=1.0)  # along the line of sight
    az, el, _ = pymap3d.geodetic2aer(got["latitude_deg"], got["longitude_deg"], 50, 63.44, 10.39, 3000)
    assert (az, el) == pytest.approx((239.5, -3.2), abs=1e-9)
    bent = row(run, "azel", 10, 0.5, "--to", "geodetic", *SITE, "--range-m", 1e5, "--air", "radar")
    straight = row(run, "azel", 10, 0.5, "--to", "geodetic", *SITE, "--range-m", 1e5)
    assert straight["height_m"] - bent["height_m"] == pytest.approx(1e10 / 8 / 6.37e6, rel=0.02)


def test_a_csv(run: Run, tmp_path: Path) -> None:
    source, target = tmp_path / "in.csv", tmp_path / "out.csv"
    source.write_text("name,latitude_deg,longitude_deg,height_m\na,63.45,10.4,10\nb,63.5,10.5,20\n", encoding="utf-8")
    assert run("convert", "geodetic", "--csv", source, "--to", "enu", *SITE, "-o", target).code == 0
    with target.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [r["name"] for r in rows] == ["a", "b"]
    np.testing.assert_allclose(
        [[float(r[k]) for k in ("east_m", "north_m", "up_m")] for r in rows],
        np.transpose(pymap3d.geodetic2enu([63.45, 63.5], [10.4, 10.5], [10, 20], 63.44, 10.39, 40)),
        atol=1e-6,
    )
    assert run("convert", "geodetic", "--csv", source, "--to", "enu", *SITE).code == 0
    source.write_text("latitude_deg,longitude_deg,height_m\n63,x,10\n", encoding="utf-8")
    told = run("convert", "geodetic", "--csv", source, "--to", "ecef")
    assert told.code == 2
    assert "line 2, column 'longitude_deg': 'x' is not a number" in told.err


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("azel", 10, 5, "--to", "geodetic", *SITE), "--range-m or --height-m"),
        (("geodetic", 63, 10, 0, "--to", "enu"), "needs --site"),
        (("pixel", 1, 2, "--to", "azel"), "need a camera"),
        (("pixel", 300, 2, "--to", "azel", *CAMERA), "inside the picture"),
        (("azel", 180, 0, "--to", "pixel", *CAMERA), "in front of the camera"),
        (("enu", 1, 2, "--to", "azel"), "takes 3 values"),
        (("geodetic", 95, 10, 0, "--to", "ecef"), "latitude 95° is beyond ±90°"),
        (("geodetic", "nan", 10, 0, "--to", "ecef"), "must be finite"),
        (("geodetic", 5, 5, 5, "--to", "enu", "--site", 95, 0, 0), "site's latitude 95° is beyond ±90°"),
        (("azel", 10, 5, "--to", "azel", "--sigma-attitude-deg", -1), "sigma of attitude must be 0 or more"),
        (("azel", 10, 95, 100, "--to", "enu"), "beyond ±90°"),
        (("azel", 10, 5, "--to", "geodetic", *SITE, "--height-m", 0), "does not meet the height"),
        (("geodetic", "--csv", "none.csv", "--to", "ecef"), "none.csv"),
        (("pixel", 1, 2, "--to", "azel", "--size-px", 9, 9), "either --fov-deg or --focal-px"),
        (("martian", 1, 2, "--to", "azel"), "martian"),
    ],
)
def test_mistakes_end_with_one_line(run: Run, words: tuple[object, ...], says: str) -> None:
    done = run("convert", *words)
    assert done.code == 2
    assert says in done.err
    assert done.err.count("\n") == 1
    assert not done.out


@pytest.mark.parametrize(
    ("content", "says"),
    [(b"\xff\xfe\x00", "not a CSV in UTF-8"), (b"east_m,north_m,up_m\n1,2,3,4\n", "line 2: more cells")],
)
def test_broken_csv_ends_with_one_line(run: Run, tmp_path: Path, content: bytes, says: str) -> None:
    (tmp_path / "in.csv").write_bytes(content)
    done = run("convert", "enu", "--csv", tmp_path / "in.csv", "--to", "azel")
    assert done.code == 2
    assert says in done.err
    assert done.err.count("\n") == 1


def test_json_of_a_csv_holds_numbers(run: Run, tmp_path: Path) -> None:
    (tmp_path / "in.csv").write_text("east_m,north_m,up_m,note\n3,4,0,a\n")
    row = json.loads(run("convert", "enu", "--csv", tmp_path / "in.csv", "--to", "azel", "--json").out)["rows"][0]
    assert row["east_m"] == 3.0
    assert row["range_m"] == pytest.approx(5.0, rel=1e-15)
    assert row["note"] == "a"


def test_wang2009_json(run: Run, tmp_path: Path) -> None:
    picture = tmp_path / "w.png"
    done = run("paper", "wang2009", "--json", "--plot", picture)
    assert done.code == 0
    told = json.loads(done.out)
    assert told["command"] == "paper wang2009"
    assert [r["frame"] for r in told["rows"]] == list(range(1, 9))
    names = ["alpha_deg", "beta_deg", "alpha_g_deg", "beta_g_deg"]
    names += ["alpha_g_from_printed_deg", "beta_g_from_printed_deg"]
    for r in told["rows"]:
        assert set(names) | {f"{n}_residual" for n in names} <= set(r)
    assert picture.stat().st_size > 10_000
    assert run("paper", "wang2009").code == 0
    assert run("paper", "wang2009", "--plot", tmp_path / "w.txt").code == 2
