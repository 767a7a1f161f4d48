# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Scenarios: one validated YAML file that says everything about a mission."""

import math
import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from copy import deepcopy
from itertools import accumulate
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import numpy as np
import pydantic
from pydantic import Field

from glider_base.errors import changes_text, shown
from glider_base.files import is_file, read_yaml, yaml_line, yaml_text
from glider_base.frames import OriginSettings, to_geodetic
from glider_base.settings import (
    FILE_NAME,
    ConfigurationError,
    Settings,
    SettingsT,
    beside,
    file_names,
    find_file,
    number,
    validate,
)
from glider_base.slot import usable
from glider_base.wiring import SENSORS
from glider_control.law import LawSettings
from glider_control.settings import LAWS, ControlLawSettings, ControlSettings, check_law, with_law
from glider_guard.settings import GuardLimitSettings, GuardSettings
from glider_guidance.guidance import path_time_s
from glider_guidance.order import Order
from glider_guidance.orders import changed, check_orders
from glider_guidance.path.settings import MAX_DEPTH_M, PathSettings, StraightPath
from glider_guidance.settings import GuidanceLawSettings, GuidanceSettings
from glider_guidance.yo.machine import ProfileSettings
from glider_mission.changes import (
    VEHICLE,
    fields_text,
    given_fields,
    overlap,
    plain,
    set_field,
    split_changes,
)
from glider_mission.chart import charted, in_metres, uncharted
from glider_mission.mafiles import from_folder, with_mafiles
from glider_mission.rules import Rules
from glider_model.ocean.bottom import BathymetrySettings, bottom_depth
from glider_model.ocean.current_settings import CurrentSettings, SumOfCurrents
from glider_model.ocean.field import Mission
from glider_model.ocean.fields.grid import GridFileSettings
from glider_model.ocean.grid_file import time_text
from glider_model.ocean.water import WaterSettings
from glider_model.onboard.gate import GateSettings
from glider_model.plant.faults.settings import FAULTS, Fault, FaultSettings, Message, check_fitted
from glider_model.plant.plant import SURFACE_S, InitialSettings, PlantSettings
from glider_model.plant.sensors import SensorSettings
from glider_model.vehicle.file import (
    changed_vehicle,
    load_vehicle,
    vehicle_names,
    vehicle_parts,
    vehicle_path,
)
from glider_model.vehicle.perturb import PerturbSettings, perturbed
from glider_navigation.settings import NavigationLawSettings, NavigationSettings

SCENARIO_FOLDER = Path(__file__).parent / 'scenarios'
DEFAULT_SCENARIO = 'current_8deg'

#: There is ample time for a dive, or a path, in so many times what its glides take (-).
AMPLE = 1.25
#: A straight way is looked at at so many places, whether it leads over land.
ALONG = 2000
#: The farthest that an estimate may jump at a fix (m).
JUMP_M = 1e8

#: A run of this simulated time or more is a long one, with the longer settling time (s).
LONG_RUN_S = 20000.0
SETTLE_LONG_S, SETTLE_SHORT_S = 7200.0, 1800.0
#: Of a short run this share is left out at most.
SETTLE_SHARE = 0.5


class RouteForecast(Settings):
    """A forecast of the current for who plans the route: a file, or the truth with an error."""

    file: str = Field(
        '',
        max_length=4000,
        description='NetCDF file, beside this one or else in the working folder; without: the '
        'current of the scenario',
    )
    error_mps: float = number(
        0.0,
        (0.0, 1.0),
        'rms of the error of each part of the depth-averaged current (m/s); a file has it, to the '
        'truth one is added',
    )
    error_km: float = number(40.0, (5.0, 1000.0), 'correlation length of the error (km)')
    late_h: float = number(0.0, (0.0, 240.0), 'by what its water comes too late: its age (h)')

    _found = pydantic.field_validator('file')(beside)


class Scenario(Settings):
    """A mission: vehicle, water, path, profile, current, guidance, control, and its end."""

    #: Settings of the control node, as a type: it knows the same laws.
    control_kind: ClassVar[type[ControlSettings]] = ControlSettings

    name: str = Field(
        pattern=FILE_NAME,
        max_length=100,
        description='name, used for files',
    )
    description: str = Field('', max_length=2000, description='what the scenario shows')
    changed: dict[str, str] = Field(
        {}, description='fields that were changed since there was a file, by options and --set'
    )
    vehicle: str = Field(
        'zhang2021', description='vehicle by name, or path of a file relative to this one'
    )
    seed: int = number(0, (0, 2**63 - 1), 'seed of everything random')
    dives: int = number(1, (0, 100000), 'dives of a run without --duration; 0: until duration_s')
    duration_s: float = number(108000.0, (0.1, 1e8), 'simulated time of --duration full (s)')
    settle_s: float | None = number(
        None,
        (0.0, 1e8),
        'time left out of the score (s); by default 7200 in long runs, else 1800, a dive to '
        'depth_m or half of the run, whichever is shortest',
    )
    initial: InitialSettings = Field(InitialSettings(), description='state at the start')
    water: WaterSettings = Field(
        WaterSettings(), description='density of the water, its bottom, and wind'
    )
    bathymetry: BathymetrySettings = Field(
        BathymetrySettings(), description='chart of the bottom, instead of water.bottom_m'
    )
    current: CurrentSettings = Field(CurrentSettings(), description='current')
    sensors: SensorSettings = Field(SensorSettings(), description='errors of the sensors')
    origin: OriginSettings = Field(
        OriginSettings(), description='where the origin of the path lies on the Earth'
    )
    navigation: NavigationLawSettings = Field(
        NavigationLawSettings(), description='where the vehicle estimates it is'
    )
    perturb: PerturbSettings = Field(
        PerturbSettings(), description='what the plant differs in from its vehicle file'
    )
    faults: list[Fault] = FAULTS
    forecast: RouteForecast = Field(
        RouteForecast(), description='what a planned route is planned by'
    )
    path: PathSettings = Field(
        StraightPath(kind='straight', length_m=25000.0), description='path to follow'
    )
    profile: ProfileSettings = Field(
        ProfileSettings(),
        description="sawtooth; mafiles in it names a Slocum's yo10.ma, surfac10.ma or both, in "
        'place of fields, which a scenario makes of them',
    )
    orders: list[Order] = Field([], description='orders to the vehicle in flight, and when')
    guidance: GuidanceLawSettings = Field(GuidanceLawSettings(), description='guidance')
    control: ControlLawSettings = Field(ControlLawSettings(), description='control')
    guard: GuardLimitSettings = Field(
        GuardLimitSettings(), description='when the guard acts, which has the last word'
    )

    @pydantic.model_validator(mode='before')
    @classmethod
    def _charted(cls, values: Any) -> Any:
        return charted(values) if isinstance(values, dict) else values

    @pydantic.field_validator('path', mode='before')
    @classmethod
    def _path_in_metres(cls, path: Any, info: pydantic.ValidationInfo) -> Any:
        return in_metres(path, info.data.get('origin'))

    _profile_of_mafiles = pydantic.field_validator('profile', mode='before')(with_mafiles)

    @pydantic.field_validator('orders', mode='before')
    @classmethod
    def _orders_in_metres(cls, orders: Any, info: pydantic.ValidationInfo) -> Any:
        if not isinstance(orders, list):
            return orders
        origin = info.data.get('origin')
        return [
            {**one, 'path': in_metres(one.get('path'), origin)} if isinstance(one, dict) else one
            for one in orders
        ]

    @pydantic.field_validator('current')
    @classmethod
    def _one_seed(cls, current: CurrentSettings) -> CurrentSettings:
        if 'seed' in current.model_fields_set:
            raise ValueError('seed belongs to the scenario, not to its current')
        return current

    @property
    def described(self) -> str:
        """Its description, and what is not as described."""
        but = f'but with {fields_text(self.changed)}' if self.changed else ''
        return ', '.join(filter(None, (self.description, but)))

    @property
    def unsteered(self) -> list[str]:
        """Which of its glides are too slow to be steered by roll, in words."""
        vehicle, profile = load_vehicle(self.vehicle), self.guidance_settings().params().profile
        slowest, rates = vehicle.params().slowest_glide, (profile.dive_rate, profile.climb_rate)
        slow = {n: r for n, r in zip(('dives', 'climbs'), rates, strict=True) if r < slowest}
        if not slow or vehicle.steers_by or profile.follows_path:
            return []
        return [
            f'{" and ".join(slow)} are not steered by roll, at {min(slow.values()):.3f} m/s of '
            f'vertical rate: it takes {slowest:g} m/s, slowest_glide of the vehicle'
        ]

    @property
    def is_charted(self) -> bool:
        """Whether it says where on the Earth it is: then people read its places in degrees."""
        in_degrees = getattr(self.path, 'waypoints_latlon', None) is not None
        return in_degrees or self.origin != OriginSettings()

    @property
    def vehicle_faults(self) -> list[FaultSettings]:
        """Faults of the vehicle itself."""
        return [fault for fault in self.faults if not isinstance(fault, Message)]

    @property
    def message_faults(self) -> list[Message]:
        """What goes wrong with messages between nodes."""
        return [fault for fault in self.faults if isinstance(fault, Message)]

    def plant_settings(self) -> PlantSettings:
        """Settings of the plant node."""
        chart = self.bathymetry
        return _settings_of(
            PlantSettings,
            self,
            water=self.resolved_water(),
            bathymetry=chart.resolved(self.mission()) if chart.file else chart,
            dives=0 if self._holds else self.dives,
            dive_depth_m=self.shallowest_m,
            afloat_s=self._afloat_s(),
            fitted=[name for name in SENSORS if name in self.topics],
            faults=self.vehicle_faults,
        )

    @property
    def topics(self) -> tuple[str, ...]:
        """Those of the topics that not every run has that there are in a run of this."""
        needed = ('altitude',) if self.profile.clearance_m > 0.0 else ()
        return tuple(dict.fromkeys((*self.navigation.topics, *self.sensors.also_fitted, *needed)))

    @property
    def _holds(self) -> bool:
        """Whether the vehicle is ordered to hold: such a mission ends by its time alone."""
        return any(order.hold for order in self.orders)

    @property
    def shallowest_m(self) -> float:
        """Depth of the shallowest dives that it is ordered to make, over a flat bottom (m)."""
        depths, profile = [one.depth_m for one in self.orders if one.depth_m], self.profile
        if profile.clearance_m and self.water.bottom_m and not self.bathymetry.file:
            depths.append(max(profile.top_depth_m, self.water.bottom_m - profile.clearance_m))
        return min([profile.depth_m, *depths])

    def _afloat_s(self) -> float:
        """Time (s) afloat that ends a run: longer than any wait of its mission; 0: never."""
        paths = [self.path, *(one.path for one in self.orders if one.path)]
        if self._holds or all(path.at_end == 'continue' for path in paths):
            return 0.0
        return SURFACE_S + (self._stay_s() if self.profile.surface_every_dives else 0.0)

    def current_settings(self) -> CurrentSettings:
        """Settings of the current node: directions absolute, the scenario's seed."""
        resolved = self.resolved_current(self.current)
        return resolved.model_copy(update={'seed': self.seed})

    def resolved_current(self, current: SumOfCurrents) -> SumOfCurrents:
        """A current with what it has to know of the mission."""
        return current.resolved(self.path.course_rad(), self.mission() if current.field else None)

    def resolved_water(self) -> WaterSettings:
        """Its water, which knows where and when the mission is."""
        grid = self.water.grid
        if not grid.file:
            return self.water
        return self.water.model_copy(update={'grid': grid.resolved(self.mission())})

    def bottom(self) -> NamedTuple:
        """Kernel parameters of the bottom."""
        return self.plant_settings().bottom()

    def mission(self) -> Mission:
        """Where and when it is flown."""
        origin = self.origin.params()
        corners = self.path.points(0)
        return Mission(
            origin=self.origin,
            places=tuple(to_geodetic(float(n), float(e), origin) for n, e, _ in corners),
            # wherever a fault or an order lets it go
            deepest_m=min(MAX_DEPTH_M, load_vehicle(self.vehicle).rated_depth_m),
            lasts_s=self.duration_s,
        )

    def ways(self, along: bool) -> Iterator[tuple[str, np.ndarray]]:
        """Places that it is led through (m), float64[n, 3], each time with what they are.

        A way that is straight is looked at all ``along``, one that is planned at its corners.
        """
        start = (self.initial.north_m, self.initial.east_m, 0.0)
        paths = [(f'of orders.{i}', one.path) for i, one in enumerate(self.orders) if one.path]
        along = along and self.guidance.route == 'straight' and not paths
        yield 'on the path', np.vstack((start, self.path.points(ALONG if along else 0)))
        for what, path in paths:
            yield what, path.points(0)

    def constant_current(self) -> tuple[float, float]:
        """Constant part of the current, north and east (m/s)."""
        current = self.current_settings()
        if current.speed_mps is None:
            return 0.0, 0.0
        speed, direction = current.speed_mps, math.radians(current.direction_deg)
        return speed * math.cos(direction), speed * math.sin(direction)

    def navigation_settings(self) -> NavigationSettings:
        """Settings of the navigation node."""
        sources = self.navigation, self.initial, self.sensors, self
        given = {
            'forecast': self.resolved_current(self.navigation.forecast),
            'also_fitted': [one for one in self.topics if one not in self.navigation.topics],
        }
        return _settings_of(NavigationSettings, *sources, **given)

    def guidance_settings(self) -> GuidanceSettings:
        """Settings of the guidance node."""
        altitude, gate = 'altitude' in self.topics, self._gate(self.guidance)
        return _settings_of(GuidanceSettings, self.guidance, self, altitude=altitude, gate=gate)

    def _gate(self, law: GuidanceLawSettings | ControlLawSettings | GuardLimitSettings):
        """Gate of a law that gets the estimated place.

        It may jump at a fix as far as it was off: that is no fault, unless somebody said so.
        """
        if not self.navigation.jumps or law.gate.position_jump_m != GateSettings().position_jump_m:
            return law.gate
        return law.gate.model_copy(update={'position_jump_m': JUMP_M})

    def control_settings(self) -> ControlSettings:
        """Settings of the control node."""
        return _settings_of(self.control_kind, self.control, self, gate=self._gate(self.control))

    def guard_settings(self) -> GuardSettings:
        """Settings of the guard node."""
        has = {name: name in self.topics for name in ('pressure', 'altitude')}
        gate = self._gate(self.guard)
        return _settings_of(GuardSettings, self.guard, self.sensors, self, gate=gate, **has)

    def block_settings(self) -> tuple[Settings, ...]:
        """Settings of the node of each block, in the order of `glider_mission.blocks`."""
        return (
            self.plant_settings(),
            self.current_settings(),
            self.navigation_settings(),
            self.guidance_settings(),
            self.control_settings(),
            self.guard_settings(),
        )

    def settle_time_s(self, sim_time_s: float) -> float:
        """Settling time (s) of a run that lasted ``sim_time_s``."""
        if self.settle_s is not None:
            return self.settle_s
        if sim_time_s >= LONG_RUN_S:
            return SETTLE_LONG_S
        return min(SETTLE_SHORT_S, self._glide_s(), SETTLE_SHARE * sim_time_s)

    def score_rules(self, sim_time_s: float) -> Rules:
        """By what a run that lasted ``sim_time_s`` is scored."""
        dive_s = self._dive_s()
        return Rules(
            settle_s=self.settle_time_s(sim_time_s),
            depth_m=self.profile.depth_m,
            glide_s=self._glide_s(),
            navigation=self.navigation.method,
            path=self.path.params(),
            ends=self.path.at_end == 'stop',
            arrival_radius_m=self.path.arrival_radius_m,
            pace_s=max(self._pace_s(settings) for settings in self._in_turn()),
            spare_s=self._held_s() if self.profile.mode == 'path' else dive_s,
            duration_s=self.duration_s,
            origin=self.origin.params() if self.is_charted else None,
            shallowest_m=self.shallowest_m,
            dives=self.dives,
            dive_s=dive_s,
        )

    def _dive_s(self) -> float:
        """Time (s) that is ample for a stay and a dive; infinite where it may wait for good."""
        slowest_s = max(self._glide_s(settings) for settings in self._in_turn())
        return AMPLE * 2.0 * slowest_s + self._stay_s() + self._held_s()

    def _pace_s(self, settings: GuidanceSettings) -> float:
        """Time (s) that is ample for a metre of its path and its stays, in still water.

        That is by what guidance is set to at one time.
        """
        params, every = settings.params(), self.profile.surface_every_dives
        time_s = path_time_s(params, 0.0, 0.0)
        if params.profile.follows_path:  # it takes its time for the way down and up, too
            depths = settings.path.points(ALONG)[:, 2]
            time_s += float(np.sum(np.abs(np.diff(depths)))) / params.profile.glide_rate
        elif every:
            time_s += time_s / (2.0 * every * self._glide_s(settings)) * self._stay_s()
        return AMPLE * time_s / params.path.ways[-1]

    def _in_turn(self) -> list[GuidanceSettings]:
        """Settings of guidance by its mission, and then by each order."""
        orders = sorted(self.orders, key=lambda one: one.tick)
        return list(accumulate(orders, changed, initial=self.guidance_settings()))

    def _held_s(self) -> float:
        """Time (s) from each order to hold to that to resume; infinite if there is none."""
        held_s, since_s = 0.0, math.inf
        for order in sorted(self.orders, key=lambda one: one.tick):
            if order.hold:
                since_s = order.at_s
            elif order.resume:
                held_s, since_s = held_s + order.at_s - since_s, math.inf
        return held_s if math.isinf(since_s) else math.inf

    def _stay_s(self) -> float:
        """Time (s) of the longest surface interval."""
        waits_s = (one.wait_s or 0.0 for one in self.orders)
        return max([self.profile.wait_s, *waits_s]) + self.profile.prepare_s

    def _glide_s(self, settings: GuidanceSettings | None = None) -> float:
        """Time of a glide to the depth of the lower turn (s); infinite along a path in 3-D."""
        if self.profile.mode == 'path':
            return math.inf
        profile = (settings or self.guidance_settings()).params().profile
        return profile.depth / profile.glide_rate

    def with_orders(self, orders: Iterable[Order]) -> 'Scenario':
        """The same with orders that were given in flight: who flies it again plans no more."""
        guidance = self.guidance.model_copy(update={'route': 'straight', 'replan': 'never'})
        given = [*self.orders, *orders]
        return self.model_copy(update={'orders': given, 'guidance': guidance})

    def to_yaml(self, vehicle: str = '') -> str:
        """The scenario as a file that loads to the same scenario.

        It can be loaded where nobody has the laws and methods of others that do not fly in it, if
        it says nothing of them. It may call the ``vehicle`` something else than the scenario does.
        """
        left_out = {
            **({} if self.changed else {'changed': True}),
            'current': {'seed'},
            'navigation': self.navigation.idle,
            'guidance': self.guidance.idle,
            'control': self.control.idle(load_vehicle(self.vehicle).steers_by),
        }
        values = self.model_dump(mode='json', exclude_none=True, exclude=left_out)
        return yaml_text({**values, 'vehicle': vehicle or self.vehicle})


def _settings_of(kind: type[SettingsT], *sources: Settings, **given: Any) -> SettingsT:
    """Settings of a kind: what is set, else what the first of the sources has by that name."""
    for source in sources:
        names = type(source).model_fields.keys() & kind.model_fields.keys() - given.keys()
        given |= {name: getattr(source, name) for name in names}
    return kind(**given)


#: Kinds of scenario that know one law more, which this program brought, by its name.
_WITH_LAW: dict[str, type[Scenario]] = {}


def know_law(law: type[LawSettings]) -> str:
    """Let scenarios of this program fly a law that is not registered; returns its name.

    A later class of the same name takes the place of an earlier one. Raises ConfigurationError if
    it cannot be called by its name, or one of its fields has no default.
    """
    name = law.__name__
    check_law(name, law)
    control, flown = with_law(name, law)
    known = pydantic.create_model(
        'Scenario', __base__=Scenario, control=(control, Field(control(), description='control'))
    )
    known.control_kind, known.__reduce__ = flown, _not_pickled
    _WITH_LAW[name] = known
    return name


def _not_pickled(scenario: Scenario) -> None:
    raise TypeError(
        f'a scenario with law {scenario.control.law}, of this program, is not pickled, nor is its '
        'Run: hand on Run.score or Run.to_xarray()'
    )


def _kind(values: dict[str, Any]) -> type[Scenario]:
    """Type of the scenario of a file: that which knows its law."""
    control = values.get('control')
    law = control.get('law') if isinstance(control, dict) else None
    return _WITH_LAW.get(law, Scenario) if isinstance(law, str) else Scenario


def scenario_names() -> list[str]:
    """Names of the scenarios that come with the package."""
    return [*file_names(SCENARIO_FOLDER)]


def scenario_path(name: str | Path) -> Path:
    """File of a scenario given by name or by path; errors as `find_file`."""
    return find_file('scenario', name, SCENARIO_FOLDER)


class ScenarioSource(NamedTuple):
    """A scenario file as it was read."""

    path: Path
    values: dict[str, Any]


def name_after(path: Path) -> str:
    """Name of what a file holds, if it says none: that of the file, in letters that names have."""
    return re.sub(r'^[.-]|[^\w.-]', '_', path.stem, flags=re.ASCII)[:100]


def read_scenario(name: str | Path = DEFAULT_SCENARIO) -> ScenarioSource:
    """Read the file of a scenario given by name or by path; `make_scenario` validates it.

    Errors are those of `scenario_path` and `read_yaml`.
    """
    path = scenario_path(name)
    values = from_folder(read_yaml(path), path.parent)
    values.setdefault('name', name_after(path))
    return ScenarioSource(path, values)


def make_scenario(
    source: ScenarioSource,
    changes: dict[str, Any] | None = None,
    recorded: bool = False,
    kind: type[Scenario] | None = None,
) -> Scenario:
    """Scenario of a file with some of its fields changed.

    Changes are values by dotted field name, such as ``{'current.speed_kn': 0.5}``; names that
    begin with ``vehicle.`` are fields of the vehicle's file. Of one that is ``recorded`` nobody
    asks any more whether the vehicle is rated for its depth. Its ``kind`` is that of its law, by
    default the last one that this program brought by that name. A ConfigurationError names file,
    field, value and allowed range.
    """
    path, values, changes = (
        source.path,
        deepcopy(source.values),
        plain(given_fields(changes, 'changes')),
    )
    own, in_vehicle = split_changes(changes)
    fields = {field: shown(value) for field, value in changes.items()}
    for field, value in own.items():
        if not set_field(values, field, value, own):
            del fields[field]
    if fields:
        before = values.get('changed')
        values['changed'] = {**(before if isinstance(before, dict) else {}), **fields}
    changed = changes_text(changes)

    def line_of(location: tuple[str, ...]) -> int | None:
        name = '.'.join(location)
        here = any(overlap(field, name) for field in own)
        return None if here else yaml_line(path, location)

    line = line_of((VEHICLE,))
    in_line = f'{path}:{line}{changed}' if line else f'{path}{changed}'
    try:
        scenario = validate(
            kind or _kind(values), values, str(path), path.parent, line_of, changed
        )
    except ConfigurationError as error:
        lines = [str(error)]
        if isinstance(values.get(VEHICLE), str):  # a wrong one is not found out only later
            try:
                _vehicle_called(values[VEHICLE], path.parent, in_line)
            except ConfigurationError as other:
                lines.append(str(other))
        raise ConfigurationError('\n'.join(lines)) from None
    name = changed_vehicle(_vehicle_called(scenario.vehicle, path.parent, in_line), in_vehicle)
    vehicle = load_vehicle(name)
    with named_in(f'{path}{changed}: '):  # good, wherever nodes are started from
        perturbed(vehicle.params(), scenario.perturb)
        scenario.control.steering(vehicle.steers_by)
        gyro, topics = scenario.sensors.gyro, scenario.topics
        check_fitted(scenario.faults, vehicle.steers_by, topics, gyro)
    scenario = scenario.model_copy(update={'vehicle': name})
    if not recorded:
        with named_in(f'{path}{changed}: '):
            _check_glide(scenario)
            return with_known_fields(scenario)
    return scenario


def changed_scenario(
    scenario: Scenario, changes: dict[str, Any], law: type[LawSettings] | None = None
) -> Scenario:
    """A scenario as it was loaded, with some of its fields changed; see `make_scenario`.

    Its law stays the very one that it was, unless another one is named, or is given. Waypoints in
    degrees say anew where its origin is, and where it starts.
    """
    values = scenario.model_dump(mode='json', exclude_none=True, exclude={'current': {'seed'}})
    for part in ('origin', 'initial'):
        values[part] = getattr(scenario, part).model_dump(mode='json', exclude_unset=True)
    path = changes.get('path', values['path'])
    if 'path.waypoints' not in changes and isinstance(path, dict) and 'waypoints_latlon' in path:
        values = uncharted(values)
    values[VEHICLE], in_vehicle = vehicle_parts(scenario.vehicle)
    changes = {f'{VEHICLE}.{name}': value for name, value in in_vehicle.items()} | changes
    own, flown = type(scenario.control.chosen), scenario.control.law
    stays = law in (None, own) and changes.get('control.law', flown) == flown
    kind = type(scenario) if stays and 'control' not in changes else None
    if not stays and flown not in LAWS:  # gains that others do not know
        del values['control'][flown]
    return make_scenario(ScenarioSource(Path(scenario.name), values), changes, kind=kind)


def _check_glide(scenario: Scenario) -> None:
    """Refuse a mission that its vehicle cannot fly, or water that there is not."""
    scenario.guidance_settings().check()
    check_orders(scenario.guidance_settings(), scenario.orders)
    guidance, moved = scenario.guidance, [i for i, one in enumerate(scenario.orders) if one.path]
    if moved and (guidance.route, guidance.replan) == ('planned', 'surfacing'):
        raise ConfigurationError(
            f'orders.{moved[0]}.path: not with a route that is planned anew, which leads back to '
            "the path of the mission (allowed: guidance.replan = 'never')"
        )
    if scenario.forecast.file and not is_file(Path(scenario.forecast.file)):
        raise ConfigurationError(f'forecast.file = {scenario.forecast.file!r}: no such file')
    scenario.water.check_stable()
    PlantSettings(vehicle=scenario.vehicle, initial=scenario.initial).check()


def with_known_fields(scenario: Scenario) -> Scenario:
    """Scenario that says which files its currents are from, once they were read.

    A ConfigurationError tells of a file, or of a path through what is not in it, or over land.
    """
    currents = {'current': scenario.current, 'navigation.forecast': scenario.navigation.forecast}
    starts, is_charted = {}, bool(scenario.bathymetry.file)
    for name, current in currents.items():
        if current.field is None:
            continue
        with named_in(f'{name}.field.', ValueError):
            field = current.field.known()
            resolved = scenario.resolved_current(current).field
            if not isinstance(resolved, GridFileSettings):
                usable('params', resolved.params)
            else:
                resolved.params()
                check_ways(scenario, resolved, name == 'current' and not is_charted)
                starts[f'{name}.field.file'] = resolved.start_s
        currents[name] = current.model_copy(update={'field': field})
    bathymetry, initial = scenario.bathymetry, scenario.initial
    bottom_m = scenario.water.bottom_m or math.inf
    if is_charted:
        with named_in('bathymetry.', ValueError):
            bathymetry = bathymetry.known()
            bottom_m = bottom_depth(initial.north_m, initial.east_m, scenario.bottom())
            check_ways(scenario, bathymetry.resolved(scenario.mission()), True)
    if initial.depth_m > bottom_m:
        raise ConfigurationError(
            f'initial.depth_m = {initial.depth_m:g}: below the bottom '
            f'(allowed: <= {bottom_m:g} m there)'
        )
    water = scenario.water
    if water.grid.file:
        with named_in('water.grid.', ValueError):
            water = water.model_copy(update={'grid': water.grid.known()})
            resolved = scenario.resolved_water()
            resolved.params()
            check_ways(scenario, resolved.grid, not is_charted)
            starts['water.grid.file'] = resolved.grid.start_s
    check_starts(starts)
    forecast = {'forecast': currents['navigation.forecast']}
    navigation = scenario.navigation.model_copy(update=forecast)
    changed = {'current': currents['current'], 'navigation': navigation}
    changed |= {'bathymetry': bathymetry, 'water': water}
    return scenario.model_copy(update=changed)


def check_ways(scenario: Scenario, grid: GridFileSettings, along: bool) -> None:
    """Refuse a mission that leads over land of a file, or beyond what is read of it.

    Its legs are looked at all ``along`` by a chart of the bottom, or where there is none: a grid
    of currents is coarse, and has land for a coast that is some kilometres away.
    """
    origin = scenario.origin.params()
    for what, places in scenario.ways(along):
        grid.check_places((to_geodetic(float(n), float(e), origin) for n, e, _ in places), what)


def check_starts(starts: dict[str, float | None]) -> None:
    """Refuse files that a mission without a time would meet at different times (s since 1970)."""
    found = {name: start_s for name, start_s in starts.items() if start_s is not None}
    if len(set(found.values())) > 1:
        begin = ', '.join(f'{name} at {time_text(start_s)}' for name, start_s in found.items())
        raise ConfigurationError(
            f'origin.time: missing, and files begin at different times: {begin} (allowed: the '
            'start of the mission, within the times of all of them)'
        )


def load_scenario(
    name: str | Path = DEFAULT_SCENARIO,
    changes: dict[str, Any] | None = None,
    recorded: bool = False,
) -> Scenario:
    """Scenario by name or path, with some of its fields changed; see `make_scenario`."""
    return make_scenario(read_scenario(name), changes, recorded)


@contextmanager
def named_in(what: str, kind: type[ValueError] = ConfigurationError) -> Iterator[None]:
    """Begin the errors of a kind that the block raises with what they are of."""
    try:
        yield
    except kind as error:
        raise ConfigurationError(f'{what}{error}') from None


def _vehicle_called(name: str, folder: Path, source: str) -> str:
    """Name of a vehicle that comes with the package, or full path of another one's file."""
    if name in vehicle_names():
        return name
    beside = folder / name
    if beside.suffix and is_file(beside):
        name = str(beside.resolve())
    with named_in(f'{source}: '):
        return str(vehicle_path(name).resolve())
