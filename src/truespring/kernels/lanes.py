"""Vectors of as many numbers as a processor handles in one instruction: one number of each of eight elements.

A kernel that computes with `Lanes` reads as one that computes with numbers, and treats LANES elements at a time. Values
are read from and written to arrays of two axes, (row, element), so that those of neighbouring elements are contiguous.
The compiler maps a vector to the registers of the processor, whatever their size.
"""

import operator
from collections.abc import Callable
from typing import Any

import numpy as np
from llvmlite import ir
from numba import extending
from numba.core import cgutils, types
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import lower_builtin, models, register_model

from truespring.kernels.threads import kernel

#: Number of elements in a vector.
LANES = 8

# Decorator of functions that write instructions; calls leave out its first argument.
intrinsic: Callable[[Any], Any] = extending.intrinsic

_FLAGS = ("contract", "nsz", "arcp")
_VECTOR = ir.VectorType(ir.DoubleType(), LANES)
_INT = ir.IntType(64)


class _LanesType(types.Type):
    """The type of a vector of LANES numbers."""

    def __init__(self) -> None:
        super().__init__(name="Lanes")


_lanes = _LanesType()


@register_model(_LanesType)
class _LanesModel(models.PrimitiveModel):
    """A vector of LANES numbers in LLVM."""

    def __init__(self, manager, kind):
        super().__init__(manager, kind, _VECTOR)


def _splat(builder, value):
    """Return a vector with equal entries."""
    one = builder.insert_element(ir.Constant(_VECTOR, ir.Undefined), value, ir.Constant(ir.IntType(32), 0))
    return builder.shuffle_vector(
        one, ir.Constant(_VECTOR, ir.Undefined), ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES)
    )


def _define(operation, instruction):
    """Make an operator of Python known for vectors, and for a vector and a number."""

    @infer_global(operation)
    class _Operator(AbstractTemplate):
        def generic(self, args, kws):
            kinds = [_lanes if isinstance(one, types.Number) else one for one in args]
            if len(args) == 2 and _lanes in args and all(kind is _lanes for kind in kinds):
                numbers = [types.float64 if isinstance(one, types.Number) else one for one in args]
                return signature(_lanes, *numbers)
            return None

    def lower(context, builder, sig, args):
        a, b = (one if kind is _lanes else _splat(builder, one) for one, kind in zip(args, sig.args, strict=True))
        return getattr(builder, instruction)(a, b, flags=_FLAGS)

    for kinds in ((_LanesType, _LanesType), (_LanesType, types.Float), (types.Float, _LanesType)):
        lower_builtin(operation, *kinds)(lower)


for _operation, _instruction in (
    (operator.add, "fadd"),
    (operator.sub, "fsub"),
    (operator.mul, "fmul"),
    (operator.truediv, "fdiv"),
):
    _define(_operation, _instruction)


def _pointer(context, builder, kind, array, row, column):
    """Return the address of an entry of an array of two axes, of contiguous rows."""
    view = context.make_array(kind)(context, builder, array)
    (stride, _) = cgutils.unpack_tuple(builder, view.strides)
    offset = builder.add(builder.mul(row, stride), builder.mul(column, ir.Constant(_INT, 8)))
    start = builder.ptrtoint(view.data, _INT)
    return builder.inttoptr(builder.add(start, offset), _VECTOR.as_pointer())


def _load(context, builder, kind, array, row, column):
    return builder.load(_pointer(context, builder, kind, array, row, column), align=8)


def _indices(context, builder, kinds, values):
    return [context.cast(builder, one, kind, types.int64) for one, kind in zip(values, kinds, strict=True)]


@intrinsic
def load(typing, array, row, column):
    """Return the entries of a row from a column on."""

    def code(context, builder, sig, args):
        at = _indices(context, builder, sig.args[1:], args[1:])
        return _load(context, builder, sig.args[0], args[0], *at)

    return _lanes(array, row, column), code


@intrinsic
def store(typing, array, row, column, value):
    """Write a vector to a row from a column on."""

    def code(context, builder, sig, args):
        at = _indices(context, builder, sig.args[1:3], args[1:3])
        builder.store(args[3], _pointer(context, builder, sig.args[0], args[0], *at), align=8)
        return context.get_dummy_value()

    return types.void(array, row, column, value), code


@intrinsic
def fill(typing, array, row, column, values):
    """Write a tuple of vectors to consecutive rows from a column on."""

    def code(context, builder, sig, args):
        at, column = _indices(context, builder, sig.args[1:3], args[1:3])
        for number in range(len(sig.args[3])):
            place = builder.add(at, ir.Constant(_INT, number))
            pointer = _pointer(context, builder, sig.args[0], args[0], place, column)
            builder.store(builder.extract_value(args[3], number), pointer, align=8)
        return context.get_dummy_value()

    return types.void(array, row, column, values), code


@intrinsic
def zeros(typing, like):
    """Return a tuple of as many zero vectors as a tuple has entries."""
    found = types.UniTuple(_lanes, len(like))

    def code(context, builder, sig, args):
        zero = ir.Constant(_VECTOR, [0.0] * LANES)
        return context.make_tuple(builder, sig.return_type, [zero] * len(sig.args[0]))

    return found(like), code


@intrinsic
def add_times(typing, total, factor, array, row, column):
    """Return a tuple of vectors + a vector or number times consecutive rows from a column on."""

    def code(context, builder, sig, args):
        at, column = _indices(context, builder, sig.args[3:], args[3:])
        factor = args[1] if sig.args[1] is _lanes else _splat(builder, args[1])
        found = []
        for number in range(len(sig.args[0])):
            place = builder.add(at, ir.Constant(_INT, number))
            part = builder.fmul(factor, _load(context, builder, sig.args[2], args[2], place, column), flags=_FLAGS)
            found.append(builder.fadd(builder.extract_value(args[0], number), part, flags=_FLAGS))
        return context.make_tuple(builder, sig.return_type, found)

    return total(total, factor, array, row, column), code


@kernel
def room(rows):
    """Return an uninitialised array, shape (rows, LANES), whose rows do not cross lines of the cache."""
    flat = np.empty((rows + 1) * LANES)
    skip = (-flat.ctypes.data // 8) % LANES
    return flat[skip : skip + rows * LANES].reshape(rows, LANES)
