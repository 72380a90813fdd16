"""Parts of kernels: right in their callers, refused from Python, found again in the cache by another process."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numba import njit
from numba.core import compiler
from numpy.typing import NDArray

from boresight.kernels.arctan import WIDE, WIDE_PASS
from boresight.kernels.options import LEAF
from boresight.kernels.parts import Flags

MODULE = """
import sys
from numba import njit
from boresight.kernels.options import LEAF, PART

@njit(**PART)
def total(a):
    s = 0.0
    for i in range(len(a)):
        if a[i] < 0.0:
            raise ValueError("negative")
        s += a[i]
    return s

@njit(**PART)
def mean(a):
    return total(a) / len(a)

@njit(**LEAF)
def half(x):
    return 0.5 * x

@njit(cache=True)
def first(a):
    return half(total(a))

@njit(cache=True)
def second(a, b):
    return total(a) + half(b)
"""
USE = """
import numpy as np, {module} as m
print(m.{call})
print(sum(m.total.stats.cache_hits.values()), sum(m.total.stats.cache_misses.values()))
try:
    m.total(np.ones(3))
except TypeError as error:
    print("part of a kernel" in str(error))
"""


def test_a_part_within_a_kernel_and_from_python() -> None:
    @njit(**{**LEAF, "cache": False})
    def largest(a: np.ndarray) -> float:
        best = a[0]
        for i in range(1, len(a)):
            best = max(best, a[i])
        return best

    @njit
    def kernel(a: np.ndarray, n: int) -> float:
        best = largest(a)
        for _ in range(n - 1):
            best *= largest(a)
        return best

    assert kernel(np.array([1.0, 3.0, 2.0]), 4) == 81.0
    with pytest.raises(TypeError, match="part of a kernel"):
        largest(np.array([1.0, 2.0]))


def test_parts_are_cached_for_other_kernels_of_other_processes(tmp_path: Path) -> None:
    """What a part raises, and what it returns, does not depend on who compiled it, nor on whether it was loaded."""
    (tmp_path / "parted.py").write_text(MODULE)

    def said(call: str) -> list[str]:
        code = f"import sys; sys.path.insert(0, {str(tmp_path)!r})\n" + USE.format(module="parted", call=call)
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
        assert done.returncode == 0, done.stderr
        return done.stdout.split("\n")

    assert said("first(np.arange(4.0))")[:3] == ["3.0", "0 1", "True"]
    assert said("second(np.arange(4.0), 5.0)")[:3] == ["8.5", "1 0", "True"]
    assert said("first(np.arange(4.0))")[:1] == ["3.0"]
    code = f"import sys; sys.path.insert(0, {str(tmp_path)!r})\nimport numpy as np, parted as m\nm.first(-np.ones(2))"
    failed = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
    assert "ValueError: negative" in failed.stderr


def test_a_part_from_the_cache_is_not_machine_code(tmp_path: Path) -> None:
    """It would be taken for the part of every kernel that is compiled later in the same process, and it is slow."""
    (tmp_path / "parted.py").write_text(MODULE)
    code = f"""
import sys; sys.path.insert(0, {str(tmp_path)!r})
import parted as m
from numba import float64
m.mean.compile((float64[::1],))
made = next(iter(m.mean.overloads.values()))
print(sum(m.mean.stats.cache_hits.values()), made.library.get_pointer_to_function(made.fndesc.llvm_func_name))
"""
    for hits in ("0", "1"):
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
        assert done.stdout.split() == [hits, "0"], done.stderr


def test_settings_compare_as_numba_compares_them() -> None:
    plain, other = compiler.Flags(), compiler.Flags()
    other.nrt = True
    default = compiler.Flags()
    default.nrt = False  # what it is anyway
    for a in (plain, other, default):
        for b in (plain, other, default):
            assert (Flags(a) == b) is (b == Flags(a)) is (Flags(a) == Flags(b)) is (a == b)
        assert hash(Flags(a)) == hash(a)
    assert Flags(other).get_mangle_string() == other.get_mangle_string()
    assert Flags(plain) != 1


def test_a_kernel_over_tiles_and_its_parts_may_use_the_widest_vectors() -> None:
    @njit(**{**WIDE_PASS, "cache": False})
    def part(a: NDArray[np.float64]) -> None:
        for i in range(64):
            a[i] = 2.0 * a[i] + 1.0

    @njit(**{**WIDE, "cache": False})
    def kernel(a: NDArray[np.float64]) -> float:
        part(a)
        return float(a[63])

    @njit(**{**WIDE, "cache": False})
    def alone(a: NDArray[np.float64]) -> None:
        for i in range(64):
            a[i] = 2.0 * a[i] + 1.0

    a = np.arange(64.0)
    assert kernel(a) == 127.0
    np.testing.assert_array_equal(a, 2.0 * np.arange(64.0) + 1.0)
    alone(a)
    for f in (part, alone):  # `kernel` holds the code of `part`
        assert '"prefer-vector-width"="512"' in next(iter(f.overloads.values())).library.get_llvm_str()
    with pytest.raises(TypeError, match="part of a kernel"):
        part(a)
