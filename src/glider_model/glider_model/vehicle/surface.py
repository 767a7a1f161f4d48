# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What a steering surface is: a section of the vehicle file, params, and the loads it makes.

A vehicle has one such surface, or none and banks to turn. Its section is called like the file of
its kind in `glider_model.vehicle.surfaces`, or like its entry point in the group
``glider.surfaces``, and so is its joint on the topics. How it is steered by is the other half:
`glider_control.surface`.
"""

from typing import NamedTuple

from glider_base.kernel import kernel
from glider_base.settings import Settings
from glider_base.slot import returns, slot
from glider_model.vehicle.quantity import optional, required


class SurfaceSettings(Settings):
    """A steering surface: as far as it goes to each side, and how fast."""

    range: required('deg', 'as far as it turns to each side', gt=0.0, le=90.0)
    rate: required('deg/s', 'how fast it turns', gt=0.0, le=180.0)
    dead_band: optional('deg', 'nearer than this to where it is sent it stops', ge=0.0, le=20.0)
    noise: optional('deg', 'standard deviation of the angle that it says', ge=0.0, le=20.0)

    def params(self) -> NamedTuple:
        """Kernel parameters, of a type of its own, for `surface_loads`."""
        raise NotImplementedError


class NoSurface(NamedTuple):
    """A vehicle without a steering surface."""


@slot
@returns(*(f'force {axis} (N)' for axis in 'xyz'), *(f'moment {axis} (N m)' for axis in 'xyz'))
def surface_loads(loads, u, v, w, p, q, r, delta, params):
    """Loads on hull and steering surface, by the type of its params (`SurfaceSettings.params`).

    Those on the surface are added to ``loads``: viscous force (N) and moment (N m) on the hull
    about the origin, FRD, 6 numbers. u, v, w are the velocity through the water (m/s), p, q, r the
    angular rates (rad/s), FRD; ``delta`` is the angle (rad), + turns the nose to starboard.
    """


@surface_loads.body(NoSurface)
@kernel
def _hull_alone(loads, u, v, w, p, q, r, delta, params):
    """The very same numbers: not even zeros are added, which could change a sign."""
    return loads
