#!/usr/bin/env bash
# Expected: a reader of SGP4 elements refuses an OMM that names another theory, frame or time scale, or acts on it.
# What happens: sgp4.omm takes MEAN_ELEMENT_THEORY SGP4-XP with EPHEMERIS_TYPE 4, or DSST, and REF_FRAME EME2000, and
# TIME_SYSTEM TAI, and computes the very position that it gives for SGP4, TEME and UTC; error code 0.
# Version: sgp4 2.27. Why it matters: the public catalogue offers SGP4-XP elements, which SGP4 does not propagate rightly; a TAI
# epoch is 37 s off, some 280 km along a low orbit: the antenna points past the satellite, and nothing has said why.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q sgp4==2.27
"$dir/venv/bin/python" - <<'PY'
import sys
from importlib.metadata import version

from sgp4 import omm
from sgp4.api import Satrec

print("sgp4", version("sgp4"))
fields = dict(OBJECT_NAME="X", OBJECT_ID="2000-001A", EPOCH="2026-11-30T12:00:00.000000", MEAN_MOTION="15.5", BSTAR="0.0001",
              ECCENTRICITY="0.0005", INCLINATION="51.6", RA_OF_ASC_NODE="10", ARG_OF_PERICENTER="20", MEAN_ANOMALY="30",
              EPHEMERIS_TYPE="0", CLASSIFICATION_TYPE="U", NORAD_CAT_ID="25544", ELEMENT_SET_NO="999", REV_AT_EPOCH="1",
              MEAN_MOTION_DOT="0", MEAN_MOTION_DDOT="0", MEAN_ELEMENT_THEORY="SGP4", REF_FRAME="TEME", TIME_SYSTEM="UTC")
changes = [{}, {"MEAN_ELEMENT_THEORY": "SGP4-XP", "EPHEMERIS_TYPE": "4"}, {"MEAN_ELEMENT_THEORY": "DSST"},
           {"REF_FRAME": "EME2000"}, {"TIME_SYSTEM": "TAI"}]
seen = []
for change in changes:
    sat = Satrec()
    omm.initialize(sat, {**fields, **change})
    error, position, _ = sat.sgp4(2461375.0, 0.25)
    seen.append((error, position))
    print(f"{str(change):66} error {error} at {position[0]:.3f} {position[1]:.3f} {position[2]:.3f} km")
sys.exit(0 if seen[0][0] == 0 and len(set(seen)) == 1 else 1)
PY
