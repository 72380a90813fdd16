"""The tracker live: what is sent, logged, replayed and tracked as a file is one and the same, and no fault stops it."""

from __future__ import annotations

import contextlib
import errno
import json
import math
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from boresight.cli.send import lines_of, moved
from boresight.config.serve import Service, service_of
from boresight.door import track
from boresight.engine.loop import Tick
from boresight.errors import UserError
from boresight.io.declaration import Declaration, write_declaration
from boresight.io.livelog import HEADER, Kind, LogReader, LogTable, create_log, resume_log
from boresight.io.recording import read_recording, write_recording
from boresight.service import sockets
from boresight.service.clock import Clock
from boresight.service.restart import load_state
from boresight.service.serve import parts_of, serve
from boresight.service.sockets import Broadcast, UdpOut
from boresight.tracking.config import TrackerConfig
from boresight.types import DecisionRows, Recording, TrackRows
from tests.service.test_live import free_port
from tests.tracking.conftest import make_recording


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    """As it comes from files: angles are numbers of degrees. The last radar look is given twice."""
    made = make_recording(duration=40.0)
    d = made.detections
    twice = np.concatenate([np.arange(len(d)), np.flatnonzero(d.scan == d.scan[d.sensor == 0].max())])
    d = replace(d, **{f.name: getattr(d, f.name)[twice] for f in fields(d) if f.name in ARRAYS})
    d = replace(d, t_recv=np.maximum.accumulate(d.t_recv))
    folder = tmp_path_factory.mktemp("recorded") / "rec"
    write_recording(replace(made, detections=d, duplicates=np.zeros(len(d), bool)), folder)
    return read_recording(folder)


ARRAYS = ("t", "t_recv", "sensor", "scan", "z", "sigma")


def site_of(recording: Recording, more: str) -> str:
    about = Declaration(recording.name, recording.dimensions, recording.site, recording.sensors)
    return write_declaration(about) + more


def service(recording: Recording, port: int, more: str = "", arrival: str = "recorded") -> Service:
    text = site_of(recording, f'\n[input]\nudp = "127.0.0.1:{port}"\narrival = "{arrival}"\n{more}')
    return service_of(text, "site.toml", Path())


def encoded(recording: Recording, shift: float | None = None) -> list[bytes]:
    rows = (row if shift is None else moved(row, shift) for _, row in lines_of(recording))
    return [msgspec.json.encode(row) + b"\n" for row in rows]


class Sender(threading.Thread):
    """Sends lines, some in one datagram, then says that it is done."""

    def __init__(self, port: int, lines: list[bytes], together: int = 3) -> None:
        super().__init__(daemon=True)
        self.port, self.lines, self.together = port, lines, together
        self.done = math.inf

    def run(self) -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as s:
            for k in range(0, len(self.lines), self.together):
                s.sendto(b"".join(self.lines[k : k + self.together]), ("127.0.0.1", self.port))
                if k % 60 == 0:
                    time.sleep(0.002)
        self.done = time.monotonic()

    def over(self) -> bool:
        return time.monotonic() > self.done + 0.4


def same(a: TrackRows, b: TrackRows) -> None:
    for f in fields(TrackRows):
        np.testing.assert_array_equal(getattr(a, f.name), getattr(b, f.name))


def same_decisions(a: DecisionRows, b: DecisionRows) -> None:
    for name in ("row", "fate", "track_id", "nis", "reason"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name))


def test_live_log_and_file_give_the_same_bits(recording: Recording, tmp_path: Path) -> None:
    port = free_port()
    one = service(recording, port)
    log = create_log(tmp_path / "log", one.text, one.settings, one.logged)
    (tmp_path / "work").mkdir()
    lines = encoded(recording)
    again = [line for line in lines if b'"radar"' in line and b"range_m" in line][-1]
    sender = Sender(port, [*lines, again])  # the network gives one look twice
    told, serving, state = serve(
        one, log=log, results=tmp_path / "work", stop=sender.over, ready=lambda _: sender.start(), duration=60.0
    )
    assert told["lost"] == {}
    twice = again.count(b"range_m")
    assert twice > 0
    assert told["reports"] == int((~recording.duplicates).sum()) + twice  # `send` leaves the duplicates out
    assert serving.results is not None
    rows, fates = serving.results.tables(state, serving.parts.decoder.rows, serving.duplicates)
    replayed = read_recording(tmp_path / "log")
    from_log = track(replayed, TrackerConfig())
    same(rows, from_log.tracks)
    same_decisions(fates, from_log.decisions)
    assert len(np.unique(rows.track_id)) >= 2
    same(rows, track(recording, TrackerConfig()).tracks)
    assert int(replayed.duplicates.sum()) == twice
    write_recording(replayed, tmp_path / "exported")
    exported = track(read_recording(tmp_path / "exported"), TrackerConfig())
    same(rows, exported.tracks)
    same_decisions(fates, exported.decisions)


def test_ticks_change_nothing_and_rows_after_the_last_arrival_belong_to_no_run(recording: Recording) -> None:
    """Whatever the moments at which the rows due are asked for: the rows are those of the file."""
    parts = parts_of(service(recording, 1))
    state = parts.tracking.init()
    rng = np.random.default_rng(5)
    rows, clock = [], -math.inf
    for line in encoded(recording):
        items: list[Any] = list(parts.decoder.decode(line, 0.0))
        arrival = parts.decoder.arrival
        while clock < arrival - 1e-3:  # as the loop does: only times at which nothing later has come
            clock = max(clock, arrival - 1.0) + rng.uniform(0.0, 0.3)
            if clock < arrival:
                state, out = parts.tracking.step(state, [Tick(clock)])
                rows += out.rows
        state, out = parts.tracking.step(state, items)
        rows += out.rows
    last = state.tracker.arrival
    for t in (last + 0.2, last + 3.0, last + 9.0):  # nobody reports any more
        state, out = parts.tracking.step(state, [Tick(t)])
        rows += out.rows
    state, out = parts.tracking.finish(state)
    rows += out.rows
    from boresight.tracking.run import track_rows

    made = track_rows(rows)
    assert (made.t_known > last).any()
    kept = made.t_known <= last
    mine = TrackRows(**{f.name: getattr(made, f.name)[kept] for f in fields(TrackRows)})
    results = track(recording, TrackerConfig())
    same(mine, results.tracks)
    assert state.tracker.names.given == results.summary["counts"]["tracks"]


def test_duplicates_late_navigation_and_nonsense_are_counted_by_source(recording: Recording) -> None:
    parts = parts_of(service(recording, 1, arrival="clock"))
    decode, health = parts.decoder.decode, parts.decoder.health
    look = {"sensor": "radar", "t_s": 100.0, "detections": [{"range_m": 300.0, "azimuth_deg": 10.0}]}

    def give(now: float, **change: Any) -> int:
        return len(decode(json.dumps({**look, **change}).encode(), now))

    assert give(100.1) == 1
    assert give(100.2) == 0  # the same again
    assert health["radar"].counts == {"accepted": 2, "duplicate_rows": 1}
    assert give(100.3, detections=[]) == 1
    assert give(100.3, detections=[]) == 0
    nav = {"platform": "ferry", "t_s": 100.0, "east_m": 1.0, "north_m": 2.0}
    assert len(decode(json.dumps(nav).encode(), 100.1)) == 1
    assert len(decode(json.dumps(nav).encode(), 100.2)) == 0
    assert health["ferry"].counts["late_navigation"] == 1
    for change, reason in (
        ({"detections": [{"range_m": -1.0, "azimuth_deg": 3.0}]}, "bad_value"),
        ({"detections": [{"range_m": 1.0, "azimuth_deg": 361.0}]}, "bad_value"),
        ({"detections": [{}]}, "bad_value"),
        ({"detections": [{"range_m": 1.0, "azimuth_deg": 3.0, "range_rate_m_s": 3.0}]}, "bad_value"),  # no noise
        ({"detections": [{"range_m": 1.0, "azimuth_deg": 3.0, "sigma_range_m": 0.0}]}, "bad_value"),
        ({"detections": [{"range_m": 1.0, "azimuth_deg": 3.0, "covariance": [1.0, 2.0, 1.0]}]}, "bad_value"),
        ({"detections": [{"range_m": 1.0, "azimuth_deg": 511.0}]}, "not_available"),
        ({"detections": [{"latitude_deg": 1.0, "longitude_deg": 3.0}]}, "bad_value"),  # not in its axes
        ({"t_s": 50.0}, "bad_time"),
        ({"t_s": 1e18}, "bad_time"),
        ({"t_s": 102.0}, "clock_ahead"),
    ):
        before = health["radar"].counts[reason]
        assert give(100.5, **change) == 0
        assert health["radar"].counts[reason] == before + 1, change
        assert health["radar"].why[reason]
    rows = parts.decoder.rows
    for data in (b"{", b"[]", b'{"t_s": 1.0}', b'{"sensor": "nobody", "t_s": 1.0}', b"\xff", b"[" * 5000):
        assert decode(data, 100.6) == []
    assert health["?"].counts.total() == 6
    assert parts.decoder.rows == rows  # what was refused has no row


def test_a_log_cut_anywhere_gives_what_was_before(recording: Recording, tmp_path: Path) -> None:
    one = service(recording, 1)
    folder = tmp_path / "log"
    log = create_log(folder, one.text, one.settings, one.logged)
    lines = encoded(recording)[:200]

    for k, line in enumerate(lines):
        log.append(Kind.TAKEN, 0, float(k), line)
    log.close(0.0)
    path = next(folder.glob("*.bslog"))
    whole = path.read_bytes()
    assert [r.data for r in LogReader(folder)] == lines
    rng = np.random.default_rng(3)
    for cut in [*rng.integers(8, len(whole), 40).tolist(), len(whole) - 1]:
        path.write_bytes(whole[:cut])
        reader = LogReader(folder)
        found = [r.data for r in reader]
        assert found == lines[: len(found)]
        ends = np.cumsum([len(line) + HEADER.size for line in lines]) + 8
        assert len(found) == int((ends <= cut).sum())
        assert bool(reader.damage) == (cut not in (8, *ends.tolist()))
    for at in rng.integers(8, len(whole), 40).tolist():  # a flipped bit ends it there
        path.write_bytes(whole[:at] + bytes([whole[at] ^ 0x10]) + whole[at + 1 :])
        reader = LogReader(folder)
        found = [r.data for r in reader]
        assert found == lines[: len(found)]
        assert len(found) == int((ends <= at).sum())
        assert reader.damage
    path.write_bytes(whole)
    more = resume_log(folder)  # what a later run adds stands in a segment of its own
    more.append(Kind.TAKEN, 0, 1e3, b"later")
    more.close(0.0)
    assert [r.data for r in LogReader(folder)] == [*lines, b"later"]


def test_a_full_disk_stops_nothing_and_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from boresight.io import livelog

    log = create_log(tmp_path / "log", "x = 1\n", "", LogTable())
    log.append(Kind.TAKEN, 0, 1.0, b"before")
    log.flush(0.0)
    real = os.write

    def full(file: int, data: Any) -> int:
        real(file, bytes(data)[:7])  # a part gets on to it
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(livelog.os, "write", full)
    log.append(Kind.TAKEN, 0, 2.0, b"while it is full")
    for now in (1.0, 1.5, 2.5):
        log.flush(now)
    assert log.errors == 2  # tried again a second later, not at once
    assert "no space left" in log.error
    monkeypatch.setattr(livelog.os, "write", real)
    log.append(Kind.TAKEN, 0, 3.0, b"after")
    log.flush(4.0)
    assert not log.error
    log.close(5.0)
    reader = LogReader(tmp_path / "log")
    assert [r.data for r in reader] == [b"before", b"while it is full", b"after"]
    assert not reader.damage
    assert log.lost == 0
    monkeypatch.setattr(livelog, "MOST_WAITING", 1000)
    monkeypatch.setattr(livelog.os, "write", full)
    for _ in range(100):
        log.append(Kind.TAKEN, 0, 4.0, b"x" * 50)
        log.flush(10.0)
    assert log.lost > 80  # memory is bounded, and what is given up counted


def test_a_run_goes_on_from_its_saved_state_bit_for_bit(recording: Recording, tmp_path: Path) -> None:
    """State saved in the middle, the rest of the log replayed: the same state as without, and as the straight run."""
    one = service(recording, 1)
    lines = encoded(recording)
    from boresight.service.restart import StateFile
    from boresight.service.serve import _restored

    straight = parts_of(one)
    log = create_log(tmp_path / "log", one.text, one.settings, one.logged)
    state = straight.tracking.init()
    for k, line in enumerate(lines):
        log.append(Kind.TAKEN, 0, 0.0, line)
        state, _ = straight.tracking.step(state, [*straight.decoder.decode(line, 0.0), Tick(straight.decoder.arrival)])
        log.append(Kind.TICK, 0, straight.decoder.arrival)
        if k == len(lines) // 2:
            log.flush(0.0)
            others = {"decoder": straight.decoder.saved(), "poses": straight.poses.saved()}
            StateFile(tmp_path / "log").save(state.tracker, log.place, others, wait=True)
    log.close(0.0)
    from boresight.tracking.saved import arrays_of_state

    whole = arrays_of_state(state.tracker)
    for _ in range(2):
        again = parts_of(one)
        back = _restored(again, log, None)
        assert back is not None
        found = arrays_of_state(back.tracker)
        assert found.keys() == whole.keys()
        for name, array in whole.items():
            np.testing.assert_array_equal(found[name], array, err_msg=name)
        assert again.decoder.rows == straight.decoder.rows
        (tmp_path / "log" / "state.npz").unlink(missing_ok=True)  # the second time from the beginning of the log
    (tmp_path / "log" / "state.npz").write_bytes(b"PK\x03\x04 not a state")
    with pytest.raises(UserError, match="damaged"):
        load_state(tmp_path / "log", straight.tracker)


@pytest.mark.parametrize("code", [errno.EPERM, errno.ENETUNREACH, errno.EHOSTUNREACH])
def test_outputs_that_the_network_refuses_are_counted(code: int, monkeypatch: pytest.MonkeyPatch) -> None:
    out = UdpOut("127.0.0.1:9")

    class Refusing(socket.socket):
        def sendto(self, *_: Any) -> int:
            raise OSError(code, os.strerror(code))

    monkeypatch.setattr(sockets.socket, "socket", Refusing)
    out.send([b"a\n", b"b\n"], 0.0)
    assert out.counts == {"sent": 0, "failed": 2}
    assert out.error == os.strerror(code)
    monkeypatch.undo()
    out.close()
    out.send([b"c\n"], 1.0)
    assert out.counts == {"sent": 1, "failed": 2}
    assert not out.error
    out.close()


def test_a_name_that_cannot_be_resolved_stops_nobody(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = threading.Event()

    def slow(*_: Any, **__: Any) -> Any:
        asked.set()
        raise socket.gaierror(-2, "Name or service not known")

    monkeypatch.setattr(sockets.socket, "getaddrinfo", slow)
    out = UdpOut("nowhere.invalid:9000")
    begun = time.perf_counter()
    out.send([b"a\n"], 0.0)
    assert time.perf_counter() - begun < 0.5
    assert asked.wait(5.0)
    assert out.host._thread is not None
    out.host._thread.join(5.0)
    out.send([b"b\n"], 0.5)
    assert out.counts["failed"] == 2
    assert "not known" in out.error
    monkeypatch.setattr(sockets.socket, "getaddrinfo", lambda *_, **__: [(socket.AF_INET, 2, 17, "", ("127.0.0.1", 9))])
    out.send([b"c\n"], 12.0)  # asked for again
    out.host._thread.join(5.0)
    out.send([b"d\n"], 12.5)
    assert out.counts["sent"] >= 1
    out.close()


def test_a_receiver_that_stops_reading_goes_and_the_others_stay() -> None:
    out = Broadcast("127.0.0.1:0")
    where = out.server.getsockname()
    with socket.create_connection(where) as deaf, socket.create_connection(where) as half:
        half.shutdown(socket.SHUT_WR)  # it says nothing more, and goes on reading
        got = bytearray()
        line = b"x" * 1000 + b"\n"
        for _ in range(12_000):
            out.send([line])
            half.setblocking(False)
            with contextlib.suppress(BlockingIOError):
                got += half.recv(1 << 20)
            if out.counts["receivers_closed"]:
                break
        assert out.counts["receivers_closed"] == 1
        assert len(out.peers) == 1
        assert len(got) > 500_000
        deaf.close()
    out.close()


def test_the_clock_goes_on_when_the_wall_clock_steps() -> None:
    wall, mono = [1e9], [50.0]
    clock = Clock(lambda: wall[0], lambda: mono[0])
    assert clock() == 1e9
    for step in (5.0, -5.0, 3600.0, -3600.0):
        before = clock()
        wall[0] += step
        assert f"{step:+.1f} s" in clock.stepped()
        assert clock() == before
        assert clock.stepped() == ""  # told once
        wall[0] += 1.0
        mono[0] += 1.0
        assert clock() == pytest.approx(before + 1.0)
    wall[0] += 0.1  # led after, slowly: at most 200 µs a second
    assert clock.stepped() == ""
    mono[0] += 10.0
    wall[0] += 10.0
    before = clock()
    clock.stepped()
    assert 0.0 < clock() - before <= 2.1e-3


def test_a_source_ahead_of_its_arrival_is_named_and_taken_at_its_arrival() -> None:
    from boresight.io.arrivals import SourceHealth

    rng = np.random.default_rng(0)
    health = SourceHealth()
    now, taken, true = 1000.0, [], []
    for k in range(200):
        now += 0.1
        delay = rng.uniform(0.002, 0.02)
        got = health.admit(now - delay + 4.6, now)
        if not isinstance(got, str):
            taken.append(got)
            true.append(now - delay)
        if k == 50:
            assert health.words() == "clock ahead by 4.6 s"
    assert len(taken) == 198  # two are not enough to tell a clock from a wild stamp
    error = np.array(taken) - np.array(true)
    assert np.abs(error).max() < 0.02
    good = [health.admit(now + 0.1 * k - 0.01, now + 0.1 * k) for k in range(1, 8)]
    assert [isinstance(g, str) for g in good[:3]] == [True, True, False]  # set right again
    assert health.ahead == 0.0
    wild = SourceHealth()
    assert wild.admit(1000.0, 1000.0) == 1000.0
    assert wild.admit(1003.0, 1000.1) == "clock_ahead"
    assert wild.admit(1000.2, 1000.2) == 1000.2
    assert wild.admit(2000.0, 1000.3) == "bad_time"


@contextlib.contextmanager
def running(folder: Path, text: str, *more: str) -> Iterator[subprocess.Popen[str]]:
    """Run the command until it listens; kill it at the end if it is still there."""
    (folder / "site.toml").write_text(text, encoding="utf-8")
    command = [sys.executable, "-m", "boresight", "serve", str(folder / "site.toml"), "--json", *more]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        assert process.stderr is not None
        said = []
        while "listening" not in (line := process.stderr.readline()):
            assert line, "".join(said)
            said.append(line)
        process.said = said  # type: ignore[attr-defined]
        threading.Thread(target=process.stderr.read, daemon=True).start()
        yield process
    finally:
        process.kill()
        process.communicate()


def until(condition: Callable[[], bool], seconds: float = 30.0) -> bool:
    """Wait for a condition."""
    begun = time.monotonic()
    while time.monotonic() - begun < seconds:
        if condition():
            return True
        time.sleep(0.02)
    return False


@pytest.mark.slow
def test_after_a_kill_tracks_go_on_under_their_numbers(recording: Recording, tmp_path: Path) -> None:
    """Killed in the middle of the reports, then resumed, then told to end: exit 0, counts, the same tracks."""
    port, out = free_port(), free_port()
    more = f'\n[input]\nudp = "127.0.0.1:{port}"\n[output]\nudp = "127.0.0.1:{out}"\n[log]\nstate_s = 1.0\n'
    text = site_of(recording, more)
    listener = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    listener.bind(("127.0.0.1", out))
    listener.setblocking(False)
    heard: list[dict[str, Any]] = []

    def listen() -> None:
        with contextlib.suppress(BlockingIOError):
            while True:
                heard.extend(json.loads(line) for line in listener.recv(1 << 16).splitlines())

    halt = threading.Event()

    def send() -> None:
        begun = time.time()
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as s:
            shift = begun + 2.0
            for t_recv, row in lines_of(recording):
                if halt.wait(max(t_recv + shift - time.time(), 0.0)):
                    return
                s.sendto(msgspec.json.encode(moved(row, shift)), ("127.0.0.1", port))

    sender = threading.Thread(target=send, daemon=True)
    log = ("--log", str(tmp_path / "log"))
    with running(tmp_path, text, *log) as first:
        sender.start()
        assert until(lambda: (listen(), len({r["track_id"] for r in heard}) >= 2)[1])
        time.sleep(1.5)
        first.kill()
        first.wait()
    listen()
    before = {r["track_id"]: r for r in heard}
    heard.clear()
    with running(tmp_path, text, *log, "--resume") as second:
        assert any("goes on from" in line and "without data" in line for line in second.said)  # type: ignore[attr-defined]
        assert until(lambda: (listen(), len({r["track_id"] for r in heard}) >= 2)[1])
        time.sleep(1.0)
        listen()
        second.send_signal(signal.SIGTERM)
        told, _ = second.communicate(timeout=20)
        assert second.returncode == 0
    halt.set()
    counts = json.loads(told)["rows"][0]
    assert counts["sources"]["radar"]["counts"]["accepted"] > 0
    confirmed = {r["track_id"] for r in heard}
    assert confirmed <= set(before)  # none is born of the gap
    assert len(confirmed) == 2
    listener.close()


def test_bad_site_files_are_one_line(recording: Recording) -> None:
    for more, words in (
        ("", r"no \[input\]"),
        ('[input]\nformat = "asterix"\nudp = "127.0.0.1:1"', "format = 'asterix' is not known"),
        ("[input]\nbaud = 4800", "give udp, tcp, serial or listen"),
        ('[input]\nlisten = "127.0.0.1:1"', "listen"),
        ('[[input]]\nudp = ":1"\n[[input]]\nudp = ":2"\narrival = "recorded"', "for all inputs or for none"),
        ('[input]\nudp = ":1"\n[pointing]\nfollow = "third"', "pointing.follow"),
        ('[input]\nudp = ":1"\n[outputs]\n', "did you mean 'output'"),
        ('[input]\nudp = ":1"\n[tracker]\nprocess_noise = 1.0', "process_noise"),
        ('[input]\nudp = "no.such.host.invalid:1"', "input.udp"),
    ):
        with pytest.raises(UserError, match=words):
            serve(service_of(site_of(recording, "\n" + more), "site.toml", Path()), duration=0.0)


def test_the_pointer_follows_a_track_in_the_same_process(recording: Recording) -> None:
    more = '\n[pointing]\nfollow = "nearest"\nbeam = { width_deg = 3.0, rate_hz = 5.0 }\n'
    parts = parts_of(service(recording, 1, more))
    assert parts.chain is not None
    state = parts.chain.init()
    pointings = []
    for line in encoded(recording):
        items: list[Any] = list(parts.decoder.decode(line, 0.0))
        state, out = parts.chain.step(state, [*items, Tick(parts.decoder.arrival)])
        pointings += out.guide.pointings
    late = [p for p in pointings if p.t > 20.0]
    assert len(late) > 80
    held = state.guide.pointer.guide.track
    errors = []
    for p in late:
        places = [np.array([np.interp(p.t_aim, one.t, one.position[:, i]) for i in (0, 1)]) for one in recording.truth]
        azimuths = [math.atan2(q[0], q[1]) for q in places]
        errors.append(min(abs(math.remainder(p.aim.azimuth - a, 2 * math.pi)) for a in azimuths))
    assert held >= 0
    assert np.degrees(np.median(errors)) < 1.5
    assert sum(p.mode == "fused" for p in late) > 0.9 * len(late)


def test_the_example_tracks_a_boat_that_radar_and_ais_report() -> None:
    from boresight.config.serve import read_service

    parts = parts_of(read_service(Path(__file__).parents[2] / "examples" / "serve.toml"))
    assert parts.chain is not None
    state, rng, told = parts.chain.init(), np.random.default_rng(2), []
    site = parts.service.declaration.site
    from boresight.frames.local import geodetic_from_enu

    for k in range(60):
        now = 1e9 + k
        e, n = 900.0 - 6.0 * k, 700.0 + 2.0 * k
        r, azimuth = math.hypot(e, n) + 5.0 * rng.normal(), math.degrees(math.atan2(e, n)) + 0.5 * rng.normal()
        lines = (
            [{"sensor": "radar", "t_s": now, "detections": [{"range_m": r, "azimuth_deg": azimuth}]}] if k % 2 else []
        )
        if k % 6 == 3:
            lat, lon, _ = geodetic_from_enu(e + 10.0 * rng.normal(), n + 10.0 * rng.normal(), 0.0, site)
            place = {"latitude_deg": math.degrees(lat), "longitude_deg": math.degrees(lon)}
            lines.append({"sensor": "ais", "t_s": now, "source_id": "211000001", **place})
        items: list[Any] = [i for line in lines for i in parts.decoder.decode(json.dumps(line).encode(), now + 0.05)]
        state, out = parts.chain.step(state, [*items, Tick(now + 0.1)])
        told += [(rows, k) for rows in out.track.rows]
    rows, k = told[-1]
    assert len(set(rows.track_id.tolist())) == 1
    assert np.hypot(rows.position[-1, 0] - (900.0 - 6.0 * k), rows.position[-1, 1] - (700.0 + 2.0 * k)) < 25.0
    assert out.guide.pointings[-1].mode == "fused"
