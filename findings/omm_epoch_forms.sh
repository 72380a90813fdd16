#!/usr/bin/env bash
# Expected: a reader of OMM takes each form of time that CCSDS 502.0 allows: with or without fraction, any number of decimals, Z,
# day of year; and an OMM without the optional TLE parameters.
# What happens: sgp4.omm reads calendar dates with 1 to 6 decimals only, and needs four keys that are optional.
# Version: sgp4 2.27. Why it matters: a catalogue from another provider than the usual one fails at the first object, on a format
# that is right; a loop that skips what raises loses that provider's satellites from the list of passes.
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
              MEAN_MOTION_DOT="0", MEAN_MOTION_DDOT="0")
def read(given, what):
    try:
        omm.initialize(Satrec(), given)
    except (ValueError, KeyError) as error:
        print(f"{what:36} {type(error).__name__}: {error}")
        return False
    print(f"{what:36} read")
    return True


times = ["11-30T12:00:00" + end for end in (".000000", ".5", "", "Z", ".000000Z", ".00000000")] + ["334T12:00:00.000000"]
taken = [read({**fields, "EPOCH": "2026-" + t}, "2026-" + t) for t in times]
optional = ("EPHEMERIS_TYPE", "CLASSIFICATION_TYPE", "ELEMENT_SET_NO", "REV_AT_EPOCH")
left = [read({k: v for k, v in fields.items() if k != key}, "without " + key) for key in optional]
sys.exit(0 if taken == [True, True] + [False] * 5 and not any(left) else 1)
PY
