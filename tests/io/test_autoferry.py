"""The Autoferry importer, against the data's own JSON."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from boresight.errors import UserError
from boresight.io import iter_scans, read_recording, write_recording
from boresight.io.autoferry import import_autoferry
from boresight.types import Component

DATA = Path(__file__).parents[2] / "../shared/data/autoferry"
real = pytest.mark.skipif(not DATA.is_dir(), reason="the Autoferry data is not beside this checkout")


def entry(**changes: object) -> dict[str, object]:
    base = {"sensorID": 3, "measurements": [], "ownshipPosition": [1.0, 2.0], "time": 10.0, "measurement": 0.5}
    return {**base, **changes}


def put(path: Path, data: object) -> Path:
    path.write_text(json.dumps(data))
    return path


def test_every_measurement_shape(tmp_path: Path) -> None:
    looks = [
        entry(),
        entry(time=10.1, measurement=[]),
        entry(time=10.2, measurement=[0.1, -0.2]),
        entry(sensorID=2, time=10.05, measurement=[30.0, 40.0]),
        entry(sensorID=1, time=10.3, measurement=[[1.0, 2.0], [3.0, 4.0]], ownshipPosition=[5.0, 6.0]),
        entry(sensorID=1, time=10.4, measurement=[]),
    ]
    rec = import_autoferry(put(tmp_path / "d.json", looks))
    d = rec.detections
    names = [rec.sensors[i].id for i in d.sensor]
    assert names == ["ir", "ir", "ir", "ir", "radar", "lidar", "lidar", "lidar"]
    np.testing.assert_allclose(d.z[[0, 2, 3], Component.AZIMUTH], [0.5, 0.1, -0.2])
    assert np.isnan(d.z[[1, 7]]).all()
    np.testing.assert_array_equal(d.z[4, 4:6], [40.0, 30.0])  # east, north
    np.testing.assert_array_equal(d.z[5:7, 4:6], [[3.0, 1.0], [4.0, 2.0]])
    ferry = rec.platforms[0]
    np.testing.assert_array_equal(ferry.t, [10.0, 10.05, 10.1, 10.2, 10.3, 10.4])
    np.testing.assert_array_equal(ferry.position[[0, 4]], [[2.0, 1.0, 0.0], [6.0, 5.0, 0.0]])
    assert [len(s.t) for s in iter_scans(rec)] == [1, 0, 2, 1, 2, 0]


def test_truth_is_unique_and_ascending_and_the_own_ship_is_none_of_it(tmp_path: Path) -> None:
    looks = put(tmp_path / "d.json", [entry(), entry(time=10.1)])
    a = {"targetID": 7, "position": [3.0, 4.0, 0.0], "time": 10.2}
    b = {"targetID": 7, "position": [5.0, 6.0, 0.0], "time": 9.9}
    rec = import_autoferry(looks, put(tmp_path / "t.json", [[a], [a, b]]))
    assert [p.target for p in rec.truth] == ["7"]
    np.testing.assert_array_equal(rec.truth[0].t, [9.9, 10.2])
    np.testing.assert_array_equal(rec.truth[0].position, [[6.0, 5.0, 0.0], [4.0, 3.0, 0.0]])


def test_ignored_paths_stand_still_at_both_ends(tmp_path: Path) -> None:
    looks = put(tmp_path / "d.json", [entry()])
    csv = tmp_path / "i.csv"
    csv.write_text("time,object,north,east\n10,b,1,2\n11,b,3,4\n")
    rec = import_autoferry(looks, ignore=csv)
    np.testing.assert_array_equal(rec.ignore[0].t, [5.0, 10.0, 11.0, 16.0])
    np.testing.assert_array_equal(rec.ignore[0].position, [[2.0, 1.0], [2.0, 1.0], [4.0, 3.0], [4.0, 3.0]])
    assert set(rec.ignore[0].radius) == {40.0}


BAD = [
    ([], "the list has no entries"),
    ({}, "expected a list"),
    ([3], "entry 0: is 3"),
    ([entry(), entry(sensorID=9)], "entry 1: sensorID = 9"),
    ([entry(time="x")], "entry 0: time = 'x'"),
    ([entry(time=float("nan"))], "entry 0: time = nan"),
    ([entry(measurement=float("inf"))], "entry 0: measurement holds inf"),
    ([entry(measurement=["a"])], "entry 0: measurement holds 'a'"),
    ([entry(sensorID=2, measurement=[[1.0], [1.0, 2.0]])], "entry 0: measurement is neither"),
    ([entry(ownshipPosition=[1.0])], "entry 0: ownshipPosition"),
    ([{k: v for k, v in entry().items() if k != "measurement"}], "entry 0: key 'measurement' is missing"),
]


@pytest.mark.parametrize(("data", "message"), BAD, ids=[b[1] for b in BAD])
def test_bad_json_is_refused(data: object, message: str, tmp_path: Path) -> None:
    with pytest.raises(UserError, match=message):
        import_autoferry(put(tmp_path / "d.json", data))


@pytest.mark.parametrize("content", [b"", b"\x00\xff\x00", b'[{"sensorID": 3,'])
def test_broken_json_files_are_refused(content: bytes, tmp_path: Path) -> None:
    (tmp_path / "d.json").write_bytes(content)
    with pytest.raises(UserError, match=r"d\.json"):
        import_autoferry(tmp_path / "d.json")


def test_truth_of_another_length_is_refused(tmp_path: Path) -> None:
    looks = put(tmp_path / "d.json", [entry()])
    with pytest.raises(UserError, match="2 entries; the detections have 1"):
        import_autoferry(looks, put(tmp_path / "t.json", [[], []]))


@real
@pytest.mark.parametrize("scenario", [2, 3, 4, 13, 16])
def test_real_scenarios_hold_what_the_json_holds(scenario: int, tmp_path: Path) -> None:
    looks = DATA / f"scenario{scenario}_detections.json"
    truth = DATA / f"scenario{scenario}_groundTruth.json"
    write_recording(import_autoferry(looks, truth), tmp_path / "rec")
    rec = read_recording(tmp_path / "rec")
    raw = json.loads(looks.read_text())
    points = 0
    for e in raw:
        m = e["measurement"]
        flat = np.atleast_1d(np.array(m, dtype=float)).ravel()
        points += len(flat) // 2 if e["sensorID"] in (1, 2) else len(flat)
    d = rec.detections
    assert (~np.isnan(d.z)).any(axis=1).sum() == points
    assert len(d) == points + sum(1 for e in raw if e["measurement"] == [])
    assert len({(s, n) for s, n in zip(d.sensor, d.scan, strict=True)}) == len(raw)
    assert [p.target for p in rec.truth] == ["1", "2"]
    assert np.ptp(d.t) == pytest.approx(np.ptp([e["time"] for e in raw]))
    # the two vessels' first truth points are the first pair
    first = json.loads(truth.read_text())[0]
    for item in first:
        path = next(p for p in rec.truth if p.target == str(item["targetID"]))
        i = int(np.argmin(abs(path.t - item["time"])))
        np.testing.assert_allclose(path.position[i, [1, 0]], item["position"][:2])
