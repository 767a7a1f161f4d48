# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""State and parameters of a block where compiled code finds them and changes them."""

from types import SimpleNamespace
from typing import NamedTuple

from numba.core import types
from numba.experimental import structref
from numba.extending import overload

from glider_base.kernel import INLINED, kernel
from glider_base.kernels.packing import packed, pour


@structref.register
class HeldType(types.StructRef):
    """Type of what is held, in compiled code."""

    @property
    def key(self):
        """What tells it from others: the types of its fields. numba goes by their names alone."""
        return self._fields


class _Proxy(structref.StructRefProxy):
    """What is held, in Python."""


structref.define_boxing(HeldType, _Proxy)


def _empty(state, params):
    return SimpleNamespace()


@overload(_empty, jit_options=INLINED)
def _new_empty(state, params):
    kind = HeldType([('state', state.instance_type), ('params', params.instance_type)])
    return lambda state, params: structref.new(kind)


@kernel
def _hold(state, params):
    held = _empty(state[0], params[0])
    pour(held, 'state', state)
    pour(held, 'params', params)
    return held


@kernel
def _state_of(held):
    return held.state


@kernel
def _set_state(held, state):
    pour(held, 'state', state)


@kernel
def _set_params(held, params):
    pour(held, 'params', params)


class Held:
    """A block in the memory of compiled code."""

    def __init__(self, state: NamedTuple, params: NamedTuple) -> None:
        self.held = _hold(packed(state), packed(params))

    @property
    def state(self) -> NamedTuple:
        """State; arrays in it are those that compiled code has."""
        return _state_of(self.held)

    @state.setter
    def state(self, state: NamedTuple) -> None:
        _set_state(self.held, packed(state))

    def set_params(self, params: NamedTuple) -> None:
        """Go on with other parameters."""
        _set_params(self.held, packed(params))
