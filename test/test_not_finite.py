# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A run whose numbers cease to be finite: failed, told by name, exit code 1, valid JSON.

No scenario of a shipped vehicle does so (`./glider test --only fuzz --door flights`). A vehicle
file can: here rolling is driven, not damped, by the flow, so that a roll grows without limit.
"""

import json
import math

import pytest

from fuzzing import flights
from fuzzing.counts import Counter
from glider_bringup.engines.direct import FlightError, fly_blocks
from glider_bringup.engines.flight import mission_of
from glider_bringup.scoring.again import score_again
from glider_bringup.scoring.card import fly_scored, scorecard
from glider_mission.scenario import load_scenario, read_scenario
from glider_model.vehicle.file import vehicle_path
from glider_studies import montecarlo
from glider_studies.paper.experiments import Case, _fly_case
from glider_studies.sweep import fly
from glider_studies.sweep.fly import Chunk

DURATION_S = 600.0


def strict(text):
    """JSON as everybody reads it: without NaN and Infinity."""

    def refuse(token):
        raise AssertionError(f'{token} is no JSON')

    return json.loads(text, parse_constant=refuse)


@pytest.fixture(scope='module')
def driven(tmp_path_factory):
    """Vehicle file with a roll damping that drives."""
    text = vehicle_path('zhang2021').read_text()
    file = tmp_path_factory.mktemp('vehicle') / 'driven.yaml'
    changed = text.replace('K_p: {value: 0.0', 'K_p: {value: 10000.0')
    assert changed != text
    file.write_text(changed)
    return file


@pytest.fixture(scope='module')
def blown(glider, driven, tmp_path_factory):
    """The same run by both engines: process and folder."""

    def fly(engine):
        folder = tmp_path_factory.mktemp('runs') / engine
        more = ['--set', f'vehicle={driven}', '--duration', DURATION_S, '--out', folder, '--json']
        at_once = ['--set', 'profile.prepare_s=0']
        return glider('run', 'current_8deg', '--engine', engine, *more, *at_once), folder

    return {engine: fly(engine) for engine in ('direct', 'nodes')}


@pytest.mark.parametrize('engine', ['direct', 'nodes'])
def test_run_fails_by_name_with_valid_json(blown, engine):
    process, folder = blown[engine]
    assert process.returncode == 1
    assert 'Traceback' not in process.stderr
    card = strict(process.stdout)
    assert card == strict((folder / 'score.json').read_text())
    tick = card['ticks']
    assert 100 < tick < 10.0 * DURATION_S
    told = f'plant: the state is not finite at tick {tick} (t = {tick / 10:.1f} s): '
    assert (card['status'], card['reason'][: len(told)]) == ('failed', told)
    assert 'p' in card['reason'][len(told) :].split(', ')


def test_engines_agree_on_what_was_flown_before(blown):
    cards = [strict(blown[engine][0].stdout) for engine in ('direct', 'nodes')]
    for name in ('reason', 'ticks', 'depth_m', 'distance_along_path_m', 'final_state'):
        assert cards[0][name] == cards[1][name]


def test_failed_run_is_reported(glider, blown, tmp_path):
    _, folder = blown['direct']
    page = glider('report', folder, '--out', tmp_path / 'report.html')
    assert page.returncode == 0, page.stderr
    text = (tmp_path / 'report.html').read_text()
    assert '✕ Failed' in text
    assert 'Stopped after ' in text


def test_scored_again_it_has_failed_too(blown, tmp_path):
    process, folder = blown['nodes']
    assert score_again(folder) == strict(process.stdout)
    for file in (*folder.glob('*.mcap'), folder / 'scenario.yaml', folder / 'vehicle.yaml'):
        (tmp_path / file.name).write_bytes(file.read_bytes())
    alone, first = score_again(tmp_path), strict(process.stdout)
    for name in ('status', 'reason', 'ticks', 'final_state'):
        assert alone[name] == first[name]


def test_every_tick_before_is_finite_and_given(driven):
    changes = {'vehicle': str(driven), 'dives': 0, 'duration_s': DURATION_S}
    ticks = 0
    with pytest.raises(FlightError, match='not finite at tick') as error:
        for log in fly_blocks(*mission_of(load_scenario(changes=changes))):
            assert math.isfinite(log.sum())
            ticks += len(log)
    assert f'at tick {ticks} ' in str(error.value)


def test_studies_count_it_as_failed(driven):
    changes = {'vehicle': str(driven), 'dives': 0, 'duration_s': DURATION_S}
    scenario = load_scenario(changes=changes)
    assert montecarlo._fly_plant(scenario)['diverged']
    row, _ = _fly_case(Case('', 'adaptive', 'los_current', 'current_8deg', changes))
    assert (row['status'], row['finite']) == ('failed', False)
    vehicles = {fly.vehicle_digest(scenario.vehicle)}
    (record,) = fly.fly_chunk(Chunk(read_scenario(), vehicles, [(0, changes)]))
    assert (record['status'], record['figures']) == ('failed', {})
    assert 'not finite at tick' in record['reason']


def test_score_that_is_not_finite_is_a_failure():
    """Numbers of flights are bounded, their squares need not be."""
    scenario = load_scenario(changes={'dives': 0, 'duration_s': 1.0})
    flight, scores = fly_scored(scenario)
    scores['cross_track_m']['max_all'] = math.inf
    scores['final_state']['velocity_mps'][0] = math.nan
    card = scorecard(scenario, 'direct', flight, scores)
    assert card['status'] == 'failed'
    assert card['reason'] == (
        'the score is not finite: cross_track_m.max_all, final_state.velocity_mps'
    )
    assert card['cross_track_m']['max_all'] is card['final_state']['velocity_mps'][0] is None
    strict(json.dumps(card))


def test_a_number_that_grew_without_limit_is_not_told_and_its_run_is_shown(
    glider, driven, blown, tmp_path
):
    """It ended the run a tick before it was infinite: 6e33 m along the path, in one case."""
    folder, page = tmp_path / 'run', tmp_path / 'report.html'
    more = ['--set', f'vehicle={driven}', '--set', 'vehicle.hydrodynamics.K_p.value=19834.7']
    more += ['--set', 'perturb.roll_bias_deg=5', '--duration', DURATION_S, '--out', folder]
    done = glider('run', 'current_8deg', '--engine', 'direct', *more, '--json')
    assert (done.returncode, 'no report' in done.stderr) == (1, False), done.stderr
    card = strict(done.stdout)
    assert (card['status'], card['distance_along_path_m']) == ('failed', None)
    assert card['final_state']['velocity_mps'] == [None] * 3
    for words in (
        ('score', folder),
        ('report', folder, '--out', page),
        ('compare', folder, blown['direct'][1]),
    ):
        shown = glider(*words)
        assert shown.returncode == 0, shown.stderr
    assert '✕ Failed' in page.read_text()


def test_extreme_flights_are_finite_or_refused():
    """A few of `./glider test --only fuzz --door flights`, by loops that other tests compile."""
    counter = Counter(lambda tried: None)
    flights.fuzz(33, 12, counter)
    counts = counter.result()
    assert counts.clean, counts.examples
    assert counts.tried == 12


def test_fuzz_sees_a_flight_that_fails(driven, monkeypatch):
    changes = {'vehicle': str(driven), 'dives': 0, 'duration_s': DURATION_S}
    monkeypatch.setattr(flights, 'draw_changes', lambda seed, case: changes)
    counter = Counter(lambda tried: None)
    flights.fuzz(0, 1, counter)
    counts = counter.result()
    assert (counts.wrong, counts.clean) == (1, False)
    assert 'not finite at tick' in counts.examples[0]


@pytest.mark.parametrize('factor', [3.1, 10.0])
def test_stiff_roll_flies(factor):
    """Cases of 1980cb2 in which every number was NaN, and the run completed."""
    changes = {'perturb.D_p': factor, 'dives': 0, 'duration_s': 7000.0}
    scenario = load_scenario(changes=changes)
    flight, scores = fly_scored(scenario)
    card = scorecard(scenario, 'direct', flight, scores)
    assert (card['status'], card['ticks']) == ('completed', 70000)
    assert card['depth_m']['max'] > 900.0
    assert card['cross_track_m']['max_steady'] < 10.0
