"""Sine and cosine together, without branches, so that a loop over many angles is vectorised."""

from __future__ import annotations

import math

from numba import njit

# Half of pi in three parts of 33 bits: k times the first two is exact for |k| < 2**20 (Cody & Waite).
_PIO2_1, _PIO2_2, _PIO2_3 = 1.57079632673412561417, 6.07710050630396597660e-11, 2.02226624879595063154e-21
LARGEST = 1e6  # rad: beyond it the library's own functions are called


@njit(cache=True, inline="always")
def sincos_of_small(angle: float) -> tuple[float, float]:
    """Return (sin, cos) of an angle below LARGEST: reduction to ±π/4 and fdlibm's minimax polynomials."""
    k = math.floor(angle * (2.0 / math.pi) + 0.5)
    first = angle - k * _PIO2_1
    second = k * _PIO2_2
    r = first - second
    tail = k * _PIO2_3 - ((first - r) - second)
    x = r - tail
    z = x * x
    low = (r - x) - tail
    p = 8.33333333332248946124e-03 + z * (
        -1.98412698298579493134e-04
        + z * (2.75573137070700676789e-06 + z * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10))
    )
    s = x - ((z * (0.5 * low - z * x * p) - low) + z * x * 1.66666666666666324348e-01)
    q = z * (
        4.16666666666666019037e-02
        + z
        * (
            -1.38888888888741095749e-03
            + z
            * (
                2.48015872894767294178e-05
                + z * (-2.75573143513906633035e-07 + z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11))
            )
        )
    )
    half = 0.5 * z
    w = 1.0 - half
    c = w + (((1.0 - w) - half) + (z * q - x * low))
    quadrant = k - 4.0 * math.floor(0.25 * k)
    odd = quadrant == 1.0 or quadrant == 3.0
    sine = c if odd else s
    cosine = s if odd else c
    return (-sine if quadrant >= 2.0 else sine), (-cosine if quadrant == 1.0 or quadrant == 2.0 else cosine)


@njit(cache=True, inline="always")
def sincos(angle: float) -> tuple[float, float]:
    """Return (sin, cos) of an angle (rad), each within 1 ulp of the right one; NaN if it is not finite."""
    if not abs(angle) < LARGEST:
        if angle - angle != 0.0:
            return math.nan, math.nan
        return math.sin(angle), math.cos(angle)
    return sincos_of_small(angle)
