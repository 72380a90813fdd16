"""What is written as TOML is read back the same, whatever a name holds."""

from __future__ import annotations

import math
import tomllib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from boresight.errors import UserError
from boresight.io.declaration import Declaration, read_declaration, write_declaration
from boresight.io.toml import read_toml, write_toml
from boresight.types import Axes, Coverage, Mount, Sensor, SensorKind, Site

TEXT = st.text(st.characters(exclude_categories=["Cs"]), min_size=1, max_size=20)
NUMBER = st.floats(allow_nan=False, allow_infinity=False)


@given(name=TEXT, number=NUMBER, inner=st.dictionaries(st.sampled_from("abc"), NUMBER | TEXT | st.booleans()))
def test_any_value_comes_back(name: str, number: float, inner: dict[str, object]) -> None:
    value = {"name": name, "number": number, "list": [number, 1.0], "table": {"x": inner}, "rows": [{"id": name}]}
    assert tomllib.loads(write_toml(value)) == value


SIGMA = st.floats(1e-3, 1e4)


@given(
    name=TEXT,
    kind=st.sampled_from(SensorKind),
    axes=st.sampled_from(Axes),
    sigma=st.lists(SIGMA | st.none(), min_size=5, max_size=5),
    angles=st.lists(st.floats(-180.0, 180.0), min_size=3, max_size=3),
    latency=st.floats(-5.0, 5.0),
    low=st.floats(-180.0, 179.0),
)
def test_any_sensor_comes_back(name, kind, axes, sigma, angles, latency, low, tmp_path_factory) -> None:
    rides = None if axes is Axes.SITE_ENU else "ship"
    values = np.array([np.nan if s is None else s for s in (*sigma[:4], sigma[4], sigma[4], sigma[4])])
    values[1:3] = np.radians(values[1:3])
    one = Sensor(
        name, kind, rides, axes, Mount(*np.radians(angles).tolist(), lever_arm=(1.0, -2.0, 0.5)), values, latency,
        None, 0.5, 2.0, Coverage((1.0, math.inf), (math.radians(low), math.radians(low + 1.0)), (-0.5, 0.5)),
    )  # fmt: skip
    path = tmp_path_factory.mktemp("t") / "recording.toml"
    path.write_text(write_declaration(Declaration("x", 2, Site(0.5, -1.0, 3.0), (one,))), encoding="utf-8")
    (two,) = read_declaration(path).sensors
    assert (two.id, two.kind, two.axes, two.platform, two.latency) == (name, kind, axes, rides, latency)
    np.testing.assert_allclose(two.sigma, one.sigma, rtol=1e-12)
    np.testing.assert_allclose(
        [two.mount.yaw, two.mount.pitch, two.mount.roll, *two.coverage.azimuth],
        [one.mount.yaw, one.mount.pitch, one.mount.roll, *one.coverage.azimuth],
        rtol=1e-12,
    )
    assert two.coverage.range == one.coverage.range


@pytest.mark.parametrize("content", [b"", b"  \n", b"\x00\x01", b"\xff\xfe", b"a = ", b"[a\n"])
def test_broken_files_are_refused(content: bytes, tmp_path: Path) -> None:
    (tmp_path / "x.toml").write_bytes(content)
    with pytest.raises(UserError, match=r"x\.toml"):
        read_toml(tmp_path / "x.toml")
