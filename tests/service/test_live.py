"""Live on loopback: UDP in, UDP out, and a real rotctld (Hamlib's dummy rotator) where there is one."""

from __future__ import annotations

import contextlib
import json
import math
import selectors
import shutil
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from boresight.config.site import pointer_for, read_site
from boresight.errors import UserError
from boresight.pointing.mount import Mount
from boresight.service.live import run_live
from boresight.service.rotctld import Rotator
from boresight.service.sockets import PER_READ, Tcp, Udp
from boresight.service.source import Waiting

SITE = """
[site]
latitude_deg = 47.0
longitude_deg = 8.0
height_m = 400.0
[beam]
width_deg = 2.0
rate_hz = 20.0
[[source]]
id = "a"
sigma_angle_deg = 0.1
sigma_range_m = 20.0
[[source]]
id = "b"
sigma_angle_deg = 0.2
sigma_range_m = 20.0
[[source]]
id = "own"
own = true
sigma_angle_deg = 0.2
[mount]
azimuth_rate_deg_s = 20.0
elevation_rate_deg_s = 20.0
[input]
udp = "127.0.0.1:{port}"
[output]
udp = "127.0.0.1:{out}"
command_rate_hz = 10.0
{rotator}
"""


def free_port(kind: int = socket.SOCK_DGRAM) -> int:
    with socket.socket(socket.AF_INET, kind) as s:
        s.bind(("127.0.0.1", 0))
        return int(s.getsockname()[1])


def target(t: float) -> np.ndarray:
    return np.array([-3000.0 + 200.0 * t, 4000.0, 1500.0])


class Sender(threading.Thread):
    """Three sources at 10 Hz until told to stop."""

    def __init__(self, port: int, begun: float) -> None:
        super().__init__(daemon=True)
        self.port, self.begun, self.halt = port, begun, threading.Event()

    def run(self) -> None:
        rng = np.random.default_rng(50)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as s:
            while not self.halt.wait(0.1):
                now = time.time()
                e, n, u = target(now - self.begun)
                for name, sigma in (("a", 0.1), ("b", 0.2), ("own", 0.2)):
                    az = math.degrees(math.atan2(e, n)) + sigma * rng.standard_normal()
                    el = math.degrees(math.atan2(u, math.hypot(e, n))) + sigma * rng.standard_normal()
                    row = {"source": name, "t_s": now, "azimuth_deg": az, "elevation_deg": el}
                    if name != "own":
                        row["range_m"] = float(np.linalg.norm([e, n, u]))
                    s.sendto(json.dumps(row).encode(), ("127.0.0.1", self.port))
                s.sendto(b"{broken", ("127.0.0.1", self.port))


def run(tmp_path: Path, seconds: float, rotator: str = "", stop=lambda: False):
    port, out = free_port(), free_port()
    text = SITE.format(port=port, out=out, rotator=f'rotctld = "{rotator}"' if rotator else "")
    (tmp_path / "site.toml").write_text(text, encoding="utf-8")
    station = read_site(tmp_path / "site.toml")
    listener = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    listener.bind(("127.0.0.1", out))
    listener.setblocking(False)
    begun = time.time()
    sender = Sender(port, begun)
    sender.start()
    commands = []
    try:
        counts = run_live(station, pointer_for(station), seconds, None, stop=stop)
        while True:
            try:
                commands.append(json.loads(listener.recv(4096)))
            except BlockingIOError:
                break
    finally:
        sender.halt.set()
        sender.join()
        listener.close()
    return counts, commands, begun


def test_reports_in_commands_out(tmp_path: Path) -> None:
    counts, commands, begun = run(tmp_path, 4.0)
    assert counts["accepted"] > 60
    assert counts["malformed"] > 20
    assert counts["latency_max_s"] < 1.0  # on a loaded machine
    late = [c for c in commands if c["t_s"] > begun + 3.0]
    assert len(late) > 5
    errors = []
    for c in late:
        e, n, u = target(c["t_aim_s"] - begun)
        errors.append(abs(c["az_deg"] - math.degrees(math.atan2(e, n))))
        errors.append(abs(c["el_deg"] - math.degrees(math.atan2(u, math.hypot(e, n)))))
    # this runs on the wall clock: where other work holds the processor up for a moment, single commands may suffer
    assert np.median(errors) < 1.0
    assert sum(c["mode"] == "fused" for c in late) > len(late) / 2


def test_a_flood_is_bounded_and_every_datagram_of_it_counted() -> None:
    source = Udp("127.0.0.1:0")
    try:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as s:
            for _ in range(60_000):  # far beyond what the system's buffer holds
                s.sendto(b"a\nb\nc\n" + b"x" * 200, source.socket.getsockname())
        assert source.dropped() > 0 or sys.platform != "linux"
        taken = 0
        while batch := source.read():
            assert len(batch) <= PER_READ
            taken += len(batch)
        if sys.platform == "linux":
            assert taken + source.dropped() == 60_000
            assert source.lost() == {"overflow": 4 * source.dropped()}  # in lines
    finally:
        source.close()


def test_silent_senders_shut_nobody_out() -> None:
    source = Tcp("127.0.0.1:0", most=32)
    selector = selectors.DefaultSelector()
    source.attach(selector)
    where = source.server.getsockname()
    try:
        with contextlib.ExitStack() as silent:
            for _ in range(32):
                silent.enter_context(socket.create_connection(where))
            for _ in range(32):
                source.read([source.server])
            with socket.create_connection(where) as speaks:
                speaks.sendall(b"hello\nhalf")
                got: list[bytes] = []
                for _ in range(100):
                    got += source.read([key.fileobj for key, _ in selector.select(0.1)])
                    if got:
                        break
                assert got == [b"hello"]
                assert len(source.peers) == 32
                assert source.lost() == {"silent_senders_closed": 1}
            for _ in range(100):
                got += source.read([key.fileobj for key, _ in selector.select(0.1)])
                if len(got) == 2:
                    break
            assert got == [b"hello", b"half"]  # the last line need not end
    finally:
        source.close()
        selector.close()


def test_raw_data_beyond_the_limits_goes_the_oldest_first_and_is_counted_in_lines() -> None:
    waiting = Waiting(most_lines=10, most_bytes=1000, most_wait=1.0)
    for k in range(6):
        waiting.add(0, 0.1 * k, b"%d\nx\n" % k)
    gone = waiting.beyond(0.5)
    assert [(t, n) for _, t, _, n in gone] == [(0.0, 2)]
    assert waiting.lines == 10
    gone = waiting.beyond(1.25)  # what has waited longer than a second is no use any more
    assert [t for _, t, _, _ in gone] == [pytest.approx(0.1), pytest.approx(0.2)]
    waiting.add(0, 1.25, b"y" * 2000)
    assert len(waiting.beyond(1.25)) == 4
    assert waiting.lines == waiting.size == 0


def ask(port: int) -> tuple[float, float]:
    with socket.create_connection(("127.0.0.1", port), 2.0) as s:
        s.sendall(b"p\n")
        file = s.makefile()
        return float(file.readline()), float(file.readline())


def start_rotctld(port: int) -> subprocess.Popen[bytes]:
    process = subprocess.Popen(
        ["rotctld", "-m", "1", "-T", "127.0.0.1", "-t", str(port)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    for _ in range(100):
        try:
            ask(port)
            return process
        except (OSError, ValueError):
            time.sleep(0.05)
    raise AssertionError("rotctld does not answer")


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("rotctld") is None, reason="Hamlib's rotctld is not installed")
def test_a_real_rotctld_is_followed_and_found_again(tmp_path: Path) -> None:
    port = free_port(socket.SOCK_STREAM)
    process = start_rotctld(port)
    killed = threading.Event()

    def kill_and_restart() -> None:
        nonlocal process
        time.sleep(5.0)
        process.kill()
        process.wait()
        time.sleep(1.0)
        process = start_rotctld(port)
        killed.set()

    helper = threading.Thread(target=kill_and_restart)
    helper.start()
    try:
        counts, _, begun = run(tmp_path, 14.0, f"127.0.0.1:{port}")
        helper.join()
        assert killed.is_set()
        assert counts["rotator_connects"] >= 2
        assert counts["rotator_lost"] >= 1
        assert counts["rotator_sent"] > 10
        az, el = ask(port)
        e, n, u = target(time.time() - begun)
        # the dummy slews at 6°/s, the target moves at 3°/s; by now it has caught up
        assert abs(az - math.degrees(math.atan2(e, n))) < 4.0
        assert abs(el - math.degrees(math.atan2(u, math.hypot(e, n)))) < 4.0
    finally:
        process.kill()
        process.wait()


class FakeRotctld(threading.Thread):
    """Answers as rotctld does, refuses now and then, and keeps every command."""

    def __init__(self) -> None:
        super().__init__(daemon=True)
        self.server = socket.create_server(("127.0.0.1", 0))
        self.port = self.server.getsockname()[1]
        self.commands: list[tuple[float, float]] = []
        self.at = (10.0, 20.0)

    def run(self) -> None:
        try:
            peer, _ = self.server.accept()
        except OSError:
            return
        with peer, peer.makefile() as lines, contextlib.suppress(OSError):
            for line in lines:
                word = line.split()
                if word[0] == "P":
                    self.at = (float(word[1]), float(word[2]))
                    self.commands.append(self.at)
                    peer.sendall(b"RPRT -1\n" if len(self.commands) % 7 == 0 else b"RPRT 0\n")
                else:
                    peer.sendall(f"{self.at[0]:.2f}\n{self.at[1]:.2f}\n".encode())


def test_no_command_outside_the_limits_is_ever_sent() -> None:
    """Wild targets, time driven by the test: every command keeps the stops and the slew rate."""
    rng = np.random.default_rng(60)
    deg = math.pi / 180
    mount = Mount((-100 * deg, 100 * deg), (5 * deg, 80 * deg), 7 * deg, 3 * deg)
    fake = FakeRotctld()
    fake.start()
    rotator = Rotator(f"127.0.0.1:{fake.port}", mount, 0.01 * deg, 0.5)
    now = 0.0
    for i in range(400):
        now += 0.25
        wild = rng.choice([np.nan, np.inf, 1e9, -50.0, 0.5, 2.0])
        ahead = np.cumsum(rng.normal(0.0, 0.3, 20)) + rng.uniform(-9, 9), rng.uniform(-2, 2, 20)
        path = (lambda told=ahead: told) if i % 2 else None
        rotator.follow(float(wild if i % 3 else rng.uniform(-4, 4)), float(rng.uniform(-2, 2)), now, path)
        time.sleep(0.001)
    rotator.close()
    fake.join(2.0)
    fake.server.close()
    assert len(fake.commands) > 50
    sent = np.array(fake.commands)
    assert (sent[:, 0] >= -100.0).all()
    assert (sent[:, 0] <= 100.0).all()
    assert (sent[:, 1] >= 5.0).all()
    assert (sent[:, 1] <= 80.0).all()
    # commands are at least 0.5 s apart; one that waited for an answer may be up to 5 s of slewing
    assert np.abs(np.diff(sent[:, 0])).max() <= 7.0 * 5.0 + 1e-3
    assert rotator.counts["refused"] > 0


def test_inputs_that_cannot_be_are_told(tmp_path: Path) -> None:
    (tmp_path / "s.toml").write_text(SITE.format(port=1, out=2, rotator="").split("[input]")[0], encoding="utf-8")
    station = read_site(tmp_path / "s.toml")
    with pytest.raises(UserError, match=r"no \[input\]"):
        run_live(station, pointer_for(station), 0.1, None)
    with pytest.raises(UserError, match="host:port"):
        Rotator("nowhere", Mount(), 0.1, 1.0)


def test_elements_guide_by_themselves(tmp_path: Path) -> None:
    """No radio at all: a satellite's elements steer the beam, at the elements' own epoch."""
    from boresight.pointing.satellite import look, read_tle, unix_of
    from tests.pointing.test_satellite import SITE as PLACE
    from tests.pointing.test_satellite import tle

    lines = "\n".join(tle("28057"))
    (tmp_path / "sat.tle").write_text("CBERS 2\n" + lines, encoding="utf-8")
    (tmp_path / "site.toml").write_text(
        '[site]\nlatitude_deg = 47.45\nlongitude_deg = 8.56\nheight_m = 430.0\n[dynamics]\nkind = "orbit"\n'
        '[[source]]\nid = "sgp4"\ntle = "sat.tle"\nsatellite = "CBERS 2"\nsigma_position_m = 1000.0\n'
        f'[output]\nudp = "127.0.0.1:{(port := free_port())}"\n',
        encoding="utf-8",
    )
    station = read_site(tmp_path / "site.toml")
    (one,) = read_tle(lines, "x")
    epoch = unix_of(one.record.jdsatepoch, one.record.jdsatepochF)
    offset = epoch - time.time()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as listener:
        listener.bind(("127.0.0.1", port))
        run_live(station, pointer_for(station), 6.0, None, clock=lambda: time.time() + offset)
        listener.setblocking(False)
        rows = []
        with contextlib.suppress(BlockingIOError):
            while True:
                rows.append(json.loads(listener.recv(4096)))
    last = rows[-1]
    azimuth, elevation, _ = look(one, [last["t_aim_s"]], PLACE)
    assert abs(math.remainder(last["az_deg"] - math.degrees(azimuth[0]), 360.0)) < 0.3
    assert abs(last["el_deg"] - math.degrees(elevation[0])) < 0.3
