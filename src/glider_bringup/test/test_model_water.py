# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A flight in the water of an ocean model: the same as in a cast of it, where it is all alike."""

from pathlib import Path

import numpy as np
import pytest
import xarray
import yaml

import glider_bringup as glider
from glider_base.settings import ConfigurationError

DEPTHS = np.array([0.0, 10.0, 30.0, 60.0, 100.0, 200.0, 400.0])


def sea(path, warmer_north=0.0):
    """File of a sea that is alike everywhere, but warmer by so much (K) each degree northward."""
    pytest.importorskip('h5netcdf')
    latitudes, longitudes = np.arange(35.0, 37.01, 0.5), np.arange(121.0, 123.01, 0.5)
    column = 5.0 + 8.0 * np.exp(-DEPTHS / 50.0)
    north = np.clip(warmer_north * (latitudes - 36.0), -10.0, 20.0)
    warm = column[None, :, None, None] + north[None, None, :, None] + np.zeros((1, 1, 1, 5))
    dims = ('time', 'depth', 'latitude', 'longitude')
    data = xarray.Dataset(
        {
            'water_temp': (dims, warm, {'units': 'degC'}),
            'salinity': (dims, np.full(warm.shape, 35.0), {'units': 'psu'}),
        },
        {
            'time': ('time', np.array(['2026-03-01'], 'datetime64[ns]')),
            'depth': ('depth', DEPTHS, {'units': 'm', 'positive': 'down'}),
            'latitude': ('latitude', latitudes, {'units': 'degrees_north'}),
            'longitude': ('longitude', longitudes, {'units': 'degrees_east'}),
        },
    )
    data.to_netcdf(path, engine='h5netcdf')
    return str(path), column


def fly(water, **fields):
    """Two dives to 150 m."""
    changes = {
        'water': water,
        'origin': {'latitude_deg': 36.0, 'longitude_deg': 122.0},
        'profile.depth_m': 150.0,
        'profile.net_heaviness_kg': 0.2,
        'dives': 2,
        **fields,
    }
    return glider.fly('current_8deg', changes)


def test_it_is_flown_as_a_cast_of_the_same_water_and_says_which_file(tmp_path):
    gsw = pytest.importorskip('gsw')
    file, column = sea(tmp_path / 'sea.nc')
    pressure = gsw.p_from_z(-DEPTHS, 45.0)
    salinity = gsw.SR_from_SP(35.0)
    density = gsw.rho(salinity, gsw.CT_from_t(salinity, column, pressure), pressure)
    rows = np.stack((DEPTHS, density, column), axis=1).tolist()
    cast, model = fly({'profile': rows}), fly({'grid': {'file': file}}, duration_s=20000.0)
    depth = [one.to_xarray()['ground_truth_odom_depth'].values for one in (cast, model)]
    ticks = min(map(len, depth))
    assert abs(len(depth[0]) - len(depth[1])) < 20
    assert np.abs(depth[0][:ticks] - depth[1][:ticks]).max() < 0.1
    told = yaml.safe_load(model.scenario.to_yaml())['water']['grid']
    assert len(told['fingerprint']) == 16
    with pytest.raises(ConfigurationError, match=r'water.grid.file .*not the one that was flown'):
        fly({'grid': {'file': file, 'fingerprint': '0' * 16}})
    Path(file).unlink()
    assert model.report(tmp_path / 'report.html').exists()


def test_in_the_warmer_water_of_the_north_it_sinks_faster(tmp_path):
    pytest.importorskip('gsw')
    runs = []
    for warmer in (0.0, 40.0):
        file, _ = sea(tmp_path / f'{warmer}.nc', warmer)
        runs.append(fly({'grid': {'file': file}}, **{'initial.north_m': 20000.0, 'dives': 1}))
    deep_s = [run.to_xarray()['ground_truth_odom_depth'].values.argmax() / 10.0 for run in runs]
    assert deep_s[1] < 0.98 * deep_s[0]


def test_a_vehicle_that_a_step_of_the_density_bears_is_said_to_lie_on_denser_water():
    step = [(0.0, 1015.0), (7.0, 1015.0), (9.0, 1027.0), (1000.0, 1031.0)]
    told = fly({'profile': step}, duration_s=1500.0).score
    assert told['status'] == 'surfaced'
    assert 'on denser water' in told['reason']
    assert told['depth_m']['max'] < 20.0
