"""Speed against the peers in one run: `python -m benchmarks [--quick] [--json]` (the extra `bench` brings the peers).

Every contender's result is checked against ours before anything is timed; contenders take turns; the figure is the
median of the rounds, in CPU time. `ratio` is the contender's figure over ours (above 1: we are faster). Without --quick
the table is also written to benchmarks/results.json.
"""

from __future__ import annotations

import argparse
import json
import platform
import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import assignment, filters, scoreboard, whole_tracker
from boresight._version import __version__

Contenders = dict[str, tuple[Callable[[], Any], int]]  # name -> (call, how many units of work one call does)


def timed(contenders: Contenders, rounds: int) -> dict[str, float]:
    """Return the median CPU time per unit of work (s), contenders taking turns."""
    spent: dict[str, list[float]] = {name: [] for name in contenders}
    for _ in range(rounds):
        for name, (call, units) in contenders.items():
            started = time.process_time()
            call()
            spent[name].append((time.process_time() - started) / units)
    return {name: statistics.median(values) for name, values in spent.items()}


def rows_of(work: str, contenders: Contenders, rounds: int, unit: str, scale: float) -> list[dict[str, Any]]:
    """Time contenders, the first of which is ours, and return one row each."""
    found = timed(contenders, rounds)
    ours = next(iter(found.values()))
    return [
        {"work": work, "contender": name, "value": value * scale, "unit": unit, "ratio": value / ours}
        for name, value in found.items()
    ]


def filter_rows(quick: bool) -> list[dict[str, Any]]:
    """One report per call, and the whole stream in one call."""
    peers = {"NumPy by hand": filters.by_hand, "FilterPy": filters.filterpy, "Stone Soup": filters.stone_soup}
    reports = filters.rows(200)
    reference = filters.friendly(reports)
    for name, peer in peers.items():
        # Stone Soup differentiates h numerically; the others agree to rounding
        tolerance = 1e-3 if name == "Stone Soup" else 1e-6
        np.testing.assert_allclose(peer(reports), reference, rtol=0, atol=tolerance, err_msg=name)
    many = filters.rows(20_000)
    whole = filters.prepared(many)
    np.testing.assert_allclose(whole(), filters.friendly(many), rtol=0, atol=1e-6)
    size = 200 if quick else 1000
    part = filters.rows(size)
    contenders: Contenders = {"boresight": (lambda: filters.friendly(part), size)}
    contenders |= {name: (lambda p=peer: p(part), size) for name, peer in peers.items()}
    one = rows_of("one report per call", contenders, 3 if quick else 7, "us per report", 1e6)
    streams: Contenders = {"boresight": (whole, len(many))}
    for name, call in filters.other_streams(many).items():
        call()
        streams[name] = (call, len(many))
    stream = rows_of("whole stream in one call", streams, 5, "us per report", 1e6)
    slow = {r["contender"]: r["value"] for r in one}
    for name in ("NumPy by hand", "FilterPy", "Stone Soup"):
        ratio = slow[name] / stream[0]["value"]
        stream.append(
            {"work": stream[0]["work"], "contender": name, "value": slow[name], "unit": "us per report", "ratio": ratio}
        )
    return one + stream


def assignment_rows(quick: bool) -> list[dict[str, Any]]:
    """Gate and assignment at growing size: equal cost, then time."""
    out, ours = [], {}
    for targets in (100, 1000, 5000):
        f = assignment.frame(targets)
        calls = 2000 // targets + 1
        contenders: Contenders = {"boresight": (lambda f=f, c=calls: [assignment.ours(f) for _ in range(c)], calls)}
        if targets < 5000 or not quick:  # the dense matrix of 5,000 takes seconds
            np.testing.assert_allclose(assignment.dense(f), assignment.ours(f), rtol=1e-9)
            contenders["SciPy dense"] = (lambda f=f: assignment.dense(f), 1)
        if targets == 100:
            prepared = assignment.stone_soup(f)
            np.testing.assert_allclose(assignment.stone_soup_cost(prepared), assignment.ours(f), rtol=1e-9)
            contenders["Stone Soup"] = (lambda p=prepared: assignment.stone_soup_cost(p), 1)
        out += rows_of(f"gate and assignment, {targets} targets", contenders, 3 if quick else 5, "ms", 1e3)
        ours[targets] = next(r["value"] for r in out if r["work"].endswith(f" {targets} targets"))
    growth = float(np.log(ours[5000] / ours[100]) / np.log(50.0))
    work = "gate and assignment, growth exponent 100 to 5,000"
    return [*out, {"work": work, "contender": "boresight", "value": growth, "unit": "exponent", "ratio": 1.0}]


def tracker_rows(quick: bool) -> list[dict[str, Any]]:
    """The whole tracker on a large scenario, and on the real recordings where they are."""
    out = []
    for targets, seconds in ((400, 60.0),) if quick else ((400, 120.0), (4000, 300.0)):
        value = whole_tracker.measure(targets, seconds)["times_real_time"]
        work = f"whole tracker, {targets} targets, {targets // 2} reports/s"
        out.append({"work": work, "contender": "boresight", "value": value, "unit": "times real time", "ratio": 1.0})
    if scoreboard.DATA.is_dir():
        data = {n: r for n, r in scoreboard.recordings(scoreboard.DATA).items() if n == 2}
        config = scoreboard.configuration(data[2])
        tracker, sensors = scoreboard.tracker_for(data[2], config, ["radar", "ir"]), ["radar", "ir"]
        scans = list(scoreboard.iter_scans(data[2], sensors))
        scoreboard.run(tracker, scans[:20])
        contenders: Contenders = {"boresight": (lambda: scoreboard.run(tracker, scans), 1)}
        out += rows_of("2-minute real recording, radar + IR", contenders, 3 if quick else 7, "ms", 1e3)
    return out


def versions() -> dict[str, str]:
    """Return the machine and the versions of everything that was measured."""
    from importlib.metadata import PackageNotFoundError, version

    out = {"boresight": __version__, "python": platform.python_version(), "machine": platform.machine()}
    for name in ("numpy", "scipy", "numba", "filterpy", "stonesoup"):
        try:
            out[name] = version(name)
        except PackageNotFoundError:
            out[name] = "not installed"
    return out


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="fewer rounds and smaller sizes")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    arguments = parser.parse_args()
    try:
        import filterpy  # noqa: F401
        import stonesoup  # noqa: F401
    except ImportError as error:
        print(f"benchmarks: {error.name} is not installed; run make bench, or install the extra bench", file=sys.stderr)
        return 2
    rows = filter_rows(arguments.quick) + assignment_rows(arguments.quick) + tracker_rows(arguments.quick)
    result = {"command": "benchmarks", "version": __version__, "parameters": versions(), "rows": rows}
    if not arguments.quick:
        path = Path(__file__).with_name("results.json")
        path.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    if arguments.json:
        print(json.dumps(result, indent=1))
        return 0
    print(f"{'work':44} {'contender':16} {'value':>12} {'unit':16} {'ratio':>9}")
    for r in rows:
        print(f"{r['work']:44} {r['contender']:16} {r['value']:12.4g} {r['unit']:16} {r['ratio']:9.4g}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
