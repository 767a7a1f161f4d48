# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""NamedTuples of hundreds of numbers from Python to compiled code and into tables, quickly made.

What numba makes to take such a tuple apart in a call from Python is long to compile, and so is a
line of Python for each of its numbers. Here they go by a few arrays, and LLVM is told of each.
"""

import numba
import numpy as np
from numba.core import cgutils, types
from numba.core.imputils import impl_ret_borrowed
from numba.extending import intrinsic
from numba.np import arrayobj

#: Numbers by their type, each in an array of its own; all else is handed over as it is.
_NUMBERS = {
    **{types.float64: np.float64, types.boolean: np.bool_},
    **{types.int64: np.int64, types.uint64: np.uint64},
}
_ORDER = list(_NUMBERS)


def packed(values: tuple) -> tuple[types.Type, tuple[np.ndarray, ...], tuple]:
    """What `unpacked` makes a tuple of again: its type, its numbers, and what is none.

    Parameters
    ----------
    values : tuple
        Of tuples, numbers and arrays, in any depth.
    """
    if numba.config.DISABLE_JIT:
        return values, (), ()
    kind, numbers, others = numba.typeof(values), [[] for _ in _ORDER], []
    _sort(kind, values, numbers, others)
    arrays = (np.array(x, of) for x, of in zip(numbers, _NUMBERS.values(), strict=True))
    return kind, tuple(arrays), tuple(others)


def _sort(kind, value, numbers, others) -> None:
    """Append numbers to the lists of their types, all else to the last one."""
    if isinstance(kind, types.BaseTuple):
        for one, inner in zip(kind.types, value, strict=True):
            _sort(one, inner, numbers, others)
    elif kind in _NUMBERS:
        numbers[_ORDER.index(kind)].append(value)
    else:
        others.append(value)


def _unpacked(typing, kind, numbers, others):
    """Load each number, and put the tuple together."""
    made = kind.instance_type

    def code(context, builder, signature, arguments):
        parts = cgutils.unpack_tuple(builder, arguments[1], len(numbers.types))
        arrays = [
            context.make_array(of)(context, builder, value=part)
            for of, part in zip(numbers.types, parts, strict=True)
        ]
        left = iter(cgutils.unpack_tuple(builder, arguments[2], len(others.types)))
        taken = [0] * len(_ORDER)

        def make(of):
            if isinstance(of, types.BaseTuple):
                return context.make_tuple(builder, of, [make(one) for one in of.types])
            if of not in _NUMBERS:
                return next(left)
            which = _ORDER.index(of)
            taken[which] += 1
            place = cgutils.gep_inbounds(builder, arrays[which].data, taken[which] - 1)
            return arrayobj.load_item(context, builder, numbers.types[which], place)

        return impl_ret_borrowed(context, builder, made, make(made))

    return made(kind, numbers, others), code


def _put(typing, table, row, start, tuples):
    """Store each number."""

    def code(context, builder, signature, arguments):
        rows = context.make_array(table)(context, builder, arguments[0])
        begin = cgutils.get_item_pointer(context, builder, table, rows, arguments[1:3])
        place = 0

        def store(of, value):
            nonlocal place
            if isinstance(of, types.BaseTuple):
                parts = cgutils.unpack_tuple(builder, value, len(of.types))
                for one, part in zip(of.types, parts, strict=True):
                    store(one, part)
                return
            number = context.cast(builder, value, of, table.dtype)
            builder.store(number, cgutils.gep_inbounds(builder, begin, place))
            place += 1

        store(tuples, arguments[3])
        return context.get_dummy_value()

    if table.layout != 'C':
        raise TypeError('a table is contiguous')
    return types.none(table, types.intp, types.intp, tuples), code


if numba.config.DISABLE_JIT:

    def unpacked(kind, numbers, others):
        """The tuple that was `packed`."""
        return kind

    def put(table, row, start, tuples):
        """Write tuples of numbers into a row of float64[n, m] from a column on."""
        numbers = [number for values in tuples for number in values]
        table[row, start : start + len(numbers)] = numbers

else:
    unpacked, put = intrinsic(_unpacked), intrinsic(_put)
