# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""docs/tutorial.md to the letter: each block is run, and prints what stands below it."""

import re
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
BLOCK = re.compile(
    r'(?:<!-- not run: (?P<why>[^>]+) -->\n)?```(?P<kind>console|python)\n(?P<text>.*?)```', re.S
)


def blocks() -> list[re.Match]:
    return list(BLOCK.finditer((ROOT / 'docs/tutorial.md').read_text(encoding='utf-8')))


def left_out(expected: list[str], printed: list[str]) -> list[str]:
    """Expected lines that do not come in this order; what follows no `...` comes at once."""
    at, gap = 0, True  # progress and its empty lines may stand before
    for line in expected:
        if line == '...':
            gap = True
            continue
        places = [n for n in range(at, len(printed)) if printed[n].rstrip() == line.rstrip()]
        if not places or (not gap and places[0] != at):
            return [line]
        at, gap = places[0] + 1, False
    return []


def test_every_block_prints_what_it_says(glider, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    ran = 0
    for block in blocks():
        if block['why']:
            continue
        if block['kind'] == 'python':
            with redirect_stdout(StringIO()) as text:
                exec(block['text'], {'__name__': '__main__'})
            assert text.getvalue() == 'completed 4\n'
        else:
            command, *expected = block['text'].splitlines()
            words = command.removeprefix('$ ./glider ').split()
            done = glider(*words)
            assert done.returncode == 0, f'{command}: {done.stderr}'
            assert left_out(expected, done.stdout.splitlines()) == [], f'{command}\n{done.stdout}'
        ran += 1
    assert ran == 10


def test_what_is_not_run_says_why_and_wrong_lines_are_found():
    assert [bool(block['why']) for block in blocks()].count(True) == 3
    assert left_out(['a', '...', 'c'], ['', 'a', 'b', 'c']) == []
    assert left_out(['a', 'c'], ['a', 'b', 'c']) == ['c']
    assert left_out(['...', 'd'], ['a', 'b']) == ['d']
