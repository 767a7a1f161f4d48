# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What a vehicle has in its battery and takes out of it: the section energy of a vehicle file."""

import math
from typing import NamedTuple

from glider_model.base.settings import Settings
from glider_model.vehicle.quantity import quantity

#: Sea water by which net heaviness (kg) is oil (cc): 1025 kg/m^3.
CC_PER_KG = 1e6 / 1025.0
#: Voltage of a battery of which the vehicle file says nothing: lithium cells in service (V).
VOLTAGE_V = 15.0

_Line = {'ge': -100.0, 'le': 100.0}
_Power = {'ge': 0.0, 'le': 1000.0}


class EnergySettings(Settings):
    """Battery, and what pump, electronics, moving masses and calls take out of it.

    A volume pumped at a depth z takes pump_out + pump_out_per_m z a cc, and let in accordingly;
    never less than nothing. A mass takes as much as it moves, to and fro.
    """

    capacity: quantity('Wh', gt=0.0, le=1e6)
    usable: quantity('-', gt=0.0, le=1.0)  # share of it; the guard surfaces on the rest
    voltage: quantity('V', gt=0.0, le=1000.0)
    pump_out: quantity('J/cc', **_Line)
    pump_out_per_m: quantity('J/cc/m', **_Line)
    pump_in: quantity('J/cc', **_Line)
    pump_in_per_m: quantity('J/cc/m', **_Line)
    hotel_dive: quantity('W', **_Power)
    hotel_climb: quantity('W', **_Power)
    hotel_surface: quantity('W', **_Power)
    pitch_mass: quantity('J/m', ge=0.0, le=1e6)
    roll_mass: quantity('J/deg', ge=0.0, le=1e4)
    steering_surface: quantity('J/deg', ge=0.0, le=1e4) | None = None
    call_start: quantity('J', ge=0.0, le=1e6)  # once at each surfacing
    call_power: quantity('W', **_Power)  # above hotel_surface
    call_duration: quantity('s', ge=0.0, le=86400.0)

    def params(self) -> 'EnergyParams':
        """Kernel parameters."""
        surface = self.steering_surface.value if self.steering_surface else 0.0
        return EnergyParams(
            3600.0 * self.capacity.value,
            self.voltage.value,
            CC_PER_KG * self.pump_out.value,
            CC_PER_KG * self.pump_out_per_m.value,
            CC_PER_KG * self.pump_in.value,
            CC_PER_KG * self.pump_in_per_m.value,
            self.hotel_dive.value,
            self.hotel_climb.value,
            self.hotel_surface.value,
            self.pitch_mass.value,
            math.degrees(self.roll_mass.value),
            math.degrees(surface),
            self.call_start.value,
            self.call_power.value,
            self.call_duration.value,
        )


class EnergyParams(NamedTuple):
    """The section as the kernels see it."""

    capacity: float  #: (J); 0: nothing is known of the battery but its voltage
    voltage: float  #: (V)
    out: float  #: pumped out (J/kg), and for each metre of depth (J/kg/m)
    out_per_m: float
    let_in: float  #: let in (J/kg), and for each metre of depth (J/kg/m)
    let_in_per_m: float
    dive: float  #: electronics by phase (W)
    climb: float
    surface: float
    pitch: float  #: moving mass (J/m, J/rad) and steering surface (J/rad)
    roll: float
    steer: float
    call_start: float  #: (J)
    call: float  #: (W)
    call_s: float  #: (s)


NO_ENERGY = EnergyParams(0.0, VOLTAGE_V, *(13 * (0.0,)))
