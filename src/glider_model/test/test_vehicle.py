# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Vehicle files: what comes with the package, and what is refused with which words."""

import copy
import math
import re

import pytest
import yaml

from glider_base.errors import ConfigurationError
from glider_base.files import read_yaml
from glider_model.vehicle.file import VEHICLE_FOLDER, load_vehicle, vehicle_names, vehicle_path

MISSING = object()


@pytest.fixture(scope='module')
def values():
    return read_yaml(VEHICLE_FOLDER / 'zhang2021.yaml')


@pytest.fixture
def edited(tmp_path, values):
    """``edited('hull.length.value', 3.0)``: path of a copy of zhang2021 with one change."""

    def edit(field, value):
        changed = copy.deepcopy(values)
        *groups, last = field.split('.')
        group = changed
        for name in groups:
            group = group[name]
        if value is MISSING:
            del group[last]
        else:
            group[last] = value
        path = tmp_path / 'vehicle.yaml'
        path.write_text(yaml.safe_dump(changed), encoding='utf-8')
        return str(path)

    return edit


# ------------------------------------------------------------------------------- what there is


def test_vehicles_of_the_package():
    assert vehicle_names() == [
        'seaglider',
        'seawing',
        'slocum_g2',
        'zhang2021',
        'zhang2021_table1',
    ]


@pytest.mark.parametrize('name', vehicle_names())
def test_vehicle_is_called_like_its_file(name):
    assert load_vehicle(name).name == name


@pytest.mark.parametrize('name', vehicle_names())
def test_parameters_are_finite(name):
    numbers = load_vehicle(name).params()._asdict()
    numbers.pop('surface')
    errors = numbers.pop('errors')
    numbers |= errors.dead_band._asdict() | {'rate_per_m': errors.rate_per_m}
    assert all(math.isfinite(number) for number in numbers.values())


@pytest.mark.parametrize('name', vehicle_names())
def test_the_hull_hangs_below_its_buoyancy(name):
    """Metacentric moment of the vehicle at neutral (kg m), of a glider's order."""
    vehicle = load_vehicle(name).params()
    assert 0.2 < vehicle.s_z + vehicle.m_p * vehicle.R_p < 1.0


@pytest.mark.parametrize('name', vehicle_names())
def test_neutral_is_level(name):
    """First moment along x at neutral (kg m): below 0.1 mm of the moving mass."""
    vehicle = load_vehicle(name).params()
    assert abs(vehicle.s_x + vehicle.m_p * vehicle.x_p0) < 1e-4 * vehicle.m_p


def test_numbers_of_table_1():
    """Zhang et al. (2021): mass, inertia at neutral, added mass, rotary damping."""
    vehicle = load_vehicle('zhang2021').params()
    inertia = vehicle.m_p * vehicle.R_p**2
    assert vehicle.m == 69.0
    assert vehicle.i_xx + inertia == pytest.approx(0.54, abs=1e-12)
    assert vehicle.i_yy + inertia == pytest.approx(19.75, abs=1e-12)
    assert vehicle.i_zz == 19.82
    assert (vehicle.a_11, vehicle.a_22, vehicle.a_33) == (1.3, 79.66, 60.53)
    assert (vehicle.a_44, vehicle.a_55, vehicle.a_66) == (0.0, 21.83, 23.56)
    assert (vehicle.D_p, vehicle.D_q, vehicle.D_r) == (20.0, 35.0, 35.0)


def test_static_moments_of_zhang2021_with_munk():
    """Pitch -40 kg (stable nose-on), yaw +80 kg (weathercock) once the added mass has its part."""
    vehicle = load_vehicle('zhang2021').params()
    assert vehicle.K_M + vehicle.a_33 - vehicle.a_11 == pytest.approx(-40.0, abs=0.1)
    assert vehicle.K_MY - (vehicle.a_22 - vehicle.a_11) == pytest.approx(80.0, abs=0.1)


def test_numbers_of_seawing():
    vehicle = load_vehicle('seawing').params()
    assert vehicle.m == pytest.approx(65.28, abs=1e-12)
    assert vehicle.s_x / 54.28 == pytest.approx(-0.0814, abs=1e-12)
    assert (vehicle.a_26, vehicle.a_35) == (3.61, 2.57)
    assert (vehicle.K_M0, vehicle.K_MY) == (0.28, 34.10)
    assert (vehicle.K_p, vehicle.K_q, vehicle.K_r) == (-19.83, -205.64, -389.30)


def test_degrees_become_radians():
    vehicle = load_vehicle('zhang2021').params()
    assert vehicle.mu_max == pytest.approx(math.pi / 3.0, rel=1e-15)
    assert vehicle.mu_rate == pytest.approx(math.pi / 30.0, rel=1e-15)


def test_vehicle_by_path(edited):
    assert load_vehicle(edited('hull.length.value', 3.0)).hull.length.value == 3.0


# ----------------------------------------------------------------------------- what is refused


@pytest.mark.parametrize(
    ('field', 'value', 'expected'),
    [
        ('sonar', 1.0, 'sonar = 1.0: unknown field (allowed fields: name, description, '),
        ('hull.colour', 'red', "hull.colour = 'red': unknown field (allowed fields: length, "),
        (
            'hydrodynamics.K_D.value',
            math.nan,
            'hydrodynamics.K_D.value = nan: should be a finite number (allowed: >= 0.0 and <= ',
        ),
        (
            'rigid_body.hull_mass.value',
            -3.0,
            'rigid_body.hull_mass.value = -3.0: should be greater than 0 (allowed: > 0.0 and <= ',
        ),
        (
            'moving_mass.rotation.value',
            400.0,
            'moving_mass.rotation.value = 400.0: should be less than or equal to 180 '
            '(allowed: >= 0.0 and <= 180.0)',
        ),
        (
            'rigid_body.hull_mass.unit',
            'g',
            "rigid_body.hull_mass.unit = 'g': should be 'kg' (allowed: 'kg'; 1 g = 0.001 kg, ",
        ),
        (
            'rigid_body.hull_center_of_mass.unit',
            'mm',
            "rigid_body.hull_center_of_mass.unit = 'mm': should be 'm' (allowed: 'm'; 1 mm = ",
        ),
        ('hull.length.source', MISSING, 'hull.length.source: missing'),
        ('hull.length.source', '', "hull.length.source = '': "),
        ('hull.length', MISSING, 'hull.length: missing'),
        ('hull', MISSING, 'hull: missing'),
        (
            'hull.length',
            2.0,
            'hull.length = 2.0: expected a mapping of fields '
            '(allowed fields: value, unit, source)',
        ),
        (
            'hull',
            [1, 2],
            'hull = [1, 2]: expected a mapping of fields (allowed fields: length, diameter)',
        ),
        (
            'rigid_body.hull_inertia.value',
            [1.0, -2.0, 3.0],
            'rigid_body.hull_inertia.value.1 = -2.0: should be greater than or equal to 0 ',
        ),
        (  # beside K_q < 0, which damps, it is easily written so, and was no damping at all
            'hydrodynamics.linear_angular_damping.value',
            [0.0, -5.0, -37.0],
            'hydrodynamics.linear_angular_damping.value.1 = -5.0: should be greater than or '
            'equal to 0 (allowed: >= 0.0)',
        ),
        (
            'hydrodynamics.K_beta.value',
            120.0,
            'hydrodynamics.K_beta.value = 120.0: should be less than or equal to 0 (allowed: ',
        ),
        (  # a Slocum with it was 696 m off its path, and completed
            'hydrodynamics.K_q.value',
            200.0,
            'hydrodynamics.K_q.value = 200.0: should be less than or equal to 0 (allowed: ',
        ),
        (
            'hydrodynamics.K_r.value',
            111.0,
            'hydrodynamics.K_r.value = 111.0: should be less than or equal to 0 (allowed: ',
        ),
        (
            'hydrodynamics.K_D0.value',
            0.0,
            'hydrodynamics: K_D0 = 0: nothing brakes it (allowed: > 0 kg/m, or ',
        ),
        (  # z is down
            'rigid_body.hull_center_of_mass.value',
            [0.0, 0.0, -0.02],
            'rigid_body, moving_mass: top-heavy, its centre of mass is at z = -',
        ),
        (  # nothing took note of it
            'compressibility',
            {'value': 5e-10, 'unit': '1/Pa', 'source': 'Merckelbach et al. 2019'},
            'compressibility: of no volume (allowed: beside volume)',
        ),
        (
            'volume',
            {'value': 6.9, 'unit': 'l', 'source': 'tank, a digit lost'},
            'rigid_body, moving_mass, volume: neutral in water of 1e+04 kg/m^3 ',
        ),
        (
            'rigid_body.hull_inertia.value',
            [1.0, math.nan, 3.0],
            'rigid_body.hull_inertia.value.1 = nan: should be a finite number',
        ),
        (
            'rigid_body.hull_inertia.value',
            [1.0, 2.0],
            'rigid_body.hull_inertia.value = [1.0, 2.0]',
        ),
        (
            'added_mass.linear.value',
            [1.0, 2.0, 1e6],
            'added_mass.linear.value.2 = 1000000.0: should be less than or equal to 100000 ',
        ),
        (
            'added_mass.linear.value',
            [1.0, True, 3.0],
            'added_mass.linear.value.1 = True: should be a valid number',
        ),
        ('name', 'My Glider', "name = 'My Glider' (allowed: small letters, digits and _)"),
    ],
)
def test_message_names_file_field_value_and_range(edited, field, value, expected):
    path = edited(field, value)
    with pytest.raises(ConfigurationError) as caught:
        load_vehicle(path)
    where, _, told = str(caught.value).partition(': ')
    assert re.fullmatch(rf'{re.escape(path)}(:\d+)?', where)
    assert told.startswith(expected)


@pytest.mark.parametrize('name', ['nautilus', '', '/', 'seawing.txt'])
def test_unknown_name_lists_the_known_ones(name):
    with pytest.raises(ConfigurationError) as caught:
        vehicle_path(name)
    assert str(caught.value) == (
        f'vehicle = {name!r}: no such vehicle '
        '(allowed: seaglider, seawing, slocum_g2, zhang2021, zhang2021_table1, '
        'or a path to a .yaml file)'
    )


def test_missing_file_is_named(tmp_path):
    path = tmp_path / 'none.yaml'
    with pytest.raises(ConfigurationError) as caught:
        load_vehicle(str(path))
    assert str(caught.value) == f'{path}: no such vehicle file'


def test_a_field_given_twice_is_refused(tmp_path):
    path = tmp_path / 'twice.yaml'
    text = (VEHICLE_FOLDER / 'zhang2021.yaml').read_text(encoding='utf-8')
    path.write_text(text + 'name: again\n', encoding='utf-8')
    line = len(text.splitlines()) + 1
    with pytest.raises(
        ConfigurationError, match=rf"twice.yaml:{line}: .*field 'name' is given twice"
    ):
        load_vehicle(str(path))


def test_a_list_is_no_vehicle(tmp_path):
    path = tmp_path / 'list.yaml'
    path.write_text('- name: zhang2021\n', encoding='utf-8')
    with pytest.raises(ConfigurationError, match=r'list.yaml: expected a mapping of fields'):
        load_vehicle(str(path))
