"""A reported scalar beside the kinematics."""

from __future__ import annotations

import numpy as np
import pytest

from boresight.errors import UserError
from boresight.filters.attribute import Attribute

TEMPERATURE = Attribute(sigma=0.5, spread=20.0, mean=300.0, q=1e-3)


def test_constant_attribute_is_the_weighted_mean() -> None:
    z = np.random.default_rng(1).normal(310.0, 0.5, 50)
    state = TEMPERATURE.init(0.0)
    for value in z:
        state = TEMPERATURE.update(state, value)
    precision = 50 / 0.25 + 1 / 400.0
    assert state.mean == pytest.approx((z.sum() / 0.25 + 300.0 / 400.0) / precision)
    assert state.variance == pytest.approx(1 / precision)


def test_likelihood_tells_warm_from_cold_and_says_nothing_of_what_is_missing() -> None:
    warm = TEMPERATURE.update(TEMPERATURE.init(0.0), 310.0)
    assert TEMPERATURE.log_likelihood(warm, 310.1) > TEMPERATURE.log_likelihood(warm, 300.0) + 50.0
    assert TEMPERATURE.log_likelihood(warm, np.nan) == 0.0
    assert TEMPERATURE.update(warm, np.nan) is warm
    density = np.exp([TEMPERATURE.log_likelihood(warm, v) for v in np.linspace(300, 320, 4001)])
    assert density.sum() * 0.005 == pytest.approx(1.0, abs=1e-6)


def test_it_forgets_no_further_than_the_population() -> None:
    state = TEMPERATURE.predict(TEMPERATURE.update(TEMPERATURE.init(0.0), 310.0), 1e9)
    assert state.variance == 400.0


def test_mistakes_are_named() -> None:
    with pytest.raises(UserError, match="sigma"):
        Attribute(sigma=0.0, spread=1.0)
    with pytest.raises(UserError, match="backwards"):
        TEMPERATURE.predict(TEMPERATURE.init(1.0), 0.0)
