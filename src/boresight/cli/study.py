"""`boresight study`: a scenario × parameter grid × many runs, over all cores."""

from __future__ import annotations

import contextlib
import json as json_module
import shutil
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from boresight.cli.output import print_json, print_table
from boresight.errors import UserError
from boresight.io.files import holds_others, reason

WRITTEN = ("runs.parquet", "cells.parquet", "study.png", "summary.json")  # beside the journal


def study(
    plan: Path,
    /,
    *,
    output: Annotated[Path | None, Parameter(name=["--output", "-o"])] = None,
    engine: str = "local",
    workers: int = 0,
    runs: int | None = None,
    force: bool = False,
    json: bool = False,
) -> None:
    """Simulate, track and score a scenario many times for every combination of parameters; a killed study goes on.

    Writes runs.parquet (one row a run), cells.parquet (one row a combination), study.png (error over Cramér-Rao bound
    and NEES per cell) and summary.json. Started again with the same plan it does only the runs that are missing.

    Parameters
    ----------
    plan
        STUDY.toml; docs/studies.md names every key.
    output
        Folder of the results (the plan's name with -results, in the present folder).
    engine
        local: processes of this machine; ray: a Ray cluster (extra ray). Both give the same numbers.
    workers
        Processes (0: one per core).
    runs
        Runs of every combination, instead of the plan's number.
    force
        Begin anew: forget what the output folder holds.
    json
        Print one JSON object instead of a table.
    """
    from boresight.study.engine import ENGINES, cores
    from boresight.study.plan import read_study

    if workers < 0 or engine not in ENGINES:
        raise UserError("--workers must be 0 or more" if workers < 0 else f"--engine {engine}: give local or ray")
    checked = read_study(plan, runs)
    folder = output if output is not None else Path(f"{plan.stem}-results")
    rows = _run(checked, folder, engine, workers or cores(), force)
    try:
        table = _finish(checked, folder, rows)
    except OSError as error:
        raise UserError(f"{folder}: cannot be written ({reason(error)}); the runs are kept") from None
    if json:
        parameters = {"plan": str(plan), "output": str(folder), "engine": engine, "seed": checked.seed}
        print_json("study", {**parameters, "runs": checked.runs, "keys": list(checked.keys)}, table)
        return
    columns = {key: key.split(".")[-1].replace("_", "\n") for key in checked.keys}
    columns |= {"runs": "runs", "position_rmse_m": "RMSE\nm", "bound_rmse_m": "bound\nm", "rmse_over_bound": "ratio"}
    columns |= {
        "nees_mean": "NEES",
        "gospa_rms_m": "GOSPA\nm",
        "tracked_fraction": "tracked",
        "false_track_s": "false\ns",
    }
    print_table(columns, table, f"{checked.name}: {len(table)} cells of {checked.runs} runs", digits=3)
    print(f"wrote {folder}: runs.parquet, cells.parquet, study.png")


def _run(checked: Any, folder: Path, engine: str, workers: int, force: bool) -> list[dict[str, Any]]:
    """Do the runs that the folder's journal lacks; returns all."""
    from boresight.study.engine import run_all
    from boresight.study.journal import JOURNAL, Journal
    from boresight.study.run import one_run

    if folder.exists() and not folder.is_dir():
        raise UserError(f"{folder}: exists and is not a folder; choose another output folder")
    if folder.is_dir():
        inside = {p.name for p in folder.iterdir()}
        foreign = sorted(inside - {JOURNAL, *WRITTEN} - {f".{name}" for name in WRITTEN})
        if foreign or (inside and JOURNAL not in inside):
            raise UserError(f"{folder}: {holds_others(foreign or sorted(inside))}")
        if force:
            shutil.rmtree(folder)
    with Journal(folder, checked.fingerprint()) as journal:
        done = {(r["cell"], r["run"]) for r in journal.rows}
        wanted = [(c, r) for r in range(checked.runs) for c in range(len(checked.cells)) if (c, r) not in done]
        if done and wanted:
            _tell(f"going on after {len(done)} runs, {len(wanted)} to do")
        if wanted and engine == "local":
            _warm(checked)
        tasks = [checked.task(c, r) for c, r in wanted]
        with _progress(len(done) + len(wanted), len(done)) as tick:
            for _, row in run_all(engine, one_run, tasks, min(workers, max(len(tasks), 1)), _tell):
                journal.add(row)
                tick()
        return journal.rows


def _warm(checked: Any) -> None:
    """Compile the kernels once, here, so that the workers find them in the cache."""
    from boresight.cli.track import loading

    with loading():
        from boresight.study.plan import build
        from boresight.tracking.tracker import Tracker
        from boresight.tracking.warm import warm_tracker

        for cell in set(zip(checked.scenarios, checked.trackers, strict=True)):
            scenario, config = build(json_module.loads(cell[0]), json_module.loads(cell[1]), 0, "study")
            sensors = tuple(s.sensor for s in scenario.sensors)
            warm_tracker(Tracker(config, sensors, scenario.dimensions))


def _finish(checked: Any, folder: Path, rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Write the results of all runs; returns the cells."""
    from boresight.door import versions
    from boresight.io.results import finite
    from boresight.study.plot import plot
    from boresight.study.table import cells, ordered, write_rows

    table = cells(checked, rows)
    write_rows(folder / "runs.parquet", ordered(rows))
    write_rows(folder / "cells.parquet", table)
    plot(folder / "study.png", checked, table, json_module.loads(checked.scenarios[0]).get("dimensions", 3))
    summary = {"study": checked.name, "keys": checked.keys, "runs": checked.runs, "seed": checked.seed}
    text = json_module.dumps(finite({**summary, "versions": versions(), "cells": table}), indent=1, allow_nan=False)
    (folder / "summary.json").write_text(text + "\n", encoding="utf-8")
    return table


def _tell(text: str) -> None:
    print(f"boresight: {text}", file=sys.stderr, flush=True)


@contextlib.contextmanager
def _progress(total: int, done: int) -> Iterator[Callable[[], None]]:
    """A bar on standard error where that is a terminal, else nothing."""
    if not sys.stderr.isatty():
        yield lambda: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("runs"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("runs", total=total, completed=done)
        yield lambda: bar.advance(task)
