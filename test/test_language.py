# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What a person reads is short, and in the words of the field."""

import inspect
import json
import re
import tokenize
from pathlib import Path

import click
import pytest
import typer

import glider_bringup
from glider_bringup import cli
from glider_bringup.showing.scorecard import card_rows

ROOT = Path(__file__).resolve().parents[1]
#: Longer sentences are allowed here: mathematics, and the reasons of decisions.
THEORY = {'docs/theory.md', 'docs/paper.md'}
DOCUMENTS = sorted([ROOT / 'README.md', ROOT / 'CONTRIBUTING.md', *ROOT.glob('docs/*.md')])
DECISIONS = sorted(ROOT.glob('docs/adr/*.md'))
SOURCES = sorted((ROOT / 'src').glob('*/glider_*'))
MOST_WORDS = 35

#: Words that this project once had of its own, and those of the field.
OWN_WORDS = {
    r'the (?:kick|bend) of': 'adverse yaw, cubic roll effectiveness',
    r'null bank': 'zero-turn bank',
    r'net heaviness': 'net buoyancy',
    r'turn-?overs?\b': 'inflection',
    r'belie(?:f|fs|ves?|ved|ving)\b': 'estimate, estimated',
    r'mean current of a way|mean current learnt': 'depth-averaged current (DAC)',
    r'off the place': 'navigation error, surfacing position error',
    r'(?:way|ways) under water|stays? at the surface': 'dive segment, surface interval',
    r'beside (?:the|its|their) paths?|(?<!set )\baside\b': 'cross-track',
    r'lead of turns': 'drift pre-compensation',
    r'(?<!disk had )(?<!is )\brooms?\b(?! for)': 'packages',
    r'\bfloors?\b': 'baselines',
    r'\btold\b|\bheard\b(?! of)': 'reported, received',
    r'\bunwell\b|\bis well\b': 'unhealthy, healthy',
    r'\btakers?\b': 'sink',
    r'weight(?:s)? let go|let(?:s)? go (?:of )?(?:its|the) weight': 'drop weight released',
    r'\bflown (?:by|over|from|before|last) the (?:nodes|direct|engine)': 'simulated',
}


def prose(text: str) -> list[str]:
    """Paragraphs, list items and cells of tables of a document, without code."""
    text = re.sub(r'^(```|~~~).*?^\1', '\n', text, flags=re.DOTALL | re.MULTILINE)
    text = re.sub(r'<!--.*?-->|</?[a-z][^>]*>', ' ', text, flags=re.DOTALL)
    found, open_now = [], []
    for line in [*text.splitlines(), '']:
        bare = line.strip()
        is_code = line.startswith('    ') and not open_now
        starts = re.match(r'#+ |[*+-] |\d+\. |> |\|', bare)
        if (not bare or starts or is_code) and open_now:
            found.append(' '.join(open_now))
            open_now = []
        if bare.startswith('|'):
            cells = re.split(r'(?<!\\)\||;', bare.strip('|'))  # ; divides what a cell lists
            found += [cell.strip() for cell in cells]
        elif bare and not is_code:
            open_now.append(bare[len(starts[0]) :] if starts else bare)
    return [re.sub(r'\]\([^)]*\)', ']', re.sub(r'`[^`]*`', 'CODE', one)) for one in found]


def sentences(text: str) -> list[str]:
    """Sentences of a document, without code."""
    return [one for part in prose(text) for one in re.split(r'(?<=[.!?])[*_)"]*\s+', part)]


def long_ones(text: str) -> list[str]:
    """Sentences of more than `MOST_WORDS` words."""
    return [one for one in sentences(text) if len(re.findall(r'\w[^\s]*', one)) > MOST_WORDS]


def own_words(text: str) -> list[str]:
    """Words of our own in prose, each with what to write."""
    found = []
    for one in prose(text):
        for pattern, instead in OWN_WORDS.items():
            for match in re.finditer(pattern, one, re.IGNORECASE):
                found.append(f'{match[0]!r} (write {instead}): ...{one[:120]}')
    return found


@pytest.mark.parametrize('path', DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_sentences_are_short(path):
    if str(path.relative_to(ROOT)) not in THEORY:
        assert long_ones(path.read_text(encoding='utf-8')) == []


@pytest.mark.parametrize(
    'path', [*DOCUMENTS, *DECISIONS], ids=lambda path: str(path.relative_to(ROOT))
)
def test_words_are_those_of_the_field(path):
    assert own_words(path.read_text(encoding='utf-8')) == []


@pytest.mark.parametrize('package', SOURCES, ids=lambda path: path.name)
def test_words_in_code_are_those_of_the_field(package):
    """In comments and docstrings."""
    for path in package.rglob('*.py'):
        with tokenize.open(path) as file:
            tokens = list(tokenize.generate_tokens(file.readline))
        said = [one.string.lstrip('#: ') for one in tokens if one.type == tokenize.COMMENT]
        said += [inspect.cleandoc(one.string) for one in tokens if one.string.startswith('"""')]
        text = '\n\n'.join(said).lower()
        # in kilograms, positive where it sinks, and so named in scenarios
        assert own_words(text.replace('net heaviness', '')) == [], path


def test_bad_text_is_found():
    long = ' '.join(['word'] * 36) + '.'
    assert long_ones(f'# Title\n\nShort. {long}\n') == [long]
    assert long_ones(f'| a | {long} |\n') == [long]
    assert long_ones(f'* {long[:-5]}.\n') == []
    assert long_ones(f'```\n{long}\n```\n\n    {long}\n') == []
    assert len(own_words('It believes that it is beside the path.')) == 2
    assert own_words('`believed_north_m`, `./glider --net heaviness`') == []


# ---------------------------------------------------------------------- what commands print


def helps() -> dict[str, str]:
    """Help of every command: its own text, and that of each option and argument."""
    group = typer.main.get_command(cli.app)
    context = click.Context(group)
    found = {}
    for name in group.list_commands(context):
        command = group.get_command(context, name)
        texts = [
            command.help,
            command.epilog,
            *(getattr(one, 'help', '') for one in command.params),
        ]
        found[name] = '\n\n'.join(text for text in texts if text)
    return found


def test_help_is_short_and_in_words_of_the_field():
    found = helps()
    assert len(found) > 20 and all(found.values())
    for name, text in found.items():
        wrong = long_ones(text.replace(';', '.')) + own_words(text)  # ; divides what it lists
        assert wrong == [], name


def test_report_and_scorecard_are_in_words_of_the_field(tmp_path):
    run = glider_bringup.fly('slocum_shelf', {'profile.depth_m': 60.0}, duration=4000.0)
    assert run.score['navigation']['surfacings'] >= 1
    page = run.report(tmp_path / 'report.html').read_text(encoding='utf-8')
    (data,) = re.findall(r'<script type="application/json" id="data">(.*?)</script>', page, re.S)
    body = re.sub(r'<(script|style).*?</\1>|<[^>]+>', '\n\n', page, flags=re.DOTALL)
    panels = [
        text
        for panel in json.loads(data)['panels']
        for text in (panel['title'], panel['caption'], *(one['label'] for one in panel['curves']))
    ]
    lines = [f'{name} {value}' for name, value in card_rows(run.score)]
    assert len(panels) > 20 and len(lines) > 10
    assert own_words('\n\n'.join([body, *panels, *lines])) == []
