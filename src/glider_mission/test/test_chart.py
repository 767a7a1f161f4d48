# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Missions on a chart: waypoints in degrees, where they lie, and what is refused."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from glider_base.frames import OriginSettings, to_geodetic
from glider_base.settings import ConfigurationError
from glider_mission.chart import degrees, in_metres, stretch
from glider_mission.scenario import ScenarioSource, load_scenario, make_scenario, read_scenario

#: A ring of six waypoints, 160 km round, in words that people use.
RING = [
    [36.0, 122.0],
    ['36 15 N', '122°18.0′E'],
    ['36.55', '122 12.0 E'],
    ['N 36 36', 121.75],
    [36.3, 'E 121.5'],
    ['36°N', 121.7],
]

FIJI = [[-17.0, 179.9], [-17.1, -179.9]]


def mission(**values):
    """Scenario of a path through waypoints in degrees."""
    source = read_scenario('survey')
    path = {'kind': 'waypoints', 'waypoints_latlon': RING}
    changed = {**source.values, 'path': path, **values}
    return make_scenario(ScenarioSource(source.path, changed))


@given(st.floats(-84.0, 84.0), st.floats(-179.9, 179.9))
def test_degrees_and_minutes_are_read_as_they_are_written(latitude, longitude):
    for value, axis, letters in ((latitude, 'latitude', 'NS'), (longitude, 'longitude', 'EW')):
        size, letter = abs(value), letters[value < 0.0]
        whole, minutes = int(size), 60.0 * (size - int(size))
        assume(minutes < 59.999999)
        for text in (
            f'{size:.9f} {letter}',
            f'{letter.lower()}{whole}°{minutes:.7f}′',
            f"{whole} {minutes:.7f}'{letter}",
            f'{value:.9f}',
        ):
            assert degrees(text, axis) == pytest.approx(value, abs=1e-8), text


@pytest.mark.parametrize(
    'bad',
    [
        *('', 'here', '36 60 N', '36.5 30 N', '-36 N', 'N 36 S', '36 E', '86', True, None, 90.0),
        *('0012.3 S', '-0012.3', 'S0012.34', '1234.5S'),  # degrees and minutes as one number
    ],
)
def test_what_is_no_latitude_is_refused(bad):
    with pytest.raises(ValueError, match=r'latitude = .*allowed: -85 to 85 deg'):
        degrees(bad, 'latitude')


def test_waypoints_lie_where_they_are_written_and_the_vehicle_starts_at_the_first():
    flown = mission()
    origin = flown.origin.params()
    written = [(degrees(a, 'latitude'), degrees(b, 'longitude')) for a, b in RING]
    found = [to_geodetic(*point[:2], origin) for point in flown.path.waypoints]
    np.testing.assert_allclose(found, written, rtol=0.0, atol=1e-9)
    assert (flown.origin.latitude_deg, flown.origin.longitude_deg) == (36.3, 121.9)
    assert flown.path.waypoints[0][:2] == (flown.initial.north_m, flown.initial.east_m)
    assert flown.is_charted
    assert not load_scenario('survey').is_charted


def test_a_degree_is_as_long_as_on_the_earth():
    """Lengths of degrees on WGS 84 at 45 deg: 111131.7 and 78846.8 m (NGA, TR 8350.2)."""
    path = {'kind': 'waypoints', 'waypoints_latlon': [[44.5, 10.0], [45.5, 10.0], [45.0, 11.0]]}
    (south, _), (north, west), (_, east) = in_metres(
        path, OriginSettings(latitude_deg=45.0, longitude_deg=10.0)
    )['waypoints']
    assert north - south == pytest.approx(111131.7, abs=0.5)
    assert east - west == pytest.approx(78846.8, abs=0.5)


@given(st.floats(-80.0, 80.0), st.floats(-1.0, 1.0))
def test_the_stretch_is_that_of_the_parallels_of_a_sphere(latitude, away):
    """To a thousandth of it: the Earth is nearly one."""
    origin = OriginSettings(latitude_deg=latitude).params()
    there = latitude + away
    sphere = math.cos(math.radians(latitude)) / math.cos(math.radians(there)) - 1.0
    assert stretch(there, origin) == pytest.approx(sphere, rel=0.01, abs=1e-9)


def test_across_the_date_line():
    ring = [[10.0, 179.9], [10.1, -179.9], ['10 12 N', 180.3]]
    flown = mission(path={'kind': 'waypoints', 'waypoints_latlon': ring})
    assert flown.origin.longitude_deg == pytest.approx(-179.9)
    (_, first), (_, after), (_, last) = (point[:2] for point in flown.path.waypoints)
    assert after - first == pytest.approx(0.2 * 109641.0, rel=1e-3)
    assert last - first == pytest.approx(0.4 * 109641.0, rel=1e-3)


def test_a_flown_scenario_is_the_same_again_and_its_degrees_can_be_changed(tmp_path):
    flown = mission(origin={'time': '2026-03-01T06:00+02:00'})
    assert flown.origin.time == '2026-03-01T04:00:00Z'
    (tmp_path / 'flown.yaml').write_text(flown.to_yaml())
    again = load_scenario(str(tmp_path / 'flown.yaml'))
    assert again == flown
    moved = [[35.5, 122.0], [35.6, 122.1]]
    other = load_scenario(str(tmp_path / 'flown.yaml'), {'path.waypoints_latlon': moved})
    assert len(other.path.waypoints) == 2
    assert other.path.waypoints[0][0] == pytest.approx(-0.8 * 110990.0, rel=1e-3)


def test_orders_may_be_in_degrees():
    path = {'kind': 'waypoints', 'waypoints_latlon': RING[2:4]}
    flown = mission(orders=[{'at_s': 100.0, 'path': path}])
    assert flown.orders[0].path.waypoints == flown.path.waypoints[2:4]


@pytest.mark.parametrize(
    ('values', 'text'),
    [
        ({'path': {'kind': 'waypoints', 'waypoints_latlon': [[10, 0], [91, 0]]}},
         r'waypoints_latlon.1: latitude = 91: not usable \(allowed: -85 to 85'),
        ({'path': {'kind': 'waypoints', 'waypoints_latlon': [[10, 0], [10]]}},
         r'waypoints_latlon.1 = \[10\]: allowed: \[latitude, longitude\]'),
        ({'path': {'kind': 'waypoints', 'waypoints_latlon': [[10, 0]]}}, 'allowed: 2 and more'),
        ({'path': {'kind': 'waypoints', 'waypoints_latlon': [[60, 0], [70, 0]]}},
         'waypoints_latlon.0: 60.00000 N, 0.00000 E: the mission is too large for a flat chart'),
        ({'path': {'kind': 'waypoints', 'waypoints_latlon': RING, 'waypoints': [[0, 0], [9, 9]]}},
         'other places than waypoints_latlon'),
        ({'origin': {'time': 'yesterday'}}, r"origin.time = 'yesterday': not a time \(allowed: "),
        ({'origin': {'time': '0001-01-01T00:00+09:00'}}, r'not a time \(allowed: '),
        ({'origin': {'time': '9999-12-31T23:00'}}, r'not a time \(allowed: .*, of 1900 to 2199\)'),
        ({'origin': {'time': '1026-03-01'}}, r'not a time \(allowed: .*, of 1900 to 2199\)'),
        ({'origin': {'time': 'now'}, 'path': {'kind': 'waypoints', 'waypoints_latlon': FIJI}},
         r'^[^\n]*origin.time = .now.: not a time[^\n]*$'),
        ({'path': {'kind': 'waypoints', 'waypoints_latlon': [[10, 0], [10, 0]]}},
         r'are 0.000 m apart \(allowed: >= 1.0 m\)'),
    ],
)  # fmt: skip
def test_what_makes_no_mission_is_refused_by_name(values, text):
    with pytest.raises(ConfigurationError, match=text):
        mission(**values)
