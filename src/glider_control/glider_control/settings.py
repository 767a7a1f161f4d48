# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Settings of control, and the kernels' params by them."""

import math
from typing import Literal

import pydantic
from pydantic import Field

from glider_base import plugins
from glider_base.settings import ConfigurationError, Settings, number, positive
from glider_base.signals import Joints
from glider_base.slot import usable
from glider_control import laws, surfaces
from glider_control.allocation import make_allocation
from glider_control.control import ControlParams, ControlState
from glider_control.intake import IntakeParams
from glider_control.law import HeadingSettings, LawSettings
from glider_control.surface import NoSteering, SurfaceLawSettings
from glider_model.onboard.attitude_filter import STILL
from glider_model.onboard.gate import GateSettings
from glider_model.onboard.glide_polar import make_polar
from glider_model.vehicle.actuators import ranges
from glider_model.vehicle.file import load_vehicle


class BuoyancySettings(Settings):
    """Vertical rate on the buoyancy engine."""

    ki_kg_per_m: float = number(
        0.004, (0.0, 10.0), 'integral of the vertical-rate error (kg/m)', tunable=True
    )
    drag_ki_kg_per_m: float = number(
        0.002, (0.0, 10.0), 'integral that changes sides with dive and climb (kg/m)', tunable=True
    )
    trim_limit_kg: float = number(0.3, (0.0, 20.0), 'largest correction by each integral (kg)')


class FilterSettings(Settings):
    """What keeps noise from moving the motors."""

    attitude_s: float = positive(3.0, 60.0, 'time constant of the attitude filter (s)')
    buoyancy_dead_band_kg: float = number(
        0.005, (0.0, 1.0), 'change of command that the pump ignores (kg)'
    )
    pitch_dead_band_m: float = number(
        1e-4, (0.0, 0.1), 'change of command that the pitch mass ignores (m)'
    )
    roll_dead_band_deg: float = number(
        0.2, (0.0, 10.0), 'change of command that the roll mass ignores (deg)'
    )


#: Other parameters of control: no law can have such a name.
TAKEN = {'law', 'heading', 'buoyancy', 'filters', 'gate', 'vehicle'}
#: Settings of every control law by its name.
LAWS = plugins.classes(plugins.CONTROL_LAWS, LawSettings, laws, TAKEN)
#: Settings of steering by every kind of surface, by its name.
SURFACE_LAWS = plugins.classes(plugins.SURFACE_LAWS, SurfaceLawSettings, surfaces, {*TAKEN, *LAWS})

#: The choice of a law, and the gains of each, so that another one is chosen by one word; then
#: those of steering by a surface, which the vehicle chooses.
_LawChoice = pydantic.create_model(
    '_LawChoice',
    __base__=Settings,
    law=plugins.choice(LAWS, 'adaptive', plugins.CONTROL_LAWS, 'attitude law'),
    **plugins.sections({**LAWS, **SURFACE_LAWS}),
)


class ControlLawSettings(_LawChoice):
    """How to control, whatever the vehicle: the control section of a scenario."""

    heading: HeadingSettings = Field(HeadingSettings(), description='bank to turn')
    buoyancy: BuoyancySettings = Field(BuoyancySettings(), description='vertical-rate law')
    filters: FilterSettings = Field(FilterSettings(), description='filters and dead bands')
    gate: GateSettings = Field(GateSettings(), description='odometry that is refused')

    @pydantic.model_validator(mode='before')
    @classmethod
    def _tell_the_law_alone(cls, values):
        """Leave out the gains of a law that is not there: to tell that it is not is enough."""
        law = values.get('law') if isinstance(values, dict) else None
        if not isinstance(law, str) or law in cls.model_fields:
            return values
        return {name: value for name, value in values.items() if name != law}

    @property
    def chosen(self) -> LawSettings:
        """Gains of the law that was chosen."""
        return getattr(self, self.law, None) or LAWS[self.law]()

    def steering(self, steers_by: str) -> SurfaceLawSettings | None:
        """Gains of steering by a surface of this name; None without a name.

        Raises ConfigurationError if nothing steers by such a surface.
        """
        if steers_by and steers_by not in SURFACE_LAWS:
            raise ConfigurationError(
                f'the vehicle has a {steers_by}, which nothing steers by (allowed: '
                f'{", ".join(SURFACE_LAWS)}; {plugins.others(plugins.SURFACE_LAWS)})'
            )
        if not steers_by:
            return None
        return getattr(self, steers_by, None) or SURFACE_LAWS[steers_by]()

    def idle(self, steers_by: str) -> set[str]:
        """What does not fly, with the gains that it has anyway: laws of others, surfaces."""
        kinds = {**LAWS, **SURFACE_LAWS}
        names = (plugins.of_others(LAWS, laws) | set(SURFACE_LAWS)) - {self.law, steers_by}
        return {name for name in names if getattr(self, name, None) == kinds[name]()}


class ControlSettings(ControlLawSettings):
    """Everything the control node is set to."""

    vehicle: str = Field('zhang2021', description='vehicle: masses, ranges, polar, steering')

    def params(self) -> 'ControlParams':
        """Kernel parameters."""
        vehicle = load_vehicle(self.vehicle)
        kernel_vehicle = vehicle.params()
        filters, bank = self.filters, self.heading.params()
        surface, steers = self.steering(vehicle.steers_by), NoSteering()
        if surface:
            bank = bank._replace(limit=0.0)  # it is held level
            steers = usable('control.steering: params', surface.params, vehicle)
        return ControlParams(
            allocation=make_allocation(kernel_vehicle),
            polar=make_polar(kernel_vehicle),
            law=usable('control.law: params', self.chosen.params, vehicle, bank),
            steering=steers,
            buoyancy_ki=self.buoyancy.ki_kg_per_m,
            drag_ki=self.buoyancy.drag_ki_kg_per_m,
            buoyancy_trim_max=self.buoyancy.trim_limit_kg,
            attitude_s=filters.attitude_s,
            dead_band=Joints(
                filters.buoyancy_dead_band_kg,
                filters.pitch_dead_band_m,
                math.radians(filters.roll_dead_band_deg),
                math.radians(surface.dead_band_deg) if surface else 0.0,
            ),
            safe_command=Joints(-kernel_vehicle.m_b_max, -kernel_vehicle.x_p_max, 0.0, 0.0),
            intake=IntakeParams(self.gate.params(), ranges(kernel_vehicle)),
        )

    def initial_state(self) -> 'ControlState':
        """State before the first tick."""
        surface, steers = self.steering(load_vehicle(self.vehicle).steers_by), NoSteering()
        if surface:
            steers = usable('control.steering: initial_state', surface.initial_state)
        return ControlState(
            tick=0,
            measured=STILL,
            law=usable('control.law: initial_state', self.chosen.initial_state),
            steering=steers,
        )


def check_law(name: str, law: type) -> None:
    """Refuse a law that this program alone brings, if it cannot be called by this name.

    Raises ConfigurationError.
    """
    try:
        plugins.refuse_unusable(name, law, LawSettings, {*TAKEN, *LAWS, *SURFACE_LAWS})
    except (TypeError, ValueError) as error:
        raise ConfigurationError(f'law {name}: {error}; docs/your_law.md has one') from None


def with_law(
    name: str, law: type[LawSettings]
) -> tuple[type[ControlLawSettings], type[ControlSettings]]:
    """Kinds of settings that know one law more than are registered."""
    more = {
        'law': (Literal[(*LAWS, name)], ControlLawSettings.model_fields['law']),
        name: (law, Field(law(), description=plugins.summary(law))),
    }
    return tuple(
        pydantic.create_model(base.__name__, __base__=base, **more)
        for base in (ControlLawSettings, ControlSettings)
    )
