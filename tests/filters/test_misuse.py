"""Filters called with what they cannot take: one line of error, never a traceback, a crash or a negative variance."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from boresight import GaussianState, NearlyConstantVelocity, Radar, predict, update
from boresight.errors import UserError
from boresight.filters import packed, stream

MOTION = NearlyConstantVelocity(1.0)
RADAR = Radar(sigma_range=10.0, sigma_azimuth=0.01, sigma_elevation=0.01)
X = np.array([1000.0, 2000.0, 300.0, 10.0, 0.0, 0.0])
P = np.diag([100.0, 100.0, 100.0, 10.0, 10.0, 10.0])
Z = np.array([2250.0, 0.46, 0.13])


def _with(at: tuple[int, int], value: float) -> np.ndarray:
    out = P.copy()
    out[at] = value
    return out


STATES: dict[str, tuple[Any, Any, Any]] = {
    "lists": (0.0, X.tolist(), P),
    "list of P": (0.0, X, P.tolist()),
    "short": (0.0, X[:5], P),
    "short too": (0.0, X[:5], P[:5, :5]),
    "P short": (0.0, X, P[:5, :5]),
    "negative": (0.0, X, _with((0, 0), -1.0)),
    "negative speed": (0.0, X, _with((5, 5), -1.0)),
    "not symmetric": (0.0, X, _with((0, 1), 50.0)),
    "not positive": (0.0, X, _with((0, 1), 200.0) + _with((1, 0), 200.0) - P),
    "NaN in P": (0.0, X, _with((1, 1), np.nan)),
    "inf in P": (0.0, X, _with((1, 1), np.inf)),
    "NaN in x": (0.0, np.full(6, np.nan), P),
    "inf in x": (0.0, np.full(6, np.inf), P),
    "text": (0.0, np.array(["a"] * 6), P),
    "nothing": (0.0, None, None),
    "two-dimensional": (0.0, X[None], P),
}
MEASUREMENTS: dict[str, Any] = {
    "short": Z[:2],
    "long": np.r_[Z, Z],
    "infinite": np.array([np.inf, 0.4, 0.1]),
    "negative range": np.array([-5.0, 0.1, 0.1]),
    "text": "abc",
    "two-dimensional": Z[None],
}


def _one_line(call: Callable[[], Any]) -> None:
    with pytest.raises(UserError) as told:
        call()
    assert "\n" not in str(told.value)


@pytest.mark.parametrize("name", STATES)
def test_a_state_that_is_none(name: str) -> None:
    state = GaussianState(*STATES[name])
    if name != "not positive":  # moved, its variances stay positive: the update says so, if it shows
        _one_line(lambda: predict(state, MOTION, 1.0))
        _one_line(lambda: update(state, RADAR, Z))
    _one_line(lambda: packed.pack(state, MOTION))
    _one_line(lambda: stream.run(state, MOTION, stream.stack([1.0], [RADAR], [Z])))


@pytest.mark.parametrize("name", MEASUREMENTS)
def test_a_measurement_that_is_none(name: str) -> None:
    z = MEASUREMENTS[name]
    _one_line(lambda: update(GaussianState(0.0, X, P), RADAR, z))
    _one_line(lambda: packed.report(RADAR, 1.0, z))
    _one_line(lambda: packed.table([1.0], [RADAR], [z]))
    _one_line(lambda: stream.stack([1.0], [RADAR], [z]))


def test_models_and_times_that_are_none() -> None:
    state: Any = GaussianState(0.0, X, P)
    other: Any = (0.0, X, P)
    nothing: Any = None
    for t in (np.nan, np.inf, "1", None, np.array([1.0, 2.0]), -1.0):
        late: Any = t
        _one_line(lambda late=late: predict(state, MOTION, late))  # type: ignore[misc]
    for n in (-1, 7, "a", 2.5):
        count: Any = n
        _one_line(lambda count=count: update(state, RADAR, Z, n_estimated=count))  # type: ignore[misc]
    _one_line(lambda: predict(other, MOTION, 1.0))
    _one_line(lambda: update(other, RADAR, Z))
    _one_line(lambda: predict(state, nothing, 1.0))
    _one_line(lambda: update(state, nothing, Z))
    _one_line(lambda: predict(state, NearlyConstantVelocity(1.0, dimensions=2), 1.0))


def test_tables_that_do_not_fit() -> None:
    belief, table = packed.pack(GaussianState(0.0, X, P), MOTION), packed.table([1.0], [RADAR], [Z])
    before = belief.copy()
    longer = packed.table([1.0, 2.0], [RADAR] * 2, [Z] * 2)
    listed: Any = belief.tolist()
    for call in (
        lambda: packed.run(listed, table),
        lambda: packed.run(belief.astype(np.float32), table),
        lambda: packed.run(belief[:20], table),
        lambda: packed.run(belief, table._replace(sensor=np.array([9999999]))),
        lambda: packed.run(belief, table._replace(sensor=np.array([-1]))),
        lambda: packed.run(belief, table._replace(contexts=table.contexts[:, :5])),
        lambda: packed.run(belief, longer._replace(z=table.z)),
        lambda: packed.run(belief, table, np.zeros((1, 3))),
        lambda: packed.run(belief, table, nis=np.zeros(3)),
    ):
        _one_line(call)
    np.testing.assert_array_equal(belief, before)


@pytest.mark.parametrize(
    "change",
    [
        {"x0": X},
        {"x0": np.full((3, 6), np.nan)},
        {"x0": np.tile(X, (3, 1))[:, :5]},
        {"P0": P[:5, :5]},
        {"P0": _with((0, 0), -1.0)},
        {"P0": _with((0, 1), 50.0)},
        {"P0": _with((0, 0), np.nan)},
        {"t": [np.nan]},
        {"t0": np.nan},
        {"z": [np.zeros((2, 3))]},
    ],
)
def test_many_tracks_that_do_not_fit(change: dict[str, Any]) -> None:
    good: dict[str, Any] = {"t0": 0.0, "x0": np.tile(X, (3, 1)), "P0": P, "t": [1.0], "sensors": [RADAR]}
    good["z"] = [np.tile(Z, (3, 1))]
    assert np.isfinite(packed.run_many(MOTION, **good).x).all()
    _one_line(lambda: packed.run_many(MOTION, **{**good, **change}))
