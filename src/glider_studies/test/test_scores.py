# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A score is said once, and is everywhere."""

import json

import numpy as np
import pytest

from glider_bringup.scoring.card import fly_scored, scorecard, write_score
from glider_bringup.scoring.scores import SCORES, Score
from glider_bringup.showing.compare import score_rows
from glider_bringup.showing.scorecard import card_rows
from glider_mission.scenario import load_scenario
from glider_studies.montecarlo import judge, report

SHALLOWEST = Score(
    *('depth, shallowest after settling', 'depth_m.shallowest', 'm', 2),
    less_is_better=True,
    of=lambda flown: float(np.min(flown.depth[flown.scored])),
    study=(9, 'shallowest_m', 'shallowest (m)'),
)


@pytest.fixture
def stranger():
    """Line of a stranger in the registry."""
    SCORES.append(SHALLOWEST)
    yield
    SCORES.remove(SHALLOWEST)


def test_a_score_added_in_one_place_is_in_card_comparison_and_study(stranger, tmp_path):
    scenario = load_scenario('current_8deg', {'dives': 0, 'duration_s': 100.0, 'settle_s': 50.0})
    flight, scores = fly_scored(scenario)
    card = scorecard(scenario, 'direct', flight, scores)
    write_score(tmp_path, card)
    value = json.loads((tmp_path / 'score.json').read_text())['depth_m']['shallowest']
    assert 0.0 < value < card['depth_m']['max']
    lines = dict(card_rows(card))
    assert lines['depth'] == f'shallowest after settling {value:,.2f} m'
    rows = dict(score_rows([card, {**card, 'depth_m': {'max': 1.0, 'shallowest': value - 0.5}}]))
    first, second = rows['depth, shallowest after settling']
    assert (first.text, second.change, second.better) == (f'{value:,.2f} m', '-0.50', True)
    flown, frames = {(0, 'pid'): judge(scores)}, {0: {'unstable': 0, 'weak_steering': 0}}
    study = report('current_8deg', {}, 1, 0, flown, frames)
    assert study['rows'][0]['shallowest_m']['worst'] == value


def test_a_card_of_before_a_score_has_none_of_it(stranger):
    flight, scores = fly_scored(load_scenario('current_8deg', {'dives': 0, 'duration_s': 10.0}))
    card = scorecard(load_scenario('current_8deg'), 'direct', flight, scores)
    del card['depth_m']['shallowest']
    assert SHALLOWEST.in_card(card) is None
    assert SHALLOWEST.label not in dict(score_rows([card, card]))
