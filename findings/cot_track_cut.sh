#!/usr/bin/env bash
# Expected: what a CoT event says in <track> (course, speed, slope and the errors of each) survives XML -> TAK protobuf.
# What happens: takproto keeps speed and course and drops slope, eSpeed, eCourse and eSlope without a word, though it carries
# elements that it does not know whole. The same instant with "+00:00" for "Z" is refused.
# Version: takproto 3.0.1. Why it matters: a climbing aircraft becomes one in level flight, and the receiver can no longer
# tell a good velocity from a poor one: what is predicted from it points below the aircraft.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q takproto==3.0.1
"$dir/venv/bin/python" - <<'PY'
import sys
from importlib.metadata import version

from takproto.functions import parse_proto, xml2proto

print("takproto", version("takproto"))
event = (
    '<event version="2.0" uid="T1" type="a-u-A" how="m-r" time="{0}" start="{0}" stale="2026-12-01T10:00:10.250Z">'
    '<point lat="59.9" lon="10.7" hae="500" ce="12" le="20"/><detail><sensor vfov="4"/>'
    '<track course="90" speed="50" slope="12.5" eCourse="1.5" eSpeed="0.7" eSlope="2"/></detail></event>'
)
detail = parse_proto(bytearray(xml2proto(event.format("2026-12-01T10:00:00.250Z").encode()))).cotEvent.detail
print(detail)
try:
    xml2proto(event.format("2026-12-01T10:00:00.250+00:00").encode())
    offset = "read"
except ValueError as error:
    offset = "refused"
    print("+00:00:", error)
lost = not any(word in str(detail) for word in ("slope", "eCourse", "eSpeed", "12.5"))
sys.exit(0 if lost and detail.track.speed == 50.0 and "vfov" in detail.xmlDetail and offset == "refused" else 1)
PY
