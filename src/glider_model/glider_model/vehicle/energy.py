# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What a vehicle has in its battery and takes out of it: the section energy of a vehicle file."""

import math
from typing import NamedTuple

from glider_base.settings import Settings
from glider_base.signals import SEA_WATER_DENSITY
from glider_model.vehicle.quantity import meaning, quantity

#: Oil (cc) that makes as much net heaviness (kg).
CC_PER_KG = 1e6 / SEA_WATER_DENSITY
#: Voltage of a battery of which the vehicle file says nothing: lithium cells in service (V).
VOLTAGE_V = 15.0

_Line = {'ge': -100.0, 'le': 100.0}
_Power = {'ge': 0.0, 'le': 1000.0}


class EnergySettings(Settings):
    """Battery, and what pump, electronics, moving masses and calls take out of it.

    A volume pumped at a depth z takes pump_out + pump_out_per_m z a cc, and let in accordingly;
    never less than nothing. A mass takes as much as it moves, to and fro.
    """

    capacity: meaning(quantity('Wh', gt=0.0, le=1e6), 'of a fresh battery')
    usable: meaning(quantity('-', gt=0.0, le=1.0), 'share of it; the guard surfaces on the rest')
    voltage: meaning(quantity('V', gt=0.0, le=1000.0), 'of a battery in service')
    pump_out: meaning(quantity('J/cc', **_Line), 'taken by a volume pumped out at the surface')
    pump_out_per_m: meaning(quantity('J/cc/m', **_Line), 'and more for every metre of depth')
    pump_in: meaning(
        quantity('J/cc', **_Line), 'the same of a volume let in; never less than nothing in all'
    )
    pump_in_per_m: meaning(quantity('J/cc/m', **_Line), 'and more for every metre of depth')
    hotel_dive: meaning(quantity('W', **_Power), 'electronics and sensors in the dive')
    hotel_climb: meaning(quantity('W', **_Power), 'the same in the climb')
    hotel_surface: meaning(quantity('W', **_Power), 'the same at the surface')
    pitch_mass: meaning(quantity('J/m', ge=0.0, le=1e6), 'by as much as it moves, to and fro')
    roll_mass: meaning(quantity('J/deg', ge=0.0, le=1e4), 'the same')
    steering_surface: meaning(quantity('J/deg', ge=0.0, le=1e4) | None, 'the same; 0 without') = (
        None
    )
    call_start: meaning(quantity('J', ge=0.0, le=1e6), 'once at each surfacing')
    call_power: meaning(quantity('W', **_Power), 'of a call, above hotel_surface')
    call_duration: meaning(quantity('s', ge=0.0, le=86400.0), 'of a call')

    def params(self) -> 'EnergyParams':
        """Kernel parameters."""
        surface = self.steering_surface.value if self.steering_surface else 0.0
        return EnergyParams(
            capacity=3600.0 * self.capacity.value,
            voltage=self.voltage.value,
            out=CC_PER_KG * self.pump_out.value,
            out_per_m=CC_PER_KG * self.pump_out_per_m.value,
            let_in=CC_PER_KG * self.pump_in.value,
            let_in_per_m=CC_PER_KG * self.pump_in_per_m.value,
            dive=self.hotel_dive.value,
            climb=self.hotel_climb.value,
            surface=self.hotel_surface.value,
            pitch=self.pitch_mass.value,
            roll=math.degrees(self.roll_mass.value),
            steer=math.degrees(surface),
            call_start=self.call_start.value,
            call=self.call_power.value,
            call_s=self.call_duration.value,
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
