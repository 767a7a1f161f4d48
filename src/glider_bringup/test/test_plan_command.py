# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""``./glider plan``, and flights on a planned route: orders that are kept and flown again."""

import json
import re

import matplotlib.image
import numpy as np
import pytest
import xarray
from typer.testing import CliRunner

import glider_bringup as glider
from glider_base.frames import poses_from_wire
from glider_base.settings import ConfigurationError
from glider_base.signals import TICK_S
from glider_bringup.cli import app
from glider_bringup.commands import plan as planning
from glider_bringup.commands.plan import plan
from glider_bringup.engines.flight import fly
from glider_bringup.engines.recorded import fly_recorded
from glider_bringup.scoring.score import Scorer, scores_of
from glider_bringup.showing.findings import findings
from glider_bringup.showing.flown_run import read_run
from glider_mission.blocks import COLUMNS
from glider_mission.planned import unballasted
from glider_mission.routing import pilot as piloting
from glider_mission.routing.plan import plan as planned
from glider_mission.run_folder import make_run_folder
from glider_mission.scenario import load_scenario, scenario_names

#: Two dives on a route that is planned anew between them.
SHORT = {'dives': 2, 'profile.depth_m': 500.0}


class Rows:
    """Keeps the rows of a flight."""

    def __init__(self) -> None:
        self.blocks = []

    def add(self, log: np.ndarray) -> None:
        self.blocks.append(log.copy())


def test_a_plan_in_json_and_as_a_picture(tmp_path, capsys):
    picture = tmp_path / 'plan.png'
    plan('eddies_hard', out=picture, as_json=True)
    told = json.loads(capsys.readouterr().out)
    assert told['reachable'] is True
    assert told['straight_h'] is None
    assert 150.0 < told['arrival_h']['p50'] < told['mission_h'] == 336.0
    assert 100.0 < told['wh'] < 600.0
    np.testing.assert_allclose(told['route_latlon'][0], [36.0, 122.0], atol=1e-6)
    np.testing.assert_allclose(told['route_latlon'][-1], [36.0, 121.7], atol=1e-6)
    assert len(told['waypoints_h']) == 5
    assert sorted(told['waypoints_h']) == told['waypoints_h']
    assert told['waypoints_h'][-1] == told['arrival_h']['p50'], 'of the same route'
    assert matplotlib.image.imread(picture).std() > 0.05


@pytest.mark.parametrize(('speed_kn', 'label'), [(0.3, 'planned route'), (4.0, 'does not arrive')])
def test_the_picture_of_a_plan_shows_its_mission_and_whether_it_arrives(
    speed_kn, label, tmp_path, monkeypatch
):
    drawn = []
    keep = 'glider_bringup.showing.ocean.save_figure'
    monkeypatch.setattr(keep, lambda figure, *_: drawn.append(figure))
    changes = [f'current.speed_kn={speed_kn}', 'origin.longitude_deg=180']
    plan('survey', changes, out=tmp_path / 'plan.png', as_json=True)
    axis = drawn[0].axes[0]
    ticks = {
        float(text) for text in axis.xaxis.get_major_formatter().format_ticks(axis.get_xticks())
    }
    assert min(ticks) < -179.0 and max(ticks) > 179.0, 'across the date line'
    assert all(-180.0 <= one <= 180.0 for one in ticks)
    path, _, route = axis.lines
    assert np.diff(axis.get_ylim())[0] < 15.0 * np.ptp(path.get_ydata()), 'no dot on a chart'
    assert route.get_label().startswith(label)


def test_a_plan_ends_when_the_dives_of_its_mission_are_flown(capsys):
    plan('slocum_shelf', as_json=True)
    told = json.loads(capsys.readouterr().out)
    flown = glider.fly('slocum_shelf').score
    assert (told['reachable'], told['dives'], flown['dives']) == (False, 4, 4)
    assert told['mission_h'] == pytest.approx(flown['sim_time_s'] / 3600.0, rel=0.03)


@pytest.mark.parametrize(
    ('every', 'depth_m', 'wait_s', 'bottom_m'),
    [
        (0, 60.0, 600.0, 0.0),
        (0, 200.0, 600.0, 0.0),
        (1, 60.0, 0.0, 0.0),
        (2, 200.0, 600.0, 0.0),
        (2, 200.0, 600.0, 60.0),
    ],
)
def test_a_plan_tells_time_and_energy_of_a_flight_that_surfaces_and_of_one_that_does_not(
    every, depth_m, wait_s, bottom_m
):
    path = {'kind': 'straight', 'course_deg': 0.0, 'length_m': 10_000.0, 'at_end': 'stop'}
    yo = {'profile.depth_m': depth_m, 'profile.surface_every_dives': every}
    yo |= {'profile.wait_s': wait_s, 'profile.clearance_m': 10.0, 'water.bottom_m': bottom_m}
    known = {'navigation.method': 'known', 'dives': 0, 'duration_s': 2e5}
    scenario = load_scenario('slocum_shelf', {'path': path, **yo, **known})
    made, run = planned(scenario), glider.fly(scenario)
    assert made.arrival_s(50.0) == pytest.approx(run.score['arrival']['t_s'], rel=0.15)
    assert made.wh == pytest.approx(run.score['energy']['wh'], rel=0.15)
    surfacings = np.sum(np.diff(run.to_xarray().ground_truth_odom_depth.values < 1.5) > 0) // 2
    assert planning._report(made, scenario)['surfacings'] == pytest.approx(surfacings, rel=0.15)


def test_a_path_in_depth_is_no_plan_and_what_would_be_one_is_named():
    with pytest.raises(ConfigurationError, match='profile.mode = path') as error:
        planned(load_scenario('survey', {'profile.mode': 'path'}))
    (allowed,) = re.findall(r'\(allowed: (\w+)\)', str(error.value))
    assert planned(load_scenario('survey', {'profile.mode': allowed})).reachable


@pytest.mark.parametrize('rise', [0.001, 0.002, 0.003])
def test_a_plan_knows_that_a_pump_has_no_more_than_its_range(rise):
    """Where the water asks for more, a dive is slower than by its net buoyancy."""
    path = {'kind': 'straight', 'course_deg': 0.0, 'length_m': 20_000.0, 'at_end': 'stop'}
    still = {'current.speed_kn': 0.0, 'water.pycnocline_rise': rise, 'dives': 0}
    scenario = load_scenario('slocum_shelf', {'path': path, 'duration_s': 2e5, **still})
    flown = glider.fly(scenario).score
    made = planned(scenario)
    assert made.arrival_s(50.0) == pytest.approx(flown['arrival']['t_s'], rel=0.03)
    assert made.wh == pytest.approx(flown['energy']['wh'], rel=0.1)


@pytest.mark.parametrize(
    ('vehicle', 'depth_m', 'net_heaviness_kg'),
    [('seaglider', 200.0, 0.2), ('seaglider', 600.0, 0.15), ('zhang2021', 300.0, 0.4)],
)
def test_a_plan_counts_what_is_pumped_as_the_nose_goes_over_and_a_dive_that_is_begun(
    vehicle, depth_m, net_heaviness_kg
):
    path = {'kind': 'straight', 'course_deg': 0.0, 'length_m': 9_000.0, 'at_end': 'stop'}
    yo = {'profile.depth_m': depth_m, 'profile.net_heaviness_kg': net_heaviness_kg}
    yo |= {'profile.surface_every_dives': 1, 'dives': 0, 'duration_s': 2e5}
    scenario = load_scenario('current_8deg', {'vehicle': vehicle, 'path': path, **yo})
    flown = glider.fly(scenario).score
    assert planned(scenario).wh == pytest.approx(flown['energy']['wh'], rel=0.05)


@pytest.mark.parametrize(
    ('fields', 'note'),
    [
        (['water.bottom_m=150'], 'dives to 200 m touch a bottom at 150 m'),
        (['water.bottom_m=15', 'profile.clearance_m=10'], 'no dives where the bottom is 15 m'),
        (['orders=[{at_s: 900, depth_m: 50}]'], '1 order of the mission not counted'),
        (['navigation.method=dead_reckoned'], 'no surfacing for a fix'),
        (['navigation.method=dead_reckoned', 'profile.surface_every_dives=2'], None),
        (['profile.net_heaviness_kg=0.14', 'profile.pitch_deg=20'], 'dives and climbs are not'),
        (['profile.climb_net_heaviness_kg=0.05'], 'climbs are not steered by roll'),
        (['duration_s=1e5', 'vehicle.energy.capacity.value=9'], 'its battery has 8 Wh to use'),
        (['duration_s=1e5', 'vehicle.energy.capacity.value=90'], None),
        (['profile.net_heaviness_kg=0.05', 'vehicle=slocum_g2'], None),
        (['profile.net_heaviness_kg=0.1', 'vehicle=seaglider'], None),
        (['water.bottom_m=150', 'profile.clearance_m=10'], None),
        (['water.bottom_m=250'], None),
    ],
)
def test_a_plan_tells_of_a_bottom_of_glides_not_steered_and_of_what_it_does_not_count(
    fields, note, capsys
):
    plan('survey', fields, as_json=True)
    told = json.loads(capsys.readouterr().out)['notes']
    assert len(told) == bool(note) and all(one.startswith(note) for one in told)


def test_a_plan_says_that_there_is_no_way_round_land(tmp_path, capsys):
    axes = {'lat': np.linspace(35.9, 36.3, 41), 'lon': np.linspace(121.0, 123.0, 2)}
    height = np.where(abs(axes['lat'] - 36.06) < 0.001, 9.0, -900.0)
    wall = xarray.DataArray(np.tile(height, (2, 1)).T, axes, name='z')
    wall.assign_attrs(units='m').to_netcdf(tmp_path / 'wall.nc', 'w', engine='scipy')
    over = [f'bathymetry.file={tmp_path}/wall.nc', 'guidance.route=planned']
    over += ['path={kind: straight, length_m: 14000.0, at_end: stop}']
    plan('survey', over, as_json=True)
    told = json.loads(capsys.readouterr().out)
    assert not told['reachable']
    assert told['notes'] == ['no way round the land between waypoints is found in its time']


def test_a_flight_whose_glides_are_not_steered_says_so_before_and_after(tmp_path):
    fields = 'profile.net_heaviness_kg=0.14', 'profile.pitch_deg=20'
    asked = ['run', 'current_8deg', '--engine', 'direct', '--duration', '60']
    asked += [word for field in fields for word in ('--set', field)]
    done = CliRunner().invoke(app, [*asked, '--out', str(tmp_path / 'run')])
    assert done.exit_code == 0 and 'dives and climbs are not steered by roll' in done.stderr
    told = findings(read_run(tmp_path / 'run'))
    (problem,) = (text for kind, text in told if kind == 'problem')
    assert problem.startswith('Dives and climbs are not steered by roll')
    assert not any('could be held' in text for _, text in told)
    assert not any(load_scenario(name).unsteered for name in scenario_names())


@pytest.mark.parametrize(
    ('density', 'why'), [(1005.0, 'sinks whatever'), (1025.0, ''), (1045.0, 'floats whatever')]
)
def test_a_vehicle_that_is_not_ballasted_for_its_water_is_named(density, why, tmp_path):
    water = {'profile': [[0.0, density], [300.0, density + 0.1]]}
    scenario = load_scenario('slocum_shelf', {'dives': 0, 'duration_s': 1500.0, 'water': water})
    assert why in ''.join(unballasted(scenario)) and bool(why) == bool(unballasted(scenario))
    run = glider.fly(scenario, out=tmp_path / 'run')
    found = [text for kind, text in findings(read_run(run.folder)) if kind == 'problem']
    assert any('whatever its pump does' in text for text in found) == bool(why)
    depth = run.score['depth_m']['max']
    assert {'sinks whatever': depth > 250.0, '': 190.0 < depth < 210.0}.get(why, depth < 5.0)
    assert not any(unballasted(load_scenario(name)) for name in scenario_names())


@pytest.mark.parametrize(
    ('rise', 'bottom_m', 'why'),
    [(0.003, 0.0, ''), (0.0045, 0.0, 'at 200 m, it floats whatever'), (0.0045, 60.0, '')],
)
def test_a_vehicle_too_light_for_the_water_of_its_dives_is_named(rise, bottom_m, why):
    water = {'water.pycnocline_rise': rise, 'water.bottom_m': bottom_m}
    scenario = load_scenario('slocum_shelf', water)
    assert why in ''.join(unballasted(scenario)) and bool(why) == bool(unballasted(scenario))


def test_a_planned_flight_has_its_route_as_orders_and_flies_so_to_the_same_bits(tmp_path):
    scenario, first, again = load_scenario('eddies_hard', SHORT), Rows(), Rows()
    flight = fly(scenario, [first])
    assert flight.status == 'completed'
    assert flight.orders[0].at_s == 0.0
    assert len(flight.orders) > 1
    assert all(order.path.at_end == 'stop' for order in flight.orders)
    run = glider.fly(scenario, out=tmp_path / 'run')
    assert tuple(run.scenario.orders) == flight.orders
    kept = load_scenario(str(run.folder / 'scenario.yaml'))
    assert kept.guidance.route == 'straight'
    scorer = Scorer(kept)
    assert not fly(kept, [again, scorer]).orders
    assert scores_of(kept, scorer)['arrival'] == run.score['arrival']
    one, other = (np.concatenate(rows.blocks) for rows in (first, again))
    assert one.tobytes() == other.tobytes()


def test_what_a_pilot_notes_is_the_true_current_of_the_dive_segment_that_he_dates(monkeypatch):
    """The mean of what was flown through from one surfacing to the next, there and then."""
    noted, plain, rows = [], piloting.observed, Rows()

    def observed(chart, seen, *errors):
        noted[:] = seen
        return plain(chart, seen, *errors)

    monkeypatch.setattr(piloting, 'observed', observed)
    fly(load_scenario('eddies_hard', {'dives': 5}), [rows])
    log = np.concatenate(rows.blocks)
    north, east, depth = poses_from_wire(log[:, COLUMNS['ground_truth/odom']])[:, :3].T
    under = np.flatnonzero(np.diff(depth > 5.0, prepend=False, append=False))
    segments = [slice(*ends) for ends in under.reshape(-1, 2) if np.ptp(ends) > 36000]
    assert len(noted) == len(segments) - 2 == 3
    for (t_s, *place, v_n, v_e), one in zip(noted, segments, strict=False):
        assert one.start * TICK_S < t_s < one.stop * TICK_S
        middle = (one.start + one.stop) // 2
        assert np.hypot(north[middle] - place[0], east[middle] - place[1]) < 2000.0
        true_e, true_n, _ = log[one, COLUMNS['current_velocity']].mean(axis=0)
        assert np.hypot(v_n - true_n, v_e - true_e) < 0.02


def test_a_route_that_is_planned_in_flight_is_not_recorded(tmp_path):
    scenario = load_scenario('eddies_hard', SHORT)
    folder = make_run_folder(scenario, tmp_path / 'run')
    with pytest.raises(ConfigurationError, match=r"guidance.route = 'planned': not over nodes"):
        fly_recorded(scenario, folder)
