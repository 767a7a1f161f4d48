# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The stability map: classes by stated thresholds, limits by independent formulas, images."""

import json
import math
import sys

import matplotlib.image
import numpy as np
import pytest
import yaml

from command_line import glider
from glider_bringup import cli
from glider_bringup.door.netcdf import read_dataset, write_dataset
from glider_studies.showing.stability_map import CLASSES, CRITICAL_M, STABLE_M, load_map, shares
from glider_studies.sweep.fly import failure
from glider_studies.sweep.netcdf import make_dataset
from glider_studies.sweep.plan import load_sweep

KNOT_MPS = 1852.0 / 3600.0
SPEEDS, ANGLES = [0.0, 0.4, 0.8, 1.2], [0.0, 20.0, 60.0, 90.0, 150.0, 180.0]
DIMENSIONS = {
    'who': {'kind': 'variants', 'variants': {'one': {'seed': 1}, 'other': {'seed': 2}}},
    'angle': {'kind': 'values', 'field': 'current.angle_deg', 'values': ANGLES},
    'speed': {'kind': 'values', 'field': 'current.speed_kn', 'values': SPEEDS},
}


def write(folder, errors, statuses=None, dimensions=DIMENSIONS):
    """Result of a sweep whose cells have these steady errors, in their order."""
    path = folder / 'mine.yaml'
    path.write_text(yaml.safe_dump({'dimensions': dimensions}, sort_keys=False))
    plan = load_sweep(str(path))
    records = [
        {
            'cell': cell,
            'status': (statuses or {}).get(cell, 'completed'),
            'reason': '',
            'figures': {'cross_track_m.max_steady': errors[cell % len(errors)]},
        }
        for cell in range(plan.cells)
    ]
    write_dataset(make_dataset(plan, records), folder / 'sweep.nc')
    return folder / 'sweep.nc'


def refused(arguments, monkeypatch, capsys):
    monkeypatch.setattr(sys, 'argv', ['glider', 'map', *map(str, arguments)])
    assert cli.main() == 2
    printed = capsys.readouterr()
    assert printed.out == ''
    return printed.err


def test_classes_are_those_of_the_stated_thresholds(tmp_path):
    errors = [0.0, STABLE_M, STABLE_M + 1e-6, CRITICAL_M, CRITICAL_M + 1e-6, None, 1.0, 1.0]
    expected = ['stable', 'stable', 'critical', 'critical', 'lost', 'lost', 'infeasible', 'failed']
    file = write(tmp_path, errors, {6: 'infeasible', 7: 'failed'})
    found = [CLASSES[i] for i in load_map(file).classes[0].T.ravel()[:8]]
    assert found == expected


def test_a_map_by_surfacing_has_its_own_measure_and_limits(tmp_path, monkeypatch, capsys):
    path = tmp_path / 'mine.yaml'
    path.write_text(yaml.safe_dump({'dimensions': DIMENSIONS}, sort_keys=False))
    plan, name = load_sweep(str(path)), 'navigation.from_fourth.surfacing_cross_track_m'
    beside = [49.0, 51.0, 199.0, 201.0]
    records = [
        {
            **{'cell': cell, 'status': 'completed', 'reason': ''},
            'figures': {'cross_track_m.max_steady': 1.0, name: beside[cell % 4]},
        }
        for cell in range(plan.cells)
    ]
    file = tmp_path / 'sweep.nc'
    write_dataset(make_dataset(plan, records), file)
    found = [CLASSES[i] for i in load_map(file, 'surfacing').classes[0].T.ravel()[:4]]
    assert found == ['stable', 'critical', 'critical', 'lost']
    assert (load_map(file).classes == CLASSES.index('stable')).all()
    for record in records:
        record['figures'][name] = None  # too few dives
    write_dataset(make_dataset(plan, records), file)
    (tmp_path / 'known').mkdir()
    for none in (file, write(tmp_path / 'known', [1.0])):
        assert 'surfacing' in refused([none, '--by', 'surfacing'], monkeypatch, capsys)


def test_dimensions_are_sorted_out_whatever_their_order(tmp_path):
    stability = load_map(write(tmp_path, [1.0, 20.0, 60.0, 60.0]))
    assert stability.panels == ['one', 'other']
    assert list(stability.speed_kn) == SPEEDS
    assert list(stability.angle_deg) == ANGLES
    assert stability.classes.shape == (2, 4, 6)
    for i, name in enumerate(('stable', 'critical', 'lost', 'lost')):
        assert (stability.classes[:, i] == CLASSES.index(name)).all()


def test_limit_of_physics_is_that_of_the_formula(tmp_path):
    """|V sin d| <= U_h and sqrt(U_h^2 - V^2 sin^2 d) + V cos d > 0, with U_h of the glide."""
    stability = load_map(write(tmp_path, [1.0]))
    done = glider('trim', 'zhang2021', '--json', '--net-heaviness-kg', 0.4, '--pitch-deg', -30)
    glide = json.loads(done.stdout)
    horizontal = glide['speed_mps'] * math.cos(math.radians(glide['glide_deg'])) / KNOT_MPS
    assert stability.horizontal_kn == pytest.approx([horizontal] * 2, rel=1e-3)
    for i, speed in enumerate(SPEEDS):
        for j, angle in enumerate(np.radians(ANGLES)):
            left = horizontal**2 - (speed * math.sin(angle)) ** 2
            holds = left >= 0.0 and math.sqrt(left) + speed * math.cos(angle) > 0.0
            assert (stability.feasible[:, i, j] == holds).all(), (speed, angle)


def test_each_panel_has_the_limit_of_its_own_vehicle_and_glide(tmp_path):
    """U_h by the balance of weight, lift and drag; all panels were told that of the first."""
    light = {'profile.net_heaviness_kg': 0.2}
    who = {
        'light': light,
        'heavy': {'profile.net_heaviness_kg': 0.4},
        'steep': {**light, 'profile.pitch_deg': 50.0},
        'fouled': {**light, 'vehicle.hydrodynamics.K_D0': 30.0},
        'seaglider': {**light, 'vehicle': 'seaglider'},
    }
    dimensions = {**DIMENSIONS, 'who': {'kind': 'variants', 'variants': who}}
    stability = load_map(write(tmp_path, [1.0], dimensions=dimensions))
    told = dict(zip(stability.panels, stability.horizontal_kn, strict=True))
    assert told['heavy'] == pytest.approx(math.sqrt(2.0) * told['light'], rel=0.01)
    for name, drag, pitch in ('light', 7.5, 30.0), ('steep', 7.5, 50.0), ('fouled', 30.0, 30.0):
        angles = np.radians(np.linspace(0.01, 20.0, 200_001))
        forces = drag + 400.0 * angles**2, 458.0 * angles
        off = np.abs(np.arctan2(*forces) - np.radians(pitch) - angles)
        best = int(np.argmin(off))
        speed = math.sqrt(0.2 * 9.81 / math.hypot(*(force[best] for force in forces)))
        across = speed * math.cos(math.radians(pitch) + angles[best])
        assert told[name] == pytest.approx(across / KNOT_MPS, rel=0.01)
    assert told['seaglider'] == pytest.approx(0.727, rel=0.01)  # ./glider trim
    rows = {row['panel']: row for row in shares(stability)}
    assert rows['heavy']['feasible'] > rows['light']['feasible'] > rows['fouled']['feasible']


def test_shares_add_up(tmp_path):
    rows = shares(load_map(write(tmp_path, [1.0, 1.0, 20.0, 60.0], {3: 'infeasible'})))
    assert [row['panel'] for row in rows] == ['one', 'other']
    for row in rows:
        assert row['cells'] == 24
        assert sum(row[name] for name in CLASSES) == pytest.approx(1.0)
    assert rows[0]['stable'] == 0.5 and rows[0]['critical'] == 0.25
    assert rows[0]['infeasible'] == pytest.approx(1.0 / 24.0)
    stability = load_map(tmp_path / 'sweep.nc')
    held = stability.feasible[0, :2].sum() / stability.feasible[0].sum()
    assert rows[0]['stable_of_feasible'] == pytest.approx(held)


@pytest.mark.parametrize('suffix', ['png', 'svg', 'pdf'])
def test_map_is_drawn(suffix, tmp_path, monkeypatch, capsys):
    file = write(tmp_path, [1.0, 20.0, 60.0, None], {5: 'infeasible', 6: 'failed'})
    image = tmp_path / f'map.{suffix}'
    monkeypatch.setattr(sys, 'argv', ['glider', 'map', str(file), '--out', str(image), '--json'])
    assert cli.main() == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed['image'] == str(image)
    assert [row['panel'] for row in printed['panels']] == ['one', 'other']
    if suffix == 'png':
        pixels = (255.0 * matplotlib.image.imread(image)[..., :3]).round().astype(int)
        colours = {tuple(pixel) for pixel in pixels.reshape(-1, 3)}
        for colour in ('56b4e9', 'f0e442', 'd55e00', 'c8c8c8'):
            assert tuple(bytes.fromhex(colour)) in colours
    else:
        assert image.read_bytes()[:5] in (b'<?xml', b'%PDF-')


def test_sweep_without_a_third_dimension_is_one_panel(tmp_path):
    dimensions = {name: DIMENSIONS[name] for name in ('speed', 'angle')}
    stability = load_map(write(tmp_path, [1.0], dimensions=dimensions))
    assert stability.panels == ['']


def edges(values, alone):
    """Bounds of cells: half way to the neighbours, and as far on the outer side."""
    if len(values) == 1:
        return np.array([values[0] - alone, values[0] + alone])
    steps = np.diff(values) / 2.0
    return np.array([values[0] - steps[0], *(values[:-1] + steps), values[-1] + steps[-1]])


def areas(speeds, angles):
    """Areas of lost, critical and stable cells: sectors of rings."""
    rings = np.diff(np.maximum(edges(speeds, 0.1), 0.0) ** 2)
    bounds = edges(angles, 5.0)
    if len(angles) > 1 and min(angles) >= 0.0 and max(angles) <= 180.0:
        bounds = np.clip(bounds, 0.0, 180.0)
    wedges = np.diff(bounds)
    lost = wedges[0] if len(angles) > 1 else 0.0
    critical = (wedges.sum() - lost) * (rings[0] if len(speeds) > 1 else 0.0)
    parts = np.array([lost * rings.sum(), critical, 0.0])
    parts[2] = wedges.sum() * rings.sum() - parts.sum()
    return parts / (wedges.sum() * rings.sum())


def over(speeds, angles):
    """Dimensions of speeds within angles."""
    fields = (('angle', 'current.angle_deg', angles), ('speed', 'current.speed_kn', speeds))
    return {
        name: {'kind': 'values', 'field': field, 'values': [float(one) for one in values]}
        for name, field, values in fields
    }


@pytest.mark.parametrize(
    ('speeds', 'angles', 'circle'),
    [
        ([0.5, 1.0], [0.0, 30.0, 60.0], '0.5 kn'),  # the sweep called small
        ([0.2, 0.4, 0.6, 0.8], [45.0], '0.2 kn'),
        ([0.25, 0.5, 0.75, 1.0], [20.0, 25.0, 30.0, 35.0, 40.0], '0.5 kn'),
        ([1.0], [0.0, 45.0, 90.0, 135.0, 180.0], '1 kn'),
        ([0.1, 0.2, 0.5, 1.4], [-70.0, -60.0, -20.0, 0.0, 5.0, 90.0], '0.5 kn'),
        ([0.5, 1.0, 1.5], list(range(0, 360, 30)), '1 kn'),
    ],
)
def test_nothing_of_a_map_is_cut_off(tmp_path, monkeypatch, speeds, angles, circle):
    """Lost the first angle, critical the lowest speed of the others: so much of each is seen."""
    errors = [
        60.0 if not j and len(angles) > 1 else 20.0 if not i and len(speeds) > 1 else 1.0
        for j in range(len(angles))
        for i in range(len(speeds))
    ]
    file = write(tmp_path, errors, dimensions=over(speeds, angles))
    for image in ('map.png', 'map.svg'):
        out = str(tmp_path / image)
        monkeypatch.setattr(sys, 'argv', ['glider', 'map', str(file), '--out', out])
        assert cli.main() == 0
    pixels = (255.0 * matplotlib.image.imread(tmp_path / 'map.png')[..., :3]).round().astype(int)
    assert (pixels[:, [0, -1]] == 255).all()
    seen = np.array(
        [
            np.count_nonzero((pixels == list(bytes.fromhex(colour))).all(axis=-1))
            for colour in ('d55e00', 'f0e442', '56b4e9')
        ]
    )
    assert seen.sum() > 0.02 * pixels.shape[0] * pixels.shape[1]
    assert seen / seen.sum() == pytest.approx(areas(speeds, angles), abs=0.04)
    drawing = (tmp_path / 'map.svg').read_text()
    assert f'<!--  {circle} -->' in drawing
    held = shares(load_map(file))[0]['stable_of_feasible']
    assert f'<!-- {held:.1%} of the feasible -->' in drawing


@pytest.mark.parametrize(('vehicle', 'points'), [('zhang2021', 3), ('seawing', 0)])
def test_points_of_the_paper_are_on_maps_of_its_vehicle_alone(
    vehicle, points, tmp_path, monkeypatch
):
    dimensions = over([0.5, 1.0], [0.0, 30.0])
    dimensions['who'] = {'kind': 'values', 'field': 'vehicle', 'values': [vehicle]}
    file, image = write(tmp_path, [1.0], dimensions=dimensions), tmp_path / 'map.svg'
    monkeypatch.setattr(sys, 'argv', ['glider', 'map', str(file), '--out', str(image)])
    assert cli.main() == 0
    assert image.read_text().count('<!-- the paper: ') == points


def test_map_of_currents_that_nobody_can_hold(tmp_path, monkeypatch, capsys):
    file = write(tmp_path, [None], dimensions=over([1.5, 1.6], [80.0, 90.0]))
    arguments = ['glider', 'map', str(file), '--out', str(tmp_path / 'map.svg')]
    monkeypatch.setattr(sys, 'argv', [*arguments, '--json'])
    assert cli.main() == 0
    (panel,) = json.loads(capsys.readouterr().out, parse_constant=pytest.fail)['panels']
    assert (panel['feasible'], panel['stable_of_feasible']) == (0.0, None)
    monkeypatch.setattr(sys, 'argv', arguments)
    assert cli.main() == 0
    assert 'no cell is feasible' in (tmp_path / 'map.svg').read_text()


def test_file_that_is_no_map_is_refused(tmp_path, monkeypatch, capsys):
    def told(*arguments):
        return refused(arguments, monkeypatch, capsys)

    assert 'no such file' in told(tmp_path / 'nowhere.nc')
    (tmp_path / 'text.nc').write_text('hello')
    text = told(tmp_path / 'text.nc')
    assert 'cannot be read as NetCDF' in text and 'pip' not in text
    whole = write(tmp_path, [1.0])
    (tmp_path / 'half.nc').write_bytes(whole.read_bytes()[:2000])
    assert 'half.nc' in told(tmp_path / 'half.nc')
    assert 'cannot be written' in told(whole, '--out', tmp_path / 'map.docx')
    assert 'cannot be written' in told(whole, '--out', tmp_path / 'nowhere' / 'map.png')
    alien = read_dataset(whole)
    alien.attrs = {}
    write_dataset(alien, tmp_path / 'alien.nc')
    assert 'not a result of ./glider sweep' in told(tmp_path / 'alien.nc')
    depth = {'kind': 'values', 'field': 'profile.depth_m', 'values': [100.0, 200.0]}
    more = {**DIMENSIONS, 'depth': depth}
    assert 'at most one more' in told(write(tmp_path, [1.0], dimensions=more))
    less = {'speed': DIMENSIONS['speed'], 'depth': depth}
    assert 'current.angle_deg' in told(write(tmp_path, [1.0], dimensions=less))


def test_sweep_that_failed_everywhere_has_no_map(tmp_path, monkeypatch, capsys):
    path = tmp_path / 'mine.yaml'
    path.write_text(yaml.safe_dump({'dimensions': DIMENSIONS}))
    plan = load_sweep(str(path))
    records = [{'cell': cell, **failure('broken')} for cell in range(plan.cells)]
    write_dataset(make_dataset(plan, records), tmp_path / 'sweep.nc')
    assert 'every cell failed' in refused([tmp_path / 'sweep.nc'], monkeypatch, capsys)
