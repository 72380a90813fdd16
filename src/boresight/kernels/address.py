"""Kernels by address: a user's function as an integer, so that a cached kernel can call it for next to nothing.

Handing a compiled function over as an argument costs 10–30 µs a call, for Numba asks Python for its address each time.
Here the address is asked for once; `motion_at` and `observation_at` make the function of it again inside a kernel.
Whoever holds an address must keep the function too.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from boresight.kernels.signatures import MOTION, OBSERVATION


def address_of(function: Any, kind: Any) -> int:
    """Return the address of a compiled function with the signature of `kind` (MOTION or OBSERVATION).

    Compiles it for that signature first, if need be; Numba's errors pass through.
    """
    compiled = function.get_compile_result(kind.signature)
    return int(compiled.library.get_pointer_to_function(compiled.fndesc.llvm_func_name))


def _at(kind: Any) -> Any:
    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        function = cgutils.create_struct_proxy(kind)(context, builder)
        pointer = ir.IntType(8).as_pointer()
        function.c_addr = function.py_addr = ir.Constant(pointer, None)
        function.jit_addr = builder.inttoptr(arguments[0], pointer)
        return function._getvalue()

    return codegen


def _motion_at(typing: Any, address: Any) -> Any:
    """Return the motion kernel at an address (int64)."""
    return MOTION(types.int64), _at(MOTION)


def _observation_at(typing: Any, address: Any) -> Any:
    """Return the observation kernel at an address (int64)."""
    return OBSERVATION(types.int64), _at(OBSERVATION)


motion_at: Any = intrinsic(_motion_at)
observation_at: Any = intrinsic(_observation_at)
