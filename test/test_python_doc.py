# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""docs/python.md and the notebook do what they say: every block of code in them is run.

``python test/test_python_doc.py`` writes the table of the document anew.
"""

import json
import re
import subprocess
from importlib.util import find_spec
from pathlib import Path

import matplotlib
import numpy as np
import pytest
from matplotlib import pyplot

import glider_bringup as glider
from glider_base.signals import TICK_S
from glider_bringup.door.dataset import make_dataset
from glider_mission.blocks import ROW

ROOT = Path(__file__).resolve().parents[1]
DOCUMENT = ROOT / 'docs' / 'python.md'
NOTEBOOK = ROOT / 'examples' / 'first_flight.ipynb'
MARKED = re.compile(r'(<!-- table: variables -->\n)(.*?)(<!-- end -->)', re.DOTALL)


def with_table(text: str) -> str:
    """The document with the table as it should be."""
    scenario = glider.load_scenario('current_8deg', {'navigation.method': 'dead_reckoned'})
    score = glider.fly(duration=TICK_S).score
    data = make_dataset(np.zeros((1, ROW)), scenario, score)
    lines = ['| variable | unit | frame | meaning |', '| --- | --- | --- | --- |']
    for name, variable in data.data_vars.items():
        about = variable.attrs
        cells = f'`{name}`', about['units'], about.get('frame', '-'), about['long_name']
        lines.append(f'| {" | ".join(cells)} |')
    return MARKED.sub(lambda found: found[1] + '\n'.join(lines) + '\n' + found[3], text)


def test_memory_of_a_run_is_that_of_its_rows():
    """Float64 of every number, ten ticks in a second (MB/h)."""
    assert f'{36000 * ROW * 8 / 1e6:.0f} MB for each simulated hour' in DOCUMENT.read_text()


def code_cells(notebook: dict) -> list[dict]:
    return [cell for cell in notebook['cells'] if cell['cell_type'] == 'code']


@pytest.fixture
def run_code(tmp_path, monkeypatch):
    """Function that runs pieces of code one after the other, in a folder of their own."""
    monkeypatch.chdir(tmp_path)
    matplotlib.use('Agg')

    def run(pieces: list[str], source: Path) -> dict:
        names = {'__name__': '__main__'}
        for number, piece in enumerate(pieces, 1):
            exec(compile(piece, f'{source.name}, code {number}', 'exec'), names)
        return names

    yield run
    pyplot.close('all')


def test_table_of_the_document_is_that_of_the_dataset():
    text = DOCUMENT.read_text(encoding='utf-8')
    assert with_table(text) == text, 'run python test/test_python_doc.py'


def blocks() -> list[str]:
    """Python in the document."""
    return re.findall(r'^```python\n(.*?)^```', DOCUMENT.read_text(), re.DOTALL | re.MULTILINE)


def test_every_public_name_is_in_an_example():
    """`glider.Run` is what `glider.fly` gives; its own names are there too."""
    code = '\n'.join(blocks())
    names = [f'glider.{name}' for name in dir(glider) if name != 'Run']
    names += ['score', 'folder', 'scenario', 'report(', 'to_xarray()']
    missing = [name for name in names if name not in code]
    assert not missing


def test_every_block_of_the_document_runs(run_code, tmp_path):
    names = run_code(blocks(), DOCUMENT)
    frame = names['frame']
    assert len(frame) == 6000
    assert frame.index.name == 'time'
    assert frame['odom_depth'].max() > 50.0
    assert (tmp_path / 'flight.html').stat().st_size > 1e6
    assert set(names['steady'].dims) == {'controller', 'current_speed', 'current_angle'}


def test_a_dataframe_takes_three_lines():
    (block,) = [block for block in blocks() if 'to_dataframe' in block]
    assert sum(line != '' for line in block.splitlines()) == 3


def test_notebook_runs_and_has_no_outputs(run_code, tmp_path):
    notebook = json.loads(NOTEBOOK.read_text(encoding='utf-8'))
    cells = code_cells(notebook)
    assert all(not cell['outputs'] and cell['execution_count'] is None for cell in cells)
    names = run_code([''.join(cell['source']) for cell in cells], NOTEBOOK)
    assert {run.score['status'] for run in names['runs'].values()} == {'completed'}
    assert [run.score['controller'] for run in names['runs'].values()] == ['adaptive', 'pid']
    assert (tmp_path / 'first_flight.html').exists()
    assert names['depth'].yaxis_inverted()  # the surface is on top


def script(*arguments: str) -> subprocess.CompletedProcess:
    """A command of the ``glider`` script, which is there by now or these tests were not."""
    return subprocess.run(
        [ROOT / 'glider', *arguments], capture_output=True, text=True, timeout=300
    )


def test_script_gives_an_interpreter_with_the_stack_in_it():
    program = 'import sys, glider_bringup; print(glider_bringup.fly.__name__, *sys.argv[1:])'
    done = script('python', '-c', program, '--help', 'a b')
    assert (done.returncode, done.stdout) == (0, 'fly --help a b\n')
    assert script('python', '-c', 'raise SystemExit(7)').returncode == 7


def test_script_starts_jupyter_or_says_how_to_get_it():
    done = script('jupyter', '--version')
    if find_spec('jupyter_core'):
        assert (done.returncode, 'jupyter' in done.stdout) == (0, True)
    else:
        assert (done.returncode, done.stdout) == (2, '')
        (line,) = done.stderr.splitlines()
        assert './glider python -m pip install jupyterlab' in line


if __name__ == '__main__':
    DOCUMENT.write_text(with_table(DOCUMENT.read_text(encoding='utf-8')), encoding='utf-8')
