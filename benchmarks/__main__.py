"""Speed against the peers in one run: `python -m benchmarks [--quick] [--json]` (the extra `bench` brings the peers).

Every contender's result is checked against ours before anything is timed; contenders take turns; the figure is the
median of the rounds, in CPU time. `ratio` is the contender's figure over ours (above 1: we are faster). Without --quick
the rows are also written to benchmarks/results.json and the table of docs/speed.md.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

from boresight._version import __version__
from boresight.tracking.cache import compiling_beside


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="fewer rounds and smaller sizes")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    arguments = parser.parse_args()
    try:
        import filterpy  # noqa: F401
        import stonesoup  # noqa: F401
    except ImportError as error:
        print(f"benchmarks: {error.name} is not installed; run make bench, or install the extra bench", file=sys.stderr)
        return 2
    quick = arguments.quick
    # where nothing is cached: one core for the tracker, one for the filters
    with compiling_beside(2, (0.0,) if quick else (0.1, 0.0)):
        from benchmarks import rows as every
        from benchmarks import table

        every.warm(quick)
    rows = every.all_rows(quick)
    result = {"command": "benchmarks", "version": __version__, "parameters": every.versions(), "rows": rows}
    if not arguments.quick:
        path = Path(__file__).with_name("results.json")
        path.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
        table.write(result)
    if arguments.json:
        print(json.dumps(result, indent=1))
        return 0
    print(f"{'work':44} {'contender':16} {'value':>12} {'unit':16} {'ratio':>9}")
    for r in rows:
        print(f"{r['work']:44} {r['contender']:16} {r['value']:12.4g} {r['unit']:16} {r['ratio']:9.4g}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
