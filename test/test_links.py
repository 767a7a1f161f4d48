# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Documents point at what is there."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
DOCUMENTS = sorted([*ROOT.glob('*.md'), *ROOT.glob('docs/**/*.md'), *ROOT.glob('examples/*.md')])


@pytest.mark.parametrize('document', DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_links_lead_to_files_and_headings(document):
    links = re.findall(r'\]\((?!\w+:)([^)#\s]*)(?:#([^)\s]*))?\)', document.read_text())
    for path, heading in links:
        target = (document.parent / path).resolve() if path else document
        assert target.exists(), path
        if heading:
            titles = re.findall(r'^#+ (.*)$', target.read_text(), re.MULTILINE)
            anchors = [re.sub(r'[^\w\- ]', '', t.lower()).replace(' ', '-') for t in titles]
            assert heading in anchors, f'{path}#{heading}'


def test_every_decision_is_in_their_list():
    folder = ROOT / 'docs/adr'
    listed = (folder / 'README.md').read_text()
    missing = [one.name for one in folder.glob('0*.md') if f']({one.name})' not in listed]
    assert not missing


DESCRIBE_TODAY = [one for one in DOCUMENTS if one.name != 'CHANGELOG.md']


@pytest.mark.parametrize('document', DESCRIBE_TODAY, ids=lambda path: str(path.relative_to(ROOT)))
def test_files_that_are_named_are_there(document):
    """Those in a folder, such as `engines/janitor.py`."""
    named = re.findall(r'`((?!share/)(?:\w+/)+\w+\.(?:py|xml))`', document.read_text())
    folders = [ROOT, *ROOT.glob('src/**/'), *ROOT.glob('examples/**/')]
    assert [one for one in named if not any((folder / one).exists() for folder in folders)] == []
