"""Every Jacobian against central differences, over the whole domain."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from boresight.frames import array_face, attitude, azel, bearing, camera, chain, geodetic, local, refraction
from boresight.frames.array_face import Pole
from boresight.types import Site

SITE = Site(0.68, 1.74, 1400.0)
LENS = camera.Camera(640, 480, 500.0, 510.0, 320.0, 235.0, -0.28, 0.07, 1e-3, -5e-4, 0.01)
ANGLE = st.floats(-np.pi, np.pi)
LATITUDE = st.floats(-1.56, 1.56)
METRES = st.floats(-1e6, 1e6)


def central(f: Callable[[np.ndarray], np.ndarray], x: np.ndarray, h: np.ndarray) -> np.ndarray:
    """Central differences of fourth order, one column per input."""
    out = []
    for i in range(len(x)):
        e = np.zeros(len(x))
        e[i] = h[i]
        out.append((8 * (f(x + e) - f(x - e)) - (f(x + 2 * e) - f(x - 2 * e))) / (12 * h[i]))
    return np.stack(out, axis=-1)


def agree(J: np.ndarray, f: Callable[[np.ndarray], np.ndarray], x: np.ndarray, h: np.ndarray) -> None:
    """To 1e-7 of each row's size, in units of the steps: m and rad are not compared with each other."""
    numeric = central(f, x, h) * h
    scale = np.abs(numeric).max(axis=-1, keepdims=True)
    rounding = 1e-13 * np.maximum(np.abs(np.asarray(f(x))), 1.0)[:, None]  # of the differences themselves
    off = np.abs(J * h - numeric)
    assert (off <= 1e-7 * scale + rounding).all(), (off / scale, J * h, numeric)


def unwrapped(f: Callable[[np.ndarray], np.ndarray], x0: np.ndarray, angles: tuple[int, ...]) -> Callable:
    """`f` with its angles taken near those at x0."""
    base = np.asarray(f(x0))

    def g(x: np.ndarray) -> np.ndarray:
        y = np.asarray(f(x)).copy()
        for i in angles:
            y[i] = base[i] + (y[i] - base[i] + np.pi) % (2 * np.pi) - np.pi
        return y

    return g


@given(LATITUDE, ANGLE, st.floats(-1e4, 4e7))
def test_geodetic(latitude: float, longitude: float, height: float) -> None:
    x = np.array([latitude, longitude, height])
    h = np.array([1e-3, 1e-3, 1e3])
    near = min(1e-3, 0.1 * np.cos(latitude))
    forward = lambda v: np.stack(geodetic.ecef_from_geodetic(*v))  # noqa: E731
    agree(geodetic.ecef_from_geodetic_jacobian(*x), forward, x, np.array([near, near, 1e3]))
    ecef = forward(x)
    back = unwrapped(lambda v: np.stack(geodetic.geodetic_from_ecef(*v)), ecef, (1,))
    step = min(2e4, 0.01 * np.hypot(ecef[0], ecef[1]))
    agree(geodetic.geodetic_from_ecef_jacobian(*ecef), back, ecef, np.full(3, step))
    agree(local.enu_from_geodetic_jacobian(*x, SITE), lambda v: np.stack(local.enu_from_geodetic(*v, SITE)), x, h)


@given(METRES, METRES, st.floats(-1e5, 1e6))
def test_local(east: float, north: float, up: float) -> None:
    x = np.array([east, north, up])
    f = lambda v: np.stack(local.geodetic_from_enu(*v, SITE))  # noqa: E731
    agree(local.geodetic_from_enu_jacobian(*x, SITE), f, x, np.full(3, 1e4))
    ecef = np.stack(local.ecef_from_enu(*x, SITE))
    np.testing.assert_allclose(
        local.ecef_from_enu_rotation(SITE),
        central(lambda v: np.stack(local.ecef_from_enu(*v, SITE)), x, np.full(3, 1e5)),
        atol=1e-9,
    )
    assert np.isfinite(ecef).all()


@given(ANGLE, st.floats(-1.569, 1.569), st.floats(1.0, 1e7))
def test_azel(azimuth: float, elevation: float, range_m: float) -> None:
    x = np.array([azimuth, elevation, range_m])
    f = lambda v: np.stack(azel.enu_from_azel(*v))  # noqa: E731
    agree(azel.enu_from_azel_jacobian(*x), f, x, np.array([1e-3, 1e-3, 1e-3 * range_m]))
    enu = f(x)
    back = unwrapped(lambda v: np.stack(azel.azel_from_enu(*v)), enu, (0,))
    step = 1e-3 * np.hypot(enu[0], enu[1])
    agree(azel.azel_from_enu_jacobian(*enu), back, enu, np.full(3, step))


@given(ANGLE, st.floats(-1.5, 1.5), ANGLE, st.tuples(*[st.floats(-1, 1)] * 3))
def test_attitude(yaw: float, pitch: float, roll: float, v: tuple[float, float, float]) -> None:
    x = np.array([yaw, pitch, roll])
    agree(bearing.turned_vector_jacobian(*x, v), lambda a: attitude.ned_from_body(*a) @ v, x, np.full(3, 1e-3))


@given(st.floats(0, 639), st.floats(0, 479))
def test_camera(px: float, py: float) -> None:
    x = np.array([px, py])
    f = lambda p: camera.kernel.direction_from_pixel(LENS.parameters, p[:1], p[1:])  # noqa: E731
    agree(camera.direction_from_pixel_jacobian(LENS, px, py), lambda p: np.concatenate(f(p)), x, np.full(2, 0.5))
    d = camera.direction_from_pixel(LENS, px, py)
    g = lambda v: np.concatenate(camera.kernel.pixel_from_direction(LENS.parameters, *v[:, None]))  # noqa: E731
    agree(camera.pixel_from_direction_jacobian(LENS, d), g, d, np.full(3, 1e-3))


@given(st.floats(-np.pi, np.pi), st.floats(0.0, 1.5), st.sampled_from(list(Pole)))
def test_face(azimuth: float, off: float, pole: Pole) -> None:
    d = np.array([np.sin(off) * np.sin(azimuth), np.cos(off), np.sin(off) * np.cos(azimuth)])
    agree(
        array_face.cosines_from_face_jacobian(d),
        lambda v: np.stack(array_face.cosines_from_face(v)),
        d,
        np.full(3, 1e-3),
    )
    uv = np.stack(array_face.cosines_from_face(d))
    step = np.full(2, 1e-3 * np.cos(off) ** 2)
    agree(array_face.face_from_cosines_jacobian(*uv), lambda v: array_face.face_from_cosines(*v), uv, step)
    a, e, r = array_face.angles_from_face(d, pole)
    if np.cos(e) > 1e-3:
        f = unwrapped(lambda v: np.stack(array_face.angles_from_face(v, pole)), d, (0,))
        agree(array_face.angles_from_face_jacobian(d, pole), f, d, np.full(3, 1e-3 * np.cos(e)))
    x = np.array([a, e, r], dtype=float)
    back = lambda v: array_face.face_from_angles(v[0], v[1], pole, v[2])  # noqa: E731
    agree(array_face.face_from_angles_jacobian(a, e, pole, r), back, x, np.full(3, 1e-3))


@given(
    st.floats(-0.05, 1.5),
    st.floats(1e3, 1e6),
    st.floats(0, 2e4),
    st.sampled_from([1.0, refraction.RADAR, refraction.OPTICAL]),
)
def test_refraction(elevation: float, range_m: float, height: float, factor: float) -> None:
    x = np.array([elevation, range_m])
    f = lambda v: np.stack(refraction.true_from_apparent(v[0], v[1], height, factor))  # noqa: E731
    agree(refraction.true_from_apparent_jacobian(*x, height, factor), f, x, np.array([1e-3, 0.01 * range_m]))


@settings(max_examples=30)
@given(LATITUDE, ANGLE, st.floats(-100, 1e5))
def test_a_chain_is_the_product(latitude: float, longitude: float, height: float) -> None:
    whole = chain.compose(chain.enu_from_geodetic(SITE), chain.AZEL_FROM_ENU)
    x = np.array([latitude, longitude, height])
    steps = np.array([1e-4, 1e-4, 100.0])
    enu = chain.enu_from_geodetic(SITE).value(x)
    if np.hypot(enu[0], enu[1]) < 1e4:
        return
    agree(whole.jacobian(x), unwrapped(whole.value, x, (0,)), x, steps)
    y, P = chain.propagate(whole, x, np.diag([1e-12, 1e-12, 4.0]))
    J = whole.jacobian(x)
    np.testing.assert_allclose(P, J @ np.diag([1e-12, 1e-12, 4.0]) @ J.T)
    np.testing.assert_allclose(y, whole.value(x))


@pytest.mark.parametrize("shape", [(), (4,), (2, 3)])
def test_shapes(shape: tuple[int, ...]) -> None:
    one = np.full(shape, 0.3)
    assert geodetic.ecef_from_geodetic_jacobian(one, one, one).shape == (*shape, 3, 3)
    assert azel.azel_from_enu_jacobian(one, one, one).shape == (*shape, 3, 3)
    assert camera.direction_from_pixel_jacobian(LENS, one, one).shape == (*shape, 3, 2)
    assert refraction.true_from_apparent_jacobian(one, one, one).shape == (*shape, 2, 2)
    step = chain.compose(chain.turn(np.eye(3), 1.0), chain.AZEL_FROM_ENU)
    assert step.value(np.ones((*shape, 3))).shape == (*shape, 3)
    assert step.jacobian(np.ones((*shape, 3))).shape == (*shape, 3, 3)
