#!/usr/bin/env bash
# Expected: a satellite that decays gives SGP4's error 6 ("the satellite has decayed") from then on.
# What happens: 70-80 km above the ground the first error is 1 ("mean eccentricity is outside the range"), without any 6;
# others reach the ground with error 6 and then are propagated again without error, minutes later.
# Version: sgp4 2.27 (compiled). Why it matters: a list of passes that asks for code 6, or asks only where the window ends,
# takes a satellite that has come down for one that flies; the first error of any kind, from the epoch on, is the end.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m pip install --quiet --target "$folder" sgp4==2.27 numpy==2.3.5 >/dev/null
PYTHONPATH="$folder" python3 - <<'PY'
import math
import sys
from importlib.metadata import version

import numpy as np
from sgp4.api import SGP4_ERRORS, WGS72, Satrec

print("sgp4", version("sgp4"))
seen = {}
for name, bstar, turns in (("quick", 2e-3, 16.2), ("slow", 2e-3, 15.9)):
    sat = Satrec()
    sat.sgp4init(WGS72, "i", 5, 27094.0, bstar, 0.0, 0.0, 0.0005, 1.0, 0.9, 1.0, turns * 2 * math.pi / 1440, 1.0)
    minutes = np.arange(0.0, 30 * 1440.0)
    error, r, _ = sat.sgp4_array(np.full(minutes.shape, sat.jdsatepoch), sat.jdsatepochF + minutes / 1440.0)
    first = int(np.flatnonzero(error)[0])
    height = np.linalg.norm(r[first - 1]) - 6378.0
    again = int(np.sum(error[first:] == 0))
    seen[name] = (int(error[first]), again > 0)
    print(f"{name}: first error on day {minutes[first] / 1440:.2f}, {height:.0f} km up: {error[first]} ({SGP4_ERRORS[int(error[first])]});")
    print(f"   codes in 30 days: {np.unique(error).tolist()}; minutes without an error after the first: {again}")
sys.exit(0 if seen == {"quick": (1, False), "slow": (6, True)} else 1)
PY
