#!/usr/bin/env bash
# Expected: a category 021 message of edition 0.26 fails when it is read as edition 2.1, for the two share hardly an item.
# What happens: it can parse to the last octet, without error, into one record: the time of day is read as a track number and
# a position from other octets. The edition is not on the wire, so that neither side can tell.
# Version: libasterix 0.36.3. Why it matters: old ADS-B ground stations still send 0.23-0.26; trying editions until one
# parses yields aircraft in places where none is. The edition has to be set for each source.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q libasterix==0.36.3
"$dir/venv/bin/python" - <<'PY'
import sys
from importlib.metadata import version

import asterix.generated as gen
from asterix.base import Bits, RawDatablock

print("libasterix", version("libasterix"))
old, new = gen.Cat_021_0_26, gen.Cat_021_2_1
sent = {"010": (("SAC", 1), ("SIC", 2)), "040": 0x0100, "030": (37487.0, "s"), "080": 0x42F429, "170": "SAS4411 ",
        "130": (("LAT", (59.9, "°")), ("LON", (11.8, "°"))), "140": (834.0, "ft"), "090": 0x0101, "210": 0,
        "145": (211.0, "FL"), "155": (-1543.0, "ft/min"), "160": (("GS", (0.0843, "NM/s")), ("TA", (285.8, "°"))),
        "200": 0, "020": 5}
wire = old.create([old.cv_record.create(sent)]).unparse().to_bytes()
print("sent as 0.26:", wire.hex(), "time of day 37487 s, 59.9 N 11.8 E")
records = new.cv_uap.parse(RawDatablock.parse(Bits.from_bytes(wire))[0].get_raw_records())
if isinstance(records, ValueError):
    sys.exit("read as 2.1: an error")
first = records[0]
track = first.get_item("161").variation.get_item("TRNUM").as_uint()
lat, lon = (first.get_item("130").variation.get_item(k).variation.content.as_quantity("°") for k in ("LAT", "LON"))
print(f"read as 2.1: {len(records)} record, no error, track number {track}, {lat:.2f} N {lon:.2f} E")
sys.exit(0 if len(records) == 1 and track == (37487 * 128 >> 8) & 0xFFF and abs(lat - 59.9) > 1 else 1)
PY
