# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Faults as a person writes them: one model for each kind, with what it does."""

import math
from collections.abc import Collection, Sequence
from typing import Annotated, Any, ClassVar, Literal, NamedTuple, Union

import numpy as np
import pydantic
from pydantic import Field

from glider_base.noise import random_stream
from glider_base.ros.message_fault import TICK_TOPICS, MessageFault
from glider_base.settings import ConfigurationError, Settings, number, positive
from glider_base.signals import TICK_S
from glider_base.wiring import present
from glider_model.plant.faults import kinds
from glider_model.plant.faults.kinds import FaultParams, FaultState, NoFaults, NoFaultState

#: Faults of one scenario at most.
MAX_FAULTS = 50
#: A fault without an end lasts so many ticks: longer than any run.
FOR_EVER = 2**62
#: Sets the streams of faults apart from those of the currents and sensors.
_STREAM_OFFSET = 2**33

#: Actuators in the order of `glider_base.signals.Joints`.
ACTUATORS = ('buoyancy_engine', 'pitch_mass', 'roll_mass', 'steering_surface')
#: Phases of a dive, in the order of their numbers in `kinds`.
PHASES = ('any', 'dive', 'turn', 'climb', 'surface')
_RAD = math.pi / 180.0
#: Topics of which any tells attitude and rates.
_TILTED = ('measured_odom', 'imu')
#: What a sensor shows: the first of its numbers in `kinds`, how many, one of its unit in SI, and
#: the topics of which any tells it.
SENSED = {
    'attitude': (0, 2, _RAD, _TILTED),
    'roll': (0, 1, _RAD, _TILTED),
    'pitch': (1, 1, _RAD, _TILTED),
    'heading': (2, 1, _RAD, _TILTED),
    'rates': (3, 3, _RAD, _TILTED),
    'depth': (6, 1, 1.0, ('measured_odom', 'pressure')),
    'position': (7, 2, 1.0, ('measured_odom',)),
    'velocity': (9, 3, 1.0, ('measured_odom',)),
    'fix': (12, 3, 1.0, ('fix',)),
}


def measured(topics: Collection[str], gyro: bool = True) -> tuple[str, ...]:
    """What of `SENSED` is measured where there are these topics, with a gyro or without."""
    shown = (name for name, (*_, tell) in SENSED.items() if not set(tell).isdisjoint(topics))
    return tuple(name for name in shown if gyro or name != 'rates')


class FaultSettings(Settings):
    """When a fault begins: at the first tick at which all of its conditions hold."""

    at_s: float = number(0.0, (0.0, 1e8), 'not before this time (s)')
    at_depth_m: float | None = number(
        None, (0.0, 12000.0), 'not before it is as deep as this, or in a climb as shallow (m)'
    )
    phase: Literal[PHASES] = Field(
        'any',
        description='only while it sinks (dive), rises (climb), does neither at depth (turn), or '
        'is at the surface after a dive',
    )
    for_s: float = number(0.0, (0.0, 1e8), 'how long it lasts (s); 0: to the end')

    #: The kind that it is to the kernels, if another one.
    acts_as: ClassVar[str] = ''
    #: What of `SENSED` it is about, if of any.
    measures: ClassVar[str] = ''

    @property
    def code(self) -> int:
        """Number of its kind."""
        return kinds.KINDS.index(self.acts_as or self.kind)

    @property
    def own(self) -> dict[str, Any]:
        """Its own fields, which say neither its kind nor when it is."""
        common = {*FaultSettings.model_fields, 'kind'}
        return {name: value for name, value in self if name not in common}

    @property
    def target(self) -> tuple[int, int]:
        """Actuator, or the first of the numbers of a sensor; and how many of them."""
        return 0, 1

    @property
    def numbers(self) -> Sequence[float]:
        """What the kernels get of it, four at most: its own numbers."""
        return [float(value) for value in self.own.values() if not isinstance(value, str)]

    @property
    def lasts(self) -> int:
        """How many ticks it lasts."""
        return max(1, round(self.for_s / TICK_S)) if self.for_s else FOR_EVER

    @property
    def words(self) -> str:
        """What it is, in a few words."""
        unusual = ', '.join(
            value if isinstance(value, str) else f'{name} {value:g}'
            for name, value in self.own.items()
            if value != type(self).model_fields[name].default
        )
        return f'{self.kind}: {unusual}' if unusual else self.kind

    @property
    def when(self) -> str:
        """What it waits for, in words."""
        parts = [f'from {self.at_s:g} s'] if self.at_s or self.at_depth_m is None else []
        parts += [f'at {self.at_depth_m:g} m'] if self.at_depth_m is not None else []
        parts += [f'in {self.phase}'] if self.phase != 'any' else []
        parts += [f'for {self.for_s:g} s'] if self.for_s else []
        return ', '.join(parts)


class Leak(FaultSettings):
    """Water runs into the hull and makes the vehicle heavier; what is in it stays."""

    kind: Literal['leak']
    rate_kgps: float = positive(..., 10.0, 'water taken in (kg/s)')
    limit_kg: float = positive(100.0, 100.0, 'and no more than this (kg)')
    detected: bool = Field(True, description='the leak detector tells it, from 0.01 kg on')


class Mass(FaultSettings):
    """The vehicle is heavier, or lighter: something was picked up, or lost."""

    kind: Literal['mass']
    mass_kg: float = number(..., (-50.0, 50.0), 'added net buoyancy (kg, + sinks)')


class Fouling(FaultSettings):
    """Growth on hull and wings, or a lost wing: drag and lift change."""

    kind: Literal['fouling']
    drag: float = number(1.5, (0.1, 20.0), 'factor on the drag (-)')
    lift: float = number(1.0, (0.0, 5.0), 'factor on the lift that turns (-)')
    over_s: float = number(0.0, (0.0, 1e8), 'time in which that comes about (s)')


class LooseRollMass(FaultSettings):
    """The roll mass has come off its drive and hangs straight down: no roll moment."""

    kind: Literal['loose_roll_mass']


class Gust(FaultSettings):
    """Water that moves beside the current of the scenario, where the vehicle is."""

    kind: Literal['gust']
    north_mps: float = number(0.0, (-3.0, 3.0), 'velocity to the north (m/s)')
    east_mps: float = number(0.0, (-3.0, 3.0), 'velocity to the east (m/s)')
    down_mps: float = number(0.0, (-1.0, 1.0), 'velocity downward (m/s)')
    over_s: float = number(60.0, (1.0, 1e6), 'time in which it rises, and falls (s)')


class _ActuatorFault(FaultSettings):
    """Something about one actuator."""

    actuator: Literal[ACTUATORS] = Field(
        description='which actuator; steering_surface where the vehicle has one'
    )

    @property
    def target(self) -> tuple[int, int]:
        """Number of the actuator."""
        return ACTUATORS.index(self.actuator), 1


class Stuck(_ActuatorFault):
    """The actuator does not move."""

    kind: Literal['stuck']
    acts_as: ClassVar[str] = 'slow'
    numbers: ClassVar[Sequence[float]] = (0.0,)


class Slow(_ActuatorFault):
    """The actuator moves slower than it should."""

    kind: Literal['slow']
    rate: float = number(0.2, (0.001, 1.0), 'factor on its rate (-)')


class Offset(_ActuatorFault):
    """The actuator is somewhere else than where it says."""

    kind: Literal['offset']
    offset: float = number(..., (-1.0, 1.0), 'how far, as a share of its range (-)')


class Partial(_ActuatorFault):
    """The actuator reaches a part of its range."""

    kind: Literal['partial']
    low: float = number(-1.0, (-1.0, 1.0), 'from this share of its range (-)')
    high: float = number(1.0, (-1.0, 1.0), 'to this share (-)')

    @pydantic.model_validator(mode='after')
    def _check_order(self):
        if self.low > self.high:
            raise ValueError(
                f'low = {self.low:g} is above high = {self.high:g} (allowed: <= high)'
            )
        return self


class Jam(_ActuatorFault):
    """The actuator jams and comes free, over and over."""

    kind: Literal['jam']
    period_s: float = number(60.0, (0.2, 1e6), 'from jam to jam (s)')
    share: float = number(0.5, (0.0, 1.0), 'share of it that it is jammed for (-)')


class _SensorFault(FaultSettings):
    """Something about what is measured."""

    sensor: Literal[tuple(SENSED)] = Field(
        description='what is measured: attitude (roll and pitch) or one of the two, heading, '
        'rates, depth (pressure too), position (north and east of measured_odom), velocity, fix'
    )

    @property
    def measures(self) -> str:
        """What is measured."""
        return self.sensor

    @property
    def target(self) -> tuple[int, int]:
        """Numbers of the sensor."""
        return SENSED[self.sensor][:2]

    @property
    def numbers(self) -> Sequence[float]:
        """Its own numbers in SI."""
        si = {name: SENSED[self.sensor][2] for name in ('error', 'std')}
        own = self.own.items()
        return [value * si.get(name, 1.0) for name, value in own if name != 'sensor']


def _error(words: str, least: float = -1e6):
    return number(..., (least, 1e6), f'{words} (deg, deg/s, m or m/s, by what is measured)')


class Frozen(_SensorFault):
    """It shows what it showed last; stamps go on."""

    kind: Literal['frozen']
    acts_as: ClassVar[str] = 'dropout'
    numbers: ClassVar[Sequence[float]] = (1.0,)


class Biased(_SensorFault):
    """It shows too much, or too little."""

    kind: Literal['biased']
    error: float = _error('added to each number')


class Spike(_SensorFault):
    """It shows wild numbers now and then, of either sign, at random."""

    kind: Literal['spike']
    error: float = _error('added or taken away')
    share: float = number(0.01, (0.0, 1.0), 'share of the ticks at which it is (-)')


class Dropout(_SensorFault):
    """It has no new sample now and then, at random, and shows the last one."""

    kind: Literal['dropout']
    share: float = number(0.5, (0.0, 1.0), 'share of the ticks at which it has none')


class Noisier(_SensorFault):
    """White noise is added to each number."""

    kind: Literal['noisier']
    std: float = _error('standard deviation', least=0.0)


class Compass(FaultSettings):
    """The deviation of the compass jumps: an error that goes as the sine of the heading."""

    kind: Literal['compass']
    measures: ClassVar[str] = 'heading'
    deviation_deg: float = number(..., (-90.0, 90.0), 'its largest error (deg)')
    phase_deg: float = number(0.0, (-180.0, 180.0), 'phase of the sine (deg)')

    @property
    def numbers(self) -> Sequence[float]:
        """Its parts with the sine and the cosine of the heading (rad)."""
        size, phase = math.radians(self.deviation_deg), math.radians(self.phase_deg)
        return size * math.cos(phase), size * math.sin(phase)


class GpsSilent(FaultSettings):
    """There is no fix."""

    kind: Literal['gps_silent']
    measures: ClassVar[str] = 'fix'


class Battery(FaultSettings):
    """The voltage of the battery sags."""

    kind: Literal['battery']
    drop_v: float = number(..., (0.0, 15.0), 'by so much (V)')
    over_s: float = number(0.0, (0.0, 1e8), 'in this time (s)')


class Vacuum(FaultSettings):
    """The vacuum of the hull is lost."""

    kind: Literal['vacuum']
    rate_paps: float = positive(100.0, 1e6, 'in a second (Pa/s)')


class NoContact(FaultSettings):
    """Nobody answers at the surface: the age of the last contact grows on."""

    kind: Literal['no_contact']


class Message(MessageFault, FaultSettings):
    """Messages of a topic go wrong as they leave their node; over nodes alone."""

    kind: Literal['message']

    @pydantic.model_validator(mode='after')
    def _check_when(self):
        if self.at_depth_m is not None or self.phase != 'any':
            raise ValueError(
                'at_depth_m, phase: a message goes wrong by time alone (at_s, for_s), for who '
                'publishes it need not know where the vehicle is'
            )
        return self


def _kinds(model: type[FaultSettings]) -> list[type[FaultSettings]]:
    """Models of kinds, in the order in which they stand here."""
    return [kind for one in model.__subclasses__() for kind in _kinds(one)] or [model]


Fault = Annotated[Union[tuple(_kinds(FaultSettings))], Field(discriminator='kind')]  # noqa: UP007
#: A scenario's faults, as a field of settings.
FAULTS = Field([], max_length=MAX_FAULTS, description='what breaks, and when')


def check_fitted(
    faults: Sequence[FaultSettings], steers_by: str, topics: Collection[str], gyro: bool
) -> None:
    """Refuse a fault of what there is not: an actuator, something measured, a topic.

    The vehicle steers by that surface, and of `SENSORS` and `ESTIMATES` it has ``topics``.
    Raises ConfigurationError.
    """
    has = {
        'actuator': ACTUATORS if steers_by else ACTUATORS[:-1],
        'measures': measured(topics, gyro),
        'topic': present(TICK_TOPICS, topics),
    }
    for i, fault in enumerate(faults):
        fields = type(fault).model_fields
        for name, allowed in has.items():
            if (value := getattr(fault, name, '')) and value not in allowed:
                field = next(one for one in (name, 'sensor', 'kind') if one in fields)
                raise ConfigurationError(
                    f'faults.{i}.{field} = {getattr(fault, field)!r}: there is no {value} in this '
                    f'mission (allowed: faults of {", ".join(allowed)})'
                )


def fault_params(faults: Sequence[FaultSettings], seed: int) -> NamedTuple:
    """Kernel parameters of faults: `NoFaults`, or `FaultParams`."""
    if not faults:
        return NoFaults()
    numbers = np.zeros((len(faults), 4))
    for row, fault in zip(numbers, faults, strict=True):
        row[: len(fault.numbers)] = fault.numbers
    codes, targets = [fault.code for fault in faults], [fault.target for fault in faults]
    depths = [np.nan if fault.at_depth_m is None else fault.at_depth_m for fault in faults]
    streams = [random_stream(seed, _STREAM_OFFSET, i) for i in range(len(faults))]
    return FaultParams(
        kind=np.array(codes, np.int64),
        target=np.array([first for first, _ in targets], np.int64),
        count=np.array([count for _, count in targets], np.int64),
        numbers=numbers,
        from_tick=np.array([round(fault.at_s / TICK_S) for fault in faults], np.int64),
        depth=np.array(depths, np.float64),
        phase=np.array([PHASES.index(fault.phase) for fault in faults], np.int64),
        ticks=np.array([fault.lasts for fault in faults], np.int64),
        stream=np.array(streams, np.uint64),
        repeats=kinds.DROPOUT in codes,
    )


def fault_state(faults: Sequence[FaultSettings]) -> NamedTuple:
    """State of faults of which none has begun."""
    if not faults:
        return NoFaultState()
    return FaultState(np.full(len(faults), -1, np.int64), np.zeros(kinds.SHOWN))
