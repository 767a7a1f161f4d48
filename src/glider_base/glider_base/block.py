# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What a block declares of itself, and how it is called in loops over many ticks.

A block answers a tick: from the numbers of its input topics it makes those of its outputs, and
flags of which changes become events. Nodes, the direct engine, recordings and `verify` all
call it through the same kernel.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numba.extending import overload

from glider_base.kernel import INLINED, kernel
from glider_base.settings import Settings
from glider_base.slot import slot
from glider_base.wiring import Wired


class Said(NamedTuple):
    """What an event says."""

    level: str  #: 'ok', 'warn' or 'error'
    message: str
    values: dict[str, object] = {}


class Block(NamedTuple):
    """A block of the tick."""

    wired: Wired
    settings: type[Settings]  #: with ``params()`` and ``initial_state()``
    flags: tuple[str, ...] = ()  #: names of its flags
    quiet: tuple[int, ...] = ()  #: flags of which nothing needs to be reported at the beginning
    every_ns: int = 0  #: a change of the flags is reported at most once in this time
    say: Callable[..., Said] | None = None  #: what flags say
    surface: Callable | None = None  #: kernel: state of a block that asks for the surface
    clear: Callable | None = None  #: kernel: state of a block that forgets what has latched
    steers_by: Callable[[Settings], str] = lambda settings: ''
    #: name of the steering surface among the joints on its topics, by its settings

    @property
    def orders(self) -> tuple[Callable, ...]:
        """Those of its kernels that take an order in flight."""
        return tuple(order for order in (self.surface, self.clear) if order)


@slot
def block_tick(state, t_s, inputs, params, dt):
    """One tick of a block, by the type of its params.

    Parameters
    ----------
    state, params : NamedTuple
    t_s, dt : float
        Time since the start, and length of the tick (s).
    inputs : tuple of tuple of float
        Numbers of its input topics, as on the wire.

    Returns
    -------
    state : NamedTuple
    outputs : tuple of tuple of float
        Numbers of its output topics, as on the wire.
    flags : tuple of int
    """


@kernel
def answer(held, t_s, inputs, dt):
    """Outputs and flags of a tick of a block that is held; where its law raises it has not moved.

    To hand its state to Python and back would cost many times what the tick itself does.
    """
    state, outputs, flags = block_tick(held.state, t_s, inputs, held.params, dt)
    held.state = state
    return outputs, flags


def optional_topics(settings: Settings) -> tuple[str, ...]:
    """Those of the topics that not every run has with which a block of such settings works."""
    return getattr(settings, 'topics', ())


def rows_at(arrays, row):
    """Rows of some arrays, as a tuple; in kernels only."""
    return tuple(array[row] for array in arrays)


@overload(rows_at, jit_options=INLINED)
def _rows_at(arrays, row):
    if len(arrays) == 0:
        return lambda arrays, row: ()
    return lambda arrays, row: (arrays[0][row], *rows_at(arrays[1:], row))


@kernel
def _differs(flags, reported):
    """Whether one of some flags, int64[m], is not as it was reported."""
    for i in range(len(flags)):
        if flags[i] != reported[i]:
            return True
    return False


@kernel
def changes_to_tell(flags, stamps_ns, every_ns, reported, reported_ns):
    """Where flags int64[n, m] have changed, at most once in ``every_ns``; indices int64[k].

    The flags ``reported`` last, int64[m], are changed in place.
    """
    found = np.empty(len(flags), np.int64)
    count = 0
    for k in range(len(flags)):
        since_ns = stamps_ns[k] - reported_ns  # less than nothing: a vehicle's clock was set back
        if not 0 <= since_ns < every_ns and _differs(flags[k], reported):
            for i in range(len(reported)):  # a slice has numba load its text module
                reported[i] = flags[k, i]
            reported_ns = stamps_ns[k]
            found[count] = k
            count += 1
    return found[:count]


class Telling:
    """Which changes of the flags of a block are reported from a time on, and what was last."""

    def __init__(self, block: Block, start_ns: int = 0) -> None:
        self.block = block
        self._reported, self._reported_ns = tuple(block.quiet), start_ns - block.every_ns

    def among(self, flags: np.ndarray, stamps_ns: np.ndarray) -> np.ndarray:
        """Indices of ticks at which something is reported; flags int64[n, m], stamps int64[n]."""
        every_ns = self.block.every_ns
        reported = np.array(self._reported, np.int64)
        found = changes_to_tell(flags, stamps_ns, every_ns, reported, self._reported_ns)
        if len(found):
            self._reported, self._reported_ns = tuple(reported.tolist()), int(stamps_ns[found[-1]])
        return found

    def is_due(self, flags: tuple[int, ...], stamp_ns: int) -> bool:
        """Whether flags of one tick are reported."""
        if flags == self._reported or 0 <= stamp_ns - self._reported_ns < self.block.every_ns:
            return False
        self._reported, self._reported_ns = flags, stamp_ns
        return True
