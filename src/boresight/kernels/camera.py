"""Pinhole camera with Brown–Conrady distortion: pixels against directions in forward, right, down axes.

The parameters of a camera are (fx, fy, cx, cy, k1, k2, p1, p2, k3, s_max): focal lengths and centre in pixels, the
coefficients in OpenCV's order, and the square of the normalised radius at which the distortion folds over.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from boresight.kernels.geodesy import Arrays
from boresight.kernels.options import PART
from boresight.types.sensor import FloatArray

ITERATIONS = 50
Pair = tuple[float, float]


@njit(**PART)
def distort(c: FloatArray, x: float, y: float) -> Pair:
    """Return the distorted normalised coordinates of (x, y)."""
    s = x * x + y * y
    radial = 1.0 + s * (c[4] + s * (c[5] + s * c[8]))
    return (
        x * radial + 2.0 * c[6] * x * y + c[7] * (s + 2.0 * x * x),
        y * radial + c[6] * (s + 2.0 * y * y) + 2.0 * c[7] * x * y,
    )


@njit(**PART)
def distort_jacobian(c: FloatArray, x: float, y: float) -> tuple[float, float, float]:
    """Return the entries (xx, xy, yy) of the symmetric Jacobian of `distort`."""
    s = x * x + y * y
    radial = 1.0 + s * (c[4] + s * (c[5] + s * c[8]))
    slope = c[4] + s * (2.0 * c[5] + 3.0 * s * c[8])
    return (
        radial + 2.0 * x * x * slope + 2.0 * c[6] * y + 6.0 * c[7] * x,
        2.0 * x * y * slope + 2.0 * c[6] * x + 2.0 * c[7] * y,
        radial + 2.0 * y * y * slope + 6.0 * c[6] * y + 2.0 * c[7] * x,
    )


@njit(**PART)
def undistort(c: FloatArray, xd: float, yd: float) -> Pair:
    """Return (x, y) with `distort` = (xd, yd) by damped Newton steps inside the fold; NaN if there is none."""
    x, y = xd, yd
    s = x * x + y * y
    if s > c[9]:
        shrink = 0.9 * math.sqrt(c[9] / s)
        x *= shrink
        y *= shrink
    scale = 1e-14 * (1.0 + abs(xd) + abs(yd))
    for _ in range(ITERATIONS):
        px, py = distort(c, x, y)
        ex, ey = xd - px, yd - py
        if abs(ex) + abs(ey) < scale:
            return x, y
        a, b, d = distort_jacobian(c, x, y)
        det = a * d - b * b
        if not det > 0.0:
            return math.nan, math.nan
        step = 1.0
        dx, dy = (d * ex - b * ey) / det, (a * ey - b * ex) / det
        while step > 1e-6 and (x + step * dx) ** 2 + (y + step * dy) ** 2 >= c[9]:
            step *= 0.5
        x += step * dx
        y += step * dy
    px, py = distort(c, x, y)
    if abs(xd - px) + abs(yd - py) < 10.0 * scale:
        return x, y
    return math.nan, math.nan


@njit(cache=True)
def pixel_from_direction(
    c: FloatArray, forward: FloatArray, right: FloatArray, down: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return pixel columns (n,) of directions; NaN behind the camera and beyond the fold of the distortion."""
    n = len(forward)
    px, py = np.empty(n), np.empty(n)
    for i in range(n):
        px[i] = py[i] = math.nan
        if forward[i] > 0.0:
            x, y = right[i] / forward[i], down[i] / forward[i]
            if x * x + y * y < c[9]:
                x, y = distort(c, x, y)
                px[i], py[i] = c[0] * x + c[2], c[1] * y + c[3]
    return px, py


@njit(cache=True)
def direction_from_pixel(c: FloatArray, px: FloatArray, py: FloatArray) -> Arrays:
    """Return unit directions forward, right, down (n,) of pixels; NaN where no ray is distorted to the pixel."""
    n = len(px)
    forward, right, down = np.empty(n), np.empty(n), np.empty(n)
    for i in range(n):
        x, y = undistort(c, (px[i] - c[2]) / c[0], (py[i] - c[3]) / c[1])
        k = 1.0 / math.sqrt(1.0 + x * x + y * y)
        forward[i], right[i], down[i] = k, k * x, k * y
    return forward, right, down


@njit(cache=True)
def pixel_from_direction_jacobian(
    c: FloatArray, forward: FloatArray, right: FloatArray, down: FloatArray
) -> FloatArray:
    """Return d(pixel)/d(forward, right, down), (n, 2, 3)."""
    J = np.empty((len(forward), 2, 3))
    for i in range(len(forward)):
        x, y = right[i] / forward[i], down[i] / forward[i]
        a, b, d = distort_jacobian(c, x, y)
        k = 1.0 / forward[i]
        J[i, 0, 0], J[i, 0, 1], J[i, 0, 2] = -c[0] * k * (a * x + b * y), c[0] * k * a, c[0] * k * b
        J[i, 1, 0], J[i, 1, 1], J[i, 1, 2] = -c[1] * k * (b * x + d * y), c[1] * k * b, c[1] * k * d
    return J


@njit(cache=True)
def direction_from_pixel_jacobian(c: FloatArray, px: FloatArray, py: FloatArray) -> FloatArray:
    """Return d(forward, right, down)/d(pixel), (n, 3, 2), of unit directions."""
    J = np.empty((len(px), 3, 2))
    for i in range(len(px)):
        x, y = undistort(c, (px[i] - c[2]) / c[0], (py[i] - c[3]) / c[1])
        a, b, d = distort_jacobian(c, x, y)
        det = a * d - b * b
        k = 1.0 / math.sqrt(1.0 + x * x + y * y)
        k3 = k * k * k
        for j in range(2):
            # d(x, y)/d(pixel j)
            dx = d / (det * c[0]) if j == 0 else -b / (det * c[1])
            dy = -b / (det * c[0]) if j == 0 else a / (det * c[1])
            along = x * dx + y * dy
            J[i, 0, j] = -k3 * along
            J[i, 1, j] = k * dx - k3 * x * along
            J[i, 2, j] = k * dy - k3 * y * along
    return J
