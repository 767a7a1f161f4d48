# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""``./glider ocean``: what is in a file, whether it covers a mission, and its chart."""

import json

import matplotlib.image
import numpy as np
import pytest
import xarray

from glider_base.settings import ConfigurationError
from glider_bringup.commands.ocean import ocean
from glider_bringup.showing.ocean import in_words, look, mission_in
from glider_mission.scenario import SCENARIO_FOLDER
from glider_model.ocean import grid_file

#: A mission of a day in the sea of `sea_file`.
MISSION = """
name: crossing
dives: 0
duration_s: 86400.0
origin: {time: 2026-03-02}
path: {kind: waypoints, waypoints_latlon: [[36.0, 122.0], [36.2, 122.3]]}
"""


@pytest.fixture(scope='module')
def sea_file(tmp_path_factory):
    """A sea of 0.3 m/s to the east and 0.4 m/s to the north, with an island."""
    path = tmp_path_factory.mktemp('sea') / 'sea.nc'
    axes = {
        'time': np.datetime64('2026-03-01') + np.arange(4) * np.timedelta64(1, 'D'),
        'depth': np.array([0.5, 100.0, 1100.0]),
        'latitude': np.arange(35.0, 37.01, 0.1),
        'longitude': np.arange(121.0, 123.01, 0.1),
    }
    shape = tuple(map(len, axes.values()))
    data = xarray.Dataset(
        {
            name: (tuple(axes), np.full(shape, speed), {'units': 'm s-1'})
            for name, speed in (('uo', 0.3), ('vo', 0.4))
        },
        {**axes, 'depth': ('depth', axes['depth'], {'units': 'm', 'positive': 'down'})},
        {'source': 'made'},
    )
    island = (data.latitude < 35.25) & (data.longitude < 121.25)
    data.where(~island).to_netcdf(path, engine='scipy')
    return path


def told(capsys, *args, **options):
    ocean(*args, as_json=True, **options)
    return json.loads(capsys.readouterr().out)


def test_it_tells_what_is_in_a_file(sea_file, capsys):
    found = told(capsys, sea_file)
    currents = found['currents']
    assert [(one['name'], one['low'], one['high']) for one in currents['variables']] == [
        ('vo', pytest.approx(0.4), pytest.approx(0.4)),
        ('uo', pytest.approx(0.3), pytest.approx(0.3)),
    ]
    assert currents['times'] == {
        **{'first': '2026-03-01T00:00Z', 'last': '2026-03-04T00:00Z'},
        **{'count': 4, 'step_h': 24.0},
    }
    assert currents['depth_m'] == {'first': 0.5, 'last': 1100.0, 'count': 3}
    assert currents['land_share'] == pytest.approx(9 / 441)
    assert currents['speed_mps'] == pytest.approx({'rms': 0.5, 'max': 0.5})
    assert (found['water'], found['bottom'], found['mission']) == (None, None, None)


@pytest.mark.filterwarnings('error')
def test_a_fill_that_is_not_declared_is_refused_by_name(sea_file, tmp_path, capsys):
    path = tmp_path / 'filled.nc'
    with xarray.open_dataset(sea_file) as sea:
        sea.astype('float32').fillna(9.96921e36).to_netcdf(path, engine='scipy')
    says = r'filled.nc: vo at 2026-03-03T00:00Z: 9.96921e\+36 m/s \(allowed: -10 to 10 m/s\)'
    with pytest.raises(ConfigurationError, match=says):
        told(capsys, path)


@pytest.mark.parametrize('by', [['longitude'], []])
def test_a_sea_across_the_date_line_is_no_sea_round_the_earth(by, sea_file, tmp_path, capsys):
    path = tmp_path / 'across.nc'
    with xarray.open_dataset(sea_file, decode_times=False) as sea:
        east = (sea['longitude'] + 58.05 + 180.0) % 360.0 - 180.0
        sea.assign_coords(longitude=east).sortby(by).to_netcdf(path, engine='scipy')
    found = told(capsys, path)
    ends = found['currents']['longitude_deg']
    assert ends == {'first': pytest.approx(179.05), 'last': pytest.approx(181.05), 'count': 21}
    assert '35.00000 N, 179.05000 E to 37.00000 N, 178.95000 W' in dict(in_words(found))['places']


def test_of_what_is_too_large_there_are_no_numbers_or_those_of_its_surface(
    sea_file, tmp_path, monkeypatch, capsys
):
    monkeypatch.setattr(grid_file, 'MAX_BYTES', 5000)
    seen = told(capsys, sea_file)['currents']['seen']
    assert seen['depth_m'] == {'first': 0.5, 'last': 0.5}
    monkeypatch.setattr(grid_file, 'MAX_BYTES', 100)
    currents = told(capsys, sea_file)['currents']
    assert currents['seen'] is None and currents['variables'][0]['low'] is None
    with pytest.raises(ConfigurationError, match=r'sea.nc is too large \(allowed: the window of'):
        ocean(sea_file, out=tmp_path / 'sea.png')


#: Names and units of temperature and salinity, and what CF calls the first.
LAYOUTS = {
    'cmems': ('thetao', 'degrees_C', 'sea_water_potential_temperature', 'so', '1e-3'),
    'hycom': ('water_temp', 'degC', 'sea_water_temperature', 'salinity', 'psu'),
}


def hydrography(sea_file, layout):
    """Water of 5 to 15 degC and 34 to 35 psu, warmer by the day and colder by the level."""
    with xarray.open_dataset(sea_file) as sea:
        t, z, x = (sea[name] for name in ('time', 'depth', 'longitude'))
        day, level = t.copy(data=np.arange(4.0)), z.copy(data=np.arange(3.0))
        there = xarray.ones_like(sea.uo).where(sea.uo.notnull())
        warm = there * (13.0 - 4.0 * level + (day - 2.0) * 3.0 + (x - 122.0) * 2.0)
        salt = there * (34.0 + 0.5 * level)
        name, unit, standard, salinity, thousandth = LAYOUTS[layout]
        warm.attrs = {'standard_name': standard, 'units': unit}
        salt.attrs = {'standard_name': 'sea_water_salinity', 'units': thousandth}
        return xarray.Dataset({name: warm, salinity: salt}).load()


@pytest.mark.parametrize('layout', LAYOUTS)
def test_it_tells_of_temperature_and_salinity_alone(layout, sea_file, tmp_path, capsys):
    """In the middle of its time, at all levels; of HYCOM from packed integers."""
    path, picture = tmp_path / 'ts.nc', tmp_path / 'ts.png'
    pack = {'dtype': 'int16', 'scale_factor': 0.001, 'add_offset': 20.0, '_FillValue': -30000}
    data = hydrography(sea_file, layout)
    packed = {name: pack for name in data} if layout == 'hycom' else {}
    data.to_netcdf(path, engine='scipy', encoding=packed)
    found = told(capsys, path, out=picture)
    temperature, temperature_unit, standard, salinity, salinity_unit = LAYOUTS[layout]
    assert found['currents'] is None and found['refused'] == {}
    assert found['water']['variables'] == [
        {
            **{'name': temperature, 'what': 'temperature', 'standard_name': standard},
            **{'units': temperature_unit, 'unit': 'degC'},
            **{'low': pytest.approx(3.0, abs=1e-3), 'high': pytest.approx(15.0, abs=1e-3)},
        },
        {
            **{'name': salinity, 'what': 'salinity', 'standard_name': 'sea_water_salinity'},
            **{'units': salinity_unit, 'unit': 'psu'},
            **{'low': pytest.approx(34.0, abs=1e-3), 'high': pytest.approx(35.0, abs=1e-3)},
        },
    ]
    assert found['water']['seen'] == {
        **{'time': '2026-03-03T00:00Z', 'depth_m': {'first': 0.5, 'last': 1100.0}},
    }
    assert matplotlib.image.imread(picture).std() > 0.05


def test_it_tells_of_the_bottom_beside_the_water_and_of_what_cannot_be_used(
    sea_file, tmp_path, capsys
):
    data = hydrography(sea_file, 'cmems')
    deep = data.so.isel(time=0, depth=0, drop=True) * 0.0 + 100.0 * (data.latitude - 34.0)
    deep.attrs = {'standard_name': 'sea_floor_depth_below_geoid', 'units': 'm'}
    path = tmp_path / 'static.nc'
    data.drop_vars('so').assign(deptho=deep).to_netcdf(path, engine='scipy')
    found = told(capsys, path)
    (bottom,) = found['bottom']['variables']
    assert (bottom['name'], bottom['low'], bottom['high']) == (
        *('deptho', pytest.approx(100.0), pytest.approx(300.0)),
    )
    assert found['bottom']['land_share'] == pytest.approx(9 / 441)
    assert found['refused']['water'].startswith('no salinity ')
    rows = dict(in_words(found))
    assert rows['depth of the bottom'].endswith('m): 100.00 to 300.00 m')
    assert rows['water'].startswith('cannot be used: no salinity ')


@pytest.mark.parametrize('kind', ['water', 'bottom'])
def test_whether_a_mission_is_covered_by_water_or_bottom(kind, sea_file, tmp_path, capsys):
    data = hydrography(sea_file, 'cmems')
    if kind == 'bottom':
        data = xarray.Dataset(
            {'elevation': -200.0 + 0.0 * data.so.isel(time=0, depth=0, drop=True)}
        )
        data.elevation.attrs['units'] = 'm'
    path, picture, mission = (tmp_path / name for name in ('part.nc', 'part.png', 'crossing.yaml'))
    data.to_netcdf(path, engine='scipy')
    mission.write_text(MISSION)
    found = told(capsys, path, mission=str(mission), out=picture)
    assert found['mission']['covered'] is True
    assert dict(in_words(found))['mission'] == f'{mission} is covered by {kind}'
    drawn = mission_in(found, str(mission)).panels[0]
    wanted = 200.0 if kind == 'bottom' else 10.0 + 2.0 * (drawn.longitudes - 122.0)
    is_water = np.isfinite(drawn.values)
    np.testing.assert_allclose(
        drawn.values[is_water], np.broadcast_to(wanted, drawn.values.shape)[is_water], atol=1e-5
    )
    assert matplotlib.image.imread(picture).std() > 0.05
    mission.write_text(MISSION.replace('36.0, 122.0', '35.05, 121.05'))
    with pytest.raises(ConfigurationError, match='on the path is land'):
        ocean(path, mission=str(mission), as_json=True)
    assert json.loads(capsys.readouterr().out)['mission']['covered'] is False


def test_it_tells_whether_a_mission_is_covered_and_draws_it(sea_file, tmp_path, capsys):
    """Whatever files the mission names itself."""
    mission, picture = tmp_path / 'crossing.yaml', tmp_path / 'sea.png'
    gone = '{field: {kind: grid, file: gone.nc}}'
    mission.write_text(
        MISSION + f'navigation: {{method: dead_reckoned, current: forecast, forecast: {gone}}}\n'
        f'current: {gone}\nwater: {{grid: {{file: gone.nc}}}}\nbathymetry: {{file: gone.nc}}\n'
    )
    found = told(capsys, sea_file, mission=str(mission), out=picture)
    assert found['mission'] == {'scenario': str(mission), 'covered': True, 'reason': ''}
    assert matplotlib.image.imread(picture).std() > 0.05
    mission.write_text(MISSION.replace('36.2, 122.3', '37.2, 122.3'))
    with pytest.raises(ConfigurationError, match='latitude of the path goes from 36.000 to 37.2'):
        ocean(sea_file, mission=str(mission), as_json=True)
    found = json.loads(capsys.readouterr().out)
    assert found['mission']['covered'] is False
    assert 'allowed: within 35.000 to 37.000' in found['mission']['reason']


def test_a_chart_is_of_the_mean_over_the_depth():
    """Of levels that lie far apart below: as xarray integrates it."""
    file = SCENARIO_FOLDER / 'eddies_10d.nc'
    (panel,) = mission_in(look(file)[0], 'eddies_10d').panels
    sea = xarray.open_dataset(file).sel(time='2026-03-03', method='nearest')
    mean = sea.integrate('depth') / (sea.depth[-1] - sea.depth[0])
    mean = mean.sel(latitude=panel.latitudes, longitude=panel.longitudes, method='nearest')
    speed = np.hypot(mean.uo, mean.vo).transpose('latitude', 'longitude')
    assert panel.values == pytest.approx(speed.values, abs=1e-6)
