"""Arrays as Python hands them over: a kernel called at once, that looks at its arguments itself.

What a call from Python costs is mostly this: Numba's dispatcher looks up the type of every argument, then each array is
given a counted owner, some 60 ns an array in all. A kernel whose arguments are `THING`s and that is called through
`direct` gets the objects as they are, and `vector` and `matrix` find an array's numbers in the array itself: the fields
of NumPy's PyArrayObject and PyArray_Descr, which are part of its binary interface. What is not a contiguous, writeable
float64 array of that many dimensions gives an array of no numbers, so a kernel has to look at the shape before anything
else. The arrays live as long as the call does: a kernel must not return or keep them.

With NUMBA_DISABLE_JIT=1 the same kernels run as Python, and these functions with them.
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import NativeValue, intrinsic, models, register_model, unbox
from numba.np.arrayobj import make_array, populate_array

from boresight.kernels import config

HEAD = object.__basicsize__  # where an object's own fields begin; the last of the common ones is its type
TYPE, TYPE_NAME = HEAD - 8, HEAD + 8
DATA, DIMENSIONS, SHAPE, STRIDES, DTYPE, FLAGS = HEAD, HEAD + 8, HEAD + 16, HEAD + 24, HEAD + 40, HEAD + 48
KIND = HEAD + 8  # of a dtype: three characters, kind, type and byte order
USABLE = 0x1 | 0x100 | 0x400  # C-contiguous, aligned, writeable
BYTE, INT, LONG, DOUBLE = ir.IntType(8), ir.IntType(32), ir.IntType(64), ir.DoubleType()
POINTER = BYTE.as_pointer()


class Thing(types.Type):
    """Any Python object, borrowed for the length of a call."""

    def __init__(self) -> None:
        super().__init__(name="boresight.Thing")


THING = Thing()
register_model(Thing)(models.OpaqueModel)


@unbox(Thing)
def _borrow(kind: Any, thing: Any, c: Any) -> Any:
    return NativeValue(thing)


def _field(builder: Any, thing: Any, at: int, kind: Any) -> Any:
    """Load what lies `at` bytes into an object."""
    place = builder.gep(thing, [ir.Constant(LONG, at)])
    return builder.load(builder.bitcast(place, kind.as_pointer()), align=1)


def _same(builder: Any, thing: Any, at: int, kind: Any, value: int) -> Any:
    return builder.icmp_signed("==", _field(builder, thing, at, kind), ir.Constant(kind, value))


def _is_array(builder: Any, thing: Any) -> Any:
    """Return whether an object's type is called numpy.ndarray: its address is another in every process."""
    name = _field(builder, _field(builder, thing, TYPE, POINTER), TYPE_NAME, POINTER)
    first, last = (int.from_bytes(word, sys.byteorder, signed=True) for word in (b"numpy.nd", b"ndarray\0"))
    return builder.and_(_same(builder, name, 0, LONG, first), _same(builder, name, 6, LONG, last))


def _is_usable(builder: Any, thing: Any, dimensions: int) -> Any:
    """Return whether an array is of native float64, contiguous and of so many dimensions."""
    flags = builder.and_(_field(builder, thing, FLAGS, INT), ir.Constant(INT, USABLE))
    fits = builder.icmp_signed("==", flags, ir.Constant(INT, USABLE))
    fits = builder.and_(fits, _same(builder, thing, DIMENSIONS, INT, dimensions))
    dtype = _field(builder, thing, DTYPE, POINTER)
    for i, letter in enumerate(b"fd="):
        fits = builder.and_(fits, _same(builder, dtype, KIND + i, BYTE, letter))
    return fits


def _view(dimensions: int) -> Any:
    """Return the function that makes an array of so many dimensions of a Thing."""
    array = types.Array(types.float64, dimensions, "C")

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        thing = arguments[0]
        out = cgutils.alloca_once_value(builder, ir.Constant(context.get_value_type(array), None))
        with builder.if_then(_is_array(builder, thing)), builder.if_then(_is_usable(builder, thing, dimensions)):
            made = make_array(array)(context, builder)
            shape, strides = (
                [_field(builder, _field(builder, thing, at, POINTER), 8 * i, LONG) for i in range(dimensions)]
                for at in (SHAPE, STRIDES)
            )
            data, size = _field(builder, thing, DATA, DOUBLE.as_pointer()), ir.Constant(LONG, 8)
            populate_array(made, data=data, shape=shape, strides=strides, itemsize=size, meminfo=None)
            builder.store(made._getvalue(), out)
        return builder.load(out)

    def view(typing: Any, thing: Any) -> Any:
        return array(thing), codegen

    def plain(thing: Any) -> Any:
        usable = type(thing) is np.ndarray and thing.dtype.str == np.dtype(float).str and thing.ndim == dimensions
        return thing if usable and thing.flags.carray else np.empty((0,) * dimensions)

    return plain if config.DISABLE_JIT else intrinsic(view)


vector: Any = _view(1)
matrix: Any = _view(2)


def direct(kernel: Any) -> Any:
    """Return the compiled code of a kernel of one signature, all of Things and numbers, without Numba's dispatcher."""
    if config.DISABLE_JIT:
        return kernel
    (compiled,) = kernel.overloads.values()
    return compiled.entry_point
