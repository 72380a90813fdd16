#!/usr/bin/env bash
# Expected: a field that the caller leaves out of an AIS message is encoded as the standard's "not available":
# 91 N 181 E, speed 102.3 kn, course 360, heading 511, time stamp 60.
# What happens: pyais encodes 0 for each of them: a position report at 0 N 0 E, heading north, at second 0. The rate of turn
# and the navigational status of the same message do get their "not available".
# Version: pyais 3.3.1. Why it matters: a receiver cannot tell such a report from a measured one: a ship appears in the Gulf of
# Guinea, its heading turns the drawn hull north, and a fusion weighs a speed of 0 that nobody measured.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q pyais==3.3.1
"$dir/venv/bin/python" - <<'PY'
import sys
from importlib.metadata import version

from pyais import decode, encode_dict

print("pyais", version("pyais"))
absent = {"lon": 181.0, "lat": 91.0, "speed": 102.3, "course": 360.0, "heading": 511, "second": 60}
got = []
for kind in (1, 18):
    sentence = encode_dict({"type": kind, "mmsi": 219000001})
    fields = decode(*sentence).asdict()
    got.append({k: fields[k] for k in absent})
    print("message", kind, sentence[0])
    print("  ", got[-1], "turn and status:", fields.get("turn"), fields.get("status"))
full = decode(*encode_dict({"type": 1, "mmsi": 219000001, **absent})).asdict()
print("given by hand, all are carried:", all(full[k] == v for k, v in absent.items()))
sys.exit(0 if all(v == 0 for g in got for v in g.values()) and full["lat"] == 91.0 else 1)
PY
