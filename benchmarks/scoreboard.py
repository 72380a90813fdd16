"""The real recordings, every sensor combination, one parameter set: `python -m benchmarks.scoreboard [--json]`.

Reads the Autoferry scenarios from `../shared/data/autoferry` (or the folder given), tracks each with the settings that
`boresight import autoferry` writes, scores them, and prints one row per combination: each scenario's GOSPA RMS, the
pooled one, and beside them an empty tracker and the figures of Stone Soup 1.9.1's JPDA (tuned with truth on these).
More rows: all sensors without the declared limits on the range of what is shown, and the fixed-lag smoothed tracks
6 s later. `--page docs` writes the table into docs/scoreboard.md and the plot beside it.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from boresight._version import __version__
from boresight.config.tracker import read_tracker_config
from boresight.engine.track import run
from boresight.errors import UserError
from boresight.io.autoferry import TRACKER_TOML, import_autoferry
from boresight.io.scans import iter_scans
from boresight.metrics.score import Score, score
from boresight.tracking.config import TrackerConfig
from boresight.tracking.output import Rows
from boresight.tracking.run import track_rows, tracker_for
from boresight.types import Recording

MARKS = ("<!-- table -->", "<!-- end of table -->")
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
SMOOTHED = ("radar + ir", "all")
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


def unlimited(config: TrackerConfig) -> TrackerConfig:
    """Return the settings without limits on the range of what ranging sensors show."""
    open_ = {name: dataclasses.replace(e, report_range=float("inf")) for name, e in config.sensors.items()}
    return dataclasses.replace(config, sensors=open_)


def scored(
    data: dict[int, Recording], config: TrackerConfig, sensors: list[str], clock: list[str] | None = None
) -> tuple[list[Score], list[float]]:
    """Track and score every recording; with a smoothing lag in the settings the smoothed tracks. CPU seconds beside.

    The scores run from the first to the last report of the sensors `clock` (those used).
    """
    scores, seconds = [], []
    for recording in data.values():
        tracker, scans = tracker_for(recording, config, sensors), list(iter_scans(recording, sensors))
        run(tracker, scans[:20])  # kernels loaded
        past: list[Rows] = []
        started = time.process_time()
        watch = None if config.smoothing_lag is None else lambda _, out: past.extend(out.smoothed)  # noqa: B023
        _, made, _ = run(tracker, scans, watch=watch)  # watched, it goes look by look
        seconds.append(time.process_time() - started)
        scores.append(
            score(recording, track_rows(made if config.smoothing_lag is None else past), None, clock or sensors)
        )
    return scores, seconds


def rows(folder: Path, keep: dict[str, list[Score]] | None = None) -> list[dict[str, Any]]:
    """Track and score every combination; one row each, and one for the empty tracker. `keep` gets the scores."""
    data = recordings(folder)
    config = configuration(next(iter(data.values())))
    out: list[dict[str, Any]] = []
    every = COMBINATIONS["all"]
    cases = [(name, config, sensors, sensors) for name, sensors in COMBINATIONS.items()]
    cases += [
        (f"{few}, over the time of {many}", config, COMBINATIONS[few], COMBINATIONS[many])
        for few, many in (("radar", "radar + ir"), ("radar + lidar", "all"))
    ]
    cases.append(("all, range not limited", unlimited(config), every, every))
    later = dataclasses.replace(config, smoothing_lag=6.0)
    cases += [(f"{name}, smoothed 6 s later", later, COMBINATIONS[name], COMBINATIONS[name]) for name in SMOOTHED]
    for name, settings, sensors, clock in cases:
        scores, seconds = scored(data, settings, sensors, clock)
        if keep is not None:
            keep[name] = scores
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


def plot(kept: dict[str, list[Score]], path: Path) -> None:
    """Draw GOSPA over time, one panel for each recording."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, panels = plt.subplots(1, len(SCENARIOS), figsize=(15, 3.2), sharey=True, layout="constrained")
    for k, (panel, number) in enumerate(zip(panels, SCENARIOS, strict=True)):
        for name, colour in (("radar", "#888888"), ("radar + ir", "#c4452f"), ("all", "#0b6aa2")):
            s = kept[name][k]
            panel.plot(s.clock - s.clock[0], s.gospa[:, 0], color=colour, lw=1.2, label=name)
        panel.axhline(20.0, color="#111111", lw=0.8, ls="--", label="no tracker")
        panel.set(title=f"scenario {number}", xlabel="time, s", ylim=(0.0, 36.0))
        panel.grid(alpha=0.3)
    panels[0].set_ylabel("GOSPA, m")
    panels[0].legend(fontsize=7, loc="upper right")
    figure.savefig(path, dpi=80)
    plt.close(figure)


def write_page(folder: Path, found: list[dict[str, Any]], kept: dict[str, list[Score]]) -> None:
    """Put the table between the marks of scoreboard.md in `folder`, and the plot into its img/."""
    page = folder / "scoreboard.md"
    text = page.read_text(encoding="utf-8")
    before, _, rest = text.partition(MARKS[0])
    _, _, after = rest.partition(MARKS[1])
    if not after:
        raise UserError(f"{page}: the marks {MARKS[0]} and {MARKS[1]} are missing")
    plot(kept, folder / "img" / "scoreboard.png")
    page.write_text(f"{before}{MARKS[0]}\n\n{table(found)}\n\n{MARKS[1]}{after}", encoding="utf-8")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, nargs="?", default=DATA)
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--page", type=Path, help="folder of scoreboard.md: write table and plot there")
    arguments = parser.parse_args()
    kept: dict[str, list[Score]] = {}
    try:
        found = rows(arguments.folder, kept)
        if arguments.page is not None:
            write_page(arguments.page, found, kept)
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
