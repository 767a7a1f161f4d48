# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The plant: the vehicle in the water, from its start tick by tick to the end of a run."""

import math
from typing import Literal, NamedTuple

from pydantic import Field

from glider_base.errors import ConfigurationError
from glider_base.frames import OriginSettings, quaternion_from_euler, rotate_to_body
from glider_base.kernel import kernel, replace
from glider_base.settings import Settings, number
from glider_base.signals import TICK_S, Joints, Odometry, Vector, Water, dive_m, not_finite
from glider_base.slot import only_for
from glider_base.wiring import SENSORS
from glider_model.ocean.bottom import NO_BOTTOM, BathymetrySettings, aground, bottom_depth
from glider_model.ocean.water import WaterSettings, around, with_wind
from glider_model.plant.energy import FULL, Ledger, battery_of, spend
from glider_model.plant.faults.body import acting, blown, felt, moved
from glider_model.plant.faults.kinds import FaultParams, NoFaultState, begun, summed
from glider_model.plant.faults.sensing import remembered, with_faults
from glider_model.plant.faults.settings import FAULTS, Fault, fault_params, fault_state
from glider_model.plant.motion import Motion, integrate
from glider_model.plant.sensors import (
    ANTENNA_M,
    NO_SAMPLE,
    Readings,
    Sample,
    SensorParams,
    SensorSettings,
    add_noise,
    health_of,
    make_readings,
    read,
    sense,
    take_sample,
)
from glider_model.vehicle.energy import NO_ENERGY, EnergyParams
from glider_model.vehicle.file import VehicleParams, load_vehicle
from glider_model.vehicle.perturb import PerturbSettings, perturbed

#: A tick is one step; a step with a larger error is taken again as two, and so on (J). In all
#: shipped scenarios it stays below 1e-7.
LARGEST_ERROR_J = 1e-6
#: Steps in a tick at most.
MOST_STEPS = 256
#: Time at the surface after the last dive (s).
SURFACE_S = 60.0
#: Shallower than this the vehicle is at the surface (m).
SURFACE_M = 1.5
#: No sea is deeper (m).
DEEPEST_SEA_M = 12000.0
#: A vehicle that has been below this has dived, not only bobbed (m).
DIVED_M = 3.0


class Surfacing(NamedTuple):
    """What a receiver for satellites has of the surface."""

    count: int  #: surfacings so far, each after a dive
    is_under: bool  #: has dived since
    out_ticks: int  #: ticks with the antenna out of the water without a break
    silent_ticks: int  #: ticks since it was last out of the water, or since the start


LAUNCHED = Surfacing(0, False, 0, 0)


class Dives(NamedTuple):
    """The dives of a vehicle."""

    count: int  #: each from where it turned up
    is_down: bool  #: has come down by `dive_m`, and not up again since
    turn: float  #: deepest since then, or shallowest since it came up (m)


NO_DIVES = Dives(0, False, math.inf)


class PlantState(NamedTuple):
    """State of the plant at a tick."""

    motion: Motion
    joints: Joints
    water: Water = Water(
        0.0, 0.0, 0.0
    )  #: water velocity during the tick that led here, with the drift of wind
    tick: int = 0
    dives: Dives = NO_DIVES
    surface_ticks: int = 0  #: ticks at the surface without a break
    afloat_ticks: int = -1  #: since the pump was filled last; -1: has not dived yet
    sample: Sample = NO_SAMPLE  #: what the sensors showed at the tick before
    surfacing: Surfacing = LAUNCHED
    faults: NamedTuple = NoFaultState()  #: NoFaultState, or FaultState
    is_dropped: bool = False  #: the drop weight is gone
    ledger: Ledger = FULL  #: energy taken out of the battery


class PlantParams(NamedTuple):
    """Vehicle, water, where the run ends, and the noise of what is measured."""

    vehicle: VehicleParams
    density: NamedTuple  #: DensityParams, CastParams or ModelWaterParams
    wind_drift: Vector  #: at the surface (m/s)
    max_ticks: int
    stop_after_dives: int  #: 0: only max_ticks ends the run
    stop_surface_ticks: int
    stop_afloat_ticks: int  #: 0: never
    dive: float  #: a dive leads so far down and up again (m)
    sensors: SensorParams
    faults: NamedTuple  #: NoFaults, or FaultParams
    energy: EnergyParams
    readings: Readings  #: noise of where the actuators say that they are
    bottom: NamedTuple = NO_BOTTOM  #: flat, or by a chart


@kernel
def dives_after(dives: Dives, depth: float, dive: float) -> Dives:
    """What there is of the dives a tick later, at a depth (m); ``dive`` is `dive_m`."""
    if dives.turn == math.inf:  # it may begin in a dive
        return Dives(dives.count, depth > dive, depth)
    turn = max(dives.turn, depth) if dives.is_down else min(dives.turn, depth)
    if abs(depth - turn) <= dive:
        return Dives(dives.count, dives.is_down, turn)
    return Dives(dives.count + dives.is_down, not dives.is_down, depth)


class InitialSettings(Settings):
    """State at the start of a run."""

    north_m: float = number(0.0, (-1e7, 1e7), 'start position, north (m)')
    east_m: float = number(0.0, (-1e7, 1e7), 'start position, east (m)')
    depth_m: float = number(0.1, (0.0, 12000.0), 'start depth (m)')
    heading_deg: float = number(0.0, (-360.0, 360.0), 'start heading (deg)')
    pitch_deg: float = number(0.0, (-80.0, 80.0), 'start pitch (deg, + nose up)')
    speed_mps: float = number(0.0, (0.0, 3.0), 'start speed through water (m/s)')
    net_heaviness_kg: float = number(0.0, (-50.0, 50.0), 'start net buoyancy (kg, + sinks)')


class PlantSettings(Settings):
    """Everything the plant node is set to."""

    vehicle: str = Field('zhang2021', description='vehicle by name, or path of its YAML file')
    water: WaterSettings = Field(
        WaterSettings(), description='density of the water, its bottom, and wind'
    )
    bathymetry: BathymetrySettings = Field(
        BathymetrySettings(), description='chart of the bottom, instead of a flat one'
    )
    initial: InitialSettings = Field(InitialSettings(), description='state at the start')
    duration_s: float = number(108000.0, (0.1, 1e8), 'the run ends after this simulated time (s)')
    dives: int = number(0, (0, 100000), 'the run ends at the surface after this many; 0: never')
    surface_s: float = number(
        SURFACE_S, (0.0, 86400.0), 'time at the surface after the last dive (s)'
    )
    dive_depth_m: float = number(
        1000.0, (1.0, 12000.0), 'depth of the dives, by which they are counted (m)'
    )
    afloat_s: float = number(
        0.0,
        (0.0, 1e6),
        'the run ends once the vehicle, having dived, has been at the surface so long since it '
        'filled its pump (s); 0.0: never',
    )
    seed: int = number(0, (0, 2**63 - 1), 'seed of the noise')
    sensors: SensorSettings = Field(SensorSettings(), description='errors of the sensors')
    fitted: list[Literal[SENSORS]] = Field(
        ['measured_odom'], description='topics of the sensors that the vehicle has'
    )
    origin: OriginSettings = Field(
        OriginSettings(), description='where the origin of map lies on the Earth'
    )
    perturb: PerturbSettings = Field(
        PerturbSettings(), description='what this vehicle differs in from its file'
    )
    faults: list[Fault] = FAULTS

    def check(self) -> None:
        """Refuse a start that is not one of the vehicle."""
        vehicle = load_vehicle(self.vehicle)
        if self.initial.depth_m > vehicle.rated_depth_m:
            raise ConfigurationError(
                f'initial.depth_m = {self.initial.depth_m:g}: deeper than the vehicle is rated '
                f'for (allowed: <= {vehicle.rated_depth_m:g} m, its rated_depth)'
            )
        most = vehicle.params().m_b_max
        if abs(weight := self.initial.net_heaviness_kg) > most:
            raise ConfigurationError(
                f'initial.net_heaviness_kg = {weight:g}: more than the pump of the vehicle makes '
                f'(allowed: {-most:g} to {most:g} kg, its buoyancy_engine.range)'
            )

    @property
    def topics(self) -> tuple[str, ...]:
        """Topics of the sensors that are fitted."""
        return tuple(self.fitted)

    def params(self) -> PlantParams:
        """Kernel parameters."""
        vehicle = load_vehicle(self.vehicle)
        real = perturbed(vehicle.params(), self.perturb)
        return PlantParams(
            vehicle=real,
            density=self.water.params(),
            wind_drift=self.water.wind_drift(),
            max_ticks=max(1, round(self.duration_s / TICK_S)),
            stop_surface_ticks=round(self.surface_s / TICK_S),
            **self.ends(),
            sensors=self.sensors.params(self.seed, self.origin, tuple(self.fitted)),
            faults=fault_params(self.faults, self.seed),
            energy=vehicle.energy.params() if vehicle.energy else NO_ENERGY,
            readings=make_readings(real, self.seed),
            bottom=self.bottom(),
        )

    def ends(self) -> dict[str, int | float]:
        """Kernel parameters, by name, of what an order in flight changes: when the run ends."""
        return {
            'stop_after_dives': self.dives,
            'stop_afloat_ticks': round(self.afloat_s / TICK_S),
            'dive': dive_m(self.dive_depth_m),
        }

    def bottom(self) -> NamedTuple:
        """Kernel parameters of the bottom: on a chart, flat, or none."""
        return self.bathymetry.params() if self.bathymetry.file else self.water.bottom()

    def initial_state(self) -> PlantState:
        """State at tick 0."""
        start = self.initial
        q = quaternion_from_euler(
            0.0, math.radians(start.pitch_deg), math.radians(start.heading_deg)
        )
        motion = Motion(
            start.north_m, start.east_m, start.depth_m, *q, start.speed_mps, *(5 * (0.0,))
        )
        joints = Joints(start.net_heaviness_kg, 0.0, 0.0, 0.0)
        return PlantState(motion, joints, faults=fault_state(self.faults))


@kernel
def plant_odometry(state):
    """Where the vehicle is and how it moves: what it would measure without error."""
    x, water = state.motion, state.water
    u, v, w = rotate_to_body(x.q_w, x.q_x, x.q_y, x.q_z, water.v_n, water.v_e, water.v_d)
    return Odometry(*replace(x, u=x.u + u, v=x.v + v, w=x.w + w))


@kernel
def _height(motion, params):
    """Height over the bottom (m)."""
    return bottom_depth(motion.p_n, motion.p_e, params.bottom) - motion.p_d


@kernel
def tell(state, params):
    """What the vehicle tells at a tick: numbers of the topics of the plant, as on the wire."""
    numbers = sense(
        plant_odometry(state),
        _height(state.motion, params),
        read(state.joints, state.tick, params.readings),
        state.sample,
        state.surfacing.out_ticks,
        state.surfacing.count,
        state.tick,
        params.sensors,
    )
    health, battery = health_of(state), battery_of(state.ledger, params.energy)
    numbers = (*numbers[:-1], health, battery, numbers[-1])
    return with_faults(numbers, state, params.sensors, params.faults)


@only_for(FaultParams, lambda state, faults, whole, params: faults)
@kernel
def _after_telling(state, faults, whole, params):
    """State of the faults for the next tick; ``whole`` is `PlantParams`."""
    return remembered(faults, tell(state, whole), whole.sensors) if params.repeats else faults


@kernel
def plant_step(
    state: PlantState,
    command: Joints,
    water: Water,
    params: PlantParams,
    dt: float,
    drops: bool = False,
) -> PlantState:
    """Advance the plant by one tick of ``dt`` s.

    ``command`` is where the actuators are to go, ``water`` the velocity of the water at the
    vehicle (NED, m/s), held during the tick. With ``drops`` the drop weight, if there is one, is
    let go.
    """
    faults = begun(state, params.faults)
    total = summed(faults, state.tick, params.faults)
    water = blown(with_wind(water, state.motion.p_d, params.wind_drift), total, params.faults)
    depth, v = state.motion.p_d, params.vehicle
    joints = moved(state.joints, command, depth, v, dt, total, params.faults)
    start = acting(state.joints, params.vehicle, total, params.faults)
    end = acting(joints, params.vehicle, total, params.faults)
    x, t_s = state.motion, state.tick * dt
    body = felt(around(params, x.p_n, x.p_e, t_s, params.density), total, params.faults)
    water_rate = Water(0.0, 0.0, 0.0)
    if state.tick > 0:
        water_rate = Water(
            (water.v_n - state.water.v_n) / dt,
            (water.v_e - state.water.v_e) / dt,
            (water.v_d - state.water.v_d) / dt,
        )
    is_dropped = state.is_dropped or drops
    if is_dropped:
        body = _relieved(body)
    steps, motion, error = 1, state.motion, math.inf
    while error > LARGEST_ERROR_J and steps <= MOST_STEPS:
        motion, error = integrate(state.motion, start, end, water, water_rate, body, dt, steps)
        steps *= 2
    motion = aground(motion, water, bottom_depth(motion.p_n, motion.p_e, params.bottom))
    surface_ticks = state.surface_ticks + 1 if motion.p_d < SURFACE_M else 0
    fills = command.m_b > joints.m_b + v.errors.dead_band.m_b
    afloat_ticks = _afloat(state.afloat_ticks, motion.p_d, fills)
    sample = state.sample
    if params.sensors.is_held:
        measured = add_noise(plant_odometry(state), state.tick, params.sensors)
        height = _height(state.motion, params)
        sample = take_sample(measured, height, sample, state.tick, params.sensors)
    surfacing = surface_after(state.surfacing, motion.p_d)
    depths, surfacings = (state.motion.p_d, motion.p_d), (state.surfacing, surfacing)
    return PlantState(
        motion=motion,
        joints=joints,
        water=water,
        tick=state.tick + 1,
        dives=dives_after(state.dives, motion.p_d, params.dive),
        surface_ticks=surface_ticks,
        afloat_ticks=afloat_ticks,
        sample=sample,
        surfacing=surfacing,
        faults=_after_telling(state, faults, params, params.faults),
        is_dropped=is_dropped,
        ledger=spend(state.ledger, state.joints, joints, depths, surfacings, params.energy, dt),
    )


@kernel
def _relieved(body):
    """What a motion goes by without the drop weight, if there is one."""
    v = body.vehicle
    return replace(body, vehicle=replace(v, ballast=v.ballast - v.drop_weight))


@kernel
def surface_after(surfacing, depth):
    """What there is of the surface a tick later, at a depth (m)."""
    is_under = depth > DIVED_M or (surfacing.is_under and depth >= SURFACE_M)
    count = surfacing.count + 1 if surfacing.is_under and not is_under else surfacing.count
    if depth <= ANTENNA_M:
        return Surfacing(count, is_under, surfacing.out_ticks + 1, 0)
    return Surfacing(count, is_under, 0, surfacing.silent_ticks + 1)


@kernel
def _afloat(ticks, depth, fills):
    """Ticks afloat after one more; of a vehicle that fills its pump since then: it may dive."""
    if ticks < 0:
        return 0 if depth > DIVED_M else -1
    return 0 if fills or depth >= SURFACE_M else ticks + 1


@kernel
def plant_finished(state, params):
    """Whether the tick of this state is the last one of the run; there is no deeper sea."""
    surfaced = (
        params.stop_after_dives > 0
        and state.dives.count >= params.stop_after_dives
        and state.surface_ticks >= params.stop_surface_ticks
    )
    afloat = 0 < params.stop_afloat_ticks <= state.afloat_ticks
    lies_deep = state.motion.p_d > DEEPEST_SEA_M
    return state.tick + 1 >= params.max_ticks or surfaced or afloat or lies_deep


def state_fault(odometry: Odometry, joints: Joints, tick: int) -> str:
    """What of the vehicle's state at a tick is not finite, in words; empty if all is."""
    numbers = {**odometry._asdict(), **joints._asdict()}
    wrong = [name for name, number in numbers.items() if not math.isfinite(number)]
    return f'{not_finite("plant: the state", tick)}: {", ".join(wrong)}' if wrong else ''
