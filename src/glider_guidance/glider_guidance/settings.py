# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Settings of guidance, and the kernels' params by them."""

import math
import zlib
from typing import Literal

import pydantic
from pydantic import Field

from glider_base import plugins
from glider_base.settings import TUNABLE, ConfigurationError, Settings, number, positive
from glider_base.slot import usable
from glider_guidance import methods
from glider_guidance.current_observer import ObserverParams
from glider_guidance.guidance import Followed, GuidanceParams, GuidanceState
from glider_guidance.method import LosGains, MethodSettings
from glider_guidance.order import Order
from glider_guidance.path.settings import PathSettings, StraightPath
from glider_guidance.yo.machine import ProfileSettings
from glider_model.onboard.attitude_filter import STILL
from glider_model.onboard.command_filter import FilterParams
from glider_model.onboard.gate import GateSettings
from glider_model.onboard.glide_polar import glide_horizontal_speed, make_polar
from glider_model.onboard.learnt_steering import SteeringLearningSettings
from glider_model.vehicle.file import load_vehicle, vehicle_path

#: Other parameters of guidance: no method can have such a name.
TAKEN = {'los', 'observer', 'filters', 'steering', 'gate', 'vehicle', 'path', 'profile'}
TAKEN |= {'dives', 'duration_s', 'hold', 'orders'}
#: Settings of every guidance method by its name.
METHODS = plugins.classes(plugins.GUIDANCE_METHODS, MethodSettings, methods, TAKEN)
#: What some of them were called before: still understood.
OLD_NAMES = {'observer': 'los_current', 'paper': 'los_zhang2021'}

_MethodChoice = pydantic.create_model(
    '_MethodChoice',
    __base__=Settings,
    method=plugins.choice(METHODS, 'los_current', plugins.GUIDANCE_METHODS),
)
#: Gains of the methods that have some of their own, by the names of the methods.
_MethodGains = pydantic.create_model(
    '_MethodGains', __base__=Settings, **plugins.sections(METHODS)
)


class LosSettings(LosGains, _MethodChoice):
    """Line of sight."""

    @pydantic.field_validator('method', mode='before')
    @classmethod
    def _of_before(cls, value):
        """The name of now."""
        return OLD_NAMES.get(value, value) if isinstance(value, str) else value


class ObserverSettings(Settings):
    """Current observer."""

    k3_per_s: float = positive(0.02, 1.0, 'K3, gain on position (1/s)', tunable=True)
    k4_per_s2: float = positive(1e-4, 0.1, 'K4, gain on the current (1/s^2)', tunable=True)

    @pydantic.model_validator(mode='after')
    def _is_stable(self):
        if self.k4_per_s2 > 5.0 * self.k3_per_s:
            raise ValueError(
                f'k4_per_s2 = {self.k4_per_s2} is unstable in steps of 0.1 s (allowed: at most '
                f'5 k3_per_s = {5.0 * self.k3_per_s:g})'
            )
        return self


class CommandFilterSettings(Settings):
    """Command filters of heading and pitch."""

    heading_frequency_radps: float = positive(
        0.07, 2.0, 'natural frequency of the heading filter (rad/s)'
    )
    heading_rate_radps: float = positive(0.012, 1.0, 'largest rate of the desired heading (rad/s)')
    pitch_frequency_radps: float = positive(
        0.12, 2.0, 'natural frequency of the pitch filter (rad/s)'
    )
    pitch_rate_radps: float = positive(0.03, 1.0, 'largest rate of the desired pitch (rad/s)')


class GuidanceLawSettings(_MethodGains):
    """How to guide, whatever the vehicle and the path: the guidance section of a scenario."""

    los: LosSettings = Field(LosSettings(), description='line of sight')
    observer: ObserverSettings = Field(ObserverSettings(), description='current observer')
    filters: CommandFilterSettings = Field(CommandFilterSettings(), description='command filters')
    steering: SteeringLearningSettings = Field(
        SteeringLearningSettings(), description='what the vehicle can follow, learnt'
    )
    gate: GateSettings = Field(GateSettings(), description='odometry that is refused')
    route: Literal['straight', 'planned'] = Field(
        'straight',
        description='straight legs between waypoints, or a route through the forecast, which the '
        'direct engine gives as orders',
    )
    replan: Literal['never', 'surfacing'] = Field(
        'never',
        description='a planned route is planned anew at surfacings, with what was observed',
    )
    no_progress: Literal['tell', 'skip', 'hold'] = Field(
        'tell',
        description='what follows where the way along the path gets no shorter: a report alone; '
        'the next waypoint is headed for; or the vehicle waits at the surface for orders',
    )
    no_progress_surfacings: int = Field(
        3, ge=0, le=1000, description='so many surfacings in a row are no progress; 0: none are'
    )

    @pydantic.model_validator(mode='after')
    def _leave_it_to_the_pilot(self):
        if self.route == 'planned' and self.no_progress != 'tell':
            raise ValueError(
                f"no_progress = '{self.no_progress}': not with a planned route (allowed: tell)"
            )
        return self

    @pydantic.model_validator(mode='before')
    @classmethod
    def _tell_the_method_alone(cls, values):
        """Leave out the gains of a method that is not there: to tell that it is not is enough."""
        los = values.get('los') if isinstance(values, dict) else None
        method = los.get('method') if isinstance(los, dict) else None
        if not isinstance(method, str) or method in cls.model_fields:
            return values
        return {name: value for name, value in values.items() if name != method}

    @property
    def chosen(self) -> MethodSettings:
        """Gains of the method that was chosen."""
        method = METHODS[self.los.method]
        return getattr(self, self.los.method) if method.model_fields else method()

    @property
    def idle(self) -> set[str]:
        """Methods of other packages that do not fly, with the gains that they have anyway."""
        names = plugins.of_others(METHODS, methods) - {self.los.method}
        return {name for name in names if getattr(self, name, None) == METHODS[name]()}


class GuidanceSettings(GuidanceLawSettings):
    """Everything the guidance node is set to."""

    vehicle: str = Field('zhang2021', description='vehicle whose glide polar and pump are used')
    path: PathSettings = Field(
        StraightPath(kind='straight', length_m=25000.0),
        description='path to follow',
        json_schema_extra=TUNABLE,
    )
    profile: ProfileSettings = Field(ProfileSettings(), description='sawtooth')
    dives: int = number(0, (0, 100000), 'dives before waiting on the surface; 0: no end')
    duration_s: float = number(
        0.0, (0.0, 1e8), 'time at which the mission ends (s), no later turn is led; 0.0: never'
    )
    hold: bool = Field(
        False,
        description='come up, and wait at the surface until it is false',
        json_schema_extra=TUNABLE,
    )
    orders: list[Order] = Field([], description='orders to the vehicle in flight, and when')
    altitude: bool = Field(False, description='an altimeter is fitted; its topic is waited for')

    @property
    def topics(self) -> tuple[str, ...]:
        """Those of the topics that not every run has that it reads."""
        return ('altitude',) if self.altitude or self.profile.clearance_m > 0.0 else ()

    def check(self) -> None:
        """Refuse a depth, a glide or a yo that the vehicle does not have."""
        if self.hold and self.profile.mode == 'path':
            raise ConfigurationError(
                'hold = true: not along a path in three dimensions (allowed: with profile.mode = '
                "'profile')"
            )
        if self.profile.clearance_m and self.profile.mode == 'path':
            raise ConfigurationError(
                f'profile.clearance_m = {self.profile.clearance_m:g}: not along a path in three '
                "dimensions (allowed: 0, or with profile.mode = 'profile')"
            )
        self._check_depth()
        self._check_pitch()
        self._check_profile()

    def _check_depth(self) -> None:
        """Refuse to go deeper than the vehicle is rated for, or with one that has no rating."""
        vehicle = load_vehicle(self.vehicle)
        if vehicle.rated_depth is None:
            raise ConfigurationError(
                f'{vehicle_path(self.vehicle)}: rated_depth: missing (allowed: depth in m that '
                f'the vehicle is rated for, with unit and source)'
            )
        field, deepest = 'profile.depth_m', self.profile.depth_m
        if self.profile.mode == 'path':
            field, deepest = 'deepest point of path', float(self.path.points(500)[:, 2].max())
        if deepest > vehicle.rated_depth_m:
            raise ConfigurationError(
                f'{field} = {deepest:g}: deeper than the vehicle is rated for (allowed: <= '
                f'{vehicle.rated_depth_m:g} m, its rated_depth)'
            )

    def _check_pitch(self) -> None:
        """Refuse a glide that is shallower than the vehicle has it."""
        shallowest = math.degrees(load_vehicle(self.vehicle).params().shallowest_glide)
        for name in ('pitch_deg', 'climb_pitch_deg'):
            pitch = getattr(self.profile, name)
            if pitch is not None and pitch < shallowest - 1e-9:
                raise ConfigurationError(
                    f'profile.{name} = {pitch:g}: shallower than the vehicle glides (allowed: >= '
                    f'{shallowest:g} deg, its shallowest_glide)'
                )

    def _check_profile(self) -> None:
        """Refuse dives that turn no deeper than they begin, and a weight that no pump makes."""
        profile = self.profile
        if profile.mode == 'profile' and profile.top_depth_m >= profile.depth_m:
            raise ConfigurationError(
                f'profile.top_depth_m = {profile.top_depth_m:g}: not above the lower turn '
                f'(allowed: < {profile.depth_m:g} m, profile.depth_m)'
            )
        most = load_vehicle(self.vehicle).params().m_b_max
        for name in ('net_heaviness_kg', 'climb_net_heaviness_kg'):
            weight = getattr(profile, name)
            if weight is not None and weight > most:
                raise ConfigurationError(
                    f'profile.{name} = {weight:g}: more than the pump of the vehicle makes '
                    f'(allowed: <= {most:g} kg, its buoyancy_engine.range)'
                )

    def params(self) -> GuidanceParams:
        """Kernel parameters."""
        vehicle = load_vehicle(self.vehicle)
        kernel_vehicle = vehicle.params()
        polar = make_polar(kernel_vehicle)
        filters = self.filters
        pump_rate = vehicle.slowest_pump_rate(self.profile.depth_m)
        profile = self.profile.params(self.dives, pump_rate, polar, holds=self.hold)
        return GuidanceParams(
            path=self.path.params(),
            path_id=zlib.crc32(self.path.model_dump_json(exclude={'arrival_radius_m'}).encode()),
            profile=profile,
            polar=polar,
            profile_speed=glide_horizontal_speed(profile.pitch, profile.glide_rate, polar),
            method=usable('guidance.los.method: params', self.chosen.params, self.los, vehicle),
            end_s=self.duration_s if self.duration_s > 0.0 else math.inf,
            ends_with_path=self.path.at_end == 'stop',
            arrival_radius=self.path.arrival_radius_m,
            no_progress_surfacings=self.no_progress_surfacings,
            target_gain=self.los.delta1_per_s,
            observer=ObserverParams(self.observer.k3_per_s, self.observer.k4_per_s2),
            heading_filter=FilterParams(
                filters.heading_frequency_radps, filters.heading_rate_radps
            ),
            pitch_filter=FilterParams(filters.pitch_frequency_radps, filters.pitch_rate_radps),
            steering=self.steering.params(kernel_vehicle, 0.0 if vehicle.steers_by else 1.0),
            gate=self.gate.params(),
        )

    def initial_state(self) -> GuidanceState:
        """State before the first tick."""
        followed = Followed(STILL, self.steering.initial_state())
        return GuidanceState(
            usable('guidance.los.method: initial_state', self.chosen.initial_state), followed
        )
