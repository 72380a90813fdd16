"""Models that a user writes: plain NumPy functions, compiled into kernels so that streams run at full speed.

What Numba can compile of NumPy is most of it (np.array, np.sqrt, np.arctan2, slicing, @ …); a function that it cannot
compile still works unwrapped, as a class with the methods of `models.protocols`, one step at a time.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from numba.core.errors import NumbaError

from boresight.errors import UserError
from boresight.models import check
from boresight.models.motion.base import KernelMotion
from boresight.types.enums import N_COMPONENTS
from boresight.types.sensor import FloatArray

Function = Callable[..., Any]


@dataclass(frozen=True, eq=False)
class OwnMotion(KernelMotion):
    """A motion model around a user's kernel; made by `own_motion`, or from an `@njit` kernel (see kernels.motion)."""

    kernel: Function  # type: ignore[misc]  # one per object here, not per class
    size: int
    parameters: FloatArray
    dimensions: int = 3

    def __post_init__(self) -> None:
        check.spatial(self.dimensions)
        object.__setattr__(self, "parameters", np.array(self.parameters, dtype=float).ravel())

    @property
    def layout(self) -> tuple[str, ...]:  # type: ignore[override]
        """An IMM matches position and velocity; further components are this model's own."""
        rest = self.size - 2 * self.dimensions
        return ("position", "velocity", *(f"own_{id(self)}_{i}" for i in range(rest)))

    @property
    def state_dimension(self) -> int:
        """Length n of the state."""
        return self.size


@dataclass(frozen=True, eq=False)
class OwnSensor:
    """A measurement model around a user's kernel; made by `own_sensor`, or from an `@njit` kernel of one's own.

    The kernel is `kernel(x, z, context, y, H, R) -> m` (see kernels.observation), the measurement the first columns.
    """

    kernel: Function
    dimension: int
    context: FloatArray

    def columns(self, z: FloatArray) -> FloatArray:
        """Return the measurement (m,) in the first of 7 columns, NaN elsewhere; raises UserError for another shape."""
        if np.shape(z) != (self.dimension,):
            raise UserError(f"the measurement must have shape ({self.dimension},), not {np.shape(z)}")
        return np.concatenate([np.asarray(z, dtype=float), np.full(N_COMPONENTS - self.dimension, np.nan)])

    def innovation(self, z: FloatArray, x: FloatArray) -> FloatArray:
        """Return z - h(x) (m,), NaN where `z` is."""
        return self._linearised(z, x)[0]

    def H(self, x: FloatArray) -> FloatArray:
        """Return ∂h/∂x (m, n)."""
        return self._linearised(np.zeros(self.dimension), x)[1]

    def R(self, x: FloatArray) -> FloatArray:
        """Return the noise covariance (m, m)."""
        return self._linearised(np.zeros(self.dimension), x)[2]

    def _linearised(self, z: FloatArray, x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        m = self.dimension
        y, H, R = np.empty(7), np.empty((7, len(x))), np.empty((7, 7))
        self.kernel(np.ascontiguousarray(x, dtype=float), np.nan_to_num(self.columns(z)), self.context, y, H, R)
        return np.where(np.isnan(z), np.nan, y[:m]), H[:m].copy(), R[:m, :m].copy()


def own_motion(
    transition: Function,
    Q: Function,
    *,
    state_dimension: int,
    parameters: FloatArray | tuple[float, ...] = (),
    F: Function | None = None,
    dimensions: int = 3,
) -> OwnMotion:
    """Compile a motion model from plain NumPy functions of (x, dt, parameters).

    `transition` returns the moved mean (n,), `Q` the process noise (n, n), `F` the Jacobian (n, n); without `F` it is
    taken by central differences. Position comes first in the state, then velocity. Raises UserError where Numba cannot
    compile a function, naming it.
    """
    move, noise = _compiled(transition, "transition"), _compiled(Q, "Q")
    slope = _compiled(F, "F") if F is not None else None

    if slope is not None:

        @njit
        def kernel(x: Any, dt: float, p: Any, x_out: Any, F_out: Any, Q_out: Any) -> None:
            x_out[:] = move(x, dt, p)
            F_out[:, :] = slope(x, dt, p)
            Q_out[:, :] = noise(x, dt, p)

    else:

        @njit
        def kernel(x: Any, dt: float, p: Any, x_out: Any, F_out: Any, Q_out: Any) -> None:
            x_out[:] = move(x, dt, p)
            Q_out[:, :] = noise(x, dt, p)
            for j in range(x.shape[0]):
                step = 1e-5 * max(1.0, abs(x[j]))
                above, below = x.copy(), x.copy()
                above[j] += step
                below[j] -= step
                F_out[:, j] = (move(above, dt, p) - move(below, dt, p)) / (above[j] - below[j])

    model = OwnMotion(kernel, state_dimension, np.array(parameters, dtype=float), dimensions)
    _try("motion model", lambda: model.move(np.ones(state_dimension), 0.1))
    return model


def own_sensor(
    h: Function,
    R: FloatArray,
    *,
    parameters: FloatArray | tuple[float, ...] = (),
    angles: tuple[int, ...] = (),
    H: Function | None = None,
) -> OwnSensor:
    """Compile a measurement model from plain NumPy functions of (x, parameters).

    `h` returns the measurement (m,), `H` its Jacobian (m, n); without `H` it is taken by central differences. `R` is
    the noise covariance (m, m), `angles` the indices of components that wrap. A fitted function serves as well: what it
    needs goes into `parameters`. Raises UserError for a bad R, m > 7, or where Numba cannot compile a function.
    """
    m = len(R)
    noise = check.covariance("the sensor's covariance", R, m)
    if m > N_COMPONENTS:
        raise UserError(f"a report holds at most {N_COMPONENTS} components, not {m}")
    see, slope = _compiled(h, "h"), _compiled(H, "H") if H is not None else None
    wraps = np.array([i in angles for i in range(m)])
    start = m * m

    @njit
    def differences(x: Any, p: Any) -> Any:
        out = np.empty((m, x.shape[0]))
        for j in range(x.shape[0]):
            step = 1e-5 * max(1.0, abs(x[j]))
            above, below = x.copy(), x.copy()
            above[j] += step
            below[j] -= step
            d = see(above, p) - see(below, p)
            for i in range(m):
                if wraps[i]:
                    d[i] = (d[i] + np.pi) % (2.0 * np.pi) - np.pi
            out[:, j] = d / (above[j] - below[j])
        return out

    jacobian = differences if slope is None else slope

    @njit
    def kernel(x: Any, z: Any, context: Any, y: Any, H_out: Any, R_out: Any) -> int:
        p = context[start:]
        seen, J = see(x, p), jacobian(x, p)
        rows = np.empty(m, np.int64)
        k = 0
        for i in range(m):
            if not np.isnan(z[i]):
                d = z[i] - seen[i]
                y[k] = (d + np.pi) % (2.0 * np.pi) - np.pi if wraps[i] else d
                H_out[k, :] = J[i]
                rows[k] = i
                k += 1
        for a in range(k):
            for b in range(k):
                R_out[a, b] = context[rows[a] * m + rows[b]]
        return k

    return OwnSensor(kernel, m, np.r_[noise.ravel(), np.array(parameters, dtype=float).ravel()])


def _compiled(function: Function, name: str) -> Function:
    if not callable(function):
        raise UserError(f"{name} must be a function, not {type(function).__name__}")
    compiled: Function = njit(function) if not hasattr(function, "py_func") else function
    return compiled


def _try(what: str, call: Callable[[], Any]) -> None:
    try:
        call()
    except NumbaError as error:
        line = " ".join(str(error).split())
        raise UserError(f"Numba cannot compile the {what}: {line[:200]}") from None
