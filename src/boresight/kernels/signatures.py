"""The types of user-replaceable kernels as first-class functions: a driver that takes them compiles once, is cached."""

from __future__ import annotations

from numba import types

VECTOR = types.float64[::1]
MATRIX = types.float64[:, ::1]
STACK = types.float64[:, :, ::1]
MOTION = types.FunctionType(types.void(VECTOR, types.float64, VECTOR, VECTOR, MATRIX, MATRIX))
OBSERVATION = types.FunctionType(types.int64(VECTOR, VECTOR, VECTOR, VECTOR, MATRIX, MATRIX))
