"""Refraction: closed forms and published values."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from boresight.errors import UserError
from boresight.frames import refraction


@given(st.floats(-0.02, 1.57), st.floats(1.0, 1e6), st.floats(0, 1e4))
def test_both_ways(elevation: float, range_m: float, height: float) -> None:
    true = refraction.true_from_apparent(elevation, range_m, height)
    a, r = refraction.apparent_from_true(*true, height)
    assert a == pytest.approx(elevation, abs=1e-12)
    assert r == pytest.approx(range_m, rel=1e-12, abs=1e-9)


def test_without_bending_nothing_changes() -> None:
    e, r = refraction.true_from_apparent(0.1, 1e5, 100.0, factor=1.0)
    assert e == pytest.approx(0.1, abs=1e-14)
    assert r == pytest.approx(1e5, rel=1e-14)


def test_radar_height_is_the_textbook_one() -> None:
    """h = r²/(2·k·R) + r sin e, to first order: at 100 km and 0° 588 m over the 4/3 Earth."""
    e, r = refraction.true_from_apparent(0.0, 1e5)
    R = refraction.EARTH_RADIUS
    height = np.hypot(R + r * np.sin(e), r * np.cos(e)) - R
    assert height == pytest.approx(1e10 / (2 * 4 / 3 * R), rel=1e-3)
    assert e == pytest.approx(-1e5 / R * 0.125, rel=1e-3)  # half of (1 - 3/4) of the angle at the centre


def test_bennett_at_the_horizon() -> None:
    """34.5' at the apparent horizon, 5.3' at 10°, about 1' at 45° (Bennett 1982; Meeus, ch. 16)."""

    def bend(degrees: float) -> float:
        apparent = np.radians(degrees)
        return float(60 * np.degrees(apparent - refraction.sky_true_from_apparent(apparent)))

    assert bend(0.0) == pytest.approx(34.5, abs=0.1)
    assert bend(10.0) == pytest.approx(5.3, abs=0.1)
    assert bend(45.0) == pytest.approx(0.99, abs=0.02)


@given(st.floats(-0.005, 1.57))
def test_the_sky_both_ways(elevation: float) -> None:
    apparent = refraction.sky_apparent_from_true(elevation)
    assert refraction.sky_true_from_apparent(apparent) == pytest.approx(elevation, abs=1e-12)


def test_bad_input_is_told() -> None:
    with pytest.raises(UserError, match="between -1° and 90°"):
        refraction.sky_true_from_apparent(-0.1)
    with pytest.raises(UserError, match="range not negative"):
        refraction.true_from_apparent(0.1, -1.0)
