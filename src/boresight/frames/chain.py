"""Transforms in a row, with the Jacobian of the whole."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from boresight.frames import azel, geodetic, local
from boresight.types import Site
from boresight.types.sensor import FloatArray


class Step(NamedTuple):
    """A transform of vectors (..., n) to (..., m) and its Jacobian (..., m, n)."""

    value: Callable[[FloatArray], FloatArray]
    jacobian: Callable[[FloatArray], FloatArray]


def compose(*steps: Step) -> Step:
    """Return the steps one after the other, first to last, as one step."""

    def value(x: FloatArray) -> FloatArray:
        for step in steps:
            x = step.value(x)
        return x

    def jacobian(x: FloatArray) -> FloatArray:
        J: FloatArray = np.eye(x.shape[-1])
        for step in steps:
            J = step.jacobian(x) @ J
            x = step.value(x)
        return J

    return Step(value, jacobian)


def propagate(step: Step, x: FloatArray, covariance: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the value (..., m) and J P J' (..., m, m) of `x` (..., n) with covariance P (..., n, n)."""
    J = step.jacobian(x)
    out: FloatArray = J @ covariance @ np.swapaxes(J, -1, -2)
    return step.value(x), out


def turn(rotation: FloatArray, offset: FloatArray | float = 0.0) -> Step:
    """Return the step x → R x + offset: a rotation (3, 3), with the origin of the old axes in the new ones."""
    return Step(lambda x: x @ rotation.T + offset, lambda x: np.broadcast_to(rotation, (*x.shape[:-1], 3, 3)))


def _stacked(value: Callable[..., object], jacobian: Callable[..., FloatArray], *extra: Site) -> Step:
    return Step(
        lambda x: np.stack(value(*_split(x), *extra), axis=-1),  # type: ignore[call-overload]
        lambda x: jacobian(*_split(x), *extra),
    )


def _split(x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    return x[..., 0], x[..., 1], x[..., 2]


ECEF_FROM_GEODETIC = _stacked(geodetic.ecef_from_geodetic, geodetic.ecef_from_geodetic_jacobian)
GEODETIC_FROM_ECEF = _stacked(geodetic.geodetic_from_ecef, geodetic.geodetic_from_ecef_jacobian)
AZEL_FROM_ENU = _stacked(azel.azel_from_enu, azel.azel_from_enu_jacobian)
ENU_FROM_AZEL = _stacked(azel.enu_from_azel, azel.enu_from_azel_jacobian)


def enu_from_geodetic(site: Site) -> Step:
    """Return the step from (latitude, longitude, height) to (east, north, up) at a site."""
    return _stacked(local.enu_from_geodetic, local.enu_from_geodetic_jacobian, site)


def geodetic_from_enu(site: Site) -> Step:
    """Return the step from (east, north, up) at a site to (latitude, longitude, height)."""
    return _stacked(local.geodetic_from_enu, local.geodetic_from_enu_jacobian, site)
