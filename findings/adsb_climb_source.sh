#!/usr/bin/env bash
# Expected: two decoders agree on the source of an ADS-B climb rate: bit 36 of the velocity message, 0 geometric (GNSS),
# 1 barometric, as DO-260B has it.
# What happens: rs1090 names the source the other way round; pyModeS follows the bit. The rate itself is equal in both.
# Version: rs1090 0.7.0, pyModeS 3.6.1. Why it matters: a barometric rate belongs to a barometric height, a geometric one to a
# height above the ellipsoid; with the label inverted, a filter pairs each with the wrong one, off by the temperature.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q rs1090==0.7.0 pyModeS==3.6.1
"$dir/venv/bin/python" - <<'PY'
import sys
from importlib.metadata import version

import pyModeS
import rs1090

print("rs1090", version("rs1090"), "pyModeS", version("pyModeS"))


def message(source, subtype=1):
    bits = f"{19:05b}{subtype:03b}" + "00" + "010" + "0" + f"{10:010b}" + "1" + f"{161:010b}" + f"{source}"
    bits += "1" + f"{14:09b}" + "00" + "0" + f"{23:07b}"  # climb negative, (14 - 1) * 64 ft/min
    data = bytes.fromhex("8D485020") + int(bits, 2).to_bytes(7, "big")
    rest = int.from_bytes(data + b"\0\0\0", "big")
    for k in range(111, 23, -1):  # the 24-bit parity of Mode S
        if rest >> k & 1:
            rest ^= 0x1FFF409 << (k - 24)
    return (data + rest.to_bytes(14, "big")[-3:]).hex()


seen = []
for bit in (0, 1):
    one, two = rs1090.decode(message(bit)), pyModeS.decode(message(bit))
    assert two["crc_valid"] and one["vertical_rate"] == two["vertical_rate"] == -832
    seen.append((one["vrate_src"], two["vr_source"]))
    print(f"source bit {bit}: {message(bit)} rs1090 {seen[-1][0]}, pyModeS {seen[-1][1]}, {two['vertical_rate']} ft/min")
sys.exit(0 if seen == [("barometric", "GNSS"), ("GNSS", "BARO")] else 1)
PY
