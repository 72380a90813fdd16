"""Reading, checking and writing recordings."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from boresight.errors import UserError
from boresight.io import iter_scans, read_recording, write_recording
from boresight.types import Axes, Component
from tests.io.conftest import TOML, Write


def test_values_arrive_in_si_and_radians(write: Write) -> None:
    rec = read_recording(write())
    d = rec.detections
    assert rec.site.latitude == pytest.approx(math.radians(63.4389029083), abs=1e-15)
    assert d.z[0, Component.AZIMUTH] == pytest.approx(math.radians(10.0))
    assert d.z[1, Component.AZIMUTH] == pytest.approx(-math.pi / 2)
    assert d.z[2, Component.AZIMUTH] == math.pi  # (-π, π]
    assert rec.sensors[1].axes is Axes.BODY
    # body: x forward, y right -> the north-like and east-like columns
    np.testing.assert_array_equal(d.z[3, 4:], [1.0, 5.0, np.nan])
    np.testing.assert_allclose(d.sigma[0, :3], [5.0, math.radians(1.0), np.nan])
    np.testing.assert_array_equal(d.sigma[3, 4:], [1.5, 1.5, np.nan])
    np.testing.assert_array_equal(d.t_recv, [1.0, 1.1, 1.1, 2.0, 2.0, 2.5])
    np.testing.assert_allclose(rec.platforms[0].ypr[0], [math.pi / 2, 0.0, 0.0])  # heading alone: level
    assert rec.truth[0].position[1].tolist() == [5.0, 1.0, 0.0]
    assert rec.ignore[0].radius.tolist() == [40.0, 40.0]


def test_scans_come_in_order_of_arrival_and_empty_looks_are_kept(write: Write) -> None:
    scans = list(iter_scans(read_recording(write())))
    assert [(s.sensor, s.row.tolist(), s.empty_rows) for s in scans] == [
        (0, [0, 1], ()),
        (2, [2], ()),
        (1, [3, 4], ()),
        (2, [], (5,)),
    ]
    assert scans[0].t_look == pytest.approx(1.05)
    assert scans[3].t_look == 2.5
    assert [s.t_recv for s in scans] == [1.1, 1.1, 2.0, 2.5]
    cov = scans[0].covariance[0]
    assert cov[0, 0] == 25.0
    assert cov[0, 1] == 0.0
    assert np.isnan(cov[2]).all()


def test_a_scan_may_be_interleaved_and_arrives_with_its_last_row(write: Write) -> None:
    def edit(c):
        c["detections"]["sensor"] = ["radar", "ir", "radar", "ir", "ir", "radar"]
        c["detections"]["scan"] = [1, 1, 1, 2, 2, 2]
        c["detections"]["range_m"] = [100.0, None, 101.0, None, None, 102.0]
        c["detections"]["azimuth_deg"] = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
        c["detections"] = {k: v for k, v in c["detections"].items() if k not in ("x_m", "y_m")}

    rec = read_recording(write(edit))
    assert [s.row.tolist() for s in iter_scans(rec)] == [[1], [0, 2], [3, 4], [5]]
    assert [s.row.tolist() for s in iter_scans(rec, ["ir"])] == [[1], [3, 4]]
    with pytest.raises(UserError, match=r"unknown sensor 'raddar' \(did you mean 'radar'\?\)"):
        list(iter_scans(rec, ["raddar"]))


def test_duplicates_are_found_and_used_once(write: Write) -> None:
    def edit(c):
        d = c["detections"]
        for name in d:
            d[name] = d[name] + [d[name][0], d[name][5]]
        d["scan"][6] = 99  # the repeated row may carry another scan number

    rec = read_recording(write(edit))
    assert np.flatnonzero(rec.duplicates).tolist() == [6, 7]
    rows = [r for s in iter_scans(rec) for r in (*s.row.tolist(), *s.empty_rows)]
    assert sorted(rows) == [0, 1, 2, 3, 4, 5]


def test_row_sigma_and_covariance_override_the_sensor(write: Write) -> None:
    def edit(c):
        c["detections"]["sigma_range_m"] = [7.0, None, None, None, None, None]
        # body axes, order x, y: variance forward 4, right 9, cross 1
        c["detections"]["covariance"] = [None, None, None, [4.0, 1.0, 9.0], None, None]

    rec = read_recording(write(edit))
    assert rec.detections.sigma[0, 0] == 7.0
    assert rec.detections.sigma[1, 0] == 5.0
    np.testing.assert_allclose(rec.detections.covariance[3][4:6, 4:6], [[9.0, 1.0], [1.0, 4.0]])
    np.testing.assert_allclose(rec.detections.sigma[3, 4:6], [3.0, 2.0])
    lidar = next(s for s in iter_scans(rec) if s.sensor == 1)
    np.testing.assert_allclose(lidar.covariance[0][4:6, 4:6], [[9.0, 1.0], [1.0, 4.0]])


def test_a_down_component_changes_sign_with_its_covariances(write: Write) -> None:
    def edit(c):
        c["detections"]["z_m"] = [None, None, None, 3.0, None, None]
        c["detections"]["covariance"] = [None] * 3 + [[4.0, 1.0, 0.5, 9.0, 0.25, 16.0]] + [None] * 2

    rec = read_recording(write(edit))
    assert rec.detections.z[3, 4:].tolist() == [1.0, 5.0, -3.0]
    turn = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    frd = np.array([[4.0, 1.0, 0.5], [1.0, 9.0, 0.25], [0.5, 0.25, 16.0]])
    np.testing.assert_allclose(rec.detections.covariance[3][4:, 4:], turn @ frd @ turn.T)


def test_written_and_read_back_is_the_same(write: Write, tmp_path: Path) -> None:
    def edit(c):
        d = c["detections"]
        d["sigma_range_m"] = [7.0, None, None, None, None, None]
        d["covariance"] = [None, None, None, [4.0, 1.0, 9.0], None, None]
        d["source_id"] = ["x", None, None, None, None, None]
        d["attributes"] = ['{"snr": 3}', None, None, None, None, None]

    one = read_recording(write(edit))
    write_recording(one, tmp_path / "copy")
    two = read_recording(tmp_path / "copy")
    for name in ("t", "t_recv", "sensor", "scan", "z", "sigma"):
        np.testing.assert_allclose(getattr(two.detections, name), getattr(one.detections, name), rtol=1e-14)
    np.testing.assert_allclose(two.detections.covariance[3], one.detections.covariance[3])
    assert two.detections.source_id == one.detections.source_id
    assert two.detections.attributes == one.detections.attributes
    for a, b in zip(one.sensors, two.sensors, strict=True):
        assert (a.id, a.kind, a.platform, a.axes, a.latency, a.period) == (
            b.id,
            b.kind,
            b.platform,
            b.axes,
            b.latency,
            b.period,
        )
        assert a.coverage == b.coverage
        np.testing.assert_array_equal(a.sigma, b.sigma)
    np.testing.assert_array_equal(two.platforms[0].position, one.platforms[0].position)
    np.testing.assert_array_equal(two.truth[0].position, one.truth[0].position)
    assert two.site == one.site
    assert sorted(p.name for p in tmp_path.iterdir()) == ["copy", "rec"]  # nothing temporary is left


def test_an_existing_output_folder_needs_force(write: Write, tmp_path: Path) -> None:
    rec = read_recording(write())
    write_recording(rec, tmp_path / "out")
    with pytest.raises(UserError, match="--force"):
        write_recording(rec, tmp_path / "out")
    write_recording(rec, tmp_path / "out", force=True)
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.txt").write_text("years of work")
    with pytest.raises(UserError, match="did not write"):
        write_recording(rec, tmp_path / "mine", force=True)
    assert (tmp_path / "mine" / "thesis.txt").exists()


def col(table, name, row, value):
    def edit(c):
        c[table][name][row] = value

    return edit


def rename(table, old, new):
    def edit(c):
        c[table] = {new if k == old else k: v for k, v in c[table].items()}

    return edit


def put(table, name, values):
    return lambda c: c[table].__setitem__(name, values)


BAD_TABLES = [
    (rename("detections", "t_s", "time"), "unknown column 'time'"),
    (
        rename("detections", "range_m", "rnage_m"),
        r"detections.parquet: unknown column 'rnage_m' \(did you mean 'range_m'",
    ),
    (lambda c: c["detections"].pop("scan"), "detections.parquet: column 'scan' is missing"),
    (put("detections", "range_m", ["a"] * 6), "column 'range_m' holds string, expected a number"),
    (put("detections", "sensor", [1] * 6), "column 'sensor' holds int64, expected text"),
    (put("detections", "scan", [0.5] * 6), "row 0: scan is 0.5, not whole"),
    (col("detections", "range_m", 1, float("nan")), "row 1: range_m is nan; leave it null"),
    (col("detections", "azimuth_deg", 1, float("inf")), "row 1: azimuth_deg is inf"),
    (col("detections", "t_s", 2, float("nan")), "row 2: t_s is nan"),
    (col("detections", "t_s", 2, None), "row 2: t_s is null"),
    (col("detections", "range_m", 0, -3.0), "row 0: range_m is -3.0; a range is not negative"),
    (put("detections", "elevation_deg", [95.0] + [None] * 5), "row 0: elevation_deg is 95.0, outside"),
    (col("detections", "sensor", 1, "radr"), r"row 1: unknown sensor 'radr' \(did you mean 'radar'\?\)"),
    (put("detections", "sigma_range_m", [0.0] + [None] * 5), "row 0: sigma_range_m is 0.0"),
    (put("detections", "sigma_range_m", [None, -1.0] + [None] * 4), "row 1: sigma_range_m is -1.0"),
    (col("detections", "range_m", 2, 4.0), r"row 2: range_m has no noise: add sigma_range_m to \[\[sensor\]\] 'ir'"),
    (put("detections", "covariance", [[1.0, 2.0, 1.0]] + [None] * 5), "row 0: covariance is not positive definite"),
    (put("detections", "covariance", [[1.0, 2.0]] + [None] * 5), "row 0: covariance has 2 numbers"),
    (
        put("detections", "covariance", [[1.0, float("nan"), 1.0]] + [None] * 5),
        "row 0: covariance holds a number that is",
    ),
    (lambda c: [v.clear() for v in c["detections"].values()], "the table has no rows"),
    (col("truth", "t_s", 1, -1.0), "truth.parquet: row 1: t_s = -1.0 of target 'a' does not come after 0.0"),
    (col("platform", "t_s", 1, 0.0), "platform.parquet: row 1: t_s = 0.0 of platform 'ferry' does not come after"),
    (col("platform", "east_m", 1, None), "platform.parquet: row 1: east_m is null"),
    (lambda c: c.pop("platform"), "sensor 'radar' rides on platform 'ferry', which has no navigation data"),
    (put("platform", "platform", ["fery", "fery"]), r"no navigation data \(did you mean 'fery'"),
    (lambda c: c["platform"].pop("yaw_deg"), "no row with yaw_deg, which sensor 'lidar' needs"),
    (lambda c: c["platform"].pop("east_m"), "platform.parquet: column 'east_m' is missing"),
    (lambda c: [c["platform"].pop("east_m"), c["platform"].pop("north_m")], "no position; give either latitude_deg"),
    (col("ignore", "radius_m", 0, 0.0), "ignore.parquet: row 0: radius_m is 0.0"),
    (lambda c: c["truth"].pop("target"), "truth.parquet: column 'target' is missing"),
]


@pytest.mark.parametrize(("edit", "message"), BAD_TABLES, ids=[m[:60] for _, m in BAD_TABLES])
def test_bad_tables_are_refused_in_one_line(edit, message: str, write: Write) -> None:
    with pytest.raises(UserError, match=message) as error:
        read_recording(write(edit))
    assert "\n" not in str(error.value)


BAD_TOML = [
    (
        "sigma_range_m = 5.0",
        "sigma_rnage_m = 5.0",
        r"unknown key 'sigma_rnage_m' in sensor\['radar'\] \(did you mean 'sigma_range_m'",
    ),
    (
        "sigma_range_m = 5.0",
        "sigma_range_m = 0.0",
        "sensor 'radar': sigma_range_m = 0.0; give a standard deviation above",
    ),
    ("sigma_range_m = 5.0", "sigma_range_m = -1", "sensor 'radar': sigma_range_m = -1.0"),
    ("sigma_range_m = 5.0", "sigma_range_m = nan", r"sensor\['radar'\].sigma_range_m: is NaN"),
    ("sigma_range_m = 5.0", "sigma_range_m = inf", "sigma_range_m = inf"),
    ("sigma_range_m = 5.0", 'sigma_range_m = "5"', r"sensor\['radar'\].sigma_range_m: expected float"),
    ('kind = "lidar"', 'kind = "lidr"', r"kind = 'lidr' is not known \(did you mean 'lidar'\?\)"),
    ('axes = "body"', 'axes = "bdy"', r"axes = 'bdy' is not known \(did you mean 'body'\?\)"),
    ('id = "lidar"', 'id = "radar"', "sensor id 'radar' stands twice"),
    ("p_detection = 0.9", "p_detection = 1.5", "p_detection = 1.5; give a probability"),
    ("period_s = 1.68", "period_s = 0", "period_s = 0.0; give a time above zero"),
    ("range_m = [0.0, 600.0]", "range_m = [600.0, 0.0]", "coverage.range_m"),
    ("format = 1", "format = 2", "format = 2; this version reads format = 1"),
    ("dimensions = 2", "dimensions = 4", "dimensions = 4; give 2 or 3"),
    ("latitude_deg = 63.4389029083", "latitude_deg = 163.0", "site.latitude_deg = 163.0 is out of range"),
    ("latitude_deg = 63.4389029083", "", "key 'latitude_deg' is missing in site"),
    ("[site]", "[site", "not valid TOML"),
    ("height_m = 39.923", "hight_m = 39.923", r"unknown key 'hight_m' in site \(did you mean 'height_m'"),
]


@pytest.mark.parametrize(("old", "new", "message"), BAD_TOML, ids=[b[1][:40] or "missing" for b in BAD_TOML])
def test_bad_declarations_are_refused_in_one_line(old: str, new: str, message: str, write: Write) -> None:
    assert old in TOML
    with pytest.raises(UserError, match=message) as error:
        read_recording(write(toml=TOML.replace(old, new, 1)))
    assert "recording.toml" in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("name", ["recording.toml", "detections.parquet", "truth.parquet"])
@pytest.mark.parametrize("how", ["empty", "binary", "truncated"])
def test_broken_files_are_refused_in_one_line(name: str, how: str, write: Write) -> None:
    folder = write()
    whole = (folder / name).read_bytes()
    spoiled = {"empty": b"", "binary": bytes(range(256)) * 4, "truncated": whole[: len(whole) // 2]}[how]
    (folder / name).write_bytes(spoiled)
    with pytest.raises(UserError, match=name) as error:
        read_recording(folder)
    assert "\n" not in str(error.value)


def test_missing_files_and_folders(write: Write, tmp_path: Path) -> None:
    with pytest.raises(UserError, match="no such recording folder"):
        read_recording(tmp_path / "nowhere")
    folder = write()
    (folder / "detections.parquet").unlink()
    with pytest.raises(UserError, match=r"detections\.parquet: no such file"):
        read_recording(folder)


def test_a_file_that_may_not_be_read_is_not_called_damaged(write: Write, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = write()

    def refuse(*_: object) -> None:
        raise PermissionError(13, "Failed to open local file")

    monkeypatch.setattr(pq, "ParquetFile", refuse)
    with pytest.raises(UserError, match=r"detections\.parquet: cannot be read \(permission denied\)"):
        read_recording(folder)


def test_without_a_name_it_goes_by_its_folders(write: Write) -> None:
    folder = write()
    file = folder / "recording.toml"
    file.write_text("\n".join(line for line in file.read_text().split("\n") if not line.startswith("name")))
    assert read_recording(folder).name == folder.name


def test_two_sets_of_positions_are_refused(write: Write) -> None:
    with pytest.raises(UserError, match="both kinds of position"):
        read_recording(write(put("platform", "latitude_deg", [1.0, 1.0])))


def test_other_number_types_are_read(write: Write) -> None:
    folder = write()
    table = pq.read_table(folder / "detections.parquet")
    table = table.set_column(table.column_names.index("t_s"), "t_s", table["t_s"].cast(pa.float32()))
    table = table.set_column(table.column_names.index("scan"), "scan", table["scan"].cast(pa.int16()))
    table = table.set_column(table.column_names.index("sensor"), "sensor", table["sensor"].dictionary_encode())
    pq.write_table(table, folder / "detections.parquet")
    assert [len(s.row) for s in iter_scans(read_recording(folder))] == [2, 1, 2, 0]


@pytest.mark.parametrize("dimensions", [2, 3])
def test_geodetic_platforms_agree_with_pymap3d(dimensions: int, write: Write) -> None:
    pymap3d = pytest.importorskip("pymap3d")
    lat, lon, height = [63.44, 63.45], [10.40, 10.38], [40.0, 41.0]

    def edit(c):
        c["platform"] = {"t_s": [0.0, 10.0], "platform": ["ferry"] * 2, "yaw_deg": [90.0, 90.0]}
        c["platform"] |= {"latitude_deg": lat, "longitude_deg": lon, "height_m": height}
        c["truth"]["up_m"] = [0.0, 0.0]

    rec = read_recording(write(edit, TOML.replace("dimensions = 2", f"dimensions = {dimensions}")))
    enu = np.array(pymap3d.geodetic2enu(lat, lon, height, 63.4389029083, 10.39908278, 39.923))
    if dimensions == 2:
        enu[2] = 0.0  # everything lies in the plane of the tracks
    np.testing.assert_allclose(rec.platforms[0].position.T, enu, atol=1e-6)  # metres
