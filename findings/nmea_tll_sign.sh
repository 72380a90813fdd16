#!/usr/bin/env bash
# Expected: one reader gives one sign convention: south and west negative in every sentence.
# What happens: pynmeagps gives signed degrees for RMC, GLL and GGA, but for a radar target in TLL the absolute value; the
# hemisphere is in a field of its own, to be applied by the caller.
# Version: pynmeagps 1.1.8. Why it matters: the own ship is read from RMC and the target from TLL of the same radar; south of
# the equator, or west of Greenwich, the target is drawn in the other hemisphere.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q pynmeagps==1.1.8
"$dir/venv/bin/python" - <<'PY'
import sys
from functools import reduce
from importlib.metadata import version

from pynmeagps import NMEAReader

print("pynmeagps", version("pynmeagps"))


def read(body):
    sentence = f"${body}*{reduce(lambda a, c: a ^ ord(c), body, 0):02X}\r\n"
    print(sentence.strip())
    return NMEAReader.parse(sentence.encode())


ship = read("GPRMC,100021.00,A,3352.000,S,15112.000,W,5.0,90.0,011226,,,A")
target = read("RATLL,01,3352.000,S,15112.000,W,TGT1,100021.00,T,")
print("own ship (RMC):", ship.lat, ship.lon)
print("target (TLL):  ", target.targetlat, target.targetlon, target.targetlatNS, target.targetlonEW)
sys.exit(0 if ship.lat < 0 and ship.lon < 0 and target.targetlat == -ship.lat and target.targetlon == -ship.lon else 1)
PY
