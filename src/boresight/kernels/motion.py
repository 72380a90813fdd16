"""Motion kernels: fill the moved mean, its Jacobian F and the process noise Q, all exact over any interval.

Every motion kernel, a user's own too, is `kernel(x, dt, parameters, x_out, F, Q)`: `x` (n,) and `parameters` (k,) in,
`x_out` (n,), `F` (n, n) and `Q` (n, n) filled. Position first (d components), then velocity, then the rest.
The built-in models share one kernel, `move`, told apart by `parameters[0]`, so that a set of them runs in one stream.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from boresight.kernels.options import PART
from boresight.types.sensor import FloatArray

CHAIN, SINGER, TURN, TURNING = 0, 1, 2, 3  # parameters[0]

_FACTORIAL = (1.0, 1.0, 2.0, 6.0)

# Gauss-Legendre nodes and weights on [0, 1]: exact to degree 19
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(10)
_NODES, _WEIGHTS = 0.5 * (_NODES + 1.0), 0.5 * _WEIGHTS


@njit(**PART)
def _apply(F: FloatArray, x: FloatArray, x_out: FloatArray) -> None:
    n = x.shape[0]
    for i in range(n):
        s = 0.0
        for j in range(n):
            s += F[i, j] * x[j]
        x_out[i] = s


@njit(**PART)
def white_derivative(
    x: FloatArray, dt: float, parameters: FloatArray, x_out: FloatArray, F: FloatArray, Q: FloatArray
) -> None:
    """Chain of integrators driven by white noise: `parameters` = (CHAIN, d, order, q).

    Order 1 is nearly constant velocity (white acceleration, q in m²/s³), 2 nearly constant acceleration (white jerk,
    m²/s⁵), 3 nearly constant jerk (white snap, m²/s⁷). With i, j the derivatives 0…order,
    F_ij = dt^(j-i)/(j-i)!, Q_ij = q dt^p / (p (order-i)! (order-j)!), p = 2·order+1-i-j (Bar-Shalom 2001, 6.2).
    """
    d = int(parameters[1])
    order = int(parameters[2])
    q = parameters[3]
    F[:, :] = 0.0
    Q[:, :] = 0.0
    if order == 1:  # by far the most used: written out
        for a in range(d):
            F[a, d + a] = dt
            F[a, a] = F[d + a, d + a] = 1.0
            Q[a, a] = q * dt * dt * dt / 3.0
            Q[a, d + a] = Q[d + a, a] = q * dt * dt / 2.0
            Q[d + a, d + a] = q * dt
            x_out[a] = x[a] + dt * x[d + a]
            x_out[d + a] = x[d + a]
        return
    power = np.empty(2 * order + 2)
    power[0] = 1.0
    for i in range(1, 2 * order + 2):
        power[i] = power[i - 1] * dt
    for i in range(order + 1):
        f = 1.0
        for j in range(i, order + 1):
            if j > i:
                f *= dt / (j - i)
            for a in range(d):
                F[i * d + a, j * d + a] = f
        for j in range(order + 1):
            p = 2 * order + 1 - i - j
            value = q * power[p] / (p * _FACTORIAL[order - i] * _FACTORIAL[order - j])
            for a in range(d):
                Q[i * d + a, j * d + a] = value
    _apply(F, x, x_out)


@njit(**PART)
def _decay(alpha: float, s: float) -> tuple[float, float, float]:
    """Return what an acceleration impulse that decays at rate `alpha` leaves after s: position, velocity, itself."""
    a = alpha * s
    e = math.exp(-a)
    if a > 0.05:
        return (a - 1.0 + e) / alpha**2, (1.0 - e) / alpha, e
    second = s * s * (1 / 2 - a * (1 / 6 - a * (1 / 24 - a * (1 / 120 - a * (1 / 720 - a / 5040)))))
    first = s * (1.0 - a * (1 / 2 - a * (1 / 6 - a * (1 / 24 - a * (1 / 120 - a * (1 / 720 - a / 5040))))))
    return second, first, e


@njit(**PART)
def singer(x: FloatArray, dt: float, parameters: FloatArray, x_out: FloatArray, F: FloatArray, Q: FloatArray) -> None:
    """Acceleration as an Ornstein-Uhlenbeck process (Singer 1970): `parameters` = (SINGER, d, tau, sigma).

    Acceleration forgets with time constant `tau` (s) about a standard deviation `sigma` (m/s²) per axis. Q is the
    integral of the impulse responses' products by Gauss-Legendre quadrature, exact to rounding.
    """
    d = int(parameters[1])
    alpha = 1.0 / parameters[2]
    q = 2.0 * alpha * parameters[3] ** 2
    F[:, :] = 0.0
    Q[:, :] = 0.0
    p, v, a = _decay(alpha, dt)
    for i in range(d):
        for k in range(3):
            F[k * d + i, k * d + i] = 1.0
        F[i, d + i] = dt
        F[i, 2 * d + i] = p
        F[d + i, 2 * d + i] = v
        F[2 * d + i, 2 * d + i] = a
    panels = 1 + int(alpha * dt / 2.0)
    h = dt / panels
    g = np.empty(3)
    for panel in range(panels):
        for k in range(_NODES.shape[0]):
            g[0], g[1], g[2] = _decay(alpha, (panel + _NODES[k]) * h)
            for i in range(3):
                for j in range(3):
                    for c in range(d):
                        Q[i * d + c, j * d + c] += q * _WEIGHTS[k] * h * g[i] * g[j]
    _apply(F, x, x_out)


@njit(**PART)
def _arc(w: float, s: float) -> tuple[float, float, float, float]:
    """Return sin(ws)/w, (1 - cos(ws))/w and their derivatives with respect to w; smooth through w = 0."""
    a = w * s
    if abs(a) < 1e-3:
        a2 = a * a
        return (
            s * (1.0 - a2 / 6.0),
            s * a * (0.5 - a2 / 24.0),
            -s * s * a * (1.0 / 3.0 - a2 / 30.0),
            s * s * (0.5 - a2 / 8.0),
        )
    sine, versine = math.sin(a), 2.0 * math.sin(0.5 * a) ** 2
    return sine / w, versine / w, (a * math.cos(a) - sine) / w**2, (a * sine - versine) / w**2


@njit(**PART)
def _turn(w: float, s: float, d: int, F: FloatArray) -> None:
    """Fill the position and velocity part of F for turning at rate `w` over `s`."""
    S, C, _, _ = _arc(w, s)
    c, n = math.cos(w * s), math.sin(w * s)
    for i in range(2 * d):
        for j in range(2 * d):
            F[i, j] = 1.0 if i == j else 0.0
    F[0, d] = S
    F[0, d + 1] = -C
    F[1, d] = C
    F[1, d + 1] = S
    F[d, d] = c
    F[d, d + 1] = -n
    F[d + 1, d] = n
    F[d + 1, d + 1] = c
    if d == 3:
        F[2, 5] = s


@njit(**PART)
def _turn_noise(w: float, dt: float, d: int, q: float, rate: float, v: FloatArray, Q: FloatArray) -> None:
    """Fill Q: white acceleration q on every axis, and `rate` (rad²/s³) on the turn rate of velocity `v` (d,)."""
    n = Q.shape[0]
    Q[:, :] = 0.0
    panels = 1 + int(abs(w) * dt / 2.0)
    h = dt / panels
    F = np.empty((2 * d, 2 * d))
    g = np.zeros(n)
    for panel in range(panels):
        for k in range(_NODES.shape[0]):
            s = (panel + _NODES[k]) * h
            weight = _WEIGHTS[k] * h
            _turn(w, s, d, F)
            for i in range(2 * d):
                for j in range(2 * d):
                    for c in range(d):
                        Q[i, j] += weight * q * F[i, d + c] * F[j, d + c]
            if rate > 0.0:
                _turn_sensitivity(w, s, math.cos(w * (dt - s)), math.sin(w * (dt - s)), v, d, g)
                g[2 * d] = 1.0
                for i in range(n):
                    for j in range(n):
                        Q[i, j] += weight * rate * g[i] * g[j]


@njit(**PART)
def _turn_sensitivity(w: float, s: float, c: float, n: float, v: FloatArray, d: int, g: FloatArray) -> None:
    """Fill the derivative by the rate of position and velocity after `s`; `v` is first turned by (c, n)."""
    e, o = c * v[0] - n * v[1], n * v[0] + c * v[1]
    _, _, dS, dC = _arc(w, s)
    cs, ns = math.cos(w * s), math.sin(w * s)
    g[0] = dS * e - dC * o
    g[1] = dC * e + dS * o
    g[d] = s * (-ns * e - cs * o)
    g[d + 1] = s * (cs * e - ns * o)


@njit(**PART)
def coordinated_turn(
    x: FloatArray, dt: float, parameters: FloatArray, x_out: FloatArray, F: FloatArray, Q: FloatArray
) -> None:
    """Turn at a known rate in the horizontal plane, level flight above it: `parameters` = (TURN, d, rate, q).

    `rate` (rad/s) is positive from east towards north; white acceleration `q` (m²/s³) on every axis, turned along.
    """
    d = int(parameters[1])
    _turn(parameters[2], dt, d, F)
    _turn_noise(parameters[2], dt, d, parameters[3], 0.0, x[d : 2 * d], Q)
    _apply(F, x, x_out)


@njit(**PART)
def turning(x: FloatArray, dt: float, parameters: FloatArray, x_out: FloatArray, F: FloatArray, Q: FloatArray) -> None:
    """Turn at a rate that is part of the state (position, velocity, rate): `parameters` = (TURNING, d, q, q_rate).

    The mean moves exactly at the present rate; white acceleration `q` (m²/s³), the rate a random walk of `q_rate`
    (rad²/s³), carried into position and velocity to first order.
    """
    d = int(parameters[1])
    w = x[2 * d]
    F[:, :] = 0.0
    _turn(w, dt, d, F)
    F[2 * d, 2 * d] = 1.0
    _apply(F, x, x_out)
    g = np.zeros(2 * d + 1)
    _turn_sensitivity(w, dt, 1.0, 0.0, x[d : 2 * d], d, g)
    for i in range(2 * d):
        F[i, 2 * d] = g[i]
    _turn_noise(w, dt, d, parameters[2], parameters[3], x[d : 2 * d], Q)


@njit(cache=True)
def move(x: FloatArray, dt: float, parameters: FloatArray, x_out: FloatArray, F: FloatArray, Q: FloatArray) -> None:
    """The built-in models in one kernel: `parameters[0]` says which."""
    kind = int(parameters[0])
    if kind == CHAIN:
        white_derivative(x, dt, parameters, x_out, F, Q)
    elif kind == SINGER:
        singer(x, dt, parameters, x_out, F, Q)
    elif kind == TURN:
        coordinated_turn(x, dt, parameters, x_out, F, Q)
    else:
        turning(x, dt, parameters, x_out, F, Q)
