# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""README is short, and its figures are those that commands print today."""

import json
import re
import sys
from pathlib import Path

import pytest

import glider_bringup

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / 'README.md').read_text(encoding='utf-8')
FOUND = json.loads((ROOT / 'docs/figures.json').read_text(encoding='utf-8'))
MOST_WORDS = 900


@pytest.fixture(scope='module')
def figures():
    """The program behind ./glider figures."""
    sys.path.insert(0, str(ROOT / 'docs/making'))
    try:
        import figures
    finally:
        sys.path.pop(0)
    return figures


def test_is_short():
    """As `wc -w` counts, with code and tables."""
    assert 300 < len(README.split()) <= MOST_WORDS


def test_pictures_are_there_and_small():
    for name in re.findall(r'(?:src|srcset)="([^"]+)"', README):
        assert 10_000 < (ROOT / name).stat().st_size <= 3_000_000, name


def test_figures_are_those_that_were_measured(figures):
    assert figures.with_figures(README, FOUND) == README, 'run ./glider figures'
    assert {found[2] for found in figures.MARKED.finditer(README)} == {'shown', 'tracking', 'sea'}


def test_every_figure_names_its_command_commit_and_date(figures):
    assert set(FOUND) == {*figures.FLIGHTS, *figures.AT_SEA}
    for one in FOUND.values():
        assert one['command'].startswith('./glider ')
        assert re.fullmatch(r'[0-9a-f]{7,}', one['commit'])
        assert re.fullmatch(r'\d{4}-\d\d-\d\d', one['date'])


def test_flights_come_up_today_where_readme_says():
    """The first three surfacings of the flight of 30 h: enough to notice that it has changed."""
    told = FOUND['reckoned']['printed']['navigation']['surfacing_error_m'][:3]
    run = glider_bringup.fly('reckoned_12deg', duration=26_000.0)
    again = [round(metres) for metres in run.score['navigation']['surfacing_error_m']]
    assert again == [round(metres) for metres in told], 'run ./glider figures'
