# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The plant flown along the stretches of a recorded flight."""

import math
from typing import Literal, NamedTuple

import numpy as np

from glider_base.errors import ConfigurationError
from glider_base.signals import SEA_WATER_DENSITY, TICK_S
from glider_flights.record import Flight, vertical_rate
from glider_flights.validation.imposed import STEP_S, Forcing, fly_free, fly_held
from glider_flights.validation.track import RATE_S, Track
from glider_model.vehicle.file import VehicleParams, load_vehicle

#: What of a recording can be imposed on the plant.
Imposed = Literal['pitch', 'actuators']
#: What has to be recorded for it, by the names of `Instruments`.
NEEDED = {'pitch': ('pumped_m3',), 'actuators': ('pumped_m3', 'mass_x_m')}
#: No glider flies steeper or rolls more (rad): what hangs from the surface does.
STEEPEST_RAD = math.radians(60.0)


class Model(NamedTuple):
    """What is flown: a vehicle, and how its pitch sensor reads."""

    vehicle: VehicleParams
    #: Pitch is what was recorded times this (-), and this more (deg).
    pitch_scale: float = 1.0
    pitch_offset_deg: float = 0.0

    def pitch(self, recorded_rad: np.ndarray) -> np.ndarray:
        """True pitch (rad) behind what was recorded."""
        return self.pitch_scale * recorded_rad + math.radians(self.pitch_offset_deg)


class Simulated(NamedTuple):
    """What the plant did along a stretch, arrays of shape (n,)."""

    rate_mps: np.ndarray  #: vertical rate (m/s, + down), over the same time as the recorded one
    #: Way through the water since the first sample (m), along the heading and to starboard.
    ahead_m: np.ndarray
    abeam_m: np.ndarray
    #: Heading since the first sample (rad), not wrapped.
    heading_rad: np.ndarray
    speed_mps: np.ndarray  #: speed through the water (m/s)
    roll_rad: np.ndarray
    pitch_rad: np.ndarray


def model_of(name: str, flight: Flight) -> Model:
    """A vehicle with the constants of the body that the files of a flight name.

    Raises
    ------
    ConfigurationError
        If its volume is not known.
    """
    vehicle, body = load_vehicle(name).params(), flight.body or {}
    if body.keys() >= {'mass_kg', 'volume_m3'}:  # one alone would be that of another vehicle
        vehicle = vehicle._replace(m=body['mass_kg'], volume=body['volume_m3'])
    if vehicle.volume == 0.0:
        raise ConfigurationError(
            f'--vehicle {name}: its file has no volume (needed to fly in water that was measured)'
        )
    return Model(vehicle)


def check(found: list[Track], impose: Imposed) -> None:
    """Refuse a flight that lacks what is to be imposed.

    Raises
    ------
    ConfigurationError
    """
    for name in NEEDED[impose]:
        if all(np.isnan(getattr(track.instruments, name)).all() for track in found):
            raise ConfigurationError(
                f'--impose {impose}: {name} was not recorded (needed: {", ".join(NEEDED[impose])})'
            )


def fly(track: Track, model: Model, impose: Imposed) -> Simulated:
    """Fly the plant along a stretch."""
    table, flown = forcing(track, model), np.empty((len(track.phase), len(Simulated._fields)))
    if impose == 'pitch':
        fly_held(table, model.vehicle, STEP_S, flown)
    else:
        fly_free(table, model.vehicle, TICK_S, flown)
    down_m, *others = flown.T
    return Simulated(vertical_rate(track.instruments.time_s, down_m, RATE_S), *others)


def forcing(track: Track, model: Model) -> np.ndarray:
    """Rows of `Forcing`; what was not recorded is 0, water that was not is sea water."""
    own, vehicle = track.instruments, model.vehicle
    columns = Forcing(
        time=own.time_s - own.time_s[0],
        depth=own.depth_m,
        phi=_filled(own.roll_rad, 0.0).clip(-STEEPEST_RAD, STEEPEST_RAD),
        theta=model.pitch(own.pitch_rad).clip(-STEEPEST_RAD, STEEPEST_RAD),
        m_b=-SEA_WATER_DENSITY * _filled(own.pumped_m3, 0.0),
        x_p=_filled(own.mass_x_m, 0.0),
        mu=_filled(own.mass_roll_rad, 0.0),
        delta=_filled(own.surface_rad, 0.0),
        ratio=_filled(track.density_kgpm3, SEA_WATER_DENSITY) / SEA_WATER_DENSITY,
        temperature=_filled(own.temperature_degc, vehicle.reference_temperature),
    )
    return np.ascontiguousarray(np.stack(columns, axis=1))


def _filled(values: np.ndarray, otherwise: float) -> np.ndarray:
    """Values with gaps filled from the neighbours."""
    good = np.isfinite(values)
    if not good.any():
        return np.full(len(values), otherwise)
    index = np.arange(len(values))
    return np.interp(index, index[good], values[good])
