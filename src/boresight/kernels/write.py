"""Copying one array into another of the same shape, in two lines of machine code and none of error messages.

`a[:] = b` takes Numba seconds to compile, once in every process that compiles a kernel with it: what it would say if
the shapes did not fit is text, and Numba's text is compiled too.
"""

from __future__ import annotations

from numba import njit

from boresight.kernels.options import LEAF
from boresight.types.sensor import FloatArray


@njit(**LEAF)
def write_vector(out: FloatArray, source: FloatArray) -> None:
    """Copy (n,) into `out`, whose first n places it fills."""
    for i in range(len(source)):
        out[i] = source[i]


@njit(**LEAF)
def write_matrix(out: FloatArray, source: FloatArray) -> None:
    """Copy (n, m) into `out`, whose first n rows and m columns it fills."""
    for i in range(source.shape[0]):
        for j in range(source.shape[1]):
            out[i, j] = source[i, j]
