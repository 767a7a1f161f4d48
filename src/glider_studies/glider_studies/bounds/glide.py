# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The steady glide of a phase, as the stack flies it, and the steering loop there.

`steering_loop` is the one function that knows what a law and a guidance method look like inside:
it moves what they see by a little, one tick long, and reads what they ask for.
"""

import math
from typing import NamedTuple

import numpy as np

from glider_base.settings import ConfigurationError
from glider_base.signals import TICK_S, Reference, TrackingError, Water
from glider_bringup.engines.direct import HeldMission, MissionParams, MissionState
from glider_bringup.engines.flight import mission_of
from glider_control.control import see
from glider_control.law import Seen, bank_carefully, law_step
from glider_control.surface import steer
from glider_guidance.method import Leg, Situation, method_step
from glider_guidance.path.settings import StraightPath
from glider_guidance.yo.stage import GLIDING_DOWN, GLIDING_UP
from glider_mission.blocks import COLUMNS, ROW
from glider_mission.scenario import Scenario, load_scenario
from glider_model.onboard.command_filter import Filtered
from glider_model.vehicle.file import load_vehicle
from glider_model.vehicle.steering import STEERING_SPEED
from glider_studies.bounds.steering_loop import SteeringLoop

#: Scenario in which a vehicle glides as it does nominally; any other vehicle as in the first.
SCENARIOS = {'': 'current_8deg', 'slocum_g2': 'slocum_shelf', 'seaglider': 'seaglider_1000m'}
#: Still water, position known, and a path that turns to both sides, so that steering is learnt.
FIELDS = {
    'dives': 0,
    'duration_s': 50000.0,
    'current.speed_kn': 0.0,
    'sensors': {},
    'navigation.method': 'known',
    'profile.surface_every_dives': 0,
    'path': {
        'kind': 'waypoints',
        'waypoints': [[300 * i, 60 * (i % 2)] for i in range(80)],
        'at_end': 'continue',
    },
}
#: Dive whose glides are looked at; so long after it began a glide goes on straight, and after so
#: long again it is steady (s).
DIVE, SETTLED_S, STRAIGHT_S = 2, 100.0, 250.0
#: Ticks between two looks at the stage of the yo.
_LOOK_TICKS = 100
#: A glide is over so long before it ends (s).
BEFORE_TURN_S = 60.0
#: Changes of what a law (rad, rad/s) and a method (m) see.
_SMALL, _SMALL_M = 1e-4, 0.1
PHASES = {'dive': GLIDING_DOWN, 'climb': GLIDING_UP}


class Glide(NamedTuple):
    """A mission in the middle of a steady glide."""

    scenario: Scenario
    state: MissionState
    params: MissionParams
    descends: bool
    speed: float  #: through the water (m/s)
    left_s: float  #: until the glide is over
    leg_s: float  #: time of the whole glide


def scenario_of(vehicle: str) -> Scenario:
    """What a vehicle flies to be looked at."""
    fields = {**FIELDS, 'vehicle': vehicle}
    if vehicle not in SCENARIOS:  # it may be one of a small pump, or of shallow water
        its = load_vehicle(vehicle)
        fields['profile.depth_m'] = min(1000.0, its.rated_depth_m)
        fields['profile.net_heaviness_kg'] = min(0.4, 0.5 * its.params().m_b_max)
    return load_scenario(SCENARIOS.get(vehicle, SCENARIOS['']), fields)


def straight_on(params: MissionParams, north: float, east: float, course: float) -> MissionParams:
    """Another path from now on: through a point (m), on a course (rad)."""
    path = StraightPath(
        kind='straight', start=(north, east), course_deg=0.0, length_m=1e5
    ).params()
    path.coefficients[0, :2, 1] = math.cos(course), math.sin(course)
    guidance = params.guidance
    changed = guidance._replace(path=path, path_id=guidance.path_id + 1)
    return params._replace(guidance=changed)


def _stage(held: HeldMission, ticks: int) -> int:
    """Stage of the yo after some ticks."""
    log = np.empty((ticks, ROW))
    rows, is_over = held.fly(log)
    return -1 if is_over else int(log[rows - 1, COLUMNS['stage']])


def glides(vehicle: str) -> dict[str, Glide]:
    """A steady glide of each phase, by its name."""
    load_vehicle(vehicle)  # what is wrong with it is named in its own words
    scenario = scenario_of(vehicle)
    state, params = mission_of(scenario)
    held = HeldMission(state, params)
    found, before, dives, t_s = {}, -1, 0, 0.0
    began_s: dict[int, float] = {}
    lengths: dict[int, float] = {}
    while len(found) < len(PHASES) and t_s < scenario.duration_s - 1000.0:
        stage = _stage(held, _LOOK_TICKS)
        t_s += _LOOK_TICKS * TICK_S
        if stage != before:
            if before in began_s:
                lengths[before] = t_s - began_s[before]
            began_s[stage] = t_s
            dives += stage == GLIDING_DOWN
            before = stage
        name = next((name for name, one in PHASES.items() if one == stage), '')
        ready = dives >= DIVE and name and name not in found and stage in lengths
        if ready and t_s - began_s[stage] >= SETTLED_S:
            found[name] = _settled(
                held, scenario, params, stage, lengths[stage], t_s - began_s[stage]
            )
    if len(found) < len(PHASES):
        raise ConfigurationError(f'{vehicle}: no steady glide within {scenario.duration_s:,.0f} s')
    return found


def _settled(held, scenario, params, stage, leg_s, gone_s) -> Glide:
    """Fly straight on until the glide is steady; the mission goes on from there."""
    guidance = held.state.guidance
    place = guidance.gate.odometry
    course = guidance.commanded.heading_command
    params = straight_on(params, place.p_n, place.p_e, course)
    held.set_params(params)
    _stage(held, round(STRAIGHT_S / TICK_S))
    state = held.state
    return Glide(
        scenario=scenario,
        state=state,
        params=params,
        descends=stage == GLIDING_DOWN,
        speed=_seen(state, params).speed,
        left_s=leg_s - gone_s - STRAIGHT_S - BEFORE_TURN_S,
        leg_s=leg_s,
    )


def _seen(state: MissionState, params: MissionParams) -> Seen:
    """What the law sees of a vehicle that goes where it shall."""
    measured, control = state.control.measured, params.control
    taken = state.control.intake
    commanded = state.guidance.commanded
    reference = Reference(*(0.0,) * len(Reference._fields))._replace(
        theta=commanded.pitch.value, psi=measured.psi, v_d=measured.vertical_rate
    )
    still = measured._replace(phi=0.0, phi_dot=0.0, psi_dot=0.0, theta_dot=0.0)
    return see(still, reference, taken.joints, state.control.command, control)


# ------------------------------------------------------------------- what law and method ask


def steering_loop(glide: Glide) -> SteeringLoop:
    """The loop of a glide, with the gains that law and method have in it.

    Raises ConfigurationError if the law does not steer there.
    """
    state, params = glide.state, glide.params
    law, seen = params.control.law, _seen(state, params)
    fin = params.control.steering
    if hasattr(fin, 'turn_rate'):
        ask, roll_filter = lambda seen: steer(state.control.steering, seen, fin, TICK_S)[1], None
        limit = params.control.allocation.delta_max
        speed_ratio = (glide.speed / STEERING_SPEED) ** 2
        b, k = state.control.steering.known.b * fin.turn_rate * speed_ratio, 0.0
    else:
        careful = bank_carefully(seen.m_b, law)
        ask, roll_filter = _ask_law(state, law, careful.roll_filter), careful.roll_filter
        limit = _largest(ask, seen)
        steering = state.control.law.steering
        phase = steering.dive if glide.descends else steering.climb
        b, k = phase.b * steering.ratio, phase.k
    speed = state.guidance.water.speed
    loop = SteeringLoop(
        speed=speed,
        b=b,
        k=k,
        line_of_sight=-_heading(glide, _SMALL_M) / _SMALL_M,
        heading_filter=params.guidance.heading_filter,
        law=_slopes(ask, seen),
        limit=limit,
        roll_filter=roll_filter,
        leg_s=glide.leg_s,
    )
    if not loop.bandwidth > 0.0:
        raise ConfigurationError(
            f'{glide.scenario.vehicle}: the law does not steer it by its turn in a '
            f'{"dive" if glide.descends else "climb"} of {glide.speed:.2f} m/s'
        )
    return loop


def slope(glide: Glide, reach: float) -> float:
    """Least gain of the line of sight up to a reach (m), of that on the path."""
    return _heading(glide, reach) / reach / (_heading(glide, _SMALL_M) / _SMALL_M)


def _heading(glide: Glide, beside: float) -> float:
    """Heading from the path (rad) that the method asks for beside it (m)."""
    state, params = glide.state, glide.params
    guidance, psi = state.guidance, state.guidance.followed.measured.psi
    speed = guidance.water.speed
    leg = Leg(
        stage=GLIDING_DOWN if glide.descends else GLIDING_UP,
        descends=glide.descends,
        is_gliding=True,
        is_surfaced=False,
        turns_over=False,
        begins_to_turn_over=False,
        glided_s=1e6,
        glided_before_s=1e6,
        lead_s=0.0,
        lead_before_s=0.0,
        to_turn_s=math.inf,
    )
    seen = Situation(
        course=psi,
        elevation=0.0,
        error=TrackingError(0.0, beside, 0.0),
        follows_path=False,
        ground_n=speed * math.cos(psi),
        ground_e=speed * math.sin(psi),
        speed=speed,
        glide_speed=params.guidance.profile_speed,
        current=Water(0.0, 0.0, 0.0),
        steering=guidance.followed.steering,
        turning=params.guidance.steering,
        leg=leg,
        heading=psi,
    )
    method = guidance.method
    if hasattr(method, 'beside'):  # as long as it has been there, so long it is known
        method = method._replace(beside=beside)
    _, asked = method_step(method, seen, params.guidance.method, TICK_S)
    return math.remainder(asked.heading - psi, 2.0 * math.pi)


def _ask_law(state: MissionState, law: NamedTuple, roll_filter):
    """Roll (rad) that a law asks for, read off a tick of its roll filter."""

    def ask(seen: Seen, value: float = 0.0) -> float:
        before = state.control.law._replace(roll=Filtered(value, 0.0))
        after, _, _ = law_step(before, seen, law, TICK_S)
        pull = after.roll.rate / (TICK_S * 2.0 * roll_filter.frequency)
        return value + pull / (0.5 * roll_filter.frequency)

    return ask


def _largest(ask, seen: Seen) -> float:
    """Largest roll that is asked for (rad): the filter lets a tick see no step of any size."""
    turned = seen._replace(reference=seen.reference._replace(psi=seen.reference.psi + 0.5))
    value = 0.0
    for _ in range(10):
        value = ask(turned, value)
    return abs(value)


def _slopes(ask, seen: Seen) -> tuple[float, ...]:
    """What is asked for over psi_s, psi_s', psi, psi', u and u'."""
    places = (
        *(('reference', name) for name in ('psi', 'psi_dot')),
        *(('measured', name) for name in ('psi', 'psi_dot', 'phi', 'phi_dot')),
    )
    found = []
    for part, name in places:
        of = getattr(seen, part)
        sides = (
            ask(seen._replace(**{part: of._replace(**{name: getattr(of, name) + side})}))
            for side in (_SMALL, -_SMALL)
        )
        found.append((next(sides) - next(sides)) / (2.0 * _SMALL))
    return tuple(found)
