"""Functions without branches, so that a loop over many tracks is vectorised: four-quadrant arctangent and wrapping;
and the exponential.

`FAST` are the compiler's settings of every kernel that takes part: products and sums may be fused, a division by zero
gives infinity instead of an exception, and small functions are put where they are called.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

from boresight.kernels.parts import PartCompiler, WideCompiler, WidePartCompiler

FAST: dict[str, Any] = {"cache": True, "fastmath": {"contract"}, "error_model": "numpy"}
PASS: dict[str, Any] = {**FAST, "pipeline_class": PartCompiler}  # called by kernels only
INLINE: dict[str, Any] = {**PASS, "forceinline": True}
WIDE: dict[str, Any] = {**FAST, "pipeline_class": WideCompiler}  # kernels over tiles, and
WIDE_PASS: dict[str, Any] = {**FAST, "pipeline_class": WidePartCompiler, "_nrt": False}  # what these call

_PI, _HALF_PI, _QUARTER_PI = 3.141592653589793, 1.5707963267948966, 0.7853981633974483
_TAN_EIGHTH = 0.41421356237309503  # tan(π/8)


@njit(**INLINE)
def arctan2(y: float, x: float) -> float:
    """Return atan2(y, x), within 2e-15; 0 (or ±π) where both are zero.

    The ratio of the smaller to the larger is brought below tan(π/8) by atan(a) = π/4 + atan((a - 1)/(a + 1)); there
    atan(t) = t + t³p(t²), where p (degree 10) interpolates at Chebyshev nodes. `arctan_coefficients` in the tests
    finds the same numbers again.
    """
    across, up = abs(x), abs(y)
    large, small = max(across, up), min(across, up)
    far = small > _TAN_EIGHTH * large
    top = small - large if far else small
    bottom = small + large if far else large
    t = top / (bottom if bottom > 0.0 else 1.0)
    s = t * t
    p = -0.01915602063681337
    p = 0.03921198015950306 + s * p
    p = -0.05084647217416281 + s * p
    p = 0.05857963647167232 + s * p
    p = -0.06664484840473793 + s * p
    p = 0.07692180731546636 + s * p
    p = -0.09090904431926902 + s * p
    p = 0.11111111009837867 + s * p
    p = -0.14285714284549836 + s * p
    p = 0.19999999999994253 + s * p
    p = -0.33333333333333326 + s * p
    angle = t + t * (s * p)
    angle = angle + (_QUARTER_PI if far else 0.0)
    angle = _HALF_PI - angle if up > across else angle
    angle = _PI - angle if x < 0.0 else angle
    return math.copysign(angle, y)


@njit(**INLINE)
def near(angle: float) -> float:
    """Wrap an angle to [-π, π] (rad)."""
    turns: float = np.floor(angle * (0.5 / _PI) + 0.5)
    return angle - 2.0 * _PI * turns


@njit(**INLINE)
def exponential(x: float) -> float:
    """Return exp(x) for |x| ≤ 60, limited to that, within 4e-14 of its value: exp(x/64) by its series, 64th power."""
    t = min(max(x, -60.0), 60.0) * (1.0 / 64.0)
    p = 1.0 / 355687428096000.0  # 1/17!
    for n in (
        20922789888000.0, 1307674368000.0, 87178291200.0, 6227020800.0, 479001600.0, 39916800.0, 3628800.0, 362880.0,
        40320.0, 5040.0, 720.0, 120.0, 24.0, 6.0, 2.0, 1.0, 1.0,
    ):  # fmt: skip
        p = 1.0 / n + t * p
    p = p * p
    p = p * p
    p = p * p
    p = p * p
    p = p * p
    return p * p
