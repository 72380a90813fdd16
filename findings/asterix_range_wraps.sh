#!/usr/bin/env bash
# Expected: a plot just inside the largest range that the field holds is encoded as that largest range, or refused.
# What happens: libasterix and aviconv-asterix both round to the nearest count and drop the carry: a slant range of
# 255.999 NM in 048/040 becomes 0 NM, and vx = 8191.9 m/s in 062/185 becomes -8192 m/s; no error from either.
# Version: libasterix 0.36.3, aviconv-asterix 0.4.0. Why it matters: a plot at the edge of coverage lands on the radar
# itself, and a fast track flies backward; a range check by the caller (< 256 NM, < 8192 m/s) lets both through.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q libasterix==0.36.3 aviconv-asterix==0.4.0
"$dir/venv/bin/python" - <<'PY'
import sys
from importlib.metadata import version

import asterix.generated as gen
from aviconv_asterix import Cat048Record, encode_records, iter_records

print("libasterix", version("libasterix"), "aviconv-asterix", version("aviconv-asterix"))
seen = []
for rho in (255.99, 255.999):
    record = gen.Cat_048_1_32.cv_record.create({"040": (("RHO", (rho, "NM")), ("THETA", (45.0, "°")))})
    one = record.get_item("040").variation.get_item("RHO").variation.content.as_quantity("NM")
    other = next(iter(iter_records(encode_records([Cat048Record(sac=1, sic=2, rho_nm=rho, theta_deg=45.0)])))).rho_nm
    print(f"slant range {rho} NM -> libasterix {one} NM, aviconv {other} NM")
    seen += [one, other]
for vx in (8191.7, 8191.9):
    record = gen.Cat_062_1_20.cv_record.create({"185": (("VX", (vx, "m/s")), ("VY", (0.0, "m/s")))})
    seen.append(record.get_item("185").variation.get_item("VX").variation.content.as_quantity("m/s"))
    print(f"vx {vx} m/s -> libasterix {seen[-1]} m/s")
sys.exit(0 if seen[2:] == [0.0, 0.0, 8191.75, -8192.0] and min(seen[:2]) > 255.9 else 1)
PY
