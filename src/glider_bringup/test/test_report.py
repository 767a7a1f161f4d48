# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Reports and comparisons: what they say, what they take, and what a failed one leaves behind."""

import base64
import json
import math
import re
import resource
import shutil
import sys
import zlib
from functools import partial
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

from command_line import glider
from glider_bringup import cli, console
from glider_bringup.engines.direct import fly_blocks
from glider_bringup.engines.flight import Outcome, mission_of
from glider_bringup.scoring.card import scorecard, write_score
from glider_bringup.scoring.one_hertz import Rows
from glider_bringup.scoring.score import Scorer
from glider_bringup.scoring.traces import dives_of, make_tracer
from glider_bringup.showing.figure import draw_run
from glider_bringup.showing.findings import LOST_M, findings, lost_since_s, verdict
from glider_bringup.showing.flown_run import keep_traces, read_run
from glider_bringup.showing.report import report_page
from glider_bringup.showing.words import span
from glider_guard.rows import ROWS
from glider_mission.blocks import COLUMNS
from glider_mission.disk import write_whole
from glider_mission.rules import Rules
from glider_mission.run_folder import make_run_folder
from glider_mission.scenario import load_scenario, scenario_names

E2 = COLUMNS['tracking_error'].start + 1
SHORT = {'dives': 0, 'duration_s': 300.0, 'settle_s': 0.0}


class Text(HTMLParser):
    """Tags of a page, and its text outside of scripts and styles."""

    def __init__(self, page):
        super().__init__()
        self.tags, self.text, self._inside = [], '', []
        self.feed(page)

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        if tag in ('script', 'style'):
            self._inside.append(tag)

    def handle_endtag(self, tag):
        if self._inside and tag == self._inside[-1]:
            self._inside.pop()

    def handle_data(self, data):
        if not self._inside:
            self.text += data


def read_page(file):
    """Text of a page, and the data in it with its curves unpacked."""
    page = file.read_text(encoding='utf-8')
    text = re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.S)
    data = json.loads(text[1], parse_constant=lambda name: pytest.fail(f'{name} is no JSON'))
    for run in data['runs']:
        packed = run['packed']
        raw = np.frombuffer(zlib.decompress(base64.b64decode(packed['data'])), np.uint8)
        numbers = np.ascontiguousarray(raw.reshape(4, -1).T).view('<f4').ravel()
        ends = np.cumsum(list(packed['lengths'].values()))
        assert ends[-1] == len(numbers)
        run['arrays'] = dict(zip(packed['lengths'], np.split(numbers, ends[:-1]), strict=True))
    return Text(page), data


def fly(tmp_path, change=None, stop=False, name='flight', of='current_8deg', **fields):
    """Fly in this process; ``change`` alters each block of the log, ``stop`` is a Ctrl-C."""
    scenario = load_scenario(of, {**SHORT, **fields})
    folder = make_run_folder(scenario, tmp_path / name)
    tracer, scorer = make_tracer(scenario), Scorer(scenario)
    for log in fly_blocks(*mission_of(scenario)):
        log = log if change is None else change(log.copy())
        tracer.add(log)
        scorer.add(log)
    flight = Outcome('aborted' if stop else 'completed', 'stopped' if stop else '', 1.0, 0, 0)
    scores = scorer.result(scenario.score_rules(scorer.ticks * 0.1))
    card = scorecard(scenario, 'direct', flight, scores)
    write_score(folder, card)
    keep_traces(scenario, folder, card, tracer)
    return folder


def report_of(folder):
    file = folder / 'report.html'
    write_whole(file, report_page(read_run(folder)))
    return read_page(file)


@pytest.fixture
def call(monkeypatch, capsys):
    """Call the command line in this process: exit code, output, messages."""

    def run(*arguments):
        monkeypatch.setattr(sys, 'argv', ['glider', *map(str, arguments)])
        try:
            code = cli.main()
        except SystemExit as end:
            code = end.code
        printed = capsys.readouterr()
        return code, printed.out, printed.err

    return run


@pytest.fixture(scope='module')
def flown(tmp_path_factory):
    """Folder of a run with bag and report, as the command leaves it."""
    folder = tmp_path_factory.mktemp('report') / 'flight'
    fields = ('--set', 'settle_s=0', '--duration', 300)
    done = glider('run', 'rough_water', '--engine', 'direct', '--bag', *fields, '--out', folder)
    assert done.returncode == 0, done.stderr
    return folder


# ---------------------------------------------------------------------------------- one run


@pytest.mark.parametrize('name', scenario_names())
def test_every_scenario_has_a_report_of_what_its_vehicle_can_move(tmp_path, name):
    page, _ = report_of(fly(tmp_path, of=name, duration_s=30.0))
    is_slocum = name.startswith('slocum')
    assert 'Net buoyancy, + sinks' in page.text and '+ forward: nose down' in page.text
    assert ('Angle, + turns the nose to starboard' in page.text) == is_slocum
    assert ('Rotation, + to starboard' in page.text) != is_slocum


def test_report_holds_the_run_and_needs_nothing_else(flown):
    """Every panel has its curves, and no tag of the page asks for another file."""
    text, data = read_page(flown / 'report.html')
    card = json.loads((flown / 'score.json').read_text())
    (run,) = data['runs']
    assert np.max(np.abs(run['arrays']['cross_track_m'])) == np.float32(
        card['cross_track_m']['max_all']
    )
    assert np.max(run['arrays']['depth_m']) == np.float32(card['depth_m']['max'])
    for panel in data['panels']:
        for curve in panel['curves']:
            assert np.all(np.isfinite(run['arrays'][curve['name']])), curve['name']
    for tag, attributes in text.tags:
        assert tag not in ('iframe', 'img', 'object'), tag
        for name in ('src', 'href'):
            assert attributes.get(name, 'data:,') == 'data:,', (tag, attributes)


def test_report_from_the_bag_is_that_of_the_flight(flown, tmp_path, call):
    """Two feeds, one page: the same bytes, with what was kept of the run gone."""
    folder = tmp_path / 'flight'
    shutil.copytree(flown, folder)
    first = (folder / 'report.html').read_bytes()
    (folder / 'report.html').unlink()
    (folder / 'traces.npz').unlink()
    code, out, _ = call('report', folder)
    assert code == 0
    assert str(folder / 'report.html') in out.replace('\n', '')
    assert (folder / 'report.html').read_bytes() == first


def recorded_only(flown, tmp_path):
    """What a launch leaves of the same run, and its MCAP file alone."""
    launched, alone = tmp_path / 'launched', tmp_path / 'alone'
    shutil.copytree(flown, launched)
    for name in ('report.html', 'score.json', 'traces.npz'):
        (launched / name).unlink()
    alone.mkdir()
    (file,) = launched.glob('*.mcap')
    return launched, Path(shutil.copy(file, alone))


def test_report_of_a_launched_run_and_of_its_bag_alone(flown, tmp_path, call):
    """Neither score nor traces were kept: both come from the bag, and are what they were."""
    (before,) = read_page(flown / 'report.html')[1]['runs']
    for run in recorded_only(flown, tmp_path):
        code, _, err = call('report', run)
        assert code == 0, err
        text, data = read_page((run if run.is_dir() else run.parent) / 'report.html')
        (after,) = data['runs']
        assert after['packed'] == before['packed']
        assert 'Completed' in text.text
        assert 'not known' in text.text


def test_report_without_a_bag_is_made_of_what_was_kept(tmp_path, call):
    folder = fly(tmp_path)
    code, out, _ = call('report', folder, '--out', tmp_path / 'page.html', '--json')
    assert (code, json.loads(out)['file']) == (0, str(tmp_path / 'page.html'))
    _, data = read_page(tmp_path / 'page.html')
    assert data['duration'] == 300.0


def test_open_hands_the_page_to_the_browser(flown, tmp_path):
    opened, browser = tmp_path / 'opened', tmp_path / 'browser'
    browser.write_text(f'#!/bin/sh\necho "$1" > {opened}\n')
    browser.chmod(0o755)
    page = tmp_path / 'a page.html'
    done = glider('report', flown, '--out', page, '--open', BROWSER=f'{browser} %s')
    assert done.returncode == 0, done.stderr
    assert opened.read_text().strip() == page.as_uri()


def test_run_without_report_leaves_none_and_says_what_is_missing(tmp_path, call):
    folder = tmp_path / 'flight'
    assert (
        call('run', '--engine', 'direct', '--duration', 5, '--no-report', '--out', folder)[0] == 0
    )
    assert {path.name for path in folder.iterdir()} == {
        'score.json',
        'scenario.yaml',
        'vehicle.yaml',
    }
    code, out, err = call('report', folder)
    assert (code, out) == (2, '')
    for word in ('flight', 'traces.npz', 'bag', '--no-report'):
        assert word in err


def test_run_folder_and_report_are_told_together(tmp_path, call):
    for name, options in (('plain', ()), ('json', ('--json',)), ('none', ('--no-report',))):
        folder = tmp_path / name
        flight = ('--engine', 'direct', '--duration', 5, '--out', folder)
        code, out, err = call('run', *flight, *options)
        assert code == 0
        told = [f'run folder: {folder}', f'report: {folder / "report.html"}']
        lines = (err if name == 'json' else out).splitlines()
        assert lines[-2 if name != 'none' else -1 :] == told[: 2 if name != 'none' else 1]


def test_script_in_a_description_is_only_text(tmp_path):
    evil = '</script><script>alert(1)</script><img src=x onerror=alert(2)> & "quotes"'
    text, _ = report_of(fly(tmp_path, description=evil))
    assert evil in text.text
    assert 'img' not in [tag for tag, _ in text.tags]
    scripts = [attributes for tag, attributes in text.tags if tag == 'script']
    assert len(scripts) == 3


@pytest.mark.parametrize('seconds', [0.1, 0.2, 0.3])
def test_run_of_a_few_ticks_has_a_report(tmp_path, seconds):
    text, data = report_of(fly(tmp_path, duration_s=seconds))
    assert data['duration'] == seconds
    assert f'{seconds:g} s' in text.text
    assert f'limit of 1 kg for {seconds:g} s (100 % of the time)' in text.text
    assert {panel['id'] for panel in data['panels']} >= {'track', 'space', 'depth', 'pitch'}


def never_flown(folder):
    """Run that was aborted before its first tick."""
    scenario = load_scenario('current_8deg')
    folder = make_run_folder(scenario, folder)
    flight = Outcome('aborted', 'plant_node was killed by SIGKILL', 0.0, 0, 0)
    card = scorecard(scenario, 'nodes', flight, Scorer(scenario).result(Rules()))
    write_score(folder, card)
    keep_traces(scenario, folder, card, make_tracer(scenario))
    return folder


def test_run_that_ended_before_its_first_tick_has_a_report(tmp_path):
    text, data = report_of(never_flown(tmp_path / 'flight'))
    assert data['panels'] == []
    assert 'before the first tick: plant_node was killed by SIGKILL' in text.text


def test_not_a_number_in_the_data_is_a_gap_that_is_told(tmp_path):
    def spoil(log):
        log[1000:1500, E2] = np.nan
        log[100, COLUMNS['adaptation']] = np.inf
        return log

    text, data = report_of(fly(tmp_path, spoil))
    assert 'cross_track_m (500)' in text.text
    assert 'steering_dive_radps (1)' in text.text
    curve = data['runs'][0]['arrays']['cross_track_m']
    assert np.count_nonzero(np.isnan(curve)) == 500
    assert not np.any(np.isinf(data['runs'][0]['arrays']['steering_dive_radps']))


def test_topic_that_is_not_in_the_bag_has_no_panel(tmp_path):
    """A vehicle at sea tells nothing of the true current."""

    def at_sea(log):
        log[:, COLUMNS['current_velocity']] = np.nan
        return log

    text, data = report_of(fly(tmp_path, at_sea))
    curves = [curve['name'] for panel in data['panels'] for curve in panel['curves']]
    assert 'estimate_north_kn' in curves
    assert 'current_north_kn' not in curves
    assert 'current_north_kn (3,000)' in text.text


def test_pid_shows_nothing_learnt(tmp_path):
    _, data = report_of(fly(tmp_path, **{'control.law': 'pid'}))
    assert not [panel['id'] for panel in data['panels'] if panel['id'].startswith('learnt')]


def test_desired_path_is_drawn_as_far_as_it_was_followed(tmp_path):
    """A leg of 50 m that goes on straight, followed for ten minutes."""
    path = {'kind': 'straight', 'length_m': 50.0, 'course_deg': 30.0, 'at_end': 'continue'}
    _, data = report_of(fly(tmp_path, duration_s=600.0, path=path))
    (run,) = data['runs']
    way = [math.hypot(n, e) for n, e, _ in run['path']]
    track = np.hypot(run['arrays']['track_north_m'], run['arrays']['track_east_m'])
    assert track.max() > 60.0
    assert way[-1] == pytest.approx(track.max(), abs=2.0)
    for north, east, depth in (point for point in run['path'] if point[0] > 10.0):
        assert math.degrees(math.atan2(east, north)) == pytest.approx(30.0, abs=0.1)
        assert depth == 0.0


def test_desired_path_is_that_which_was_ordered(tmp_path):
    """North for five minutes, then to the east from where it is."""
    path = '{kind: straight, length_m: 5000.0, course_deg: 0.0}'
    east = '{kind: waypoints, waypoints: [[80.0, 0.0], [80.0, 5000.0]]}'
    fields = ('--set', f'path={path}', '--set', f'orders=[{{at_s: 300.0, path: {east}}}]')
    folder = tmp_path / 'ordered'
    done = glider('run', *fields, '--engine', 'direct', '--duration', 900, '--out', folder)
    assert done.returncode == 0, done.stderr
    _, data = read_page(folder / 'report.html')
    way = np.array(data['runs'][0]['path'])
    ordered = way[:, 1] > 1.0
    assert ordered.any() and not ordered.all()
    np.testing.assert_allclose(way[ordered, 0], 80.0, atol=0.1)
    np.testing.assert_allclose(way[~ordered, 1], 0.0, atol=0.1)
    np.testing.assert_allclose(way[:, 2], 0.0)


def test_battery_has_a_curve(flown):
    """Within rounding it is what the scorecard says was taken out of 100 %."""
    _, data = read_page(flown / 'report.html')
    curve = data['runs'][0]['arrays']['battery_percent']
    run = read_run(flown)
    taken = run.card['energy']['wh'] / run.vehicle.energy.capacity.value
    assert curve[0] == pytest.approx(100.0, abs=1e-3)
    assert 100.0 - curve[-1] == pytest.approx(100.0 * taken, rel=0.01)
    assert 'battery' in [panel['id'] for panel in data['panels']]


def test_battery_that_is_not_known_has_none(tmp_path):
    def unknown(log):
        log[:, COLUMNS['battery']] = -1.0
        return log

    text, data = report_of(fly(tmp_path, unknown))
    assert 'battery' not in [panel['id'] for panel in data['panels']]
    assert 'battery_percent' not in text.text


def test_each_dive_has_a_line(tmp_path):
    fields = {'duration_s': 1500.0, 'profile.depth_m': 40.0, 'profile.top_depth_m': 5.0}
    folder = fly(tmp_path, **fields)
    rows = Rows()
    for log in fly_blocks(*mission_of(load_scenario('current_8deg', {**SHORT, **fields}))):
        rows.add(log)
    log = rows.result()
    depth = -log[:, COLUMNS['ground_truth/odom'].start + 2]
    place = log[:, COLUMNS['ground_truth/odom']][:, :2]
    bottoms = np.flatnonzero((depth[1:-1] >= depth[:-2]) & (depth[1:-1] > depth[2:]))
    bottoms = bottoms[depth[bottoms] > 35.0] + 1
    found = dives_of(read_run(folder).traces)
    assert len(bottoms) > 1
    for one, bottom in zip(found, bottoms, strict=False):
        assert one.from_s < 0.1 * bottom < one.to_s
        assert one.deepest_m == pytest.approx(depth[bottom], abs=1e-3)
        first, last = (min(round(10.0 * t), len(log) - 1) for t in (one.from_s, one.to_s))
        assert one.way_m == pytest.approx(np.linalg.norm(place[last] - place[first]), abs=1.0)
    assert len(found) in (len(bottoms), len(bottoms) + 1)
    text, _ = report_of(folder)
    assert 'Each dive' in text.text
    assert f'{depth[bottoms[0]]:,.1f}' in text.text


# ---------------------------------------------------------------------------------- in words


def drift(log, speed_mps=1.0, from_s=100.0, depth_m=100.0):
    """The vehicle is carried off its path from some time on."""
    time_s = 0.1 * np.arange(len(log))
    for name in ('ground_truth/odom', 'odom'):
        log[:, COLUMNS[name].start + 2] = -depth_m
    log[:, E2] = speed_mps * np.clip(time_s - from_s, 0.0, None)
    return log


def test_lost_track_is_told_with_its_time(tmp_path):
    run = read_run(fly(tmp_path, drift))
    assert lost_since_s(run.traces) == pytest.approx(100.0 + LOST_M, abs=0.2)
    assert (
        'problem',
        'Track lost: more than 100 m off the path from 3 min to the end.',
    ) in findings(run)


@pytest.mark.parametrize(
    'flight',
    [
        lambda log: drift(log, depth_m=1.0),  # adrift on the surface
        lambda log: drift(log, speed_mps=0.4),  # never so far
        lambda log: drift(log, speed_mps=2.0)[::-1].copy(),  # comes back
    ],
)
def test_track_is_not_lost_by_less(tmp_path, flight):
    assert lost_since_s(read_run(fly(tmp_path, flight)).traces) is None


def test_trouble_comes_before_notes_and_none_is_called_none(tmp_path):
    good = findings(read_run(fly(tmp_path, name='good')))
    assert good[0][0] == 'fine'
    assert [kind for kind, _ in good[1:]] == ['note'] * (len(good) - 1)
    bad = findings(read_run(fly(tmp_path, drift, stop=True, name='bad')))
    kinds = [kind for kind, _ in bad]
    assert kinds == sorted(kinds, reverse=True)
    assert 'fine' not in kinds
    said = verdict(read_run(tmp_path / 'bad').card, 1800.0)
    assert said.startswith('Stopped after 5 min: stopped. At worst it was 200 m off its path.')
    assert kinds[0] == 'problem' and not [text for _, text in bad if text in said]


def test_all_that_the_guard_told_is_on_the_page(tmp_path):
    latching = [row for row in ROWS if row.latches][:7]
    rows = [{'row': row.name, 'reaction': 'surface', 'message': row.says} for row in latching]
    events = [{'t_s': 10.0 * i, **row} for i, row in enumerate(rows)]
    guard = {'state': 'latched', 'reaction': 'surface', 'events': events}
    text, data = report_of(altered(fly(tmp_path), 'ended', guard=guard))
    assert not [row.says for row in latching if row.says not in text.text]
    for panel in data['panels']:
        drawn = {steps['label'] for steps in panel['steps']} & {row.says for row in latching}
        assert len(drawn) in (0, len(latching)), panel['caption']


def test_a_gust_that_was_too_strong_is_not_contradicted(tmp_path):
    def gust(log):
        log[600:700, COLUMNS['infeasible']] = 1.0
        return log

    (_, fine), (_, note), *_ = findings(read_run(fly(tmp_path, gust)))
    assert 'could not be held against the estimated current for 10 s' in note
    assert fine == 'Nothing went wrong: the run is complete.'


@pytest.mark.parametrize(
    ('settle_s', 'ended'), [(0.0, 'at its first tick'), (600.0, 'the settling time of 10 min')]
)
def test_verdict_of_a_flight_too_short_for_a_score(tmp_path, settle_s, ended):
    folder = fly(tmp_path, duration_s=0.1, settle_s=settle_s)
    assert f'{ended}, so errors have no score.' in verdict(read_run(folder).card, settle_s)


def test_a_vehicle_that_went_far_deeper_than_it_was_to_has_gone_wrong(tmp_path):
    deep = altered(fly(tmp_path), 'deep', depth_m__overshoot=584.0)
    assert ('problem', 'It went 584 m deeper than it was to.') in findings(read_run(deep))


def test_verdict_of_a_flight_into_a_current_that_is_too_strong(tmp_path):
    fields = {'duration_s': 4000.0, 'current.speed_kn': 1.5, 'current.angle_deg': 90.0}
    folder = fly(tmp_path, settle_s=1000.0, **fields)
    run = read_run(folder)
    assert run.card['status'] == 'infeasible'
    assert 'too strong' in verdict(run.card, 1000.0)
    assert any('could not be held' in text for kind, text in findings(run) if kind == 'problem')


@pytest.mark.parametrize(
    ('seconds', 'text'),
    [(0.1, '0.1 s'), (119.9, '119.9 s'), (120.0, '2 min'), (7199.0, '2 h'), (7721.0, '2 h 9 min')],
)
def test_times_are_said_as_people_say_them(seconds, text):
    assert span(seconds) == text


# ---------------------------------------------------------------------------------- mistakes


def test_report_that_cannot_be_written_loses_no_run(tmp_path):
    folder = tmp_path / 'flight'
    full = partial(resource.setrlimit, resource.RLIMIT_FSIZE, (100_000, 100_000))
    done = glider(
        *('run', '--engine', 'direct', '--duration', 900, '--json', '--out', folder),
        preexec_fn=full,
    )
    assert done.returncode == 1, done.stderr
    assert 'Traceback' not in done.stderr
    assert 'no report' in done.stderr
    assert 'traces.npz: cannot be written: File too large' in done.stderr
    assert json.loads((folder / 'score.json').read_text()) == json.loads(done.stdout)
    assert {path.name for path in folder.iterdir()} == {
        'score.json',
        'scenario.yaml',
        'vehicle.yaml',
    }


def test_mistakes_end_with_one_message_and_exit_code_2(tmp_path, call):
    folder, other = fly(tmp_path), fly(tmp_path, name='other')
    broken = fly(tmp_path, name='broken')
    (broken / 'traces.npz').write_bytes(b'PK\x03\x04 and no more')
    half = fly(tmp_path, name='half')
    (half / 'score.json').write_text('{"scenario": "x", "status": "completed"}')
    before = (folder / 'score.json').read_bytes()
    mistakes = (
        (('report', tmp_path), ['not a run folder', 'score.json']),
        (('report', tmp_path / 'nowhere'), ['nowhere', 'no such run folder']),
        (('report', broken), ['traces.npz', 'damaged']),
        (('report', half), ['score.json', 'not a scorecard']),
        (('report', folder, '--out', tmp_path), [str(tmp_path), 'cannot be written']),
        (('report', folder, '--out', '/sys/report.html'), ['/sys/report.html', 'cannot be']),
        (('report', folder, '--out', tmp_path / 'no' / 'x.html'), ['x.html', 'cannot be written']),
        (('compare', folder), ['two or more']),
        (('compare', folder, other, folder), ['given twice']),
        (('compare', folder, tmp_path), ['not a run folder']),
        (('compare', folder, other, '--out', tmp_path), ['cannot be written']),
        (('figure', folder, '--out', tmp_path / 'x.doc'), ['x.doc', 'cannot be written']),
    )
    for arguments, words in mistakes:
        code, out, err = call(*arguments)
        assert (code, out) == (2, ''), arguments
        for word in words:
            assert word in err.replace('\n', ''), arguments
    assert (folder / 'score.json').read_bytes() == before
    assert not list(tmp_path.rglob('*.part'))


ARRIVAL = {
    **{'arrived': True, 't_s': 9.0, 'missed_m': 1.0, 'left_m': 0.0, 'eta_s': 9.0},
    **{'overrun_s': 0.0, 'place_latlon_deg': None},
}
EVENT = {'t_s': 1.0, 'row': 'leak', 'reaction': 'surface', 'message': 'wet'}


@pytest.mark.parametrize(
    ('part', 'told'),
    [
        ({'arrival': {**ARRIVAL, 't_s': None}}, 'arrival: t_s: not known, though it arrived'),
        ({'arrival': {**ARRIVAL, 'arrived': False, 'left_m': 'far'}}, "arrival.left_m = 'far'"),
        ({'guard': {'events': [{**EVENT, 'row': []}]}}, 'guard.events.0.row = []'),
        ({'guard': {'events': [{**EVENT, 'reaction': {}}]}}, 'guard.events.0.reaction: should'),
    ],
)
def test_damaged_arrival_or_event_is_named(tmp_path, call, part, told):
    one = fly(tmp_path)
    two = altered(one, 'damaged', **part)
    for use in (('score', two), ('report', two), ('compare', one, two)):
        code, out, err = call(*use)
        assert (code, out) == (2, '')
        assert f'score.json: not a scorecard of this program: {told}' in ' '.join(err.split())


def test_figure_needs_no_bag(tmp_path, call):
    folder = fly(tmp_path)
    for suffix, magic in (('png', b'\x89PNG'), ('pdf', b'%PDF'), ('svg', b'<?xml')):
        code, _, err = call('figure', folder, '--out', tmp_path / f'run.{suffix}')
        assert code == 0, err
        assert (tmp_path / f'run.{suffix}').read_bytes().startswith(magic)


@pytest.mark.parametrize(
    ('scenario', 'moved'),
    [('slocum_shelf', ['pitch mass', 'fin']), ('current_8deg', ['pitch mass', 'roll mass'])],
)
def test_figure_shows_the_actuators_of_the_vehicle(tmp_path, call, scenario, moved):
    """That of a vehicle steered by its fin had a roll mass at rest, and no fin."""
    folder = fly(tmp_path, of=scenario)
    assert call('figure', folder, '--out', tmp_path / 'run.svg')[0] == 0
    drawn = re.findall(r'<!-- (.*) / 100 (?:mm|deg) -->', (tmp_path / 'run.svg').read_text())
    assert drawn == moved


@pytest.mark.filterwarnings('error')
def test_figure_of_a_long_title_and_of_still_water(tmp_path, monkeypatch):
    """All of the title is on the paper, no legend over a curve, no current that is not there."""
    drawn = []
    keep = 'glider_bringup.showing.figure.save_figure'
    monkeypatch.setattr(keep, lambda figure, *_, **__: drawn.append(figure))
    draw_run(read_run(fly(tmp_path, of='helix', description='far ' * 60)), tmp_path / 'run.png')
    (figure,) = drawn
    FigureCanvasAgg(figure).draw()
    across = figure._suptitle.get_window_extent()
    assert 0.0 <= across.x0 < across.x1 <= figure.bbox.x1
    labels = figure.axes[0].get_legend_handles_labels()[1]
    assert labels == ['desired path', 'track', 'start']
    for axis in filter(lambda axis: axis.get_legend(), figure.axes):
        assert axis.get_legend().get_window_extent().y0 >= axis.bbox.y1 - 1.0


# ---------------------------------------------------------------------------------- several


def test_comparison_tells_scores_and_differences(tmp_path, call):
    one = fly(tmp_path, name='one')
    two = fly(tmp_path, name='two', duration_s=200.0, **{'control.law': 'pid'})
    code, out, _ = call('compare', one, two, '--json', '--out', tmp_path / 'both.html')
    assert code == 0
    told = json.loads(out)
    assert [run['run'] for run in told['runs']] == ['one', 'two']
    for run, folder in zip(told['runs'], (one, two), strict=True):
        assert run['score'] == json.loads((folder / 'score.json').read_text())
    assert {row['field']: row['values'] for row in told['differences']} == {
        'duration_s': [300.0, 200.0],
        'control.law': ['adaptive', 'pid'],
    }
    text, data = read_page(tmp_path / 'both.html')
    assert data['duration'] == 300.0
    assert 'control.law' in text.text
    for panel in data['panels']:
        if panel['kind'] == 'time':
            assert [curve['run'] for curve in panel['curves']] == [0, 1], panel['id']
    lengths = [len(run['arrays']['depth_m']) * run['spacing'] for run in data['runs']]
    assert lengths == pytest.approx([300.0, 200.0])


def test_comparison_takes_what_is_only_recorded(flown, tmp_path, call):
    """One run in three forms has one score, but for what no bag knows."""
    runs = [flown, *recorded_only(flown, tmp_path)]
    for options in ((), ('--out', tmp_path / 'all.html')):
        code, out, err = call('compare', *runs, '--json', *options)
        assert code == 0, err
        told = json.loads(out)
        assert told['differences'] == []
        first, *others = (run['score'] for run in told['runs'])
        for score in others:
            changed = {name for name in first if score[name] != first[name]}
            assert changed == {'engine', 'wall_time_s', 'real_time_factor'}
    _, data = read_page(tmp_path / 'all.html')
    first, *others = (run['packed'] for run in data['runs'])
    assert others == [first, first]


def test_comparison_names_what_only_one_scenario_has(tmp_path, call):
    one = fly(tmp_path, name='one')
    path = {'kind': 'waypoints', 'waypoints': [[0, 0], [500, 0]]}
    two = fly(tmp_path, name='two', path=path, vehicle='zhang2021_table1')
    page = tmp_path / 'both.html'
    rows = json.loads(call('compare', one, two, '--json', '--out', page)[1])['differences']
    shown = read_page(page)[0].text
    found = {row['field']: row['values'] for row in rows}
    by_end = {name.rpartition('.')[2]: name for name in found}
    assert by_end['value'] in shown
    assert by_end['source'] not in shown, 'nor a hundred other sentences'
    assert found['path.kind'] == ['straight', 'waypoints']
    assert found['path.length_m'] == [25000.0, None]
    assert found['vehicle.name'] == ['zhang2021', 'zhang2021_table1']


def test_comparison_of_runs_with_one_name_shows_where_they_are(tmp_path, call):
    folders = [fly(tmp_path / name, name='same') for name in ('a', 'b')]
    told = json.loads(call('compare', *folders, '--json')[1])
    assert [run['run'] for run in told['runs']] == list(map(str, folders))
    assert told['differences'] == []


def test_comparison_for_a_person_lists_each_run(tmp_path, call):
    one, two = fly(tmp_path, name='one'), fly(tmp_path, name='two', stop=True)
    code, out, _ = call('compare', one, two)
    assert code == 0
    for word in ('one', 'two', 'completed', 'aborted', 'cross-track', 'the same'):
        assert word in out


def altered(folder, name, **figures):
    """Copy of a run beside it, with other figures in its score."""
    other = folder.parent / name
    shutil.copytree(folder, other)
    card = json.loads((other / 'score.json').read_text())
    for key, value in figures.items():
        group, _, figure = key.partition('__')
        if figure:
            card[group][figure] = value
        else:
            card[group] = value
    (other / 'score.json').write_text(json.dumps(card))
    return other


def compared(call, *folders):
    """Cells of each line of a comparison for a person."""
    code, out, err = call('compare', *folders)
    assert code == 0, err
    lines = [line.split('│') for line in out.splitlines() if line.startswith('│')]
    return {name.strip(): [cell.strip() for cell in cells] for _, name, *cells, _ in lines}, out


@pytest.fixture
def wide(monkeypatch):
    """Terminal on which no line of a comparison is broken."""
    monkeypatch.setattr(console.output, 'width', 300)


def test_comparison_shows_differences_and_marks_the_better(tmp_path, call, wide):
    figures = {'cross_track_m__max_all': 4.0, 'depth_m__max': 40.0, 'dives': 2}
    one = altered(fly(tmp_path), 'one', sim_time_s=7721.0, **figures)
    two = altered(one, 'two', sim_time_s=7901.5, cross_track_m__max_all=3.5, depth_m__max=41.0)
    stopped = altered(one, 'stopped', status='aborted', cross_track_m__max_all=0.5)
    rows, _ = compared(call, one, two, stopped)
    assert rows['simulated time'] == ['2 h 9 min', '2 h 12 min (+3 min)', '2 h 9 min (=)']
    assert rows['cross-track, after settling, max'] == [
        *('4.00 m', '3.50 m (-0.50) *', '0.50 m (-3.50)'),  # no merit of a run that was stopped
    ]
    assert rows['depth, max'] == ['40.0 m', '41.0 m (+1.0)', '40.0 m (=)']  # neither is better
    assert rows['dives'] == ['2', '2 (=)', '2 (=)']
    page = tmp_path / 'page.html'
    assert call('compare', one, two, '--out', page)[0] == 0
    text = ' '.join(read_page(page)[0].text.split())
    assert 'after settling, max 4.00 m 3.50 m (-0.50) ✓' in text


def test_comparison_of_a_long_and_a_short_run_marks_nothing(tmp_path, call, wide):
    one = altered(fly(tmp_path), 'one', sim_time_s=1000.0, cross_track_m__max_all=4.0)
    two = altered(one, 'two', sim_time_s=1101.0, cross_track_m__max_all=3.0)
    rows, out = compared(call, one, two)
    assert rows['cross-track, after settling, max'] == ['4.00 m', '3.00 m (-1.00)']
    assert 'The runs last from 17 min to 18 min' in out
    _, out = compared(call, one, altered(one, 'like', sim_time_s=1000.2))
    assert 'The runs last from' not in out, 'nobody is told of 17 min to 17 min'


def test_comparison_names_a_run_that_has_no_steady_score(tmp_path, call):
    one = fly(tmp_path, name='one')
    steady = {'cross_track_m__max_steady': 3.0, 'cross_track_m__rms_steady': 2.0}
    two = altered(one, 'two', **steady)
    assert call('compare', one, two, '--out', tmp_path / 'page.html')[0] == 0
    assert 'in steady glide: two 3.00 m, one none.' in read_page(tmp_path / 'page.html')[0].text


def test_comparison_of_equal_runs_says_so(tmp_path, call, wide):
    one = fly(tmp_path, name='one')
    again = altered(one, 'again', wall_time_s=9.0, engine='nodes')
    rows, out = compared(call, one, again)
    assert 'The runs are equal' in out
    assert rows['cross-track, whole run, max'][1].endswith('(=)')
    assert not any(cell.endswith('*') for cells in rows.values() for cell in cells)
    page = tmp_path / 'page.html'
    assert call('compare', one, again, '--out', page)[0] == 0
    assert 'The runs are equal' in read_page(page)[0].text
    _, out = compared(call, one, altered(one, 'other', cross_track_m__max_run=0.123))
    assert 'The runs are equal' not in out


def test_comparison_keeps_its_lines_where_one_run_has_more_to_tell(tmp_path, call, wide):
    """What the guard told in one of them shifts nothing."""
    one = fly(tmp_path, name='one')
    event = {'t_s': 12.0, 'row': 'x', 'reaction': 'none', 'message': 'something odd'}
    guard = {'state': 'flying', 'reaction': 'none', 'events': [event]}
    two = altered(one, 'two', guard=guard, end_of_path_m=7.25)
    for runs, order in (((one, two), 1), ((two, one), -1)):
        rows, _ = compared(call, *runs)
        assert rows['guard'][::order] == ['nothing', 'at 12.0 s: something odd']
        assert rows['came up from the end of path'][::order][0] == '-'
        assert rows['depth, max'][1] == f'{rows["depth, max"][0]} (=)'


def test_comparison_with_a_run_that_never_flew(tmp_path, call):
    folders = fly(tmp_path, name='flown'), never_flown(tmp_path / 'never')
    assert call('compare', *folders, '--out', tmp_path / 'both.html')[0] == 0
    text, data = read_page(tmp_path / 'both.html')
    assert 'Aborted before its end: 1 of 2 runs' in text.text
    timed = [panel for panel in data['panels'] if panel['kind'] == 'time']
    assert timed
    assert all([curve['run'] for curve in panel['curves']] == [0] for panel in timed)
