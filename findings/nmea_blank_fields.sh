#!/usr/bin/env bash
# Expected: a TTM whose CPA fields hold a blank, as a real marine radar program sends when there is no CPA, is read like one
# whose CPA fields are empty.
# What happens: pynmeagps refuses the whole sentence, so that range and bearing are lost with it; pynmea2 passes the blank on as
# text where a number or None is expected. With empty fields both read it.
# Version: pynmeagps 1.1.8, pynmea2 1.19.0. Why it matters: targets without a CPA vanish from the feed, or the first
# comparison of a CPA fails; range and bearing are all that a tracker needs from the sentence.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q pynmeagps==1.1.8 pynmea2==1.19.0
"$dir/venv/bin/python" - <<'PY'
import sys
from functools import reduce
from importlib.metadata import version

import pynmea2
from pynmeagps import NMEAReader

print("pynmeagps", version("pynmeagps"), "pynmea2", version("pynmea2"))
seen = []
for cpa in ("", " "):
    body = f"RATTM,01,1.50,045.0,T,10.0,270.0,T,{cpa},{cpa},N,TGT1,T,,100021.00,A"
    sentence = f"${body}*{reduce(lambda a, c: a ^ ord(c), body, 0):02X}"
    print(sentence)
    try:
        seen.append(NMEAReader.parse(f"{sentence}\r\n".encode()).targetdist)
    except Exception as error:
        seen.append(type(error).__name__)
    print("   pynmeagps: distance", seen[-1])
    seen.append(pynmea2.parse(sentence, check=True).dist_cpa)
    print("   pynmea2: CPA", repr(seen[-1]))
sys.exit(0 if seen == [1.5, None, "NMEATypeError", " "] else 1)
PY
