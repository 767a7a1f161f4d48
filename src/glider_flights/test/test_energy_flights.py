# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""``./glider energy`` on flights that are made up here, of which it is known what they took."""

import json
import shutil

import numpy as np
import pytest
import xarray
from typer.testing import CliRunner

from glider_base.errors import ConfigurationError
from glider_bringup.cli import app

START_S = 1.6e9
#: What a pump takes (J/cc, J/cc/m); what is drawn in dive, climb, at the surface, in a call (W).
OUT, PER_M = 5.0, 0.02
DIVE_W, CLIMB_W, SURFACE_W, CALL_W = 2.0, 1.0, 3.0, 4.0
VOLTS = 14.0


def energy(*words) -> dict:
    """What the command says to a script."""
    result = CliRunner().invoke(app, ['energy', *map(str, words), '--json'])
    assert result.exit_code == 0, result.output
    return json.loads(result.output)


def refused(*words) -> str:
    with pytest.raises(ConfigurationError) as error:
        CliRunner().invoke(app, ['energy', *map(str, words)], catch_exceptions=False)
    assert '\n' not in str(error.value)
    return str(error.value)


# ---------------------------------------------------------------------- Seaglider


def write_dives(folder, dives: int, factor: float = 1.0, **changes):
    """Files of dives, each deeper than the one before, of which each ends with three pumpings."""
    folder.mkdir()
    for number in range(1, dives + 1):
        depth = np.array([0.0, 10.0, 100.0 * number, 50.0 * number, 10.0])
        cc = np.array([-300.0, 0.0, 150.0, 80.0, 60.0])  # let in, nothing, and pumped out
        joules = factor * np.maximum(cc, 0.0) * (OUT + PER_M * depth)
        seconds = np.array([60.0, 0.0, 120.0, 70.0, 50.0])
        counts = cc / -0.25
        data = {
            'gc_depth': ('gc', depth),
            'gc_vbd_pot1_ad_start': ('gc', np.full(5, 2000.0)),
            'gc_vbd_pot2_ad_start': ('gc', np.full(5, 1900.0)),
            'gc_vbd_pot1_ad': ('gc', 2000.0 + counts + 20.0),
            'gc_vbd_pot2_ad': ('gc', 1900.0 + counts - 20.0),
            'gc_vbd_secs': ('gc', seconds),
            'gc_vbd_volts': ('gc', np.full(5, VOLTS)),
            'gc_vbd_i': ('gc', joules / VOLTS / np.maximum(seconds, 1.0)),
            'log_VBD_CNV': ((), -0.25),
            'gc_roll_ad_start': ('gc', np.array([0.0, 1000.0, 2000.0, 1000.0, 1000.0])),
            'gc_roll_ad': ('gc', np.array([900.0, 2000.0, 1000.0, 1000.0, 1000.0])),
            'gc_roll_secs': ('gc', np.array([2.0, 2.0, 2.0, 0.0, 0.0])),
            'gc_roll_volts': ('gc', np.full(5, VOLTS)),
            'gc_roll_i': ('gc', np.full(5, 0.1)),
            'log_ROLL_CNV': ((), 0.028),
            **changes,
        }
        dataset = xarray.Dataset({name: one for name, one in data.items() if one is not None})
        dataset.to_netcdf(folder / f'p171{number:04d}.nc', engine='scipy')
    return folder


def test_half_of_a_seaglider_flight_tells_its_pump(tmp_path):
    told = energy(write_dives(tmp_path / 'sg171', 4))
    assert told['fitted'] == pytest.approx({'pump_out': OUT, 'pump_out_per_m': PER_M}, rel=1e-6)
    assert (told['fitted_parts'], told['predicted_parts']) == (6, 6)
    # dives 3 and 4: 150, 80 and 60 cc at 100, 50 and 10 m times the number of the dive
    joules = sum(
        cc * (OUT + PER_M * z)
        for dive in (3, 4)
        for cc, z in ((150.0, 100.0 * dive), (80.0, 50.0 * dive), (60.0, 10.0))
    )
    assert told['recorded_wh'] == pytest.approx(joules / 3600.0, rel=1e-9)
    assert told['error_percent'] == pytest.approx(0.0, abs=1e-4)
    # 14 V, 0.1 A and 2 s for 28 deg; what begins at no count is not known
    assert told['measured'] == pytest.approx({'roll_mass': 0.1}, rel=1e-6)


def test_another_vehicle_is_predicted_as_far_off_as_it_is(tmp_path):
    mine, other = write_dives(tmp_path / 'a', 4), write_dives(tmp_path / 'b', 3, factor=1.25)
    told = energy(other, '--fit-on', mine)
    assert told['predicted_parts'] == 9
    assert told['error_percent'] == pytest.approx(-20.0, abs=1e-3)


def test_a_number_that_the_fit_does_not_find_is_told(tmp_path):
    shallow = np.array([0.0, 10.0, 10.0, 20.0, 400.0])  # as if it took less the deeper it is
    told = energy(write_dives(tmp_path / 'a', 4, gc_depth=('gc', shallow)))
    assert told['fitted']['pump_out_per_m'] == 0.0
    assert told['notes'] == [
        'pump_out_per_m ran to its bound, 0 J/cc/m: the flight does not tell it'
    ]


def test_what_is_left_out_of_the_flight_that_is_fitted_on_is_told(tmp_path):
    mine, other = write_dives(tmp_path / 'a', 4), write_dives(tmp_path / 'b', 3)
    (mine / 'p1710005.nc').write_bytes(b'')
    assert 'p1710005.nc' in ' '.join(energy(other, '--fit-on', mine)['notes'])


def test_dives_of_another_vehicle_and_copies_are_left_out(tmp_path):
    folder = write_dives(tmp_path / 'a', 4)
    alone = energy(folder)
    other = write_dives(tmp_path / 'b', 2, factor=3.0)
    for number in (1, 2):
        (other / f'p171{number:04d}.nc').rename(folder / f'p180{number:04d}.nc')
    shutil.copy(folder / 'p1710003.nc', folder / 'p1710003.copy.nc')
    told = energy(folder)
    notes = ' '.join(told.pop('notes'))
    assert told == {name: value for name, value in alone.items() if name != 'notes'}
    assert all(name in notes for name in ('p1800001.nc', 'p1800002.nc', 'p1710003'))


def test_what_lacks_is_named(tmp_path):
    folder = write_dives(tmp_path / 'a', 2, gc_vbd_volts=None)
    text = refused(folder)
    assert 'p1710001.nc' in text and 'gc_vbd_volts' in text
    assert 'no such folder' in refused(tmp_path / 'none')
    fewer = write_dives(tmp_path / 'c', 2, gc_depth=('other', np.zeros(3)))
    assert 'gc_depth 3, ' in refused(fewer)
    assert 'needed: 2' in refused(write_dives(tmp_path / 'b', 1))
    assert refused(write_dives(tmp_path / 'd', 2, log_VBD_CNV=((), 0.25))).endswith('2 files')


@pytest.mark.parametrize(
    ('name', 'fill'), [('gc_vbd_volts', 9.97e36), ('gc_vbd_i', 9.97e36), ('gc_depth', -999.0)]
)
def test_fills_of_a_seaglider_are_no_pumping(tmp_path, name, fill):
    folder = write_dives(tmp_path / 'a', 4)
    alone = energy(folder)['fitted']
    with xarray.open_dataset(folder / 'p1710001.nc', engine='scipy') as file:
        filled = file.load()
    filled[name][3] = fill
    filled.to_netcdf(folder / 'p1710001.nc', engine='scipy')
    assert energy(folder)['fitted'] == pytest.approx(alone, rel=1e-6)


# ---------------------------------------------------------------------- Slocum


def slocum(yos: int) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Sensors of yos to 100 m with ten minutes at the surface after each, half of it a call."""
    step_s, depth, oil, calls = 10.0, [0.0], [200.0], [0.0]
    for yo in range(yos):
        deepest = 60.0 + 10.0 * (yo % 5)
        down = np.arange(1.0, deepest, 1.5)
        for z in down:
            depth.append(z), oil.append(-200.0), calls.append(0.0)
        for z in down[::-1]:
            depth.append(z), oil.append(200.0), calls.append(0.0)
        for tick in range(60):
            depth.append(0.0), oil.append(200.0), calls.append(float(tick < 30))
    depth, oil, calls = np.array(depth), np.array(oil), np.array(calls)
    time_s = START_S + step_s * np.arange(len(depth))
    middle = 0.5 * (depth[1:] + depth[:-1])
    sinks = np.gradient(depth, time_s)[1:] > 0.0
    watts = np.where(middle < 2.0, SURFACE_W, np.where(sinks, DIVE_W, CLIMB_W))
    watts += CALL_W * calls[1:]
    pumped = np.maximum(np.diff(oil), 0.0) * (OUT + PER_M * middle)
    charge = np.append(0.0, np.cumsum(watts * step_s + pumped)) / 3600.0 / VOLTS
    return {
        'm_depth': (time_s, depth),
        'm_coulomb_amphr_total': (time_s, 100.0 + charge),
        'm_battery': (time_s, VOLTS + 1e-6 * np.arange(len(time_s))),
        'm_de_oil_vol': (time_s, oil),
        'm_iridium_on': (time_s, calls),
    }


def test_half_of_a_slocum_flight_tells_its_hotel_and_its_pump(tmp_path, write_dbd):
    pytest.importorskip('dbdreader')
    write_dbd(tmp_path / '00010000.DBD', slocum(60), cached=False)
    told = energy(tmp_path)
    fitted = told['fitted']
    hotel = [fitted[f'hotel_{phase}'] for phase in ('dive', 'climb', 'surface')]
    assert hotel == pytest.approx([DIVE_W, CLIMB_W, SURFACE_W], rel=0.1)
    assert fitted['call_power'] == pytest.approx(CALL_W, rel=0.1)
    pumped = fitted['pump_out'] + 80.0 * fitted['pump_out_per_m']
    assert pumped == pytest.approx(OUT + 80.0 * PER_M, rel=0.1)
    assert told['error_percent'] == pytest.approx(0.0, abs=1.0)


def set_back(sensors):
    sensors['m_coulomb_amphr_total'][1][3000:] -= 100.0


def off_for_a_moment(sensors):
    sensors['m_coulomb_amphr_total'][1][3000] = 0.0


def leaps(sensors):
    sensors['m_coulomb_amphr_total'][1][3000:] += 50.0


def without_depth(sensors):
    sensors['m_depth'][1][1000:3000] = np.nan


def no_voltage(sensors):
    sensors['m_battery'][1][5::200] = 0.0


def spikes_of_oil(sensors):
    sensors['m_de_oil_vol'][1][50::300] = 4000.0


@pytest.mark.parametrize(
    'harm', [set_back, off_for_a_moment, leaps, without_depth, no_voltage, spikes_of_oil]
)
def test_what_no_slocum_draws_and_what_no_depth_is_of_is_left_out(tmp_path, write_dbd, harm):
    pytest.importorskip('dbdreader')
    sensors = slocum(40)
    harm(sensors)
    write_dbd(tmp_path / '00010000.DBD', sensors, cached=False)
    told = energy(tmp_path)
    fitted = [told['fitted'][name] for name in ('hotel_dive', 'hotel_climb', 'hotel_surface')]
    assert fitted == pytest.approx([DIVE_W, CLIMB_W, SURFACE_W], rel=0.01)
    assert told['error_percent'] == pytest.approx(0.0, abs=0.1)


def test_a_slocum_of_which_no_call_is_recorded_has_no_power_of_calls(tmp_path, write_dbd):
    pytest.importorskip('dbdreader')
    sensors = slocum(20)
    del sensors['m_iridium_on']
    write_dbd(tmp_path / '00010000.DBD', sensors, cached=False)
    assert 'call_power' not in energy(tmp_path)['fitted']


def test_kinds_do_not_mix(tmp_path, write_dbd):
    pytest.importorskip('dbdreader')
    (tmp_path / 'slocum').mkdir()
    write_dbd(tmp_path / 'slocum' / '00010000.DBD', slocum(20), cached=False)
    text = refused(tmp_path / 'slocum', '--fit-on', write_dives(tmp_path / 'sg', 3))
    assert 'a slocum cannot be predicted from a seaglider' in text


def test_a_slocum_without_a_counter_of_charge_is_told_so(tmp_path, write_dbd):
    pytest.importorskip('dbdreader')
    sensors = slocum(5)
    del sensors['m_coulomb_amphr_total']
    write_dbd(tmp_path / '00010000.DBD', sensors, cached=False)
    assert 'm_coulomb_amphr_total or m_coulomb_amphr is not recorded' in refused(tmp_path)


def test_a_slocum_whose_counter_is_recorded_too_seldom_is_told_so(tmp_path, write_dbd):
    pytest.importorskip('dbdreader')
    sensors = slocum(20)
    sensors['m_coulomb_amphr_total'] = tuple(one[::61] for one in sensors['m_coulomb_amphr_total'])
    write_dbd(tmp_path / '00010000.DBD', sensors, cached=False)
    assert 'every 610 s, of which no step can be used (needed: every 600 s' in refused(tmp_path)
