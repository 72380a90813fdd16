"""A serial port without hardware: a pseudo-terminal behind a link, unplugged and plugged in again."""

from __future__ import annotations

import contextlib
import json
import os
import threading
import time
from pathlib import Path

import pytest

from boresight.config.site import pointer_for, read_site
from boresight.errors import UserError
from boresight.io.jsonlines import LONGEST
from boresight.service.live import run_live
from boresight.service.sockets import Serial

pty = pytest.importorskip("pty", reason="no pseudo-terminals here")
pytest.importorskip("serial", reason="pyserial is not installed")

SITE = """
[site]
latitude_deg = 47.0
longitude_deg = 8.0
[beam]
rate_hz = 20.0
[[source]]
id = "a"
sigma_angle_deg = 0.1
sigma_range_m = 20.0
[input]
serial = "{port}"
"""


class Plug:
    """A device at a fixed path: `plug` makes it, `unplug` takes it away."""

    def __init__(self, path: Path) -> None:
        self.path, self.far = path, -1

    def plug(self) -> None:
        import tty

        self.far, near = pty.openpty()
        tty.setraw(near)
        self.path.symlink_to(os.ttyname(near))
        os.close(near)

    def unplug(self) -> None:
        self.path.unlink()
        os.close(self.far)

    def write(self, data: bytes) -> None:
        with contextlib.suppress(OSError):
            os.write(self.far, data)


def wait_for(what, seconds: float = 10.0) -> bool:  # type: ignore[no-untyped-def]
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        if what():
            return True
        time.sleep(0.01)
    return False


def test_lines_come_whole_and_a_port_is_found_again(tmp_path: Path) -> None:
    plug = Plug(tmp_path / "tty")
    plug.plug()
    port = Serial(str(plug.path), 9600)
    lines: list[bytes] = []

    def arrived(n: int) -> bool:
        lines.extend(port.read())
        return len(lines) >= n

    try:
        plug.write(b"one\ntw")
        assert wait_for(lambda: arrived(1))
        plug.write(b"o\nlost")
        assert wait_for(lambda: arrived(2))
        assert lines == [b"one", b"two"]
        wait_for(lambda: bool(port.read()) or bool(port.rest))
        plug.unplug()
        assert wait_for(lambda: not port.read() and port.device is None)
        assert port.lost() == {"overflow": 1}  # the line without an end
        plug.plug()
        assert wait_for(lambda: not port.read() and port.device is not None)
        plug.write(b"again\n")
        assert wait_for(lambda: arrived(3))
        assert lines[2] == b"again"
    finally:
        port.close()
        plug.unplug()


def test_a_port_that_never_ends_its_line_is_bounded(tmp_path: Path) -> None:
    plug = Plug(tmp_path / "tty")
    plug.plug()
    port = Serial(str(plug.path), 9600)
    try:
        for _ in range(3 * LONGEST // 1024):
            plug.write(b"x" * 1024)
            assert port.read() == []
            assert len(port.rest) <= LONGEST
        assert wait_for(lambda: port.read() == [] and port.lost().get("overflow", 0) >= 2)
    finally:
        port.close()
        plug.unplug()


def test_a_port_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="cannot be opened"):
        Serial(str(tmp_path / "none"), 9600)


def test_the_loop_points_by_a_serial_source_through_an_unplugging(tmp_path: Path) -> None:
    plug = Plug(tmp_path / "tty")
    plug.plug()
    (tmp_path / "site.toml").write_text(SITE.format(port=plug.path), encoding="utf-8")
    station = read_site(tmp_path / "site.toml")
    halt = threading.Event()

    def send() -> None:
        for i in range(1000):
            if halt.wait(0.05):
                return
            if i == 30:
                plug.unplug()
            elif i == 40:
                plug.plug()
            elif not 30 <= i < 40:
                row = {"source": "a", "t_s": time.time(), "azimuth_deg": 30.0, "elevation_deg": 20.0, "range_m": 5000.0}
                plug.write(json.dumps(row).encode() + b"\n")

    sender = threading.Thread(target=send)
    sender.start()
    try:
        counts = run_live(station, pointer_for(station), 6.0, None)
    finally:
        halt.set()
        sender.join()
        plug.unplug()
    assert counts["accepted"] > 50  # 30 before; after it was found again as many
    assert counts["ticks"] > 20
