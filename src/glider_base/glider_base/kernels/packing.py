# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""NamedTuples of hundreds of numbers from Python to compiled code and into tables, quickly made.

What numba makes to take such a tuple apart in a call from Python is long to compile, and so is a
line of Python for each of its numbers. Here they go by a few arrays, and LLVM sees each of them.
"""

import numba
import numpy as np
from numba.core import cgutils, types
from numba.experimental import structref
from numba.extending import intrinsic
from numba.np import arrayobj

#: Numbers by their type, each in an array of its own; all else is handed over as it is.
_NUMBERS = {
    **{types.float64: np.float64, types.boolean: np.bool_},
    **{types.int64: np.int64, types.uint64: np.uint64},
}
_ORDER = list(_NUMBERS)
#: Types that need no look at the value, and of tuples by what is in them: numba takes long.
_OF_PYTHON = {float: types.float64, bool: types.boolean}
_kinds = {}
#: LLVM schedules every two of so many numbers that it moves: a block of all is long to compile.
FENCED = 32


def packed(values: tuple) -> tuple[types.Type, tuple[np.ndarray, ...], tuple]:
    """What `pour` makes a tuple of again: its type, its numbers, and what is none.

    In it are tuples, numbers and arrays, in any depth.
    """
    if numba.config.DISABLE_JIT:
        return values, (), ()
    parts, numbers, others = [], [[] for _ in _ORDER], []
    _sort(values, parts, numbers, others)
    parts = tuple(parts)
    if parts not in _kinds:
        _kinds[parts] = numba.typeof(values)
    arrays = (np.array(x, of) for x, of in zip(numbers, _NUMBERS.values(), strict=True))
    return _kinds[parts], tuple(arrays), tuple(others)


def _sort(value, parts, numbers, others) -> None:
    """Append numbers to the lists of their types, all else to the last one; and what each is."""
    if isinstance(value, tuple):
        parts += type(value), len(value)
        for one in value:
            _sort(one, parts, numbers, others)
        return
    kind = _OF_PYTHON.get(type(value)) or numba.typeof(value)
    parts.append(kind)
    if kind in _NUMBERS:
        numbers[_ORDER.index(kind)].append(value)
    else:
        others.append(value)


def _pour(typing, held, field, values):
    """Load each number and store it, so that the tuple is never there as a whole."""
    if not isinstance(field, types.StringLiteral):
        return None

    def code(context, builder, signature, arguments):
        kind, numbers, others = values.types
        if kind.instance_type != held.field_dict[field.literal_value]:
            raise TypeError(f'{field.literal_value}: not of the type that it had')
        _, *parts = cgutils.unpack_tuple(builder, arguments[2], 3)
        arrays = [
            context.make_array(of)(context, builder, value=part)
            for of, part in zip(
                numbers.types, cgutils.unpack_tuple(builder, parts[0]), strict=True
            )
        ]
        left = iter(cgutils.unpack_tuple(builder, parts[1]))
        taken = [0] * len(_ORDER)

        def store(of, place):
            if isinstance(of, types.BaseTuple):
                for k, one in enumerate(of.types):
                    store(one, cgutils.gep_inbounds(builder, place, 0, k))
            elif of in _NUMBERS:
                which = _ORDER.index(of)
                taken[which] += 1
                source = cgutils.gep_inbounds(builder, arrays[which].data, taken[which] - 1)
                item = arrayobj.load_item(context, builder, numbers.types[which], source)
                builder.store(item, place)
                if sum(taken) % FENCED == 0:
                    builder.fence('acq_rel', 'singlethread')
            else:
                new, old = next(left), builder.load(place)
                context.nrt.incref(builder, of, new)
                builder.store(new, place)
                context.nrt.decref(builder, of, old)

        data = structref._Utils(context, builder, held).get_data_struct(arguments[0])
        store(kind.instance_type, data._get_ptr_by_name(field.literal_value))
        return context.get_dummy_value()

    return types.none(held, field, values), code


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

    def pour(held, field, values):
        """Make a field of a structure reference the tuple that was `packed`."""
        setattr(held, field, values[0])

    def put(table, row, start, tuples):
        """Write tuples of numbers into a row of float64[n, m] from a column on."""
        numbers = [number for values in tuples for number in values]
        table[row, start : start + len(numbers)] = numbers

else:
    pour, put = intrinsic(prefer_literal=True)(_pour), intrinsic(_put)
