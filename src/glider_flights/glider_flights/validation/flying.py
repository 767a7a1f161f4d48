# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Stretches of a recorded flight under water, and the plant flown along them."""

import math
from typing import Literal, NamedTuple

import numpy as np

from glider_base.errors import ConfigurationError
from glider_base.signals import SEA_WATER_DENSITY, TICK_S
from glider_flights.folders import gsw
from glider_flights.netcdf import names_of
from glider_flights.record import SURFACE_DEPTH_M, Flight, Instruments, in_order, vertical_rate
from glider_flights.validation.imposed import STEP_S, Forcing, fly_free, fly_held
from glider_model.vehicle.file import VehicleParams, load_vehicle

#: The recorded vertical rate is the slope of depth over about this time (s).
RATE_S = 11.0
#: A stretch ends where nothing was recorded for so long (s), or for so many usual intervals.
LONGEST_GAP_S, LONGEST_GAP = 60.0, 8.0
#: A stretch is no shorter (s) and no shallower (m) than this.
SHORTEST_S, SHALLOWEST_M = 120.0, 10.0
#: Depth turns where it goes back by so much (m), or by this share of the depth of the stretch.
TURN_M, TURN = 5.0, 0.2
#: Not compared: so far from the surface and from a turn (m), and no more of a half dive than this.
SURFACE_M, SURFACE, AROUND_TURN_M, AROUND_TURN = 10.0, 0.25, 5.0, 0.125


class Track(NamedTuple):
    """A stretch under water without a gap; arrays of shape (n,)."""

    instruments: Instruments
    pressure_dbar: np.ndarray  #: pressure (dbar, above that of the air)
    density_kgpm3: np.ndarray  #: density in situ (kg/m^3), NaN where it is not known
    rate_mps: np.ndarray  #: recorded vertical rate (m/s, + down)
    phase: np.ndarray  #: whether it is a dive (1) or a climb (-1)
    counts: np.ndarray  #: whether it is compared


def tracks(flight: Flight) -> list[Track]:
    """Stretches under water of a flight; a ConfigurationError if there is none."""
    whole = in_order(flight.instruments, 3)  # time, depth and pitch
    under = whole.depth_m > SURFACE_DEPTH_M
    usual_s = float(np.median(np.diff(whole.time_s[under]))) if under.sum() > 1 else 0.0
    gap_s = max(LONGEST_GAP_S, LONGEST_GAP * usual_s)
    numbers = np.flatnonzero(under)
    breaks = np.flatnonzero((np.diff(numbers) > 1) | (np.diff(whole.time_s[numbers]) > gap_s))
    found = []
    for part in np.split(numbers, breaks + 1):
        if len(part) < 3:
            continue
        own = Instruments(*(values[part] for values in whole))
        if np.ptp(own.time_s) >= SHORTEST_S and own.depth_m.max() >= SHALLOWEST_M:
            found.append(_track(own, flight.origin_deg))
    if not any(track.counts.any() for track in found):
        raise ConfigurationError(
            f'{flight.label}: no stretch under water of {SHORTEST_S:g} s and {SHALLOWEST_M:g} m '
            'with depth and pitch (needed: one)'
        )
    return found


def _track(own: Instruments, origin_deg: np.ndarray) -> Track:
    water = {
        name: _by_depth(own.depth_m, getattr(own, name))
        for name in ('salinity', 'temperature_degc')
    }
    own = own._replace(**water)
    latitude, longitude = origin_deg
    pressure = gsw().p_from_z(-own.depth_m, latitude)
    absolute = gsw().SA_from_SP(own.salinity, pressure, longitude, latitude)
    density = gsw().rho_t_exact(absolute, own.temperature_degc, pressure)
    turns = _turns(own.depth_m)
    counts = np.zeros(len(own.time_s), bool)
    phase = np.zeros(len(own.time_s))
    for begin, end in zip(turns[:-1], turns[1:], strict=True):
        depth = own.depth_m[begin : end + 1]
        phase[begin : end + 1] = math.copysign(1.0, depth[-1] - depth[0])
        counts[begin : end + 1] = _compared(depth)
    return Track(
        instruments=own,
        pressure_dbar=pressure,
        density_kgpm3=density,
        rate_mps=vertical_rate(own.time_s, own.depth_m, RATE_S),
        phase=phase,
        counts=counts,
    )


def _by_depth(depth_m: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Values with gaps filled from those of the same depths, where there are some."""
    good = np.isfinite(values)
    if good.all() or not good.any():
        return values
    order = np.argsort(depth_m[good], kind='stable')
    filled = np.interp(depth_m, depth_m[good][order], values[good][order])
    return np.where(good, values, filled)


def _turns(depth_m: np.ndarray) -> list[int]:
    """Numbers of the samples at which depth turns, the first and the last included."""
    back_m = min(TURN_M, TURN * float(depth_m.max()))
    turns, extreme, down = [0], 0, True
    for number, depth in enumerate(depth_m):
        beyond = depth - depth_m[extreme] if down else depth_m[extreme] - depth
        if beyond > 0.0:
            extreme = number
        elif beyond < -back_m:
            if extreme > turns[-1]:
                turns.append(extreme)
            extreme, down = number, not down
    last = len(depth_m) - 1
    if extreme > turns[-1] and extreme < last:
        turns.append(extreme)
    return [*turns, last]


def _compared(depth_m: np.ndarray) -> np.ndarray:
    """Which samples of a half dive are far enough from the surface and from its turns."""
    span_m = abs(float(depth_m[-1] - depth_m[0]))
    around_m = min(AROUND_TURN_M, AROUND_TURN * span_m)
    top, bottom = min(depth_m[0], depth_m[-1]), max(depth_m[0], depth_m[-1])
    top = max(top + around_m, min(SURFACE_M, SURFACE * bottom))
    return (depth_m >= top) & (depth_m <= bottom - around_m)


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

    Raises ConfigurationError if its volume is not known.
    """
    vehicle, body = load_vehicle(name).params(), flight.body or {}
    if body.keys() >= {'mass_kg', 'volume_m3'}:  # one alone would be that of another vehicle
        vehicle = vehicle._replace(m=body['mass_kg'], volume=body['volume_m3'])
    if vehicle.volume == 0.0:
        raise ConfigurationError(
            f'--vehicle {name}: its file has no volume (needed to fly in water that was measured)'
        )
    return Model(vehicle)


def check(flight: Flight, found: list[Track], impose: Imposed) -> None:
    """Refuse a flight whose stretches lack what is to be imposed; raises ConfigurationError."""
    for name in NEEDED[impose]:
        if all(np.isnan(getattr(track.instruments, name)).all() for track in found):
            names = ' or '.join(names_of(flight.kind)[name])
            raise ConfigurationError(
                f'{flight.label}: no value of {names} (needed for --impose {impose})'
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
