"""`boresight paper phased_array`: the JSON object that other tools read."""

from __future__ import annotations

import json

from tests.cli.conftest import Run


def test_the_command(run: Run) -> None:
    done = run("paper", "phased_array", "--scenario", "clean", "--runs", "1", "--seed", "3", "--json")
    assert done.code == 0
    told = json.loads(done.out)
    assert told["parameters"] == {"scenario": "clean", "runs": 1, "seed": 3}
    keys = {"scenario", "mode", "rmse_deg", "median_deg", "p95_deg", "above_1deg", "available", "reduction_vs_self"}
    assert all(set(row) == keys for row in told["rows"])
    assert [row["mode"] for row in told["rows"]] == ["as_printed", "fixed", "repaired", "filter", "self"]
    wrong = run("paper", "phased_array", "--scenario", "zenit")
    assert wrong.code == 2
    assert "did you mean 'zenith'" in wrong.err
