# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What goes wrong with messages on purpose, as a person writes it and as a node gets it."""

import math
from typing import Literal

from pydantic import Field

from glider_base.settings import Settings, number, positive
from glider_base.wiring import PORTS

#: Topics that are published in every tick, but that of time.
TICK_TOPICS = tuple(name for name in PORTS if name != '/clock')


class MessageFault(Settings):
    """Messages of a topic go wrong as they leave their node."""

    topic: Literal[TICK_TOPICS] = Field(description='topic that is published in every tick')
    how: Literal['drop', 'duplicate', 'delay', 'reorder', 'corrupt'] = Field(
        description='it is lost, comes twice, comes late, comes after the next one, or is cut in '
        'two'
    )
    share: float = positive(..., 1.0, 'of so many of the messages (-)')
    delay_s: float = number(0.02, (0.0, 10.0), 'by which one comes late (s of wall time)')
    at_s: float = number(0.0, (0.0, 1e8), 'not before this time (s)')
    for_s: float = number(0.0, (0.0, 1e8), 'how long it lasts (s); 0: to the end')

    def strikes_at(self, t_s: float) -> bool:
        """Whether it is the time of the fault."""
        return self.at_s <= t_s < (self.at_s + self.for_s if self.for_s else math.inf)
