# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""No progress along the path: it is told, and what guidance does then is what it was set to."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

import glider_bringup as glider
from glider_base.settings import ConfigurationError
from glider_bringup.cli import app
from glider_bringup.showing.findings import findings
from glider_bringup.showing.flown_run import read_run

#: North against a current that carries the vehicle south, then south with it.
AGAINST = {
    'current.speed_mps': 0.6,
    'current.direction_deg': 180.0,
    'profile.depth_m': 20.0,
    'profile.prepare_s': 0.0,
    'profile.surface_every_dives': 1,
    'profile.wait_s': 30.0,
    'dives': 0,
    'path': {'kind': 'waypoints', 'waypoints': [[0, 0], [3000, 0], [-4000, 500]]},
    'guidance.no_progress_surfacings': 2,
}
FLOWN_S = 1000.0


def fly(reaction: str, duration: float = FLOWN_S, **fields) -> glider.Run:
    """A flight against the current."""
    changes = {**AGAINST, 'guidance.no_progress': reaction, **fields}
    return glider.fly('current_8deg', changes, duration=duration)


def surfacings(run) -> np.ndarray:
    """Ticks at which guidance has the vehicle at the surface, after a dive."""
    waits = run.to_xarray()['stage'].values == 5
    return np.flatnonzero(np.diff(waits.astype(int), prepend=0) > 0)


def test_it_is_told_at_the_second_surfacing_in_a_row_and_not_again():
    run = fly('tell')
    second = surfacings(run)[1] / 10.0
    assert run.score['no_progress']['events'] == [
        {'t_s': pytest.approx(second), 'message': 'waypoint 1 comes no nearer'}
    ]
    assert not fly('tell', **{'guidance.no_progress_surfacings': 0}).score['no_progress']['events']
    told = run.to_xarray()['no_progress'].values
    assert not told[: round(10 * second)].any() and (told[round(10 * second) :] == 1).all()


def test_who_gets_on_hears_nothing():
    run = fly('tell', **{'current.speed_mps': 0.1})
    assert len(surfacings(run)) >= 2 and not run.score['no_progress']['events']


def test_time_for_which_it_is_held_is_none_without_progress():
    orders = [{'at_s': 150.0, 'hold': True}, {'at_s': 30_000.0, 'resume': True}]
    run = fly('hold', 31_000.0, orders=orders, **{'current.speed_mps': 0.0})
    assert len(surfacings(run)) >= 3 and not run.score['no_progress']['events']


def test_telling_changes_no_bit():
    told, quiet = (
        fly('tell', **{'guidance.no_progress_surfacings': count}).to_xarray() for count in (2, 0)
    )
    for name in set(told.data_vars) - {'no_progress'}:
        assert told[name].values.tobytes() == quiet[name].values.tobytes(), name


def test_who_skips_heads_for_the_next_waypoint():
    run = fly('skip')
    data, skipped = run.to_xarray(), surfacings(run)[1] + 1
    place, end = data.isel(time=skipped), data.isel(time=-1)
    leg = np.array([-4000.0 - place.odom_north, 500.0 - place.odom_east])
    gone = np.array([end.reference_north - place.odom_north, end.reference_east - place.odom_east])
    assert gone @ leg > 100.0 * np.hypot(*leg)  # m along the leg, and none beside it
    assert abs(np.linalg.det([leg, gone])) < 1.0 * np.hypot(*leg)
    assert len(run.score['no_progress']['events']) == 1


def test_the_next_waypoint_is_skipped_too_if_that_comes_no_nearer_either():
    path = {'kind': 'waypoints', 'waypoints': [[0, 0], [3000, 0], [3000, 500], [-4000, 500]]}
    told = fly('skip', path=path, **{'guidance.no_progress_surfacings': 1}).to_xarray()
    told = told['no_progress'].values
    begins = np.flatnonzero(np.diff(told) > 0) + 1
    assert len(begins) == 2 and begins[1] < 9000  # in the first block that the engine flies
    assert not told[begins + 1].any()


def test_the_last_waypoint_is_not_skipped():
    run = fly('skip', path={'kind': 'waypoints', 'waypoints': [[0, 0], [3000, 0]]})
    assert (run.to_xarray()['reference_north'].values[-100:] >= 0.0).all()
    assert run.score['no_progress']['events']


def test_who_holds_waits_for_orders():
    goes_on = {'path': {**AGAINST['path'], 'at_end': 'continue'}}
    flight = glider.Flight('current_8deg', {**AGAINST, **goes_on, 'guidance.no_progress': 'hold'})
    flight.until(t_s=FLOWN_S)
    assert flight.now['stage'] == 5 and flight.now['ground_truth_odom_depth'] < 1.0
    with pytest.raises(ConfigurationError, match='holds already'):
        flight.order(hold=True)
    flight.order(resume=True)
    flight.until(t_s=FLOWN_S + 300.0)
    assert flight.now['ground_truth_odom_depth'] > 5.0


def test_a_run_that_ends_with_its_path_is_over_once_it_is_held():
    run = fly('hold')
    assert run.score['sim_time_s'] == pytest.approx(surfacings(run)[1] / 10.0 + 90.0, abs=3.0)
    assert run.score['arrival']['arrived'] is False


def test_a_planned_route_leaves_it_to_the_pilot():
    with pytest.raises(ConfigurationError, match=r'not with a planned route \(allowed: tell\)'):
        glider.Flight('eddies_hard', {'guidance.no_progress': 'skip'})


def test_nodes_do_the_same_to_the_last_bit_and_verify_says_so(tmp_path):
    changes = {'guidance.no_progress': 'skip', 'guidance.no_progress_surfacings': 1}
    asked = {'scenario': 'current_8deg', 'set': {**AGAINST, **changes}, 'bag': True}
    asked['duration'] = 280.0
    told, seen = [], []
    for engine in ('nodes', 'direct'):
        folder = tmp_path / engine
        run = glider.fly(**asked, engine=engine, out=folder)
        done = CliRunner().invoke(app, ['verify', str(folder), '--json'])
        assert done.exit_code == 0 and json.loads(done.stdout)['identical'], done.output
        told.append(run.score['no_progress'])
        seen.append(run.to_xarray())
    assert told[0] == told[1] and len(told[0]['events']) == 1
    for name in seen[0].data_vars:
        assert seen[0][name].values.tobytes() == seen[1][name].values.tobytes(), name


def test_report_and_scorecard_tell_it(tmp_path):
    run = glider.fly('current_8deg', AGAINST, duration=FLOWN_S, out=tmp_path / 'run')
    assert run.score['no_progress']['events']
    assert any('waypoint 1 comes no nearer' in text for _, text in findings(read_run(run.folder)))
