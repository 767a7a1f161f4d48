# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What the sensors of the vehicle's own health say: leak, vacuum, contact.

The hull has no model of its own: without faults it is as it was at the start.
"""

from glider_base.kernel import kernel
from glider_base.signals import TICK_S, Health

#: Pressure in a closed hull below that of the air (Pa): 7 inches of mercury, in the middle of what
#: a Slocum accepts (4 to 12).
VACUUM_PA = 23700.0


@kernel
def health_of(state):
    """What the health sensors of a vehicle say at a tick (`Health`), all well but for contact."""
    return Health(0.0, VACUUM_PA, state.surfacing.silent_ticks * TICK_S)
