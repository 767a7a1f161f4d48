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
from glider_mission.choices import Combination
from glider_mission.scenario import load_scenario
from glider_model.vehicle.file import load_vehicle, vehicle_path

#: Depth of a profile that is compiled and not flown, if the vehicle is rated for it (m).
DEPTH_M = 100.0
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
            '(allowed: numbers that keep their type, 0.0 for a float)'
        ) from None


def compile_loops(combinations: Iterable[Combination], tell: Tell) -> None:
    """Have loops compiled that are not in the cache, before many processes need them at once.

    Raises KeyboardInterrupt after the loop that was being compiled.
    """
    nothing = np.empty((0, ROW))
    with interrupts_noted() as interrupts:
        for one in dict.fromkeys(combinations):
            changes = {
                'control.law': one.law,
                'guidance.los.method': one.method,
                'navigation.method': one.navigation,
                'faults': [{'kind': 'no_contact'}] if one.breaks else [],
            }
            if one.steered:
                vehicle = load_vehicle(one.steered)
                changes['vehicle'] = one.steered
                changes['profile.depth_m'] = min(DEPTH_M, vehicle.rated_depth_m)
                changes['profile.net_heaviness_kg'] = 0.5 * vehicle.params().m_b_max
            try:
                state, params = mission_of(load_scenario(changes=changes))
            except ConfigurationError:
                continue  # by a law that may take the vehicle of its flights: these will tell
            with shown_once(one, tell):
                HeldMission(state, params).fly(nothing)
            if interrupts:
                raise KeyboardInterrupt(interrupts[0])
