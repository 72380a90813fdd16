#!/usr/bin/env bash
# Expected: an event's time is written as the instant given, to a digit of its own precision.
# What happens: PyCoT rounds to hundredths and writes 10:00:00.996 as 10:00:00.100, 0.9 s early, and it writes the local
# clock of a time with an offset followed by "Z": 10:00+02:00 becomes 10:00Z, two hours late. No error.
# Version: PyCoT 3.0.1. Why it matters: one event in two hundred steps back by 0.9 s, 220 m for an airliner; a receiver that
# orders by time drops it or sees a ghost manoeuvre.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q PyCoT==3.0.1
"$dir/venv/bin/python" - <<'PY'
import sys
import warnings
from datetime import datetime, timedelta, timezone
from importlib.metadata import version

from CoT import Event, Point

warnings.simplefilter("ignore")
print("PyCoT", version("PyCoT"))


def written(time):
    point = Point(lat=59.9, lon=10.7, hae=500, ce=12, le=20)
    event = Event(type="a-u-A", uid="T", how="m-r", time=time, start=time, stale=time + timedelta(seconds=5), point=point)
    text = event.xml().split(' time="')[1].split('"')[0]
    late = (datetime.fromisoformat(text.replace("Z", "+00:00")) - time).total_seconds()
    print(f"{time.isoformat()} -> {text}, {late:+.3f} s")
    return late


noon = datetime(2026, 12, 1, 10, tzinfo=timezone.utc)
late = [written(noon + timedelta(milliseconds=ms)) for ms in (250, 990, 996)]
late.append(written(noon.replace(tzinfo=timezone(timedelta(hours=2)))))
sys.exit(0 if [round(x, 3) for x in late] == [0.0, 0.0, -0.896, 7200.0] else 1)
PY
