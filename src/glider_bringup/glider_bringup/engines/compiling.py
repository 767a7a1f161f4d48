# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The loop of a law with a method that was never flown here is compiled, once; this is shown."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import partial

import numpy as np

from glider_base.errors import MAX_LINE, ConfigurationError
from glider_base.kernel import on_compiling
from glider_base.slot import NOT_COMPILED, reason
from glider_bringup.engines.direct import HeldMission
from glider_bringup.engines.flight import mission_of
from glider_bringup.engines.interrupts import interrupts_noted
from glider_mission.blocks import ROW
from glider_mission.choices import Combination, combination_of, loop_of
from glider_mission.scenario import Scenario
from glider_model.vehicle.file import vehicle_path

#: Gets one line for a person; may return what is to be called when that is over.
Tell = Callable[[str], Callable[[], None] | None]


@contextmanager
def shown_once(combination: Combination, tell: Tell) -> Iterator[None]:
    """Tell what is compiled in the block, if anything is; what cannot be is refused."""
    law, method, navigation, breaks, steered = combination
    words = [f'law {law} with method {method}', f'position {navigation.replace("_", " ")}']
    if breaks:
        words.append('faults')
    if steered:
        words.append(f'vehicle {vehicle_path(steered).stem}')
    line = f'compiling the mathematics for {", ".join(words)}, once; up to half a minute'
    try:
        with on_compiling(partial(tell, line)):
            yield
    except NOT_COMPILED as error:
        raise ConfigurationError(
            f'law {law} with method {method}: cannot be compiled: {reason(error)[:MAX_LINE]} '
            '(allowed: numbers that keep their type, 0.0 for a float; none at random)'
        ) from None


def compile_loops(scenarios: Iterable[Scenario], tell: Tell) -> None:
    """Have loops of scenarios compiled that are not in the cache, before many processes need them.

    Raises KeyboardInterrupt after the loop that was being compiled.
    """
    kinds: dict[tuple, Scenario] = {}
    for one in scenarios:
        kinds.setdefault(loop_of(one), one)
    with interrupts_noted() as interrupts:
        for one in kinds.values():
            try:
                mission = mission_of(one)
            except ConfigurationError:
                continue  # its flights will tell
            with shown_once(combination_of(one), tell):
                HeldMission(*mission).fly(np.empty((0, ROW)))
            if interrupts:
                raise KeyboardInterrupt(interrupts[0])
