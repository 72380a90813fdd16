"""`boresight score`: tracks against truth."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from boresight.cli.output import print_json, print_notes, print_table
from boresight.cli.report import check_belongs
from boresight.errors import UserError
from boresight.io.recording import read_recording
from boresight.io.results import read_results
from boresight.metrics.losses import loss_lines, losses
from boresight.metrics.score import ALPHA, ORDER, score
from boresight.types import Recording, Results

SETS = {
    "item": "",
    "gospa_rms_m": "GOSPA\nRMS m",
    "gospa_mean_m": "mean\nm",
    "gospa_localisation_m": "local.\nm",
    "gospa_missed_m": "missed\nm",
    "gospa_false_m": "false\nm",
    "ospa_mean_m": "OSPA\nmean m",
    "tracked_fraction": "tracked",
    "position_rmse_m": "RMSE\nm",
}
LIVES = {
    "item": "",
    "identity_switches": "identity\nswitches",
    "breaks": "breaks",
    "false_track_s": "false-track\nseconds",
    "nees_mean": "NEES\nmean",
    "nees_median": "NEES\nmedian",
    "nees_in_band_95": "NEES in\n95 % band",
}
TARGETS = {
    "target": "target",
    "tracked_fraction": "tracked",
    "position_rmse_m": "RMSE\nm",
    "identity_switches": "identity\nswitches",
    "breaks": "breaks",
    "nees_mean": "NEES\nmean",
    "nees_in_band_95": "NEES in\n95 % band",
}
SENSORS = {
    "sensor": "sensor",
    "reports": "reports",
    "reports_updated": "updated",
    "reports_initiated": "initi-\nated",
    "nis_per_dof": "NIS per\ncomponent",
    "nis_in_band_95": "NIS in\n95 % band",
}


def score_command(
    out: Path,
    rec: Path,
    /,
    *,
    cut_off_m: float | None = None,
    smoothed: bool = False,
    json: bool = False,
) -> None:
    """Score tracks against the truth of their recording: GOSPA, OSPA, tracked fraction, identities, NEES, NIS.

    Parameters
    ----------
    out
        Folder of the results (boresight track -o).
    rec
        Folder of the recording, with truth.
    cut_off_m
        Largest distance at which a track holds a target, and the cut-off of GOSPA and OSPA (five standard deviations of
        the best sensor's positions or of the truth, rounded up, at least 20 m).
    smoothed
        Score smoothed.parquet (boresight track --lag) instead of the causal tracks.
    json
        Print one JSON object instead of tables.
    """
    recording = read_recording(rec)
    results = read_results(out)
    if smoothed:
        if results.smoothed is None:
            raise UserError(f"{out}: no smoothed.parquet; write it with: boresight track {rec} -o {out} --lag 5")
        results = replace(results, tracks=results.smoothed)
    check_belongs(results, recording, rec)
    print_notes(recording.notes)
    scored = score(recording, results.tracks, results.decisions, results.summary.get("sensors"), cut_off_m)
    rows = [*scored.rows, *losses(recording, results.decisions)]
    print_notes(scored.notes)
    if json:
        parameters = {
            "results": str(out),
            "recording": str(rec),
            "smoothed": smoothed,
            "cut_off_m": scored.cut_off,
            "cut_off_from": "noise" if cut_off_m is None else "command line",
            "p": ORDER,
            "alpha": ALPHA,
            "clock_step_s": 0.5,
        }
        print_json("score", parameters, rows)
        return
    sets = [r for r in rows if r["item"] in ("tracks", "empty tracker")]
    why = "from the noise of sensors and truth; --cut-off-m sets it" if cut_off_m is None else "as given"
    print(f"cut-off {scored.cut_off:g} m ({why})")
    print_table(SETS, sets, title=f"GOSPA and OSPA with p = 2, alpha = 2, c = {scored.cut_off:g} m, every 0.5 s")
    print_table(LIVES, sets)
    print_table(TARGETS, [r for r in rows if r["item"] == "target"])
    print_table(SENSORS, [r for r in rows if r["item"] == "sensor"])
    for line in loss_lines(recording, results.decisions):
        print(line)


def score_rows(recording: Recording, results: Results) -> list[dict[str, Any]]:
    """Return the rows of `boresight score --json`: what the report shows too."""
    return score(recording, results.tracks, results.decisions, results.summary.get("sensors")).rows
