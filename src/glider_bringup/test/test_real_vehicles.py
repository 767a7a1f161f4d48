# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A Slocum and a Seaglider hold a path, in deep and in shallow water, by either law."""

import numpy as np
import pytest

from glider_base.settings import ConfigurationError
from glider_bringup.scoring.card import fly_scored
from glider_bringup.scoring.one_hertz import SECOND, Record, Rows
from glider_mission.scenario import load_scenario
from glider_model.ocean.density import immersed

#: Rows of depth (m), density (kg/m^3), temperature (degC).
SEA = [[0.0, 1022.5, 20.0], [30.0, 1024.0, 15.0], [200.0, 1025.6, 12.0], [1000.0, 1030.0, 5.0]]


#: Its place is known throughout, and what it measures is so.
KNOWN = {'navigation.method': 'known', 'profile.surface_every_dives': 0, 'sensors': {}}


def flown(name, known=KNOWN, **changes):
    fields = {name.replace('__', '.'): value for name, value in changes.items()}
    recorder = Rows(SECOND)
    flight, scores = fly_scored(load_scenario(name, {'dives': 0, **known, **fields}), [recorder])
    assert flight.status == 'completed'
    assert scores['guard']['events'] == []
    return scores, Record(recorder.result())


@pytest.mark.parametrize('name', ['slocum_shelf', 'seaglider_1000m'])
def test_operators_meet_them_as_theirs_fly(name):
    """As the scenario is: no position under water, fixes when it comes up, and it learns of them.

    The first way is flown in a current that nobody has told it of, and drifts with it.
    """
    scenario = load_scenario(name)
    assert scenario.navigation.method == 'dead_reckoned'
    scores, _ = flown(name, known={}, dives=scenario.dives)
    told = scores['navigation']
    assert told['surfacings'] >= 2
    assert told['fixed'] >= 1
    first, second = told['reports'][:2]
    under_water_s = first['t_s'] - first['dive_t_s']
    drift_m = np.hypot(*first['dac_true_mps']) * under_water_s
    assert first['error_m'] == pytest.approx(drift_m, rel=0.05)
    assert second['error_m'] < 0.1 * first['error_m']
    assert told['ellipse_95_share'] == 1.0


@pytest.mark.parametrize('law', ['adaptive', 'pid'])
@pytest.mark.parametrize(
    ('name', 'seconds', 'dives'), [('slocum_shelf', 15000.0, 5), ('seaglider_1000m', 33000.0, 2)]
)
def test_a_straight_path_in_half_a_knot(name, seconds, dives, law):
    """Steady error below a metre; 200 m and 1000 m are reached and not passed by far."""
    scores, _ = flown(name, duration_s=seconds, control__law=law)
    assert scores['dives'] >= dives
    assert scores['cross_track_m']['max_steady'] < 1.0
    assert scores['pitch_error_deg']['max_steady'] < 0.5
    assert 0.0 <= scores['depth_m']['overshoot'] < 4.0


@pytest.mark.parametrize('name', ['slocum_shelf', 'seaglider_1000m'])
def test_the_same_in_measured_water(name):
    """The pump makes up for what the hull weighs less in it, and the path is held."""
    water = {'profile': SEA}
    scores, record = flown(name, duration_s=9000.0, water=water, profile__depth_m=200.0)
    assert scores['cross_track_m']['max_steady'] < 1.0
    shallow, deep = (
        np.median(record.joints[record.descending & (abs(record.depth - depth) < 10.0), 0])
        for depth in (60.0, 160.0)
    )
    vehicle = load_scenario(name).plant_settings().params().vehicle
    gain = [
        immersed(depth, 0.0, vehicle, load_scenario(name, {'water': water}).water.params()).net
        for depth in (60.0, 160.0)
    ]
    assert gain[1] < gain[0]
    assert deep - shallow == pytest.approx(gain[0] - gain[1], abs=0.03)


@pytest.mark.parametrize(
    ('name', 'depth', 'dives'), [('slocum_shelf', 25.0, 8), ('seaglider_1000m', 38.0, 5)]
)
def test_shallow_water_is_scored_and_counted(name, depth, dives):
    shallow = {'profile__depth_m': depth, 'profile__top_depth_m': 4.0}
    scores, _ = flown(name, duration_s=9000.0, settle_s=1800.0, **shallow)
    assert scores['dives'] >= dives
    assert scores['cross_track_m']['max_steady'] < 8.0
    assert abs(scores['depth_m']['overshoot']) < 4.0


def test_dive_and_climb_have_a_pitch_and_a_heaviness_each():
    """12 deg and 0.15 kg down, 20 deg and 0.25 kg up; water and hull are alike soft."""
    scores, record = flown(
        'seaglider_1000m',
        duration_s=14000.0,
        water={'compression_per_m': 4.43e-6},
        profile__depth_m=300.0,
        profile__pitch_deg=12.0,
        profile__net_heaviness_kg=0.15,
        profile__climb_pitch_deg=20.0,
        profile__climb_net_heaviness_kg=0.25,
    )
    rate, pitch = np.gradient(record.depth), record.pitch
    middle = (record.depth > 120.0) & (record.depth < 220.0)
    for phase, degrees, kilograms in ((rate > 0.02, -12.0, 0.15), (rate < -0.02, 20.0, -0.25)):
        glides = phase & middle & (record.time_s > 3600.0)
        assert glides.sum() > 500
        assert np.median(pitch[glides]) == pytest.approx(degrees, abs=0.3)
        assert np.median(record.joints[glides, 0]) == pytest.approx(kilograms, abs=0.02)
    assert scores['dives'] >= 2


def test_a_glide_that_a_vehicle_does_not_have_is_refused():
    with pytest.raises(ConfigurationError, match='pitch_deg = 9: shallower than the vehicle gli'):
        load_scenario('slocum_shelf', {'profile.pitch_deg': 9.0})
    assert load_scenario('seaglider_1000m', {'profile.pitch_deg': 8.0}).profile.pitch_deg == 8.0
