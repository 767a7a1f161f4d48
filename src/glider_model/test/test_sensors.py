# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Sensors: size and independence of noise, and that it can be taken off; errors that stay."""

import math

import numpy as np
import pydantic
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from glider_base.frames import (
    NO_RATES,
    OriginSettings,
    euler_from_quaternion,
    from_geodetic,
    odometry_to_wire,
    quaternion_from_euler,
)
from glider_base.kernel import kernel
from glider_base.signals import TICK_S, Joints, Odometry
from glider_base.wiring import PLANT
from glider_model.ocean.density import depth_at
from glider_model.plant.block import plant_move, plant_outputs
from glider_model.plant.plant import PlantSettings, plant_odometry
from glider_model.plant.sensors import (
    HAS_FIX,
    NO_FIX,
    NO_SAMPLE,
    SensorSettings,
    add_noise,
    is_noisy,
    noise_of_tick,
    sense,
    take_sample,
)

quick = settings(max_examples=100)

NOISE = {
    'attitude_std_deg': 0.2,
    'heading_std_deg': 0.5,
    'rate_std_dps': 0.1,
    'position_std_m': 1.0,
}
COUNT = 100_000
#: Sensors of a vehicle that navigates by itself.
PARTS = ['imu', 'pressure', 'fix']
UNDER_WATER = {'depth_m': 20.0, 'pitch_deg': -20.0, 'speed_mps': 0.4, 'heading_deg': 50.0}
ORIGIN = OriginSettings(latitude_deg=60.0, longitude_deg=179.99)
#: Places among the numbers of the plant.
MEASURED, IMU, FIX = (PLANT.outputs.index(name) - 1 for name in ('measured_odom', 'imu', 'fix'))
angles = st.floats(-math.pi, math.pi)
seeds = st.integers(0, 2**63 - 1)
ticks = st.integers(0, 10**9)


def odometry(phi=0.0, theta=-0.5, psi=1.0, position=(4000.0, -300.0, 500.0)):
    attitude = quaternion_from_euler(phi, theta, psi)
    return Odometry(*position, *attitude, 0.8, -0.1, 0.05, 0.01, -0.02, 0.03)


@kernel
def series(params, count):
    """Noise of ticks 0 to ``count``: float64[count, 9]."""
    rows = np.empty((count, 9))
    for tick in range(count):
        for column, number in enumerate(noise_of_tick(tick, params)):
            rows[tick, column] = number
    return rows


@pytest.fixture(scope='module')
def noise():
    return series(SensorSettings(**NOISE).params(seed=7), COUNT)


def test_each_number_has_its_standard_deviation_and_no_mean(noise):
    expected = np.repeat(
        [1.0, math.radians(0.2), math.radians(0.5), math.radians(0.1)], [3, 2, 1, 3]
    )
    np.testing.assert_allclose(noise.std(axis=0), expected, rtol=4.0 / math.sqrt(COUNT))
    assert np.all(np.abs(noise.mean(axis=0)) < 4.0 * expected / math.sqrt(COUNT))


def test_numbers_are_independent_of_each_other_and_from_tick_to_tick(noise):
    correlations = np.corrcoef(np.vstack([noise[:-1].T, noise[1:].T]))
    assert np.max(np.abs(correlations - np.eye(18))) < 5.0 / math.sqrt(COUNT)


@quick
@given(seeds, ticks)
def test_no_noise_is_the_very_same_numbers(seed, tick):
    params = SensorSettings().params(seed)
    assert not is_noisy(params)
    assert add_noise(odometry(), tick, params) == odometry()


@pytest.mark.parametrize('name', NOISE)
def test_each_kind_of_noise_alone_is_noise(name):
    params = SensorSettings(**{name: NOISE[name]}).params(0)
    assert is_noisy(params)
    assert add_noise(odometry(), 3, params) != odometry()


@quick
@given(seeds, ticks)
def test_a_measurement_is_a_function_of_seed_and_tick(seed, tick):
    one, two = (SensorSettings(**NOISE).params(seed) for _ in range(2))
    assert add_noise(odometry(), tick, one) == add_noise(odometry(), tick, two)
    other = SensorSettings(**NOISE).params((seed + 1) % 2**63)
    assert add_noise(odometry(), tick, other) != add_noise(odometry(), tick, one)
    assert add_noise(odometry(), tick + 1, one) != add_noise(odometry(), tick, one)


@quick
@given(seeds, st.floats(-0.6, 0.6), st.floats(-1.2, 1.2), angles)
def test_noise_of_heading_turns_about_the_vertical(seed, phi, theta, psi):
    params = SensorSettings(heading_std_deg=0.5).params(seed)
    measured = euler_from_quaternion(*add_noise(odometry(phi, theta, psi), 9, params)[3:7])
    expected = psi + noise_of_tick(9, params).psi
    assert measured[:2] == pytest.approx((phi, theta), abs=1e-12)
    assert math.cos(measured[2] - expected) == pytest.approx(1.0, abs=1e-14)


def test_noise_of_roll_and_pitch_adds_to_roll_and_pitch():
    """In wings-level flight, to first order."""
    params = SensorSettings(attitude_std_deg=0.2).params(1)
    for tick in range(20):
        noise = noise_of_tick(tick, params)
        phi, theta, psi = euler_from_quaternion(*add_noise(odometry(), tick, params)[3:7])
        assert theta == pytest.approx(-0.5 + noise.theta, abs=1e-4)
        assert phi == pytest.approx(noise.phi, abs=1e-4)
        assert psi == pytest.approx(1.0, abs=1e-4)


def test_velocity_over_ground_keeps_its_numbers_in_body_axes():
    measured = add_noise(odometry(), 5, SensorSettings(**NOISE).params(0))
    assert measured[7:10] == odometry()[7:10]


def test_attitude_stays_a_unit_quaternion():
    params = SensorSettings(attitude_std_deg=10.0, heading_std_deg=45.0).params(0)
    for tick in range(100):
        assert np.linalg.norm(add_noise(odometry(), tick, params)[3:7]) == pytest.approx(
            1.0, abs=1e-15
        )


def said(state, params):
    """What the plant says of a tick, by topic."""
    outputs, _ = plant_outputs(state, params)
    return dict(zip(PLANT.outputs[1:], outputs, strict=True))


def test_plant_measures_with_the_noise_of_its_tick_and_seed():
    given = PlantSettings(sensors=NOISE, seed=4)
    state = given.initial_state()._replace(tick=17)
    expected = add_noise(plant_odometry(state), 17, SensorSettings(**NOISE).params(4))
    told = said(state, given.params())
    assert told['measured_odom'] == odometry_to_wire(expected)
    assert told['joint_states'] == state.joints


@pytest.mark.parametrize('sensors', [{}, NOISE, {'compass_bias_deg': 9.0, 'imu_period_s': 3.0}])
@pytest.mark.parametrize('fitted', [['measured_odom'], PARTS])
def test_plant_tells_the_truth_whatever_it_measures(sensors, fitted):
    given = PlantSettings(sensors=sensors, initial=UNDER_WATER, fitted=fitted)
    state = given.initial_state()._replace(tick=5)
    told = said(state, given.params())
    assert told['ground_truth/odom'] == odometry_to_wire(plant_odometry(state))


def test_plant_without_noise_measures_its_odometry():
    given = PlantSettings(initial=UNDER_WATER)
    state = given.initial_state()
    assert said(state, given.params())['measured_odom'] == odometry_to_wire(plant_odometry(state))


def test_only_what_is_fitted_measures():
    for fitted, silent in ((['measured_odom'], PARTS), (PARTS, ['measured_odom'])):
        given = PlantSettings(initial=UNDER_WATER, fitted=fitted)
        told = said(given.initial_state(), given.params())
        assert all(any(told[name]) for name in fitted), fitted
        for name in silent:
            assert not any(x for x in told[name] if x != NO_FIX), name


# ---------------------------------------------------------------------- errors that stay


def test_parts_without_errors_measure_what_is_true():
    given = PlantSettings(initial=UNDER_WATER, fitted=PARTS)
    state = given.initial_state()
    told, true = said(state, given.params()), odometry_to_wire(plant_odometry(state))
    assert told['imu'] == (*true[3:7], *true[10:], 0.0)
    assert depth_at(*told['pressure']) == pytest.approx(20.0, abs=1e-9)
    assert told['fix'][0] == NO_FIX


def measured_angles(phi_deg, theta_deg, psi_deg, **errors):
    """Roll, pitch and heading (deg) as the compass shows them."""
    params = SensorSettings(**errors).params(0)
    sample = take_sample(
        odometry(*np.radians([phi_deg, theta_deg, psi_deg])), math.inf, NO_SAMPLE, 0, params
    )
    return np.degrees(euler_from_quaternion(*sample[:4]))


def turned_deg(one, other):
    """Differences of angles, the short way (deg)."""
    return (np.asarray(one) - np.asarray(other) + 180.0) % 360.0 - 180.0


@quick
@given(st.floats(-40.0, 40.0), st.floats(-60.0, 60.0), st.floats(-180.0, 180.0))
def test_errors_of_the_compass_stay(phi_deg, theta_deg, psi_deg):
    true = (phi_deg, theta_deg, psi_deg)
    errors = {
        'compass_bias_deg': -3.0,
        'compass_deviation_deg': 5.0,
        'compass_deviation_phase_deg': 30.0,
        'pitch_scale': 1.1,
        'pitch_offset_deg': -2.0,
        'roll_bias_deg': 4.0,
    }
    deviation = 5.0 * math.sin(math.radians(psi_deg + 30.0))
    expected = (phi_deg + 4.0, 1.1 * theta_deg - 2.0, psi_deg - 3.0 + deviation)
    assert turned_deg(measured_angles(*true, **errors), expected) == pytest.approx(0.0, abs=1e-9)
    for name, value in errors.items():
        alone = measured_angles(*true, **{name: value})
        off = {
            'compass_bias_deg': (0.0, 0.0, -3.0),
            'compass_deviation_deg': (0.0, 0.0, 5.0 * math.sin(math.radians(psi_deg))),
            'compass_deviation_phase_deg': (0.0, 0.0, 0.0),
            'pitch_scale': (0.0, 0.1 * theta_deg, 0.0),
            'pitch_offset_deg': (0.0, -2.0, 0.0),
            'roll_bias_deg': (4.0, 0.0, 0.0),
        }[name]
        assert turned_deg(alone, true) == pytest.approx(off, abs=1e-9), name


@quick
@given(st.floats(-1.0, 1200.0), st.sampled_from([0.0, 0.1, 0.5, 2.0]), st.floats(-5.0, 5.0))
def test_depth_has_its_offset_and_comes_in_steps(depth_m, step_m, offset_m):
    params = SensorSettings(depth_offset_m=offset_m, depth_resolution_m=step_m).params(0)
    measured = odometry(position=(0.0, 0.0, depth_m))
    shown = take_sample(measured, math.inf, NO_SAMPLE, 0, params).p_d
    assert abs(shown - depth_m - offset_m) <= 0.5 * step_m + 1e-9
    if step_m:
        assert shown / step_m == pytest.approx(round(shown / step_m), abs=1e-9)


@quick
@given(st.floats(-180.0, 180.0), st.floats(-30.0, 30.0), st.floats(-5.0, 5.0))
def test_a_wrong_chart_turns_the_heading_and_magnetic_north_the_deviation(psi, true, wrong):
    """The compass goes by magnetic north, and what the chart has of it is added."""
    deviates = {'compass_deviation_deg': 4.0, 'declination_deg': true}
    magnetic = psi - true
    reading = magnetic + 4.0 * math.sin(math.radians(magnetic))
    for charted, expected in ((None, reading + true), (true + wrong, reading + true + wrong)):
        _, _, shown = measured_angles(0.0, 0.0, psi, chart_declination_deg=charted, **deviates)
        assert turned_deg(shown, expected) == pytest.approx(0.0, abs=1e-9)
    _, _, shown = measured_angles(0.0, 0.0, psi, declination_deg=true)
    assert turned_deg(shown, psi) == pytest.approx(0.0, abs=1e-9)


def heights(depths, bottom_m=200.0, **sensors):
    """What the altimeter shows at depths (m), a tick each."""
    given = PlantSettings(fitted=['altitude'], sensors=sensors, water={'bottom_m': bottom_m})
    state, params, found = given.initial_state(), given.params(), []
    for depth in depths:
        state = state._replace(motion=state.motion._replace(p_d=depth))
        found.append(said(state, params)['altitude'][0])
        state = plant_move(state, (4 * (0.0,), 3 * (0.0,), (0.0,)), params, TICK_S)
    return np.array(found)


def test_altimeter_hears_the_bottom_within_its_reach():
    depths = [0.0, 99.9, 100.5, 150.25, 199.4, 199.6, 200.0, 210.0]
    shown = heights(depths, altimeter_period_s=0.1)
    assert shown == pytest.approx([0.0, 0.0, 99.5, 49.75, 0.6, 0.0, 0.0, 0.0], abs=1e-5)
    assert np.array_equal(shown, shown.astype(np.float32))
    assert not heights(depths, bottom_m=0.0, altimeter_period_s=0.1).any()


def test_altimeter_shows_its_echo_until_the_next():
    shown = heights(150.0 + 0.1 * np.arange(40), altimeter_period_s=1.0)
    assert shown == pytest.approx(np.repeat(50.0 - np.arange(4.0), 10), abs=1e-5)


def test_noise_of_the_altimeter_is_that_of_its_seed():
    shown = heights(np.full(4000, 150.0), altimeter_period_s=0.1, altimeter_std_m=0.5)
    assert np.std(shown) == pytest.approx(0.5, rel=0.05)
    assert np.mean(shown) == pytest.approx(50.0, abs=0.05)
    again = heights(np.full(50, 150.0), altimeter_period_s=0.1, altimeter_std_m=0.5)
    assert np.array_equal(shown[:50], again)


def test_without_a_gyro_there_are_no_rates():
    truth, joints = odometry(), Joints(0.0, 0.0, 0.0, 0.0)
    for gyro, rates in ((True, (0.01, 0.02, -0.03, 0.0)), (False, (0.0, 0.0, 0.0, NO_RATES))):
        params = SensorSettings(gyro=gyro).params(0)
        told = sense(truth, math.inf, joints, NO_SAMPLE, 0, 0, 0, params)
        assert told[IMU][4:] == pytest.approx(rates, abs=1e-15)
        assert told[MEASURED][10:] == pytest.approx(rates[:3], abs=1e-15)


# ---------------------------------------------------------------------- samples


def shown(count, **sensors):
    """What the plant shows in ``count`` ticks of a glide, by topic: float64[count, n]."""
    given = PlantSettings(initial=UNDER_WATER, fitted=[*PARTS, 'measured_odom'], sensors=sensors)
    state, params = given.initial_state(), given.params()
    rows = {name: [] for name in PLANT.outputs[1:]}
    for tick in range(count):
        for name, numbers in said(state, params).items():
            rows[name].append(numbers)
        pump = 0.4 * math.sin(0.05 * tick)
        state = plant_move(
            state, ((pump, 0.01, 0.1, 0.0), (0.1, 0.0, 0.0), (0.0,)), params, TICK_S
        )
    return {name: np.array(numbers) for name, numbers in rows.items()}


@pytest.mark.parametrize('period_s', [0.1, 0.5, 4.0])
def test_a_sample_is_shown_until_the_next(period_s):
    """Attitude, rates, depth; the horizontal position and the velocity are measured always."""
    noise = {'attitude_std_deg': 0.2, 'position_std_m': 1.0}
    every, held = shown(100, **noise), shown(100, **noise, imu_period_s=period_s)
    last = np.arange(100) // round(period_s / TICK_S) * round(period_s / TICK_S)
    for name in ('imu', 'pressure'):
        assert len(np.unique(every[name], axis=0)) == 100, 'something is to be held'
        assert np.array_equal(held[name], every[name][last]), name
    columns = [2, *range(3, 7), *range(10, 13)]
    one, other = held['measured_odom'], every['measured_odom']
    assert np.array_equal(one[:, columns], other[last][:, columns])
    assert np.array_equal(np.delete(one, columns, 1), np.delete(other, columns, 1))
    assert np.array_equal(held['ground_truth/odom'], every['ground_truth/odom'])


def test_some_samples_drop_out():
    every, some = shown(2000), shown(2000, imu_missed_share=0.3)
    assert np.array_equal(some['imu'][0], every['imu'][0])
    is_new = np.all(some['imu'] == every['imu'], axis=1)
    assert np.mean(~is_new) == pytest.approx(0.3, abs=0.04)
    before = np.flatnonzero(~is_new) - 1
    assert np.array_equal(some['imu'][before + 1], some['imu'][before])


# ---------------------------------------------------------------------- fixes

TEN_S = round(10.0 / TICK_S)


def fix_of(depth_m, surfaced_ticks, dives=1, tick=0, seed=0, **sensors):
    """Numbers of a fix 4000 m north and 300 m west of the origin."""
    params = SensorSettings(gps_first_fix_s=10.0, **sensors).params(seed, ORIGIN, ('fix',))
    truth = odometry(position=(4000.0, -300.0, depth_m))
    return sense(
        *(truth, math.inf, Joints(0.0, 0.0, 0.0, 0.0), NO_SAMPLE),
        *(surfaced_ticks, dives, tick, params),
    )[FIX]


@pytest.mark.parametrize(
    ('depth_m', 'surfaced_ticks', 'has_fix'),
    [
        (0.1, 0, False),
        (0.1, TEN_S - 1, False),
        (0.1, TEN_S, True),
        (-0.2, 100 * TEN_S, True),
        (0.49, TEN_S, True),
        (0.51, 100 * TEN_S, False),
        (20.0, 100 * TEN_S, False),
    ],
)
def test_a_fix_needs_the_antenna_out_and_its_time(depth_m, surfaced_ticks, has_fix):
    status, *place = fix_of(depth_m, surfaced_ticks)
    assert status == (HAS_FIX if has_fix else NO_FIX)
    assert any(place) == has_fix


def test_a_fix_is_where_the_vehicle_is():
    _, latitude, longitude, *variances = fix_of(0.1, TEN_S, gps_std_m=0.0)
    place = from_geodetic(latitude, longitude, ORIGIN.params())
    assert place == pytest.approx((4000.0, -300.0), abs=1e-6)
    assert variances == [0.0, 0.0]


def test_the_error_of_fixes_is_as_told_and_stays_for_a_minute():
    places = [
        from_geodetic(*fix_of(0.1, TEN_S, tick=tick, gps_std_m=4.0)[1:3], ORIGIN.params())
        for tick in range(0, 600 * 600, 300)
    ]
    off = np.array(places) - (4000.0, -300.0)
    assert np.array_equal(off[::2], off[1::2])
    assert off.std(axis=0) == pytest.approx(4.0, rel=0.12)
    assert np.abs(off.mean(axis=0)) == pytest.approx(0.0, abs=0.6)
    assert fix_of(0.1, TEN_S, gps_std_m=4.0)[3:] == (16.0, 16.0)


@pytest.mark.parametrize('pattern', ['0', '1', '01', '110', '00001'])
def test_surfacings_without_a_fix_follow_their_pattern(pattern):
    found = [fix_of(0.1, TEN_S, n, fix_missed_pattern=pattern)[0] for n in range(15)]
    expected = [NO_FIX if pattern[n % len(pattern)] == '1' else HAS_FIX for n in range(15)]
    assert found == expected


@pytest.mark.parametrize(('pattern', 'missed'), [('01', {1, 3}), ('100', {0, 3}), ('0', set())])
def test_each_time_at_the_surface_is_one_surfacing(pattern, missed):
    """However deep it has been, and however it bobs: up and down by hand, a tick at each depth."""
    sensors = {'gps_first_fix_s': 2.0, 'fix_missed_pattern': pattern}
    given = PlantSettings(fitted=PARTS, sensors=sensors, initial={'depth_m': 0.1})
    state, params = given.initial_state(), given.params()
    stay = [0.1] * 30 + [0.6] + [0.2] * 10 + [1.2, 2.0, 0.1] + [0.1] * 30
    dive = [1.0, 4.0, 20.0, 200.0, 2.0, 1.6, 1.4, 0.6]
    found = []
    for depth in 4 * [*stay, *dive]:
        motion = state.motion._replace(p_d=depth, u=0.0, w=0.0)
        state = state._replace(motion=motion)
        found.append(said(state, params)['fix'][0] == HAS_FIX)
        state = plant_move(state, (4 * (0.0,), 3 * (0.0,), (0.0,)), params, TICK_S)
    expected = [*range(20, 30), *range(63, len(stay))]
    for number, has in enumerate(np.split(np.array(found), 4)):
        assert np.flatnonzero(has).tolist() == ([] if number in missed else expected), number


def test_surfacings_without_a_fix_are_drawn_by_their_share():
    """A surfacing has fixes, or has none, from its first tick to its last."""
    found = [fix_of(0.1, TEN_S, n, fix_missed_share=0.25)[0] for n in range(2000)]
    later = [fix_of(0.1, 9 * TEN_S, n, 777, fix_missed_share=0.25)[0] for n in range(2000)]
    assert found == later
    assert np.mean(np.array(found) == NO_FIX) == pytest.approx(0.25, abs=0.04)


@pytest.mark.parametrize('name', NOISE)
@pytest.mark.parametrize('value', [-0.1, 1e9, math.nan])
def test_impossible_noise_is_refused(name, value):
    with pytest.raises(pydantic.ValidationError, match=name):
        SensorSettings(**{name: value})
