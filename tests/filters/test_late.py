"""Late reports: any order of arrival within the window gives the in-order result; older ones are counted."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from boresight.errors import UserError
from boresight.filters import ekf
from boresight.filters.extended import ExtendedKalman
from boresight.filters.late import LateReports
from boresight.filters.ukf import UnscentedKalman
from boresight.models import Infrared, NearlyConstantVelocity, Radar

MOTION = NearlyConstantVelocity(0.5)
PRIOR = ekf.init(0.0, np.array([900.0, 500, 80, -10, 5, 0]), np.diag([400.0, 400, 400, 100, 100, 100]))


def rows(rng: np.random.Generator, k: int) -> list[tuple[float, Any, np.ndarray]]:
    t = np.cumsum(rng.uniform(0.01, 0.2, k))
    out = []
    for i, now in enumerate(t):
        truth = np.array([900 - 10 * now, 500 + 5 * now, 80.0, -10, 5, 0])
        sensor = Radar(5.0, 0.01, 0.01, 0.5) if i % 3 == 0 else Infrared(2e-3, 2e-3)
        out.append(
            (
                float(now),
                sensor,
                sensor.h(truth) + rng.normal(size=sensor.dimension) * np.sqrt(np.diag(sensor.R(truth))),
            )
        )
    return out


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), unscented=st.booleans())
def test_any_permutation_within_the_window_is_the_in_order_result(seed: int, unscented: bool) -> None:
    rng = np.random.default_rng(seed)
    reports = rows(rng, 40)
    filter_ = UnscentedKalman() if unscented else ExtendedKalman()
    state = PRIOR
    for t, sensor, z in reports:
        state, _ = filter_.update(filter_.predict(state, MOTION, t), sensor, z)
    # late by up to 1.5 s, a window of 2 s
    arrival = sorted(reports, key=lambda r: r[0] + rng.uniform(0.0, 1.5))
    late = LateReports(filter_, MOTION, window=2.0)
    now = late.init(PRIOR)
    for t, sensor, z in arrival:
        now, fate = late.update(now, t, sensor, z)
        assert fate.used
    np.testing.assert_allclose(now.state.x, state.x, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(now.state.P, state.P, rtol=1e-9, atol=1e-9)
    assert now.too_late == 0


def test_reports_older_than_the_window_are_counted_and_left_out() -> None:
    reports = rows(np.random.default_rng(1), 40)
    late = LateReports(ExtendedKalman(), MOTION, window=1.0)
    now = late.init(PRIOR)
    for t, sensor, z in reports[1:]:
        now, _ = late.update(now, t, sensor, z)
    before = now.state
    now, fate = late.update(now, *reports[0])
    assert fate == (False, 0)
    assert now.too_late == 1
    assert now.state is before
    assert all(r.t >= reports[-1][0] - 1.0 for r in now.reports)


def test_states_are_values_so_rewinding_leaves_the_old_one_alone() -> None:
    reports = rows(np.random.default_rng(2), 10)
    late = LateReports(ExtendedKalman(), MOTION)
    now = late.init(PRIOR)
    for row in reports[:8]:
        now, _ = late.update(now, *row)
    kept, x = now, now.state.x.copy()
    late.update(now, *reports[9])
    np.testing.assert_array_equal(kept.state.x, x)


def test_mistakes_are_named() -> None:
    with pytest.raises(UserError, match="window"):
        LateReports(ExtendedKalman(), MOTION, window=0.0)
