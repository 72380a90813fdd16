"""Passes of the SGP4 verification set's satellites against skyfield."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from boresight.errors import UserError
from boresight.pointing.mount import Mount
from boresight.pointing.satellite import look, passes, read_tle, unix_of
from boresight.types import Site

sgp4 = pytest.importorskip("sgp4")
VERIFICATION = Path(sgp4.__file__).parent / "SGP4-VER.TLE"
SITE = Site(np.radians(47.45), np.radians(8.56), 430.0)
CHOSEN = {"06251", "28057", "22312", "26900"}  # near-Earth orbits that live for days; one geostationary


def tle(number: str) -> list[str]:
    lines = VERIFICATION.read_text(encoding="ascii").splitlines()
    i = next(i for i, line in enumerate(lines) if line.startswith(f"1 {number}"))
    return [lines[i][:69], lines[i + 1][:69]]


@pytest.mark.parametrize("number", ["06251", "28057", "11801"])
def test_passes_agree_with_skyfield(number: str) -> None:
    """Rise and set within 1 s, az/el within 0.005°; UT1 is skyfield's own on both sides, no refraction."""
    api = pytest.importorskip("skyfield.api")
    lines = tle(number)
    (one,) = read_tle("\n".join(lines), "verification set")
    begin = unix_of(one.record.jdsatepoch, one.record.jdsatepochF)
    ts = api.load.timescale(builtin=True)
    theirs = api.EarthSatellite(*lines, ts=ts)
    there = api.wgs84.latlon(47.45, 8.56, 430.0)
    at = ts.from_datetime
    from datetime import UTC, datetime

    t0, t1 = (at(datetime.fromtimestamp(begin + s, UTC)) for s in (0.0, 86400.0))
    dut1 = float(t0.dut1)
    t, event = theirs.find_events(there, t0, t1, altitude_degrees=10.0)
    unix = np.array([x.utc_datetime().timestamp() for x in t])
    ours = passes(one, SITE, begin, begin + 86400.0, np.radians(10.0), dut1)
    tops = unix[event == 1]
    assert len(ours) == len(tops) > 0
    for p, top in zip(ours, tops):
        assert abs(p.culmination - top) < 30.0  # skyfield stops looking for the top early: it is flat
        for mine, kind in ((p.rise, 0), (p.set, 2)):
            near = unix[event == kind]
            if len(near) and np.abs(near - mine).min() < 600:
                assert np.abs(near - mine).min() < 1.0
    times = begin + np.arange(0.0, 86400.0, 600.0)
    alt, az, _ = (theirs - there).at(ts.from_datetimes([datetime.fromtimestamp(x, UTC) for x in times])).altaz()
    azimuth, elevation, _ = look(one, times, SITE, dut1)
    np.testing.assert_allclose(np.degrees(elevation), alt.degrees, atol=0.005)
    away = np.cos(elevation) * np.degrees(np.sin(azimuth - az.radians))
    np.testing.assert_allclose(away, 0.0, atol=0.005)


def test_a_zenith_pass_needs_a_fast_mount() -> None:
    (one,) = read_tle("\n".join(tle("28057")), "verification set")
    begin = unix_of(one.record.jdsatepoch, one.record.jdsatepochF)
    under = max(passes(one, SITE, begin, begin + 5 * 86400.0), key=lambda p: p.max_elevation)
    assert under.max_elevation > np.radians(70.0)
    t = np.arange(under.rise, under.set)
    azimuth, elevation, _ = look(one, t, SITE)
    slow = Mount(azimuth_rate=np.radians(0.5), elevation_rate=np.radians(3.0)).plan(t, azimuth, elevation)
    fast = Mount(azimuth_rate=np.radians(60.0), elevation_rate=np.radians(30.0)).plan(t, azimuth, elevation)
    assert slow.error.max() > 10 * max(fast.error.max(), 1e-9)
    assert slow.keyhole.any()
    assert not fast.keyhole.any()


def test_bad_elements_are_told() -> None:
    one, two = tle("28057")
    with pytest.raises(UserError, match="no two-line elements"):
        read_tle("hello", "x")
    with pytest.raises(UserError, match="without its line 2"):
        read_tle(one, "x")
    with pytest.raises(UserError, match="checksum"):
        read_tle(one[:20] + ("1" if one[20] != "1" else "2") + one[21:] + "\n" + two, "x")
    named = read_tle(f"0 CBERS\n{one}\n{two}\n", "x")
    assert named[0].name == "CBERS"


def test_mean_elements_say_the_same() -> None:
    """An OMM message made of the two lines gives the same place to the printed digits."""
    import json

    from sgp4.exporter import export_omm

    from boresight.pointing.satellite import read_elements

    (one,) = read_elements("\n".join(tle("28057")), "x")
    message = export_omm(one.record, "CBERS 2")
    (other,) = read_elements(json.dumps([message], default=str), "x")
    begin = unix_of(one.record.jdsatepoch, one.record.jdsatepochF)
    a, b = (look(s, [begin, begin + 3600.0], SITE) for s in (one, other))
    np.testing.assert_allclose(a[2], b[2], rtol=1e-6)
    assert other.name == "CBERS 2"
    with pytest.raises(UserError, match="not orbit mean elements"):
        read_elements('[{"OBJECT_NAME": "X"}]', "x")
