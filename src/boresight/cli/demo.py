"""`boresight demo`: simulate radar and infrared on two aircraft, track, score, write the report."""

from __future__ import annotations

import sys
from importlib.resources import as_file, files
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from boresight.cli.output import print_json, print_table
from boresight.io.files import output_folder
from boresight.io.recording import write_recording
from boresight.io.results import write_results
from boresight.io.scans import iter_scans
from boresight.tracking.cache import compiling_beside
from boresight.types import Recording, Results

SET = "P"
DIMENSIONS = 3  # of the scenario
COLUMNS = {
    "time_s": "time\ns",
    "radar_rmse_m": "radar alone\nerror m",
    "radar_bound_m": "\nbound m",
    "ir_rmse_m": "IR alone\nerror m",
    "ir_bound_m": "\nbound m",
    "both_rmse_m": "both\nerror m",
    "both_bound_m": "\nbound m",
    "both_ratio": "\nratio",
}


def demo(
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"])] = Path("demo"),
    runs: int = 400,
    seed: int = 7,
    force: bool = False,
    json: bool = False,
) -> None:
    """Simulate a UAV with radar and infrared meeting another aircraft, track it, and write the report.

    The table compares the filter's position error, second by second, with the Cramér-Rao bound: radar alone, infrared
    alone, both (shao2012, noise set P).

    Parameters
    ----------
    output
        Folder for recording, tracks and report.html.
    runs
        Monte Carlo runs of the table.
    seed
        Seed of the random numbers.
    force
        Replace the output folder.
    json
        Print one JSON object instead of text.
    """
    if runs < 2 or seed < 0:
        from boresight.errors import UserError

        raise UserError("--runs must be 2 or more, --seed 0 or more")
    with output_folder(output, force, beside=("recording", "scenario.toml")) as folder:
        with compiling_beside(DIMENSIONS) as compiles:
            if compiles:
                _say(json, "compiling kernels beside, on the first run only (about a minute) …")
            _say(json, f"comparing the filter with the bound over {runs} runs …")
            rows = _table(runs, seed)
            recording = _simulated(folder, seed)
        results = _tracked(recording, folder, output, seed, rows)
    report = output / "report.html"
    if json:
        print_json("demo", {"runs": runs, "seed": seed, "set": SET, "report": str(report)}, rows)
        return
    print_table(COLUMNS, rows, title="Position error (RMSE) and Cramér-Rao bound", digits=3)
    counts = results.summary["counts"]
    print(f"the recording: {counts['reports']} reports, {counts['tracks']} tracks; to score it again:")
    print(f"  boresight score {output} {output / 'recording'}")
    print(f"the report: {report}")


def _say(quiet: bool, text: str) -> None:
    if not quiet:
        print(f"boresight: {text}", file=sys.stderr, flush=True)


def _simulated(folder: Path, seed: int) -> Recording:
    """Write scenario and recording into `folder`; loads what places the sensors, for the tracker."""
    import numpy as np

    from boresight.config.scenario import read_scenario
    from boresight.sim.scenario import simulate
    from boresight.tracking.config import TrackerConfig
    from boresight.tracking.run import tracker_for
    from boresight.tracking.warm import warm_poses

    with as_file(files("boresight.cli") / "demo.toml") as path:
        scenario, _ = read_scenario(path, seed)
        (folder / "scenario.toml").write_text(path.read_text(encoding="utf-8"), encoding="utf-8")
    recording = simulate(scenario, np.random.default_rng(seed))
    write_recording(recording, folder / "recording")
    warm_poses(tracker_for(recording, TrackerConfig()), iter_scans(recording))
    return recording


def _tracked(recording: Recording, folder: Path, output: Path, seed: int, bound: list[dict[str, Any]]) -> Results:
    """Track the recording and write tracks and report into `folder`."""
    from boresight.cli.track import track_recording
    from boresight.report.html import write_report
    from boresight.tracking.config import TrackerConfig

    results = track_recording(recording, TrackerConfig())
    results.summary["command"] = f"boresight demo -o {output} --seed {seed}"
    results.summary["recording_folder"] = str(output / "recording")
    results.summary["bound"] = bound
    write_results(results, recording, folder)
    write_report(folder / "report.html", results, recording)
    return results


def _table(runs: int, seed: int) -> list[dict[str, Any]]:
    import numpy as np

    from boresight.papers.shao2012.scenario import SETS
    from boresight.papers.shao2012.seconds import per_second

    return per_second(SETS[SET], runs, np.random.default_rng(seed))
