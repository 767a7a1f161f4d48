# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""How a steering surface is steered by: settings, params, state, and a kernel that fills `steer`.

The other half of `glider_model.vehicle.surface`, under the same name: in a file of
`glider_control.surfaces`, or in the group ``glider.surface_laws``. A vehicle with a surface does
not bank to turn: the control law holds it level, and `steer` has the heading.
"""

from typing import NamedTuple

from glider_base.kernel import kernel
from glider_base.settings import Settings, number
from glider_base.signals import Adaptation
from glider_base.slot import default, returns, slot
from glider_model.vehicle.file import Vehicle


class SurfaceLawSettings(Settings):
    """Gains of steering by a surface; every field has a default.

    Its fields are those of ``control.NAME``.
    """

    dead_band_deg: float = number(
        0.2, (0.0, 10.0), 'change of command that the surface ignores (deg)'
    )

    def params(self, vehicle: Vehicle) -> NamedTuple:
        """Kernel parameters, of a type of its own, for a vehicle that has the surface."""
        raise NotImplementedError

    def initial_state(self) -> NamedTuple:
        """State before the first tick, of the type that `steer` returns."""
        raise NotImplementedError


class NoSteering(NamedTuple):
    """Params and state of a vehicle without a steering surface."""


@slot
@returns('state after the tick', 'angle of the surface (rad)')
def steer(state, seen, params, dt):
    """One tick of steering by a surface, of ``dt`` s, by the type of `SurfaceLawSettings.params`.

    Of a `Seen`, as a control law has it, comes the state after the tick, and the angle of the
    surface (rad), + turns the nose to starboard, which control holds in its range. At the surface
    of the sea, and where odometry is lost, it is not asked.
    """


@steer.body(NoSteering)
@kernel
def _bank_to_turn(state, seen, params, dt):
    """The control law turns the vehicle."""
    return state, 0.0


@slot
@default
@returns(*Adaptation._fields)
def surface_learnt(learnt, state, params):
    """What is published on the topic ``adaptation``, with what steering has learnt of its surface.

    Both it and ``learnt``, what the control law has learnt, are an `Adaptation`. ``state`` is that
    of the steering; by the type of `SurfaceLawSettings.params`.
    """
    return learnt
