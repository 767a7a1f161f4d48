# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Settings of navigation: what is refused, and what a method reads and tells."""

import pytest

from glider_base.errors import ConfigurationError
from glider_base.settings import validate
from glider_navigation.settings import METHODS, NavigationLawSettings, NavigationSettings


def message(values) -> str:
    with pytest.raises(ConfigurationError) as caught:
        validate(NavigationSettings, values, 'a.yaml')
    return str(caught.value)


@pytest.mark.parametrize(
    ('field', 'value', 'allowed'),
    [
        ('imu_period_s', 0.05, '>= 0.1 and <= 30.0'),
        ('imu_period_s', 31.0, '>= 0.1 and <= 30.0'),
        ('imu_period_s', float('nan'), '>= 0.1 and <= 30.0'),
        ('north_m', 2e7, '>= -10000000.0 and <= 10000000.0'),
        ('east_m', float('inf'), '>= -10000000.0 and <= 10000000.0'),
        ('dead_reckoned.start_std_m', 0.0, '>= 0.1 and <= 100000.0'),
        ('dead_reckoned.speed_error_share', -0.1, '>= 0.0 and <= 1.0'),
        ('dead_reckoned.speed_error_share', 1.1, '>= 0.0 and <= 1.0'),
        ('dead_reckoned.heading_error_deg', 91.0, '>= 0.0 and <= 90.0'),
        ('origin.latitude_deg', 90.0, '>= -85.0 and <= 85.0'),
        ('current', 'still', "'none', 'persistence', 'tidal' or 'forecast'"),
    ],
)
def test_a_wrong_value_is_refused_with_field_value_and_range(field, value, allowed):
    values = value
    for name in reversed(field.split('.')):
        values = {name: values}
    told = message(values)
    assert told.startswith(f'a.yaml: {field} = {value!r}: should be ')
    assert allowed in told
    assert len(told.splitlines()) == 1


@pytest.mark.parametrize('field', ['method', 'gyro', 'vehicle', 'dead_reckoned'])
def test_a_value_of_another_kind_is_refused_by_its_field(field):
    told = message({field: 'guesses'} if field != 'vehicle' else {field: 3})
    assert told.startswith(f'a.yaml: {field} = ')
    if field == 'method':
        assert all(name in told for name in METHODS)


def test_an_unknown_field_is_told_with_those_there_are():
    told = message({'dead_reckoned': {'compass': 1.0}})
    assert 'dead_reckoned.compass' in told
    for name in ('start_std_m', 'speed_error_share', 'heading_error_deg'):
        assert name in told


def test_a_method_says_what_it_reads_and_tells():
    known = NavigationLawSettings()
    assert (known.method, known.topics, known.jumps) == ('known', ('measured_odom',), False)
    reckoned = NavigationLawSettings(method='dead_reckoned')
    assert reckoned.topics[:3] == ('imu', 'pressure', 'fix')
    assert set(reckoned.topics[3:]) == {'believed_current', 'believed_surface_current'}
    assert reckoned.jumps


@pytest.mark.parametrize('method', METHODS)
def test_kernels_are_told_by_types_of_the_methods_own(method):
    """The slot is filled by the type of params."""
    params = NavigationSettings(method=method).params().method
    others = [NavigationSettings(method=name).params().method for name in set(METHODS) - {method}]
    assert type(params) not in map(type, others)


def test_settings_become_what_kernels_know():
    settings = NavigationSettings(
        method='dead_reckoned',
        current='none',
        north_m=30.0,
        east_m=-40.0,
        dead_reckoned={'start_std_m': 7.0, 'speed_error_share': 0.1},
    )
    params, state = settings.params().method, settings.initial_state().method
    assert not params.estimates_current
    assert params.speed_variance == pytest.approx(0.01)
    assert tuple(state.place) == tuple(state.stay.place) == (30.0, -40.0)
    assert state.stay.known.pp == 49.0
