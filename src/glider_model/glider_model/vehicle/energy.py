# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What a vehicle has in its battery and takes out of it: the section energy of a vehicle file."""

import math
from typing import NamedTuple

from glider_base.settings import Settings
from glider_base.signals import SEA_WATER_DENSITY
from glider_model.vehicle.quantity import optional, required

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

    capacity: required('Wh', 'of a fresh battery', gt=0.0, le=1e6)
    usable: required('-', 'share of it; the guard surfaces on the rest', gt=0.0, le=1.0)
    voltage: required('V', 'of a battery in service', gt=0.0, le=1000.0)
    pump_out: required('J/cc', 'taken by a volume pumped out at the surface', **_Line)
    pump_out_per_m: required('J/cc/m', 'and more for every metre of depth', **_Line)
    pump_in: required(
        'J/cc', 'the same of a volume let in; never less than nothing in all', **_Line
    )
    pump_in_per_m: required('J/cc/m', 'and more for every metre of depth', **_Line)
    hotel_dive: required('W', 'electronics and sensors in the dive', **_Power)
    hotel_climb: required('W', 'the same in the climb', **_Power)
    hotel_surface: required('W', 'the same at the surface', **_Power)
    pitch_mass: required('J/m', 'by as much as it moves, to and fro', ge=0.0, le=1e6)
    roll_mass: required('J/deg', 'the same', ge=0.0, le=1e4)
    steering_surface: optional('J/deg', 'the same; 0 without', ge=0.0, le=1e4)
    call_start: required('J', 'once at each surfacing', ge=0.0, le=1e6)
    call_power: required('W', 'of a call, above hotel_surface', **_Power)
    call_duration: required('s', 'of a call', ge=0.0, le=86400.0)

    @property
    def usable_wh(self) -> float:
        """What the guard lets be taken from a fresh battery (Wh)."""
        return self.usable.value * self.capacity.value

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
