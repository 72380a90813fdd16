#!/usr/bin/env bash
# Expected: tracks that lie on the truth within a millimetre score next to zero, also when their time stamps are 1 ms from it.
# What happens: Stone Soup compares only states of equal time stamps: with 1 ms between them OSPA is the cutoff at each instant,
# of which there are twice as many, and GOSPA counts each truth as missed and each track as false.
# Version: stonesoup 1.9.1. Why it matters: sensors stamp in 1/128 s or in floats, truth in another clock; a tracker is called
# useless, or one is chosen over another, for the rounding of a time stamp.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q stonesoup==1.9.1
"$dir/venv/bin/python" - <<'PY'
import sys
from datetime import datetime, timedelta
from importlib.metadata import version

import numpy as np
from stonesoup.metricgenerator.ospametric import GOSPAMetric, OSPAMetric
from stonesoup.types.state import State

print("stonesoup", version("stonesoup"))


def states(late):
    begin = datetime(2026, 12, 1, 10) + timedelta(seconds=late)
    return [State(np.array([[float(k)], [0.0]]), timestamp=begin + timedelta(seconds=k)) for k in range(5)]


seen = []
for late in (0.0, 0.001):
    given = (states(late), [0] * 5, states(0.0), [0] * 5)
    ospa = [float(m.value) for m in OSPAMetric(c=10.0, p=1.0).compute_over_time(*given).value]
    gospa = [m.value for m in GOSPAMetric(c=10.0, p=1.0).compute_over_time(*given).value]
    missed, false = (sum(float(g[k]) for g in gospa) / 5 for k in ("missed", "false"))
    seen.append((len(ospa), max(ospa), missed, false))
    print(f"stamps {late} s apart: {len(ospa)} instants, OSPA {ospa}, missed {missed:g}, false {false:g}")
sys.exit(0 if seen[0] == (5, 0.0, 0.0, 0.0) and seen[1] == (10, 10.0, 5.0, 5.0) else 1)
PY
