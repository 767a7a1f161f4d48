# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""No property fails because a machine is busy: none of them has a deadline."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
#: Collects the tests of a folder, from there as colcon does, and prints every property.
COLLECT = """
import pytest
class Properties:
    def pytest_collection_finish(self, session):
        for item in session.items:
            found = getattr(item.obj, '_hypothesis_internal_use_settings', None)
            if hasattr(item.obj, 'hypothesis'):
                print('property', item.nodeid, getattr(found, 'deadline', 'default'))
raise SystemExit(pytest.main(['--collect-only', '-q', 'test'], plugins=[Properties()]))
"""


@pytest.mark.parametrize(
    'folder',
    [ROOT, *sorted(one.parent for one in ROOT.glob('src/*/test'))],
    ids=lambda at: at.name,
)
def test_no_property_has_a_deadline(folder):
    done = subprocess.run(
        [sys.executable, '-c', COLLECT], cwd=folder, capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stdout + done.stderr
    found = [line.split() for line in done.stdout.splitlines() if line.startswith('property ')]
    assert found or folder.name in (ROOT.name, 'glider_flights')  # which have none
    assert {words[1]: words[-1] for words in found if words[-1] != 'None'} == {}
