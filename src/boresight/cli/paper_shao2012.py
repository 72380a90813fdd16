"""`boresight paper shao2012`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from boresight.cli.output import print_json, print_table
from boresight.cli.paper import LOADING, check_runs, say, write_image
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


CASE_COLUMNS = {
    "case": "case",
    "method": "method",
    "time_s": "time\ns",
    "position_m": "position\nm",
    "range_m": "range\nm",
    "range_bound_m": "bound\nm",
    "range_over_bound": "range\n/bound",
    "range_sigma_reported_m": "reported\nm",
    "range_observable": "range\nknown",
    "anees_per_dim": "ANEES\n/dim",
}


def shao2012(
    *,
    set_: Annotated[str, Parameter(name="--set")] = "A",
    runs: int = 500,
    seed: int = 1,
    plot: Path | None = None,
    json: bool = False,
) -> None:
    """Print shao2012's table: every method's RMS error over 3–6 s, its ratio to the Cramér–Rao bound, consistency.

    Parameters
    ----------
    set_
        A, P (paper-like), B, C or M (manoeuvring): noise and rates as docs/filters.md states them; or one of the
        cases weave, straight, diffuse, overhead, where the choice of coordinates and of noise decides.
    runs
        Monte Carlo runs.
    seed
        Of the random numbers.
    plot
        Image file (.svg, .png, .pdf) to write with the errors over time; for the sets only.
    json
        Print one JSON object instead of a table.
    """
    say(LOADING)
    from boresight.papers.shao2012.cases import CASES
    from boresight.papers.shao2012.scenario import SETS

    known = [*SETS, *CASES]
    if set_ not in known:
        raise UserError(f"--set must be one of {', '.join(known)}, not '{set_}'{did_you_mean(set_, known)}")
    check_runs(runs, seed)
    if plot is not None:
        _plot(plot, set_, runs, seed)
    rows = _rows(set_, runs, seed)
    if json:
        print_json("paper shao2012", {"set": set_, "runs": runs, "seed": seed}, rows)
        return
    title = f"shao2012, {'case' if set_ in CASES else 'set'} {set_}, {runs} runs, seed {seed}"
    print_table(CASE_COLUMNS if set_ in CASES else COLUMNS, rows, title, digits=3)


def _rows(name: str, runs: int, seed: int) -> list[dict[str, Any]]:
    import numpy as np

    from boresight.papers.shao2012.cases import CASES
    from boresight.papers.shao2012.table import table

    if name in CASES:
        say(f"case {name}")
        return CASES[name](runs, np.random.default_rng(seed))
    return table(name, runs, seed, lambda method: say(f"set {name}, {method}"))


def _plot(path: Path, name: str, runs: int, seed: int) -> None:
    from boresight.papers.shao2012.plot import plot
    from boresight.papers.shao2012.scenario import SETS

    if name not in SETS:
        raise UserError(f"--plot shows the sets {', '.join(SETS)}, not '{name}'")
    write_image(path, lambda part: plot(part, name, runs, seed))
