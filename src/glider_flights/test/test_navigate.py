# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""``./glider navigate`` on flights that are made up here, with a current that is known."""

import json
import math
import re
import struct
from pathlib import Path

import numpy as np
import pytest
import xarray
from scipy.optimize import brentq
from typer.testing import CliRunner

from glider_base.errors import ConfigurationError
from glider_bringup.cli import app
from glider_flights.navigation import navigate, summary
from glider_flights.reading import read_flight, read_whole
from glider_flights.slocum import slocum_files

START_S = 1.6e9
#: Of the flights made up here: current below and at the surface (m/s north, east), pitch (rad).
CURRENT, SURFACE = np.array([0.08, -0.05]), np.array([0.2, 0.1])
PITCH, RATE = math.radians(26.0), 0.15
#: Half a dive, and a dive with the stay before it (s).
LEG_S, CYCLE_S = 3000.0, 6600.0
DECLINED = 0.3
ORIGIN = np.array([49.5, -50.2])


def quiet(*_):
    pass


def navigated(flight):
    return navigate(flight, quiet)


def slocum_speed(pitch: float, rate: float) -> float:
    """Horizontal speed (m/s) of a glide with Merckelbach's coefficients, by a root of its own."""

    def balance(alpha):
        lift, drag = 7.53 * alpha, 0.15 + 10.5 * alpha**2
        return drag * math.cos(pitch + alpha) - lift * math.sin(pitch + alpha)

    return rate / math.tan(pitch + brentq(balance, 0.0, math.radians(8.0)))


def made_up(dives: int, period_s: float = 4.0, currents=None):
    """Samples (t, depth, pitch, heading) and fixes (t, north, east) of dives to 450 m.

    Ten minutes at the surface before each, with a fix each minute from the second on.
    """
    speed = slocum_speed(PITCH, RATE)
    place, now = np.zeros(2), START_S
    samples, fixes, swings = [], [], np.random.default_rng(5)
    currents = [CURRENT] * dives if currents is None else currents
    for number in range(dives + 1):
        for step in np.arange(0.0, 600.0, 60.0):
            samples.append((now + step, 0.3, 0.0, 0.0))
            if 120.0 <= step:
                fixes.append((now + step, *(place + SURFACE * step)))
        place, now = place + SURFACE * 600.0, now + 600.0
        if number == dives:
            break
        heading = 0.4 + 0.5 * number
        for sign in (-1.0, 1.0):
            for step in np.arange(0.0, LEG_S, period_s):
                depth = RATE * step if sign < 0.0 else RATE * (LEG_S - step)
                swing = 0.01 * swings.standard_normal()
                samples.append((now + step, depth, sign * PITCH, heading + swing))
            along = speed * np.array([math.cos(heading), math.sin(heading)])
            place, now = place + LEG_S * (along + currents[number]), now + LEG_S
    return np.array(samples), np.array(fixes)


def degrees(fixes: np.ndarray) -> np.ndarray:
    """Latitude and longitude of north and east (m), on the same sphere."""
    metres = math.radians(1.0) * 6_371_000.0
    latitude = ORIGIN[0] + fixes[:, 1] / metres
    scale = np.cos(np.radians(0.5 * (latitude + ORIGIN[0])))
    return np.stack([latitude, ORIGIN[1] + fixes[:, 2] / metres / scale], axis=-1)


def to_nmea(values: np.ndarray) -> np.ndarray:
    whole = np.trunc(values)
    return whole * 100.0 + (values - whole) * 60.0


def sensors(dives: int, **kwargs) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Sensors of a made-up Slocum, whose own current is off by 2 cm/s to magnetic north."""
    samples, fixes = made_up(dives, **kwargs)
    time_s, depth, pitch, heading = samples.T
    latitude, longitude = degrees(fixes).T
    told_s = START_S + CYCLE_S * np.arange(1, dives + 1) + 400.0
    cosine, sine = math.cos(DECLINED), math.sin(DECLINED)
    north, east = CURRENT
    magnetic = np.array([[east * cosine + north * sine], [north * cosine - east * sine + 0.02]])
    magnetic = np.repeat(magnetic, dives, axis=1)
    return {
        'm_depth': (time_s, depth),
        'm_pitch': (time_s, pitch),
        'm_heading': (time_s, (heading + DECLINED) % (2.0 * math.pi)),
        'm_gps_lat': (fixes[:, 0], to_nmea(latitude)),
        'm_gps_lon': (fixes[:, 0], to_nmea(longitude)),
        'm_gps_mag_var': (fixes[:, 0], np.full(len(fixes), DECLINED)),
        'm_final_water_vx': (told_s, magnetic[0]),
        'm_final_water_vy': (told_s, magnetic[1]),
    }


def write_dive(file: Path, number: int, dives: int, engine: str = 'scipy', **changes) -> None:
    """Write the NetCDF file of one of several dives as a base station does."""
    samples, fixes = made_up(dives)
    begin, end = START_S + CYCLE_S * number, START_S + CYCLE_S * (number + 1)
    inside = (samples[:, 0] >= begin + 600.0) & (samples[:, 0] < end)
    time_s, depth, pitch, heading = samples[inside].T
    mine = (fixes[:, 0] >= begin) & (fixes[:, 0] <= end + 120.0)
    three = fixes[mine][[0, 7, 8]]
    latitude, longitude = degrees(three).T
    point, fix = 'sg_data_point', 'gps_info'
    data = {
        'time': (point, time_s, {'units': 'seconds since 1970-1-1 00:00:00'}),
        'depth': (point, depth),
        'eng_pitchAng': (point, np.degrees(pitch)),
        'eng_head': (point, np.degrees(heading + DECLINED)),
        'magnetic_variation': ((), -math.degrees(DECLINED)),
        'log_gps_time': (fix, three[:, 0], {'units': 'seconds since 1970-1-1 00:00:00'}),
        'log_gps_lat': (fix, latitude),
        'log_gps_lon': (fix, longitude),
        'depth_avg_curr_north': ((), CURRENT[0] + 0.03),
        'depth_avg_curr_east': ((), CURRENT[1]),
        # As Merckelbach's of a Slocum: angles in degrees, an area of 0.1 m^2.
        'sg_cal_hd_a': ((), math.radians(7.53)),
        'sg_cal_hd_b': ((), 0.15),
        'sg_cal_hd_c': ((), math.radians(math.radians(10.5))),
        'sg_cal_hd_s': ((), 0.0),
        'sg_cal_glider_length': ((), math.sqrt(0.1)),
    }
    data |= changes
    dataset = xarray.Dataset({name: value for name, value in data.items() if value is not None})
    dataset.to_netcdf(file, engine=engine)


def told(*words: str) -> str:
    """What the command says when it refuses."""
    with pytest.raises(ConfigurationError) as error:
        CliRunner().invoke(app, ['navigate', *words], catch_exceptions=False)
    assert '\n' not in str(error.value)
    return str(error.value)


# ---------------------------------------------------------------------- Slocum


@pytest.mark.parametrize('cached', [True, False])
def test_a_slocum_finds_the_current_it_drifted_with(tmp_path, cached, write_dbd):
    pytest.importorskip('dbdreader')
    write_dbd(tmp_path / '00010000.DBD', sensors(4), cached)
    flight = read_flight(tmp_path, None, quiet)
    rows = navigated(flight)
    report = summary(flight, rows)
    assert (report['vehicle'], report['segments']) == ('slocum', 4)
    for row in rows:
        assert row.dac_mps == pytest.approx(CURRENT, abs=0.005)
        assert row.seconds == pytest.approx(2.0 * LEG_S, abs=40.0)
    # The current of the vehicle is 2 cm/s off, in its magnetic coordinates.
    assert report['dac_difference_mps']['median'] == pytest.approx(0.02, abs=0.003)
    assert report['dac_difference_mps']['segments'] == 4


def test_a_sent_file_is_turned_by_the_field_of_the_earth(tmp_path, write_dbd):
    """It has no m_gps_mag_var; compasses pointed 18 deg west of north there in 2020 (IGRF-14)."""
    pytest.importorskip('dbdreader')
    pytest.importorskip('ppigrf')
    table = sensors(3)
    del table['m_gps_mag_var']
    time_s, heading = table['m_heading']
    table['m_heading'] = time_s, heading - DECLINED + math.radians(18.0)
    write_dbd(tmp_path / '00010000.sbd', table, True)
    flight = read_flight(tmp_path, None, quiet)
    assert any('by IGRF' in note for note in flight.notes)
    for row in navigated(flight):
        assert row.dac_mps == pytest.approx(CURRENT, abs=0.02)


def test_attitude_that_is_not_recorded_at_the_surface_takes_no_depth_from_it(tmp_path, write_dbd):
    """A Slocum lies there for 20 minutes, and records depth alone until it has dived."""
    pytest.importorskip('dbdreader')
    table = sensors(3)
    since_s = (table['m_depth'][0] - START_S) % CYCLE_S
    told = (since_s > 700.0) & (since_s < CYCLE_S - 500.0)
    for name in ('m_pitch', 'm_heading'):
        table[name] = tuple(values[told] for values in table[name])
    write_dbd(tmp_path / '00010000.dbd', table, True)
    rows = navigated(read_flight(tmp_path, None, quiet))
    for row in rows[1:-1]:
        assert row.seconds == pytest.approx(2.0 * LEG_S, abs=40.0)


@pytest.mark.parametrize(('fix', 'off_min'), [(3, 30.0), (8, 0.5)])
def test_a_fix_far_off_and_one_under_water_are_left_out(tmp_path, write_dbd, fix, off_min):
    """The first of a stay may be 900 m off: that from which it dived, as a real Slocum sent it."""
    pytest.importorskip('dbdreader')
    table = sensors(2)
    time_s, latitude = table['m_gps_lat']
    assert fix == 3 or time_s[fix] - time_s[fix - 1] > 2.0 * LEG_S
    latitude[fix] += off_min
    deep_s = START_S + 1500.0
    for name, value in (('m_gps_lat', latitude[0]), ('m_gps_lon', table['m_gps_lon'][1][0])):
        table[name] = (np.append(time_s, deep_s), np.append(table[name][1], value))
    write_dbd(tmp_path / '00010000.dbd', table, True)
    rows = navigated(read_flight(tmp_path, None, quiet))
    assert len(rows) == 2
    for row in rows:
        assert row.dac_mps == pytest.approx(CURRENT, abs=0.003)


def test_a_current_of_another_time_is_not_compared(tmp_path, write_dbd):
    """A fix in between starts a vehicle's reckoning anew, but not the clock of its current."""
    pytest.importorskip('dbdreader')
    table = sensors(2)
    told_s = table['m_final_water_vx'][0]
    table['m_dr_time'] = (told_s, np.array([2.0 * LEG_S, 9.0 * LEG_S]))
    write_dbd(tmp_path / '00010000.dbd', table, True)
    flight = read_flight(tmp_path, None, quiet)
    assert summary(flight, navigated(flight))['dac_difference_mps']['segments'] == 1


def test_a_current_that_is_far_off_by_the_way_is_told_so(tmp_path, write_dbd):
    """The vehicle believes to be faster by 6 cm/s, and its current is as much another."""
    pytest.importorskip('dbdreader')
    table = sensors(2)
    for name in ('m_final_water_vx', 'm_final_water_vy'):
        table[name] = (table[name][0], table[name][1] + 0.05)
    time_s, depth = table['m_depth']
    speed = np.where(depth > 0.5, slocum_speed(PITCH, RATE) + 0.06, 0.0)
    write_dbd(tmp_path / '00010000.dbd', table | {'m_speed': (time_s, speed)}, True)
    flight = read_flight(tmp_path, None, quiet)
    (note,) = summary(flight, navigated(flight))['notes']
    metres, cmps = re.search(r'ways (\d+) m off those on board are ([\d.]+) cm/s', note).groups()
    assert float(cmps) == pytest.approx(6.0, abs=0.5)
    assert float(metres) == pytest.approx(0.06 * 2.0 * LEG_S, abs=30.0)


def test_a_pitch_that_tells_no_speed_in_much_of_a_dive_is_told(tmp_path, write_dbd):
    pytest.importorskip('dbdreader')
    table = sensors(2)
    time_s, pitch = table['m_pitch']
    table['m_pitch'] = time_s, np.where(table['m_depth'][1] > 225.0, 0.0, pitch)
    write_dbd(tmp_path / '00010000.dbd', table, True)
    (note,) = read_flight(tmp_path, None, quiet).notes
    assert 'in 50% of the samples' in note and 'ways are too short' in note


def test_the_fullest_kind_of_file_is_read(tmp_path):
    for name in ('a.sbd', 'A.DCD', 'a.dbd', 'b.dcd', 'a.ebd', 'a.txt'):
        (tmp_path / name).touch()
    assert [path.name for path in slocum_files(tmp_path)] == ['a.dbd', 'b.dcd']


def test_what_a_slocum_lacks_is_told(tmp_path, write_dbd):
    pytest.importorskip('dbdreader')
    file = tmp_path / '00010000.dbd'
    table = sensors(1)
    write_dbd(file, table, True)
    (tmp_path / 'cache' / 'AB12CD34.CAC').rename(tmp_path / 'cache' / 'other.cac')
    assert 'ab12cd34.cac' in told(str(tmp_path))
    assert '--cache' in told(str(tmp_path))
    del table['m_pitch']
    write_dbd(file, table, False)
    assert 'no value of m_pitch' in told(str(tmp_path))
    file.write_bytes(file.read_bytes()[:-500])
    assert 'no value of m_pitch' in told(str(tmp_path))
    assert '; read as far as it goes: 00010000.dbd: cut short' in told(str(tmp_path))
    file.write_bytes(b'dbd_label: DBD')
    assert 'no file could be read' in told(str(tmp_path))


@pytest.mark.parametrize(
    ('surfaced', 'why'), [(700.0, 'no dive between two fixes'), (1e9, 'a large part of them')]
)
def test_a_slocum_without_one_whole_dive_says_so(tmp_path, write_dbd, surfaced, why):
    """Its only dive has no end, or no samples."""
    pytest.importorskip('dbdreader')
    table = part(sensors(1), START_S, START_S + surfaced)
    for name in ('m_depth', 'm_pitch', 'm_heading'):
        table[name] = tuple(values[:20] for values in table[name])
    write_dbd(tmp_path / '00010000.dbd', table, True)
    assert why in told(str(tmp_path))


@pytest.mark.parametrize(
    'damage',
    [
        lambda content: b'\0' * 1000,
        lambda content: content[:50],
        lambda content: content.replace(b'num_ascii_tags', b'num_ascii\0tags'),
        lambda content: content.replace(b'tags:    14', b'tags:    2'),
        lambda content: content.replace(b'tags:    14', b'tags:    14141414'),
    ],
)
@pytest.mark.parametrize('suffix', ['.dbd', '.dcd'])
def test_a_damaged_file_is_left_out_and_named(damage, suffix, tmp_path, write_dbd):
    pytest.importorskip('dbdreader')
    file = tmp_path / '00010000.dbd'
    write_dbd(file, sensors(2), True)
    wrong = damage(file.read_bytes())
    bad = tmp_path / f'00020000{suffix}'
    bad.write_bytes(wrong if suffix == '.dbd' else packed(wrong))
    flight = read_flight(tmp_path, None, quiet)
    assert len(flight.segments) == 2
    assert flight.notes[0].startswith(f'left out: {bad.name}: cannot be read')


def test_a_file_that_is_damaged_before_its_end_is_named(tmp_path, write_dbd):
    pytest.importorskip('dbdreader')
    file = tmp_path / '00010000.dbd'
    write_dbd(file, sensors(3), True)
    content = file.read_bytes()
    assert not read_flight(tmp_path, None, quiet).notes
    middle = len(content) // 2
    file.write_bytes(content[:middle] + bytes(500) + content[middle + 500 :])
    assert any(file.name in note for note in read_flight(tmp_path, None, quiet).notes)


def part(table: dict, begin_s: float, end_s: float, later_s: float = 0.0) -> dict:
    """What sensors told in a time, with dates that are so much later."""
    chosen = {}
    for name, (time_s, values) in table.items():
        inside = (time_s >= begin_s) & (time_s < end_s)
        chosen[name] = (time_s[inside] + later_s, values[inside])
    return chosen


def test_each_bad_file_of_a_slocum_costs_what_it_holds_and_is_named(tmp_path, write_dbd):
    pytest.importorskip('dbdreader')
    dives, year_s = 12, 365 * 86_400.0
    table = sensors(dives)
    bad = {1: 'cut', 3: 'packed', 5: 'foreign', 6: 'no_cache', 7: 'empty', 8: 'late', 9: 'twice'}
    bad[10] = 'no_pitch'
    for number in range(dives + 1):
        begin = START_S + CYCLE_S * number
        kind, vehicle, cache, later_s = bad.get(number, ''), 'unit', 'AB12CD34', 0.0
        if kind == 'foreign':
            vehicle = 'other'
        elif kind == 'no_cache':
            cache = 'LOST0000'
        elif kind in ('late', 'twice'):
            later_s = 3.0 * year_s if kind == 'late' else -5.0 * CYCLE_S + 17.0
        mine = part(table, begin, begin + CYCLE_S, later_s)
        if kind == 'no_pitch':
            del mine['m_pitch']
        file = tmp_path / f'{number:04d}0000.dbd'
        write_dbd(file, mine, kind != 'no_pitch', f'{vehicle}-2026-001-0-{number}', cache)
        content = file.read_bytes()
        if kind == 'cut':
            file.write_bytes(content[: len(content) // 2 + 1])
        elif kind == 'empty':
            file.write_bytes(b'')
        elif kind == 'packed':
            file.unlink()
            file.with_suffix('.dcd').write_bytes(packed(content)[: len(content) // 5])
    (tmp_path / 'cache' / 'LOST0000.CAC').unlink()
    flight = read_flight(tmp_path, None, quiet)
    assert flight.segments
    for row in navigated(flight):
        assert row.dac_mps == pytest.approx(CURRENT, abs=0.005)
    whole = {number for number in range(dives) if number not in bad}
    # A dive ends with the fixes in the file after it.
    kept = {int(segment.name[:4]) for segment in flight.segments}
    assert kept >= {number for number in whole if number + 1 in whole or number + 1 in (1, 3)}
    for number in bad:
        assert any(f'{number:04d}0000.d' in note for note in flight.notes), bad[number]
    assert len(flight.files) == dives + 1 - 6


def packed(content: bytes) -> bytes:
    """A file as a Slocum compresses it: blocks with their length before them."""
    from lz4.block import compress

    blocks = [
        compress(content[at : at + 8192], store_size=False) for at in range(0, len(content), 8192)
    ]
    return b''.join(struct.pack('>H', len(block)) + block for block in blocks)


def test_a_damaged_compressed_file_does_not_end_the_program(tmp_path, write_dbd):
    """Random bytes in it: what can be read is plausible, whatever dbdreader makes of it."""
    pytest.importorskip('dbdreader')
    file, generator = tmp_path / '00010000.dbd', np.random.default_rng(3)
    table, edge_s = sensors(3), START_S + 2.0 * CYCLE_S + 600.0
    write_dbd(file, part(table, edge_s, math.inf), False, 'unit-2026-001-0-1')
    content = packed(file.read_bytes())
    write_dbd(file, part(table, 0.0, edge_s), False)
    for _ in range(20):
        at = int(generator.integers(2000, len(content) - 64))
        damaged = content[:at] + generator.bytes(64) + content[at + 64 :]
        (tmp_path / '00020000.dcd').write_bytes(damaged)
        flight = read_flight(tmp_path, None, quiet)
        assert len(flight.segments) >= 2
        assert any('00020000.dcd' in note for note in flight.notes)


def test_instruments_of_a_slocum_come_from_both_computers(tmp_path, write_dbd):
    """Those of the water by the times of the CTD, half a second off those of the file."""
    pytest.importorskip('dbdreader')
    gsw = pytest.importorskip('gsw')
    table = sensors(2)
    time_s, depth = table['m_depth']
    whole = np.ones(len(time_s))
    table |= {'m_roll': (time_s, 0.1 * whole), 'm_battpos': (time_s, 0.5 * whole)}
    table |= {'m_ballast_pumped': (time_s, -230.0 * whole), 'm_fin': (time_s, -0.2 * whole)}
    write_dbd(tmp_path / '00010000.dbd', table, True)
    science = {
        'sci_water_pressure': (time_s, gsw.p_from_z(-depth, ORIGIN[0]) / 10.0),
        'sci_water_temp': (time_s, 10.0 * whole),
        'sci_water_cond': (time_s, gsw.C_from_SP(35.0, 10.0, depth) / 10.0),
        'sci_ctd41cp_timestamp': (time_s, time_s - 0.5),
    }
    write_dbd(tmp_path / '00010000.ebd', science, False)
    flight = read_whole(tmp_path, None, quiet)
    found = flight.instruments
    assert found.time_s == pytest.approx(time_s - 0.5, abs=1e-6)
    inside = slice(1, -1)
    assert found.depth_m[inside] == pytest.approx(depth[inside], abs=0.01)
    assert found.salinity[inside] == pytest.approx(35.0, abs=0.01)
    assert found.pumped_m3[inside] == pytest.approx(-230e-6)
    assert found.mass_x_m[inside] == pytest.approx(0.0127)
    assert found.surface_rad[inside] == pytest.approx(-0.2)
    assert found.roll_rad[inside] == pytest.approx(0.1)
    # Navigation has no need of the other computer.
    (tmp_path / '00010000.ebd').write_bytes(b'nothing')
    assert read_flight(tmp_path, None, quiet).instruments is None
    assert any('00010000.ebd' in note for note in read_whole(tmp_path, None, quiet).notes)


# ---------------------------------------------------------------------- Seaglider


def test_a_seaglider_finds_the_current_of_each_dive(tmp_path):
    for number in range(3):
        write_dive(tmp_path / f'p123{number + 7:04d}.nc', number, 3)
    flight = read_flight(tmp_path, None, quiet)
    rows = navigated(flight)
    for row in rows[:-1]:
        assert row.dac_mps == pytest.approx(CURRENT, abs=0.005)
    # After the last dive a single fix says nothing of the drift: it counts as under water.
    assert rows[-1].seconds == pytest.approx(2.0 * LEG_S + 120.0, abs=40.0)
    # From fix to fix the drift at the surface counts too: 180 s of 6180.
    mean = (2.0 * LEG_S * CURRENT + 180.0 * SURFACE) / (2.0 * LEG_S + 180.0)
    assert rows[1].comparable_mps == pytest.approx(mean, abs=0.004)
    off = np.hypot(*(mean - CURRENT - [0.03, 0.0]))
    report = summary(flight, rows)
    assert report['dac_difference_mps']['median'] == pytest.approx(off, abs=0.004)
    assert report['prediction_m']['persistence']['segments'] == 2


def test_buoyancy_is_taken_where_it_is_recorded(tmp_path):
    """A glide with so much buoyancy is as fast as drag times speed squared has it."""
    speed = slocum_speed(PITCH, RATE)
    total = math.hypot(speed, RATE)
    alpha = math.atan2(RATE, speed) - PITCH
    drag = 0.5 * 1027.5 * total**2 * 0.1 * (0.15 + 10.5 * alpha**2)
    grams = 1000.0 * drag / 9.81 / math.sin(PITCH + alpha)
    samples, _ = made_up(1)
    under = samples[samples[:, 0] >= START_S + 600.0]
    under = under[under[:, 0] < START_S + CYCLE_S]
    # A vertical rate of the water would mislead what goes by the vertical rate of the vehicle.
    waves = under[:, 1] + 10.0 * np.sin((under[:, 0] - START_S - 600.0) * math.pi / 250.0)
    write_dive(
        tmp_path / 'p1230001.nc',
        0,
        1,
        depth=('sg_data_point', np.abs(waves)),
        buoyancy=('sg_data_point', np.sign(under[:, 2]) * grams),
    )
    flight = read_flight(tmp_path / 'p1230001.nc', None, quiet)
    (row,) = navigated(flight)
    assert np.hypot(*row.way_m) == pytest.approx(2.0 * LEG_S * speed, rel=0.02)


def test_a_missing_dive_is_not_bridged(tmp_path):
    for number in (0, 1, 3):
        write_dive(tmp_path / f'p123{number + 7:04d}.nc', number, 4)
    flight = read_flight(tmp_path, None, quiet)
    assert [segment.name for segment in flight.segments] == [
        *('p1230007.nc', 'p1230008.nc', 'p1230010.nc'),
    ]
    assert len(flight.segments[1].after.time_s) == 1


def test_a_group_of_netcdf_4_is_read_too(tmp_path):
    pytest.importorskip('h5netcdf')
    write_dive(tmp_path / 'plain.nc', 0, 1)
    with xarray.open_dataset(tmp_path / 'plain.nc', decode_times=False) as dataset:
        parts = {name: name.startswith('log_gps') for name in dataset.variables}
        fixes = dataset[[name for name, is_fix in parts.items() if is_fix]].load()
        rest = dataset[[name for name, is_fix in parts.items() if not is_fix]].load()
    (tmp_path / 'plain.nc').unlink()
    rest.to_netcdf(tmp_path / 'p1230001.nc', engine='h5netcdf')
    fixes.to_netcdf(tmp_path / 'p1230001.nc', engine='h5netcdf', group='gps', mode='a')
    (row,) = navigated(read_flight(tmp_path, None, quiet))
    assert row.comparable_mps == pytest.approx(CURRENT, abs=0.03)


def test_what_a_dive_lacks_is_told(tmp_path):
    file = tmp_path / 'p1230001.nc'
    write_dive(file, 0, 1, eng_head=None)
    assert 'no variable eng_head' in told(str(tmp_path))
    write_dive(file, 0, 1, log_gps_lat=('gps_info', np.full(3, np.nan)))
    assert 'no usable fix' in told(str(tmp_path))
    file.write_text('no NetCDF')
    assert 'cannot be read as NetCDF' in told(str(file))
    write_dive(file, 0, 1)
    write_dive(tmp_path / 'p1240001.nc', 0, 1)
    assert 'several vehicles, 123, 124' in told(str(tmp_path))


def test_each_bad_dive_of_a_seaglider_costs_what_it_holds_and_is_named(tmp_path):
    year = 365 * 86_400.0
    for number in range(12):
        write_dive(tmp_path / f'p123{number + 1:04d}.nc', number, 12)
    write_dive(tmp_path / 'p1230003.nc', 2, 12, eng_head=None)
    for name, size in (('p1230005.nc', 3000), ('p1230006.nc', 0)):
        (tmp_path / name).write_bytes((tmp_path / name).read_bytes()[:size])
    for number, by_s in ((8, 19.6 * year), (10, -3.0 * CYCLE_S)):
        name = tmp_path / f'p123{number:04d}.nc'
        with xarray.open_dataset(name, decode_times=False) as dataset:
            dive = dataset.load()
        for one in ('time', 'log_gps_time'):
            dive[one] = dive[one] + by_s
        dive.to_netcdf(name, engine='scipy')
    (tmp_path / 'p1230012.nc').rename(tmp_path / 'p4560012.nc')
    (tmp_path / '00010000.dbd').write_bytes(bytes(200))
    flight = read_flight(tmp_path, None, quiet)
    kept = {1, 2, 4, 7, 9, 11}
    assert [segment.name for segment in flight.segments] == [f'p123{n:04d}.nc' for n in kept]
    for row in navigated(flight)[:-1]:
        assert row.dac_mps == pytest.approx(CURRENT, abs=0.02)
    for name in (*(f'p123{n:04d}.nc' for n in (3, 5, 6, 8, 10)), 'p4560012.nc', '00010000.dbd'):
        assert any(name in note for note in flight.notes), name


# ---------------------------------------------------------------------- OG1


def og1(dives: int) -> xarray.Dataset:
    """A flight as OG1 has it: one time for samples and fixes, true north told."""
    samples, fixes = made_up(dives)
    latitude, longitude = degrees(fixes).T
    nothing = np.full(len(fixes), math.nan)
    table = {
        'TIME': (samples[:, 0], fixes[:, 0]),
        'DEPTH': (samples[:, 1], nothing),
        'PITCH': (np.degrees(samples[:, 2]), nothing),
        'HEADING': (np.degrees(samples[:, 3]), nothing),
        'TIME_GPS': (samples[:, 0] * math.nan, fixes[:, 0]),
        'LATITUDE_GPS': (samples[:, 0] * math.nan, latitude),
        'LONGITUDE_GPS': (samples[:, 0] * math.nan, longitude),
        'DAVG_CURR_NORTH': (np.full(len(samples), CURRENT[0] + 0.02), nothing),
        'DAVG_CURR_EAST': (np.full(len(samples), CURRENT[1]), nothing),
    }
    order = np.argsort(np.concatenate(table['TIME']), kind='stable')
    dataset = xarray.Dataset(
        {name: ('N_MEASUREMENTS', np.concatenate(pair)[order]) for name, pair in table.items()}
    )
    dataset['TIME'].attrs['units'] = 'seconds since 1970-01-01T00:00:00Z'
    dataset['MAGNETIC_VARIATION'] = 0.0
    dataset['PLATFORM_SERIAL_NUMBER'] = 'unit_1'
    return dataset


def test_a_flight_in_og1_is_navigated(tmp_path):
    og1(4).to_netcdf(tmp_path / 'unit_1_20200913T122640_R.nc', engine='scipy')
    flight = read_flight(tmp_path, None, quiet)
    rows = navigated(flight)
    assert len(rows) == 4
    for row in rows:
        assert row.dac_mps == pytest.approx(CURRENT, abs=0.005)
    assert summary(flight, rows)['dac_difference_mps']['median'] == pytest.approx(0.02, abs=0.003)


def test_a_current_on_board_that_is_a_fill_is_none(tmp_path):
    data = og1(3)
    data['DAVG_CURR_NORTH'] = (0.0 * data.DAVG_CURR_NORTH - 9999.9).fillna(-9999.9)
    data.to_netcdf(tmp_path / 'unit_1.nc', engine='scipy')
    flight = read_flight(tmp_path, None, quiet)
    assert summary(flight, navigated(flight))['dac_difference_mps']['segments'] == 0


def in_bar(data):
    gsw = pytest.importorskip('gsw')
    pressure = gsw.p_from_z(-data.DEPTH, ORIGIN[0]) / 10.0
    return data.assign(PRES=pressure.assign_attrs(units='bar')).drop_vars('DEPTH')


def without_pressure(data):
    pytest.importorskip('gsw')
    return data.assign(PRES=math.nan * data.DEPTH)


def in_days(data):
    """Of which one is missing, and one is what NetCDF fills with."""
    time = (data.TIME / 86_400.0).copy()
    time[7], time[11] = math.nan, 9.96921e36
    days = {'units': 'days since 1970-01-01'}
    fixed = (data.TIME_GPS / 86_400.0).assign_attrs(days)
    return data.assign(TIME=time.assign_attrs(days), TIME_GPS=fixed)


def from_noon(data):
    noon = {'units': 'seconds since 1970-01-01 12:00:00'}
    times = {name: (data[name] - 43_200.0).assign_attrs(noon) for name in ('TIME', 'TIME_GPS')}
    return data.assign(times)


def across_the_date_line(data):
    """Westward, and on to -180.01."""
    return data.assign(LONGITUDE_GPS=data.LONGITUDE_GPS - data.LONGITUDE_GPS.min() - 180.01)


def with_fixes_that_are_none(data):
    """A receiver without a fix tells 0, 0."""
    fixed = np.isfinite(data.TIME_GPS)
    lost = fixed & (fixed.cumsum() % 3 == 1)
    names = ('LATITUDE_GPS', 'LONGITUDE_GPS')
    return data.assign({name: data[name].where(~lost, 0.0) for name in names})


def with_what_is_not_valid(data):
    """By what the file says of it."""
    pitch = data.PITCH.where(np.arange(data.sizes['N_MEASUREMENTS']) % 5 > 0, 85.0)
    return data.assign(PITCH=pitch.assign_attrs(units='degrees', valid_max=60.0))


def with_flags(data):
    """Some numbers are bad, and flagged so."""
    bad = {name: np.arange(data.sizes[data[name].dims[0]]) % 7 == 3 for name in ('DEPTH', 'PITCH')}
    flagged = {}
    for name, where in bad.items():
        flagged[name] = data[name].where(~where, 1.5 * data[name]).assign_attrs(data[name].attrs)
        flagged[f'{name}_QC'] = (data[name].dims, np.where(where, 4, 1).astype('int8'))
    return data.assign(flagged)


def with_flags_of_characters(data):
    """The same as characters, which are blank where nobody looked."""
    data = with_flags(data)
    names = ('DEPTH_QC', 'PITCH_QC')
    return data.assign(
        {name: (data[name].dims, np.where(data[name] == 4, b'4', b'')) for name in names}
    )


def with_fills(data):
    """Some have no number, and the file does not say which stands for none."""
    names, dived = ('DEPTH', 'PITCH', 'HEADING'), data.DEPTH > 50.0
    lost = dived & (np.arange(data.sizes['N_MEASUREMENTS']) % 5 == 0)
    told = data.assign({name: data[name].where(~lost, -9999.9) for name in names})
    return told.assign(MAGNETIC_VARIATION=('n', [0.0, 9.96921e36, 9.96921e36]))


@pytest.mark.parametrize(
    'change',
    [
        with_fills,
        with_flags,
        with_flags_of_characters,
        with_what_is_not_valid,
        lambda data: data.assign(LONGITUDE_GPS=data.LONGITUDE_GPS % 360.0),
        across_the_date_line,
        lambda data: data.assign(DEPTH=(-data.DEPTH).assign_attrs(units='m', positive='up')),
        lambda data: data.assign(DEPTH=(100.0 * data.DEPTH).assign_attrs(units='cm')),
        without_pressure,
        in_bar,
        in_days,
        from_noon,
        with_fixes_that_are_none,
    ],
)
def test_a_flight_in_og1_is_the_same_however_it_is_told(change, tmp_path):
    change(og1(4)).to_netcdf(tmp_path / 'unit_1.nc', engine='scipy')
    rows = navigated(read_flight(tmp_path, None, quiet))
    assert len(rows) == 4
    for row in rows:
        assert row.dac_mps == pytest.approx(CURRENT, abs=0.005)


@pytest.mark.parametrize(
    ('name', 'unit'),
    [('DEPTH', 'km'), ('DEPTH', 'dm'), ('PITCH', 'gon'), ('DAVG_CURR_EAST', 'knots')],
)
def test_a_unit_that_is_not_known_is_refused_by_name(name, unit, tmp_path):
    data = og1(2)
    data[name].attrs['units'] = unit
    data.to_netcdf(tmp_path / 'unit_1.nc', engine='scipy')
    with pytest.raises(ConfigurationError, match=rf"unit_1.nc: {name} is in '{unit}' \(allowed"):
        read_flight(tmp_path, None, quiet)


def test_a_pitch_of_the_other_sign_is_refused(tmp_path):
    data = og1(2)
    data.assign(PITCH=-data.PITCH).to_netcdf(tmp_path / 'unit_1.nc', engine='scipy')
    for read in (read_flight, read_whole):
        with pytest.raises(ConfigurationError, match=r'in 100% of its samples \(allowed: \+ nose'):
            read(tmp_path, None, quiet)


def test_a_pitch_in_radians_that_says_degrees_is_refused(tmp_path):
    data = og1(2)
    pitch = np.radians(data.PITCH).assign_attrs(units='degrees')
    data.assign(PITCH=pitch).to_netcdf(tmp_path / 'unit_1.nc', engine='scipy')
    assert re.search(r'the pitch is 0\.\d\d degrees at most where it sinks', told(str(tmp_path)))
    data.assign(PITCH=pitch.assign_attrs(units='rad')).to_netcdf(
        tmp_path / 'unit_1.nc', engine='scipy'
    )
    assert len(navigated(read_flight(tmp_path, None, quiet))) == 2


def test_a_depth_of_the_other_sign_is_refused(tmp_path):
    data = og1(2)
    data.assign(DEPTH=-data.DEPTH).to_netcdf(tmp_path / 'unit_1.nc', engine='scipy')
    assert 'depths are below 0 all along (allowed: + down, or positive' in told(str(tmp_path))


@pytest.mark.parametrize(
    ('name', 'values', 'unit', 'why'),
    [
        ('DEPTH', 'deep', 'm', "has what is no number: could not convert string to float: 'deep'"),
        (
            'TIME',
            5.0,
            'bananas',
            "holds no times in 'bananas' (allowed: such as seconds since 1970-01-01)",
        ),
        (
            'TIME',
            1e5,
            'days since 2020-45-01',
            "holds no times in 'days since 2020-45-01' (allowed",
        ),
        ('PITCH', 20.0, '', 'or GLIDER_PITCH (needed along the time, of a flight in OG1 or CF)'),
    ],
)
def test_what_is_no_number_or_no_time_is_named(name, values, unit, why, tmp_path):
    data = og1(2)
    dims = () if name == 'PITCH' else data[name].dims
    data[name] = (dims, np.full(data[name].shape if dims else (), values), {'units': unit})
    data.to_netcdf(tmp_path / 'unit_1.nc', engine='scipy')
    assert f'{name} {why}' in told(str(tmp_path))


@pytest.mark.parametrize('names', [['DEPTH'], ['PITCH', 'HEADING']])
def test_no_line_is_drawn_over_what_is_missing_for_most_of_a_dive(names, tmp_path):
    data = og1(2)
    since_s = (data.TIME - START_S) % CYCLE_S
    is_kept = (since_s < 1200.0) | (since_s > 6000.0)
    changed = {name: data[name].where(is_kept) for name in names}
    data.assign(changed).to_netcdf(tmp_path / 'unit_1.nc', engine='scipy')
    with pytest.raises(ConfigurationError, match='no samples for a large part'):
        navigated(read_flight(tmp_path, None, quiet))


def test_samples_that_begin_late_in_a_dive_are_no_fault_of_the_program(tmp_path):
    data = og1(1)
    since_s = data.TIME - START_S
    late = data.where((since_s > 5000.0) | np.isfinite(data.TIME_GPS), drop=True)
    late.assign(MAGNETIC_VARIATION=0.0).to_netcdf(tmp_path / 'unit_1.nc', engine='scipy')
    with pytest.raises(ConfigurationError, match='no samples for a large part'):
        navigated(read_flight(tmp_path, None, quiet))


def test_magnetic_heading_of_og1_is_turned_by_the_field_of_the_earth(tmp_path):
    """In 2020 the compass pointed 18 deg west of north off Newfoundland (IGRF-14)."""
    pytest.importorskip('ppigrf')
    dataset = og1(2).drop_vars('MAGNETIC_VARIATION')
    dataset['HEADING'] = dataset['HEADING'] + 18.0
    dataset.to_netcdf(tmp_path / 'unit.nc', engine='scipy')
    flight = read_flight(tmp_path, None, quiet)
    assert any('by IGRF' in note for note in flight.notes)
    for row in navigated(flight):
        assert row.dac_mps == pytest.approx(CURRENT, abs=0.02)


def test_each_bad_file_in_og1_costs_what_it_holds_and_is_named(tmp_path):
    whole, edges = og1(8), START_S + CYCLE_S * np.arange(10)
    for number in range(8):
        time_s = whole['TIME'].values
        inside = (time_s >= edges[number]) & (time_s < edges[number + 1] + 600.0)
        mine = whole.isel(N_MEASUREMENTS=inside)
        if number == 1:
            mine = mine.drop_vars('PITCH')
        elif number == 3:
            mine['PLATFORM_SERIAL_NUMBER'] = 'unit_2'
        elif number == 5:
            mine = mine.assign({name: mine[name] + 1e9 for name in ('TIME', 'TIME_GPS')})
        mine.to_netcdf(tmp_path / f'unit_{number}.nc', engine='scipy')
    (tmp_path / 'unit_6.nc').write_bytes((tmp_path / 'unit_6.nc').read_bytes()[:500])
    (tmp_path / 'unit_7.nc').write_bytes(b'')
    flight = read_flight(tmp_path, None, quiet)
    assert [segment.name for segment in flight.segments] == [f'unit_{n}.nc' for n in (0, 2, 4)]
    for row in navigated(flight):
        assert row.dac_mps == pytest.approx(CURRENT, abs=0.01)
    for number in (1, 3, 5, 6, 7):
        assert any(f'unit_{number}.nc' in note for note in flight.notes), number


@pytest.mark.parametrize('name', ['p1230001.nc', 'unit_1.nc'])
def test_a_file_in_netcdf_3_is_refused_wherever_in_its_header_it_is_cut(tmp_path, name):
    write_dive(tmp_path / name, 0, 2)
    whole = (tmp_path / name).read_bytes()
    for length in range(1, 1500, 13):
        (tmp_path / name).write_bytes(whole[:length])
        with pytest.raises(ConfigurationError, match=name):
            read_flight(tmp_path, None, quiet)


def test_missing_numbers_in_a_dive_do_not_spread(tmp_path):
    samples, _ = made_up(1)
    pitch = np.degrees(samples[10:1510, 2])
    pitch[::3] = np.nan
    write_dive(tmp_path / 'p1230001.nc', 0, 1, eng_pitchAng=('sg_data_point', pitch))
    (row,) = navigated(read_flight(tmp_path, None, quiet))
    assert np.isfinite(row.dac_mps).all()


# ---------------------------------------------------------------------- forecasts and the command


def test_no_forecast_knows_what_comes_after_it(tmp_path):
    for number in range(10):
        write_dive(tmp_path / f'p123{number + 1:04d}.nc', number, 10)
    whole = navigated(read_flight(tmp_path, None, quiet))
    for number in range(8, 11):
        (tmp_path / f'p123{number:04d}.nc').unlink()
    part = navigated(read_flight(tmp_path, None, quiet))
    for row, again in zip(whole[:6], part[:6], strict=True):
        assert again.missed_m == pytest.approx(row.missed_m, nan_ok=True)


def test_the_command_prints_what_was_agreed(tmp_path):
    for number in range(3):
        write_dive(tmp_path / f'p123{number + 1:04d}.nc', number, 3)
    done = CliRunner().invoke(app, ['navigate', str(tmp_path), '--json'])
    assert done.exit_code == 0
    report = json.loads(done.stdout)
    assert report['segments'] == 3
    assert report['method'] == 'dead_reckoned'
    assert {'median', 'p90'} <= report['dac_difference_mps'].keys()
    for name in ('none', 'persistence', 'ours'):
        assert report['prediction_m'][name]['median'] >= 0.0
        assert report['prediction_m'][name]['p90'] >= report['prediction_m'][name]['median']
    shown = CliRunner().invoke(app, ['navigate', str(tmp_path)])
    assert shown.exit_code == 0
    assert '3 dives' in shown.stdout
    assert 'p1230002' in shown.stdout


def test_no_figure_of_a_long_row_is_cut_short_in_80_columns(tmp_path, write_dbd, monkeypatch):
    pytest.importorskip('dbdreader')
    monkeypatch.setenv('COLUMNS', '80')
    table = sensors(3, currents=[np.array([-0.956, -0.844])] * 3)
    for name in ('m_final_water_vx', 'm_final_water_vy'):
        table[name] = (table[name][0], np.array([-0.7] * 3))
    write_dbd(tmp_path / 'unit-2026-001-0-123.dbd', table, True)
    shown = CliRunner().invoke(app, ['navigate', str(tmp_path)]).stdout
    rows = [line for line in shown.splitlines() if '-001-0-1' in line]
    assert len(rows) == 3
    assert all(row.count('…') == 1 for row in rows), rows


@pytest.mark.parametrize('method', ['known', 'nobody'])
def test_a_method_that_no_recording_feeds_is_refused(tmp_path, method):
    write_dive(tmp_path / 'p1230001.nc', 0, 1)
    assert f'--method {method}' in told(str(tmp_path), '--method', method)


def test_what_is_no_flight_is_refused(tmp_path):
    assert 'no files of a flight' in told(str(tmp_path))
    assert 'no such folder or file' in told(str(tmp_path / 'lost'))
    for folder in ('one', 'two'):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / '00010000.dbd').touch()
    assert '2 folders below it' in told(str(tmp_path))


@pytest.mark.parametrize('engine', ['scipy', 'h5netcdf'])
def test_a_table_along_time_without_pitch_is_no_flight(tmp_path, engine):
    pytest.importorskip('h5netcdf')
    table = og1(1)[['TIME', 'DEPTH']]
    table.to_netcdf(tmp_path / 'mooring.nc', engine=engine)
    assert 'a flight in OG1 has TIME, and PITCH or LATITUDE_GPS' in told(str(tmp_path))


@pytest.mark.parametrize(
    ('module', 'name'), [('dbdreader', '00010000.dbd'), ('h5netcdf', 'p1230001.nc')]
)
def test_a_library_that_is_not_there_is_named(tmp_path, monkeypatch, module, name):
    monkeypatch.setitem(__import__('sys').modules, module, None)
    (tmp_path / name).write_bytes(b'\x89HDF\r\n\x1a\n' + b'\0' * 200)
    assert f'{module}, which reads' in told(str(tmp_path))
    assert 'requirements-flights.txt' in told(str(tmp_path))
