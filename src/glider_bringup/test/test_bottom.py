# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The bottom of the sea: turned above by guidance, left by the guard, or touched and told."""

import math

import numpy as np
import pytest
import xarray
from hypothesis import given
from hypothesis import strategies as st
from rclpy.parameter import Parameter
from scipy.spatial.transform import Rotation

import glider_bringup
from glider_base.ros.wire.topics import TOPICS
from glider_base.settings import ConfigurationError
from glider_base.signals import TICK_NS, TICK_S, Water
from glider_base.wiring import NO_ECHO, at_rest
from glider_guard.nodes.guard_node import GuardNode
from glider_guidance.nodes.guidance_node import GuidanceNode
from glider_model.ocean.bottom import aground
from glider_model.plant.motion import Motion

#: A shelf that a yo to 200 m does not fit over.
SHELF = {'water.bottom_m': 120.0}
SPEED = st.floats(-2.0, 2.0)


@given(*[SPEED] * 6, *[st.floats(-3.0, 3.0)] * 3, st.floats(90.0, 110.0))
def test_a_vehicle_lies_where_it_touched_the_bottom(u, v, w, north, east, down, a, b, c, depth):
    """By rotations of SciPy: it does not move over ground but upward."""
    turn = Rotation.from_euler('xyz', (a, b, c))
    x, y, z, scalar = turn.as_quat()
    before = Motion(1.0, 2.0, depth, scalar, x, y, z, u, v, w, 0.1, 0.2, 0.3)
    after = aground(before, Water(north, east, down), 100.0)
    if depth <= 100.0:
        assert after == before
        return
    over_ground = turn.apply(after[7:10]) + (north, east, down)
    rose = min(0.0, (turn.apply((u, v, w)) + (north, east, down))[2])
    np.testing.assert_allclose(over_ground, (0.0, 0.0, rose), atol=1e-9)
    assert after[:3] == (1.0, 2.0, 100.0)
    assert after[3:7] + after[10:] == before[3:7] + before[10:]


ORIGIN = 36.0, 122.0  #: of the chart of slocum_shelf (deg)
#: Corners of the chart (deg): the shelf around the origin of the chart, and north of it.
CHART = np.linspace(35.9, 36.3, 41), np.linspace(121.9, 122.1, 21)


def mountains(path, seed, height_m=150.0):
    """Chart as GEBCO writes it: a plain at 250 m, four hills of a height or less on the way."""
    draw = np.random.default_rng(seed)
    latitudes, longitudes = CHART
    elevation = np.full((len(latitudes), len(longitudes)), -250.0)
    for _ in range(4):
        north, east = draw.uniform(36.01, 36.15), draw.uniform(121.99, 122.01)
        away = np.hypot(latitudes[:, None] - north, 0.8 * (longitudes - east))
        size = draw.uniform(0.012, 0.03)
        elevation += draw.uniform(0.5, 1.0) * height_m * np.exp(-((away / size) ** 2))
    data = xarray.Dataset(
        {'elevation': (('lat', 'lon'), np.minimum(elevation, -60.0).round().astype(np.int16))},
        {
            'lat': ('lat', latitudes, {'standard_name': 'latitude', 'units': 'degrees_north'}),
            'lon': ('lon', longitudes, {'standard_name': 'longitude', 'units': 'degrees_east'}),
        },
    )
    data['elevation'].attrs = {'standard_name': 'height_above_mean_sea_level', 'units': 'm'}
    data.to_netcdf(path, engine='scipy')
    return path


def least_height(run, chart) -> float:
    """Of the true track over a chart (m), by xarray and the series for the length of a degree."""
    told, phi = run.to_xarray(), np.radians(ORIGIN[0])
    north, east, depth = (told[f'ground_truth_odom_{name}'] for name in ('north', 'east', 'depth'))
    a_degree_north = 111132.92 - 559.82 * np.cos(2.0 * phi) + 1.175 * np.cos(4.0 * phi)
    a_degree_east = 111412.84 * np.cos(phi) - 93.5 * np.cos(3.0 * phi) + 0.118 * np.cos(5.0 * phi)
    at = {'lat': ORIGIN[0] + north / a_degree_north, 'lon': ORIGIN[1] + east / a_degree_east}
    elevation = xarray.load_dataset(chart)['elevation'].astype(float).interp(at)
    heights = -elevation - depth
    assert heights.notnull().all()
    return float(heights.min())


@pytest.mark.parametrize('seed', [1, 5])
def test_dives_turn_above_mountains(seed, tmp_path):
    """Over which the same yo does not fit without; over those of 0 and 4 it does."""
    chart = mountains(tmp_path / 'chart.nc', seed)
    given = {'bathymetry.file': str(chart)}
    assert glider_bringup.fly('slocum_shelf', given).score['bottom']['touched']
    run = glider_bringup.fly('slocum_shelf', {**given, 'profile.clearance_m': 10.0})
    told = run.score
    assert told['status'] == 'completed', told['reason']
    assert not told['bottom']['touched']
    assert told['bottom']['least_height_m'] > 5.0
    assert least_height(run, chart) == pytest.approx(told['bottom']['least_height_m'], abs=1.0)


def flown(**fields):
    """Score of a mission over the shelf."""
    return glider_bringup.fly('slocum_shelf', {**SHELF, **fields}).score


def test_dives_turn_above_the_bottom():
    told = flown(**{'profile.clearance_m': 10.0})
    assert told['status'] == 'completed'
    assert told['dives'] >= 4
    assert not told['bottom']['touched']
    assert 7.0 < told['bottom']['least_height_m'] < 15.0
    assert told['guard']['events'] == []


@pytest.mark.parametrize('every', [0, 1])
def test_dives_in_shallow_water_are_counted_by_its_depth(every):
    """Of 15 m, or 5 m from turn to turn: they are the three that there were to be."""
    fields = {'water.bottom_m': 25.0, 'profile.clearance_m': 10.0, 'profile.depth_m': 57.0}
    told = flown(**{**fields, 'dives': 3, 'profile.surface_every_dives': every})
    assert (told['status'], told['reason'], told['dives']) == ('completed', '', 3)


def test_an_altimeter_alone_ends_the_mission_above_the_bottom():
    told = flown(**{'sensors.also_fitted': ['altitude']})
    assert told['status'] == 'surfaced'
    assert 'too close to the bottom' in told['reason']
    assert not told['bottom']['touched']


def test_a_vehicle_that_touches_comes_up_and_the_score_says_so():
    told = flown()
    assert told['status'] == 'surfaced'
    assert 'lies aground' in told['reason']
    assert told['bottom']['touched']
    assert told['bottom']['least_height_m'] == 0.0
    assert 120.0 / 0.5 < told['bottom']['t_s'] < told['sim_time_s']


def test_a_vehicle_that_bobs_from_the_bottom_to_the_surface_has_not_dived(tmp_path):
    """Over 6 m, and 0.5 m more on each kilometre north: so it does not stand still."""
    axes = {'lat': [35.9, 36.3], 'lon': [121.9, 122.1]}
    slope = xarray.DataArray([[0.0, 0.0], [-24.0, -24.0]], axes, name='elevation')
    slope.assign_attrs(units='m').to_netcdf(tmp_path / 'slope.nc', engine='scipy')
    fields = {'bathymetry.file': str(tmp_path / 'slope.nc'), 'dives': 0, 'duration_s': 6000.0}
    fields |= {'origin.latitude_deg': 36.0, 'origin.longitude_deg': 122.0}
    told = flown(**fields, current={'speed_mps': 0.1, 'direction_deg': 0.0})
    assert told['bottom']['touched'] and not told['dives']
    assert told['reason'].startswith('no dive flown, for which there was time')


@pytest.mark.parametrize(
    ('name', 'vehicle', 'pitch_deg', 'heavy_kg'),
    [('survey', 'seawing', 45.0, 0.8), ('seaglider_1000m', 'seaglider', 40.0, 0.3)],
)
def test_a_turn_with_little_weight_teaches_no_short_lead_over_the_bottom(
    name, vehicle, pitch_deg, heavy_kg
):
    fields = {'vehicle': vehicle, 'profile.pitch_deg': pitch_deg, 'water.bottom_m': 80.0}
    fields |= {'profile.net_heaviness_kg': heavy_kg, 'profile.clearance_m': 5.0, 'dives': 3}
    fields |= {'profile.depth_m': 200.0, 'profile.surface_every_dives': 0}
    score = glider_bringup.fly(name, fields).score
    assert (score['status'], score['bottom']['touched']) == ('completed', False)
    assert score['bottom']['least_height_m'] > 5.0


def test_clearance_is_for_yos():
    with pytest.raises(ConfigurationError, match=r'profile.clearance_m = 10: not along a path'):
        glider_bringup.fly('helix', {'profile.clearance_m': 10.0, 'profile.mode': 'path'})


@pytest.mark.parametrize('kind', [GuidanceNode, GuardNode])
@pytest.mark.parametrize('no_echo', [NO_ECHO, math.inf, math.nan])
def test_an_altimeter_that_pings_every_four_seconds_is_heard_in_between(
    context, monkeypatch, kind, no_echo
):
    """A bottom is believed that is heard for seconds on end, and no longer than it is heard."""
    told, heard = {'lockstep': False, 'altitude': True}, []
    overrides = [Parameter(name, value=value) for name, value in told.items()]
    node, now_s = kind(context=context, parameter_overrides=overrides), 0.0
    try:
        place = [item.topic.name for item in node.inputs].index('altitude')
        monkeypatch.setattr(node, 'now_s', lambda: now_s)
        monkeypatch.setattr(node, 'step', lambda _, *values: heard.append(values[place][0]))
        monkeypatch.setattr(node, 'is_of_owner', lambda *_: True)
        for tick in range(100):
            now_s = tick * TICK_S
            for item in node.inputs:
                numbers = at_rest(item.topic.name)
                if item.topic.name == 'altitude':
                    if tick % 40:
                        continue
                    numbers = (15.0 if tick < 80 else no_echo,)
                codec = TOPICS[item.topic.name].codec
                node._on_newest(item, codec.encode(tick * TICK_NS, numbers[: codec.width]), {})
            node._on_cycle()
        assert heard == [15.0] * 80 + [NO_ECHO] * 20
    finally:
        node.close()
        node.destroy_node()
