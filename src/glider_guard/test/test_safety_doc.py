# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""docs/safety.md has the rows of the code; run as a program, this file writes them anew."""

import re
from pathlib import Path

from glider_guard.rows import REACTIONS, ROWS
from glider_guard.settings import GuardSettings
from glider_model.vehicle.file import Vehicle

ROOT = Path(__file__).resolve().parents[3]
DOCUMENT = ROOT / 'docs' / 'safety.md'
HEADER = ('bit', 'row', 'when', 'by', 'then', 'latches')
#: What the guard is told of a vehicle and what it measures, and its gate: no limits of rows.
FITTED = {
    *('vehicle', 'pressure', 'altitude', 'depth_resolution_m', 'imu_period_s', 'imu_missed_share'),
    *('position_std_m', 'gate'),
}
_BEGIN, _END = '<!-- table: guard -->', '<!-- end -->'


def _with_default(name: str) -> str:
    """Parameter with its default; a field of the vehicle by its name alone."""
    if name in Vehicle.model_fields:
        return f'`{name}`'
    value = GuardSettings()
    for part in name.split('.'):
        value = getattr(value, part)
    return f'`{name}` {value:g}'


def _parts() -> tuple[str, str, str]:
    text = DOCUMENT.read_text(encoding='utf-8')
    before, _, rest = text.partition(_BEGIN)
    inside, _, after = rest.partition(_END)
    return before, inside.strip(), after


def table() -> str:
    """The rows as Markdown: when one holds, and by which fields, the document says by itself."""
    said = [line.strip('| ').split(' | ') for line in _parts()[1].splitlines()[2:]]
    told = {cells[1].strip('`'): cells[2:-2] for cells in said}
    lines = [HEADER, ('---',) * len(HEADER)]
    for row in ROWS:
        when, *by = told[row.name]
        by = ', '.join(map(_with_default, re.findall('`([^`]+)`', ''.join(by))))
        latches = 'yes' if row.latches else 'no'
        lines.append((str(row.bit), f'`{row.name}`', when, by, REACTIONS[row.reaction], latches))
    return '\n'.join(f'| {" | ".join(line)} |' for line in lines)


def test_the_document_prints_every_row():
    assert _parts()[1] == table(), f'write it anew: ./glider python {Path(__file__).name}'


def test_every_limit_of_the_guard_stands_by_a_row():
    by = ''.join(line.split(' | ')[3] for line in _parts()[1].splitlines()[2:])
    named = set(re.findall('`([^`]+)`', by))
    assert set(GuardSettings.model_fields) - FITTED == named & set(GuardSettings.model_fields)


def test_every_row_has_a_test():
    """Its name, or that of its bit, stands in the tests of the guard."""
    files = sorted(Path(__file__).parent.glob('test_*.py'))
    tests = ''.join(file.read_text(encoding='utf-8') for file in files)
    for row in ROWS:
        assert re.search(rf"'{row.name}'", tests), row.name


if __name__ == '__main__':
    before, _, after = _parts()
    DOCUMENT.write_text(f'{before}{_BEGIN}\n{table()}\n{_END}{after}', encoding='utf-8')
