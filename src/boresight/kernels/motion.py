"""Motion kernels: fill the moved mean, its Jacobian F and the process noise Q, all exact over any interval.

Every motion kernel, a user's own too, is `kernel(x, dt, parameters, x_out, F, Q)`: `x` (n,) and `parameters` (k,) in,
`x_out` (n,), `F` (n, n) and `Q` (n, n) filled. Position first (d components), then velocity, then the rest.
"""

from __future__ import annotations

import math

from numba import njit

from boresight.types.sensor import FloatArray


@njit(cache=True)
def _apply(F: FloatArray, x: FloatArray, x_out: FloatArray) -> None:
    n = x.shape[0]
    for i in range(n):
        s = 0.0
        for j in range(n):
            s += F[i, j] * x[j]
        x_out[i] = s


@njit(cache=True)
def white_derivative(
    x: FloatArray, dt: float, parameters: FloatArray, x_out: FloatArray, F: FloatArray, Q: FloatArray
) -> None:
    """Chain of integrators driven by white noise: `parameters` = (d, order, q).

    Order 1 is nearly constant velocity (white acceleration, q in m²/s³), 2 nearly constant acceleration (white jerk,
    m²/s⁵), 3 nearly constant jerk (white snap, m²/s⁷). With i, j the derivatives 0…order,
    F_ij = dt^(j-i)/(j-i)!, Q_ij = q dt^p / (p (order-i)! (order-j)!), p = 2·order+1-i-j (Bar-Shalom 2001, 6.2).
    """
    d = int(parameters[0])
    order = int(parameters[1])
    q = parameters[2]
    F[:, :] = 0.0
    Q[:, :] = 0.0
    for i in range(order + 1):
        f = 1.0
        for j in range(i, order + 1):
            if j > i:
                f *= dt / (j - i)
            for a in range(d):
                F[i * d + a, j * d + a] = f
        for j in range(order + 1):
            p = 2 * order + 1 - i - j
            value = q * dt**p / (p * math.gamma(order - i + 1.0) * math.gamma(order - j + 1.0))
            for a in range(d):
                Q[i * d + a, j * d + a] = value
    _apply(F, x, x_out)
