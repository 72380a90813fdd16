#!/usr/bin/env bash
# Expected: a pair of infinite cost is never assigned: an assignment without it, or an error as scipy gives.
# What happens: lap.lapjv assigns it, without error, and in a matrix with one allowed pair it leaves that pair out and assigns two
# forbidden ones; with cost_limit it works as expected.
# Version: lap 0.5.13, scipy 1.17.1. Why it matters: inf is how a gate is written into a cost matrix: a track takes a plot outside
# its gate while the plot inside goes to a track that it cannot belong to.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q lap==0.5.13 scipy==1.17.1 numpy==2.3.5
"$dir/venv/bin/python" - <<'PY'
import sys
from importlib.metadata import version

import lap
import numpy as np
from scipy.optimize import linear_sum_assignment

print("lap", version("lap"), "scipy", version("scipy"))
cost = np.array([[1.0, np.inf], [np.inf, np.inf]])
print(cost)
total, columns, _ = lap.lapjv(cost)
print("lap.lapjv:", columns, "costs", [float(cost[i, j]) for i, j in enumerate(columns)])
limited = lap.lapjv(cost, cost_limit=10.0)[1]
print("lap.lapjv with cost_limit=10:", limited)
try:
    linear_sum_assignment(cost)
    refused = False
except ValueError as error:
    refused = True
    print("scipy:", error)
sys.exit(0 if columns.tolist() == [1, 0] and limited.tolist() == [0, -1] and refused else 1)
PY
