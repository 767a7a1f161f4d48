# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Messages that nobody would send, through the entry of a node and the step behind it.

In the middle of a dive one message is mutated: bits, length, numbers, frames. It is refused by
name, or the block makes of it, and of the good messages after it, finite numbers and commands
within the ranges.
"""

from functools import partial
from typing import NamedTuple

import numpy as np

from fuzzing.counts import Counter
from fuzzing.watch import outcome_of, time_limit_after
from glider_base.frames import odometry_from_wire, reference_from_wire
from glider_base.ros.hearing.inputs import Input
from glider_base.ros.wire.codec import MessageError, to_cdr
from glider_base.ros.wire.topics import TOPICS
from glider_base.signals import TICK_NS, TICK_S, Battery, Joints, Water
from glider_base.wiring import GUARD, NAVIGATION, NO_ECHO, SENSORS
from glider_bringup.engines.direct import MissionParams, MissionState, fly
from glider_bringup.engines.flight import mission_of
from glider_control.control import control_step
from glider_guard.block import guard_tick
from glider_guidance.guidance import guidance_step
from glider_mission.blocks import COLUMNS, ROW
from glider_mission.scenario import load_scenario
from glider_model.ocean.current import current_step
from glider_model.plant.plant import plant_step
from glider_navigation.block import navigation_tick

#: Topics that a block reads. What the plant makes of a wild current it says itself: it fails.
READ = (
    'odom',
    'joint_states',
    'reference',
    'demand',
    'command',
    'drop_weight',
    'health',
    'battery',
    *SENSORS,
)
#: Missions by their names, and what is changed in them.
SCENES = {
    'adaptive': {'control.law': 'adaptive'},
    'pid': {'control.law': 'pid'},
    'dead reckoned': {'navigation.method': 'dead_reckoned'},
}
#: The message comes after this many ticks of a dive.
TICKS = 3000
#: Good messages after it.
AFTER = 10
#: Fields of 32 bits, and fields that cannot hold such numbers.
_NARROW = {'range', *Battery._fields}
_INTEGERS = {'status.status'}
_WILD = (np.nan, np.inf, -np.inf, 0.0, 1e308, -1e308, 1e6, -1e6, 5e-324, 10.0, -10.0, 1e4, 2.0)


class Scene(NamedTuple):
    """A mission on its way down, and what the topics carry there."""

    state: MissionState
    params: MissionParams
    wires: dict[str, tuple[float, ...]]


def make_scene(name: str) -> Scene:
    """One of `SCENES`."""
    scenario = load_scenario('current_12deg', {'dives': 0, **SCENES[name]})
    state, params = mission_of(scenario)
    log = np.empty((TICKS, ROW))
    state, _, _ = fly(state, params, log)
    wires = {name: tuple(float(x) for x in log[-1, COLUMNS[name]]) for name in READ}
    return Scene(state, params, wires)


def _with_wild_numbers(draw: np.random.Generator, codec, values) -> bytes:
    numbers = list(values)
    places = [i for i, field in enumerate(codec.fields) if field not in _INTEGERS]
    for place in draw.choice(places, draw.integers(1, len(places) + 1), replace=False):
        wild = float(draw.choice(_WILD))
        if codec.fields[place] in _NARROW:
            with np.errstate(over='ignore'):
                wild = float(np.float32(wild))
        numbers[place] = wild
    return codec.encode(TICKS * TICK_NS, numbers)


def _flipped(draw: np.random.Generator, codec, values) -> bytes:
    raw = bytearray(codec.encode(TICKS * TICK_NS, values))
    for _ in range(draw.integers(1, 9)):
        raw[draw.integers(len(raw))] ^= 1 << draw.integers(8)
    return bytes(raw)


def _cut_or_longer(draw: np.random.Generator, codec, values) -> bytes:
    raw = codec.encode(TICKS * TICK_NS, values)
    length = int(draw.integers(0, 2 * len(raw)))
    return (raw + draw.bytes(len(raw)))[:length]


def _noise(draw: np.random.Generator, codec, values) -> bytes:
    return draw.bytes(int(draw.integers(0, 2000)))


def _of_another_layout(draw: np.random.Generator, codec, values) -> bytes:
    message = codec.message(codec.encode(TICKS * TICK_NS, values))
    message.header.frame_id = str(draw.choice(['', 'map_ned', 'map', 'x' * 1000, 'a/map']))
    if hasattr(message, 'name'):
        message.name = [str(name) for name in draw.permutation(list(message.name))]
        message.position = message.position[: draw.integers(len(message.position) + 1)]
    return to_cdr(message)


MUTATIONS = (_with_wild_numbers, _flipped, _cut_or_longer, _noise, _of_another_layout)


def _outputs(scene: Scene, name: str, values: tuple[float, ...]) -> list[float]:
    """Numbers that the readers of a topic make of a message and of good ones after it."""
    plant, current, navigation, guidance, control, guard = scene.state
    made: list[float] = []
    limits = scene.params.control.allocation
    for tick in range(1 + AFTER):
        wires = {**scene.wires, name: values} if tick == 0 else scene.wires
        heard = tuple(wires[topic] for topic in NAVIGATION.inputs)
        navigation, believed, _ = navigation_tick(
            navigation, 0.0, heard, scene.params.navigation, TICK_S
        )
        made += [number for numbers in believed for number in numbers]
        odometry = odometry_from_wire(wires['odom'])
        reference = reference_from_wire(wires['reference'])
        guidance, guided = guidance_step(
            guidance, odometry, NO_ECHO, scene.params.guidance, TICK_S
        )
        joints = Joints(*wires['joint_states'])
        control, out = control_step(
            control, odometry, joints, reference, scene.params.control, TICK_S
        )
        heard = tuple(wires[topic] for topic in GUARD.inputs)
        guard, guarded, _ = guard_tick(guard, 0.0, heard, scene.params.guard, TICK_S)
        target, drops = Joints(*wires['command']), wires['drop_weight'][0] > 0.5
        plant = plant_step(plant, target, Water(0.0, 0.0, 0.0), scene.params.plant, TICK_S, drops)
        _, water = current_step(current, odometry[:3], 0.0, scene.params.current, TICK_S)
        made += [*guided.reference, *guided.error, *out.command, *out.wrench, *plant.motion]
        made += water if np.all(np.isfinite(odometry[:3])) else ()
        most = (limits.m_b_max, limits.x_p_max, limits.mu_max, limits.delta_max)
        made += guarded[0]
        made += [
            np.nan
            for command in (out.command, guarded[0])
            for x, limit in zip(command, most, strict=True)
            if not abs(x) <= limit
        ]
    return made


def _try(draw: np.random.Generator, scene: Scene, name: str, mutate) -> tuple[str, str]:
    item = Input(TOPICS[name], lockstep=False)
    try:
        item.accept(mutate(draw, item.topic.codec, scene.wires[name]))
    except MessageError:
        return '', ''
    if not np.all(np.isfinite(_outputs(scene, name, item.values))):
        return 'wrong', f'not finite or out of range, after {item.values}'
    return '', ''


def fuzz(seed: int, count: int, counter: Counter) -> None:
    """Send ``count`` messages; refused, or answered within all limits, is well."""
    scenes = {name: make_scene(name) for name in SCENES}
    _outputs(scenes['pid'], 'odom', scenes['pid'].wires['odom'])  # loads the kernels
    for case in range(count):
        draw = np.random.Generator(np.random.PCG64([seed, case]))
        scene, name = str(draw.choice(list(scenes))), str(draw.choice(READ))
        mutate = MUTATIONS[draw.integers(len(MUTATIONS))]
        attempt = partial(_try, draw, scenes[scene], name, mutate)
        outcome, why = outcome_of(attempt, time_limit_after)
        case_text = f'seed {seed}, case {case}: {name}{mutate.__name__.replace("_", " ")}, {scene}'
        counter.add(case_text, outcome, why)
