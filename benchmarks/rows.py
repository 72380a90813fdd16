"""All rows of the benchmark; importing this and `warm` compile all but the tracker, where that is not cached."""

from __future__ import annotations

import platform
from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import assignment, batch, filters, recording, scoreboard, startup, whole_tracker
from benchmarks.timing import Contenders, Row, row, rows_of, timed
from boresight._version import __version__
from boresight.engine.track import run
from boresight.io.scans import iter_scans
from boresight.study.engine import cores
from boresight.tracking.run import tracker_for
from boresight.tracking.tracker import Tracker
from boresight.tracking.warm import warm_poses
from boresight.types import Scan


def warm(quick: bool) -> None:
    """Call what is not compiled by being imported: a user's own models, and what places the recording's sensors."""
    for call in filters.own_models(filters.rows(2)):
        call()
    if scoreboard.DATA.is_dir():
        tracker, scans = two_minutes(quick)
        warm_poses(tracker, scans)


def filter_rows(quick: bool) -> list[Row]:
    """One report per call, and the whole stream in one call; user's own models beside the built-in ones."""
    peers = {"NumPy by hand": filters.by_hand, "FilterPy": filters.filterpy, "Stone Soup": filters.stone_soup}
    size = 100 if quick else 500
    part = filters.rows(size)
    reference = filters.friendly(part)
    calls = filters.packed_calls(part)
    own_calls, _ = filters.own_models(part)
    for name, peer in {**peers, "packed": lambda _: calls(), "own models": lambda _: own_calls()}.items():
        # Stone Soup differentiates h numerically; the others agree to rounding
        tolerance = 1e-3 if name == "Stone Soup" else 1e-6
        np.testing.assert_allclose(peer(part), reference, rtol=0, atol=tolerance, err_msg=name)
    contenders: Contenders = {
        "boresight, packed": (lambda: [calls() for _ in range(20)], 20 * size),
        "boresight, packed, own models": (lambda: [own_calls() for _ in range(20)], 20 * size),
        "boresight": (lambda: [filters.friendly(part) for _ in range(20)], 20 * size),
    }
    contenders |= {name: (partial(peer, part), size) for name, peer in peers.items()}
    one = rows_of("one report per call", contenders, 5 if quick else 9, "us per report", 1e6)
    many = filters.rows(20_000)
    whole, general = filters.packed_stream(many), filters.prepared(many)
    _, own_whole = filters.own_models(many)
    for name, other in {"general": general, "own models": own_whole}.items():
        np.testing.assert_allclose(other(), whole(), rtol=0, atol=1e-6, err_msg=name)
    streams: Contenders = {
        "boresight": (lambda: [whole() for _ in range(10)], 10 * len(many)),
        "boresight, own models": (lambda: [own_whole() for _ in range(3)], 3 * len(many)),
        "boresight, all states kept": (general, len(many)),
    }
    few = many[:2000]
    for name, call in () if quick else filters.other_streams(few).items():
        call()
        streams[name] = (call, len(few))
    stream = rows_of("whole stream in one call", streams, 5 if quick else 9, "us per report", 1e6)
    slow = {r["contender"]: r["value"] for r in one}
    stream += [
        row(stream[0]["work"], name, slow[name], "us per report", slow[name] / stream[0]["value"]) for name in peers
    ]
    return one + stream


def _again(call: Callable[[Any], Any], argument: Any, times: int) -> None:
    for _ in range(times):
        call(argument)


def assignment_rows(quick: bool) -> list[Row]:
    """Gate and assignment at growing size: equal cost, then time."""
    out, ours = [], {}
    for targets in (100, 1000, 5000):
        f = assignment.frame(targets)
        calls = 20_000 // targets
        contenders: Contenders = {"boresight": (partial(_again, assignment.ours, f, calls), calls)}
        if targets < 5000 or not quick:  # the dense matrix of 5,000 takes seconds
            np.testing.assert_allclose(assignment.dense(f), assignment.ours(f), rtol=1e-9)
            contenders["SciPy dense"] = (partial(assignment.dense, f), 1)
        if targets == 100:
            prepared = assignment.stone_soup(f)
            np.testing.assert_allclose(assignment.stone_soup_cost(prepared), assignment.ours(f), rtol=1e-9)
            contenders["Stone Soup"] = (partial(assignment.stone_soup_cost, prepared), 1)
        out += rows_of(f"gate and assignment, {targets} targets", contenders, 3 if quick else 5, "ms", 1e3)
        ours[targets] = next(r["value"] for r in out if r["work"].endswith(f" {targets} targets"))
    growth = float(np.log(ours[5000] / ours[100]) / np.log(50.0))
    work = "gate and assignment, growth exponent 100 to 5,000"
    return [*out, row(work, "boresight", growth, "exponent")]


def tracker_rows(quick: bool) -> list[Row]:
    """The whole tracker on a real recording, where they are, and on large scenarios, which leave much memory behind."""
    out = recording_rows(quick) if scoreboard.DATA.is_dir() else []
    # targets, seconds of data, seconds between two reports of one radar on one target: five radars see each
    sizes = [(400, 60.0, 10.0), (4000, 60.0, 10.0)]
    for targets, seconds, period in sizes if quick else [*sizes[:1], (4000, 300.0, 10.0), (100_000, 20.0, 5.0)]:
        value = whole_tracker.measure(targets, seconds, period)["times_real_time"]
        work = f"whole tracker, {targets} targets, {int(5 * targets / period)} reports/s"
        out.append(row(work, "boresight", value, "times real time"))
    return out


@cache
def two_minutes(quick: bool) -> tuple[Tracker, list[Scan]]:
    """Return a real recording of radar and infrared, and the tracker for it.

    The quick one does not look for second targets in a blob: that takes another kernel than the large scenarios.
    """
    recording, sensors = scoreboard.recordings(scoreboard.DATA)[2], ["radar", "ir"]
    config = scoreboard.configuration(recording)
    tracker = tracker_for(recording, replace(config, blob_share=0.0) if quick else config, sensors)
    return tracker, list(iter_scans(recording, sensors))


def recording_rows(quick: bool) -> list[Row]:
    """Two minutes of radar and infrared, beside a tracker of Stone Soup's parts."""
    tracker, scans = two_minutes(quick)
    run(tracker, scans[:20])
    ours = "boresight, without blob_share" if quick else "boresight"
    contenders: Contenders = {ours: (lambda: run(tracker, scans), 1)}
    work = "2-minute real recording, radar + IR"
    out = rows_of(work, contenders, 3 if quick else 7, "ms", 1e3)
    if not quick:  # once: it takes ten seconds
        looks = recording.stone_soup_scans(scoreboard.recordings(scoreboard.DATA)[2], scans)
        peer = timed({"Stone Soup, nearest neighbours": (lambda: recording.stone_soup(looks), 1)}, 1)
        out += [row(work, name, 1e3 * v, "ms", 1e3 * v / out[0]["value"]) for name, v in peer.items()]
    return out


def machine() -> str:
    """Return the processor's name and how many cores may be used."""
    names = [line.split(":", 1)[1].strip() for line in _cpu_lines() if line.startswith("model name")]
    return f"{names[0] if names else platform.processor() or platform.machine()}, {cores()} cores"


def _cpu_lines() -> list[str]:
    path = Path("/proc/cpuinfo")
    return path.read_text(encoding="utf-8").splitlines() if path.is_file() else []


def versions() -> dict[str, str]:
    """Return the machine and the versions of everything that was measured."""
    from importlib.metadata import PackageNotFoundError, version

    out = {"boresight": __version__, "python": platform.python_version(), "machine": machine()}
    for name in ("numpy", "scipy", "numba", "filterpy", "stonesoup"):
        try:
            out[name] = version(name)
        except PackageNotFoundError:
            out[name] = "not installed"
    return out


def all_rows(quick: bool) -> list[Row]:
    """Return every row."""
    return filter_rows(quick) + batch.rows(quick) + assignment_rows(quick) + tracker_rows(quick) + startup.rows(quick)
