#!/usr/bin/env bash
# Expected: the heights that MISB ST 0601 writes as IMAPB (tag 104, sensor height above the ellipsoid, -900 to 40000 m) are read
# by IMAPB (ST 1201): powers of two for the scale, the highest bit kept for special values.
# What happens: klvdata maps them linearly over 0 to 65535: two octets for 1000 m give -307 m; three octets, which the
# standard also allows, raise ValueError.
# Version: klvdata 0.0.3. Why it matters: the height of the camera is the base of each line of sight: with 1300 m less, the
# place where a shallow line of sight meets the ground moves by kilometres.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q klvdata==0.0.3
"$dir/venv/bin/python" - <<'PY'
import math
import sys
from importlib.metadata import version

from klvdata.misb0601 import SensorEllipsoidHeightExtended

print("klvdata", version("klvdata"))


def imapb(x, low, high, octets):  # ST 1201, start and stop with low < 0 < high
    scale = 2.0 ** (8 * octets - 1 - math.ceil(math.log2(high - low)))
    return int(scale * (x - low) + scale * low - math.floor(scale * low)).to_bytes(octets, "big")


seen = []
for metres, octets in ((0.0, 2), (1000.0, 2), (10000.0, 2), (1000.0, 3)):
    data = imapb(metres, -900.0, 40000.0, octets)
    try:
        seen.append(round(SensorEllipsoidHeightExtended(data).value.value))
    except ValueError:
        seen.append("ValueError")
    print(f"{metres} m as IMAPB in {octets} octets {data.hex()} -> {seen[-1]}")
sys.exit(0 if seen[1] == -307 and seen[3] == "ValueError" else 1)
PY
