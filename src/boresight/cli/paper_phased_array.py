"""`boresight paper phased_array`."""

from __future__ import annotations

from boresight.cli.output import print_json, print_table
from boresight.cli.paper import check_runs
from boresight.errors import UserError, did_you_mean

COLUMNS = {
    "scenario": "scenario",
    "mode": "mode",
    "rmse_deg": "RMSE\n°",
    "median_deg": "median\n°",
    "p95_deg": "95 %\n°",
    "above_1deg": "share\n> 1°",
    "available": "avail-\nable",
    "reduction_vs_self": "less than\nown tracking",
}


def phased_array(*, scenario: str = "nominal", runs: int = 12, seed: int = 1, json: bool = False) -> None:
    """Print the beam's error one second ahead: as printed, with fixed weights, repaired, filtered, own tracking alone.

    Parameters
    ----------
    scenario
        nominal, clean, zenith, ship, biased, silent, heavy, or all: docs/pointing.md describes them.
    runs
        Monte Carlo runs.
    seed
        Of the random numbers.
    json
        Print one JSON object instead of a table.
    """
    from boresight.papers.phased_array.scenario import SCENARIOS
    from boresight.papers.phased_array.table import table

    if scenario != "all" and scenario not in SCENARIOS:
        known = [*SCENARIOS, "all"]
        raise UserError(
            f"--scenario must be one of {', '.join(known)}, not '{scenario}'{did_you_mean(scenario, known)}"
        )
    check_runs(runs, seed)
    rows = table(tuple(SCENARIOS) if scenario == "all" else (scenario,), runs, seed)
    if json:
        print_json("paper phased_array", {"scenario": scenario, "runs": runs, "seed": seed}, rows)
        return
    print_table(COLUMNS, rows, f"phased_array, {runs} runs, seed {seed}: beam error one second ahead", digits=3)
