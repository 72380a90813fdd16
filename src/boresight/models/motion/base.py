"""A motion model whose work is done by one compiled kernel."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np

from boresight.errors import UserError
from boresight.types.sensor import FloatArray

Moved = tuple[FloatArray, FloatArray, FloatArray]


class KernelMotion:
    """The one abstract level of motion models: name a kernel (see kernels.motion), its parameters, and the layout.

    A subclass is final: a frozen dataclass with `dimensions`, `layout`, `kernel` (a staticmethod of an `@njit`
    function `kernel(x, dt, parameters, x_out, F, Q)`), whose `__post_init__` sets `parameters` by `set_parameters`.
    """

    kernel: ClassVar[Callable[..., Any]]
    layout: ClassVar[tuple[str, ...]]  # blocks of the state: vectors of length `dimensions`, or scalars ("turn_rate")
    dimensions: int
    parameters: FloatArray  # what the kernel wants to know

    def set_parameters(self, *values: float) -> None:
        """Keep what the kernel wants to know as one float64 array."""
        object.__setattr__(self, "parameters", np.array(values, dtype=float))

    @property
    def state_dimension(self) -> int:
        """Length n of the state."""
        return sum(1 if block in SCALARS else self.dimensions for block in self.layout)

    def move(self, x: FloatArray, dt: float) -> Moved:
        """Return the moved mean (n,), F (n, n) and Q (n, n); raises UserError where `x` has another length."""
        n = self.state_dimension
        x = np.ascontiguousarray(x, dtype=float)
        if x.shape != (n,):
            raise UserError(f"{type(self).__name__} needs a state of length {n}, not of shape {x.shape}")
        x_out, F, Q = np.empty(n), np.empty((n, n)), np.empty((n, n))
        self.kernel(x, float(dt), self.parameters, x_out, F, Q)
        return x_out, F, Q

    def transition(self, x: FloatArray, dt: float) -> FloatArray:
        """Return the mean (n,) moved by `dt` (s)."""
        return self.move(x, dt)[0]

    def F(self, x: FloatArray, dt: float) -> FloatArray:
        """Return the Jacobian (n, n) of `transition` at `x`."""
        return self.move(x, dt)[1]

    def Q(self, x: FloatArray, dt: float) -> FloatArray:
        """Return the covariance (n, n) that the process noise adds over `dt` (s)."""
        return self.move(x, dt)[2]


SCALARS = frozenset({"turn_rate"})
