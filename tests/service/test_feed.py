"""A hundred thousand bad datagrams: counted, never a crash, never a report that is not sound."""

from __future__ import annotations

import json
import math
import tracemalloc

import numpy as np

from boresight.frames.local import ecef_from_enu_rotation
from boresight.io.jsonlines import LONGEST
from boresight.pointing.guide import GuideFilter, GuideSource
from boresight.pointing.pointer import Pointer
from boresight.service.feed import Feed, Stand
from boresight.service.navigation import Navigation
from boresight.types import Site
from tests.service.common import give, parse

SITE = Site(0.8, 0.15, 400.0)
POINTER = Pointer(
    GuideFilter(
        (
            GuideSource("radar", sigma_angle=3e-3, sigma_range=20.0),
            GuideSource("gps", sigma_position=10.0),
            GuideSource("other", correlation=2.0),
        ),
        False,
        1.0,
    ),
    SITE,
    (False, False, False),
)
GOOD = {"source": "radar", "t_s": 1000.0, "azimuth_deg": 30.0, "elevation_deg": 10.0, "range_m": 5000.0}
PLACE = {"source": "gps", "t_s": 1000.0, "latitude_deg": 45.9, "longitude_deg": 8.6, "height_m": 900.0}
TRACK = {
    "source": "other", "t_s": 1000.0, "east_m": 1e3, "north_m": 2e3, "up_m": 5e2,
    "ve_m_s": 9.0, "vn_m_s": 1.0, "vu_m_s": 0.0,
    "covariance": [400.0, 90, 0, 1, 0, 0, 250.0, 0, 0, 1, 0, 900.0, 0, 0, 1, 9.0, 0, 0, 9.0, 0, 9.0],
}  # fmt: skip
SHIP = {
    "platform": "ship", "t_s": 1000.0, "east_m": 1.0, "north_m": 2.0, "up_m": 0.0, "yaw_deg": 9.0, "pitch_deg": 1.0,
    "roll_deg": -3.0,
}  # fmt: skip


def feed() -> Feed:
    return Feed(POINTER, {"radar": Stand(), "gps": Stand(), "other": Stand()}, Navigation("ship", POINTER, 1.0))


def line(**change: object) -> bytes:
    return json.dumps({**GOOD, **change}).encode()


def test_a_good_line_is_a_report() -> None:
    f = feed()
    (report,) = parse(f, line(), 1000.1)
    np.testing.assert_allclose(report.z, [math.radians(30), math.radians(10), 5000.0])
    np.testing.assert_allclose(report.axes, ecef_from_enu_rotation(SITE))
    two = parse(f, line() + b"\n" + json.dumps(PLACE).encode() + b"\n", 1000.1)
    assert [r.source for r in two] == [0, 1]
    assert np.linalg.norm(two[1].z) > 6e6
    face = b'{"source":"radar","t_s":1000,"face_az_deg":1,"face_el_deg":2}'
    assert parse(f, face, 1000.0) == []  # the face stands on a ship of which nothing is known
    assert f.counts["no_navigation"] == 1
    parse(f, json.dumps(SHIP).encode(), 1000.0)
    (own,) = parse(f, face, 1000.0)
    assert math.isnan(own.z[2])


def test_every_mistake_has_its_name() -> None:
    f = feed()
    for data, name in (
        (b"{", "malformed"), (b"\xff\xfe{}", "malformed"), (b'{"source":"radar"}', "malformed"),
        (b"[1,2]", "malformed"),
        (line(azimuth_deg="north"), "malformed"), (line(source="nobody"), "unknown_source"),
        (line(t_s=0.0), "bad_time"),
        (line(t_s=1e9), "bad_time"), (line(elevation_deg=91.0), "bad_value"), (line(range_m=-5.0), "bad_value"),
        (line(note="x" * LONGEST), "oversized"), (line(source="gps"), "bad_value"),
        (json.dumps({**PLACE, "latitude_deg": 99.0}).encode(), "bad_value"),
        (json.dumps({**TRACK, "covariance": [1.0, 2.0]}).encode(), "bad_value"),
        (json.dumps({**TRACK, "covariance": [1.0, 9.0, 0.0, 1.0, 0.0, 1.0]}).encode(), "bad_value"),
        (json.dumps({**TRACK, "covariance": None}).encode(), "bad_value"),
        (json.dumps({**TRACK, "ve_m_s": None}).encode(), "bad_value"),
    ):  # fmt: skip
        before = f.counts[name]
        assert parse(f, data, 1000.0) == []
        assert f.counts[name] == before + 1, (data, f.counts)


def test_a_hundred_thousand_mutants() -> None:
    rng = np.random.default_rng(40)
    seeds = [json.dumps(m).encode() for m in (GOOD, PLACE, TRACK, SHIP)]
    seeds += [line(range_m=None), b"", b"[" * 500, b"\x00" * 64]
    f, state, taken = feed(), POINTER.init(), 0
    which, kinds = rng.integers(len(seeds), size=100_000), rng.integers(5, size=100_000)
    noise = rng.integers(256, size=(100_000, 3))
    places = rng.random((100_000, 3))
    for m in (SHIP, GOOD, PLACE, TRACK):  # compile first: that takes memory of its own
        for report in parse(feed(), json.dumps(m).encode(), 1000.0):
            give(POINTER, POINTER.init(), report)
    for i in range(100_000):
        if i == 80_000:  # tracing is slow: what leaks, leaks at the end too
            tracemalloc.start()
            base = tracemalloc.get_traced_memory()[0]
        data = bytearray(seeds[which[i]])
        if data and kinds[i] < 3:
            for k in range(kinds[i] + 1):
                data[int(places[i, k] * len(data))] = noise[i, k]
        elif kinds[i] == 3:
            data = data[: int(places[i, 0] * len(data))]
        else:
            data = data * (1 + noise[i, 0] % 40)
        for report in parse(f, bytes(data), 1000.0 + 1e-3 * i if i % 2 else 1000.0):
            assert np.isfinite(report.z).any()
            assert not np.isinf(report.z).any()
            assert np.isfinite(report.axes).all()
            taken += 1
            if taken % 5 == 0:
                give(POINTER, state, report)
                assert np.isfinite(state.guide.X).all()
    grown = tracemalloc.get_traced_memory()[0] - base
    tracemalloc.stop()
    assert taken > 300
    assert sum(f.counts.values()) > 50_000
    assert grown < 5e5
