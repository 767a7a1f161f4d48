# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""An order to a vehicle in flight: another path, depth, pitch or wait; hold, resume, abort."""

from typing import Any, Literal

import pydantic
from pydantic import Field

from glider_base.settings import Settings, number
from glider_base.signals import TICK_S
from glider_guidance.path.settings import PathSettings

#: Orders that are given alone, and those that may be given together.
ALONE, TOGETHER = ('hold', 'resume', 'abort'), ('path', 'depth_m', 'pitch_deg', 'wait_s')


class Order(Settings):
    """What a vehicle is ordered in flight, and when."""

    at_s: float = number(..., (0.0, 1e8), 'time from which it holds (s)')
    when: Literal['once', 'surfacing'] = Field(
        'once',
        description='once: from then on; surfacing: from when the vehicle is at the surface next',
    )
    path: PathSettings | None = Field(
        None, description='another path: it is entered at its nearest point'
    )
    depth_m: float | None = number(
        None, (10.0, 12000.0), 'another depth of the lower turn, of this dive on'
    )
    pitch_deg: float | None = number(None, (8.0, 60.0), 'another pitch of the glides (deg)')
    wait_s: float | None = number(
        None, (0.0, 864000.0), 'another wait on the surface between dives (s)'
    )
    hold: bool = Field(False, description='come up and wait at the surface')
    resume: bool = Field(False, description='dive on after a hold')
    abort: bool = Field(False, description='come up for good')

    @pydantic.model_validator(mode='after')
    def _is_one(self):
        alone = [name for name in ALONE if getattr(self, name)]
        together = [name for name in TOGETHER if getattr(self, name) is not None]
        if len(alone) + bool(together) != 1:
            given = ', '.join((*alone, *together)) or 'nothing'
            raise ValueError(
                f'{given}: not one order (allowed: {", ".join(ALONE)} alone, or any of '
                f'{", ".join(TOGETHER)})'
            )
        if alone and self.when != 'once':
            raise ValueError(f"when = '{self.when}': not with {alone[0]} (allowed: once)")
        return self

    @property
    def tick(self) -> int:
        """First tick at which it can hold: the second one at the earliest, for it is in flight."""
        return max(1, round(self.at_s / TICK_S))

    def changes(self) -> dict[str, Any]:
        """Settings of guidance that it changes, by dotted name; none where it aborts."""
        asked = {
            'path': self.path,
            'profile.depth_m': self.depth_m,
            'profile.pitch_deg': self.pitch_deg,
            'profile.wait_s': self.wait_s,
            'hold': self.hold if self.hold or self.resume else None,
        }
        return {name: value for name, value in asked.items() if value is not None}
