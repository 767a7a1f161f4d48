# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The yo, flown by a point that has a pump and nothing else: w = W sign(m) sqrt(abs(m) / m_0)."""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from glider_base.signals import TICK_S
from glider_base.wiring import NO_ECHO
from glider_guidance.yo.end_of_path import WayLeft, lower_turn, next_dive
from glider_guidance.yo.machine import (
    NEAR_TICKS,
    NO_END,
    PITCH_OVER,
    ProfileSettings,
    ProfileState,
    look_ahead_s,
    mission_time_s,
    profile_step,
    profile_targets,
)
from glider_guidance.yo.stage import (
    AT_END_OF_PATH,
    GLIDING_DOWN,
    GLIDING_UP,
    INFLECTING_DOWN,
    INFLECTING_UP,
    STAGE_NAMES,
    SURFACE_PREPARATION,
    SURFACING,
    WAITING_ON_SURFACE,
    is_descending,
    is_gliding,
)
from glider_model.onboard.glide_polar import make_polar
from glider_model.vehicle.file import load_vehicle

quick = settings(max_examples=50)

POLAR = make_polar(load_vehicle('zhang2021').params())
PUMP = 0.004
ALL_STAGES = range(len(STAGE_NAMES))
DEEP_STAGES = [GLIDING_DOWN, INFLECTING_UP, GLIDING_UP, INFLECTING_DOWN]
ROUND = [SURFACE_PREPARATION, GLIDING_DOWN, INFLECTING_UP, GLIDING_UP]


def glide_rate(params):
    """Vertical rate of the steady dive (m/s)."""
    return profile_targets(GLIDING_DOWN, 0.0, params)[1]


class Point:
    """A point with a pump, in a profile."""

    def __init__(self, dives=1, pump=PUMP, **fields):
        self.settings = ProfileSettings(**fields)
        self.params = self.settings.params(dives, pump, POLAR)
        self.pump = pump
        self.state = ProfileState()
        self.depth, self.rate = 0.0, 0.0
        self.net = -self.settings.net_heaviness_kg
        self.stages, self.depths = [self.state.stage], [0.0]

    def tick(self):
        self.state = profile_step(
            self.state, self.depth, self.rate, NO_ECHO, self.left(), self.params
        )
        full = self.settings.net_heaviness_kg
        wanted = math.copysign(full, profile_targets(self.state.stage, self.rate, self.params)[1])
        step = self.pump * TICK_S
        self.net += min(step, max(-step, wanted - self.net))
        self.rate = math.copysign(
            glide_rate(self.params) * math.sqrt(abs(self.net) / full), self.net
        )
        self.depth += TICK_S * self.rate
        if self.depth < 0.0:
            self.depth, self.rate = 0.0, 0.0
        if self.state.stage != self.stages[-1]:
            self.stages.append(self.state.stage)
        self.depths.append(self.depth)

    def left(self):
        return NO_END

    def fly(self, seconds):
        for _ in range(round(seconds / TICK_S)):
            self.tick()
        return self


def test_one_dive_passes_the_stages_in_order_and_ends_waiting():
    point = Point(dives=1, depth_m=100.0).fly(2500.0)
    assert point.stages == [*ROUND, WAITING_ON_SURFACE]


@pytest.mark.parametrize('dives', [1, 2, 3])
def test_so_many_dives_are_flown_and_counted(dives):
    point = Point(dives=dives, depth_m=50.0, top_depth_m=5.0).fly(700.0 * dives + 1500.0)
    again = [INFLECTING_DOWN, *ROUND[1:]] * (dives - 1)
    assert point.stages == [*ROUND, *again, WAITING_ON_SURFACE]
    assert point.state.dives == dives


@pytest.mark.parametrize(('depth_m', 'pump'), [(20.0, PUMP), (60.0, PUMP), (60.0, 10.0 * PUMP)])
def test_the_rest_of_the_path_is_looked_at_for_four_dives(depth_m, pump):
    """With their turns, which a strong pump hardly takes time for."""
    point = Point(dives=4, pump=pump, depth_m=depth_m, prepare_s=0.0)
    while point.state.dives < 4:
        point.tick()
    took_s = TICK_S * len(point.depths)
    assert took_s < look_ahead_s(point.params) < 1.2 * took_s + 8.0 * 6.0 * point.params.lead_s


class Walker(Point):
    """A point that goes along a path of ``way_m``, at 0.42 m/s in a glide, and no farther."""

    def __init__(self, way_m, **fields):
        super().__init__(**fields)
        self.way_m, self.gone_m = way_m, 0.0

    def left(self):
        return WayLeft((self.way_m - self.gone_m) / 0.42, 0.0)

    def tick(self):
        super().tick()
        self.gone_m += TICK_S * 0.42 * abs(self.rate) / glide_rate(self.params)


@pytest.mark.parametrize(
    ('way_m', 'depth_m'),
    [
        (150.0, 100.0),
        (333.0, 60.0),
        (500.0, 400.0),
        (777.0, 90.0),
        (900.0, 200.0),
        (1234.0, 150.0),
    ],
)
def test_last_dive_comes_up_at_the_end_of_the_path(way_m, depth_m):
    """Whatever the way and the depth: the surfacing is within 30 m of it, and stays."""
    walker = Walker(way_m, dives=0, depth_m=depth_m)
    while walker.state.stage != AT_END_OF_PATH:
        walker.tick()
        assert walker.gone_m < way_m + 100.0
    assert walker.gone_m == pytest.approx(way_m, abs=30.0)
    assert max(walker.depths) <= depth_m + 0.2
    walker.fly(2000.0)
    assert walker.state.stage == AT_END_OF_PATH
    assert walker.depth < 1.0


def test_only_the_last_two_dives_share_the_way_that_is_left():
    """1100 m are 3.6 dives to 100 m: two go down all the way, the last two equally deep."""
    walker = Walker(1100.0, dives=0, depth_m=100.0)
    while walker.state.stage != AT_END_OF_PATH:
        walker.tick()
    depths = np.array(walker.depths)
    peaks = depths[1:-1][(depths[1:-1] > depths[:-2]) & (depths[1:-1] >= depths[2:])]
    assert peaks[:-2] == pytest.approx(100.0, abs=0.5)
    assert len(peaks) == 4
    assert peaks[-2] == pytest.approx(peaks[-1], abs=10.0)
    assert 50.0 < peaks[-1] < 95.0


def test_so_many_dives_are_not_made_shallower_by_a_long_path():
    walker = Walker(1e5, dives=2, depth_m=100.0).fly(3000.0)
    assert walker.state.stage == WAITING_ON_SURFACE
    assert max(walker.depths) == pytest.approx(100.0, abs=0.5)


def test_path_that_is_too_short_for_a_dive_has_one_all_the_same():
    """The shallowest that has a glide in it."""
    walker = Walker(1.0, dives=0, depth_m=500.0)
    while walker.state.stage != AT_END_OF_PATH:
        walker.tick()
    assert 20.0 < max(walker.depths) < 40.0
    assert walker.state.dives == 1


def test_without_an_end_the_sawtooth_goes_on():
    point = Point(dives=0, depth_m=50.0, top_depth_m=5.0).fly(6000.0)
    teeth = [*ROUND, *[INFLECTING_DOWN, *ROUND[1:]] * 20]
    assert len(point.stages) > 20
    assert point.stages == teeth[: len(point.stages)]


@pytest.mark.parametrize('pump', [0.002, 0.004, 0.016])
@pytest.mark.parametrize('net', [0.2, 0.8])
def test_lead_puts_the_lower_turn_on_the_target(pump, net):
    """The pump's way is 2/3 W m_0 / pump: the deepest point is the target within 0.2 m."""
    point = Point(dives=0, pump=pump, net_heaviness_kg=net, depth_m=300.0).fly(3000.0)
    assert max(point.depths) == pytest.approx(300.0, abs=0.2)


def test_lead_puts_the_upper_turn_on_the_top_depth():
    point = Point(dives=0, depth_m=300.0, top_depth_m=40.0).fly(6000.0)
    below = point.depths[point.depths.index(max(point.depths)) :]
    assert min(below) == pytest.approx(40.0, abs=0.2)


def test_second_turn_is_led_by_the_pump_as_it_is():
    """A pump at a third of its rate: 24 m too deep the first time, within 0.5 m after that."""
    point = Point(dives=0, pump=PUMP / 3.0, depth_m=300.0)
    point.params = point.settings.params(0, PUMP, POLAR)
    point.fly(12000.0)
    depths = np.array(point.depths)
    peaks = depths[1:-1][(depths[1:-1] > depths[:-2]) & (depths[1:-1] >= depths[2:])]
    assert peaks[0] > 315.0
    assert peaks[1:] == pytest.approx(300.0, abs=0.5)
    assert len(peaks) > 2


@quick
@given(st.floats(10.0, 1000.0), st.floats(2.0, 1000.0))
def test_upper_turn_is_never_below_half_of_the_lower(depth_m, top_depth_m):
    params = ProfileSettings(depth_m=depth_m, top_depth_m=top_depth_m).params(0, PUMP, POLAR)
    assert params.top_depth == min(top_depth_m, 0.5 * depth_m)


def test_preparation_lasts_as_long_as_asked():
    point = Point(prepare_s=30.0).fly(30.0)
    assert point.state.stage == SURFACE_PREPARATION
    point.fly(0.2)
    assert point.state.stage == GLIDING_DOWN


@pytest.mark.parametrize('stage', ALL_STAGES)
def test_abort_leads_to_surfacing_from_every_stage(stage):
    params = ProfileSettings().params(1, PUMP, POLAR)
    state = profile_step(
        ProfileState(stage=stage, ticks=100, aborted=True),
        *(200.0, 0.2, NO_ECHO, NO_END, params),
    )
    assert state.stage == SURFACING


@pytest.mark.parametrize('stage', ALL_STAGES)
def test_abort_at_the_surface_stays_there(stage):
    params = ProfileSettings(wait_s=0.0, prepare_s=0.0).params(5, PUMP, POLAR)
    state = ProfileState(stage=stage, ticks=10**6, aborted=True)
    for _ in range(100):
        state = profile_step(state, 0.2, 0.0, NO_ECHO, NO_END, params)
    assert state.stage == WAITING_ON_SURFACE


@pytest.mark.parametrize('after_s', [30.0, 200.0, 380.0, 600.0])
def test_aborted_vehicle_comes_up_and_waits(after_s):
    point = Point(dives=0, depth_m=100.0).fly(after_s)
    point.state = point.state._replace(aborted=True)
    point.fly(1500.0)
    assert point.state.stage == WAITING_ON_SURFACE
    assert point.depth < 1.0


@pytest.mark.parametrize('stage', [SURFACE_PREPARATION, GLIDING_UP, WAITING_ON_SURFACE, SURFACING])
def test_stages_that_lead_up_ask_for_a_rate_upward(stage):
    params = ProfileSettings().params(1, PUMP, POLAR)
    assert profile_targets(stage, 0.0, params)[1] == -glide_rate(params)


@quick
@given(st.sampled_from(ALL_STAGES), st.floats(-1.0, 1.0), st.floats(13.0, 60.0))
def test_targets_are_always_the_glide_or_its_mirror_image(stage, vertical_rate, pitch_deg):
    params = ProfileSettings(pitch_deg=pitch_deg).params(1, PUMP, POLAR)
    pitch, rate = profile_targets(stage, vertical_rate, params)
    assert abs(pitch) == math.radians(pitch_deg)
    assert abs(rate) == pytest.approx(glide_rate(params), rel=1e-12)
    assert (rate > 0.0) == is_descending(stage)


@pytest.mark.parametrize('stage', [GLIDING_DOWN, GLIDING_UP])
def test_in_a_glide_the_nose_points_where_the_vehicle_goes(stage):
    params = ProfileSettings().params(1, PUMP, POLAR)
    pitch, rate = profile_targets(stage, 0.0, params)
    assert pitch * rate < 0.0
    assert is_gliding(stage)


@pytest.mark.parametrize(('stage', 'sign'), [(INFLECTING_UP, 1.0), (INFLECTING_DOWN, -1.0)])
@quick
@given(share=st.floats(-1.0, 1.0))
def test_pitch_goes_over_once_the_vertical_rate_has_halved(stage, sign, share):
    """The nose stays in the old direction until the rate is ``PITCH_OVER`` of the glide's."""
    assume(abs(share - PITCH_OVER) > 1e-9)
    params = ProfileSettings().params(1, PUMP, POLAR)
    vertical_rate = sign * share * glide_rate(params)
    pitch, _ = profile_targets(stage, vertical_rate, params)
    old = share > PITCH_OVER
    assert math.copysign(1.0, pitch) == (-sign if old else sign)


def test_nose_is_down_before_the_dive_begins():
    params = ProfileSettings().params(1, PUMP, POLAR)
    assert profile_targets(SURFACE_PREPARATION, 0.0, params)[0] < 0.0


def test_pitch_goes_over_once_in_a_turn():
    """Seen over a whole turn of the point: one change of sign, while it still goes down."""
    point, pitches, rates = Point(dives=0, depth_m=60.0), [], []
    while point.state.stage != GLIDING_UP:
        point.tick()
        if point.state.stage == INFLECTING_UP:
            pitches.append(profile_targets(point.state.stage, point.rate, point.params)[0])
            rates.append(point.rate)
    changes = [i for i in range(1, len(pitches)) if pitches[i] != pitches[i - 1]]
    assert len(changes) == 1
    assert rates[changes[0]] == pytest.approx(PITCH_OVER * glide_rate(point.params), rel=0.01)


@pytest.mark.parametrize('dives', [1, 3])
def test_estimated_time_is_that_of_the_flight(dives):
    """What the progress bar is drawn from, within 5 %."""
    point = Point(dives=dives, depth_m=300.0)
    ticks = 0
    while point.state.stage != WAITING_ON_SURFACE:
        point.tick()
        ticks += 1
    estimate = mission_time_s(point.params, dives)
    assert estimate == pytest.approx(ticks * TICK_S, rel=0.05)


@quick
@given(
    st.floats(2.0, 40.0),
    st.floats(0.3, 0.95),
    st.booleans(),
    st.floats(0.0, 1.0),
    st.floats(0.0, 60.0),
    st.floats(0.0, 1.0),
)
def test_the_last_dives_take_up_the_way_that_is_left(top, share, is_up, above, lead_s, drift):
    """Down, up to the upper turn, down and up for good, at the mean rate: two dives of one depth.

    One that rises has its way to the upper turn to go before them. In each of two turns of a dive
    the current carries the vehicle on.
    """
    params = ProfileSettings(depth_m=200.0, top_depth_m=top).params(0, PUMP, POLAR)
    depth = 0.0 if is_up else top + above * (200.0 - top)
    turn = top + (0.5 + 0.5 * share) * (200.0 - top)
    way = 4.0 * (turn - top) + (2.0 * top if is_up else depth)
    left = WayLeft(way / params.glide_rate + 4.0 * lead_s * drift, drift)
    assert next_dive(left, depth, is_up, lead_s, 3, False, params) == pytest.approx(turn)


def test_the_last_of_so_many_dives_is_left_out_where_the_path_ends_before_it():
    """Two of three are done once the vehicle is up: there is one to come, but no way for it."""
    params = ProfileSettings(depth_m=200.0, top_depth_m=5.0).params(3, PUMP, POLAR)
    state = ProfileState(stage=GLIDING_UP, dives=1, turn_depth=200.0, depth=200.0)
    moved = profile_step(state, 100.0, -0.2, NO_ECHO, WayLeft(10.0, 0.0), params)
    assert moved.turn_depth == 0.0


@pytest.mark.parametrize('known', [{}, {'lead_up_s': 1.0}, {'lead_down_s': 1.0}])
def test_the_first_turn_of_a_vehicle_that_sinks_too_fast_is_led_by_more(known):
    """By the square of how much faster it is; one that has turned knows how long that takes."""
    params = ProfileSettings(depth_m=200.0).params(0, PUMP, POLAR)
    state = ProfileState(stage=GLIDING_DOWN, turn_depth=200.0, depth=200.0, **known)
    rate = 1.4 * params.dive_rate
    lead_s = 1.0 if known else params.lead_s
    lead = rate * lead_s * (1.0 if known else 1.4**2)
    for depth, stage in ((200.1 - lead, INFLECTING_UP), (199.9 - lead, GLIDING_DOWN)):
        assert profile_step(state, depth, rate, NO_ECHO, NO_END, params).stage == stage


@quick
@given(st.floats(0.0, 100.0), st.floats(100.0, 190.0), st.floats(0.0, 60.0), st.floats(0.0, 1.0))
def test_a_dive_turns_where_the_rest_of_the_path_takes_it_up(depth, turn, lead_s, drift):
    params = ProfileSettings(depth_m=200.0, top_depth_m=5.0).params(0, PUMP, POLAR)
    way = (turn - depth) + turn
    left = WayLeft(way / params.glide_rate + lead_s * drift, drift)
    assert lower_turn(200.0, left, depth, lead_s, params) == pytest.approx(turn)
    assert lower_turn(90.0, left, depth, lead_s, params) == 90.0


def test_a_bottom_that_is_near_for_three_seconds_turns_a_dive():
    """Not one that is heard too near for less, by whatever swims there."""
    params = ProfileSettings(depth_m=200.0, clearance_m=10.0).params(0, PUMP, POLAR)
    state = ProfileState(stage=GLIDING_DOWN, turn_depth=200.0, depth=200.0)
    for _ in range(NEAR_TICKS):
        state = profile_step(state, 100.0, 0.2, 5.0, NO_END, params)
        assert state.stage == GLIDING_DOWN
    for no_echo in (NO_ECHO, -1.0):  # some drivers say that
        assert profile_step(state, 100.0, 0.2, no_echo, NO_END, params).near_ticks == 0
    assert profile_step(state, 100.0, 0.2, 5.0, NO_END, params).stage == INFLECTING_UP


@pytest.mark.parametrize(('depth', 'rate'), [(23.0, -0.3), (0.1, 0.8)])
def test_a_dive_that_has_not_begun_to_sink_does_not_turn(depth, rate):
    """A start under water rises as yet; at the surface a noisy rate is no way down."""
    params = ProfileSettings(depth_m=36.0).params(0, PUMP, POLAR)
    state = ProfileState(stage=GLIDING_DOWN, turn_depth=36.0, depth=36.0)
    assert profile_step(state, depth, rate, NO_ECHO, NO_END, params).stage == GLIDING_DOWN
    assert profile_step(state, 23.0, 0.3, NO_ECHO, NO_END, params).stage == INFLECTING_UP
