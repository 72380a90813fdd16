#!/usr/bin/env bash
# Expected: a conversion from height above the ellipsoid to height above EGM96 without the geoid's grid raises, or gives inf.
# What happens: pyproj gives 500 m for 500 m without a warning, even with only_best=True; the accuracy it reports is -1.
# Only allow_ballpark=False refuses. The wheel carries no geoid grid, and the network is off by default.
# Version: pyproj 3.7.2. Why it matters: the geoid is up to 100 m from the ellipsoid: at 2 km, 40 m of height are 1.1 degrees of
# elevation, and a radar and a camera that differ in their reference give two targets for one.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q pyproj==3.7.2
"$dir/venv/bin/python" - <<'PY'
import os
import sys

for name in ("PROJ_DATA", "PROJ_LIB"):  # the folders of the wheel alone
    os.environ.pop(name, None)
os.environ.update(PROJ_NETWORK="OFF", PROJ_USER_WRITABLE_DIRECTORY=sys.prefix)
import pyproj
from pyproj.exceptions import ProjError

print("pyproj", pyproj.__version__, "PROJ", pyproj.proj_version_str)
seen = []
for option in ({}, {"only_best": True}, {"allow_ballpark": False}):
    try:
        change = pyproj.Transformer.from_crs("EPSG:4979", "EPSG:4326+5773", always_xy=True, **option)
        seen.append(change.transform(10.75, 59.9, 500.0)[2])
        print(option, "500 m above the ellipsoid ->", seen[-1], "m above EGM96; accuracy", change.accuracy)
    except ProjError as error:
        seen.append("refused")
        print(option, error)
sys.exit(0 if seen == [500.0, 500.0, "refused"] else 1)
PY
