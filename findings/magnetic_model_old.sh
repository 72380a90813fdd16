#!/usr/bin/env bash
# Expected: a magnetic model refuses, or warns of, a date outside its five years.
# What happens: geomag carries the World Magnetic Model of 2015 (to the end of 2019) and extrapolates to any date without a word:
# for December 2026 it is 0.3 degrees off at Oslo and 6 degrees at 80 N 100 W, against the model of 2025.
# Version: geomag 0.9.2015, pygeomag 1.1.0. Why it matters: a compass-aligned director or a magnetic heading of the own ship
# turns by this error, and every bearing taken from it turns with it.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q geomag==0.9.2015 pygeomag==1.1.0
"$dir/venv/bin/python" - <<'PY'
import sys
from datetime import date
from importlib.metadata import version

import geomag
from pygeomag import GeoMag

print("geomag", version("geomag"), "pygeomag", version("pygeomag"))
new = GeoMag(coefficients_file="wmm/WMM_2025.COF")
gap = {}
for place, lat, lon in (("Oslo", 59.9, 10.75), ("Beaufort Sea", 70.0, -140.0), ("80 N 100 W", 80.0, -100.0)):
    old = geomag.declination(lat, lon, 0, date(2026, 12, 1))
    now = new.calculate(glat=lat, glon=lon, alt=0, time=2026.92).d
    gap[place] = abs(old - now)
    print(f"{place}: declination geomag {old:.2f}, WMM 2025 {now:.2f}, {gap[place]:.2f} degrees apart")
sys.exit(0 if 0.2 < gap["Oslo"] < 0.5 and gap["80 N 100 W"] > 5 else 1)
PY
