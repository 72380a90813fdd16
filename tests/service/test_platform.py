"""An antenna on a rolling ship, live: navigation and reports by UDP, commands in the axes of the deck."""

from __future__ import annotations

import contextlib
import json
import math
import socket
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from boresight.config.site import pointer_for, read_site
from boresight.errors import UserError
from boresight.frames.array_face import Pole, angles_from_face, enu_from_face
from boresight.frames.attitude import enu_from_body
from boresight.frames.local import ecef_from_enu_rotation
from boresight.pointing.pointer import Mode
from boresight.service.feed import Feed, Stand
from boresight.service.live import run_live
from boresight.service.navigation import FRD_FROM_RFU, Navigation
from boresight.types import Axes
from tests.service.common import give, parse

SITE = """
platform = "ship"
attitude_coast_s = 0.5
[site]
latitude_deg = 47.0
longitude_deg = 8.0
height_m = 0.0
[beam]
width_deg = 2.0
rate_hz = 20.0
mechanics_s = 0.05
[face]
azimuth_deg = -60.0
elevation_deg = 30.0
pole = "in_face"
[[source]]
id = "radar"
axes = "body"
lever_arm_frd_m = [-20.0, 0.0, -10.0]
sigma_angle_deg = 0.1
sigma_range_m = 20.0
[[source]]
id = "gps"
sigma_position_m = 10.0
[[source]]
id = "own"
own = true
sigma_angle_deg = 0.2
{more}
"""
TARGET = np.array([-3000.0, 4000.0, 1500.0])


def ship(t: float) -> tuple[np.ndarray, np.ndarray]:
    """Position (ENU) and yaw, pitch, roll (rad): 8° of roll in 9 s."""
    return np.array([4.0 * t, 6.0 * t, 0.0]), np.radians([30.0, 2.0 * math.sin(t), 8.0 * math.sin(2 * math.pi * t / 9)])


def rfu(t: float) -> np.ndarray:
    """Right, forward, up of the ship in ENU: columns (3, 3)."""
    return enu_from_body(*(float(a) for a in ship(t)[1])) @ FRD_FROM_RFU


def navigation_line(t: float, stamp: float) -> dict[str, object]:
    p, ypr = ship(t)
    yaw, pitch, roll = np.degrees(ypr).tolist()
    row: dict[str, object] = {"platform": "ship", "t_s": stamp, "yaw_deg": yaw, "pitch_deg": pitch, "roll_deg": roll}
    return row | {"east_m": p[0], "north_m": p[1], "up_m": p[2], "ve_m_s": 4.0, "vn_m_s": 6.0, "vu_m_s": 0.0}


def radar_line(t: float, stamp: float) -> dict[str, object]:
    R = rfu(t)
    arm = R @ np.array([0.0, -20.0, 10.0])  # right, forward, up
    x, y, z = R.T @ (TARGET - ship(t)[0] - arm)
    az, el = math.degrees(math.atan2(x, y)), math.degrees(math.atan2(z, math.hypot(x, y)))
    far = math.sqrt(x * x + y * y + z * z)
    return {"source": "radar", "t_s": stamp, "azimuth_deg": az, "elevation_deg": el, "range_m": far}


def station(tmp_path: Path, more: str = ""):  # type: ignore[no-untyped-def]
    (tmp_path / "site.toml").write_text(SITE.format(more=more), encoding="utf-8")
    return read_site(tmp_path / "site.toml")


def test_reports_from_a_rolling_deck_are_turned_by_its_attitude(tmp_path: Path) -> None:
    """Body angles with a lever arm, and face angles, against the geometry done by hand."""
    p = pointer_for(station(tmp_path))
    nav = Navigation("ship", p, 0.5)
    feed = Feed(p, {"radar": Stand(Axes.BODY, lever_arm=(-20.0, 0.0, -10.0)), "gps": Stand(), "own": Stand()}, nav)
    assert parse(feed, json.dumps(radar_line(1.0, 1.0)).encode(), 1.0) == []
    assert feed.counts["no_navigation"] == 1
    for t in np.arange(0.0, 2.0, 0.05):
        parse(feed, json.dumps(navigation_line(float(t), float(t))).encode(), 2.0)
    assert feed.counts["navigation"] == 40
    (report,) = parse(feed, json.dumps(radar_line(1.02, 1.02)).encode(), 2.0)
    c = math.cos(report.z[1])
    u = np.array([c * math.sin(report.z[0]), c * math.cos(report.z[0]), math.sin(report.z[1])])
    R = ecef_from_enu_rotation(p.site)
    home = feed._origin["gps"]
    found = R.T @ (report.origin + report.z[2] * report.axes @ u - home)
    # local level at the ship is not the site's by 0.009° per km of its way: millimetres here
    np.testing.assert_allclose(found, TARGET, atol=0.2)
    face = rfu(1.02) @ enu_from_face(math.radians(-60.0), math.radians(30.0))
    az, el, _ = angles_from_face(face.T @ (TARGET - ship(1.02)[0]), Pole.IN_FACE)
    line = {"source": "own", "t_s": 1.02, "face_az_deg": math.degrees(az), "face_el_deg": math.degrees(el)}
    (own,) = parse(feed, json.dumps(line).encode(), 2.0)
    c = math.cos(own.z[1])
    u = np.array([c * math.sin(own.z[0]), c * math.cos(own.z[0]), math.sin(own.z[1])])
    to = TARGET - ship(1.02)[0]
    np.testing.assert_allclose(R.T @ own.axes @ u, to / np.linalg.norm(to), atol=2e-5)


def test_navigation_that_is_wrong_late_or_unknown_is_counted(tmp_path: Path) -> None:
    p = pointer_for(station(tmp_path))
    feed = Feed(p, {"radar": Stand(), "gps": Stand(), "own": Stand()}, Navigation("ship", p, 0.5))
    good = navigation_line(1.0, 1.0)
    for change, name in (
        ({}, "navigation"),
        ({}, "late_navigation"),
        ({"platform": "shipp"}, "unknown_platform"),
        ({"t_s": 1.1, "pitch_deg": 100.0}, "bad_value"),
        ({"t_s": -100.0}, "bad_time"),
        ({"t_s": 1.2, "yaw_deg": None, "up_m": None}, "bad_value"),
        ({"platform": None}, "malformed"),
    ):
        before = feed.counts[name]
        parse(feed, json.dumps({**good, **change}).encode(), 1.0)
        assert feed.counts[name] == before + 1, (change, feed.counts)
    fixed = Feed(p, {"radar": Stand(), "gps": Stand(), "own": Stand()})
    parse(fixed, json.dumps(good).encode(), 1.0)
    assert fixed.counts["unknown_platform"] == 1
    for i in range(5000):
        parse(feed, json.dumps({**good, "t_s": 2.0 + 1e-3 * i}).encode(), 5.0)
    assert len(feed.navigation.rows) <= 1000  # type: ignore[union-attr]


def test_attitude_is_coasted_then_said_to_be_lost(tmp_path: Path) -> None:
    p = pointer_for(station(tmp_path))
    nav, state = Navigation("ship", p, 0.5), p.init()
    feed = Feed(p, {"radar": Stand(), "gps": Stand(), "own": Stand()}, nav)
    state, out = p.tick(state, 0.0, nav.place(0.0))
    assert out is None
    for t in np.arange(0.0, 5.0, 0.05):
        parse(feed, json.dumps(navigation_line(float(t), float(t))).encode(), float(t))
    e, n, u = TARGET.tolist()
    line = {"source": "gps", "t_s": 4.9, "east_m": e, "north_m": n, "up_m": u}
    for report in parse(feed, json.dumps(line).encode(), 5.0):
        assert give(p, state, report) == 0
    for t, mode in ((5.0, Mode.FUSED), (5.4, Mode.FUSED), (5.6, Mode.NO_ATTITUDE), (7.0, Mode.NO_ATTITUDE)):
        state, out = p.tick(state, t, nav.place(t))
        assert out is not None
        assert out.mode == mode
        lost = mode == Mode.NO_ATTITUDE
        assert (
            math.isnan(out.aim.face_azimuth) == math.isnan(out.mount_azimuth) == math.isnan(out.aim.p_in_beam) == lost
        )
        assert math.isfinite(out.aim.azimuth)
        if t == 5.4:  # 0.5 s foretold beyond the last stamp: ½ · 8° (2π/9)² · 0.55² = 0.6° at most
            x, y, z = rfu(out.t_aim).T @ (TARGET - ship(out.t_aim)[0])
            assert abs(math.degrees(out.mount_azimuth - math.atan2(x, y))) < 0.7
            assert abs(math.degrees(out.mount_elevation - math.atan2(z, math.hypot(x, y)))) < 0.7
    parse(feed, json.dumps(navigation_line(7.0, 7.0)).encode(), 7.0)
    state, out = p.tick(state, 7.05, nav.place(7.05))
    assert out is not None
    assert out.mode != Mode.NO_ATTITUDE


def test_axes_need_a_platform(tmp_path: Path) -> None:
    text = SITE.format(more="").replace('platform = "ship"\n', "")
    (tmp_path / "site.toml").write_text(text, encoding="utf-8")
    with pytest.raises(UserError, match="source 'radar': axes and lever_arm"):
        read_site(tmp_path / "site.toml")


def test_a_rolling_ship_over_loopback(tmp_path: Path) -> None:
    """UDP in, UDP out: deck angles follow the roll; when navigation stops the mode says so, and it recovers."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    begun, halt = time.time(), threading.Event()

    def send() -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as s:
            i = 0
            while not halt.wait(0.05):
                now = time.time()
                t = now - begun
                rows = [radar_line(t, now)] if i % 4 == 0 else []
                if not 5.0 < t < 7.0:
                    rows.insert(0, navigation_line(t, now))
                for row in rows:
                    s.sendto(json.dumps(row).encode(), ("127.0.0.1", port))
                i += 1

    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as listener:
        listener.bind(("127.0.0.1", 0))
        more = f'[input]\nudp = "127.0.0.1:{port}"\n[output]\nudp = "127.0.0.1:{listener.getsockname()[1]}"\n'
        one = station(tmp_path, more)
        sender = threading.Thread(target=send)
        sender.start()
        try:
            counts = run_live(one, pointer_for(one), 10.0, None)
        finally:
            halt.set()
            sender.join()
        listener.setblocking(False)
        rows = []
        with contextlib.suppress(BlockingIOError):
            while True:
                rows.append(json.loads(listener.recv(4096)))
    assert counts["navigation"] > 60
    gone = [r for r in rows if begun + 6.0 < r["t_s"] < begun + 6.8]
    assert gone
    assert {r["mode"] for r in gone} == {"no_attitude"}
    assert {r["mount_az_deg"] for r in gone} == {r["face_az_deg"] for r in gone} == {None}
    there = [r for r in rows if begun + 2.5 < r["t_s"] < begun + 4.8 or r["t_s"] > begun + 8.0]
    assert sum(r["mode"] == "fused" for r in there) > len(there) / 2
    off = []
    for r in there:
        if r["mount_az_deg"] is not None:
            t = r["t_aim_s"] - begun
            x, y, z = rfu(t).T @ (TARGET - ship(t)[0])
            off.append(abs(r["mount_az_deg"] - math.degrees(math.atan2(x, y))))
            off.append(abs(r["mount_el_deg"] - math.degrees(math.atan2(z, math.hypot(x, y)))))
    assert np.median(off) < 0.5
