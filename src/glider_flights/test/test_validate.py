# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""``./glider validate`` on flights that are made up here, by steady glides solved apart."""

import json
import math
import re
from pathlib import Path

import numpy as np
import pytest
import xarray
from scipy.optimize import brentq
from typer.testing import CliRunner

from glider_base.errors import ConfigurationError
from glider_bringup.cli import app
from glider_flights.reading import read_whole
from glider_flights.record import Instruments
from glider_flights.validation.flying import Simulated, Track
from glider_flights.validation.result import validate
from glider_flights.validation.score import turn_rates
from glider_model.plant.trim import solve_trim
from glider_model.vehicle.file import load_vehicle

gsw = pytest.importorskip('gsw')

START_S, PERIOD_S = 1.6e9, 5.0
LATITUDE, LONGITUDE = 40.0, -30.0
#: Of the flights made up here: pitch (rad), what is pumped (m^3), deepest (m), water.
PITCH, PUMPED, DEEPEST = math.radians(26.0), 230e-6, 80.0
SALINITY = 35.0
#: What they weigh more than the file says (kg), and their parasitic drag over that of the file.
HEAVIER, ROUGHER = 0.12, 1.3
#: Recorded turn rate over sin(roll) at 0.5 m/s (rad/s).
TURNS = {1.0: -0.05, -1.0: 0.03}


def quiet(*_):
    pass


def temperature(depth: np.ndarray) -> np.ndarray:
    return 8.0 + 10.0 * np.exp(-depth / 40.0)


def density(depth: float) -> float:
    pressure = gsw.p_from_z(-depth, LATITUDE)
    absolute = gsw.SA_from_SP(SALINITY, pressure, LONGITUDE, LATITUDE)
    return float(gsw.rho_t_exact(absolute, temperature(depth), pressure))


def glide(
    depth: float, sign: float, heavier: float = HEAVIER, rougher: float = ROUGHER
) -> tuple[float, float]:
    """Speed and vertical rate (m/s, + down) of a steady glide of slocum_g2, by Merckelbach."""
    file, rho = load_vehicle('slocum_g2').params(), density(depth)
    squeezed = file.compressibility * rho * 9.81 * depth
    stretched = file.thermal_expansion * (temperature(depth) - file.reference_temperature)
    volume = file.volume * (1.0 - squeezed + stretched)
    net = 70.0 + heavier - rho * (volume - sign * PUMPED)
    assert net * sign > 0.0

    def drag(alpha):
        return rougher * 0.15 + 10.5 * alpha**2

    def balance(alpha):
        return drag(alpha) * math.cos(PITCH + alpha) - 7.5 * alpha * math.sin(PITCH + alpha)

    alpha = brentq(balance, 0.0, math.radians(20.0))
    force = 9.81 * abs(net) * math.sin(PITCH + alpha)
    speed = math.sqrt(2.0 * force / (rho * 0.1 * drag(alpha)))
    return speed, sign * speed * math.sin(PITCH + alpha)


def made_up(deepest: float = DEEPEST, **differs: float) -> dict[str, np.ndarray]:
    """A dive and a climb, a sample each few seconds; how it differs from the others."""
    now, depth, heading, rows = 0.0, 2.5, 0.3, []
    for sign in (1.0, -1.0):
        while (depth < deepest) if sign > 0.0 else (depth > 2.5):
            speed, rate = glide(depth, sign, **differs)
            roll = 0.12 * math.sin(now / 120.0)
            rows.append((now, depth, -sign * PITCH, roll, heading, -sign * PUMPED, -rate, speed))
            heading += PERIOD_S * TURNS[sign] * math.sin(roll) * speed / 0.5
            depth += PERIOD_S * rate
            now += PERIOD_S
    names = ('time', 'depth', 'pitch', 'roll', 'heading', 'pumped', 'rising', 'speed')
    return dict(zip(names, np.array(rows).T, strict=True))


@pytest.fixture(scope='module')
def dive() -> dict[str, np.ndarray]:
    return made_up()


def write_dive(file, dive, **changes) -> None:
    """Write it as a base station of a Seaglider does; what is None is left out."""
    point, fix = 'sg_data_point', 'gps_info'
    end_s = START_S + dive['time'][-1]
    data = {
        'time': (point, START_S + dive['time'], {'units': 'seconds since 1970-1-1 00:00:00'}),
        'depth': (point, dive['depth']),
        'eng_pitchAng': (point, np.degrees(dive['pitch'])),
        'eng_rollAng': (point, np.degrees(dive['roll'])),
        'eng_head': (point, np.degrees(dive['heading'])),
        'eng_vbdCC': (point, 1e6 * dive['pumped']),
        'temperature': (point, temperature(dive['depth'])),
        'salinity': (point, np.full(len(dive['time']), SALINITY)),
        'vert_speed': (point, 100.0 * dive['rising'] + 2.0),
        'magnetic_variation': ((), 0.0),
        'log_gps_time': (fix, np.array([START_S - 300.0, START_S - 60.0, end_s + 60.0])),
        'log_gps_lat': (fix, np.full(3, LATITUDE)),
        'log_gps_lon': (fix, np.full(3, LONGITUDE)),
    } | changes
    data = {name: value for name, value in data.items() if value is not None}
    xarray.Dataset(data).to_netcdf(file, engine='scipy')


def write_flight(folder, dives, **changes) -> str:
    """Write dives two hours apart; the folder."""
    folder.mkdir()
    for number, dive in enumerate(dives):
        start_s = START_S + 7200.0 * number
        end_s = start_s + dive['time'][-1]
        moved = {
            'time': ('sg_data_point', start_s + dive['time']),
            'log_gps_time': (
                'gps_info',
                np.array([start_s - 300.0, start_s - 60.0, end_s + 60.0]),
            ),
        }
        write_dive(folder / f'p123{number + 1:04d}.nc', dive, **moved, **changes)
    return str(folder)


def report(*words: str) -> dict:
    done = CliRunner().invoke(app, ['validate', *words, '--json'], catch_exceptions=False)
    assert done.exit_code == 0
    return json.loads(done.stdout)


@pytest.fixture(scope='module')
def fitted(dive, tmp_path_factory) -> dict:
    """What the plant fits to that dive."""
    folder = tmp_path_factory.mktemp('flight') / 'plain'
    return report(write_flight(folder, [dive]), '--vehicle', 'seaglider')['fitted']


@pytest.mark.parametrize(
    ('name', 'change', 'unit', 'is_known'),
    [
        ('depth', lambda dive: 100.0 * dive['depth'], 'cm', True),
        ('eng_pitchAng', lambda dive: dive['pitch'], 'radians', True),
        (
            'salinity',
            lambda dive: np.where(np.arange(len(dive['time'])) % 9, 35.0, -999.0),
            '',
            True,
        ),
        ('temperature', lambda dive: temperature(dive['depth']) + 273.15, 'K', False),
    ],
)
def test_units_and_fills_of_a_seaglider_make_no_other_numbers(
    dive, fitted, tmp_path, name, change, unit, is_known
):
    changed = {name: ('sg_data_point', change(dive), {'units': unit})}
    got = report(write_flight(tmp_path / 'a', [dive], **changed), '--vehicle', 'seaglider')
    if is_known:
        assert got['fitted'] == pytest.approx(fitted, rel=1e-3)
    assert any('1025 kg/m3 is taken' in note for note in got['notes']) != is_known


def test_time_that_goes_back_is_told_and_a_unit_that_is_not_known_refused(dive, tmp_path):
    (tmp_path / 'a').mkdir()
    write_dive(
        tmp_path / 'a/p1230001.nc',
        {name: row[::-1] for name, row in dive.items()},
        log_gps_time=('gps_info', START_S + np.array([-300.0, -60.0, dive['time'][-1]])),
    )
    got = report(str(tmp_path / 'a'), '--vehicle', 'seaglider')
    assert got['notes'][0] == 'time goes back in p1230001.nc: its samples are sorted by it'
    feet = {'depth': ('sg_data_point', 3.28 * dive['depth'], {'units': 'feet'})}
    folder = write_flight(tmp_path / 'b', [dive], **feet)
    assert "depth is in 'feet'" in told(folder, '--vehicle', 'seaglider')


def told(*words: str) -> str:
    """What the command says when it refuses."""
    with pytest.raises(ConfigurationError) as error:
        CliRunner().invoke(app, ['validate', *words], catch_exceptions=False)
    assert '\n' not in str(error.value)
    return str(error.value)


@pytest.fixture(scope='module')
def file(tmp_path_factory, dive):
    path = tmp_path_factory.mktemp('flight') / 'p1230001.nc'
    write_dive(path, dive)
    return str(path)


def test_the_plant_glides_as_a_model_solved_apart_once_weight_and_drag_are_found(file):
    found = report(file, '--vehicle', 'slocum_g2', '--fit', 'mass,Cd0')
    assert found['segments'] == 1
    assert found['w_rmse_cmps'] < 0.15
    assert abs(found['w_bias_cmps']) < 0.05
    assert found['fitted']['mass'] == pytest.approx(HEAVIER, abs=0.005)
    drag = load_vehicle('slocum_g2').params().K_D0
    assert found['fitted']['Cd0'] == pytest.approx(ROUGHER * drag, rel=0.02)
    assert found['u_adcp_rmse_cmps'] is None


def test_what_is_fitted_is_printed_with_its_unit(file):
    words = ['validate', file, '--vehicle', 'slocum_g2', '--fit', 'Cd0,mass']
    done = CliRunner().invoke(app, words, catch_exceptions=False)
    assert re.search(r'Cd0 [0-9.]+ kg/m, mass [-0-9.]+ kg ', ' '.join(done.stdout.split()))


def test_without_a_fit_it_is_off_by_what_the_flight_weighs_more(file):
    found = report(file, '--vehicle', 'slocum_g2', '--fit', 'none')
    assert found['fitted'] == {}
    # A plant that is lighter sinks more slowly and rises faster.
    assert -7.0 < found['w_bias_cmps'] < -2.0


def test_what_the_base_station_made_of_it_stands_beside(file):
    """Its rate is 2 cm/s off here."""
    found = report(file, '--vehicle', 'slocum_g2', '--fit', 'none')
    assert found['peer']['name'] == 'basestation'
    assert found['peer']['w_rmse_cmps'] == pytest.approx(2.0, abs=0.05)


def test_turns_over_roll_are_told_by_phase(file):
    name = 'turn_rate_per_sin_roll'
    turns = report(file, '--vehicle', 'slocum_g2', '--fit', 'mass,Cd0')[name]
    assert turns['dive']['recorded'] == pytest.approx(TURNS[1.0], rel=0.05)
    assert turns['climb']['recorded'] == pytest.approx(TURNS[-1.0], rel=0.05)
    turns = report(file, '--vehicle', 'seaglider', '--fit', 'mass,Cd0')[name]
    assert -0.1 < turns['dive']['simulated'] < -0.01
    assert 0.01 < turns['climb']['simulated'] < 0.1


def test_turns_over_fin_are_those_that_were_made():
    """At 0.4 m/s: the turn rate goes by the sine of the fin and the square of the speed."""
    time_s = np.arange(0.0, 1800.0, 4.0)
    fin = np.radians(12.0) * np.sin(time_s / 40.0)
    nothing = np.full(len(time_s), math.nan)
    turned = np.concatenate([[0.0], np.cumsum(4.0 * (0.4 / 0.5) ** 2 * np.sin(fin[:-1]))])
    own = Instruments(*(nothing for _ in Instruments._fields))
    own = own._replace(time_s=time_s, surface_rad=fin, heading_rad=np.mod(0.11 * turned, math.tau))
    level = np.ones(len(time_s))
    track = Track(own, nothing, nothing, nothing, phase=level, counts=level > 0.0)
    flown = Simulated(*(nothing for _ in Simulated._fields))
    flown = flown._replace(speed_mps=0.4 * level, heading_rad=0.12 * turned)
    by_fin = turn_rates([(track, flown)])['turn_rate_per_sin_fin']
    assert by_fin['dive']['recorded'] == pytest.approx(0.11, rel=0.01)
    assert by_fin['dive']['simulated'] == pytest.approx(0.12, rel=0.01)
    assert by_fin['climb'] == {'recorded': None, 'simulated': None}
    assert turn_rates([(track, flown)])['turn_rate_per_sin_roll']['dive']['recorded'] is None


def test_speed_is_compared_with_an_adcp(file, dive, tmp_path):
    measured = tmp_path / 'speed.npy'
    np.save(measured, np.stack([START_S + dive['time'], dive['speed'] + 0.05]))
    words = (file, '--vehicle', 'slocum_g2', '--fit', 'mass,Cd0', '--adcp', str(measured))
    found = report(*words)
    assert found['u_adcp_bias_cmps'] == pytest.approx(-5.0, abs=0.3)
    assert found['u_adcp_rmse_cmps'] == pytest.approx(5.0, abs=0.3)
    np.save(measured, np.load(measured) + [[1e6], [0.0]])
    other = report(*words)
    assert other['u_adcp_rmse_cmps'] is None
    assert 'no speed by an ADCP at the time' in other['notes'][0]
    np.save(measured, np.load(measured) - [[1e6], [0.0]])
    table = tmp_path / 'speed.csv'
    np.savetxt(table, np.load(measured).T, delimiter=',')
    assert report(*words[:-1], str(table))['u_adcp_rmse_cmps'] == found['u_adcp_rmse_cmps']


def test_a_pitch_sensor_that_reads_too_much_is_found_by_the_adcp(dive, tmp_path):
    """Over several stretches: each is compared with a model that was not told of it."""
    for number in range(4):
        later = {**dive, 'time': dive['time'] + 10_000.0 * number}
        changes = {'eng_pitchAng': ('sg_data_point', np.degrees(dive['pitch']) / 0.86)}
        write_dive(tmp_path / f'p123{number + 1:04d}.nc', later, **changes)
    times = np.concatenate([START_S + dive['time'] + 10_000.0 * number for number in range(4)])
    np.save(tmp_path / 'U_measured.npy', np.stack([times, np.tile(dive['speed'], 4)]))
    found = report(str(tmp_path), '--vehicle', 'slocum_g2', '--fit', 'mass,Cd0,pitch_scale')
    assert found['segments'] == 4
    assert found['fitted']['pitch_scale'] == pytest.approx(0.86, abs=0.01)
    assert found['u_adcp_rmse_cmps'] < 0.5
    later = np.load(tmp_path / 'U_measured.npy')[:, len(times) // 2 :]
    np.save(tmp_path / 'U_measured.npy', later)  # of the first half no ADCP tells
    tried = report(str(tmp_path), '--vehicle', 'slocum_g2', '--fit-on', 'first')
    assert tried['fitted'].keys() == {'mass', 'Cd0', 'lift'}
    assert tried['u_adcp_rmse_cmps'] is not None


def test_the_plant_finds_its_pitch_by_the_actuators(dive, tmp_path):
    """Where the pitch mass has to be for it is what `./glider trim` says."""
    vehicle = load_vehicle('slocum_g2').params()
    at = [
        solve_trim(vehicle, sign * 0.2, pitch_deg=-sign * math.degrees(PITCH)).pitch_mass_m
        for sign in (1.0, -1.0)
    ]
    pumped = np.where(dive['pumped'] < 0.0, -0.2, 0.2) / 1025.0
    mass = np.where(dive['pumped'] < 0.0, *at)
    write_dive(
        tmp_path / 'p1230001.nc',
        dive,
        eng_vbdCC=('sg_data_point', 1e6 * pumped),
        eng_pitchCtl=('sg_data_point', -100.0 * mass),
        eng_rollAng=None,
    )
    words = (str(tmp_path), '--vehicle', 'slocum_g2', '--impose', 'actuators', '--fit')
    found = report(*words, 'none')
    assert found['imposed'] == 'actuators'
    assert found['pitch_rmse_deg'] < 1.5
    assert report(*words, 'mass,Cd0,trim')['pitch_rmse_deg'] < found['pitch_rmse_deg']


def og1(dives, **constants) -> xarray.Dataset:
    """Dives two hours apart as OG1 has them, without fixes."""
    parts = [
        {
            'TIME': START_S + 7200.0 * number + dive['time'],
            'LATITUDE': np.full(len(dive['time']), LATITUDE),
            'LONGITUDE': np.full(len(dive['time']), LONGITUDE),
            'DEPTH': dive['depth'],
            'PITCH': np.degrees(dive['pitch']),
            'ROLL': np.degrees(dive['roll']),
            'HEADING': np.degrees(dive['heading']),
            'VBD_CC': 1e6 * dive['pumped'],
            'TEMP': temperature(dive['depth']),
            'PSAL': np.full(len(dive['time']), SALINITY),
            'GLIDER_VERT_VELO_MODEL': 100.0 * dive['rising'] + 2.0,
        }
        for number, dive in enumerate(dives)
    ]
    data = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    dataset = xarray.Dataset({name: ('N_MEASUREMENTS', values) for name, values in data.items()})
    dataset['TIME'].attrs['units'] = 'seconds since 1970-01-01T00:00:00Z'
    return dataset.assign(constants)


def test_a_flight_in_og1_gives_the_same_figures(file, dive, tmp_path):
    dataset = og1([dive])
    dataset.to_netcdf(tmp_path / 'sg123_delayed.nc', engine='scipy')
    words = ('--vehicle', 'slocum_g2', '--fit', 'mass,Cd0')
    one, other = report(file, *words), report(str(tmp_path), *words)
    for scale, units in ((1.0, 'cm/s'), (0.01, 'm s-1')):
        rising = (scale * dataset.GLIDER_VERT_VELO_MODEL).assign_attrs(units=units)
        told = dataset.assign(GLIDER_VERT_VELO_MODEL=rising)
        told.to_netcdf(tmp_path / 'sg123_delayed.nc', engine='scipy')
        again = report(str(tmp_path), *words)['peer']['w_rmse_cmps']
        assert again == pytest.approx(other['peer']['w_rmse_cmps'], rel=1e-6)
    assert other['kind'] == 'og1'
    assert other['w_rmse_cmps'] == pytest.approx(one['w_rmse_cmps'], abs=0.01)
    assert other['peer']['w_rmse_cmps'] == pytest.approx(one['peer']['w_rmse_cmps'], abs=0.01)


def test_the_zero_of_an_engine_may_move_from_dive_to_dive(dive, tmp_path):
    """The cc of a Seaglider count from a number that people set before each dive."""
    for number, zero in enumerate((2900.0, 2700.0)):
        later = {**dive, 'time': dive['time'] + 10_000.0 * number}
        moved = 1e6 * dive['pumped'] + (zero - 2900.0) * 0.25
        write_dive(
            tmp_path / f'p123{number + 1:04d}.nc',
            later,
            eng_vbdCC=('sg_data_point', moved),
            log_C_VBD=((), zero),
            log_VBD_MIN=((), 500.0),
            log_VBD_CNV=((), -0.25),
            sg_cal_volmax=((), 69e3),
            sg_cal_mass=((), 70.0),
        )
    recorded = read_whole(tmp_path, None, quiet).instruments
    one, other = np.split(recorded.pumped_m3, 2)
    assert other == pytest.approx(one, abs=1e-9)


def test_the_page_of_pictures_is_drawn(file, tmp_path):
    picture = tmp_path / 'flight.svg'
    words = [file, '--vehicle', 'slocum_g2', '--fit', 'none', '--out', str(picture)]
    done = CliRunner().invoke(app, ['validate', *words], catch_exceptions=False)
    assert done.exit_code == 0
    assert 'vertical rate off, rms' in done.stdout
    assert picture.read_text().count('<g id="axes_') == 6


def test_gliderflight_that_is_not_there_is_told(dive, tmp_path, monkeypatch):
    monkeypatch.setitem(__import__('sys').modules, 'gliderflight', None)
    write_dive(tmp_path / 'p1230001.nc', dive, vert_speed=None)
    found = report(str(tmp_path), '--vehicle', 'slocum_g2', '--fit', 'none')
    assert found['peer'] is None
    assert 'gliderflight, the model to compare with, is not installed' in found['notes'][-1]


def test_gliderflight_flies_beside(tmp_path):
    pytest.importorskip('gliderflight')
    write_dive(tmp_path / 'p1230001.nc', made_up(150.0), vert_speed=None)
    found = report(str(tmp_path), '--vehicle', 'slocum_g2', '--fit', 'mass,Cd0')
    assert found['peer']['name'] == 'gliderflight'
    # It knows of no thermal expansion.
    assert found['w_rmse_cmps'] < found['peer']['w_rmse_cmps'] < 2.0


def test_what_cannot_be_flown_is_told(file, dive, tmp_path):
    slocum = ('--vehicle', 'slocum_g2')
    assert 'no constant mas (allowed: none' in told(file, *slocum, '--fit', 'mas')
    assert 'its file has no volume' in told(file, '--vehicle', 'zhang2021')
    assert 'no such folder or file' in told(str(tmp_path / 'lost'), *slocum)
    lacks = 'p1230001.nc: no value of eng_pitchCtl or pitchCtl (needed for --impose actuators)'
    assert lacks in told(file, *slocum, '--impose', 'actuators')
    in_og1 = tmp_path / 'og1.nc'
    og1([dive]).drop_vars('VBD_CC').to_netcdf(in_og1, engine='scipy')
    lacks = 'og1.nc: no value of VBD_CC or BALLAST_PUMPED or OIL_VOLUME (needed for --impose pitch'
    assert lacks in told(str(in_og1), *slocum)
    in_og1.unlink()
    wrong = tmp_path / 'wrong.npy'
    np.save(wrong, np.zeros(5))
    assert 'has shape (5,)' in told(file, *slocum, '--adcp', str(wrong))
    np.save(wrong, np.full((2, 9), 32.0))  # they are in cm/s
    assert '(allowed: m/s, > 0, < 5)' in told(file, *slocum, '--adcp', str(wrong))
    np.save(wrong, [['a', 'b'], ['c', 'd']])
    assert 'wrong.npy: cannot be read: could not' in told(file, *slocum, '--adcp', str(wrong))
    wrong.write_bytes(b'')
    assert 'wrong.npy: cannot be read: No data left' in told(file, *slocum, '--adcp', str(wrong))
    write_dive(tmp_path / 'p1230001.nc', {name: part[:5] for name, part in dive.items()})
    assert 'no stretch under water of 120 s' in told(str(tmp_path), *slocum)
    flight = read_whole(Path(file), None, quiet)
    of_another = flight._replace(kind='slocum')
    with pytest.raises(ConfigurationError, match='--fit-on a seaglider'):
        validate(flight, 'seaglider', 'pitch', None, None, quiet, of_another)


@pytest.mark.parametrize(('vehicle', 'is_told'), [('slocum_g2', True), ('seaglider', False)])
def test_a_vehicle_of_the_other_kind_is_told(file, vehicle, is_told):
    notes = report(file, '--vehicle', vehicle, '--fit', 'none')['notes']
    assert ('a seaglider flew this: its vehicle is seaglider, not slocum_g2' in notes) == is_told


def test_gsw_that_is_not_there_is_named(file, monkeypatch):
    monkeypatch.setitem(__import__('sys').modules, 'gsw', None)
    assert 'requirements-flights.txt' in told(file, '--vehicle', 'slocum_g2')


def test_a_half_is_fitted_and_the_other_one_tried(dive, tmp_path):
    """The second half weighs 60 g more."""
    slocum = ('--vehicle', 'slocum_g2', '--fit', 'mass,Cd0')
    later = made_up(heavier=HEAVIER + 0.06)
    alike = write_flight(tmp_path / 'alike', [dive] * 4, vert_speed=None)
    place = write_flight(tmp_path / 'flight', [dive, dive, later, later], vert_speed=None)
    found = {
        on: report(place, *slocum, '--fit-on', on) for on in ('first', 'second', 'none', alike)
    }
    first, second, none, other = found.values()
    assert second['fitted']['mass'] - first['fitted']['mass'] == pytest.approx(0.06, abs=0.005)
    assert other['fitted']['mass'] == pytest.approx(first['fitted']['mass'], abs=0.005)
    assert none['fitted'] == {} and none['w_rmse_cmps'] == none['unfitted']['w_rmse_cmps']
    assert [one['segments'] for one in found.values()] == [2, 2, 4, 4]
    assert first['w_bias_cmps'] < -1.0 < 1.0 < second['w_bias_cmps']  # too light, too heavy
    within = report(alike, *slocum, '--fit-on', 'second')
    assert within['w_rmse_cmps'] < 0.3 < within['unfitted']['w_rmse_cmps']
    for name, phase in (('dive', 1.0), ('climb', -1.0)):
        turn = within['turn_rate_per_sin_roll'][name]
        assert turn['fitted'] == pytest.approx(TURNS[phase], rel=0.1)


def test_gliderflight_is_fitted_on_the_same_half(dive, tmp_path):
    pytest.importorskip('gliderflight')
    later = made_up(heavier=HEAVIER + 0.06)
    place = write_flight(tmp_path / 'flight', [dive, dive, later, later], vert_speed=None)
    first = report(place, '--vehicle', 'slocum_g2', '--fit', 'mass,Cd0', '--fit-on', 'first')
    whole = report(place, '--vehicle', 'slocum_g2', '--fit', 'mass,Cd0')
    assert first['peer']['fitted'] == ['mg', 'Cd0']
    assert first['peer']['w_rmse_cmps'] > 1.5 * whole['peer']['w_rmse_cmps']
    assert first['unfitted']['peer_w_rmse_cmps'] > first['peer']['w_rmse_cmps']


def test_a_constant_that_runs_away_is_held_and_told(tmp_path):
    rough = made_up(rougher=7.0)
    place = write_flight(tmp_path / 'flight', [rough, rough], vert_speed=None)
    found = report(place, '--vehicle', 'slocum_g2', '--fit', 'Cd0')
    file = load_vehicle('slocum_g2').params()
    assert found['fitted']['Cd0'] == pytest.approx(5.0 * file.K_D0, rel=1e-3)
    assert any('Cd0 ran to its bound' in note for note in found['notes'])


def test_one_table_of_all_flights_of_a_folder(dive, tmp_path):
    write_flight(tmp_path / 'long', [dive] * 4, vert_speed=None)
    write_flight(tmp_path / 'short', [dive] * 2, vert_speed=None)
    of_another = np.stack([START_S - 1e6 + dive['time'], dive['speed']])
    np.save(tmp_path / 'long' / 'U_measured.npy', of_another)
    (tmp_path / 'bad').mkdir()
    (tmp_path / 'bad' / 'p1230001.nc').write_bytes(b'no file')
    table = report('--all', str(tmp_path), '--vehicle', 'slocum_g2')
    (row,) = table['flights']
    assert (row['flight'], row['segments']) == ('long', 4)
    for half in ('fit_on_first', 'fit_on_second'):
        assert row[half]['w_rmse_cmps'] < 0.5 < row[half]['unfitted']['w_rmse_cmps']
        assert 'pitch_scale' not in row[half]['fitted']
    assert 'no speed by an ADCP at the time' in ' '.join(row['notes'])
    assert 'too few dives, stretches under water: 2 (needed' in table['left_out']['short']
    assert table['left_out'].keys() == {'short', 'bad'}
    shown = CliRunner().invoke(app, ['validate', '--all', str(tmp_path), '--vehicle', 'slocum_g2'])
    assert 'left out: short' in shown.stdout
    slocum = ('--vehicle', 'slocum_g2')
    assert 'too few dives' in told(str(tmp_path / 'short'), *slocum, '--fit-on', 'first')
    for option in (('--fit-on', 'first'), ('--impose', 'actuators')):
        assert 'stands alone' in told('--all', str(tmp_path), *option)
    assert 'FLIGHT is missing' in told(*slocum)
    assert '--vehicle is missing' in told(str(tmp_path / 'long'))
    assert 'no such folder' in told('--all', str(tmp_path / 'lost'))


def test_the_table_takes_the_vehicle_that_a_file_in_og1_tells_of(dive, tmp_path):
    for name, model in (('gliders', 'Teledyne Slocum G3 glider'), ('other', 'SeaExplorer')):
        (tmp_path / name).mkdir()
        og1([dive] * 4, PLATFORM_MODEL=model).to_netcdf(tmp_path / name / '1.nc', engine='scipy')
    table = report('--all', str(tmp_path), '--fit', 'none')
    assert [one['vehicle'] for one in table['flights']] == ['slocum_g2']
    assert 'PLATFORM_MODEL is SeaExplorer (allowed without --vehicle' in table['left_out']['other']
    table = report('--all', str(tmp_path), '--fit', 'none', '--vehicle', 'seaglider')
    assert [one['vehicle'] for one in table['flights']] == ['seaglider'] * 2
