"""Live pointing against its log, against clocks that are wrong and senders that are silent."""

from __future__ import annotations

import contextlib
import json
import math
import socket
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from boresight.config.site import pointer_for, read_site
from boresight.engine.guide import Guiding
from boresight.engine.loop import Item, Tick
from boresight.io.livelog import LogReader, LogTable, create_log
from boresight.service.commands import encode
from boresight.service.feed import Feed, Stand
from boresight.service.live import replay_log, run_live
from boresight.service.sockets import Tcp
from boresight.service.source import LiveSource
from tests.service.test_live import SITE, Sender, free_port, target


def test_the_log_of_a_run_gives_the_same_commands(tmp_path: Path) -> None:
    port, out = free_port(), free_port()
    text = SITE.format(port=port, out=out, rotator="")
    (tmp_path / "site.toml").write_text(text, encoding="utf-8")
    station = read_site(tmp_path / "site.toml")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as listener:
        listener.bind(("127.0.0.1", out))
        listener.setblocking(False)
        log = create_log(tmp_path / "log", text, "", LogTable())
        sender = Sender(port, time.time())
        sender.start()
        counts = run_live(station, pointer_for(station), 3.0, None, log=log)
        sender.halt.set()
        sender.join()
        sent = []
        with contextlib.suppress(BlockingIOError):
            while True:
                sent.append(listener.recv(4096))
    assert counts["accepted"] > 30
    again = [encode(p) for p, _ in replay_log(station, pointer_for(station), LogReader(tmp_path / "log"))]
    assert len(sent) > 30
    assert again[: len(sent)] == sent  # every byte of every command
    assert len(again) - len(sent) <= 1


def run_chain(tmp_path: Path, ahead: dict[str, float], seconds: float = 40.0) -> tuple[list[float], Feed]:
    """Return the beam's errors (degrees) of the last half, with sources whose clocks are `ahead` (s); time is given."""
    (tmp_path / "site.toml").write_text(SITE.format(port=1, out=2, rotator=""), encoding="utf-8")
    pointer = pointer_for(read_site(tmp_path / "site.toml"))
    feed = Feed(pointer, {s.id: Stand() for s in pointer.guide.sources})
    guiding = Guiding(pointer, 20.0)
    state = guiding.init()
    rng = np.random.default_rng(8)
    errors = []
    for k in range(int(20 * seconds)):
        now = 1e9 + 0.05 * k
        items: list[Item] = []
        if k % 2 == 0:
            for name, sigma in (("a", 0.02), ("b", 0.02)):
                stamp = now - rng.uniform(0.001, 0.01)
                e, n, u = target(stamp - 1e9)
                row: dict[str, Any] = {"source": name, "t_s": stamp + ahead.get(name, 0.0)}
                row["azimuth_deg"] = math.degrees(math.atan2(e, n)) + sigma * rng.normal()
                row["elevation_deg"] = math.degrees(math.atan2(u, math.hypot(e, n))) + sigma * rng.normal()
                row["range_m"] = float(np.linalg.norm([e, n, u]))
                items += feed.decode(json.dumps(row).encode(), now)
        state, out = guiding.step(state, [*items, Tick(now)])
        for p in out.pointings:
            if p.t > 1e9 + seconds / 2:
                e, n, u = target(p.t_aim - 1e9)
                east, north, up = p.aim.direction
                cosine = (east * e + north * n + up * u) / math.sqrt(e * e + n * n + u * u)
                errors.append(math.degrees(math.acos(min(cosine, 1.0))))
    return errors, feed


@pytest.mark.parametrize("ahead", [{}, {"b": 2.0}, {"b": 4.6}, {"a": 5.0}, {"a": 3.0, "b": 3.0}])
def test_a_source_with_its_clock_ahead_does_not_pull_the_beam_away(tmp_path: Path, ahead: dict[str, float]) -> None:
    errors, feed = run_chain(tmp_path, ahead)
    assert len(errors) > 300
    assert max(errors) < 0.1
    for name in ("a", "b"):
        told = feed.health[name].words()
        assert told == (f"clock ahead by {ahead[name]:.1f} s" if name in ahead else "")


@pytest.mark.slow
def test_five_hundred_silent_senders_cost_nothing_and_the_next_is_served() -> None:
    class Lines:
        def __init__(self) -> None:
            self.got: list[bytes] = []

        def decode(self, data: bytes, now: float) -> list[Item]:
            self.got.append(data)
            return []

    tcp, lines, done = Tcp("127.0.0.1:0"), Lines(), threading.Event()
    source = LiveSource([tcp], [lines], time.time, 20.0, stop=done.is_set)
    where = tcp.server.getsockname()
    spent: list[float] = []

    def loop() -> None:
        begun, cpu = time.monotonic(), time.thread_time()
        for _ in source:
            pass
        spent.append((time.thread_time() - cpu) / (time.monotonic() - begun))

    thread = threading.Thread(target=loop)
    thread.start()
    try:
        with contextlib.ExitStack() as silent:
            for _ in range(500):
                silent.enter_context(socket.create_connection(where, 5.0))
            with socket.create_connection(where, 5.0) as speaks:
                for k in range(30):
                    speaks.sendall(b"line %d\n" % k)
                    time.sleep(0.1)
                for _ in range(100):
                    if len(lines.got) == 30:
                        break
                    time.sleep(0.05)
                assert len(lines.got) == 30
                assert len(tcp.peers) == 501
    finally:
        done.set()
        thread.join()
        tcp.close()
    assert spent[0] <= 0.05
