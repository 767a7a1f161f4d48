# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Currents from files of ocean models: against xarray's own interpolation, and what is refused."""

import math
import sys

import numpy as np
import pytest
import xarray

from glider_base.frames import OriginSettings, from_geodetic
from glider_base.settings import ConfigurationError, validate
from glider_base.signals import SEA_WATER_DENSITY
from glider_model.ocean import grid_file
from glider_model.ocean.bottom import BathymetrySettings, bottom_depth
from glider_model.ocean.cast import read_cast
from glider_model.ocean.current import current_initial, current_step
from glider_model.ocean.current_settings import CurrentSettings
from glider_model.ocean.density import immersed
from glider_model.ocean.field import Mission, field_velocity
from glider_model.ocean.fields.grid import GridSettings, interpolate
from glider_model.ocean.grid_file import contents, load
from glider_model.ocean.water import ModelWaterSettings, WaterSettings, around, water_there
from glider_model.plant.plant import PlantSettings

DEPTHS = np.array([0.494, 2.6, 9.6, 25.2, 65.8, 130.7, 266.0, 541.1, 1062.4])
TIMES = np.datetime64('2026-03-01T12:00') + np.arange(4) * np.timedelta64(24, 'h')
#: Names of CMEMS and of HYCOM: variables, dimensions.
LAYOUTS = {
    'cmems': (('uo', 'vo'), ('time', 'depth', 'latitude', 'longitude')),
    'hycom': (('water_u', 'water_v'), ('time', 'depth', 'lat', 'lon')),
}


def smooth(shape, seed):
    """Random water without jumps, of about 0.3 m/s."""
    rng = np.random.default_rng(seed)
    return 0.3 * rng.standard_normal(shape)


def dataset(layout='cmems', latitudes=None, longitudes=None, order=(0, 1, 2, 3), seed=1):
    """Dataset in the layout of a service."""
    names, dims = LAYOUTS[layout]
    latitudes = np.arange(34.0, 38.01, 0.25) if latitudes is None else latitudes
    longitudes = np.arange(120.0, 124.01, 0.25) if longitudes is None else longitudes
    shape = (len(TIMES), len(DEPTHS), len(latitudes), len(longitudes))
    variables = {
        name: (
            [dims[i] for i in order],
            smooth(shape, seed + k).transpose(order),
            {'standard_name': f'{side}_sea_water_velocity', 'units': ('m s-1', 'm/s')[k]},
        )
        for k, (name, side) in enumerate(zip(names, ('eastward', 'northward'), strict=True))
    }
    coords = {
        dims[0]: ([dims[0]], TIMES, {'standard_name': 'time'}),
        dims[1]: ([dims[1]], DEPTHS, {'units': 'm', 'positive': 'down'}),
        dims[2]: ([dims[2]], latitudes, {'units': 'degrees_north'}),
        dims[3]: ([dims[3]], longitudes, {'units': 'degrees_east'}),
    }
    return xarray.Dataset(variables, coords)


def written(data, path, packed=False, engine='scipy'):
    """File of a dataset; packed as HYCOM packs it. What reads NetCDF 4 is not always there."""
    pytest.importorskip(engine)
    pack = {'dtype': 'int16', 'scale_factor': np.float32(0.001), '_FillValue': np.int16(-30000)}
    encoding = {name: dict(pack) for name in data.data_vars} if packed else {}
    if 'time' in data.coords:
        encoding['time'] = {'units': 'hours since 2000-01-01', 'dtype': 'float64'}
    data.to_netcdf(path, encoding=encoding, engine=engine)
    return path


def mission(*places, begin='2026-03-01T12:00', lasts_s=3 * 86400.0, deepest_m=1000.0):
    """A mission through places (deg), with its origin at the first."""
    latitude, longitude = places[0]
    origin = OriginSettings(latitude_deg=latitude, longitude_deg=longitude, time=begin)
    return Mission(origin=origin, places=places, deepest_m=deepest_m, lasts_s=lasts_s)


def grid(path, *places, **more):
    """Params of a grid for a mission."""
    return GridSettings(file=str(path)).resolved(mission(*places, **more)).params()


@pytest.mark.parametrize('layout', LAYOUTS)
@pytest.mark.parametrize('packed', [False, True])
@pytest.mark.parametrize('engine', ['h5netcdf', 'scipy'])
def test_water_is_what_xarray_makes_of_it(layout, packed, engine, tmp_path):
    """At 10,000 places, depths and times; also held above the first and below the last level."""
    order = (0, 1, 2, 3) if packed and engine == 'h5netcdf' else (3, 0, 2, 1)
    path = written(dataset(layout, order=order), tmp_path / 'sea.nc', packed, engine=engine)
    params = grid(path, (35.0, 121.0), (37.0, 123.0))
    rng = np.random.default_rng(3)
    n = 10_000
    t_s = rng.uniform(0.0, 3 * 86400.0, n)
    depth = rng.uniform(0.0, 1200.0, n)
    latitude, longitude = rng.uniform(34.0, 38.0, n), rng.uniform(120.0, 124.0, n)
    with xarray.open_dataset(path, engine=engine) as data:
        names, dims = LAYOUTS[layout]
        at = {
            dims[0]: TIMES[0].astype('M8[ns]') + (1e9 * t_s).astype('m8[ns]'),
            dims[1]: np.clip(depth, DEPTHS[0], DEPTHS[-1]),
            dims[2]: latitude,
            dims[3]: longitude,
        }
        at = {name: ('point', values) for name, values in at.items()}
        east, north = (data[name].astype(float).interp(at).values for name in names)
    points = np.stack((t_s, depth, latitude, longitude), axis=1)
    found = np.array([interpolate(*one, params) for one in points])
    assert np.isfinite(east).all()
    np.testing.assert_allclose(found, np.stack((north, east), axis=1), rtol=0.0, atol=1e-6)


def test_the_vehicle_meets_the_water_of_its_place_and_time(tmp_path):
    path = written(dataset(), tmp_path / 'sea.nc')
    settings = CurrentSettings(field={'kind': 'grid', 'file': str(path)})
    told = settings.resolved(0.0, mission((36.0, 122.0), begin='2026-03-02T00:00', lasts_s=3600.0))
    params = told.params()
    origin = told.field.mission.origin.params()
    place = (0.3 * origin.north, -0.4 * origin.east, 100.0)
    _, water = current_step(current_initial(params), place, 1800.0, params, 0.1)
    with xarray.open_dataset(path) as data:
        there = data.interp(
            time=np.datetime64('2026-03-02T00:30', 'ns'),
            depth=100.0,
            latitude=36.3,
            longitude=121.6,
        )
        np.testing.assert_allclose(water, (float(there.vo), float(there.uo), 0.0), atol=1e-6)
    assert field_velocity(place, 1800.0, params.field) == tuple(water)


@pytest.mark.parametrize('start', [-180.0, 0.0])
@pytest.mark.parametrize('longitude', [-179.9, 179.9, 0.05, -0.05, 359.9])
def test_a_sea_round_the_earth_has_no_seam(start, longitude, tmp_path):
    """Where longitudes begin at 0 or at -180: at either, water goes on."""
    longitudes = start + np.arange(0.0, 360.0, 0.5)
    latitudes = np.array([10.0, 9.5, 9.0])  # from north to south, as some files are
    data = dataset(latitudes=latitudes, longitudes=longitudes)
    east = np.cos(np.radians(longitudes)) * np.ones_like(data.uo)
    path = written(data.assign(uo=data.uo.copy(data=east)), tmp_path / 'sea.nc')
    wrapped = (longitude + 180.0) % 360.0 - 180.0
    params = grid(path, (9.6, wrapped))
    for away in (-1.0, -0.25, 0.0, 0.25, 1.0):
        found = interpolate(0.0, 10.0, 9.6, wrapped + away, params)[1]
        assert found == pytest.approx(np.cos(np.radians(longitude + away)), abs=2e-5)
    assert len(params.longitudes) < 20


@pytest.mark.parametrize('read', [grid, lambda path, *places: bottom_of(path, *places)])
@pytest.mark.parametrize(('west', 'east'), [(-80.0, 10.0), (-170.0, 170.0), (10.0, 350.0)])
def test_behind_the_ends_of_a_file_is_no_water(read, west, east, tmp_path):
    """A file of a part of the earth: what lies between its ends on the other side is not in it."""
    longitudes = np.arange(west, east + 1.0, 2.0)
    data = dataset(latitudes=np.arange(9.0, 11.5, 0.5), longitudes=longitudes)
    there = xarray.full_like(data.uo[0, 0], -100.0, dtype=float).drop_vars(['time', 'depth'])
    there.attrs = {'standard_name': 'height_above_mean_sea_level', 'units': 'm'}
    path = written(data.assign(elevation=there), tmp_path / 'sea.nc')
    outside = (0.5 * (west + east) + 180.0 + 180.0) % 360.0 - 180.0
    for place in ((10.0, outside), (10.0, outside + 3.0)):
        with pytest.raises(
            ValueError, match=r'longitude of the path .*but not .* as the file has'
        ):
            read(path, place)
    for inside in (west + 0.5, east - 0.5, 0.5 * (west + east)):
        assert read(path, (10.0, (inside + 180.0) % 360.0 - 180.0))


@pytest.mark.parametrize('layout', LAYOUTS)
@pytest.mark.parametrize('attrs', [{'positive': 'up'}, {}])
def test_depths_may_be_told_as_heights(layout, attrs, tmp_path):
    data = dataset(layout)
    name = LAYOUTS[layout][1][1]
    below = data.assign_coords({name: (name, -data[name].values, {'units': 'm', **attrs})})
    down, up = (
        grid(written(one, tmp_path / f'{k}.nc'), (36.0, 122.0))
        for k, one in enumerate((data, below))
    )
    for depth in (0.0, 40.0, 333.0, 900.0):
        found = interpolate(0.0, depth, 36.1, 122.1, up)
        assert found == interpolate(0.0, depth, 36.1, 122.1, down)


@pytest.mark.parametrize(
    ('change', 'says'),
    [
        (lambda u: u.where(u.time != u.time[2]), r'uo at 2026-03-0\dT12:00Z: no number around'),
        (
            lambda u: u.where(u.longitude != 122.0, 9999.0),
            r'uo at .*: 9999 m/s \(allowed: -10 to 10',
        ),
    ],
)
def test_a_step_without_water_is_refused_by_its_time(change, says, tmp_path):
    data = dataset()
    path = written(data.assign(uo=change(data.uo)), tmp_path / 'sea.nc')
    with pytest.raises(ValueError, match=f'file {path}: {says}'):
        grid(path, (36.0, 122.0))


@pytest.mark.parametrize('packed', [False, True])
@pytest.mark.parametrize(
    'told',
    [
        {'valid_min': np.float32(-5.0), 'valid_max': np.float32(5.0)},
        {'valid_range': np.array([-5.0, 5.0])},
        {'valid_max': np.int16(5000)},
    ],
)
def test_what_is_beyond_the_valid_numbers_of_a_variable_is_missing(told, packed, tmp_path):
    """Whole numbers are limits of what is packed; a number at its limit is valid."""
    data = dataset().clip(-4.0, 4.0)
    data.uo[:, :, 8, 8], data.uo[:, :, 0, 0] = 9.0, 5.0
    data.uo.attrs |= told
    loaded = load(written(data, tmp_path / 'sea.nc', packed))
    if packed or 'int16' not in str(told):
        assert loaded.land[8, 8] and loaded.land.sum() == 1
        assert abs(loaded.water[..., 1]).max() == pytest.approx(5.0)
    else:
        assert not loaded.land.any()


@pytest.mark.parametrize(
    'told',
    [
        {'units': 'days since 2026-01-01', 'calendar': '360_day'},
        {'units': 'days since 0001-01-01', 'calendar': 'standard'},
        {'units': 'moons since 2026-01-01'},
        {'units': 'days since 2026-01-01', 'calendar': 7},
    ],
)
def test_times_of_another_calendar_are_refused(told, tmp_path):
    data = dataset().assign_coords(time=('time', np.arange(4.0), {'axis': 'T', **told}))
    data.to_netcdf(tmp_path / 'sea.nc', engine='scipy')
    with pytest.raises(ValueError, match=r'no times of this world \(allowed: such as'):
        grid(tmp_path / 'sea.nc', (36.0, 122.0))


def test_a_file_that_was_written_anew_is_read_anew(tmp_path):
    path = written(dataset(), tmp_path / 'sea.nc')
    before = interpolate(0.0, 10.0, 36.1, 122.1, grid(path, (36.0, 122.0)))
    written(dataset(seed=7), path)
    assert interpolate(0.0, 10.0, 36.1, 122.1, grid(path, (36.0, 122.0))) != before


def test_land_is_told_and_has_the_water_beside_it(tmp_path):
    data = dataset()
    shore = (data.longitude < 121.0) | (data.depth > 500.0)
    path = written(data.where(~shore), tmp_path / 'sea.nc', packed=True)
    loaded = load(path)
    assert loaded.land[:, :4].all()
    assert not loaded.land[:, 4:].any()
    params = grid(path, (36.0, 122.0))
    at_shore = interpolate(0.0, 0.0, 36.0, 121.0, params)
    assert interpolate(0.0, 0.0, 36.0, 120.1, params) == pytest.approx(at_shore)
    above = interpolate(0.0, 266.0, 36.0, 122.0, params)
    assert interpolate(0.0, 900.0, 36.0, 122.0, params) == pytest.approx(above)
    with pytest.raises(ValueError, match=r'36.0000, 120.3000 on the path is land'):
        grid(path, (36.0, 120.3))


def test_a_level_without_water_has_that_of_the_one_beside_it(tmp_path):
    """The one above it; of the uppermost there is only that below."""
    data = dataset()
    wet = (data.depth > DEPTHS[0]) & (data.depth != DEPTHS[3])
    water = load(written(data.where(wet | (data.time != data.time[2])), tmp_path / 'sea.nc')).water
    whole = load(written(data, tmp_path / 'whole.nc')).water
    assert water[2] == pytest.approx(whole[2][[1, 1, 2, 2, *range(4, len(DEPTHS))]])
    assert (water[[0, 1, 3]] == whole[[0, 1, 3]]).all()


@pytest.mark.parametrize(
    ('places', 'more', 'text'),
    [
        ([(36.0, 122.0), (38.5, 122.0)], {}, r'latitude of the path goes from 36.000 to 38.500'),
        ([(36.0, -60.0)], {}, r'longitude of the path goes from -60.000 to -60.000 deg \(allowed'),
        ([(36.0, 122.0)], {'begin': '2026-02-01'}, r'from 2026-02-01T00:00Z to 2026-02-04T00:00Z '
         r'\(allowed: within 2026-03-01T12:00Z to 2026-03-04T12:00Z'),
        ([(36.0, 122.0)], {'lasts_s': 1e6}, 'the mission goes from'),
        ([(36.0, 122.0)], {'begin': '', 'lasts_s': 1e6}, r'lasts 1,000,000 s \(allowed: <= 259,2'),
    ],
)  # fmt: skip
def test_what_the_file_does_not_cover_is_refused(places, more, text, tmp_path):
    path = written(dataset(), tmp_path / 'sea.nc')
    with pytest.raises(ValueError, match=text):
        grid(path, *places, **more)


@pytest.mark.parametrize('begin', ['2026-03-01T12:00', ''])
def test_days_that_are_missing_in_a_file_are_refused_within_a_mission_alone(begin, tmp_path):
    data = dataset()
    days = TIMES + np.array([0, 0, 72, 72]) * np.timedelta64(1, 'h')
    path = written(data.assign_coords(time=data.time.copy(data=days)), tmp_path / 'sea.nc')
    with pytest.raises(ValueError, match='no water between 2026-03-02T12:00Z and 2026-03-06T1'):
        grid(path, (36.0, 122.0), begin=begin)
    grid(path, (36.0, 122.0), begin=begin, lasts_s=86400.0)
    grid(path, (36.0, 122.0), begin='2026-03-06T12:00', lasts_s=86400.0)


@pytest.mark.parametrize('kind', ['float32', 'float64'])
def test_a_waypoint_at_the_edge_of_a_file_is_within_it_as_a_person_writes_both(kind, tmp_path):
    latitudes, longitudes = np.arange(34.7, 36.35, 0.1), np.arange(121.1, 122.95, 0.1)
    data = dataset(latitudes=latitudes.astype(kind), longitudes=longitudes.astype(kind))
    path = written(data, tmp_path / 'sea.nc')
    found = grid(path, (34.7, 121.1), (36.3, 122.9))
    assert (len(found.latitudes), len(found.longitudes)) == (17, 19)
    with pytest.raises(ValueError, match='latitude of the path goes from 34.700 to 36.301'):
        grid(path, (34.7, 121.1), (36.301, 122.9))


def bent(data):
    """The same on a curvilinear grid."""
    flat = data.rename(latitude='y', longitude='x').drop_vars(['y', 'x'])
    across = np.tile(data.latitude.values[:, None], (1, data.sizes['longitude']))
    return flat.assign_coords(nav_lat=(('y', 'x'), across, {'units': 'degrees_north'}))


def called(data, **standards):
    """The same with axes that have such standard names."""
    named = {name: data[name].assign_attrs(standard_name=one) for name, one in standards.items()}
    return data.assign_coords(named)


@pytest.mark.parametrize(
    ('change', 'text'),
    [
        (lambda one: one.drop_vars('vo'), 'no velocity to the north .*it has uo'),
        (bent, 'uo: dimension y is no axis; a curvilinear grid: nav_lat has two dimensions'),
        (lambda one: one.rename(depth='s_rho').drop_vars('s_rho'), 'follow the bottom, as ROMS'),
        (lambda one: one.assign(vo=one.vo.rename(latitude='latitude_v').assign_coords(
            latitude_v=one.latitude.values + 0.1).assign_attrs(one.vo.attrs)),
         r'dimension latitude_v is no axis'),
        (lambda one: one.assign(uo=one.uo.assign_attrs(units='knots')), "uo: units = 'knots'"),
        (lambda one: one.isel(latitude=[0, 2, 1]), 'latitude: neither increases nor decreases'),
        (lambda one: one.isel(longitude=0), 'uo: no axis of longitude'),
        (lambda one: called(one, latitude='grid_latitude'), 'latitude is no axis; a rotated grid'),
        (lambda one: called(one, depth='ocean_s_coordinate_g1'), 'levels that follow the bottom'),
        (lambda one: one.assign_coords(depth=one.depth.assign_attrs(positive='up')),
         'depth: positive up, and no level below the surface'),
        (lambda one: one.assign(uo=one.uo.assign_attrs(scale_factor='0.01 m/s')), 'uo: scale_fac'),
    ],
)  # fmt: skip
def test_what_is_no_regular_grid_is_refused_by_name(change, text, tmp_path):
    path = written(change(dataset()), tmp_path / 'sea.nc')
    with pytest.raises(ValueError, match=rf'file {path}: .*{text}'):
        load(path)


def test_what_is_no_file_is_refused(tmp_path):
    with pytest.raises(ValueError, match='no such file'):
        load(tmp_path / 'none.nc')
    (tmp_path / 'text.nc').write_text('hello')
    with pytest.raises(ValueError, match='not a NetCDF file that xarray reads'):
        load(tmp_path / 'text.nc')


def test_a_file_whose_numbers_were_damaged_on_the_way_is_named(tmp_path):
    pytest.importorskip('h5netcdf')
    path, data = tmp_path / 'sea.nc', dataset()
    data.to_netcdf(path, engine='h5netcdf', encoding={name: {'zlib': True} for name in data})
    whole = path.read_bytes()
    half = len(whole) // 2  # among what is packed
    path.write_bytes(whole[:half] + bytes(1000) + whole[half + 1000 :])
    with pytest.raises(ConfigurationError, match=f'file {path}: .*read data'):
        load(path)


@pytest.mark.parametrize('read', [load, read_cast])
def test_who_lacks_a_library_for_netcdf_4_is_told_which(read, tmp_path, monkeypatch):
    path = tmp_path / 'sea.nc'
    path.write_bytes(b'\x89HDF\r\n\x1a\n')
    monkeypatch.setitem(sys.modules, 'h5netcdf', None)
    with pytest.raises(ValueError, match=rf'{path}: h5netcdf, .*not installed; .*-flights.txt'):
        read(path)


def test_what_is_in_a_file(tmp_path):
    path = written(dataset('hycom'), tmp_path / 'sea.nc', packed=True)
    found = contents(path)
    assert list(found.parts) == ['currents'] and not found.refused
    currents = found.parts['currents']
    assert [one['name'] for one in currents.variables] == ['water_v', 'water_u']
    np.testing.assert_allclose(currents.axes['depth'], DEPTHS)
    assert currents.axes['time'][0] == TIMES[0].astype('M8[s]').astype(float)


def test_a_part_that_cannot_be_used_is_told_beside_one_that_can(tmp_path):
    path = written(xarray.merge([dataset(), hydrography(temperature='K')]), tmp_path / 'sea.nc')
    found = contents(path)
    assert list(found.parts) == ['currents']
    assert found.refused['water'].startswith("thetao: units = 'K' (allowed: degrees_C")


@pytest.mark.parametrize(
    ('change', 'says'),
    [
        (lambda data: data.drop_vars('so'), r'no salinity \(allowed: .* it has thetao'),
        (lambda data: data.rename(latitude='node'), r'dimension node is no axis; a mesh'),
        (
            lambda data: data[['so']].rename(so='foo').drop_attrs(),
            r'no currents, no temperature and salinity, and no bottom \(allowed: .* it has foo\)',
        ),
    ],
)
def test_a_file_of_which_nothing_can_be_used_is_refused_by_name(change, says, tmp_path):
    path = written(change(hydrography()), tmp_path / 'sea.nc')
    with pytest.raises(ValueError, match=rf'file {path}: .*{says}'):
        contents(path)


def test_another_file_is_told_from_the_one_that_was_flown(tmp_path):
    path = written(dataset(), tmp_path / 'sea.nc')
    known = GridSettings(file=str(path)).known()
    assert known.known() == known
    written(dataset(seed=7), path)
    with pytest.raises(ValueError, match='not the one that was flown'):
        known.known()


def test_steps_of_a_window_are_read_together(tmp_path, monkeypatch):
    """Those that are packed together are unpacked once; the water is that of step by step."""
    path, reads, cut = written(dataset(), tmp_path / 'sea.nc'), [], grid_file._cut
    monkeypatch.setattr(grid_file, '_cut', lambda *given: reads.append(given) or cut(*given))
    together = load(path)
    assert len(reads) == 2
    monkeypatch.setattr(grid_file, '_BLOCK_BYTES', 1)
    np.testing.assert_array_equal(load(path).water, together.water)


def test_of_a_large_file_the_window_alone_is_read(tmp_path):
    """A file of 5 GB, sparse: what is read is counted by the size of what is kept."""
    h5py = pytest.importorskip('h5py')
    path = tmp_path / 'large.nc'
    shape = (30, 40, 1000, 2000)
    with h5py.File(path, 'w') as file:
        axes = {
            'time': (np.arange(30.0), {'units': 'days since 2026-03-01', 'standard_name': 'time'}),
            'depth': (np.linspace(0.5, 2000.0, 40), {'units': 'm', 'positive': 'down'}),
            'latitude': (np.linspace(20.0, 60.0, 1000), {'units': 'degrees_north'}),
            'longitude': (np.linspace(100.0, 180.0, 2000), {'units': 'degrees_east'}),
        }
        for name, (values, attrs) in axes.items():
            file[name] = values
            file[name].make_scale(name)
            file[name].attrs.update(attrs)
        for name, side in (('uo', 'east'), ('vo', 'north')):
            made = file.create_dataset(
                name, shape, 'i2', chunks=(1, 1, 1000, 2000), fillvalue=np.int16(250)
            )
            made.attrs['standard_name'] = f'{side}ward_sea_water_velocity'
            made.attrs['units'], made.attrs['scale_factor'] = 'm s-1', 0.001
            for number, dimension in enumerate(axes):
                made.dims[number].attach_scale(file[dimension])
        assert 2 * np.prod(shape) * 2 > 5e9 * 0.9
    params = grid(path, (36.0, 122.0), (37.0, 123.0), begin='2026-03-05', lasts_s=86400.0 * 3)
    assert params.water.nbytes < 20e6
    assert interpolate(1000.0, 50.0, 36.5, 122.5, params) == pytest.approx((0.25, 0.25))


# ---------------------------------------------------------------------- bottom


def chart(path, name, seed=0, sign=1.0, **attributes):
    """File of a random bottom of some hundred metres."""
    rng = np.random.default_rng(seed)
    latitudes, longitudes = np.arange(35.0, 37.01, 0.05), np.arange(121.0, 123.01, 0.05)
    depth = rng.uniform(100.0, 900.0, (len(latitudes), len(longitudes))).round()
    coords = {
        'lat': ('lat', latitudes, {'units': 'degrees_north'}),
        'lon': ('lon', longitudes, {'units': 'degrees_east'}),
    }
    data = xarray.Dataset(
        {name: (('lat', 'lon'), (sign * depth).astype(np.int16), attributes)}, coords
    )
    data.to_netcdf(path, engine='scipy')
    return data[name]


@pytest.mark.parametrize(
    ('name', 'sign', 'told'),
    [
        ('elevation', -1.0, {'standard_name': 'height_above_mean_sea_level'}),
        ('deptho', 1.0, {'standard_name': 'sea_floor_depth_below_geoid'}),
        ('z', -1.0, {}),
        ('z', 1.0, {'positive': 'down'}),
        ('bathymetry', -1.0, {'positive': 'up'}),
    ],
)
def test_the_bottom_is_what_xarray_makes_of_a_chart(name, sign, told, tmp_path):
    data = chart(tmp_path / 'chart.nc', name, sign=sign, units='m', **told)
    flown = mission((35.5, 121.5), (36.5, 122.5))
    settings = BathymetrySettings(file=str(tmp_path / 'chart.nc')).resolved(flown)
    params = settings.params()
    rng = np.random.default_rng(3)
    latitudes, longitudes = rng.uniform(35.5, 36.5, 1000), rng.uniform(121.5, 122.5, 1000)
    at = {'lat': ('p', latitudes), 'lon': ('p', longitudes)}
    wanted = sign * data.interp(**at).values
    north, east = from_geodetic_all(latitudes, longitudes, flown.origin)
    found = [bottom_depth(n, e, params) for n, e in zip(north, east, strict=True)]
    np.testing.assert_allclose(found, wanted, rtol=0.0, atol=1e-3)


def from_geodetic_all(latitudes, longitudes, origin):
    """Places on the chart of an origin (m)."""
    places = [
        from_geodetic(a, b, origin.params()) for a, b in zip(latitudes, longitudes, strict=True)
    ]
    return np.array(places).T


@pytest.mark.parametrize(
    ('place', 'attributes', 'text'),
    [
        ((30.0, 122.0), {'units': 'm'}, 'latitude of the path goes from 30.000'),
        ((36.0, 122.0), {'units': 'fathoms'}, "elevation: units = 'fathoms'"),
        ((36.0, 122.0), {'units': 'm', 'scale_factor': 60.0}, 'elevation: 53760 m'),
    ],
)
def test_a_chart_that_does_not_serve_is_refused_by_name(place, attributes, text, tmp_path):
    chart(tmp_path / 'chart.nc', 'elevation', sign=-1.0, **attributes)
    settings = BathymetrySettings(file=str(tmp_path / 'chart.nc')).resolved(mission(place))
    with pytest.raises(ValueError, match=f'file .*chart.nc: .*{text}'):
        settings.params()


@pytest.mark.parametrize('wrong', [math.nan, 35.0])
def test_a_chart_of_the_bottom_whose_latitudes_are_in_no_order_is_no_chart(wrong, tmp_path):
    data = chart(tmp_path / 'chart.nc', 'elevation', sign=-1.0, units='m')
    latitudes = data.lat.values.copy()
    latitudes[7] = wrong
    lat = data.lat.copy(data=latitudes)
    path = written(data.assign_coords(lat=lat).to_dataset(), tmp_path / 'wrong.nc')
    with pytest.raises(ValueError, match='lat: neither increases nor decreases'):
        contents(path)
    settings = BathymetrySettings(file=str(path)).resolved(mission((36.0, 122.0)))
    with pytest.raises(ValueError, match='lat: neither increases nor decreases'):
        settings.params()


def test_a_chart_is_land_where_it_has_no_number(tmp_path):
    data = chart(tmp_path / 'chart.nc', 'elevation', sign=-1.0, units='m').astype(float)
    data[0, :3] = [math.nan, math.inf, -math.inf]
    data[0, 3:5] = [20.0, math.nan]  # within land, too
    path = written(data.to_dataset(), tmp_path / 'holes.nc')
    depth = contents(path).parts['bottom'].seen.water[0, 0, ..., 0]
    assert np.all(depth[0, :5] <= 0.0) and np.all(depth[1:] >= 100.0)


def test_a_path_over_land_is_refused(tmp_path):
    chart(tmp_path / 'chart.nc', 'elevation', sign=1.0, units='m')
    settings = BathymetrySettings(file=str(tmp_path / 'chart.nc')).resolved(mission((36.0, 122.0)))
    with pytest.raises(ValueError, match=r'36.0000, 122.0000 on the path is land'):
        settings.params()


#: Names of CMEMS and HYCOM, and what CF calls their temperature.
HYDROGRAPHY = {
    'cmems': ('thetao', 'so', 'sea_water_potential_temperature'),
    'hycom': ('water_temp', 'salinity', 'sea_water_temperature'),
}
PLACES = (35.0, 121.0), (37.0, 123.0)


@pytest.fixture
def gsw():
    """The library by which density follows from temperature and salinity."""
    return pytest.importorskip('gsw')


def hydrography(layout='cmems', **units):
    """A warm and fresh front to the north, that warms by the day."""
    latitudes, longitudes = np.arange(34.0, 38.01, 0.25), np.arange(120.0, 124.01, 0.25)
    t, z, y, x = np.meshgrid(np.arange(4.0), DEPTHS, latitudes, longitudes, indexing='ij')
    warm = 4.0 + 14.0 * np.exp(-z / 150.0) + (y - 36.0) + 0.2 * t + 0.1 * x - 12.0
    salt = 34.5 + 0.4 * (1.0 - np.exp(-z / 200.0)) - 0.2 * (y - 36.0)
    temperature, salinity, standard = HYDROGRAPHY[layout]
    dims = ('time', 'depth', 'latitude', 'longitude')
    told = {'temperature': 'degrees_C', 'salinity': '1e-3', **units}
    variables = {
        temperature: (dims, warm, {'standard_name': standard, 'units': told['temperature']}),
        salinity: (
            *(dims, salt),
            {'standard_name': 'sea_water_salinity', 'units': told['salinity']},
        ),
    }
    coords = {
        'time': ('time', TIMES, {'standard_name': 'time'}),
        'depth': ('depth', DEPTHS, {'units': 'm', 'positive': 'down'}),
        'latitude': ('latitude', latitudes, {'units': 'degrees_north'}),
        'longitude': ('longitude', longitudes, {'units': 'degrees_east'}),
    }
    return xarray.Dataset(variables, coords)


def bottom_of(path, *places):
    """Kernel parameters of the bottom of a mission."""
    return BathymetrySettings(file=str(path)).resolved(mission(*places)).params()


def params_of(path, *places):
    """Kernel parameters of a mission's water."""
    return ModelWaterSettings(file=str(path)).resolved(mission(*places)).params(0.0)


@pytest.mark.parametrize('layout', HYDROGRAPHY)
def test_density_is_that_of_gsw_at_the_points_of_the_grid(layout, gsw, tmp_path):
    """1e-3 kg/m^3, and 1e-5 degC in place: potential temperature is not that of the place."""
    data = hydrography(layout)
    params = params_of(written(data, tmp_path / 'sea.nc'), *PLACES)
    temperature, salinity, standard = HYDROGRAPHY[layout]
    for t, z, latitude, longitude in (
        (0, 0, 35.0, 121.0),
        (2, 6, 36.5, 122.25),
        (3, 8, 37.0, 123.0),
    ):
        at = data.isel(time=t, depth=z).sel(latitude=latitude, longitude=longitude)
        pressure = gsw.p_from_z(-DEPTHS[z], 45.0)
        absolute = gsw.SR_from_SP(at[salinity].item())
        make = gsw.CT_from_pt if 'potential' in standard else gsw.CT_from_t
        more = () if 'potential' in standard else (pressure,)
        conservative = make(absolute, at[temperature].item(), *more)
        n, e = from_geodetic(latitude, longitude, params.grid.origin)
        rise, warm = water_there(DEPTHS[z], params._replace(n=n, e=e, t_s=t * 86400.0))
        density = SEA_WATER_DENSITY * (1.0 + rise)
        assert density == pytest.approx(gsw.rho(absolute, conservative, pressure), abs=1e-3)
        assert warm == pytest.approx(gsw.t_from_CT(absolute, conservative, pressure), abs=1e-5)


def test_between_the_points_it_is_linear_and_held_at_the_ends(gsw, tmp_path):
    params = params_of(written(hydrography(), tmp_path / 'sea.nc'), *PLACES)
    last = water_there(DEPTHS[-1], params)
    assert water_there(2000.0, params) == last and water_there(0.0, params) == water_there(
        0.4, params
    )
    between = water_there(0.5 * (DEPTHS[6] + DEPTHS[7]), params)
    ends = [water_there(DEPTHS[i], params) for i in (6, 7)]
    assert between == pytest.approx(np.mean(ends, axis=0), abs=1e-12)


def test_a_vehicle_is_neutral_where_it_was_ballasted_and_lighter_in_denser_water(gsw, tmp_path):
    """In the fresh and warm north it is heavier by as much as its volume of water is lighter."""
    told = WaterSettings(grid={'file': str(written(hydrography(), tmp_path / 'sea.nc'))})
    water = told.model_copy(update={'grid': told.grid.resolved(mission(*PLACES))})
    plant = PlantSettings(water=water).params()
    there = around(
        plant, *from_geodetic(*PLACES[1], plant.density.grid.origin), 0.0, plant.density
    )
    here = around(plant, *from_geodetic(*PLACES[0], plant.density.grid.origin), 0.0, plant.density)
    net = [immersed(0.0, 0.0, one.vehicle, one.density).net for one in (here, there)]
    assert net[0] == pytest.approx(0.0, abs=1e-9)
    rises = [water_there(0.0, one.density)[0] for one in (here, there)]
    volume = plant.vehicle.m / (SEA_WATER_DENSITY * (1.0 + rises[0]))
    assert net[1] == pytest.approx(volume * SEA_WATER_DENSITY * (rises[0] - rises[1]), rel=1e-9)
    assert net[1] > 0.05


@pytest.mark.parametrize(
    ('change', 'says'),
    [
        (
            lambda data: data.drop_vars('so'),
            r'no salinity \(allowed: .* called so or salinity; it',
        ),
        (lambda data: hydrography(temperature='K'), r"thetao: units = 'K' \(allowed: degrees_C"),
        (lambda data: data.isel(time=slice(0, 2)), r'the mission goes from .* the times of the'),
        (lambda data: data.where(data.latitude > 35.2), r'35.0000, 121.0000 on the path is land'),
        (lambda data: data.rename(latitude='node'), r'dimension node is no axis; a mesh'),
    ],
)
def test_what_has_no_such_water_is_refused_by_name(change, says, tmp_path):
    path = written(change(hydrography()), tmp_path / 'sea.nc')
    with pytest.raises(ValueError, match=says) as error:
        params_of(path, *PLACES)
    assert str(path) in str(error.value)


@pytest.mark.parametrize(
    ('also', 'says'),
    [
        ({'pycnocline_rise': 0.002}, r'pycnocline_rise = 0.002: the grid says the density'),
        ({'profile': [[0.0, 1025.0]]}, r'profile: the grid says the density'),
    ],
)
def test_the_grid_alone_says_the_density(also, says):
    with pytest.raises(ConfigurationError, match=says):
        validate(WaterSettings, {'grid': {'file': 'sea.nc'}, **also}, 'water')
