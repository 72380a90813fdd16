"""Are the settings of the scoreboard tuned to its recordings? `python -m benchmarks.crossvalidate [--candidates 60]`.

Candidates are drawn about the settings that `boresight import autoferry` writes, each setting log-normal with the
spread of the table below, without a look at any score. All are run on all recordings and sensor combinations. Leaving
one recording out, the candidates are ordered by the summed mean-square GOSPA on the other four; judged on the one left
out are the best of them, and the middle (geometric mean) of the ten best, which is how the settings were made. Printed
per combination: the settings as they are, the best candidate on all five, these two, and how much the candidates differ
among themselves, which is the luck in any tuning.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.scoreboard import COMBINATIONS, DATA, configuration, recordings
from boresight._version import __version__
from boresight.engine.track import run
from boresight.errors import UserError
from boresight.io.scans import iter_scans
from boresight.metrics.score import score
from boresight.tracking.config import TrackerConfig
from boresight.tracking.run import track_rows, tracker_for
from boresight.types import FloatArray, Recording

MIDDLE_OF = 10  # candidates
NAMES = ("radar", "radar + ir", "radar + lidar", "all")
SPREAD = {
    "q": 0.3,
    "speed_sigma": 0.2,
    "birth_rate": 0.4,
    "targets_at_start": 0.4,
    "hide_time": 0.3,
    "show_time": 0.3,
    "static_share": 0.3,
    "static_q": 0.3,
    "stop_floor": 0.4,
    "start_speed": 0.3,
    "doubt": 0.4,
    "hide_below": 0.15,
    "merge_distance": 0.1,
    "apart": 0.1,
    "clutter_memory": 0.3,
}
SENSOR_SPREAD = {
    ("radar", "bias_position"): 0.25,
    ("radar", "bias_time"): 0.3,
    ("radar", "resolution"): 0.15,
    ("lidar", "bias_position"): 0.25,
    ("lidar", "bias_time"): 0.3,
    ("ir", "decorrelation"): 0.3,
    ("ir", "bias_azimuth"): 0.2,
    ("ir", "sees_static"): 0.5,
    ("ir", "fade_range"): 0.25,
    ("eo", "decorrelation"): 0.3,
    ("eo", "bias_azimuth"): 0.2,
    ("eo", "sees_static"): 0.5,
    ("eo", "fade_range"): 0.25,
}


def candidate(config: TrackerConfig, steps: FloatArray) -> TrackerConfig:
    """Return the settings, each of the tables times exp(its spread · its step)."""
    step = iter(steps)
    top: dict[str, Any] = {}
    for name, spread in SPREAD.items():
        value = getattr(config, name)
        top[name] = (value if value is not None else 0.1) * float(np.exp(spread * next(step)))
    top["hide_below"] = min(top["hide_below"], config.confirm_above)
    top["stop_floor"] = min(top["stop_floor"], 0.9 * (1.0 - config.confirm_above))  # above, hardly anything is shown
    sensors = dict(config.sensors)
    for (sensor, name), spread in SENSOR_SPREAD.items():
        errors = sensors[sensor]
        value = getattr(errors, name) * float(np.exp(spread * next(step)))
        sensors[sensor] = dataclasses.replace(errors, **{name: value})
    return dataclasses.replace(config, **top, sensors=sensors)


def squares(data: dict[int, Recording], config: TrackerConfig) -> FloatArray:
    """Return (recordings, combinations) mean-square GOSPA (m²)."""
    out = np.zeros((len(data), len(NAMES)))
    for a, recording in enumerate(data.values()):
        for b, name in enumerate(NAMES):
            sensors = COMBINATIONS[name]
            _, made, _ = run(tracker_for(recording, config, sensors), iter_scans(recording, sensors))
            scored = score(recording, track_rows(made), None, sensors)
            out[a, b] = float((scored.gospa[:, 0] ** 2).mean())
    return out


def rows(data: dict[int, Recording], candidates: int, seed: int) -> list[dict[str, Any]]:
    """One row for each sensor combination; every recording counts the same here."""
    config = configuration(next(iter(data.values())))
    rng = np.random.default_rng(seed)
    steps = rng.standard_normal((candidates + 1, len(SPREAD) + len(SENSOR_SPREAD)))
    steps[0] = 0.0  # as they are
    found = []
    for k in range(candidates + 1):
        found.append(squares(data, candidate(config, steps[k])))
        if sys.stderr.isatty():
            print(f"\r{k}/{candidates}", end="", file=sys.stderr)
    pool = np.array(found)
    written = pool[0]
    tuned = int(pool.sum(axis=(1, 2)).argmin())
    best, middle = np.zeros_like(written), np.zeros_like(written)
    for a, (number, recording) in enumerate(data.items()):
        rest = np.arange(len(data)) != a
        order = pool[:, rest].sum(axis=(1, 2)).argsort()
        best[a] = pool[order[0], a]
        middle[a] = squares({number: recording}, candidate(config, steps[order[:MIDDLE_OF]].mean(axis=0)))[0]
    return [
        {
            "sensors": name,
            "as_written_m": float(np.sqrt(written[:, b].mean())),
            "tuned_m": float(np.sqrt(pool[tuned, :, b].mean())),
            "best_of_the_others_m": float(np.sqrt(best[:, b].mean())),
            "cross_validated_m": float(np.sqrt(middle[:, b].mean())),
            "candidates_mean_m": float(np.sqrt(pool[:, :, b].mean(axis=1)).mean()),
            "candidates_std_m": float(np.sqrt(pool[:, :, b].mean(axis=1)).std()),
            "candidates": candidates,
        }
        for b, name in enumerate(NAMES)
    ]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, nargs="?", default=DATA)
    parser.add_argument("--candidates", type=int, default=60)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    arguments = parser.parse_args()
    try:
        found = rows(recordings(arguments.folder), max(1, arguments.candidates), arguments.seed)
    except UserError as error:
        print(f"crossvalidate: {error}", file=sys.stderr)
        return 2
    if arguments.json:
        about = {"candidates": arguments.candidates, "seed": arguments.seed}
        print(json.dumps({"command": "crossvalidate", "version": __version__, "parameters": about, "rows": found}))
        return 0
    head = ("sensors", "as written", "best of all", "best of the other four", "middle of their ten best")
    print(f"| {' | '.join(head)} | candidates, mean ± spread |\n|---|---|---|---|---|---|")
    for r in found:
        print(
            f"| {r['sensors']} | {r['as_written_m']:.2f} | {r['tuned_m']:.2f} | {r['best_of_the_others_m']:.2f} | "
            f"{r['cross_validated_m']:.2f} | {r['candidates_mean_m']:.2f} ± {r['candidates_std_m']:.2f} |"
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
