#!/usr/bin/env bash
# Expected: the course between two equal positions is undefined: nan, or an error.
# What happens: GeographicLib gives 180 degrees at and north of the equator and 0 degrees south of it; pyproj's Geod gives the
# same with the back azimuth turned. The distance is 0, and nothing says that the azimuth means nothing.
# Version: geographiclib 2.1, pyproj 3.7.2. Why it matters: a course taken from successive positions turns every ship at
# anchor north of the equator due south, and so does each repeated report; a smoothed course is drawn that way.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q geographiclib==2.1 pyproj==3.7.2
"$dir/venv/bin/python" - <<'PY'
import sys
from importlib.metadata import version

import pyproj
from geographiclib.geodesic import Geodesic

print("geographiclib", version("geographiclib"), "pyproj", pyproj.__version__)
seen = []
for lat in (60.0, 0.0, -60.0):
    line = Geodesic.WGS84.Inverse(lat, 10.0, lat, 10.0)
    other = pyproj.Geod(ellps="WGS84").inv(10.0, lat, 10.0, lat)
    seen.append((line["azi1"], other[0]))
    print(f"latitude {lat}: geographiclib course {line['azi1']}, {line['s12']} m; pyproj (azimuth, back, m) {other}")
sys.exit(0 if seen == [(180.0, 180.0), (180.0, 180.0), (0.0, 0.0)] else 1)
PY
