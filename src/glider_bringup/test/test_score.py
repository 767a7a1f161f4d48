# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Scores of made-up flights whose scores are known."""

import json
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import uniform_filter1d
from scipy.spatial.transform import Rotation

import glider_bringup
from glider_base.signals import TICK_S
from glider_bringup.scoring.again import score_again
from glider_bringup.scoring.score import Scorer
from glider_guidance.path.settings import HelixPath, WaypointPath
from glider_guidance.yo.stage import AT_END_OF_PATH
from glider_mission.blocks import COLUMNS, ROW
from glider_mission.rules import Rules
from glider_mission.scenario import load_scenario
from glider_navigation.settings import METHODS

quick = settings(max_examples=20)

TARGET_M = 1000.0
#: Where the vehicle is, and where it believes it is.
TRUTH = COLUMNS['ground_truth/odom']
ESTIMATE = slice(COLUMNS['odom'].start, COLUMNS['odom'].start + 13)


def wire_quaternion(theta, psi):
    """Attitude as on a topic, ENU / FLU, w x y z: yaw is pi/2 - psi, pitch is -theta."""
    theta, psi = np.broadcast_arrays(theta, psi)
    angles = np.stack([math.pi / 2.0 - psi, -theta, np.zeros_like(psi)], axis=-1)
    return np.roll(Rotation.from_euler('ZYX', angles).as_quat(), 1, axis=-1)


def make_log(t, **given):
    """Log of a flight: a column for each name, a number or float64[n]; rad and m."""
    value = {
        'north': 0.0,
        'east': 0.0,
        'depth': 500.0,
        'theta': -0.5,
        'psi': 0.0,
        'e2': 0.0,
        'theta_ref': -0.5,
        'psi_ref': 0.0,
        'rate_ref': 0.25,
        'target_n': 0.0,
        'target_e': 0.0,
        'infeasible': 0.0,
        **given,
    }
    log = np.zeros((len(t), ROW))
    odom, reference = log[:, TRUTH], log[:, COLUMNS['reference']]
    odom[:, 0], odom[:, 1], odom[:, 2] = value['east'], value['north'], -value['depth']
    odom[:, 3:7] = wire_quaternion(value['theta'], value['psi'])
    log[:, ESTIMATE] = log[:, TRUTH]
    reference[:, 0], reference[:, 1] = value['target_e'], value['target_n']
    reference[:, 3:7] = wire_quaternion(value['theta_ref'], value['psi_ref'])
    reference[:, 9] = -value['rate_ref']
    log[:, COLUMNS['tracking_error'].start + 1] = value['e2']
    log[:, COLUMNS['infeasible']] = value['infeasible']
    return log


def ticks(seconds):
    return TICK_S * np.arange(round(seconds / TICK_S))


def score(log, settle_s=0.0, target_m=TARGET_M, **rules):
    scorer = Scorer(load_scenario())
    scorer.add(log)
    return scorer.result(Rules(settle_s, target_m, **rules))


def test_sinusoidal_error_has_its_rms_and_its_amplitude():
    """3 m of amplitude over whole periods: rms 3 / sqrt(2)."""
    t = ticks(5000.0)
    track = score(make_log(t, e2=3.0 * np.sin(2.0 * math.pi * t / 100.0)))['cross_track_m']
    assert track['rms_steady'] == pytest.approx(3.0 / math.sqrt(2.0), rel=1e-3)
    assert track['max_steady'] == pytest.approx(3.0, rel=1e-6)
    assert track['max_all'] == pytest.approx(3.0, rel=1e-6)


@pytest.mark.parametrize('heading_deg', [0.0, 90.0, -120.0])
def test_what_is_believed_is_not_what_is_scored(heading_deg):
    """Estimate on its path, and really 30 m to starboard of it and 10 m below."""
    t, psi = ticks(2000.0), math.radians(heading_deg)
    way = 0.5 * t
    n, e = math.cos(psi), math.sin(psi)
    place = {'north': n * way - 30.0 * e, 'east': e * way + 30.0 * n, 'depth': 510.0}
    log = make_log(t, psi=psi, target_n=n * way, target_e=e * way, **place)
    log[:, ESTIMATE.start : ESTIMATE.start + 3] = np.stack(
        (e * way, n * way, -500.0 + 0 * t), axis=1
    )
    result = score(log)
    assert result['cross_track_m']['rms_steady'] == pytest.approx(30.0, abs=1e-9)
    assert result['depth_m']['max'] == pytest.approx(510.0)
    assert result['final_state']['position_ned_m'] == pytest.approx(
        [place['north'][-1], place['east'][-1], 510.0]
    )


def test_negative_error_counts_like_a_positive_one():
    assert score(make_log(ticks(2000.0), e2=-4.0))['cross_track_m']['max_all'] == 4.0


@quick
@given(st.floats(-20.0, 20.0), st.floats(-175.0, 175.0))
def test_pitch_error_is_the_difference_in_degrees(error_deg, heading_deg):
    t = ticks(800.0)
    log = make_log(
        t, theta=np.full(len(t), -0.5 + math.radians(error_deg)), psi=heading_deg / 57.3
    )
    pitch = score(log)['pitch_error_deg']
    assert pitch['rms_steady'] == pytest.approx(abs(error_deg), abs=1e-6)
    assert pitch['max_steady'] == pytest.approx(abs(error_deg), abs=1e-6)


def pulse(t, at_s):
    """A single tick of 7 m of cross-track error."""
    e2 = np.zeros(len(t))
    e2[round(at_s / TICK_S)] = 7.0
    return e2


@quick
@given(st.floats(0.0, 1999.9), st.floats(0.0, 3000.0), st.booleans())
def test_nothing_is_left_out_of_the_whole_run(at_s, settle_s, is_deep):
    """Neither settling, nor turns, nor the surface: a single tick of 7 m counts, whenever."""
    t = ticks(2000.0)
    rate = np.where(t < 1000.0, 0.25, -0.25)
    log = make_log(t, e2=-pulse(t, at_s - 0.05), rate_ref=rate, depth=500.0 * is_deep)
    assert score(log, settle_s=settle_s)['cross_track_m']['max_run'] == 7.0


def test_settling_time_is_left_out_of_all_but_the_whole_run():
    """The tick at the settling time itself is left out, the next one counts."""
    t = ticks(2000.0)
    for at_s, counted in ((1000.0, None), (1000.1, 7.0)):
        track = score(make_log(t, e2=pulse(t, at_s)), settle_s=1000.0)['cross_track_m']
        assert track['max_all'] == (counted or 0.0)
        assert track['max_steady'] == (counted or 0.0)


@pytest.mark.parametrize(
    ('offset_s', 'steady'), [(-600.1, True), (-599.9, False), (599.9, False), (600.1, True)]
)
def test_steady_is_more_than_600_s_from_an_inflection(offset_s, steady):
    """On either side; everything else of the turn still counts in "all"."""
    t = ticks(4000.0)
    rate = np.where(t < 2000.0, 0.25, -0.25)
    track = score(make_log(t, e2=pulse(t, 2000.0 + offset_s), rate_ref=rate))['cross_track_m']
    assert track['max_steady'] == (7.0 if steady else 0.0)
    assert track['max_all'] == 7.0


@pytest.mark.parametrize(
    ('offset_s', 'steady'), [(-240.1, True), (-239.9, False), (239.9, False), (240.1, True)]
)
def test_margin_of_a_shallow_dive_is_a_share_of_its_time(offset_s, steady):
    """30 % of dives of 800 s, so that 320 s of each are steady."""
    t = ticks(1600.0)
    rate = np.where(t < 800.0, 0.25, -0.25)
    log = make_log(t, e2=pulse(t, 800.0 + offset_s), rate_ref=rate, depth=100.0)
    track = score(log, target_m=200.0, glide_s=800.0)['cross_track_m']
    assert track['max_steady'] == (7.0 if steady else 0.0)


@pytest.mark.parametrize(('depth_m', 'steady'), [(9.9, 0.0), (10.1, 7.0)])
def test_steady_in_a_shallow_dive_is_deeper_than_a_quarter_of_it(depth_m, steady):
    t = ticks(1000.0)
    depth = np.where(np.abs(t - 500.0) < 50.0, depth_m, 35.0)
    log = make_log(t, e2=pulse(t, 500.0), depth=depth)
    assert score(log, target_m=40.0)['cross_track_m']['max_steady'] == steady


@pytest.mark.parametrize(('depth_m', 'steady'), [(29.9, 0.0), (30.1, 7.0)])
def test_steady_is_deeper_than_30_m(depth_m, steady):
    t = ticks(1000.0)
    depth = np.where(np.abs(t - 500.0) < 50.0, depth_m, 500.0)
    track = score(make_log(t, e2=pulse(t, 500.0), depth=depth))['cross_track_m']
    assert track['max_steady'] == steady
    assert track['max_all'] == 7.0


def test_without_a_tick_there_is_no_score():
    result = Scorer(load_scenario()).result(Rules())
    assert result['ticks'] == 0
    assert result['final_state'] is None
    assert result['depth_m'] == {'max': None, 'overshoot': None}
    assert set(result['cross_track_m'].values()) == {None}
    json.dumps(result, allow_nan=False)


def test_without_a_steady_tick_only_all_has_a_figure():
    track = score(make_log(ticks(500.0), e2=2.0, depth=10.0))
    assert track['cross_track_m'] == {
        'rms_steady': None,
        'max_steady': None,
        'max_all': 2.0,
        'max_run': 2.0,
    }
    assert track['pitch_error_deg'] == {'rms_steady': None, 'max_steady': None}
    assert track['heading_fluctuation_deg'] == {'rms_steady': None, 'max_steady': None}


def test_run_shorter_than_the_settling_time_has_no_figures():
    result = score(make_log(ticks(500.0), e2=2.0), settle_s=1800.0)
    track = result['cross_track_m']
    assert track == {'rms_steady': None, 'max_steady': None, 'max_all': None, 'max_run': 2.0}
    assert result['settle_s'] == 1800.0
    assert result['status'] == 'completed'


@pytest.mark.parametrize('centre_deg', [0.0, 90.0, 179.0, 180.0, -180.0])
def test_heading_fluctuation_is_that_of_a_sine_across_the_seam(centre_deg):
    """2 deg of amplitude, 30 s of period: a tenth of the mean's window, so all of it counts.

    The last 200 s are at the surface: there the mean's window is cut.
    """
    t = ticks(6000.0)
    heading = centre_deg + 2.0 * np.sin(2.0 * math.pi * t / 30.0)
    depth = np.where(t < 5800.0, 500.0, 5.0)
    result = score(make_log(t, psi=np.radians(heading), depth=depth), settle_s=600.0)
    found = result['heading_fluctuation_deg']
    assert found['rms_steady'] == pytest.approx(2.0 / math.sqrt(2.0), rel=0.01)
    assert found['max_steady'] == pytest.approx(2.0, rel=0.02)


@pytest.mark.parametrize('rate_degps', [0.005, -0.05])
def test_heading_fluctuation_leaves_out_a_slow_drift(rate_degps):
    """A steady turn, several times around: nothing away from both ends of the log."""
    t = ticks(20000.0)
    depth = np.where((t > 300.0) & (t < 19700.0), 500.0, 5.0)
    log = make_log(t, psi=np.radians(30.0 + rate_degps * t), depth=depth)
    found = score(log, settle_s=600.0)['heading_fluctuation_deg']
    assert found['max_steady'] == pytest.approx(0.0, abs=1e-6)


def test_heading_fluctuation_tells_a_limit_cycle_from_a_drift():
    """30 deg at 400 s on a drift: the 300 s mean follows a part sinc(300/400) of the cycle."""
    t = ticks(40000.0)
    heading = 0.002 * t + 30.0 * np.sin(2.0 * math.pi * t / 400.0)
    found = score(make_log(t, psi=np.radians(heading)), settle_s=600.0)
    expected = 30.0 / math.sqrt(2.0) * (1.0 - np.sinc(300.0 / 400.0))
    assert found['heading_fluctuation_deg']['rms_steady'] == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize(('last', 'dives'), [([500.0], 2), ([500, 400], 2), ([500, 400, 19], 3)])
def test_dives_are_counted_by_20_m_down_and_up(last, dives):
    """Waves make no dives of their own; one that is not over counts not."""
    depth = np.array([0, 25, 31, 29, 31, 19, 22, 10, 19, 40, 21, 40, 19, *last], dtype=float)
    told = score(make_log(ticks(0.1 * len(depth)), depth=depth))
    assert told['dives'] == dives


@pytest.mark.parametrize('target_m', [10.0, 25.0, 40.0, 60.0, 1000.0])
def test_every_yo_to_the_target_is_a_dive_however_shallow(target_m):
    """Between the target and the upper turn at 10 m, or half of the target, and up at last."""
    top_m = min(10.0, 0.5 * target_m)
    yo = np.concatenate([np.linspace(top_m, target_m, 50), np.linspace(target_m, top_m, 50)])
    depth = np.concatenate([np.linspace(0.0, top_m, 5), *(4 * [yo]), np.linspace(top_m, 0.0, 5)])
    log = make_log(TICK_S * np.arange(len(depth)), depth=depth)
    assert score(log, target_m=target_m)['dives'] == 4


def test_end_of_the_path_is_told_from_where_the_vehicle_came_up():
    """By the first tick of the stage; what it drifts after that does not count."""
    t = ticks(100.0)
    log = make_log(t, north=np.where(t < 60.0, 3.0, -100.0), east=4.0, depth=0.5)
    path = WaypointPath(kind='waypoints', waypoints=[(-400.0, 0.0), (0.0, 0.0)]).params()
    log[:, COLUMNS['reference'].start + 1] = np.linspace(-400.0, -100.0, len(log))  # to the north
    told = score(log, path=path, ends=True, duration_s=70.0)
    assert told['end_of_path_m'] is None
    on_the_way = told['arrival']
    assert not on_the_way['arrived']
    assert on_the_way['t_s'] is None
    assert on_the_way['left_m'] == pytest.approx(100.0, abs=1e-6)
    assert on_the_way['eta_s'] == pytest.approx(len(log) * TICK_S / 0.75, rel=1e-6)
    assert on_the_way['overrun_s'] == pytest.approx(on_the_way['eta_s'] - 70.0, rel=1e-6)
    log[:, COLUMNS['ground_truth/odom'].start + 1] += 150.0  # beyond, and not at the surface
    past = score(log, path=path, ends=True)['arrival']
    assert (past['left_m'], past['eta_s']) == (0.0, pytest.approx(100.0, abs=0.2))
    far = score(log, path=path, ends=True, arrival_radius_m=40.0, glide_s=100.0)['arrival']
    pace_s = 100.0 / 450.0
    assert far['left_m'] == far['missed_m'] == pytest.approx(math.hypot(50.0, 4.0))
    assert far['eta_s'] == pytest.approx(100.0 + far['left_m'] * pace_s, abs=0.2)
    log[:, COLUMNS['ground_truth/odom'].start + 1] -= 150.0
    log[t > 50.0, COLUMNS['stage']] = AT_END_OF_PATH
    assert score(log, path=path, ends=False)['arrival'] is None
    told = score(log, path=path, ends=True)
    assert told['end_of_path_m'] == pytest.approx(5.0, abs=1e-9)
    arrival = told['arrival']
    assert arrival['arrived']
    assert arrival['t_s'] == pytest.approx(50.1, abs=1e-6)
    assert (arrival['left_m'], arrival['overrun_s'], arrival['place_latlon_deg']) == (0, 0, None)
    told = score(log, path=path, ends=True, arrival_radius_m=4.9, glide_s=100.0)
    assert told['arrival'] == {**arrival, 'arrived': False}
    assert told['end_of_path_m'] == pytest.approx(5.0, abs=1e-9)
    assert told['status'] == 'unfinished'
    assert told['reason'] == 'came up 5 m from the last point of its path'


@pytest.mark.parametrize(
    ('path', 'where', 'left_m'),
    [
        # there and back on one line, three quarters of it
        (
            WaypointPath(kind='waypoints', waypoints=[(0.0, 0.0), (200.0, 0.0), (0.0, 0.0)]),
            lambda way_m: (200.0 - abs(300.0 * way_m - 200.0), 0.0 * way_m),
            100.0,
        ),
        # two turns of three, from the south round by the west, level and steep: as on a chart
        *(
            (
                HelixPath(
                    kind='helix', radius_m=50.0, turns=3.0, course_deg=270.0, slope_deg=slope_deg
                ),
                lambda way_m: (
                    -50.0 * np.cos(4.0 * math.pi * way_m),
                    -50.0 * np.sin(4.0 * math.pi * way_m),
                ),
                100.0 * math.pi,
            )
            for slope_deg in (0.0, 60.0)
        ),
    ],
)
def test_way_that_is_left_of_a_path_that_comes_by_again(path, where, left_m):
    t = ticks(100.0)
    north, east = where(t / t[-1])
    log = make_log(t, north=north, east=east, target_n=north, target_e=east)
    told = score(log, path=path.params(), ends=True)['arrival']
    length_m = path.params().ways[-1]
    assert told['left_m'] == pytest.approx(left_m, abs=0.1)
    assert told['eta_s'] == pytest.approx(100.0 * length_m / (length_m - left_m), rel=1e-3)


def test_overshoot_is_what_is_beyond_the_target():
    t = ticks(100.0)
    depth = 1003.5 - np.abs(t - 50.0)
    assert score(make_log(t, depth=depth))['depth_m'] == {
        'max': pytest.approx(1003.5),
        'overshoot': pytest.approx(3.5),
    }
    assert score(make_log(t, depth=depth), target_m=1200.0)['depth_m']['overshoot'] == 0.0


@pytest.mark.parametrize(('begin_m', 'end_m'), [(0.0, 0.0), (0.0, -30.0), (-20.0, 0.0)])
def test_distance_is_the_way_along_the_path(begin_m, end_m):
    """Around a circle of 100 m: its circumference, not the distance from start to end.

    A vehicle that falls behind its target by 30 m has gone 30 m less; one that catches up, more.
    """
    t = ticks(1000.0)
    angle = 2.0 * math.pi * t / t[-1]
    north, east = 100.0 * np.cos(angle), 100.0 * np.sin(angle)
    off = begin_m + (end_m - begin_m) * t / t[-1]
    place = {'north': north - np.sin(angle) * off, 'east': east + np.cos(angle) * off}
    log = make_log(t, target_n=north, target_e=east, **place)
    along = score(log)['distance_along_path_m']
    # the course is told by a metre of the path, over which it turns
    assert along == pytest.approx(200.0 * math.pi + end_m - begin_m, abs=0.01)


def test_final_state_is_that_of_the_last_tick():
    log = make_log(ticks(10.0), north=3.0, east=4.0, depth=5.0, theta=-0.3, psi=2.0)
    log[-1, TRUTH][7:10] = 0.5, 0.02, -0.03
    final = score(log)['final_state']
    assert final['position_ned_m'] == pytest.approx([3.0, 4.0, 5.0], abs=1e-12)
    assert final['attitude_rpy_rad'] == pytest.approx([0.0, -0.3, 2.0], abs=1e-9)
    assert final['velocity_mps'] == pytest.approx([0.5, -0.02, 0.03], abs=1e-12)


@pytest.mark.parametrize(('share', 'infeasible'), [(0.4, False), (0.6, True)])
def test_run_is_infeasible_from_half_of_the_scored_time_on(share, infeasible):
    t = ticks(2000.0)
    flag = (t > 1000.0) & (t < 1000.0 + share * 1000.0)
    status = score(make_log(t, infeasible=flag), settle_s=1000.0)['status']
    assert status == ('infeasible' if infeasible else 'completed')


def reference_score(t, settle_s, depth, e2, theta, theta_ref, psi, rate_ref):
    """Cross track, pitch and heading once more, from the words that define them."""
    turns = t[1:][np.sign(rate_ref[1:]) != np.sign(rate_ref[:-1])]
    scored = t > settle_s + 1e-6
    steady = scored & (depth > 30.0)
    for turn in turns:
        steady &= np.abs(t - turn) > 600.0 + 1e-6
    x = np.unwrap(psi)
    mean = uniform_filter1d(x, 3001, mode='nearest')
    deviation = np.degrees(x - mean)
    pitch = np.degrees(theta - theta_ref)

    def rms(values):
        return np.sqrt(np.mean(np.square(values[steady])))

    return {
        'cross_track_m': {
            'rms_steady': rms(e2),
            'max_steady': np.abs(e2[steady]).max(),
            'max_all': np.abs(e2[scored]).max(),
            'max_run': np.abs(e2).max(),
        },
        'pitch_error_deg': {
            'rms_steady': rms(pitch),
            'max_steady': np.abs(pitch[steady]).max(),
        },
        'heading_fluctuation_deg': {
            'rms_steady': rms(deviation),
            'max_steady': np.abs(deviation[steady]).max(),
        },
    }


@pytest.mark.parametrize('seed', range(4))
def test_scores_agree_with_an_independent_implementation(seed):
    """A random sawtooth with coloured noise on everything; 1e-6 of each figure."""
    rng = np.random.default_rng(seed)
    t = ticks(12000.0)

    def rough(scale, seconds):
        return (
            scale
            * math.sqrt(seconds)
            * uniform_filter1d(rng.standard_normal(len(t)), round(seconds / TICK_S))
        )

    period = rng.uniform(3000.0, 5000.0)
    phase = (t / period) % 1.0
    depth = 400.0 * (1.0 - np.abs(2.0 * phase - 1.0)) + 20.0 + rough(1.0, 60.0)
    flight = {
        'depth': depth,
        'e2': rough(2.0, 100.0),
        'theta': -0.5 + rough(0.01, 20.0),
        'theta_ref': -0.5 + rough(0.01, 200.0),
        'psi': (math.pi + rough(0.1, 100.0)) % (2.0 * math.pi) - math.pi,
        'rate_ref': np.where(phase < 0.5, 0.25, -0.25),
    }
    settle_s = rng.uniform(0.0, 2000.0)
    # the ends of the log, where the mean's window is cut, are at the surface
    flight['depth'][(t < 200.0) | (t > 11800.0)] = 1.0
    found = score(make_log(t, **flight), settle_s)
    for group, figures in reference_score(t, settle_s, **flight).items():
        for name, figure in figures.items():
            assert found[group][name] == pytest.approx(figure, rel=1e-6), (group, name)


@quick
@given(st.lists(st.integers(1, 3000), max_size=6))
def test_score_does_not_depend_on_the_blocks(cuts):
    t = ticks(1000.0)
    depth = 80.0 * np.sin(t / 30.0) ** 2  # dives end and begin anywhere in a block
    log = make_log(t, e2=np.sin(t), psi=0.1 * np.sin(t / 7.0), depth=depth)
    scorer = Scorer(load_scenario())
    for block in np.split(log, sorted(cuts)):
        scorer.add(block)
    assert scorer.ticks == len(t)
    assert scorer.result(Rules()) == score(log)


def test_scorer_keeps_nothing_of_a_block_by_reference():
    """The direct engine uses its block again."""
    log = make_log(ticks(800.0), e2=1.0)
    scorer = Scorer(load_scenario())
    scorer.add(log)
    before = scorer.result(Rules())
    log[:] = 9.0
    assert scorer.result(Rules()) == before


def test_a_fix_that_navigation_does_not_read_is_not_scored(tmp_path):
    """Nor a current that it does not tell: the score is that from the bag, or over nodes."""
    changes = {'sensors.also_fitted': ['fix'], 'sensors.gps_first_fix_s': 5.0}
    changes |= {'profile.depth_m': 15.0, 'profile.surface_every_dives': 1, 'profile.wait_s': 60.0}
    changes |= {'profile.prepare_s': 0.0, 'current.speed_kn': 0.1}
    run = glider_bringup.fly('current_8deg', changes, duration=700, out=tmp_path / 'run', bag=True)
    fixed = np.isfinite(run.to_xarray()['fix_latitude'].to_numpy())
    told = run.score['navigation']
    assert told['surfacings'] >= 2 and np.count_nonzero(np.diff(fixed.astype(int)) == 1) >= 2
    assert (told['fixed'], told['dac_error_mps']['rms']) == (0, None)
    assert score_again(tmp_path / 'run') == run.score


def test_a_current_that_a_method_does_not_tell_is_not_scored(tmp_path, monkeypatch):
    """As of a method of one's own that keeps what it estimates to itself."""
    monkeypatch.setattr(METHODS['dead_reckoned'], 'tells', ())
    changes = {'profile.depth_m': 15.0, 'profile.surface_every_dives': 1, 'profile.wait_s': 60.0}
    changes |= {'profile.prepare_s': 0.0, 'current.speed_kn': 0.1, 'sensors.gps_first_fix_s': 5.0}
    changes |= {'navigation.method': 'dead_reckoned'}
    run = glider_bringup.fly('current_8deg', changes, duration=700, out=tmp_path / 'run', bag=True)
    told = run.score['navigation']
    assert told['fixed'] >= 2 and told['dac_error_mps']['rms'] is None
    assert score_again(tmp_path / 'run') == run.score
