# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What a field of current is: settings, params, and a kernel that fills `field_velocity`.

A field is a velocity of the water by place and time, without a memory: an eddy, a front, a model's
output. It is added to the components of `glider_model.ocean.current`, which know depth and time
only. docs/your_law.md builds one from nothing.
"""

from typing import NamedTuple

from pydantic import Field

from glider_base.frames import OriginSettings
from glider_base.kernel import kernel
from glider_base.settings import Settings
from glider_base.slot import returns, slot


class Mission(Settings):
    """Where and when a field is flown, as a scenario says it."""

    origin: OriginSettings = Field(OriginSettings(), description='Of its chart, and its start.')
    places: tuple[tuple[float, float], ...] = Field(
        (), description='Latitude and longitude of the corners of its path (deg).'
    )
    deepest_m: float = Field(1000.0, description='Depth that its vehicle may dive to (m).')
    lasts_s: float = Field(0.0, description='Time that it may last (s).')
    earlier_s: float = Field(
        0.0, description='Time before its start of which the water is asked for, too (s).'
    )


class FieldSettings(Settings):
    """A field; every field of it but ``kind`` is a number or a word of ``current.field``.

    A subclass has ``kind: Literal['NAME'] = 'NAME'``, the name of its file in
    `glider_model.ocean.fields` or of its entry point in the group ``glider.currents``, and
    defaults for all else.
    """

    def resolved(self, mission: Mission) -> 'FieldSettings':
        """Copy that knows where and when it is flown; itself, of a field that need not know."""
        return self

    def known(self) -> 'FieldSettings':
        """Copy with what tells another file; itself, of a field that has none."""
        return self

    def params(self) -> NamedTuple:
        """Kernel parameters, of a type of the field's own."""
        raise NotImplementedError


class NoField(NamedTuple):
    """Params of a current that has no such field."""

    nothing: int = 0  #: a tuple of numbers cannot be empty


@slot
@returns('to the north', 'to the east', 'down (m/s)')
def field_velocity(position, t_s, params):
    """Velocity of the water at a place and time (s since the start), by the type of the params.

    The position is north, east and depth (m) of the place, never above the surface; the params are
    those of `FieldSettings.params`.
    """


@field_velocity.body(NoField)
@kernel
def still(position, t_s, params):
    """No velocity."""
    return 0.0, 0.0, 0.0


@kernel
def bracket(x, axis):
    """Points of an increasing axis on both sides of ``x``, and its share from one to the other."""
    low, high = 0, len(axis) - 1
    if not x > axis[0]:
        return 0, 0, 0.0
    if x >= axis[high]:
        return high, high, 0.0
    while high - low > 1:
        middle = (low + high) // 2
        if axis[middle] <= x:
            low = middle
        else:
            high = middle
    return low, high, (x - axis[low]) / (axis[high] - axis[low])
