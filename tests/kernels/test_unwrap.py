"""Kernels that look at Python's objects themselves take what they can use and nothing else."""

from __future__ import annotations

import os
import subprocess
import sys
from typing import Any

import numpy as np
import pytest
from numba import njit, types

from boresight.errors import UserError
from boresight.filters import ekf, own, packed
from boresight.kernels import config
from boresight.kernels.unwrap import THING, direct, matrix, vector
from boresight.models import NearlyConstantVelocity, Radar
from boresight.types.state import GaussianState

X = np.array([4000.0, 3000, 1000, -100, 20, 0])
P = np.diag([1e4, 1e4, 1e4, 400, 400, 400])
MOTION, RADAR = NearlyConstantVelocity(q=0.5), Radar(5.0, 0.01, 0.01)
Z = np.array([5090.0, 0.92, 0.2])


@njit(types.UniTuple(types.float64, 4)(THING, THING))
def look(one: Any, two: Any) -> tuple[float, float, float, float]:
    v, m = vector(one), matrix(two)
    return v.shape[0], v.sum(), m.shape[0] * 1000.0 + m.shape[1], (m * m).sum()


class Sub(np.ndarray):
    """An array of another type, whose numbers may mean something else."""


def read_only(a: np.ndarray) -> np.ndarray:
    out = a.copy()
    out.flags.writeable = False
    return out


def unaligned(a: np.ndarray) -> np.ndarray:
    out = np.empty(a.nbytes + 1, np.uint8)[1:].view(float).reshape(a.shape)
    out[...] = a
    return out


UNUSABLE = {
    "whole numbers": lambda a: np.nan_to_num(a).astype(np.int64),
    "single": lambda a: a.astype(np.float32),
    "complex": lambda a: a.astype(complex),
    "other bytes first": lambda a: a.astype(">f8" if sys.byteorder == "little" else "<f8"),
    "every other number": lambda a: np.repeat(a, 2, axis=-1)[..., ::2],
    "read only": read_only,
    "unaligned": unaligned,
    "subclass": lambda a: a.view(Sub),
    "one dimension more": lambda a: a[None],
    "list": lambda a: a.tolist(),
    "nothing": lambda a: None,
    "number": lambda a: 3.0,
    "type": lambda a: np.ndarray,
}


def test_what_is_usable_is_seen_whole() -> None:
    for rows in (1, 5, 200):
        v, m = np.arange(float(rows)), np.arange(3.0 * rows).reshape(rows, 3)
        assert direct(look)(v, m) == (rows, v.sum(), rows * 1000.0 + 3, (m * m).sum())
    assert direct(look)(np.empty(0), np.empty((0, 3))) == (0, 0, 3, 0)


@pytest.mark.parametrize("case", UNUSABLE)
def test_what_is_not_usable_has_no_numbers(case: str) -> None:
    make = UNUSABLE[case]
    v, m = make(np.arange(8.0)), make(np.arange(9.0).reshape(3, 3))
    if case == "one dimension more":
        m = make(m)
    references = sys.getrefcount(v)
    assert direct(look)(v, m) == (0, 0, 0, 0)
    assert v is None or sys.getrefcount(v) == references


@pytest.mark.parametrize("case", UNUSABLE)
def test_packed_steps_say_what_they_take(case: str) -> None:
    make = UNUSABLE[case]
    belief, report = packed.pack(ekf.init(0.0, X, P), MOTION), packed.report(RADAR, 0.1, Z)
    before = belief.copy()
    for b, r in ((make(belief), report), (belief, make(report)), (belief[:-1], report), (belief, report[:-1])):
        with pytest.raises(UserError, match="as pack and report make them"):
            packed.step(b, r)
    np.testing.assert_array_equal(belief, before)


@pytest.mark.skipif(config.DISABLE_JIT, reason="needs compiled kernels")
@pytest.mark.parametrize("case", UNUSABLE)
def test_steps_of_own_models_say_what_they_take(case: str) -> None:
    make = UNUSABLE[case]
    used, mine, seen = own.models(MOTION, RADAR), own.pack(ekf.init(0.0, X, P), MOTION), own.report(RADAR, 0.1, Z)
    for b, r in ((make(mine), seen), (mine, make(seen)), (mine[:20], seen), (mine, seen[:7])):
        with pytest.raises(UserError, match="as pack and report make them"):
            own.step(b, r, used.motion, used.observe)


@pytest.mark.parametrize(
    "case", ["whole numbers", "single", "every other number", "read only", "unaligned", "subclass"]
)
def test_the_filter_takes_other_arrays_by_the_way_for_all(case: str) -> None:
    make = UNUSABLE[case]
    mean, z = np.round(X), np.array([5090.0, 1.0, 0.0])
    expected, seen = ekf.update(ekf.predict(GaussianState(0.0, mean, P), MOTION, 0.1), RADAR, z)
    got, info = ekf.update(ekf.predict(GaussianState(0.0, make(mean), make(P)), MOTION, 0.1), RADAR, make(z))
    np.testing.assert_allclose(got.x, expected.x, rtol=1e-6)
    np.testing.assert_allclose(got.P, expected.P, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(info.S, seen.S, rtol=1e-6, atol=1e-12)


def test_results_are_their_own() -> None:
    """Nothing that was given is changed, or shared with what comes back."""
    state = ekf.init(0.0, X, P)
    moved = ekf.predict(state, MOTION, 0.1)
    after, info = ekf.update(moved, RADAR, Z)
    arrays = (state.x, state.P, moved.x, moved.P, after.x, after.P, info.y, info.S, Z, RADAR.context)
    assert not any(np.shares_memory(a, b) for i, a in enumerate(arrays) for b in arrays[:i])
    np.testing.assert_array_equal(state.x, X)


def test_the_same_without_compiler() -> None:
    env = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    told = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", __file__, "-k", "not compiler"],
        capture_output=True, text=True, env=env, check=False,
    )  # fmt: skip
    assert told.returncode == 0, told.stdout
