"""The live service under load: sensors' reports over loopback, log on, tracks out.

`python -m benchmarks.live` sends what 30 radars see of 4,000 targets, 2,000 reports a second, for a minute, then ten
times as much for ten seconds, then the load of before (`--overload`). It prints what the service tells at its end.
`--kills 20` kills it at random moments and resumes it; `--memory --seconds 3600` takes an hour of load at full speed.
"""

from __future__ import annotations

import argparse
import json
import math
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np

RADARS, TARGETS, PERIOD, SEEN_BY = 30, 4000, 4.0, 2
AREA = 60e3  # m
SPEED = 15.0  # m/s
HEAD = """name = "load"
dimensions = 2
[site]
latitude_deg = 47.0
longitude_deg = 8.0
[tracker]
process_noise_m2_s3 = 0.05
speed_sigma_m_s = 10.0
birth_rate = 1e-10
[output]
udp = "127.0.0.1:{out}"
[input]
{kind} = "127.0.0.1:{port}"
"""
RADAR = """[[sensor]]
id = "r{i}"
kind = "radar"
sigma_range_m = 20.0
sigma_azimuth_deg = 0.3
p_detection = 0.95
clutter_per_scan = 1.0
period_s = {period}
position = {{ east_m = {e:.1f}, north_m = {n:.1f}, up_m = 0.0 }}
coverage = {{ range_m = [0.0, {reach:.1f}] }}
"""


class Scene:
    """Targets on straight lines in a square, each turned back at its edge; radars that see the nearest of them."""

    def __init__(self, rng: np.random.Generator, targets: int, radars: int) -> None:
        self.rng, self.radars = rng, radars
        self.p = rng.uniform(-0.5 * AREA, 0.5 * AREA, (targets, 2))
        course = rng.uniform(0.0, 2.0 * math.pi, targets)
        self.v = SPEED * np.stack([np.sin(course), np.cos(course)], axis=1)
        self.at = rng.uniform(-0.45 * AREA, 0.45 * AREA, (radars, 2))
        self.reach = math.sqrt(SEEN_BY / radars / math.pi) * AREA

    def held(self, rows: dict[int, tuple[float, float, float]], t0: float) -> tuple[dict[int, int], float]:
        """Return the track number by target of lines, and the share of the lines that are no target's."""
        out, false = {}, 0
        for number, (t, e, n) in list(rows.items()):
            far = np.hypot(*(self.p + (t - t0) * self.v - [e, n]).T)
            i = int(np.argmin(far))
            if far[i] < 200.0:
                out[i] = number
            else:
                false += 1
        return out, false / max(len(rows), 1)

    def site(self, port: int, out: int, kind: str) -> str:
        sensors = [
            RADAR.format(i=i, e=e, n=n, reach=self.reach, period=PERIOD) for i, (e, n) in enumerate(self.at.tolist())
        ]
        return HEAD.format(port=port, out=out, kind=kind) + "".join(sensors)

    def look(self, radar: int, t: float, t0: float, repeat: int) -> list[bytes]:
        """Return a turn of one radar at `t` (s) as lines; `repeat` gives it several times, moved aside."""
        p = self.p + (t - t0) * self.v - self.at[radar]
        far = np.hypot(p[:, 0], p[:, 1])
        seen = np.flatnonzero((far < self.reach) & (self.rng.random(len(far)) < 0.95))
        lines = []
        for k in range(repeat):
            r = far[seen] + 20.0 * self.rng.standard_normal(len(seen)) + 150.0 * k
            azimuth = np.degrees(np.arctan2(p[seen, 0], p[seen, 1])) + 0.3 * self.rng.standard_normal(len(seen))
            found = [{"range_m": round(a, 1), "azimuth_deg": round(b, 4)} for a, b in zip(r, azimuth, strict=True)]
            row = {"sensor": f"r{radar}", "t_s": t + 1e-4 * k, "detections": found}
            lines.append(json.dumps(row, separators=(",", ":")).encode() + b"\n")
        return lines


def free_port(kind: int) -> int:
    """Return a port that is free."""
    with socket.socket(socket.AF_INET, kind) as s:
        s.bind(("127.0.0.1", 0))
        return int(s.getsockname()[1])


class Listener(threading.Thread):
    """Counts what the service sends, and keeps the newest line of each track."""

    def __init__(self, port: int) -> None:
        super().__init__(daemon=True)
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 8 << 20)
        self.socket.bind(("127.0.0.1", port))
        self.lines = 0
        self.rows: dict[int, tuple[float, float, float]] = {}  # by number: time, east, north of the newest line

    def run(self) -> None:
        while True:
            data = self.socket.recv(1 << 16)
            lines = data.splitlines()
            self.lines += len(lines)
            for one in map(json.loads, lines):
                self.rows[one["track_id"]] = one["t_s"], one["east_m"], one["north_m"]


def run(scene: Scene, seconds: list[tuple[float, int]], folder: Path) -> dict[str, Any]:
    """Run the service under a load of (seconds, times as much); returns what it told and what was heard of it."""
    port, out = free_port(socket.SOCK_DGRAM), free_port(socket.SOCK_DGRAM)
    (folder / "site.toml").write_text(scene.site(port, out, "udp"), encoding="utf-8")
    listener = Listener(out)
    listener.start()
    command = [sys.executable, "-m", "boresight", "serve", str(folder / "site.toml"), "--log", str(folder / "log")]
    process = subprocess.Popen(
        [*command, "--json", "--force"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stderr is not None
    while "listening" not in (told_line := process.stderr.readline()):
        if not told_line:
            raise SystemExit("the service did not start")
    threading.Thread(target=process.stderr.read, daemon=True).start()
    t0 = time.time()
    sent = lines = 0
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as s:
        s.connect(("127.0.0.1", port))
        k, until = 0, t0
        for length, repeat in seconds:
            until += length
            while True:
                due = t0 + PERIOD * k / scene.radars
                if due > until:
                    break
                time.sleep(max(due - time.time(), 0.0))
                for line in scene.look(k % scene.radars, time.time(), t0, repeat):
                    s.send(line)
                    sent += line.count(b"range_m")
                    lines += 1
                k += 1
    time.sleep(2.0)
    process.send_signal(signal.SIGTERM)
    told = json.loads(process.communicate(timeout=60)[0])["rows"][0]
    return {
        "load": " + ".join(f"{length:g} s x {repeat}" for length, repeat in seconds),
        "reports_sent": sent,
        "reports_taken": told["reports"],
        "lines_sent": lines,
        "lines_lost": sum(sum(v.values()) for v in told["lost"].values()),
        "tracks_shown": told["tracks_shown"],
        "core_share": told["core_share"],
        "latency_p50_ms": 1e3 * told["latency_p50_s"],
        "latency_p99_ms": 1e3 * told["latency_p99_s"],
        "latency_max_ms": 1e3 * told["latency_max_s"],
        "memory_mb": told["memory_mb"],
        "lines_out": told["lines_out"],
        "lines_heard": listener.lines,
    }


def kills(scene: Scene, times: int, folder: Path) -> dict[str, Any]:
    """Kill the service with SIGKILL at random moments under the load, and start it again each time."""
    port, out = free_port(socket.SOCK_DGRAM), free_port(socket.SOCK_DGRAM)
    text = scene.site(port, out, "udp") + "[log]\nstate_s = 2.0\n"
    (folder / "site.toml").write_text(text, encoding="utf-8")
    listener = Listener(out)
    listener.start()
    halt = threading.Event()
    t0 = time.time()

    def send() -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as s:
            k = 0
            while not halt.wait(max(t0 + PERIOD * k / scene.radars - time.time(), 0.0)):
                for line in scene.look(k % scene.radars, time.time(), t0, 1):
                    s.sendto(line, ("127.0.0.1", port))
                k += 1

    command = [sys.executable, "-m", "boresight", "serve", str(folder / "site.toml"), "--log", str(folder / "log")]
    restarts: list[float] = []
    same: list[float] = []
    false: tuple[list[float], list[float]] = ([], [])
    cut = 0
    before: dict[int, int] = {}
    thread = threading.Thread(target=send, daemon=True)
    for k in range(times + 1):
        begun = time.monotonic()
        process = subprocess.Popen(
            [*command, "--json", "--resume" if k else "--force"],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        assert process.stderr is not None
        said: list[str] = []
        while "listening" not in (line := process.stderr.readline()):
            if not line:
                raise SystemExit("".join(said))
            said.append(line)
        if k:
            restarts.append(time.monotonic() - begun)
            cut += sum("cut or damaged" in line for line in said)
        else:
            thread.start()
            time.sleep(20.0)
        threading.Thread(target=process.stderr.read, daemon=True).start()
        listener.rows.clear()
        time.sleep(PERIOD + 4.0 * float(scene.rng.random()))
        held, wrong = scene.held(listener.rows, t0)
        both = [i for i in held if i in before]
        if k:
            same.append(sum(held[i] == before[i] for i in both) / max(len(both), 1))
        false[min(k, 1)].append(wrong)
        before = held
        if k < times:
            process.kill()
            process.wait()
    process.send_signal(signal.SIGTERM)
    told = json.loads(process.communicate(timeout=60)[0])["rows"][0]
    halt.set()
    return {
        "kills": times,
        "restart_median_s": float(np.median(restarts)),
        "restart_longest_s": max(restarts),
        "logs_cut": cut,
        "same_number_after": float(np.mean(same)),
        "false_share_before": float(np.mean(false[0])),
        "false_share_after": float(np.mean(false[1])),
        "tracks_shown": told["tracks_shown"],
        "numbers_given": told["tracks"],
        "targets": len(scene.p),
        "log_errors": told["log"]["errors"],
    }


def hour(scene: Scene, seconds: float) -> dict[str, Any]:
    """Take the load of so many seconds through the service's own parts, as fast as they go; memory along the way."""
    import itertools

    from boresight.config.serve import service_of
    from boresight.engine.loop import Tick
    from boresight.service.serve import memory, parts_of
    from boresight.service.tracklines import TrackLines

    service = service_of(scene.site(1, 2, "udp"), "site.toml", Path())
    parts = parts_of(service)
    state = parts.tracking.init()
    lines = TrackLines([], service.declaration.site, 1.0, lambda: now, parts.decoder.ids)
    looks = int(seconds * scene.radars / PERIOD)
    used, now, begun = [], 0.0, time.perf_counter()
    for k in range(looks):
        now = 1e9 + PERIOD * k / scene.radars
        scene.p = np.where(np.abs(p := scene.p) > 0.5 * AREA, -np.sign(p) * 0.5 * AREA, p)  # round the edge
        items = itertools.chain.from_iterable(
            parts.decoder.decode(line, now) for line in scene.look(k % scene.radars, now, now, 1)
        )
        state, out = parts.tracking.step(state, [*items, Tick(now + 0.01)])
        lines.take(out)
        parts.decoder.duplicates.clear()
        scene.p = scene.p + PERIOD / scene.radars * scene.v
        if k % max(looks // 20, 1) == 0:
            used.append(memory())
    return {
        "simulated_s": seconds,
        "reports": parts.decoder.rows,
        "times_real_time": seconds / (time.perf_counter() - begun),
        "memory_mb": [round(m) for m in used],
        "tracks": int(state.tracker.window.tracks.live[0]),
    }


def main() -> None:
    """Run the loads and print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--overload", action="store_true", help="ten times the load for ten seconds, in between")
    parser.add_argument("--kills", type=int, default=0, help="kill and resume the service so many times instead")
    parser.add_argument("--memory", action="store_true", help="no sockets: --seconds of load as fast as it goes")
    parser.add_argument("--targets", type=int, default=TARGETS)
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    scene = Scene(np.random.default_rng(7), options.targets, RADARS)
    loads = [(options.seconds, 1)]
    if options.overload:
        loads += [(10.0, 10), (20.0, 1)]
    with tempfile.TemporaryDirectory() as folder:
        if options.kills:
            row = kills(scene, options.kills, Path(folder))
        elif options.memory:
            row = hour(scene, options.seconds)
        else:
            row = run(scene, loads, Path(folder))
    if options.json:
        print(json.dumps(row))
    else:
        for key, value in row.items():
            print(f"{key:>16}  {value:.4g}" if isinstance(value, float) else f"{key:>16}  {value}")


if __name__ == "__main__":
    main()
