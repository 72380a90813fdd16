"""`boresight paper shao2012`."""

from __future__ import annotations

from typing import Annotated, Any

from cyclopts import Parameter

from boresight.cli.output import print_json, print_table
from boresight.errors import UserError, did_you_mean

COLUMNS = {  # the ratio in elevation is left to --json: 80 columns
    "method": "method",
    "az_mrad": "az\nmrad",
    "el_mrad": "el\nmrad",
    "range_m": "range\nm",
    "velocity_m_s": "vel\nm/s",
    "az_ratio": "az\n/bound",
    "range_ratio": "range\n/bound",
    "velocity_ratio": "vel\n/bound",
    "anees_per_dim": "ANEES\n/dim",
    "us_per_update": "µs",
}


def shao2012(
    *,
    set_: Annotated[str, Parameter(name="--set")] = "A",
    runs: int = 500,
    seed: int = 1,
    json: bool = False,
) -> None:
    """Print shao2012's table: every method's RMS error over 3–6 s, its ratio to the Cramér–Rao bound, consistency.

    Parameters
    ----------
    set_
        A, P (paper-like), B, C or M (manoeuvring): noise and rates as docs/filters.md states them.
    runs
        Monte Carlo runs.
    seed
        Of the random numbers.
    json
        Print one JSON object instead of a table.
    """
    from boresight.papers.shao2012.scenario import SETS
    from boresight.papers.shao2012.table import table

    if set_ not in SETS:
        raise UserError(f"--set must be one of {', '.join(SETS)}, not '{set_}'{did_you_mean(set_, SETS)}")
    if runs < 1:
        raise UserError(f"--runs must be at least 1, not {runs}")
    rows: list[dict[str, Any]] = table(set_, runs, seed)
    if json:
        print_json("paper shao2012", {"set": set_, "runs": runs, "seed": seed}, rows)
        return
    print_table(COLUMNS, rows, f"shao2012, set {set_}, {runs} runs, seed {seed}", digits=3)
