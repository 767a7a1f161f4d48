# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The search for what random faults do: its oracles, its shrinking, and a small share of it."""

import json
import shlex

import numpy as np
import pytest
from typer.testing import CliRunner

from glider_base.signals import TICK_S
from glider_bringup.engines.flight import fly
from glider_guard.rows import LATCHED, ORDERED, TOO_HEAVY
from glider_mission.blocks import COLUMNS, ROW
from glider_mission.changes import parse_assignment
from glider_mission.scenario import load_scenario
from glider_studies.commands.experiments import app
from glider_studies.hunt import oracle, search
from glider_studies.hunt.missions import draw_mission, due_s
from glider_studies.hunt.oracle import Truth, Verdict, _shown_s, judge, unfounded
from glider_studies.paper.experiments import RESULT_FILE

#: zhang2021 is rated for 1000 m, its hull bears 1250 m.
SCENARIO = ('current_8deg', {'dives': 0, 'duration_s': 20000.0})
PUMP_STUCK = {'kind': 'stuck', 'actuator': 'buoyancy_engine', 'at_s': 2500.0}


def flight(depth_at, told_s: float = np.inf) -> Truth:
    """Truth of a flight by its depth (m) over time (s), and when the guard told to surface."""
    time_s = np.arange(0.0, depth_at[-1][0], TICK_S)
    log = np.zeros((len(time_s), ROW))
    log[:, COLUMNS['ground_truth/odom'].start + 2] = -np.interp(
        time_s, *zip(*depth_at, strict=True)
    )
    log[time_s >= told_s, COLUMNS['guard']] = ORDERED
    truth = Truth()
    truth.add(log)
    return truth


def kind_of(truth: Truth, faults=(), status='completed', **others) -> str:
    name, changes = SCENARIO
    loaded = load_scenario(name, {**changes, 'faults': list(faults), **others})
    begun = [fault['at_s'] for fault in faults]
    return judge(loaded, truth, status, '', begun).kind


#: One whose hull bears 250 m: what could be done for it takes less time.
G2 = {'vehicle': 'slocum_g2', 'profile.depth_m': 200.0, 'profile.net_heaviness_kg': 0.2}
SINKS = [(0.0, 0.0), (2500.0, 140.0), (5000.0, 280.0), (10000.0, 280.0)]


def test_who_sinks_beyond_the_hull_with_a_weight_on_board_is_lost():
    assert kind_of(flight(SINKS, told_s=3000.0), [PUMP_STUCK], **G2) == 'lost'


def test_a_fault_shows_where_it_first_changes_the_flight():
    cut = {'kind': 'partial', 'actuator': 'buoyancy_engine', 'low': -0.05, 'high': 0.5}
    cut['at_s'] = 600.0  # a pump that cannot drive the climb is not asked to before 3900 s
    leak = {'kind': 'leak', 'rate_kgps': 1e-6, 'at_s': 1000.0}
    name, changes = SCENARIO
    for faults in ([cut], [cut, cut], [cut, leak], [leak, cut]):
        loaded = load_scenario(name, {**changes, 'faults': faults})
        shown_s = zip(faults, _shown_s(loaded, 4500.0), strict=True)
        shown_s = {fault['kind']: one for fault, one in shown_s if one < np.inf}
        assert 3900.0 < shown_s['partial'] < 4000.0
        assert 1000.0 <= shown_s.get('leak', 1000.0) < 1001.0
        assert _shown_s(loaded, 600.0) == [np.inf] * len(faults)


def test_who_has_no_means_left_is_not_lost_but_has_to_be_told():
    flood = {'kind': 'leak', 'rate_kgps': 1.0, 'limit_kg': 50.0, 'at_s': 2500.0}
    assert kind_of(flight(SINKS), [flood], **G2) == 'untold'
    assert kind_of(flight(SINKS, told_s=3000.0), [flood], 'lost', **G2) == ''
    assert kind_of(flight(SINKS, told_s=3000.0), [flood], 'surfaced', **G2) == 'untold'


def test_who_fills_up_at_the_surface_with_all_done_is_not_lost():
    """Flight 224 of seed 5786: early on all that can be done brings it up, and later it fills."""
    fills = [(0.0, 0.0), (400.0, 20.0), (3600.0, 0.0), (8000.0, 0.0), (9000.0, 400.0)]
    depth = flight(fills, told_s=3400.0)
    leak = {'kind': 'leak', 'rate_kgps': 1e-4, 'at_s': 400.0, 'detected': False}
    shallow = {**G2, 'profile.depth_m': 20.0}
    assert kind_of(depth, [{**leak, 'limit_kg': 2.0}], 'lost', **shallow) == ''
    assert kind_of(depth, [{**leak, 'limit_kg': 0.1}], 'lost', **shallow) == 'lost'


def test_who_is_struck_too_fast_is_not_lost_for_a_fault_that_harms_nobody():
    """Flight 196 of seed 91670: growth, and an hour later a leak that sinks it within 300 s."""
    mission = draw_mission(91670, 196)
    assert {fault['kind'] for fault in mission.faults} == {'leak', 'fouling'}
    assert search._verdict(mission.load()).kind == ''


@pytest.mark.parametrize(('alone', 'verdict'), [('sinks', 'lost'), ('comes up', '')])
def test_who_is_struck_too_fast_is_lost_if_the_faults_before_would_have_lost_it(
    monkeypatch, alone, verdict
):
    """By what becomes of the flight without the last one, whatever the guard told of both."""
    up = [(0.0, 0.0), (2500.0, 140.0), (6000.0, 0.0), (10000.0, 0.0)]
    without = []

    def fly_made_up(scenario, sinks):
        without.extend(scenario.faults)
        made_up = flight(SINKS if alone == 'sinks' else up)
        vars(sinks[0]).update(vars(made_up))

    monkeypatch.setattr(oracle, 'fly', fly_made_up)
    flood = {'kind': 'leak', 'rate_kgps': 1.0, 'limit_kg': 50.0, 'at_s': 4300.0}
    told = flight(SINKS, told_s=3000.0)
    assert kind_of(told, [PUMP_STUCK, flood], 'lost', **G2) == verdict
    assert [fault.kind for fault in without] == ['stuck']


def test_a_reaction_is_right_where_the_pump_does_not_bring_the_vehicle_up():
    """Without a fault: one that its ballast and its hull make heavier than its pump, or nearly."""
    for seed, number, share, rows in ((91670, 273, 0.98, 0), (84464, 101, 0.95, TOO_HEAVY)):
        mission = draw_mission(seed, number)
        fields = {**mission.changes, 'guard.weight_share': share, 'faults': mission.aging}
        clean = load_scenario(mission.scenario, fields)
        truth = Truth()
        fly(clean, [truth])
        assert (truth.rows & TOO_HEAVY).any()
        assert unfounded(clean, truth, LATCHED) & TOO_HEAVY == rows


def test_who_stays_down_after_it_was_sent_up_is_late():
    hangs = [(0.0, 0.0), (1000.0, 300.0), (20000.0, 300.0)]
    assert kind_of(flight(hangs, told_s=1500.0)) == 'late'
    up = [(0.0, 0.0), (1500.0, 300.0), (1500.0 + due_s(300.0) - 60.0, 0.0), (20000.0, 0.0)]
    assert kind_of(flight(up, told_s=1500.0), status='surfaced') == ''
    assert kind_of(flight(up, told_s=1500.0), status='completed') == 'untold'
    sinks_again = [*up[:3], (19000.0, 0.0), (20000.0, 50.0)]
    assert kind_of(flight(sinks_again, told_s=1500.0)) == 'late'
    for under_s, verdict in ((300.0, ''), (900.0, 'late')):  # 4 m deep: for how long?
        dips = [(18000.0, 0.0), (18010.0, 4.0), (18000.0 + under_s, 4.0)]
        dips += [(18010.0 + under_s, 0.0), (20000.0, 0.0)]
        dips = flight([*up[:3], *dips], told_s=1500.0)
        assert kind_of(dips, status='surfaced') == verdict
    struck = [{**PUMP_STUCK, 'at_s': 19000.0}]
    assert kind_of(flight(sinks_again, told_s=1500.0), struck, 'surfaced') == ''
    hangs_again = [*up[:3], (11000.0, 0.0), (12000.0, 50.0), (20000.0, 50.0)]
    struck = [{**PUMP_STUCK, 'at_s': 11000.0}]
    assert kind_of(flight(hangs_again, told_s=1500.0), struck, 'surfaced') == 'late'
    # a fault that takes 70 min to sink it: its time begins there
    for back_s, verdict in ((16500.0, ''), (20000.0, 'late')):
        later = [*up[:3], (15000.0, 0.0), (15500.0, 50.0), (back_s - 1.0, 50.0), (back_s, 0.0)]
        slowly = flight([*later, (20000.0, 0.0)][: 6 if verdict else None], told_s=1500.0)
        assert kind_of(slowly, struck, 'surfaced') == verdict
        assert kind_of(slowly, [], 'surfaced') == 'late'


def test_who_would_have_sunk_again_whatever_was_done_is_not_late():
    flood = {'kind': 'leak', 'rate_kgps': 0.001, 'limit_kg': 50.0, 'at_s': 1500.0}
    up = [(0.0, 0.0), (1500.0, 300.0), (3000.0, 0.0), (12000.0, 0.0), (20000.0, 900.0)]
    assert kind_of(flight(up, told_s=1500.0), [flood], 'surfaced') == ''
    assert kind_of(flight(up, told_s=1500.0), [], 'surfaced') == 'late'


def test_who_hangs_or_goes_too_deep_untold_is_found():
    assert kind_of(flight([(0.0, 0.0), (1000.0, 300.0), (20000.0, 300.0)])) == 'untold'
    deep = [(0.0, 0.0), (5000.0, 1100.0), (10000.0, 0.0), (20000.0, 500.0)]
    assert kind_of(flight(deep)) == 'untold'
    yo = [(2000.0 * i, 900.0 * (i % 2)) for i in range(11)]
    assert kind_of(flight(yo)) == ''
    assert kind_of(flight(yo), status='failed') == 'not_finite'


def test_harm_is_shrunk_to_the_fault_that_does_it(monkeypatch):
    mission = next(
        one for one in (draw_mission(3, number) for number in range(50)) if len(one.faults) == 3
    )

    def verdict(scenario):
        harms = any(fault.kind == mission.faults[1]['kind'] for fault in scenario.faults)
        return Verdict('lost' if harms else '', 'by the second')

    monkeypatch.setattr(search, '_verdict', verdict)
    found, faults = search._shrunk(mission, Verdict('lost', ''))
    assert (found.kind, faults) == ('lost', [mission.faults[1]])
    words = shlex.split(search.command(mission, faults))
    fields = dict(
        parse_assignment(value)
        for option, value in zip(words, words[1:], strict=False)
        if option == '--set'
    )
    assert load_scenario(words[2], fields) == mission.load(faults)


def test_missions_follow_from_seed_and_number_and_half_of_them_are_awkward():
    missions = [draw_mission(11, number) for number in range(60)]
    assert missions[7] == draw_mission(11, 7) != draw_mission(12, 7)
    assert {one.load().vehicle for one in missions} >= {'zhang2021', 'seaglider', 'slocum_g2'}
    assert {one.load().navigation.method for one in missions} == {'known', 'dead_reckoned'}
    assert len({one.scenario for one in missions}) >= 10
    assert all(2 <= len(one.faults) <= 3 for one in missions)


def test_a_small_share_of_the_search_finds_nothing(tmp_path):
    words = ['--only', 'random_faults', '--flights', '12', '--seed', '3', '--json']
    done = CliRunner().invoke(app, [*words, '--out', str(tmp_path / 'found')])
    counts = json.loads(done.stdout)
    assert json.loads((tmp_path / 'found' / RESULT_FILE).read_text('utf-8')) == counts
    names = ('flights', 'lost', 'untold', 'late', 'not_finite', 'false_reactions')
    assert [counts[name] for name in names] == [12, 0, 0, 0, 0, 0], counts['experiments']
    assert counts['hours'] > 25.0
    assert done.exit_code == 0
