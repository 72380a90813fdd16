#!/usr/bin/env bash
# Expected: a decoded flight level comes with its two quality bits, "not validated" (V) and "garbled" (G).
# What happens: aviconv-asterix gives the same record for a clean and for a garbled, unvalidated level in 048/090; only the
# raw octets differ. For the Mode 3/A code of the same report (048/070) it does give both bits.
# Version: aviconv-asterix 0.4.0. Why it matters: a garbled Mode C reply is the overlap of two replies and may be thousands
# of feet off; taken as a height it lifts the track, and a director looks above or below the aircraft.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q aviconv-asterix==0.4.0
"$dir/venv/bin/python" - <<'PY'
import sys
from importlib.metadata import version

from aviconv_asterix import iter_records

print("aviconv-asterix", version("aviconv-asterix"))


def read(flags):
    level, code = 350 * 4 | flags << 14, 0o1234 | flags << 14  # both items carry V and G in their two highest bits
    items = bytes([1, 2]) + code.to_bytes(2, "big") + level.to_bytes(2, "big")  # 010, 070, 090
    block = bytes([0b10001100]) + items
    record = next(iter(iter_records(bytes([48]) + (len(block) + 3).to_bytes(2, "big") + block)))
    return record.model_dump(exclude_none=True, exclude={"raw_items"})


clean, bad = read(0b00), read(0b11)
print("clean:             ", clean)
print("V and G set in both:", bad)
differ = sorted(k for k in bad if bad[k] != clean.get(k))
print("fields that differ:", differ)
sys.exit(0 if differ == ["mode3a_garbled", "mode3a_validated"] and bad["flight_level"] == 350.0 else 1)
PY
