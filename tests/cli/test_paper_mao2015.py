"""`boresight paper mao2015`: the JSON object that other tools read."""

from __future__ import annotations

import json

from tests.cli.conftest import Run


def test_the_command(run: Run) -> None:
    done = run("paper", "mao2015", "--runs", "3", "--seed", "2", "--json")
    assert done.code == 0
    told = json.loads(done.out)
    assert told["command"] == "paper mao2015"
    assert told["parameters"] == {"runs": 3, "seed": 2}
    assert all(set(row) == {"trajectory", "method", "az_deg", "el_deg", "ratio"} for row in told["rows"])
    methods = [row["method"] for row in told["rows"] if row["trajectory"] == "pass"]
    assert methods[0] == "equal"
    assert methods[-2:] == ["smoother", "bound"]
    assert {row["trajectory"] for row in told["rows"]} == {"straight", "weave", "hard", "pass"}
    assert json.loads(run("paper", "mao2015", "--runs", "3", "--seed", "2", "--json").out) == told
    assert run("paper", "mao2015", "--runs", "0").code == 2
