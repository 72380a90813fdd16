"""`boresight paper mao2015`."""

from __future__ import annotations

from boresight.cli.output import print_json, print_table
from boresight.cli.paper import check_runs

COLUMNS = {
    "trajectory": "trajectory",
    "method": "method",
    "az_deg": "azimuth\nRMSE °",
    "el_deg": "elevation\nRMSE °",
    "ratio": "÷ bound",
}


def mao2015(*, runs: int = 200, seed: int = 1, json: bool = False) -> None:
    """Print mao2015's table: radar and infrared angles fused over windows of infrared samples, on four trajectories.

    Parameters
    ----------
    runs
        Monte Carlo runs.
    seed
        Of the random numbers.
    json
        Print one JSON object instead of a table.
    """
    from boresight.papers.mao2015.table import table

    check_runs(runs, seed)
    rows = table(runs, seed)
    if json:
        print_json("paper mao2015", {"runs": runs, "seed": seed}, rows)
        return
    print_table(COLUMNS, rows, f"mao2015, {runs} runs, seed {seed}: error at the radar's times", digits=3)
