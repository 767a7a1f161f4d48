# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Measured water: its files, its table, and what a vehicle weighs in it."""

import sys

import numpy as np
import pytest
import xarray
from pydantic import ValidationError

from glider_model.ocean.cast import look_up, read_cast
from glider_model.ocean.density import immersed
from glider_model.ocean.water import WaterSettings
from glider_model.vehicle.file import load_vehicle

G = 9.81
ZHANG = load_vehicle('zhang2021').params()
#: A vehicle of which everything is told that Merckelbach et al. (2019) weigh it by.
TOLD = ZHANG._replace(
    volume=69.0 / 1027.0,
    compressibility=5e-10,
    thermal_expansion=6e-5,
    reference_temperature=15.0,
    ballast=0.02,
)
ROWS = [[0.0, 1025.0, 20.0], [50.5, 1026.0, 14.0], [400.0, 1029.5, 4.0]]


def water(**fields):
    return WaterSettings(**fields).params()


@pytest.fixture
def csv(tmp_path):
    """``csv(text)``: settings of water with a file of that text."""

    def make(text, name='cast.csv'):
        (tmp_path / name).write_text(text)
        return WaterSettings.model_validate({'profile': name}, context={'folder': tmp_path})

    return make


@pytest.mark.parametrize('depth', [-2.0, 0.0, 0.25, 17.0, 50.0, 123.4, 399.5, 400.0, 900.0])
def test_the_table_is_linear_between_metres_and_held_at_its_ends(depth):
    ratio, temperature = look_up(depth, water(profile=ROWS).rows)
    rows = np.array(ROWS)
    # a break between two whole metres is rounded by less than its step of a metre
    assert ratio * 1025.0 == pytest.approx(np.interp(depth, rows[:, 0], rows[:, 1]), abs=0.005)
    assert temperature == pytest.approx(np.interp(depth, rows[:, 0], rows[:, 2]), abs=0.05)


def test_depth_that_is_no_number_reads_the_surface():
    assert look_up(float('nan'), water(profile=ROWS).rows) == (1.0, 20.0)


@pytest.mark.parametrize('depth', [0.0, 20.0, 300.0])
@pytest.mark.parametrize('m_b', [-0.3, 0.0, 0.2])
def test_net_weight_is_that_of_merckelbach(depth, m_b):
    """m - rho (V (1 - eps P + a_T (T - T_0)) + V_bp), V_bp = -m_b / 1025; to a tenth of a gram."""
    found = immersed(depth, m_b, TOLD, water(profile=ROWS))
    rho = np.interp(depth, [row[0] for row in ROWS], [row[1] for row in ROWS])
    temperature = np.interp(depth, [row[0] for row in ROWS], [row[2] for row in ROWS])
    hull = TOLD.volume * (1.0 - 5e-10 * 1025.0 * G * depth + 6e-5 * (temperature - 15.0))
    expected = 69.0 - rho * (hull - m_b / 1025.0) + 0.02
    assert found.net == pytest.approx(expected, abs=1e-4)
    assert found.ratio == pytest.approx(rho / 1025.0, rel=1e-6)


def test_a_vehicle_without_a_volume_is_neutral_at_the_surface_of_any_water():
    params = water(profile=[[0.0, 1010.0], [100.0, 1020.0]])
    assert immersed(0.0, 0.0, ZHANG, params).net == pytest.approx(0.0, abs=1e-12)
    assert immersed(100.0, 0.0, ZHANG, params).net == pytest.approx(-69.0 / 101.0, rel=1e-12)


@pytest.mark.parametrize(
    'told', [{'pycnocline_rise': 0.004}, {'compression_per_m': 4.5e-6}, {}], ids=str
)
def test_a_volume_in_water_that_is_told_by_numbers(told):
    """The same formula with rho = 1025 (1 + rise (1 - exp(-z / 100)) + c z)."""
    found = immersed(250.0, 0.1, TOLD, water(**told))
    rise = told.get('pycnocline_rise', 0.0) * (1.0 - np.exp(-2.5))
    rho = 1025.0 * (1.0 + rise + told.get('compression_per_m', 0.0) * 250.0)
    hull = TOLD.volume * (1.0 - 5e-10 * 1025.0 * G * 250.0)
    assert found.net == pytest.approx(69.02 - rho * (hull - 0.1 / 1025.0), abs=1e-9)


def test_dense_water_slows_a_glide_as_the_root_of_its_density(fly, plant_params, start):
    """At one net weight: speed over that in 1025 kg/m^3."""
    speeds = []
    for density in (1025.0, 1045.0):
        params = plant_params('zhang2021', profile=[[0.0, density], [3000.0, density]])
        # the oil makes as much net weight as in the other water
        joints = (0.4 * 1025.0 / density, 0.0162, 0.0)
        state = start((0, 0, 300), (0, -0.52, 0), (0.5, 0, 0, 0, 0, 0), joints)
        flight = fly(params, state, 600.0)
        speeds.append(np.linalg.norm(flight.velocity[-1, :3]))
        assert np.isfinite(flight.rows).all()
    assert speeds[1] / speeds[0] == pytest.approx((1025.0 / 1045.0) ** 0.5, rel=0.005)


def test_a_file_of_densities(csv):
    text = (
        'depth_m, density_kgpm3, temperature_degC\n0, 1025.0, 20\n50.5, 1026, 14\n400, 1029.5, 4\n'
    )
    assert csv(text).profile == ROWS


def test_a_file_of_temperature_and_salinity(csv):
    """Against the check values of TEOS-10: gsw.rho of S_R and CT."""
    gsw = pytest.importorskip('gsw')
    rows = csv('depth_m,temperature_degC,salinity_psu\n0,20,35\n1000,5,34.5\n').profile
    pressure = gsw.p_from_z(-1000.0, 45.0)
    salinity = 34.5 * 35.16504 / 35.0
    expected = gsw.rho(salinity, gsw.CT_from_t(salinity, 5.0, pressure), pressure)
    assert rows[1] == pytest.approx([1000.0, expected, 5.0], rel=1e-9)
    assert 1024.5 < rows[0][1] < 1025.0  # 1024.763 by EOS-80
    assert 1031.0 < rows[1][1] < 1033.0


def test_without_gsw_one_sentence_says_how_to_get_it(csv, monkeypatch):
    monkeypatch.setitem(sys.modules, 'gsw', None)
    with pytest.raises(ValidationError, match='gsw, .* is not installed; install it with: ./gl'):
        csv('depth_m,temperature_degC,salinity_psu\n0,20,35\n')


def test_a_cast_in_netcdf(tmp_path):
    """By CF names; sorted, samples without a number left out, those of one depth averaged."""
    pytest.importorskip('h5netcdf')
    depth = [400.0, 0.0, 50.0, 50.0, 60.0]
    density = [1029.5, 1025.0, 1025.9, 1026.1, np.nan]
    values = xarray.Dataset(
        {
            'RHO': ('N', density, {'standard_name': 'sea_water_density'}),
            'Z': ('N', depth, {'standard_name': 'depth'}),
            'FLUO': ('N', density),
        }
    )
    values.to_netcdf(tmp_path / 'cast.nc', engine='h5netcdf')
    found = WaterSettings.model_validate({'profile': 'cast.nc'}, context={'folder': tmp_path})
    assert found.profile == [[0.0, 1025.0], [50.0, 1026.0], [400.0, 1029.5]]
    values['Z'] = ('N', np.negative(depth), {'standard_name': 'depth', 'positive': 'up'})
    values.to_netcdf(tmp_path / 'heights.nc', engine='h5netcdf')
    found = WaterSettings.model_validate({'profile': 'heights.nc'}, context={'folder': tmp_path})
    assert found.profile == [[0.0, 1025.0], [50.0, 1026.0], [400.0, 1029.5]]


@pytest.mark.parametrize(
    ('name', 'unit', 'scale'),
    [('depth', 'km', 1e-3), ('sea_water_pressure', 'bar', 0.1), ('sea_water_pressure', 'Pa', 1e4)],
)
def test_depths_of_a_cast_are_in_units_of_their_own(name, unit, scale, tmp_path):
    """They were taken for m and dbar; others are refused, and what is not valid is left out."""
    density = np.array([1025.0, 1090.0, 1029.5])
    told = {'standard_name': 'sea_water_density', 'valid_max': 1040.0}
    cast = {'RHO': ('N', density, told)}
    deep = {'standard_name': name, 'units': unit}
    cast['Z'] = ('N', scale * np.array([0.0, 50.0, 400.0]), deep)
    xarray.Dataset(cast).to_netcdf(tmp_path / 'cast.nc', engine='scipy')
    (_, first), (depth_m, last) = read_cast(tmp_path / 'cast.nc')
    assert (first, last) == (1025.0, 1029.5) and depth_m == pytest.approx(400.0, rel=0.01)
    deep['units'] = 'feet'
    xarray.Dataset(cast).to_netcdf(tmp_path / 'feet.nc', engine='scipy')
    with pytest.raises(ValueError, match=r"feet.nc: Z: units = 'feet' \(allowed: "):
        read_cast(tmp_path / 'feet.nc')


MEASURED = 'depth_m,temperature_degC,salinity_psu\n'


@pytest.mark.parametrize(
    ('text', 'told'),
    [
        ('depth_m,sigma\n0,25\n', "column 'sigma' is unknown .allowed: depth_m, density_kgpm3, "),
        ('density_kgpm3\n1025\n', 'column depth_m is missing'),
        ('depth_m,salinity_psu\n0,35\n', 'column density_kgpm3 is missing .allowed: density'),
        (MEASURED + '0,-999,35\n', 'row 2, column temperature_degC = -999.0 .allowed: >= -5'),
        (MEASURED + '0,9,99.99\n', 'row 2, column salinity_psu = 99.99 .allowed: >= 0'),
        (
            'depth_m,density_kgpm3\n0,25.5\n',
            'row 1?2?, column density_kgpm3 = 25.5 .allowed: >= 950',
        ),
        ('depth_m,density_kgpm3\n5,1025\n5,1026\n', 'depths must increase'),
        ('depth_m,density_kgpm3\n', 'no rows'),
        ('depth_m,density_kgpm3\n0,x\n', "'x': not a finite number"),
    ],
)
def test_a_file_that_is_no_water_is_refused(csv, text, told):
    with pytest.raises(ValidationError, match=told):
        csv(text)


def test_a_file_that_is_no_cast_is_refused(csv):
    with pytest.raises(ValidationError, match='not a NetCDF file that xarray reads'):
        csv('depth', name='cast.nc')


def test_a_profile_leaves_nothing_to_be_told_of_the_density():
    with pytest.raises(ValidationError, match='pycnocline_rise = 0.004: the profile says'):
        WaterSettings(profile=ROWS, pycnocline_rise=0.004)
