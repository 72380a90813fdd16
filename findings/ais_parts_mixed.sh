#!/usr/bin/env bash
# Expected: the parts of a message are joined by receiver (the tag block's source) as well as by sequence number and channel.
# What happens: pyais joins by number and channel alone: two receivers, each with its tag block, send message 5 of two ships
# at once; one message comes out, the first part of one ship with the end of the other, and one ship is lost. No error.
# Version: pyais 3.3.1. Why it matters: receivers count 0-9 on their own, so that a feed of several stations meets this in
# daily use; a track then carries a destination, or in other messages a position, that nobody sent.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q pyais==3.3.1
"$dir/venv/bin/python" - <<'PY'
import sys
from functools import reduce
from importlib.metadata import version

from pyais import IterMessages, encode_dict

print("pyais", version("pyais"))


def tagged(source, sentence):
    tag = f"s:{source}"
    return f"\\{tag}*{reduce(lambda a, c: a ^ ord(c), tag, 0):02X}\\{sentence}".encode()


def ship(mmsi, name, to):
    return encode_dict({"type": 5, "mmsi": mmsi, "shipname": name, "destination": to})


a, b = ship(211111111, "ALPHA", "ROTTERDAM EUROPOORTA"), ship(222222222, "BRAVO", "GOTHENBURG ALVSBORGB")
feed = [tagged("north", a[0]), tagged("south", b[0]), tagged("north", a[1]), tagged("south", b[1])]
print(*(line.decode() for line in feed), sep="\n")
out = [m.decode() for m in IterMessages(feed)]
for m in out:
    print("->", m.mmsi, m.shipname, "bound for", m.destination)
sys.exit(0 if len(out) == 1 and out[0].destination not in ("ROTTERDAM EUROPOORTA", "GOTHENBURG ALVSBORGB") else 1)
PY
