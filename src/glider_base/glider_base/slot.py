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
from collections.abc import Callable
from typing import Any

from numba.extending import overload

from glider_base.errors import ConfigurationError
from glider_base.kernels.cache import BODIES, Body


def slot(stub: Callable) -> Callable:
    """Make a slot of a function that has a parameter ``params``.

    A stub that is marked by `default` is the body for all types that have none. The slot has a
    decorator ``body(params_type)`` for a kernel with the same parameters. Called by
    uncompiled code, it calls that kernel.
    """
    bodies: dict[type, Any] = {}
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
        return find(type(values[position]))(*values)

    def body(params_type: type) -> Callable:
        def fill(kernel):
            if params_type in bodies:
                raise TypeError(f'{stub.__name__}: {params_type.__name__} has a body already')
            bodies[params_type] = kernel
            BODIES.append(Body(stub.__module__, params_type.__module__, kernel.__module__))
            return kernel

        return fill

    @overload(call, jit_options={'error_model': 'numpy', 'forceinline': True}, strict=False)
    def choose(*types):
        kind = types[position]
        found = find(getattr(kind, 'instance_class', type(kind)))
        return getattr(found, 'py_func', found)

    call.body = body
    return call


def default(stub: Callable) -> Callable:
    """Let a stub be the body for all types that have none: written under ``@slot``."""
    stub.is_default = True
    return stub
