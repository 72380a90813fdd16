"""STUDY.toml: which scenario, which parameters, how many runs; and the cells that it spans."""

from __future__ import annotations

import copy
import itertools
import json
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from boresight.config.scenario import scenario_of
from boresight.config.tracker import tracker_config_of
from boresight.errors import UserError, did_you_mean
from boresight.io.toml import TableModel, convert, read_toml
from boresight.sim.scenario import Scenario
from boresight.tracking.config import TrackerConfig

Value = bool | int | float | str
ROOTS = ("scenario", "tracker")


class AxisTable(TableModel, frozen=True):
    """One `[[grid]]`: a key of the scenario or tracker and the values that it takes."""

    key: str
    values: tuple[Value, ...]


class StudyTable(TableModel, frozen=True):
    """The whole of STUDY.toml; paths are relative to it."""

    name: str
    scenario: str
    runs: int
    tracker: str | None = None
    seed: int = 0
    grid: tuple[AxisTable, ...] = ()


@dataclass(frozen=True, slots=True)
class Task:
    """One run of one cell: plain data, to be sent to a worker."""

    cell: int
    run: int
    seed: int
    scenario: str  # JSON of the scenario's table, the cell's values in it
    tracker: str  # JSON of the tracker's table


@dataclass(frozen=True, slots=True)
class Study:
    """A study that has been checked: every cell's scenario and tracker can be built."""

    name: str
    keys: tuple[str, ...]
    cells: tuple[tuple[Value, ...], ...]  # values by `keys`
    scenarios: tuple[str, ...]  # JSON, by cell
    trackers: tuple[str, ...]
    runs: int
    seed: int

    def task(self, cell: int, run: int) -> Task:
        """Return one run; all cells' runs of one number share their seed, so that cells differ by parameters alone."""
        seed = int(np.random.SeedSequence([self.seed, run]).generate_state(1)[0])
        return Task(cell, run, seed, self.scenarios[cell], self.trackers[cell])

    def fingerprint(self) -> str:
        """Return a short code of everything that results depend on."""
        content = json.dumps([self.name, self.keys, self.cells, self.scenarios, self.trackers, self.runs, self.seed])
        return f"{zlib.crc32(content.encode()):08x}"


def read_study(path: Path, runs: int | None = None) -> Study:
    """Read STUDY.toml and the files that it names; `runs` replaces its number of runs. Raises UserError."""
    where = str(path)
    table = convert(read_toml(path), StudyTable, where)
    number = table.runs if runs is None else runs
    if number < 1 or table.seed < 0:
        raise UserError(f"{where}: runs must be 1 or more, seed 0 or more")
    roots = {"scenario": read_toml(path.parent / table.scenario)}
    roots["tracker"] = read_toml(path.parent / table.tracker) if table.tracker is not None else {}
    for axis in table.grid:
        if not axis.values:
            raise UserError(f"{where}: grid key '{axis.key}' has no values")
    cells = tuple(itertools.product(*(axis.values for axis in table.grid)))
    keys = tuple(axis.key for axis in table.grid)
    for key in keys:
        if keys.count(key) > 1:
            raise UserError(f"{where}: grid key '{key}' stands twice")
    built = []
    for values in cells:
        data = copy.deepcopy(roots)
        for key, value in zip(keys, values):
            set_value(data, key, value, where)
        build(data["scenario"], data["tracker"], 0, where)  # a mistake shows before the first run
        built.append((json.dumps(data["scenario"]), json.dumps(data["tracker"])))
    scenarios, trackers = zip(*built)
    return Study(table.name, keys, cells, scenarios, trackers, number, table.seed)


def build(scenario: dict[str, Any], tracker: dict[str, Any], seed: int, where: str) -> tuple[Scenario, TrackerConfig]:
    """Return the scenario and tracker of one cell's tables; raises UserError."""
    plan, _ = scenario_of(scenario, f"{where}: scenario", seed)
    return plan, tracker_config_of(tracker, f"{where}: tracker", [s.sensor.id for s in plan.sensors])


def set_value(data: dict[str, Any], key: str, value: Value, where: str) -> None:
    """Set one value by its dotted key, in place: `scenario.sensors.radar.sigma_range_m`, `tracker.window_s`.

    In an array of tables the next word is an `id`. `tracker.KEY` is a key of the file's `[tracker]`,
    `tracker.sensor.ID.KEY` one of a `[[sensor]]`. Tables that are not there are made; raises UserError for an id that
    is not there.
    """
    root, *words = key.split(".")
    if root not in ROOTS or not words or not all(words):
        raise UserError(f"{where}: grid key '{key}' must begin with scenario. or tracker.{did_you_mean(root, ROOTS)}")
    here: Any = data[root]
    if root == "tracker" and words[0] != "sensor":
        here = here.setdefault("tracker", {})
    for word in words[:-1]:
        here = (
            here.setdefault(word, [] if (root, word) == ("tracker", "sensor") else {})
            if isinstance(here, dict)
            else (_by_id(here, word, key, where, make=root == "tracker"))
        )
    if not isinstance(here, dict):
        raise UserError(f"{where}: grid key '{key}' leads to no table: give an id before the last word")
    here[words[-1]] = value


def _by_id(tables: Any, name: str, key: str, where: str, make: bool) -> Any:
    if not isinstance(tables, list):
        raise UserError(f"{where}: grid key '{key}': '{name}' is not in a table")
    for table in tables:
        if isinstance(table, dict) and table.get("id") == name:
            return table
    if make:
        tables.append({"id": name})
        return tables[-1]
    known = [str(t.get("id")) for t in tables if isinstance(t, dict)]
    raise UserError(
        f"{where}: grid key '{key}': no id '{name}'{did_you_mean(name, known)}; there are {', '.join(known)}"
    )
