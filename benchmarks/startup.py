"""Import, and a fresh process to its first update with kernels cached."""

from __future__ import annotations

import statistics
import subprocess
import sys
import time

from benchmarks.timing import Row, row

IMPORT = "import time; t = time.perf_counter(); import boresight; print(time.perf_counter() - t)"
FIRST = """
import numpy as np, boresight
state = boresight.GaussianState(0.0, np.array([4000.0, 3000, 1000, -100, 20, 0]), np.eye(6))
radar = boresight.Radar(5.0, 0.01, 0.01)
state, info = boresight.update(boresight.predict(state, boresight.NearlyConstantVelocity(q=0.5), 0.1), radar,
                               np.array([5000.0, 0.9, 0.2]))
from numba.core.dispatcher import Dispatcher
import gc
kernels = [d for d in gc.get_objects() if isinstance(d, Dispatcher) and d.py_func.__module__.startswith("boresight")]
print(sum(sum(d.stats.cache_misses.values()) for d in kernels))
"""


def output(code: str) -> tuple[float, float]:
    """Return the wall time of a fresh process (s) and the number that it prints."""
    started = time.perf_counter()
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return time.perf_counter() - started, float(done.stdout)


def rows(quick: bool) -> list[Row]:
    """Medians over fresh processes, the first of which fills the cache."""
    output(FIRST)
    imports = statistics.median(output(IMPORT)[1] for _ in range(3 if quick else 7))
    firsts = [output(FIRST) for _ in range(1 if quick else 7)]
    return [
        row("import boresight", "boresight", imports, "s"),
        row("process start to first cached update", "boresight", statistics.median(f[0] for f in firsts), "s"),
        row("cache misses in the second process", "boresight", firsts[0][1], "kernels"),
    ]
