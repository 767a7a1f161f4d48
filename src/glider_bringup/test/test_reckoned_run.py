# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A vehicle that reckons its place, as it is scored, reported, compared and exported."""

import json
import math
import re
import shutil
from pathlib import Path

import numpy as np
import pytest

import glider_bringup as glider
from glider_bringup import cli, console
from glider_bringup.scoring.again import score_again
from glider_bringup.scoring.traces import load_traces
from glider_bringup.showing.figure import draw_run
from glider_bringup.showing.findings import navigation_notes, verdict
from glider_bringup.showing.flown_run import read_run
from glider_bringup.showing.report import report_page
from glider_bringup.showing.scorecard import card_rows
from glider_bringup.showing.words import small
from glider_mission.disk import write_whole
from glider_model.ocean.current_settings import KNOT_MPS

DOCUMENT = Path(__file__).resolve().parents[3] / 'docs' / 'reports.md'
RECKONED = {
    'navigation.method': 'dead_reckoned',
    'sensors.compass_bias_deg': 1.0,
    'sensors.gps_first_fix_s': 30.0,
    'profile.depth_m': 100.0,
    'profile.surface_every_dives': 1,
    'profile.wait_s': 200.0,
    'settle_s': 600.0,
}


@pytest.fixture(scope='module')
def flown(tmp_path_factory):
    """An hour with three surfacings, with a bag and a run folder."""
    out = tmp_path_factory.mktemp('reckoned') / 'reckoned'
    return glider.fly('current_8deg', RECKONED, duration=3600.0, out=out, bag=True)


@pytest.fixture(scope='module')
def known(tmp_path_factory):
    """A short flight with position known, with a run folder."""
    out = tmp_path_factory.mktemp('known') / 'known'
    return glider.fly('current_8deg', duration=300.0, out=out)


@pytest.fixture(scope='module')
def data(flown):
    return flown.to_xarray()


@pytest.fixture
def call(monkeypatch, capsys):
    """Call the command line in this process: exit code, output, messages."""

    def run(*arguments):
        monkeypatch.setattr(console.output, 'width', 300)
        monkeypatch.setattr('sys.argv', ['glider', *map(str, arguments)])
        try:
            code = cli.main()
        except SystemExit as end:
            code = end.code
        printed = capsys.readouterr()
        return code, printed.out, printed.err

    return run


def read_page(file):
    """Text of a page outside of scripts, styles and tags, and the data in it."""
    page = file.read_text(encoding='utf-8')
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.S)
    body = re.sub(r'<(script|style).*?</\1>', '', page, flags=re.S)
    return body, json.loads(found[1])


# ---------------------------------------------------------------------------------- score


def test_each_surfacing_is_told_as_it_was(flown, data):
    told = flown.score['navigation']
    reports = told['reports']
    assert len(reports) == told['surfacings'] >= 3
    assert [one['t_s'] for one in reports] == told['surfacing_t_s']
    assert [one['error_m'] for one in reports] == told['surfacing_error_m']
    for one in reports:
        dived, up = round(10.0 * one['dive_t_s']), round(10.0 * one['t_s'])
        at = data.isel(time=up)
        assert float(at.ground_truth_odom_depth) < 1.5
        assert float(data.ground_truth_odom_depth[up - 1]) >= 1.5
        true = [float(at.ground_truth_odom_north), float(at.ground_truth_odom_east)]
        believed = [float(at.odom_north), float(at.odom_east)]
        assert one['true_ned_m'] == true
        assert one['believed_ned_m'] == believed
        assert one['error_m'] == pytest.approx(math.dist(true, believed))
        names = ('north_variance', 'north_east_covariance', 'east_variance')
        nn, ne, ee = one['covariance_m2']
        assert one['covariance_m2'] == [float(at[f'odom_{name}']) for name in names]
        off = np.subtract(true, believed)
        squared = off @ np.linalg.solve([[nn, ne], [ne, ee]], off)
        assert one['inside_95'] == (squared <= 5.991)
        under = data.isel(time=slice(dived, up))
        assert float(under.ground_truth_odom_depth.isel(time=0)) > 3.0
        mean = [float(under[f'current_velocity_{axis}'].mean()) for axis in ('north', 'east')]
        assert one['dac_true_mps'] == pytest.approx(mean)


def test_fixes_and_what_they_told_of_the_current(flown, data):
    reports = flown.score['navigation']['reports']
    for one, after in zip(reports, [*reports[1:], None], strict=True):
        end = round(10.0 * after['dive_t_s']) if after else None
        stay = data.isel(time=slice(round(10.0 * one['t_s']), end))
        first = stay.isel(time=int(np.isfinite(stay.fix_north.values).argmax()))
        place = [float(first.fix_north), float(first.fix_east)]
        assert one['fix_ned_m'] == pytest.approx(place, abs=1e-6)
        if after:
            row = data.isel(time=round(10.0 * after['t_s']))
            names = ('believed_current_north', 'believed_current_east')
            assert one['dac_believed_mps'] == [float(row[name]) for name in names]
    assert reports[-1]['dac_believed_mps'] is None


@pytest.mark.parametrize('model', ['persistence', 'tidal'])
def test_the_current_told_is_the_mean_of_the_last_way_in_a_tide_too(model):
    """Of 0.2 m/s, which changes as much in five hours: to within 2 cm/s."""
    tide = {'kind': 'tidal', 'speed_mps': 0.2, 'direction_deg': 60.0}
    fields = {'current.components': [tide], 'navigation.current': model, 'dives': 0}
    run = glider.fly('slocum_shelf', fields, duration=43200.0)
    told = run.score['navigation']
    assert told['surfacings'] >= 6
    assert told['dac_error_mps']['worst'] < 0.02


def test_the_bag_gives_the_same_score(flown):
    assert score_again(flown.folder)['navigation'] == flown.score['navigation']


def test_printed_card_tells_of_navigation_where_the_place_was_reckoned(flown, known):
    told, rows = flown.score['navigation'], dict(card_rows(flown.score))
    assert rows['navigation'].startswith(f'dead_reckoned, {told["surfacings"]} surfacings')
    assert f'{told["error_m"]["worst"]:,.1f} m (worst)' in rows['surfacing position error']
    rms = told['dac_error_mps']['rms'] / KNOT_MPS
    assert rows['depth-averaged current'].startswith(f'off by rms {rms:.3f} kn')
    inside = sum(one['inside_95'] for one in told['reports'])
    assert rows['inside the 95 % ellipse'] == f'{inside} of {told["surfacings"]} true places'
    assert known.score['navigation']['reports'] == []
    new = set(rows) - set(dict(card_rows(known.score)))
    assert new == {
        *('navigation', 'surfacing position error', 'cross-track, surfacing'),
        *('cross-track, estimated', 'depth-averaged current', 'inside the 95 % ellipse'),
    }


@pytest.mark.parametrize(
    'damage',
    [
        lambda told: told.pop('method'),
        lambda told: told.update(surfacing_cross_track_m=['far']),
        lambda told: told['error_m'].update(worst='much'),
        lambda told: told['reports'][0].update(true_ned_m=[1.0]),
        lambda told: told['reports'][0].pop('t_s'),
        lambda told: told.update(reports=7),
    ],
)
def test_damaged_score_is_refused(flown, tmp_path, call, damage):
    folder = tmp_path / 'run'
    folder.mkdir()
    card = json.loads((flown.folder / 'score.json').read_text())
    damage(card['navigation'])
    (folder / 'score.json').write_text(json.dumps(card))
    code, _, err = call('score', folder)
    assert (code, 'not a scorecard' in ' '.join(err.split())) == (2, True)


@pytest.mark.parametrize(
    ('field', 'value', 'told'),
    [
        ('sim_time_s', None, 'sim_time_s = None'),
        ('distance_along_path_m', 'far', "distance_along_path_m = 'far'"),
        ('settle_s', 'x', "settle_s = 'x'"),
        ('end_of_path_m', 'x', "end_of_path_m = 'x'"),
        ('depth_m.max', None, 'depth_m: max, overshoot: some are known'),
        ('cross_track_m.rms_steady', None, 'cross_track_m: max_steady, rms_steady: some'),
        ('navigation.dac_error_mps.worst', None, 'navigation.dac_error_mps: rms, worst: some'),
    ],
)
def test_damage_to_a_score_is_named(flown, known, tmp_path, call, field, value, told):
    for name in ('scenario.yaml', 'vehicle.yaml', 'traces.npz'):
        shutil.copy(flown.folder / name, tmp_path / name)
    card = json.loads((flown.folder / 'score.json').read_text())
    *groups, name = field.split('.')
    part = card
    for group in groups:
        part = part[group]
    part[name] = value
    (tmp_path / 'score.json').write_text(json.dumps(card))
    for others in (('score',), ('report',), ('compare', known.folder)):
        code, _, err = call(*others, tmp_path)
        assert (code, 'Traceback' in err) == (2, False)
        assert 'score.json' in err and told in ' '.join(err.split())


# ---------------------------------------------------------------------------------- report


def test_report_shows_true_and_believed(flown, data):
    file = flown.folder / 'report.html'
    flown.report(file)
    body, page = read_page(file)
    panels = {panel['id']: panel for panel in page['panels']}
    assert {curve['label'] for curve in panels['estimated_cross_track']['curves']} == {
        *('true', 'estimated'),
    }
    run, reports = page['runs'][0], flown.score['navigation']['reports']
    assert run['surfacings'] == reports
    traces = load_traces(flown.folder / 'traces.npz')
    arrays = {**traces.curves, **traces.samples}
    assert {'place_error_m', 'place_bound_m', 'believed_north_m'} <= set(run['packed']['lengths'])
    error = np.hypot(
        data.odom_north - data.ground_truth_odom_north,
        data.odom_east - data.ground_truth_odom_east,
    )
    assert np.nanmax(arrays['place_error_m']) == pytest.approx(float(error.max()), rel=1e-6)
    assert arrays['believed_north_m'][-1] == np.float32(data.odom_north[-1])
    assert arrays['track_north_m'][-1] == np.float32(data.ground_truth_odom_north[-1])
    nn, ne, ee = (
        data[f'odom_{name}'].values
        for name in ('north_variance', 'north_east_covariance', 'east_variance')
    )
    matrices = np.moveaxis(np.array([[nn, ne], [ne, ee]]), -1, 0)
    longest = np.sqrt(5.991 * np.linalg.eigvalsh(matrices)[:, 1].max())
    assert np.nanmax(arrays['place_bound_m']) == pytest.approx(longest, rel=1e-5)
    for axis, name in enumerate(('north', 'east')):
        true, believed = panels[f'mean_current_{name}']['steps']
        assert [span[2] * KNOT_MPS for span in true['spans']] == pytest.approx(
            [one['dac_true_mps'][axis] for one in reports]
        )
        assert len(believed['spans']) == len(reports) - 1
    assert 'Each surfacing' in body
    surfacings = body[body.index('Each surfacing') : body.index('Where it went')]
    assert surfacings.count('<tr>') == 1 + len(reports)
    assert body.count('<tr>') > surfacings.count('<tr>') + len(card_rows(flown.score))
    for note in navigation_notes(flown.score['navigation'], True):
        assert note in body


def test_report_of_a_vehicle_that_knows_its_place_has_none_of_it(known):
    body, page = read_page(known.report())
    assert not {'plan', 'place_error'} & {panel['id'] for panel in page['panels']}
    assert 'believed_north_m' not in page['runs'][0]['packed']['lengths']
    assert 'Each surfacing' not in body


def test_report_from_the_bag_is_that_of_the_flight(flown, tmp_path):
    folder = tmp_path / flown.folder.name
    shutil.copytree(flown.folder, folder)
    files = [tmp_path / name for name in ('kept.html', 'bag.html')]
    write_whole(files[0], report_page(read_run(folder)))
    (folder / 'traces.npz').unlink()
    write_whole(files[1], report_page(read_run(folder)))
    assert files[0].read_bytes() == files[1].read_bytes()
    draw_run(read_run(folder), tmp_path / 'run.png')
    assert (tmp_path / 'run.png').stat().st_size > 10_000


def told_of(off, inside, rms=0.01, worst=0.02):
    """Part of a scorecard: how far off the path it came up, and how many in their ellipses."""
    return {
        'surfacing_cross_track_m': off,
        'error_m': {'p50': 5.0, 'p95': 50.0, 'worst': 60.0},
        'ellipse_95_share': inside / len(off) if off else None,
        'dac_error_mps': {'rms': rms, 'worst': worst},
    }


def test_the_largest_error_comes_first(flown):
    """A complete run opens with how far off it was at worst: its path, and where it believed."""
    reports = flown.score['navigation']['reports']
    worst_m = max(math.dist(one['true_ned_m'], one['believed_ned_m']) for one in reports)
    off_m = flown.score['cross_track_m']['max_run']
    assert worst_m > 100.0
    assert verdict(flown.score, 600.0).startswith(
        f'At worst it was {small(off_m)} off its path and came up {small(worst_m)} from its '
        'estimated position.'
    )


def test_navigation_is_told_in_words():
    learnt = told_of([753.0, -85.0, 37.0, 17.0, 2.0, -1.0], 6)
    came_up, place, ellipses, current = navigation_notes(learnt, learns=True)
    assert came_up == (
        'Came up 753 m off its path the first time, from surfacing 3 on at most 37 m: the '
        'current was learnt.'
    )
    assert place.endswith('by 5.00 m (median), by 60 m at worst.')
    assert ellipses == 'The 95 % ellipses hold 6 of 6 true places.'
    assert current.endswith('off by 0.019 kn (rms), 0.039 kn at worst.')
    one = navigation_notes(told_of([20.0, 10.0], 2, worst=0.01), learns=True)
    assert one[-1].endswith('off by 0.019 kn.')
    still = navigation_notes(learnt, learns=False)[0]
    assert still == 'Came up 753 m off its path the first time, later at most 85 m.'
    too_sure = navigation_notes(told_of([100.0] * 13, 8), learns=True)
    assert too_sure[0].endswith('later at most 100 m.')
    assert too_sure[2].endswith('8 of 13 true places: its ellipses are too small.')
    once = navigation_notes(told_of([20.0], 1, rms=None), learns=True)
    assert once[0] == 'Came up 20 m off its path.'
    assert len(once) == 3
    assert once[2] == 'Its 95 % ellipse holds the true place.'


def test_two_surfacings_are_told_one_by_one():
    told = told_of([445.0, 24.0], 2) | {'error_m': {'p50': 700.0, 'p95': 1300.0, 'worst': 1370.0}}
    came_up, place, *_ = navigation_notes(told, learns=True)
    assert came_up == 'Came up 445 m off its path the first time, 24 m the second time.'
    assert place == 'It surfaced off its estimated position by 1,370 m and by 30 m.'
    none = 'It came up from no dive, so its estimated position was never put to the proof.'
    assert navigation_notes(told_of([], 0), learns=True) == [none], 'it may lie at the surface'


# ---------------------------------------------------------------------------------- comparison


def rows_of(out):
    """Cells of each line of a comparison."""
    lines = [line.split('│') for line in out.splitlines() if line.startswith('│')]
    return {name.strip(): [cell.strip() for cell in cells] for _, name, *cells, _ in lines}


def test_comparison_has_lines_of_navigation_where_a_run_reckons(flown, known, tmp_path, call):
    page = tmp_path / 'both.html'
    code, out, err = call('compare', flown.folder, known.folder)
    assert code == 0, err
    rows = rows_of(out)
    assert rows['navigation'] == ['dead_reckoned', 'known']
    worst = flown.score['navigation']['error_m']['worst']
    assert rows['surfacing position error, worst'] == [f'{worst:,.1f} m', '-']
    assert rows['depth-averaged current, error, rms'][0].endswith('kn')
    assert rows['inside the 95 % ellipse'][0].endswith('%')
    assert call('compare', flown.folder, known.folder, '--out', page)[0] == 0
    _, data = read_page(page)
    (panel,) = (panel for panel in data['panels'] if panel['id'] == 'place_error')
    assert [curve['run'] for curve in panel['curves']] == [0]

    other = tmp_path / 'other'
    shutil.copytree(known.folder, other)
    rows = rows_of(call('compare', known.folder, other)[1])
    assert not {'navigation', 'surfacings', 'inside the 95 % ellipse'} & set(rows)


# ---------------------------------------------------------------------------------- numbers


def test_dataset_has_what_navigation_hears_and_believes(flown, data, known):
    assert np.isfinite(data.odom_east_variance).all()
    assert np.isnan(data.fix_north).any()
    fixed = data.where(np.isfinite(data.fix_north), drop=True)
    off = np.hypot(
        fixed.fix_north - fixed.ground_truth_odom_north,
        fixed.fix_east - fixed.ground_truth_odom_east,
    )
    assert 0.0 < float(off.max()) < 30.0
    assert (fixed.ground_truth_odom_depth < 1.0).all()
    deep = data.where(data.ground_truth_odom_depth > 20.0, drop=True)
    assert deep.pressure_absolute.min() > 2.9e5
    turned = deep.imu_heading - deep.ground_truth_odom_heading
    assert float(np.degrees(turned).median()) == pytest.approx(1.0, abs=0.2)
    believed = {name for name in data.data_vars if name.startswith('believed_')}
    assert {'believed_current_north', 'believed_surface_current_east_variance'} <= believed
    for name in ('fix_north', 'imu_pitch', 'pressure_absolute', 'believed_current_east'):
        assert {'units', 'long_name', 'topic'} <= set(data[name].attrs)


def test_dataset_of_a_vehicle_that_knows_its_place_has_no_other_sensors():
    data = glider.fly('current_8deg', duration=10.0).to_xarray()
    sensors = ('imu_', 'fix_', 'pressure_', 'believed_')
    assert not [name for name in data.data_vars if name.startswith(sensors)]
    assert np.array_equal(data.odom_north, data.ground_truth_odom_north)


def test_memory_and_bag_give_the_same_numbers(flown):
    memory = glider.fly('current_8deg', RECKONED, duration=600.0).to_xarray()
    bag = flown.to_xarray().isel(time=slice(0, memory.sizes['time']))
    for name in memory.data_vars:
        assert np.array_equal(memory[name], bag[name], equal_nan=True), name


def test_panels_are_called_as_in_the_document(flown, tmp_path):
    body, _ = read_page(flown.report(tmp_path / 'page.html'))
    for called in re.findall(r'^\| ([A-Z][^|]*) \|', DOCUMENT.read_text(encoding='utf-8'), re.M):
        parts = [called] if called in body else called.split(', ')
        assert all(part in body for part in parts), called


def test_a_strong_current_that_is_forecast_is_believed_from_the_launch_on():
    """Else the velocity would jump as the vehicle dives, and be refused."""
    current = {'speed_mps': 1.2, 'direction_deg': 90.0}
    told = {'navigation.current': 'forecast', 'navigation.forecast': current, 'current': current}
    told |= {'sensors.gps_first_fix_s': 600.0, 'profile.prepare_s': 10.0}
    run = glider.fly('current_8deg', {**RECKONED, **told}, duration=300.0)
    assert run.score['guard']['events'] == []


def test_a_forecast_of_a_shear_costs_no_way_that_its_mean_would_not():
    """Who turned against the water of every depth would make good less."""
    shear = {'kind': 'shear', 'law': 'exponential', 'depth_m': 60.0, 'speed_mps': 0.6}
    current = {'components': [{**shear, 'direction_deg': 90.0}]}
    mean_mps = 0.6 * 0.6 * (1.0 - math.exp(-1.0 / 0.6))
    path = {'kind': 'straight', 'course_deg': 0.0, 'length_m': 20_000.0}
    made_good = []
    for forecast in (current, {'speed_mps': mean_mps, 'direction_deg': 90.0}):
        told = {'navigation.current': 'forecast', 'navigation.forecast': forecast}
        changes = {**RECKONED, 'current': current, 'path': path, **told}
        flown = glider.fly('current_8deg', changes, duration=9000.0).to_xarray()
        north = flown.ground_truth_odom_north
        made_good.append(float(north[-1] - north[30_000]))
    assert made_good[0] == pytest.approx(made_good[1], rel=0.05)
