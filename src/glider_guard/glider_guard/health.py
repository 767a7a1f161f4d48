# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What the vehicle's own health sensors tell: leak, vacuum, battery, contact."""

from typing import NamedTuple

from glider_base.kernel import kernel
from glider_guard.rows import BATTERY, LEAK, NO_CONTACT, VACUUM, row


class HealthLimits(NamedTuple):
    """What is healthy."""

    vacuum_min: float  #: (Pa)
    vacuum_max: float
    battery_min: float  #: (V)
    reserve: float  #: share of the battery that is kept for coming home (-)
    contact_s: float  #: infinite: any
    health_s: float  #: for so long it may be otherwise


class HealthState(NamedTuple):
    """For how long each has not been well (s)."""

    leak_s: float = 0.0
    vacuum_s: float = 0.0
    battery_s: float = 0.0


@kernel
def check_health(state, health, battery, limits, dt):
    """Health a tick later (`HealthState`), and the rows that hold; less than 0 is not measured."""
    vacuum = health.vacuum_pa
    is_off = vacuum >= 0.0 and not limits.vacuum_min <= vacuum <= limits.vacuum_max
    is_low = 0.0 <= battery.voltage < limits.battery_min
    is_low = is_low or 0.0 <= battery.percentage < limits.reserve
    state = HealthState(
        state.leak_s + dt if health.leak > 0.5 else 0.0,
        state.vacuum_s + dt if is_off else 0.0,
        state.battery_s + dt if is_low else 0.0,
    )
    reported = row(LEAK, state.leak_s > limits.health_s)
    reported |= row(VACUUM, state.vacuum_s > limits.health_s)
    reported |= row(BATTERY, state.battery_s > limits.health_s)
    return state, reported | row(NO_CONTACT, health.contact_age_s > limits.contact_s)
