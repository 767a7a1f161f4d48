# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Constants of a vehicle that are found from the recording itself.

Least squares of the vertical rate, and of pitch where actuators are imposed: what a glider weighs
and how rough it is differs from flight to flight, and nobody measures it otherwise.
"""

import math
from typing import NamedTuple

import numpy as np

from glider_base.errors import ConfigurationError
from glider_flights.record import at_bound
from glider_flights.validation.flying import Imposed, Model, Track, fly
from glider_flights.validation.score import Adcp, speed_off

#: One of least squares: of the vertical rate (m/s), of pitch (rad), of speed by an ADCP (m/s).
UNIT_MPS, UNIT_RAD, UNIT_ADCP_MPS = 0.01, math.radians(2.0), 0.03
#: No more than about so many samples of all stretches, so many of them, are looked at.
SAMPLES, STRETCHES = 20_000, 12
#: The net weight that a fit begins with is that of so many stretches.
FEW = 3
#: What a plant that nobody can fly is off by, in units of least squares.
WORST = 1e3
#: Relative change of cost and constants at which a fit has found them.
TOLERANCE = 1e-5
#: The net weight is looked for within so much of that of the file (kg).
SEARCH_KG = 3.0


class Constant(NamedTuple):
    """Something that can be fitted."""

    field: str  #: of a `Model`, or of its vehicle
    unit: str
    step: float  #: a step of it that is felt, in its unit
    #: A fit moves it by no more than this from where it was (in its unit), and if it is a drag or
    #: the like by no more than this factor either way.
    within: float = math.inf
    factor: float = math.inf

    def read(self, model: Model) -> float:
        """Its value in a model."""
        return getattr(model if self.field in Model._fields else model.vehicle, self.field)

    def write(self, model: Model, value: float) -> Model:
        """The model with another value."""
        changed = {self.field: value}
        if self.field not in Model._fields:
            changed = {'vehicle': model.vehicle._replace(**changed)}
        return model._replace(**changed)

    def bounds(self, value: float) -> tuple[float, float]:
        """Smallest and largest value of a fit that begins with one."""
        if self.factor < math.inf:
            return (value / self.factor, value * self.factor) if value > 0.0 else (0.0, math.inf)
        return value - self.within, value + self.within


#: No body differs from its file by more than so many times, either way (-).
FACTOR = 5.0
CONSTANTS = {
    'mass': Constant('ballast', 'kg', 0.01, within=SEARCH_KG),
    'Cd0': Constant('K_D0', 'kg/m', 0.1, factor=FACTOR),
    'Cd1': Constant('K_D', 'kg/m/rad^2', 10.0, factor=FACTOR),
    'lift': Constant('K_L', 'kg/m/rad', 10.0, factor=FACTOR),
    'compressibility': Constant('compressibility', '1/Pa', 1e-11, factor=FACTOR),
    'expansion': Constant('thermal_expansion', '1/K', 1e-6, within=2e-4),
    'trim': Constant('s_x', 'kg m', 0.01, within=2.0),
    'righting': Constant('s_z', 'kg m', 0.01, within=2.0),
    'pump_x': Constant('pump_x', 'm', 0.01, within=1.0),
    'pitch_scale': Constant('pitch_scale', '-', 0.01, within=0.3),
    'pitch_offset': Constant('pitch_offset_deg', 'deg', 0.1, within=10.0),
}
#: What is fitted if nothing else is said: what the makers of a vehicle fit too.
FITTED = {'slocum': ('mass', 'Cd0'), 'seaglider': ('mass', 'Cd0', 'lift'), 'og1': ('mass', 'Cd0')}
#: More of it with actuators imposed: where the centre of mass is, along the vehicle and below.
OF_ACTUATORS = ('trim', 'righting')
#: More of it where an ADCP tells the speed: pitch sensors have been found 14 % off.
BY_ADCP = ('pitch_scale',)


def chosen(text: str | None, kind: str, impose: Imposed, has_adcp: bool) -> tuple[str, ...]:
    """Names of constants of an option ``--fit``; ``none`` is none; raises ConfigurationError."""
    if text is None:
        names = FITTED[kind] + (BY_ADCP if has_adcp else ())
        return names + (OF_ACTUATORS if impose == 'actuators' else ())
    names = tuple(dict.fromkeys(text.split(','))) if text != 'none' else ()
    for name in names:
        if name not in CONSTANTS:
            raise ConfigurationError(
                f'--fit {text}: no constant {name} (allowed: none, or some of '
                f'{", ".join(CONSTANTS)} with commas)'
            )
    return names


def fitted(
    found: list[Track],
    model: Model,
    impose: Imposed,
    names: tuple[str, ...],
    by_adcp: list[Track],
    adcp: Adcp | None,
) -> Model:
    """Model with the named constants so that it flies most like the recording.

    It is given the speed by an ADCP of the stretches ``by_adcp``.
    """
    if not names:
        return model
    from scipy.optimize import least_squares  # slow to load

    every = max(1, round(len(found) / STRETCHES))
    some = [track for track in found if track.counts.any()][::every]
    step = max(1, sum(int(track.counts.sum()) for track in some) // SAMPLES)
    constants = [CONSTANTS[name] for name in names]
    limits = np.array([one.bounds(one.read(model)) for one in constants])
    limits = (limits / [[one.step] for one in constants]).T
    if 'mass' in names:
        model = _balanced(some[:FEW], model)
    start = np.array([one.read(model) / one.step for one in constants])

    def moved(values: np.ndarray) -> Model:
        changed = model
        for one, value in zip(constants, values, strict=True):
            changed = one.write(changed, value * one.step)
        return changed

    def wrong(values: np.ndarray) -> np.ndarray:
        tried = moved(values)
        off = [_wrong(track, tried, impose, step) for track in some]
        for track in by_adcp:
            speed = speed_off(track, fly(track, tried, impose), adcp)
            off.append(speed[np.isfinite(speed)] / UNIT_ADCP_MPS)
        return np.nan_to_num(np.concatenate(off), nan=WORST, posinf=WORST, neginf=-WORST)

    def slope(values: np.ndarray) -> np.ndarray:
        here = wrong(values)
        return np.stack([wrong(values + one) - here for one in np.eye(len(values))], axis=1)

    tolerances = dict.fromkeys(('ftol', 'xtol', 'gtol'), TOLERANCE)
    return moved(
        least_squares(
            wrong, np.clip(start, *limits), slope, limits, loss='soft_l1', **tolerances
        ).x
    )


def at_bounds(names: tuple[str, ...], start: Model, model: Model) -> list[str]:
    """Those of the fitted constants that ran to their bounds, in words."""
    notes = []
    for name in names:
        one = CONSTANTS[name]
        value, ends = one.read(model), one.bounds(one.read(start))
        if min(abs(value - end) for end in ends) < 1e-3 * one.step:
            notes.append(at_bound(name, value, one.unit))
    return notes


def _balanced(some: list[Track], model: Model) -> Model:
    """Model as heavy as its median vertical rate is off by nothing."""
    mass = CONSTANTS['mass']
    low, high = -SEARCH_KG, SEARCH_KG
    while high - low > mass.step:
        middle = 0.5 * (low + high)
        tried = mass.write(model, middle)
        off = np.median(np.concatenate([_wrong(track, tried, 'pitch', 1) for track in some]))
        low, high = (low, middle) if off > 0.0 else (middle, high)
    return mass.write(model, 0.5 * (low + high))


def _wrong(track: Track, model: Model, impose: Imposed, step: int) -> np.ndarray:
    """What is off, in units of least squares."""
    flown = fly(track, model, impose)
    counts = np.flatnonzero(track.counts)[::step]
    rate = (flown.rate_mps - track.rate_mps)[counts] / UNIT_MPS
    if impose == 'pitch':
        return rate
    pitch = flown.pitch_rad - model.pitch(track.instruments.pitch_rad)
    return np.concatenate([rate, pitch[counts] / UNIT_RAD])
