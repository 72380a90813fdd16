"""The real recordings, every sensor combination, one parameter set: `python -m benchmarks.scoreboard [--json]`.

Reads the Autoferry scenarios from `../shared/data/autoferry` (or the folder given), tracks each with the settings that
`boresight import autoferry` writes, scores them, and prints one row per combination: each scenario's GOSPA RMS, the
pooled one, and beside them an empty tracker and the figures of Stone Soup 1.9.1's JPDA (tuned with truth on these).
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from boresight._version import __version__
from boresight.config.tracker import read_tracker_config
from boresight.errors import UserError
from boresight.io.autoferry import TRACKER_TOML, import_autoferry
from boresight.io.scans import iter_scans
from boresight.metrics.score import Score, score
from boresight.tracking.config import TrackerConfig
from boresight.tracking.run import run, track_rows, tracker_for
from boresight.types import Recording

ROOT = Path(__file__).parents[1]
DATA = ROOT.parent / "shared" / "data" / "autoferry"
SCENARIOS = (2, 3, 4, 13, 16)
COMBINATIONS = {
    "radar": ["radar"],
    "radar + ir": ["radar", "ir"],
    "radar + lidar": ["radar", "lidar"],
    "all": ["radar", "lidar", "ir", "eo"],
    "ir": ["ir"],
}
# Stone Soup 1.9.1, JPDA, EKF, CV, tuned with truth on these scenarios, scored the same way: GOSPA RMS (m),
# tracked fraction, false-track seconds, position RMSE (m). The published figures; not run here.
STONE_SOUP = {
    "radar": (15.4, 0.79, 185, 7.5),
    "radar + ir": (15.0, 0.78, 168, 7.2),
    "radar + lidar": (14.5, 0.81, 176, 5.5),
    "all": (14.5, 0.81, 168, 5.5),
}


def recordings(folder: Path) -> dict[int, Recording]:
    """Import every scenario with its truth."""
    out = {}
    for n in SCENARIOS:
        ignore = folder / f"scenario{n}_unlabelled.csv"
        out[n] = import_autoferry(
            folder / f"scenario{n}_detections.json",
            folder / f"scenario{n}_groundTruth.json",
            ignore if ignore.exists() else None,
        )
    return out


def configuration(recording: Recording) -> TrackerConfig:
    """Return the one configuration that the import writes beside every recording."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "tracker.toml"
        path.write_text(TRACKER_TOML, encoding="utf-8")
        return read_tracker_config(path, [s.id for s in recording.sensors])


def pooled(scores: list[Score], seconds: list[float]) -> dict[str, Any]:
    """Pool over scenarios: every clock time counts the same."""
    squares = np.concatenate([s.gospa[:, 0] ** 2 for s in scores])
    errors = [e for s in scores for t in s.targets for e in t.squared_error]
    nees = [v for s in scores for t in s.targets for v in t.nees]
    present = sum(t.present for s in scores for t in s.targets)
    return {
        "gospa_rms_m": float(np.sqrt(squares.mean())),
        "tracked_fraction": sum(t.held for s in scores for t in s.targets) / present,
        "false_track_s": sum(s.rows[0]["false_track_s"] for s in scores),
        "position_rmse_m": float(np.sqrt(np.mean(errors))) if errors else None,
        "identity_switches": sum(s.rows[0]["identity_switches"] for s in scores),
        "nees_median": float(np.median(nees)) if nees else None,
        "cpu_s_per_scenario": max(seconds),
    }


def rows(folder: Path) -> list[dict[str, Any]]:
    """Track and score every combination; one row each, and one for the empty tracker."""
    data = recordings(folder)
    config = configuration(next(iter(data.values())))
    out: list[dict[str, Any]] = []
    for name, sensors in COMBINATIONS.items():
        scores, seconds = [], []
        for recording in data.values():
            tracker, scans = tracker_for(recording, config, sensors), list(iter_scans(recording, sensors))
            run(tracker, scans[:20])  # kernels loaded
            started = time.process_time()
            _, made, _ = run(tracker, scans)
            seconds.append(time.process_time() - started)
            scores.append(score(recording, track_rows(made), None, sensors))
        each = {f"scenario_{n}": float(np.sqrt((s.gospa[:, 0] ** 2).mean())) for n, s in zip(data, scores, strict=True)}
        soup = dict(zip(("gospa", "tracked", "false_s", "rmse"), STONE_SOUP.get(name, (None,) * 4), strict=True))
        out.append(
            {"sensors": name, **pooled(scores, seconds), **each, **{f"stone_soup_{k}": v for k, v in soup.items()}}
        )
        if name == "all":
            empty = np.sqrt(np.mean([s.rows[1]["gospa_rms_m"] ** 2 for s in scores]))
    out.append(
        {"sensors": "(empty tracker)", "gospa_rms_m": float(empty), "tracked_fraction": 0.0, "false_track_s": 0.0}
    )
    return out


def table(found: list[dict[str, Any]]) -> str:
    """Return the rows as Markdown."""
    head = ["sensors", "GOSPA RMS m", *(f"sc. {n}" for n in SCENARIOS), "tracked", "false s", "RMSE m", "switches"]
    head += ["NEES median", "CPU s / scenario", "Stone Soup GOSPA / tracked / false s / RMSE"]
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]

    def cell(value: Any, digits: int) -> str:
        return "–" if value is None else f"{value:.{digits}f}"

    for r in found:
        cells = [r["sensors"], cell(r["gospa_rms_m"], 2), *(cell(r.get(f"scenario_{n}"), 1) for n in SCENARIOS)]
        cells += [cell(r["tracked_fraction"], 2), cell(r["false_track_s"], 0), cell(r.get("position_rmse_m"), 1)]
        cells += [
            cell(r.get("identity_switches"), 0),
            cell(r.get("nees_median"), 2),
            cell(r.get("cpu_s_per_scenario"), 2),
        ]
        soup = [r.get(f"stone_soup_{k}") for k in ("gospa", "tracked", "false_s", "rmse")]
        cells.append("–" if soup[0] is None else f"{soup[0]} / {soup[1]} / {soup[2]} / {soup[3]}")
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, nargs="?", default=DATA)
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    arguments = parser.parse_args()
    try:
        found = rows(arguments.folder)
    except UserError as error:
        print(f"scoreboard: {error}", file=sys.stderr)
        return 2
    if arguments.json:
        print(json.dumps({"command": "scoreboard", "version": __version__, "parameters": {}, "rows": found}, indent=1))
    else:
        print(table(found))
    return 0


if __name__ == "__main__":
    sys.exit(main())
