"""`boresight paper async_ekf`."""

from __future__ import annotations

from pathlib import Path

from boresight.cli.output import print_json, print_table
from boresight.cli.paper import LOADING, check_runs, say, write_image
from boresight.errors import UserError, did_you_mean

COLUMNS = {
    "scenario": "scenario",
    "method": "method",
    "position_m": "position\nm",
    "velocity_m_s": "velocity\nm/s",
    "position_ratio": "position\n/bound",
    "anees_per_dim": "ANEES\n/dim",
    "swapped": "swapped\nshare",
}


def async_ekf(
    *, scenario: str = "all", runs: int = 500, seed: int = 1, plot: Path | None = None, json: bool = False
) -> None:
    """Print async_ekf's table: the listing, its mistakes mended in turn, and filters at the data's own times.

    Parameters
    ----------
    scenario
        S0 (truth drawn from the model), S2 (the paper's path), doppler (the paper's sensors as listed: no elevation,
        range rate, temperature; two targets, at most 50 runs), or all.
    runs
        Monte Carlo runs of each scenario.
    seed
        Of the random numbers.
    plot
        Image file (.svg, .png, .pdf) to write with the errors over time; for S0 or S2, which --scenario must name.
    json
        Print one JSON object instead of a table.
    """
    say(LOADING)
    from boresight.papers.async_ekf import doppler
    from boresight.papers.async_ekf.scenario import SCENARIOS
    from boresight.papers.async_ekf.table import table

    known = [*SCENARIOS, "doppler", "all"]
    names = known[:-1] if scenario == "all" else [scenario]
    if scenario not in known:
        raise UserError(
            f"--scenario must be one of {', '.join(known)}, not '{scenario}'{did_you_mean(scenario, known)}"
        )
    check_runs(runs, seed)
    if plot is not None:
        _plot(plot, scenario, runs, seed)
    rows = []
    for name in names:
        say(f"scenario {name}")
        rows += doppler.table(runs, seed) if name == "doppler" else table(name, runs, seed)
    if json:
        print_json("paper async_ekf", {"scenario": scenario, "runs": runs, "seed": seed}, rows)
        return
    print_table(COLUMNS, rows, f"async_ekf, {runs} runs, seed {seed}", digits=3)


def _plot(path: Path, name: str, runs: int, seed: int) -> None:
    from boresight.papers.async_ekf.plot import plot
    from boresight.papers.async_ekf.scenario import SCENARIOS

    if name not in SCENARIOS:
        raise UserError(f"--plot shows one scenario: give --scenario {' or '.join(SCENARIOS)}")
    write_image(path, lambda part: plot(part, name, runs, seed))
