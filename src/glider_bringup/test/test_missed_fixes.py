# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Three days in which fixes are missed, one in two and three in a row, in a sea that changes.

What is believed jumps by hundreds of metres where a fix comes after all. Nothing that is commanded
does: a jump of odom is legal (REP-105), and the filters of guidance are what the vehicle follows.
"""

from typing import NamedTuple

import numpy as np
import pytest

from glider_base.frames import poses_from_wire
from glider_base.signals import TICK_NS, TICK_S
from glider_bringup.engines.direct import fly_blocks
from glider_bringup.engines.flight import mission_of
from glider_guidance.yo.stage import WAITING_ON_SURFACE
from glider_mission.blocks import COLUMNS
from glider_mission.recording.recorded_inputs import RecordedBlock
from glider_mission.scenario import load_scenario
from glider_navigation.block import NAVIGATION
from glider_navigation.phase import FIXED

DURATION_S = 259200.0
#: Surfacings without a fix are marked by 1.
PATTERN = '010111'
CHANGES = {
    'navigation.method': 'dead_reckoned',
    'sensors.fix_missed_pattern': PATTERN,
    'sensors.compass_bias_deg': 1.0,
    'profile.surface_every_dives': 1,
    'path.length_m': 200000.0,
    'dives': 0,
    'duration_s': DURATION_S,
}
#: A jump of what is believed, which no vehicle makes in a tick (m).
JUMP_M = 100.0


class Step(NamedTuple):
    """What changed from one tick to the next, as numbers; shape (n,) of each, and (n, 3)."""

    place: np.ndarray  #: believed (m)
    error: np.ndarray  #: e1 and e2 (m)
    command: np.ndarray  #: magnitudes (kg, m, rad)
    pitch: np.ndarray  #: of the reference, magnitudes (rad)
    heading: np.ndarray
    stage: np.ndarray  #: of the tick after, if it is that of the tick before; else -1
    variance: np.ndarray  #: of the believed place, before and after (m^2), shape (n, 2)
    phase: np.ndarray  #: after


def steps_of(log):
    """What changed from row to row."""

    def of(name):
        return log[:, COLUMNS[name]]

    place, poses = of('odom')[:, :2], poses_from_wire(np.ascontiguousarray(of('reference')))
    turned = np.abs(np.diff(poses[:, 4:], axis=0))
    stage, variance = of('stage'), of('odom')[:, 13] + of('odom')[:, 16]
    return Step(
        np.hypot(*np.diff(place, axis=0).T),
        np.hypot(*np.diff(of('tracking_error')[:, :2], axis=0).T),
        np.abs(np.diff(of('command')[:, :3], axis=0)),
        turned[:, 0],
        np.minimum(turned[:, 1], 2.0 * np.pi - turned[:, 1]),
        np.where(np.diff(stage) == 0.0, stage[1:], -1.0),
        np.stack([variance[:-1], variance[1:]], axis=1),
        of('phase')[1:],
    )


class Flown(NamedTuple):
    """The flight, as far as it is asked for here."""

    jumps: Step  #: those at which what is believed jumps
    calm: np.ndarray  #: largest steps of the commands on the surface without one
    turn: float  #: largest steps of the reference at all, pitch and heading (rad)
    turn_heading: float
    ends: np.ndarray  #: variance when it comes up, and when it dives again (m^2), shape (n, 2)
    fixed: np.ndarray  #: whether there was a fix in between


@pytest.fixture(scope='module')
def scenario():
    return load_scenario('rough_water', CHANGES)


@pytest.fixture(scope='module')
def flown(scenario):
    jumps, calm, pitch, heading = [], np.zeros(3), 0.0, 0.0
    before, phases, variances = None, [], []
    for log in fly_blocks(*mission_of(scenario)):
        rows = log if before is None else np.concatenate([before, log])
        before = rows[-1:].copy()
        step = steps_of(rows)
        far = step.place > JUMP_M
        jumps.append(Step(*(part[far].copy() for part in step)))
        waits = ~far & (step.stage == WAITING_ON_SURFACE)
        calm = np.maximum(calm, step.command[waits].max(axis=0, initial=0.0))
        pitch, heading = max(pitch, step.pitch.max()), max(heading, step.heading.max())
        phases.append(step.phase.astype(np.int8))
        variances.append(step.variance[:, 1].astype(np.float32))
    phase, variance = np.concatenate(phases), np.concatenate(variances)
    edges = np.flatnonzero(np.diff((phase != 1).astype(np.int8)))
    up = edges[phase[edges] == 1]
    down = [int(edges[edges > one][0]) for one in up if (edges > one).any()]
    up = up[: len(down)]
    return Flown(
        Step(*map(np.concatenate, zip(*jumps, strict=True))),
        calm,
        pitch,
        heading,
        np.stack([variance[up], variance[down]], axis=1),
        phase[down] == FIXED,
    )


def test_it_had_the_surfacings_it_was_to_have(flown):
    """The first number of the pattern is for the launch."""
    missed = [PATTERN[(1 + n) % len(PATTERN)] == '1' for n in range(len(flown.fixed))]
    assert len(flown.fixed) > 30
    assert flown.fixed.tolist() == [not one for one in missed]


def test_what_is_believed_jumps_by_hundreds_of_metres_and_is_taken_at_once(flown):
    """The gates of guidance and control are for wild samples: nothing is refused at a fix."""
    jumps = flown.jumps
    assert len(jumps.place) >= 10
    assert np.max(jumps.place) > 1000.0
    assert np.all(jumps.stage == WAITING_ON_SURFACE)
    assert jumps.error == pytest.approx(jumps.place, abs=1.0)


def test_no_command_jumps_at_a_fix(flown, scenario):
    """Neither at the tick of the fix nor, by the filters, at any other tick."""
    assert np.all(flown.jumps.command <= flown.calm)
    filters = scenario.guidance.filters
    assert flown.turn <= filters.pitch_rate_radps * TICK_S * (1.0 + 1e-6)
    assert flown.turn_heading <= filters.heading_rate_radps * TICK_S * (1.0 + 1e-6)
    assert np.all(flown.jumps.heading <= flown.turn_heading)


def test_covariance_grows_from_one_missed_fix_to_the_next_and_comes_back(flown):
    came_up, dived = flown.ends.T
    assert np.all(dived[flown.fixed] < 200.0)
    in_a_row = 0
    for number in range(1, len(came_up)):
        in_a_row = 0 if flown.fixed[number - 1] else in_a_row + 1
        if in_a_row:
            assert came_up[number] > dived[number - 1] > 0.9 * came_up[number - 1]
    assert np.all(came_up > 100.0 * 2.0)
    assert np.all(flown.jumps.variance[:, 1] < 0.05 * flown.jumps.variance[:, 0])
    # a jump lies within what it said of itself: chi squared of two numbers, 95 %
    assert np.mean(flown.jumps.place**2 < 5.991 / 2.0 * flown.jumps.variance[:, 0]) > 0.85


def test_a_driver_that_says_its_last_fix_again_under_water_misleads_nobody():
    """Until it has another one: as receivers do that are asked for where they are."""
    ways = {'dives': 3, 'duration_s': 20000.0, 'profile.surface_every_dives': 1}
    at_once = {'navigation.method': 'dead_reckoned', 'profile.depth_m': 150.0}
    scenario = load_scenario('current_8deg', {**ways, **at_once})
    log = np.concatenate([block.copy() for block in fly_blocks(*mission_of(scenario))])
    inputs = {name: log[:, COLUMNS[name]] for name in NAVIGATION.wired.inputs}
    fix = inputs['fix']
    is_fix = fix[:, 0] >= 0.0
    last = np.maximum.accumulate(np.where(is_fix, np.arange(len(fix)), -1))
    again = np.where(last[:, np.newaxis] < 0, fix, fix[last])
    assert np.count_nonzero(again[:, 0] >= 0.0) > 2 * np.count_nonzero(is_fix)
    stamps_ns = np.arange(len(log)) * TICK_NS
    settings = scenario.navigation_settings()
    places = []
    for said in (fix, again):
        outputs, flags = RecordedBlock(NAVIGATION, settings).run(
            stamps_ns, {**inputs, 'fix': said}
        )
        places.append(np.ascontiguousarray(outputs['odom'][:, :3]))
        assert not np.any(flags[:, 1])
    assert np.array_equal(places[0], log[:, COLUMNS['odom']][:, :3])
    off = np.abs(places[1] - places[0])
    assert np.max(off[:, 2]) < 0.05
    assert np.max(np.hypot(off[:, 0], off[:, 1])) < 10.0
