# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Settings of navigation, and the kernels' params by them."""

from typing import Literal, NamedTuple

import pydantic
from pydantic import Field

from glider_base import plugins
from glider_base.frames import Origin, OriginSettings
from glider_base.settings import Settings, derived, number
from glider_base.slot import usable
from glider_base.wiring import ESTIMATES, SENSORS
from glider_model.onboard.gate import GateSettings
from glider_model.vehicle.actuators import ranges
from glider_model.vehicle.file import load_vehicle
from glider_navigation import methods
from glider_navigation.forecast import ForecastSettings
from glider_navigation.intake import IntakeParams, IntakeState
from glider_navigation.method import NavigationMethodSettings, Start

#: Other parameters of navigation: no method can have such a name.
TAKEN = {'method', 'current', 'forecast', 'gate', 'vehicle', 'origin', 'north_m', 'east_m'}
TAKEN |= {'imu_period_s', 'gyro', 'also_fitted'}


def _check_topics(name: str, method: type[NavigationMethodSettings]) -> None:
    """Refuse a method that reads or tells what there is not."""
    if others := {*method.reads} - {*SENSORS} | {*method.tells} - {*ESTIMATES}:
        raise ValueError(
            f'it reads or tells {", ".join(sorted(others))} (allowed: to read '
            f'{", ".join(SENSORS)}; to tell {", ".join(ESTIMATES)})'
        )


#: Settings of every way to navigate by its name.
METHODS = plugins.classes(
    plugins.NAVIGATION_METHODS, NavigationMethodSettings, methods, TAKEN, _check_topics
)

_MethodChoice = pydantic.create_model(
    '_MethodChoice',
    __base__=Settings,
    method=plugins.choice(METHODS, 'known', plugins.NAVIGATION_METHODS),
    **plugins.sections(METHODS),
)


class NavigationLawSettings(_MethodChoice):
    """How to navigate, whatever the vehicle: the navigation section of a scenario."""

    current: Literal['none', 'persistence', 'tidal', 'forecast'] = Field(
        'persistence',
        description='current under water. none: still water; persistence: that of the last way '
        'between fixes; tidal: a mean and the tide M2, learnt from all of them; forecast: what is '
        'forecast, and by how much that was off on the last way',
    )
    forecast: ForecastSettings = Field(
        ForecastSettings(), description='current that is forecast, where it is used'
    )

    gate: GateSettings = Field(GateSettings(), description='samples of sensors that are refused')

    @pydantic.model_validator(mode='after')
    def _check_forecast(self):
        if self.current == 'forecast' and not self.forecast.is_given:
            raise ValueError(
                "current = 'forecast': there is none (give forecast a speed and a direction, "
                'components or a field)'
            )
        return self

    @property
    def chosen(self) -> NavigationMethodSettings:
        """Settings of the method that was chosen."""
        method = METHODS[self.method]
        return getattr(self, self.method) if method.model_fields else method()

    @property
    def topics(self) -> tuple[str, ...]:
        """Topics of sensors and estimates that there are in a run."""
        return (*self.chosen.reads, *self.chosen.tells)

    @property
    def jumps(self) -> bool:
        """Whether what is estimated may jump, as it does at a fix."""
        return 'fix' in self.chosen.reads

    @property
    def idle(self) -> set[str]:
        """Methods of other packages that do not fly, with the settings that they have anyway."""
        names = plugins.of_others(METHODS, methods) - {self.method}
        return {name for name in names if getattr(self, name, None) == METHODS[name]()}


class NavigationSettings(NavigationLawSettings):
    """Everything the navigation node is set to."""

    vehicle: str = Field('zhang2021', description='vehicle whose glide polar is used')
    origin: OriginSettings = Field(
        OriginSettings(), description='where the origin of map lies on the Earth'
    )
    north_m: float = number(0.0, (-1e7, 1e7), 'place of the launch, north (m)')
    east_m: float = number(0.0, (-1e7, 1e7), 'place of the launch, east (m)')
    imu_period_s: float = number(0.1, (0.1, 30.0), 'time between two samples of attitude (s)')
    gyro: bool = Field(True, description='angular rates are measured')
    also_fitted: list[Literal[SENSORS]] = Field(
        [], description='topics of sensors beside those that the method reads'
    )

    @property
    def topics(self) -> tuple[str, ...]:
        """Topics of sensors and estimates that there are in a run."""
        return tuple(dict.fromkeys((*super().topics, *self.also_fitted)))

    @property
    def _start(self) -> Start:
        vehicle, origin = load_vehicle(self.vehicle), self.origin.params()
        place = {'p_n': self.north_m, 'p_e': self.east_m}
        return derived(Start, self, vehicle=vehicle, origin=origin, **place)

    def params(self) -> 'NavigationParams':
        """Kernel parameters."""
        vehicle, gate = load_vehicle(self.vehicle).params(), self.gate.params()
        intake = IntakeParams(
            gate,
            ranges(vehicle),
            gate.hold_s + self.imu_period_s,
            'imu' in self.chosen.reads,
            'measured_odom' in self.chosen.reads,
        )
        return NavigationParams(
            self.origin.params(),
            intake,
            usable('navigation.method: params', self.chosen.params, self._start),
        )

    def initial_state(self) -> 'NavigationState':
        """State before the first tick."""
        return NavigationState(
            IntakeState(),
            usable('navigation.method: initial_state', self.chosen.initial_state, self._start),
        )


class NavigationParams(NamedTuple):
    """Navigation as the kernels see it."""

    origin: Origin
    intake: IntakeParams
    method: NamedTuple  #: of the method that was chosen


class NavigationState(NamedTuple):
    """Navigation between two ticks."""

    intake: IntakeState
    method: NamedTuple  #: of the method that was chosen
