# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Slots: functions whose body is picked by the type of the params that they are called with.

What can be exchanged inside a block, such as the control law, is a slot. Everybody who has params
of a type of his own fills it by a kernel, in a file of his own:

    @law_step.body(SlidingParams)
    @kernel
    def sliding_step(state, seen, params, dt): ...

Inside kernels the choice is made when they are compiled: it costs nothing in flight, and a
compiled loop is found in numba's cache by the next process, which loops that take functions as
arguments are not. Each combination of types compiles the loop again.
"""

import functools
import inspect
import re
from collections.abc import Callable
from typing import Any

from numba import typeof
from numba.core import types
from numba.core.errors import NumbaError, UnsupportedBytecodeError
from numba.extending import is_jitted, overload

from glider_base.errors import ConfigurationError, said_by, shown
from glider_base.kernel import INLINED, kernel
from glider_base.kernels.cache import BODIES, HOLDERS, Body

#: What numba raises for a function that it cannot compile.
NOT_COMPILED = (NumbaError, UnsupportedBytecodeError)
_REAL = types.Integer | types.Float | types.Boolean


def slot(stub: Callable) -> Callable:
    """Make a slot of a function that has a parameter ``params``.

    A stub that is marked by `default` is the body for all types that have none; by `returns` it
    says what a body has to return. The slot has a
    decorator ``body(params_type)`` for a kernel with the same parameters. Called by
    uncompiled code, it calls that kernel, which is checked the first time.
    """
    bodies: dict[type, Any] = {}
    called: set[Callable] = set()
    position = list(inspect.signature(stub).parameters).index('params')

    def find(params_type: type) -> Callable:
        found = bodies.get(params_type)
        if found is None and not getattr(stub, 'is_default', False):
            known = ', '.join(sorted(one.__name__ for one in bodies))
            raise ConfigurationError(
                f'{stub.__name__}: no body for params of type {params_type.__name__} (allowed: a '
                f'type for which @{stub.__name__}.body has one: {known})'
            )
        return found or stub

    @functools.wraps(stub)
    def call(*values):
        found = find(type(values[position]))
        if found not in called and hasattr(stub, 'returns') and is_jitted(found):
            _check(found, tuple(map(typeof, values)), stub.returns)
        called.add(found)
        return found(*values)

    def body(params_type: type) -> Callable:
        def fill(function):
            if params_type in bodies:
                raise TypeError(
                    f'{stub.__name__}: {params_type.__name__} has a body already (in a notebook, '
                    f'run the cell of {params_type.__name__} anew, too)'
                )
            bodies[params_type] = function if is_jitted(function) else kernel(function)
            HOLDERS.update(one.__module__.partition('.')[0] for one in (params_type, function))
            BODIES.append(Body(stub.__module__, params_type.__module__, function.__module__))
            return function

        return fill

    @overload(call, jit_options=INLINED, strict=False)
    def choose(*kinds):
        kind = kinds[position]
        found = find(getattr(kind, 'instance_class', type(kind)))
        if hasattr(stub, 'returns') and found is not stub:
            _check(found, kinds, stub.returns)
            return lambda *values: found(*values)
        return getattr(found, 'py_func', found)

    call.body = body
    return call


def default(stub: Callable) -> Callable:
    """Let a stub be the body for all types that have none: written under ``@slot``."""
    stub.is_default = True
    return stub


def only_for(params_type: type, otherwise: Callable) -> Callable:
    """Make a slot of a kernel for one type of params; for all others there is ``otherwise``."""

    def fill(function: Callable) -> Callable:
        otherwise.__name__, otherwise.__doc__ = function.__name__, function.__doc__
        filled = slot(default(otherwise))
        filled.body(params_type)(function)
        return filled

    return fill


def returns(*what: str | type) -> Callable:
    """Have a slot refuse bodies that return other than so many things: written under ``@slot``.

    Each is said in words, or is the NamedTuple of numbers that it has to be.
    """

    def mark(stub: Callable) -> Callable:
        stub.returns = what
        return stub

    return mark


def usable(what: str, make: Callable, *of: Any) -> Any:
    """State or params that somebody's class makes of something.

    A ConfigurationError names them if it raises, or kernels cannot take what it made.
    """
    try:
        values = make(*of)
    except ConfigurationError:
        raise
    except (Exception, SystemExit) as error:  # it may not be our code
        raise ConfigurationError(f'{what}: {said_by(error)}') from error
    if odd := _odd(what, values):
        raise ConfigurationError(
            f'{odd}: not usable (allowed: a NamedTuple of numbers, arrays and such NamedTuples)'
        )
    return values


def _odd(name: str, value: Any) -> str:
    """Name and value of the first part that compiled code cannot take, or not safely: a list."""
    if isinstance(value, tuple):
        fields = getattr(value, '_fields', range(len(value)))
        odd = (_odd(f'{name}.{field}', part) for field, part in zip(fields, value, strict=True))
        return next(filter(None, odd), '')
    try:
        typeof(value)
    except ValueError:
        return f'{name}: {shown(value)}'
    return f'{name}: {shown(value)}' if isinstance(value, list) else ''


def checked(kernel: Callable, *what: str) -> Callable:
    """Call a kernel, which is refused as it is compiled if it returns less or more."""

    def call(*values):
        return kernel(*values)

    @overload(call, jit_options=INLINED, strict=False)
    def choose(*kinds):
        _check(kernel, kinds, what)
        return lambda *values: kernel(*values)

    return call


def _is_usable(kind: Any, what: str | type) -> bool:
    """Whether compiled code can take what is returned for what: numbers, and tuples of them."""
    if isinstance(what, type):
        return getattr(kind, 'instance_class', None) is what and _is_numbers(kind)
    return isinstance(kind, _REAL | types.BaseTuple | types.Array if 'state' in what else _REAL)


def _is_numbers(kind: Any) -> bool:
    if isinstance(kind, types.BaseTuple):
        return all(map(_is_numbers, kind))
    return isinstance(kind, _REAL)


def _check(kernel: Any, kinds: tuple, what: tuple[str | type, ...]) -> None:
    """Refuse a kernel that is not compiled for arguments of these types, or returns other things.

    A ConfigurationError says so in one sentence, with its name and file.
    """
    names = [getattr(one, '__name__', one) for one in what]
    try:
        call = types.Dispatcher(kernel).get_call_type(kernel.typingctx, kinds, {})
        returned = call.return_type
        if isinstance(returned, types.Optional | types.NoneType):
            why = 'returns nothing where it ends without a return'
        elif not isinstance(returned, types.BaseTuple):
            why = f'returns {returned} alone'
        elif len(returned) != len(what):
            why = f'returns {len(returned)} values'
        else:
            odd = (i for i, kind in enumerate(returned) if not _is_usable(kind, what[i]))
            if (i := next(odd, None)) is not None:
                kind = str(returned[i]).replace('unicode_type', 'str')
                why = f'returns {kind} as {names[i]}'
            elif (
                'state' in names[0] and kernel.typingctx.unify_types(kinds[0], returned[0]) is None
            ):
                why = f'returns {returned[0]} as {names[0]}, which was {kinds[0]}'
            else:
                return
    except ConfigurationError:
        raise
    except Exception as error:  # it is not our code, and numba lets through what it stumbles over
        why = f'cannot be compiled: {reason(error)}'
    code = kernel.py_func.__code__
    raise ConfigurationError(
        f'{code.co_name} ({code.co_filename}, line {code.co_firstlineno}): {why} (allowed: on any '
        f'way returns {len(what)}: {", ".join(names)}; numbers keep their type, 0.0 for a float)'
    )


def reason(error: Exception) -> str:
    """The innermost of what numba says, in a line."""
    text = re.sub(r'\x1b\[\d+m', '', str(error)).partition('During:')[0]
    text = re.split(r'pipeline \(step: [^)]*\)', text)[-1].strip().partition('\n')[0]
    return text or type(error).__name__
