"""How everything is timed: contenders take turns, medians of CPU time, beside the core's measured peak."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from numba import njit

from boresight.kernels.parts import WideCompiler

Contenders = dict[str, tuple[Callable[[], Any], int]]  # name -> (call, how many units of work one call does)
Row = dict[str, Any]


def timed(contenders: Contenders, rounds: int) -> dict[str, float]:
    """Return the median CPU time per unit of work (s), contenders taking turns."""
    spent: dict[str, list[float]] = {name: [] for name in contenders}
    for _ in range(rounds):
        for name, (call, units) in contenders.items():
            started = time.process_time()
            call()
            spent[name].append((time.process_time() - started) / units)
    return {name: statistics.median(values) for name, values in spent.items()}


def row(work: str, contender: str, value: float, unit: str, ratio: float = 1.0) -> Row:
    """Return one row of the table."""
    return {"work": work, "contender": contender, "value": value, "unit": unit, "ratio": ratio}


def rows_of(work: str, contenders: Contenders, rounds: int, unit: str, scale: float) -> list[Row]:
    """Time contenders, the first of which is ours, and return one row each; `ratio` is theirs over ours."""
    found = timed(contenders, rounds)
    ours = next(iter(found.values()))
    return [row(work, name, value * scale, unit, value / ours) for name, value in found.items()]


@njit(fastmath={"contract"}, cache=True, pipeline_class=WideCompiler)
def fused(a: np.ndarray, times: int) -> None:
    """Multiply and add, nothing else: 128 numbers that stay in registers and the first-level cache."""
    for _ in range(times):
        for i in range(128):
            a[i] = a[i] * 0.999999 + 1e-7


FUSED_TIMES = 20_000
_numbers = np.ones(136)
_numbers = _numbers[(-(_numbers.ctypes.data // 8)) % 8 :][:128]  # on a cache line


def peak() -> None:
    """One measurement of the core's peak: 2·128·FUSED_TIMES floating-point operations."""
    fused(_numbers, FUSED_TIMES)
