# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Vehicles: a validated YAML file, every number with unit and source, to kernel parameters."""

import json
import math
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any, NamedTuple, get_args

import numpy as np
import pydantic
from pydantic import Field

from glider_base import plugins
from glider_base.errors import changes_text
from glider_base.files import read_bytes, read_yaml, yaml_line, yaml_text
from glider_base.settings import (
    Settings,
    file_names,
    find_field,
    find_file,
    holder_of,
    matching,
    validate,
)
from glider_base.signals import Joints
from glider_base.slot import usable
from glider_base.wiring import JOINTS
from glider_model.vehicle import surfaces
from glider_model.vehicle.actuators import ActuatorErrors
from glider_model.vehicle.energy import EnergySettings
from glider_model.vehicle.quantity import LITRE, optional
from glider_model.vehicle.rigid_body import mass_matrix
from glider_model.vehicle.sections import (
    AddedMassSettings,
    BuoyancyEngineSettings,
    HullSettings,
    HydrodynamicsSettings,
    MovingMassSettings,
    RigidBodySettings,
    SteeringSettings,
)
from glider_model.vehicle.steering import SteeringRates, steering_rates
from glider_model.vehicle.surface import NoSurface, SurfaceSettings

VEHICLE_FOLDER = Path(__file__).parent / 'vehicles'
#: Shallowest pitch at which a glide polar is used, if the file says nothing (deg).
SHALLOWEST_GLIDE_DEG = 12.0
#: Vertical rate of the slowest glide, if the file says nothing (m/s).
SLOWEST_GLIDE_MPS = 0.12
#: Share of what lies between rated and crush depth that is its drop margin, if the file says none.
DROP_MARGIN_SHARE = 0.2
#: Share of its rate that a pump keeps at the rated depth at least (-).
LEAST_PUMP_SHARE = 0.05
#: Density of the lightest and the heaviest water that there is (kg/m^3).
WATER = (950.0, 1100.0)
#: Source of a number that a person changed for a run.
_SET = '--set'


class _Body(Settings):
    """What every vehicle file says."""

    name: Annotated[
        str,
        Field(
            pattern=matching(r'^[a-z0-9_]+$', 'small letters, digits and _'),
            description='its name',
        ),
    ]
    description: Annotated[str, Field(description='what it is, in a line')]
    rigid_body: RigidBodySettings
    moving_mass: MovingMassSettings
    buoyancy_engine: BuoyancyEngineSettings
    hull: HullSettings
    # Recordings made before there was this field lack it.
    rated_depth: optional(
        'm',
        'deepest that the hull is meant to go; without it the vehicle does not fly',
        gt=0.0,
        le=12000.0,
    )
    crush_depth: optional('m', 'deeper than this the hull may give way', gt=0.0, le=15000.0)
    drop_weight: optional('kg', 'weight in water of what is let go in need', gt=0.0, le=100.0)
    drop_margin: optional(
        'm',
        'it is let go where the vehicle would come as near as this to its crush depth; a fifth of '
        'what lies between that and its rating without',
        gt=0.0,
        le=5000.0,
    )
    volume: optional(
        'm^3',
        'at the surface, at the reference temperature, with the pump at 0; without it the vehicle '
        'is neutral at the surface of any water',
        also=LITRE,
        gt=0.0,
        le=10.0,
    )
    compressibility: optional('1/Pa', 'share of the volume lost by a pascal', ge=0.0, le=1e-8)
    thermal_expansion: optional('1/K', 'share of the volume gained by a degree', ge=0.0, le=1e-3)
    reference_temperature: optional(
        'degC', 'temperature at which it has its volume', ge=-5.0, le=50.0
    )
    shallowest_glide: optional(
        'deg',
        'shallowest pitch that it glides at, about that of its best glide; 12 without',
        ge=5.0,
        le=30.0,
    )
    slowest_glide: optional(
        'm/s',
        'vertical rate below which it turns over and is not steered by roll; 0.12 without',
        gt=0.0,
        le=0.12,
    )
    pump_x: optional(
        'm', 'where the oil acts, + forward of the centre of buoyancy; 0 without', ge=-5.0, le=5.0
    )
    added_mass: AddedMassSettings
    hydrodynamics: HydrodynamicsSettings
    steering: SteeringSettings | None = None
    energy: EnergySettings | None = None


#: Settings of every kind of steering surface, by its name and that of its section.
SURFACES = plugins.classes(
    plugins.SURFACES, SurfaceSettings, surfaces, {*_Body.model_fields, *JOINTS}, complete=False
)
_Steered = pydantic.create_model(
    '_Steered',
    __base__=_Body,
    **{
        name: (kind | None, Field(None, description=plugins.summary(kind)))
        for name, kind in SURFACES.items()
    },
)


class Vehicle(_Steered):
    """A vehicle file."""

    model_config = pydantic.ConfigDict(
        json_schema_extra={'others': plugins.others(plugins.SURFACES)}
    )

    @pydantic.model_validator(mode='after')
    def _could_be_built(self):
        there = [name for name in SURFACES if getattr(self, name) is not None]
        if len(there) > 1:
            raise ValueError(f'{", ".join(there)}: a vehicle has one of them at most')
        if self.rated_depth:
            rated_m, fall = self.rated_depth_m, _value(self.buoyancy_engine.rate_per_m)
            if self.crush_depth_m <= rated_m:
                raise ValueError(
                    f'crush_depth: {self.crush_depth_m:g} m (allowed: > {rated_m:g} m, its '
                    'rated_depth)'
                )
            if fall * rated_m > 1.0 - LEAST_PUMP_SHARE:
                most = (1.0 - LEAST_PUMP_SHARE) / rated_m
                raise ValueError(
                    f'buoyancy_engine.rate_per_m: {fall:g} 1/m '
                    f'(allowed: <= {most:.3g} 1/m, which leaves 5 % of the rate at its '
                    'rated_depth)'
                )
        for name in ('compressibility', 'thermal_expansion'):
            if _value(getattr(self, name)) and not self.volume:
                raise ValueError(f'{name}: of no volume (allowed: beside volume)')
        x = self.params()
        if self.volume:
            neutral = x.m / self.volume.value
            if not WATER[0] <= neutral <= WATER[1]:
                raise ValueError(
                    f'rigid_body, moving_mass, volume: neutral in water of {neutral:.4g} kg/m^3 '
                    f'(allowed: {WATER[0]:g} to {WATER[1]:g} kg/m^3)'
                )
        low = (x.s_z + x.m_p * x.R_p) / x.m
        if low <= 0.0:
            raise ValueError(
                f'rigid_body, moving_mass: top-heavy, its centre of mass is at z = {low:.3g} m '
                '(allowed: > 0 m, below the centre of buoyancy)'
            )
        if fault := mass_fault(x):
            raise ValueError(f'rigid_body, moving_mass, added_mass: {fault}')
        return self

    def changed(self) -> dict[str, Any]:
        """Numbers that were changed by ``--set`` since there was a file, by dotted field name."""
        whole = dict(self)
        for name, group in list(whole.items()):
            if isinstance(group, Settings):
                whole |= {f'{name}.{key}': value for key, value in group}
        return {
            name: field.value
            for name, field in whole.items()
            if getattr(field, 'source', '').startswith(_SET)
        }

    @property
    def steers_by(self) -> str:
        """Name of its steering surface, and of that joint; empty if it banks to turn."""
        return next((name for name in SURFACES if getattr(self, name) is not None), '')

    @property
    def steering_rates(self) -> SteeringRates:
        """How roll turns it: as its file says, or as follows from its coefficients."""
        if self.steering is None:
            return steering_rates(self.params())
        return SteeringRates(self.steering.dive.value, self.steering.climb.value)

    @property
    def rated_depth_m(self) -> float:
        """Deepest that the hull is meant to go (m); infinite if its file does not say."""
        return self.rated_depth.value if self.rated_depth else math.inf

    def slowest_pump_rate(self, depth_m: float) -> float:
        """Rate (kg/s) of the pump at a depth (m), which is rated for, while it pumps out."""
        fall, rated_m = _value(self.buoyancy_engine.rate_per_m), self.rated_depth_m
        share = 1.0 - fall * min(depth_m, rated_m) if fall > 0.0 else 1.0
        return self.buoyancy_engine.rate.value * share

    @property
    def crush_depth_m(self) -> float:
        """Depth at which the hull may give way (m); infinite if its file does not say."""
        return self.crush_depth.value if self.crush_depth else math.inf

    @property
    def drop_margin_m(self) -> float:
        """How near to its crush depth its weight is let go (m)."""
        if self.drop_margin:
            return self.drop_margin.value
        if self.crush_depth and self.rated_depth:
            return DROP_MARGIN_SHARE * (self.crush_depth.value - self.rated_depth.value)
        return 0.0

    def params(self) -> 'VehicleParams':
        """Kernel parameters, SI and radians."""
        body, mass, added = self.rigid_body, self.moving_mass, self.added_mass
        hydro, pump = self.hydrodynamics, self.buoyancy_engine
        coefficients = 'K_D0 K_D K_L0 K_L K_beta K_MR K_p K_M0 K_M K_q K_MY K_r'.split()
        lacking = 'volume compressibility thermal_expansion reference_temperature'.split()
        lacking += ['pump_x', 'drop_weight']
        surface = getattr(self, self.steers_by) if self.steers_by else None
        return VehicleParams(
            m=body.hull_mass.value + mass.mass.value,
            **_named(
                's_x s_y s_z', body.hull_mass.value * np.array(body.hull_center_of_mass.value)
            ),
            **_named('i_xx i_yy i_zz', body.hull_inertia.value),
            m_p=mass.mass.value,
            x_p0=mass.neutral_x.value,
            R_p=mass.radius.value,
            **_named('i_px i_py i_pz', mass.inertia.value),
            **_named('a_11 a_22 a_33 a_44 a_55 a_66', added.linear.value + added.angular.value),
            a_26=added.sway_yaw.value,
            a_35=added.heave_pitch.value,
            **{name: getattr(hydro, name).value for name in coefficients},
            speed_exponent=_value(hydro.speed_exponent),
            **_named('D_u D_v D_w', hydro.linear_damping.value),
            **_named('D_p D_q D_r', hydro.linear_angular_damping.value),
            **_named('D_uu D_vv D_ww', hydro.quadratic_damping.value),
            **_named('D_pp D_qq D_rr', hydro.quadratic_angular_damping.value),
            hull_radius=0.5 * self.hull.diameter.value,
            m_b_max=pump.range.value,
            m_b_rate=pump.rate.value,
            x_p_max=mass.travel.value,
            x_p_rate=mass.rate.value,
            mu_max=math.radians(mass.rotation.value),
            mu_rate=math.radians(mass.rotation_rate.value),
            ballast=0.0,
            **{name: _value(getattr(self, name)) for name in lacking},
            shallowest_glide=math.radians(
                self.shallowest_glide.value if self.shallowest_glide else SHALLOWEST_GLIDE_DEG
            ),
            slowest_glide=self.slowest_glide.value if self.slowest_glide else SLOWEST_GLIDE_MPS,
            surface=usable(f'{self.steers_by}: params', surface.params)
            if surface
            else NoSurface(),
            delta_max=math.radians(surface.range.value) if surface else 0.0,
            delta_rate=math.radians(surface.rate.value) if surface else 0.0,
            errors=self._errors(surface),
        )

    def _errors(self, surface: SurfaceSettings | None) -> ActuatorErrors:
        """How its actuators err."""
        pump, mass = self.buoyancy_engine, self.moving_mass

        def joints(name: str) -> Joints:
            return Joints(
                _value(getattr(pump, name)),
                _value(getattr(mass, name)),
                math.radians(_value(getattr(mass, f'rotation_{name}'))),
                math.radians(_value(getattr(surface, name))) if surface else 0.0,
            )

        return ActuatorErrors(joints('dead_band'), joints('noise'), _value(pump.rate_per_m))


def _named(names: str, numbers) -> dict[str, float]:
    """Numbers by their names."""
    return dict(zip(names.split(), map(float, numbers), strict=True))


def _value(number) -> float:
    """Number of a field that a file may lack: 0 without."""
    return number.value if number else 0.0


class VehicleParams(NamedTuple):
    """A vehicle as the kernels see it: SI, radians, FRD, origin at the centre of buoyancy."""

    m: float  #: total mass (kg)
    s_x: float  #: first moment of the hull without moving mass (kg m)
    s_y: float
    s_z: float
    i_xx: float  #: inertia of the hull without moving mass about the origin (kg m^2)
    i_yy: float
    i_zz: float
    m_p: float  #: moving mass (kg), its neutral x (m), radius (m), own inertia (kg m^2)
    x_p0: float
    R_p: float
    i_px: float
    i_py: float
    i_pz: float
    a_11: float  #: added mass (kg), inertia (kg m^2) and cross terms (kg m)
    a_22: float
    a_33: float
    a_44: float
    a_55: float
    a_66: float
    a_26: float
    a_35: float
    K_D0: float  #: viscous coefficients, see HydrodynamicsSettings
    K_D: float
    K_L0: float
    K_L: float
    K_beta: float
    K_MR: float
    K_p: float
    K_M0: float
    K_M: float
    K_q: float
    K_MY: float
    K_r: float
    speed_exponent: float  #: K_D0 goes with this power of the speed over 1 m/s
    D_u: float  #: linear damping (kg/s, kg m^2/s)
    D_v: float
    D_w: float
    D_p: float
    D_q: float
    D_r: float
    D_uu: float  #: quadratic damping (kg/m, kg m^2)
    D_vv: float
    D_ww: float
    D_pp: float
    D_qq: float
    D_rr: float
    hull_radius: float  #: (m)
    m_b_max: float  #: actuator ranges (kg, m, rad) and rates (per s)
    m_b_rate: float
    x_p_max: float
    x_p_rate: float
    mu_max: float
    mu_rate: float
    ballast: float  #: net heaviness beside that of the buoyancy engine (kg, + sinks)
    volume: float  #: of the hull at the surface (m^3); 0: it is neutral there
    compressibility: float  #: of the hull (1/Pa)
    thermal_expansion: float  #: of the hull (1/K), from the reference temperature (degC)
    reference_temperature: float
    shallowest_glide: float  #: at shallower pitch its glide polar is not used (rad)
    slowest_glide: float  #: at a smaller vertical rate it turns over (m/s)
    pump_x: float  #: where the buoyancy engine is (m, + forward)
    drop_weight: float  #: weight in water of what can be let go (kg); 0: nothing
    surface: NamedTuple  #: of its steering surface, by its kind
    delta_max: float  #: range (rad) and rate (rad/s) of the steering surface; 0 without
    delta_rate: float
    errors: ActuatorErrors


def mass_fault(vehicle: VehicleParams) -> str:
    """What is wrong with the mass matrix of a vehicle; empty if nothing is."""
    for x_p in (-vehicle.x_p_max, 0.0, vehicle.x_p_max):
        for share in (-1.0, -0.5, 0.0, 0.5, 1.0):
            mu = share * vehicle.mu_max
            smallest = float(np.linalg.eigvalsh(mass_matrix(x_p, mu, vehicle))[0])
            if not smallest > 0.0:
                return (
                    f'the mass matrix is not positive definite at pitch_mass = {x_p:g} m, '
                    f'roll_mass = {mu:.3g} rad, its smallest eigenvalue is {smallest:.3g} '
                    f'(allowed: > 0)'
                )
    return ''


def vehicle_names() -> list[str]:
    """Names of the vehicles that come with the package."""
    return [*file_names(VEHICLE_FOLDER)]


def changed_vehicle(name: str, changes: dict[str, Any]) -> str:
    """Name of a vehicle, by name or path, of which some fields differ from its file.

    Values are by dotted name of the field; that of a quantity is its number, in its unit.
    `load_vehicle` takes it like any other, in every process that is handed it. No person can
    type it, and no path looks like it: a NUL stands in it.
    """
    return f'{name}\0{json.dumps(changes)}' if changes else name


def vehicle_parts(name: str) -> tuple[str, dict[str, Any]]:
    """What `changed_vehicle` was given."""
    name, _, changes = name.partition('\0')
    return name, json.loads(changes or '{}')


def vehicle_path(name: str) -> Path:
    """File of a vehicle given by name, or by path; a ConfigurationError if there is none."""
    return find_file('vehicle', vehicle_parts(name)[0], VEHICLE_FOLDER)


def vehicle_file(name: str) -> bytes:
    """Content of a file that loads to a vehicle: its own or, if fields are changed, a new one."""
    path, (_, changes) = vehicle_path(name), vehicle_parts(name)
    if not changes:
        return read_bytes(path)
    return yaml_text(_changed_values(read_yaml(path), changes)).encode()


def load_vehicle(name: str) -> Vehicle:
    """Load and validate a vehicle by name or path.

    A ConfigurationError names file, field, value and allowed range.
    """
    path = vehicle_path(name)
    status = path.stat()
    return _read_vehicle(path, name, status.st_mtime_ns, status.st_size)


def steers_by(settings: Settings) -> str:
    """Name of the steering surface of the vehicle that settings name; empty without."""
    return load_vehicle(settings.vehicle).steers_by


@lru_cache(maxsize=16)
def _read_vehicle(path: Path, name: str, mtime_ns: int, size: int) -> Vehicle:
    """Vehicle of a file in this version: every block of a mission asks for it."""
    _, changes = vehicle_parts(name)

    def line_of(location: tuple[str, ...]) -> int | None:
        where = '.'.join(location)
        here = any(f'{where}.'.startswith(f'{field}.') for field in changes)
        return None if here else yaml_line(path, location)

    changed = changes_text({f'vehicle.{field}': value for field, value in changes.items()})
    values = _changed_values(read_yaml(path), changes)
    return validate(Vehicle, values, str(path), line_of=line_of, changed=changed)


def _changed_values(values: dict[str, Any], changes: dict[str, Any]) -> dict[str, Any]:
    """Values of a vehicle file with some of its fields changed, which say so as their source.

    A whole is changed before its parts, in whatever order they are given.
    """
    whole = {'vehicle': values}
    numbers = {field.removesuffix('.value'): value for field, value in changes.items()}
    for field, value in sorted(numbers.items(), key=lambda change: change[0].count('.')):
        name = f'vehicle.{field}'
        holder, last = holder_of(whole, name), name.rpartition('.')[2]
        unit = find_field(Vehicle, f'{field}.unit')
        if unit is not None and not isinstance(value, dict):  # a quantity, given by its number
            old = holder.get(last)
            if not isinstance(old, dict):  # its file does not have it
                old = {'unit': next(iter(get_args(unit.annotation)), None)}
            source = f'{_SET}, instead of {old["value"]}' if 'value' in old else _SET
            value = {**old, 'value': value, 'source': source}
        holder[last] = value
    return values
