# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What breaks in a vehicle: what faults do to the plant and to what it tells, and when."""

import math

import numpy as np
import pydantic
import pytest

from glider_base.frames import euler_from_quaternion, odometry_from_wire
from glider_base.signals import TICK_S, Battery, Health, Joints
from glider_base.wiring import PLANT
from glider_model.ocean.density import depth_at
from glider_model.plant.block import plant_move, plant_outputs
from glider_model.plant.faults.kinds import NoFaults, NoFaultState
from glider_model.plant.faults.sensing import with_faults
from glider_model.plant.faults.settings import ACTUATORS
from glider_model.plant.plant import PlantSettings
from glider_model.plant.sensors import HAS_FIX, NO_FIX

STILL = (0.0, 0.0, 0.0)
DIVING = Joints(0.5, 0.02, 0.0, 0.0)
PARTS = ['imu', 'pressure', 'fix']


class Flown:
    """A plant that obeys one command for a while, tick by tick.

    Attributes
    ----------
    states : list of PlantState
    """

    def __init__(
        self, faults, seconds, command=DIVING, fitted=('measured_odom',), seed=0, **start
    ):
        settings = PlantSettings(
            faults=faults,
            fitted=list(fitted),
            seed=seed,
            initial={'depth_m': 100.0, 'speed_mps': 0.3, 'net_heaviness_kg': 0.5, **start},
        )
        self.params, state = settings.params(), settings.initial_state()
        self.states, self.told = [], []
        for _ in range(round(seconds / TICK_S)):
            self.states.append(state)
            self.told.append(plant_outputs(state, self.params)[0])
            state = plant_move(state, (tuple(command), STILL, (0.0,)), self.params, TICK_S)

    def topic(self, name):
        """Numbers of a topic, float64[ticks, n]."""
        place = PLANT.outputs.index(name) - 1
        return np.array([numbers[place] for numbers in self.told])

    def joint(self, i):
        return self.topic('joint_states')[:, i]

    def angles(self, name='measured_odom', first=3):
        """Roll, pitch and heading that are shown (rad), float64[ticks, 3]."""
        rows = self.topic(name)
        wires = np.zeros((len(rows), 13))
        wires[:, 3:7] = rows[:, first : first + 4]
        found = []
        for wire in wires:
            x = odometry_from_wire(tuple(wire))
            found.append(euler_from_quaternion(x.q_w, x.q_x, x.q_y, x.q_z))
        return np.array(found)

    @property
    def depth(self):
        return -self.topic('ground_truth/odom')[:, 2]


def fault(kind, **fields):
    return {'kind': kind, **fields}


# ---------------------------------------------------------------------- when


def first_change(faulty, clean, topic='measured_odom'):
    """Time (s) of the first tick at which two flights tell something else."""
    differ = np.any(faulty.topic(topic) != clean.topic(topic), axis=1)
    return np.flatnonzero(differ)[0] * TICK_S if differ.any() else None


def test_nothing_of_faults_is_in_a_plant_without_any():
    settings = PlantSettings()
    assert isinstance(settings.params().faults, NoFaults)
    assert isinstance(settings.initial_state().faults, NoFaultState)


def test_before_it_begins_a_fault_changes_no_bit():
    clean = Flown([], 10.0)
    faulty = Flown([fault('biased', sensor='heading', error=5.0, at_s=7.0)], 10.0)
    assert first_change(faulty, clean) == pytest.approx(7.0, abs=1e-9)
    assert faulty.states[-1].motion == clean.states[-1].motion


def test_a_fault_waits_for_a_depth_a_phase_and_a_time_and_ends():
    clean = Flown([], 60.0)
    at = dict(sensor='depth', error=3.0)
    deep = clean.depth[300]
    by_depth = Flown([fault('biased', at_depth_m=deep, **at)], 60.0)
    assert first_change(by_depth, clean) == pytest.approx(30.0, abs=1e-9)
    in_climb = Flown([fault('biased', phase='climb', **at)], 60.0)
    assert first_change(in_climb, clean) is None
    later = Flown([fault('biased', phase='dive', at_s=40.0, for_s=5.0, **at)], 60.0)
    off = clean.topic('measured_odom')[:, 2] - later.topic('measured_odom')[:, 2]
    assert np.flatnonzero(off > 1.0) == pytest.approx(np.arange(400, 450))
    assert off[400:450] == pytest.approx(3.0, abs=1e-9)


def test_in_a_climb_a_fault_waits_for_a_depth_from_below():
    up = Joints(-1.0, -0.02, 0.0, 0.0)
    start = {'net_heaviness_kg': -1.0, 'pitch_deg': 30.0}
    clean = Flown([], 60.0, up, **start)
    given = fault('biased', sensor='depth', error=3.0, phase='climb', at_depth_m=95.0)
    faulty = Flown([given], 60.0, up, **start)
    begins = round(first_change(faulty, clean) / TICK_S)
    assert clean.depth[begins] <= 95.0 < clean.depth[begins - 1]


def test_random_faults_are_those_of_their_seed():
    given = [fault('noisier', sensor='rates', std=1.0)]
    one, again, other = (Flown(given, 5.0, seed=seed).topic('measured_odom') for seed in (1, 1, 2))
    assert np.array_equal(one, again)
    assert np.all(one[:, 10:] != other[:, 10:])


# ---------------------------------------------------------------------- in the water


def test_a_leak_makes_the_vehicle_heavier_and_is_noticed():
    clean = Flown([], 60.0)
    leaking = Flown([fault('leak', rate_kgps=0.01, at_s=10.0)], 60.0)
    assert leaking.depth[-1] > clean.depth[-1] + 0.5
    leak = leaking.topic('health')[:, Health._fields.index('leak')]
    assert np.flatnonzero(leak)[0] * TICK_S == pytest.approx(11.0, abs=0.11)
    unseen = Flown([fault('leak', rate_kgps=0.01, at_s=10.0, detected=False)], 60.0)
    assert not unseen.topic('health')[:, 0].any()
    assert np.array_equal(unseen.depth, leaking.depth)


def test_a_leak_takes_in_no_more_than_its_limit_and_keeps_what_it_has():
    mass = Flown([fault('mass', mass_kg=0.3)], 30.0)
    limited = Flown([fault('leak', rate_kgps=10.0, limit_kg=0.3)], 30.0)
    ended = Flown([fault('leak', rate_kgps=3.0, for_s=0.1)], 30.0)
    assert limited.depth[-1] == pytest.approx(mass.depth[-1], abs=0.02)
    assert ended.depth[-1] == pytest.approx(mass.depth[-1], abs=0.02)


def test_fouling_slows_the_vehicle():
    speeds = [
        np.linalg.norm(flown.topic('ground_truth/odom')[-1, 7:10])
        for flown in (Flown([], 200.0), Flown([fault('fouling', drag=2.0)], 200.0))
    ]
    assert speeds[1] < 0.85 * speeds[0]


def test_a_gust_carries_the_vehicle_along_and_passes():
    gust = fault('gust', east_mps=0.5, at_s=10.0, over_s=10.0, for_s=40.0)
    clean, blown = Flown([], 100.0), Flown([gust], 100.0)
    east = np.diff(blown.topic('ground_truth/odom')[:, 0]) / TICK_S
    assert east[80] == pytest.approx(np.diff(clean.topic('ground_truth/odom')[:2, 0])[0], abs=0.01)
    assert np.max(east) > 0.3
    assert blown.states[350].water.v_e == pytest.approx(0.5, abs=1e-12)
    assert blown.states[-1].water.v_e == 0.0


def test_a_loose_roll_mass_does_not_roll_the_vehicle():
    rolled = Joints(0.5, 0.02, 0.6, 0.0)
    sound, loose = Flown([], 60.0, rolled), Flown([fault('loose_roll_mass')], 60.0, rolled)
    assert abs(sound.angles()[-1, 0]) > math.radians(5.0)
    assert abs(loose.angles()[-1, 0]) < math.radians(1.0)
    assert np.array_equal(loose.joint(2), sound.joint(2))


# ---------------------------------------------------------------------- actuators


@pytest.mark.parametrize('which', [0, 1, 2])
def test_a_stuck_actuator_stays_where_it_is_and_comes_free(which):
    away = Joints(-1.0, -0.03, -0.6, 0.0)
    given = fault('stuck', actuator=ACTUATORS[which], at_s=1.0, for_s=3.0)
    sound, stuck = Flown([], 6.0, away), Flown([given], 6.0, away)
    assert np.all(stuck.joint(which)[10:41] == stuck.joint(which)[10])
    assert stuck.joint(which)[50] == pytest.approx(sound.joint(which)[20], abs=1e-12)
    for other in {0, 1, 2} - {which}:
        assert np.array_equal(stuck.joint(other), sound.joint(other))


def test_a_slow_actuator_takes_longer():
    given = fault('slow', actuator='roll_mass', rate=0.25)
    far = Joints(0.5, 0.0, 0.7, 0.0)
    sound, slow = Flown([], 4.0, far), Flown([given], 4.0, far)
    assert slow.joint(2)[4] == pytest.approx(0.25 * sound.joint(2)[4], rel=1e-12)


def test_an_actuator_with_a_part_of_its_range_goes_no_farther():
    given = fault('partial', actuator='buoyancy_engine', low=-0.2, high=0.6)
    flown = Flown([given], 200.0, Joints(-1.0, 0.0, 0.0, 0.0))
    assert np.min(flown.joint(0)) == pytest.approx(-0.2 * flown.params.vehicle.m_b_max)


def test_a_jam_comes_and_goes():
    given = fault('jam', actuator='roll_mass', period_s=1.0, share=0.5)
    moves = np.diff(Flown([given], 3.0, Joints(0.5, 0.0, 2.0, 0.0)).joint(2)) != 0.0
    assert moves[:20].tolist() == 2 * (5 * [False] + 5 * [True])


def test_an_actuator_with_an_offset_is_not_where_it_says():
    given = fault('offset', actuator='roll_mass', offset=0.2)
    level = Joints(0.5, 0.02, 0.0, 0.0)
    flown = Flown([given], 60.0, level)
    rolled = Flown([], 60.0, level._replace(mu=0.2 * flown.params.vehicle.mu_max))
    assert not flown.joint(2).any()
    assert flown.angles()[-1, 0] == pytest.approx(rolled.angles()[-1, 0], abs=math.radians(0.2))


# ---------------------------------------------------------------------- sensors


def test_a_frozen_sensor_shows_the_last_number_and_all_others_go_on():
    clean = Flown([], 10.0, fitted=['measured_odom', *PARTS])
    given = fault('frozen', sensor='depth', at_s=4.0, for_s=3.0)
    frozen = Flown([given], 10.0, fitted=['measured_odom', *PARTS])
    depth, pressure = -frozen.topic('measured_odom')[:, 2], frozen.topic('pressure')[:, 0]
    assert np.all(depth[39:70] == depth[39])
    assert depth_at(pressure[50]) == pytest.approx(depth[39], abs=1e-9)
    others = [i for i in range(13) if i != 2]
    assert np.array_equal(
        frozen.topic('measured_odom')[:, others], clean.topic('measured_odom')[:, others]
    )
    assert np.array_equal(frozen.topic('measured_odom')[70:], clean.topic('measured_odom')[70:])


@pytest.mark.parametrize('fitted', [['measured_odom'], PARTS])
def test_a_biased_heading_is_off_by_so_much_and_tilt_is_right(fitted):
    clean = Flown([], 1.0, fitted=fitted, heading_deg=40.0, pitch_deg=-20.0)
    given = fault('biased', sensor='heading', error=12.0)
    biased = Flown([given], 1.0, fitted=fitted, heading_deg=40.0, pitch_deg=-20.0)
    name, first = ('measured_odom', 3) if 'measured_odom' in fitted else ('imu', 0)
    off = np.degrees(biased.angles(name, first) - clean.angles(name, first))
    assert off == pytest.approx(np.tile([0.0, 0.0, 12.0], (10, 1)), abs=1e-9)


@pytest.mark.parametrize(('heading', 'error'), [(0.0, 0.0), (90.0, 8.0), (-90.0, -8.0)])
def test_deviation_of_a_compass_goes_as_the_sine_of_the_heading(heading, error):
    given = fault('compass', deviation_deg=8.0)
    clean, off = (Flown(one, 0.2, heading_deg=heading) for one in ([], [given]))
    shown = math.degrees(off.angles()[0, 2] - clean.angles()[0, 2])
    assert shown == pytest.approx(error, abs=1e-9)


def test_spikes_come_as_often_as_was_asked_for_and_of_either_sign():
    spiky = Flown([fault('spike', sensor='depth', error=50.0, share=0.2)], 100.0)
    off = -spiky.topic('measured_odom')[:, 2] - spiky.depth
    assert np.mean(np.abs(off) > 25.0) == pytest.approx(0.2, abs=0.05)
    assert {round(x) for x in off} == {-50, 0, 50}


def test_samples_that_drop_out_are_those_of_before():
    flown = Flown([fault('dropout', sensor='position', share=0.4)], 100.0)
    north = flown.topic('measured_odom')[:, 1]
    assert np.mean(np.diff(north) == 0.0) == pytest.approx(0.4, abs=0.06)
    assert np.all(np.isin(north[1:], flown.topic('ground_truth/odom')[:, 1]))


def test_noise_has_the_deviation_that_was_asked_for():
    flown = Flown([fault('noisier', sensor='rates', std=2.0)], 100.0)
    noise = flown.topic('measured_odom')[:, 10:] - flown.topic('ground_truth/odom')[:, 10:]
    assert np.degrees(np.std(noise, axis=0)) == pytest.approx(3 * [2.0], rel=0.1)
    assert np.abs(np.corrcoef(noise.T)[np.triu_indices(3, 1)]).max() < 0.15


def test_fixes_can_be_off_and_absent():
    afloat = {'depth_m': 0.1, 'net_heaviness_kg': -1.0, 'speed_mps': 0.0}
    still, parts = Joints(-1.0, 0.0, 0.0, 0.0), [*PARTS]
    clean = Flown([], 70.0, still, parts, **afloat).topic('fix')
    silent = Flown([fault('gps_silent')], 70.0, still, parts, **afloat).topic('fix')
    off = Flown([fault('biased', sensor='fix', error=1000.0)], 70.0, still, parts, **afloat)
    assert clean[-1, 0] == HAS_FIX
    assert np.all(silent[:, 0] == NO_FIX)
    moved = 111195.0 * (off.topic('fix')[-1, 1:3] - clean[-1, 1:3])
    moved[1] *= math.cos(math.radians(clean[-1, 1]))
    assert moved == pytest.approx([1000.0, 1000.0], rel=1e-3)


def test_a_sensor_of_which_no_fault_knows_is_handed_on():
    flown = Flown([fault('biased', sensor='heading', error=5.0)], 1.0)
    *_, state = flown.states
    *_, numbers = flown.told
    further = (state, flown.params.sensors, flown.params.faults)
    told = with_faults((*numbers[:6], (7.0,), *numbers[6:]), *further)
    assert told[6] == (7.0,)
    assert (*told[:6], *told[7:]) == with_faults(numbers, *further) != numbers


def test_health_sensors_tell_of_battery_vacuum_and_contact():
    given = [
        fault('battery', drop_v=4.0, over_s=10.0),
        fault('vacuum', rate_paps=1000.0, at_s=5.0),
        fault('no_contact', at_s=2.0),
    ]
    surfaced = Flown(given, 20.0, Joints(-1.0, 0.0, 0.0, 0.0), depth_m=0.1, net_heaviness_kg=-1.0)
    well = Health(*Flown([], 0.2, depth_m=0.1).topic('health')[0])
    told = [Health(*row) for row in surfaced.topic('health')]
    volts = surfaced.topic('battery')[:, Battery._fields.index('voltage')]
    assert volts[[50, 150]] == pytest.approx(volts[0] - [2.0, 4.0], abs=1e-6)
    assert told[150].vacuum_pa == pytest.approx(well.vacuum_pa - 10000.0, abs=1e-6)
    assert told[150].contact_age_s == pytest.approx(13.0, abs=1e-9)


# ---------------------------------------------------------------------- what is written


@pytest.mark.parametrize(
    'given',
    [
        fault('leak'),
        fault('leak', rate_kgps=-1.0),
        fault('stuck', actuator='sail'),
        fault('frozen', sensor='sonar'),
        fault('partial', actuator='pitch_mass', low=0.5, high=-0.5),
        fault('melt'),
        fault('gps_silent', at_s=-1.0),
        {'at_s': 3.0},
    ],
)
def test_what_cannot_be_is_refused(given):
    with pytest.raises(pydantic.ValidationError):
        PlantSettings(faults=[given])
