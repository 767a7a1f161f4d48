# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""No property fails because a machine is busy: none of them has a deadline."""

import ast
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
#: Finds the conftest.py of a folder of tests as colcon does, and prints what properties go by.
PROFILE = """
import pytest, sys
from hypothesis import settings
class Profile:
    def pytest_collection_finish(self, session):
        print('deadline', settings().deadline)
pytest.main(['--collect-only', '-q', '--ignore-glob=*/test_*', sys.argv[1]], plugins=[Profile()])
"""


def deadline_in(folder: Path) -> str:
    """What a property of a folder has that says nothing of it, on a machine of a person.

    Where its variables tell of a server that tests, hypothesis itself sets none.
    """
    kept = ('HOME', 'PATH', 'LD_LIBRARY_PATH', 'PYTHONPATH')
    done = subprocess.run(
        [sys.executable, '-c', PROFILE, str(folder)],
        cwd=folder.parent,
        env={name: os.environ[name] for name in kept if name in os.environ},
        capture_output=True,
        text=True,
        timeout=300,
    )
    (line,) = [one for one in done.stdout.splitlines() if one.startswith('deadline ')]
    return line.removeprefix('deadline ')


@pytest.mark.parametrize('folder', ['src/glider_base/test', 'test'])
def test_properties_of_a_folder_have_none(folder):
    """Of a package or of the workspace: what holds for one holds for all, see below."""
    assert deadline_in(ROOT / folder) == 'None'


def test_no_package_has_a_root_of_its_own():
    """Else pytest would not look further up, where the profile is."""
    names = 'pytest.ini', '.pytest.ini', 'pyproject.toml', 'tox.ini', 'conftest.py'
    assert [path for name in names for path in ROOT.glob(f'src/*/{name}')] == []
    assert not any('[tool:pytest]' in path.read_text() for path in ROOT.glob('src/*/setup.cfg'))


def test_elsewhere_they_have_one(tmp_path):
    assert deadline_in(tmp_path) != 'None'


def test_no_test_gives_a_property_one():
    """None sets a deadline or a profile of its own."""
    files = [*ROOT.glob('test/**/*.py'), *ROOT.glob('src/*/test/**/*.py')]
    assert len(files) > 150
    given = []
    for path in {*files} - {ROOT / 'test' / 'mutants' / 'trial.py', Path(__file__).resolve()}:
        for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'))):
            if isinstance(node, ast.keyword) and node.arg == 'deadline':
                given.append((path.name, ast.unparse(node)))
            if isinstance(node, ast.Attribute) and node.attr in (
                'register_profile',
                'load_profile',
            ):
                given.append((path.name, ast.unparse(node)))
    assert given == []
