# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A control law of a program or a notebook: a class of settings, or a function alone."""

import inspect
from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numba

from glider_base.errors import ConfigurationError
from glider_base.slot import checked
from glider_control.law import LawSettings, law_step


def own_law(law: type[LawSettings] | Callable) -> type[LawSettings]:
    """Settings of a law: a subclass of `LawSettings`, or of a function that is the law.

    Of a `Seen` it returns the roll and the pitch moment (N m); numba compiles its body. Raises
    ConfigurationError if it is neither.
    """
    if isinstance(law, type) and issubclass(law, LawSettings):
        return law
    function = getattr(law, 'py_func', law)
    if not inspect.isfunction(function):
        raise ConfigurationError(
            f'law {law!r:.80}: not usable (allowed: a subclass of glider_control.law.LawSettings, '
            'or a function of what the law sees; the name of a law goes to controller)'
        )
    names = list(inspect.signature(function).parameters)
    if len(names) != 1:
        raise ConfigurationError(
            f'law {function.__name__}({", ".join(names)}): not usable (allowed: a function of one '
            'parameter, what the law sees; a law with a state is a class)'
        )
    return _stateless(function)


class Nothing(NamedTuple):
    """What such a function keeps; here, so that a state can be pickled."""

    nothing: int


@cache
def _stateless(function: Callable) -> type[LawSettings]:
    """Settings without a field, of a law that is a function of what it sees."""
    # compiled for this session alone, as whoever calls it is: see KernelCache
    compiled = numba.njit(error_model='numpy', forceinline=True)(function)
    moments = checked(compiled, 'roll moment (N m)', 'pitch moment (N m)')

    class Params(NamedTuple):
        nothing: int

    class Stateless(LawSettings):
        def params(self, vehicle, bank) -> Params:
            return Params(0)

        def initial_state(self) -> Nothing:
            return Nothing(0)

    @law_step.body(Params)
    @numba.njit(error_model='numpy', forceinline=True)
    def step(state, seen, params, dt):
        tau_p, tau_q = moments(seen)
        return state, 1.0 * tau_p, 1.0 * tau_q  # of a truth value, too

    Stateless.__name__ = function.__name__
    Stateless.__doc__ = function.__doc__ or f'The function {function.__name__}.'
    return Stateless
