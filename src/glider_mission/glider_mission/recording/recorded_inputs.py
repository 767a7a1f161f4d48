# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Blocks one by one, fed with recorded inputs in compiled loops.

Inputs and outputs are what topics carry: one row of numbers per tick, as on the wire. A block
computes from them what its node would have published.
"""

from typing import NamedTuple

import numpy as np

from glider_base.block import Block, block_tick, optional_topics, rows_at
from glider_base.kernel import kernel
from glider_base.kernels.holding import Held
from glider_base.kernels.packing import put
from glider_base.settings import Settings
from glider_base.signals import TICK_NS, TICK_S
from glider_base.wiring import FIELDS, not_fitted, present
from glider_model.plant.block import PLANT, plant_move, plant_outputs


@kernel
def _answer(held, stamps_ns, passed, inputs, table, dt):
    """Outputs and flags of every step, row by row."""
    state, params = held.state, held.params
    for k in range(len(stamps_ns)):
        now = stamps_ns[k] // TICK_NS
        for tick in range(now + 1 - passed[k], now + 1):
            t_s = tick * TICK_S
            state, outputs, flags = block_tick(state, t_s, rows_at(inputs, k), params, dt)
        put(table, k, 0, outputs)
        put(table, k, table.shape[1] - len(flags), (flags,))
    held.state = state


@kernel
def _move(held, inputs, table, dt):
    """Those of the plant, which are there before the inputs; these may have one row less."""
    state, params = held.state, held.params
    for k in range(len(table)):
        outputs, finished = plant_outputs(state, params)
        put(table, k, 0, outputs)
        table[k, table.shape[1] - 1] = finished
        if k < len(inputs[0]):
            state = plant_move(state, rows_at(inputs, k), params, dt)
    held.state = state


class RecordedBlock:
    """A block between two ticks; its ``state`` may be kept and put back."""

    def __init__(self, block: Block, settings: Settings) -> None:
        self.block, self.settings = block, settings
        self._held = Held(settings.initial_state(), settings.params())

    @property
    def state(self) -> NamedTuple:
        """State of the block."""
        return self._held.state

    @state.setter
    def state(self, state: NamedTuple) -> None:
        self._held.state = state

    def tune(self, settings: Settings) -> None:
        """Fly on with other settings."""
        self.settings = settings
        self._held = Held(self.state, settings.params())

    def surface(self) -> None:
        """Do what it does when the surface is asked for."""
        self.state = self.block.surface(self.state)

    def clear(self) -> None:
        """Forget what has latched."""
        self.state = self.block.clear(self.state)

    @property
    def inputs(self) -> tuple[str, ...]:
        """Topics that it needs."""
        return present(self.block.wired.inputs, optional_topics(self.settings))

    @property
    def outputs(self) -> tuple[str, ...]:
        """Topics that it fills."""
        return present(self.block.wired.outputs, optional_topics(self.settings))

    def run(
        self,
        stamps_ns: np.ndarray,
        inputs: dict[str, np.ndarray],
        passed: np.ndarray | None = None,
    ) -> tuple[dict[str, np.ndarray], np.ndarray]:
        """Outputs float64[n, m] by topic, and flags int64[n, k], of the steps at stamps int64[n].

        Inputs are float64[n, m] by topic; of the plant's, the last row may lack. In a step
        ``passed`` ticks pass, int64[n], or one.
        """
        wired = self.block.wired
        widths = {name: len(FIELDS[name]) for name in wired.outputs}
        table = np.empty((len(stamps_ns), sum(widths.values()) + len(self.block.flags)))
        absent = set(wired.inputs).difference(self.inputs)
        inputs = inputs | {name: np.tile(not_fitted(name), (len(table), 1)) for name in absent}
        rows = tuple(np.ascontiguousarray(inputs[name]) for name in wired.inputs)
        if self.block is PLANT:
            _move(self._held.held, rows, table, TICK_S)
        else:
            passed = np.ones(len(table), np.int64) if passed is None else passed
            _answer(self._held.held, stamps_ns, passed, rows, table, TICK_S)
        ends = np.cumsum([*widths.values()])
        outputs = dict(zip(widths, np.split(table, ends, axis=1)[:-1], strict=True))
        outputs = {name: outputs[name] for name in self.outputs}
        return outputs, table[:, ends[-1] :].astype(np.int64)
