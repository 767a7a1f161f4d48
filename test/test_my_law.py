# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A law and a method from other packages: flown everywhere by their names, as they are now.

The packages of examples/ are installed by pip into a folder of their own, as a person would. What
is compiled goes to a cache of its own, so that what is new there is known.
"""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
import xarray
import yaml

from glider_base.kernels import cache as kernel_cache
from glider_base.ros.wire.topics import recorded_topics
from glider_mission.recording.mcap_reader import Bag

ROOT = Path(__file__).resolve().parents[1]
EXAMPLES, DOCUMENT = ROOT / 'examples', ROOT / 'docs' / 'your_law.md'
#: Files that the document builds, piece by piece.
BUILT = (
    *('examples/my_law/pyproject.toml', 'examples/my_law/my_law/sliding.py'),
    *('examples/my_method/pyproject.toml', 'examples/my_method/my_method/vector_field.py'),
    'src/glider_model/glider_model/ocean/fields/jet.py',
)
#: A piece of a file in the document.
PIECE = re.compile(r'<!-- file: (\S+) -->\n```\w+\n(.*?)\n```\n', re.DOTALL)
PER_TICK = [
    topic.full_name('/glider') for topic in recorded_topics(['measured_odom']) if topic.per_tick
]
DEADLINE_S = 300.0
#: What is flown: short, and with moments from the first tick.
FLIGHT = {'dives': 0, 'duration_s': 60.0, 'profile.prepare_s': 0.0}
MINE = ['--controller', 'sliding', '--guidance', 'vector_field']
#: What a sweep says, but for its axes.
SWEEP = {
    'name': 'mine',
    'scenario': 'current_8deg',
    'set': {**FLIGHT, 'control.law': 'sliding', 'guidance.los.method': 'vector_field'},
}
#: Lines of the packages that are changed.
CHANGES = (
    ('my_law/sliding.py', 'params.k * math.tanh', '0.8 * params.k * math.tanh'),
    ('my_method/vector_field.py', '-params.far * 2.0', '-params.far * 1.5'),
)

#: What a process knows of the packages, without a flight.
KNOWN = """
import json, sys
from pathlib import Path
from glider_bringup.console import Controller, picked
from glider_bringup.engines.launch_plan import plan_launch
from glider_mission.scenario import load_scenario
folder = Path(sys.argv[1])
plan = plan_launch({'controller': 'sliding', 'guidance': 'vector_field'}, folder)
other = load_scenario('current_8deg', {'control.sliding.k': 5.0}).to_yaml()
mine = load_scenario('current_8deg', {'control.law': 'sliding', 'control.sliding.k': 5.0})
print(json.dumps({'laws': picked(None, Controller), 'launched': plan.scenario.control.law,
                  'other': other, 'mine': mine.to_yaml()}))
"""

#: A package of which nothing can be used, by the names in its entry points.
BROKEN = {
    'glider.control_laws': {
        'absent': ('no_such_module:Law', 'ModuleNotFoundError: No module named'),
        'failing': ('broken_failing:Law', 'ZeroDivisionError: division by zero'),
        'pid': ('broken:Law', 'ValueError: its name is taken'),
        'gate': ('broken:Law', 'ValueError: its name is taken'),
        'number': ('broken:NUMBER', 'TypeError: it is no subclass of'),
        'bare': ('broken:Bare', 'ValueError: its field gain has no usable default'),
        'idle': ('broken:Law', 'TypeError: it has no params and no initial_state'),
    },
    'glider.commands': {
        'dry': ('no_such_module:app', 'ModuleNotFoundError: No module named'),
        'five': ('broken:NUMBER', 'TypeError: it is no typer.Typer'),
        'score': ('broken:NUMBER', 'ValueError: its name is taken'),
        'sweep': ('broken:NUMBER', 'ValueError: its name is taken'),
    },
    'glider.python': {'sweep': ('broken:NUMBER', 'ValueError: its name is taken by glider_stud')},
    'glider.guidance_methods': {'los': ('broken:Law', 'ValueError: its name is taken')},
    'glider.navigation_methods': {'blind': ('broken:Blind', 'ValueError: it reads or tells gps')},
    'glider.currents': {'whirl': ('broken:Whirl', "TypeError: it needs kind: Literal['whirl']")},
}
BROKEN_PY = """
from glider_control.law import LawSettings
from glider_model.ocean.field import FieldSettings
from glider_navigation.method import NavigationMethodSettings
NUMBER = 1
class Law(LawSettings): pass
class Bare(LawSettings):
    gain: float
    def params(self, vehicle, bank): pass
    def initial_state(self): pass
class Blind(NavigationMethodSettings):
    reads = 'imu', 'gps'
    def params(self, start): pass
    def initial_state(self, start): pass
class Whirl(FieldSettings):
    kind: str = 'eddy'
    def params(self): pass
"""


class Flown(NamedTuple):
    """A run that is over."""

    folder: Path
    card: dict  #: what --json printed

    @property
    def place(self) -> list[float]:
        return self.card['final_state']['position_ned_m']


class Machine:
    """A machine on which packages are installed."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.site, self.cache = folder, folder / 'site', folder / 'cache'

    def install(self, *names: str) -> None:
        """Install packages of examples/, from copies: pip builds where they lie."""
        sources = [shutil.copytree(EXAMPLES / name, self.folder / name) for name in names]
        pip = [sys.executable, '-m', 'pip', 'install', '--no-build-isolation', '--no-index']
        quiet = ['--quiet', '--disable-pip-version-check', '--target', self.site]
        subprocess.run([*pip, *quiet, *sources], check=True, timeout=DEADLINE_S)

    def change(self, file: str, line: str, other: str) -> None:
        """Change a line of a package."""
        path = self.site / file
        text = path.read_text(encoding='utf-8')
        assert text.count(line) == 1
        path.write_text(text.replace(line, other), encoding='utf-8')

    def start(self, *arguments) -> subprocess.CompletedProcess:
        """Run Python to its end, with the packages on its path."""
        env = {name: value for name, value in os.environ.items() if name != 'ROS_DOMAIN_ID'}
        path = [str(self.site), *filter(None, [env.get('PYTHONPATH')])]
        env |= {'PYTHONPATH': os.pathsep.join(path), 'GLIDER_CACHE': str(self.cache)}
        return subprocess.run(
            [sys.executable, *map(str, arguments)],
            env=env,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=DEADLINE_S,
        )

    def glider(self, *arguments) -> subprocess.CompletedProcess:
        """Run a command that has to succeed."""
        done = self.start('-m', 'glider_bringup.cli', *arguments)
        assert done.returncode == 0, done.stderr
        return done

    def fly(self, name: str, *options) -> Flown:
        changes = [word for pair in FLIGHT.items() for word in ('--set', '{}={}'.format(*pair))]
        folder = self.folder / name
        done = self.glider('run', *MINE, *changes, '--out', folder, '--json', *options)
        return Flown(folder, json.loads(done.stdout))

    def fly_both(self, name: str, *options) -> tuple[Flown, Flown]:
        """Fly directly, then over nodes, which find most of what they need compiled."""
        direct = self.fly(f'direct_{name}', '--engine', 'direct', '--bag', '--no-report')
        return direct, self.fly(f'nodes_{name}', *options)

    def sweep(self, name: str, **dimensions) -> xarray.Dataset:
        """Fly a sweep in workers."""
        file, folder = self.folder / f'{name}.yaml', self.folder / name
        file.write_text(yaml.safe_dump({**SWEEP, 'dimensions': dimensions}))
        self.glider('sweep', file, '--out', folder, '--workers', 1)
        with xarray.open_dataset(folder / 'sweep.nc') as result:
            return result.load()

    def compiled(self) -> dict[Path, int]:
        """Files of compiled code, and when each was written."""
        kept = (path for path in (self.cache / 'kernels').rglob('*') if path.is_file())
        return {path: path.stat().st_mtime_ns for path in kept}


def values(field: str, *numbers: float) -> dict:
    """Axis of a sweep."""
    return {'kind': 'values', 'field': field, 'values': list(numbers)}


def payloads(folder: Path) -> dict[str, list[tuple[int, bytes]]]:
    """Stamps and bytes of all messages of the per-tick topics of a run."""
    bag, found = Bag(folder), {topic: [] for topic in PER_TICK}
    for batch in bag.batches():
        for index, topic in enumerate(batch.topic):
            name = bag.topics[topic].name
            if name in found:
                found[name].append((int(batch.log_ns[index]), batch.payload(index)))
    return found


def link(source: str, target: str) -> None:
    """Have a file in two places, if they are of one disk: it is replaced, never changed."""
    try:
        os.link(source, target)
    except FileNotFoundError:
        pass  # another worker was writing it
    except OSError:
        shutil.copy2(source, target)


@pytest.fixture(scope='module')
def machine(tmp_path_factory) -> Machine:
    made = Machine(tmp_path_factory.mktemp('machine'))
    # what its packages do not reach is compiled already
    cached, own = kernel_cache.folder(), made.cache / 'kernels'
    shutil.copytree(cached, own, dirs_exist_ok=True, copy_function=link)
    made.install('my_law', 'my_method')
    return made


@pytest.fixture(scope='module')
def both(machine) -> tuple[Flown, Flown]:
    return machine.fly_both('first')


@pytest.fixture(scope='module')
def direct(both) -> Flown:
    return both[0]


@pytest.fixture(scope='module')
def nodes(both) -> Flown:
    return both[1]


@pytest.fixture(scope='module')
def sweep(machine, direct) -> xarray.Dataset:
    return machine.sweep(
        'sweep',
        gain=values('control.sliding.k', 6.0, 12.0),
        width=values('guidance.vector_field.width_m', 50.0, 100.0),
    )


@pytest.fixture(scope='module')
def known(machine) -> dict:
    """What processes know, who have nothing to fly."""
    done = machine.start('-c', KNOWN, machine.folder)
    assert (done.returncode, done.stderr) == (0, '')
    return json.loads(done.stdout)


def test_its_name_stands_in_the_scorecard_and_the_report(direct, nodes):
    for run in (direct, nodes):
        assert (run.card['controller'], run.card['guidance']) == ('sliding', 'vector_field')
        assert run.card['status'] == 'completed'
    page = (nodes.folder / 'report.html').read_text(encoding='utf-8')
    assert 'sliding' in page and 'vector_field' in page


def test_its_fields_are_those_of_the_scenario_and_of_the_nodes(nodes):
    scenario = yaml.safe_load((nodes.folder / 'scenario.yaml').read_text())
    parameters = yaml.safe_load((nodes.folder / 'parameters.yaml').read_text())
    control, guidance = (
        parameters[f'/glider/{name}_node']['ros__parameters'] for name in ('control', 'guidance')
    )
    assert control['sliding'] == scenario['control']['sliding']
    assert control['sliding']['k'] == 12.0
    assert guidance['vector_field'] == scenario['guidance']['vector_field']
    assert guidance['vector_field']['width_m'] == 100.0


def test_nodes_and_direct_agree_to_the_last_bit(direct, nodes):
    flown = payloads(nodes.folder)
    assert {len(messages) for messages in flown.values()} == {600}
    assert flown == payloads(direct.folder)


def test_the_recorded_run_is_verified(machine, nodes):
    said = json.loads(machine.glider('verify', nodes.folder, '--json').stdout)
    assert said['identical']
    assert {one['block']: one['ticks'] for one in said['blocks']}['control'] == 600


def test_runs_are_compared_by_its_name(machine, direct, nodes):
    page = machine.folder / 'compare.html'
    told = machine.glider('compare', direct.folder, nodes.folder, '--out', page).stdout
    assert 'sliding' in told and 'vector_field' in told
    assert 'sliding' in page.read_text(encoding='utf-8')


def test_the_next_process_compiles_nothing(machine, direct):
    before = machine.compiled()
    again = machine.fly('again', '--engine', 'direct', '--bag', '--no-report')
    assert again.place == direct.place
    assert machine.compiled() == before != {}


def test_its_fields_are_axes_of_a_sweep(direct, sweep):
    places = sweep['final_state_position_ned_m']
    assert places.sel(gain=12.0, width=100.0).values.tolist() == direct.place
    assert len(np.unique(places.values.reshape(4, 3), axis=0)) == 4
    assert 'sliding' in sweep.attrs['scenario_yaml']


def test_montecarlo_flies_it(machine, direct):
    flown = [*MINE[:2], '--plants', 2, '--duration', 60, '--workers', 1, '--json']
    changes = ['--set', 'guidance.los.method=vector_field', '--set', 'profile.prepare_s=0']
    study = json.loads(machine.glider('montecarlo', 'current_8deg', *flown, *changes).stdout)
    (row,) = study['rows']
    assert (row['controller'], study['plants'], row['diverged']) == ('sliding', 2, 0)


def test_all_laws_are_flown_by_montecarlo_and_it_is_one_of_them(known):
    assert known['laws'] == ['adaptive', 'backstepping', 'pid', 'sliding']


def test_ros2_launch_knows_it(known):
    assert known['launched'] == 'sliding'


def test_a_scenario_tells_of_it_if_it_flies_or_something_is_said_of_it(machine, known):
    """Else runs could be read by nobody who has not installed it."""
    assert yaml.safe_load(known['mine'])['control']['sliding']['k'] == 5.0
    assert yaml.safe_load(known['other'])['control']['sliding']['k'] == 5.0
    assert 'vector_field' not in known['mine']
    program = (
        'from glider_mission.scenario import load_scenario; print(load_scenario("helix").'
        'to_yaml())'
    )
    text = machine.start('-c', program).stdout
    assert 'adaptive' in text and 'sliding' not in text and 'vector_field' not in text


def test_help_names_it_and_a_wrong_gain_is_told(machine):
    told = machine.start('-m', 'glider_bringup.cli', 'run', '--controller', 'slidin')
    assert told.returncode == 2 and "'sliding'" in told.stderr
    told = machine.start('-m', 'glider_bringup.cli', 'run', *MINE, '--set', 'control.sliding.k=-1')
    assert told.returncode == 2
    assert told.stderr.endswith('control.sliding.k = -1: should be greater than 0 '
                                '(allowed: > 0.0 and <= 200.0)\n')  # fmt: skip


def test_a_run_whose_law_is_not_installed_is_told_in_one_line_each(machine, nodes):
    text = (nodes.folder / 'scenario.yaml').read_text().replace('sliding', 'gliding')
    other = machine.folder / 'elsewhere' / 'other.yaml'
    shutil.copytree(nodes.folder, other.parent, ignore=shutil.ignore_patterns('*.mcap'))
    other.write_text(text.replace('vector_field', 'scalar_field'))
    command = ['-m', 'glider_bringup.cli', 'verify', nodes.folder, '--settings', other]
    done = machine.start(*command)
    assert (done.returncode, done.stdout) == (2, '')
    one, other = filter(str.strip, done.stderr.splitlines())
    assert "guidance.los.method = 'scalar_field'" in one and 'glider.guidance_methods' in one
    assert (
        "control.law = 'gliding'" in other
        and "'adaptive', 'backstepping', 'pid' or 'sliding'" in other
    )
    assert 'others come with packages that register them in the group' in other


def test_a_changed_line_is_what_flies_next(machine, direct, nodes, sweep):
    """Directly, over nodes and in a worker: all agree, on another flight than before."""
    before = machine.compiled()
    for change in CHANGES:
        machine.change(*change)
    changed, over_nodes = machine.fly_both('changed', '--no-report')
    assert set(machine.compiled()) > set(before)
    flown, old = payloads(changed.folder), payloads(direct.folder)
    assert flown['/glider/wrench'] != old['/glider/wrench']
    assert payloads(over_nodes.folder) == flown
    worked = machine.sweep('sweep_changed', gain=values('control.sliding.k', 12.0))
    assert worked['final_state_position_ned_m'].values.tolist() == [changed.place]
    assert changed.place != direct.place
    # what guidance was told before makes it ask for something else now
    done = machine.start('-m', 'glider_bringup.cli', 'verify', nodes.folder, '--only', 'guidance')
    assert done.returncode == 1 and 'messages that differ: reference' in done.stdout


#: The help of a command loads the classes, that of all the commands.
TWO_HELPS = """
from glider_bringup.cli import app
for words in (['run', '--help'], ['--help']):
    try:
        app(words, prog_name='./glider')
    except SystemExit as end:
        assert not end.code
"""


def test_a_package_that_cannot_be_used_is_told_and_all_else_works(tmp_path):
    """One line each on standard error: what, from where, and why; once, whatever it starts."""
    broken = Machine(tmp_path)
    info = broken.site / 'broken-1.0.dist-info'
    info.mkdir(parents=True)
    (info / 'METADATA').write_text('Metadata-Version: 2.1\nName: broken\nVersion: 1.0\n')
    groups = (
        f'[{group}]\n' + ''.join(f'{name} = {value}\n' for name, (value, _) in points.items())
        for group, points in BROKEN.items()
    )
    (info / 'entry_points.txt').write_text('\n'.join(groups))
    (broken.site / 'broken.py').write_text(BROKEN_PY)
    (broken.site / 'broken_failing.py').write_text('1 / 0\n')
    (broken.site / 'two_helps.py').write_text(TWO_HELPS)
    command = [sys.executable, '-m', 'two_helps']
    program = 'import glider_bringup, glider_control.settings, subprocess; glider_bringup.sweep; '
    program += f'subprocess.run({command}, check=True)'
    done = broken.start('-c', program)
    assert done.returncode == 0 and '<adaptive|back' in done.stdout
    told = done.stderr.splitlines()
    expected = [(group, name, *what) for group in BROKEN for name, what in BROKEN[group].items()]
    assert len(told) == len(expected)
    for group, name, value, why in expected:
        start = f'glider: broken 1.0: {group}: {name} = {value}: not usable: {why}'
        assert sum(line.startswith(start) for line in told) == 1, (start, told)


@pytest.mark.parametrize('file', BUILT)
def test_the_document_builds_the_files_that_are_flown(file):
    """Their pieces in the document, two empty lines between them, are the whole file."""
    pieces = [piece for name, piece in PIECE.findall(DOCUMENT.read_text()) if name == file]
    text = (ROOT / file).read_text(encoding='utf-8')
    lines = [line for line in text.splitlines() if not line.startswith(('# Copyright', '# SPDX'))]
    assert '\n\n\n'.join(pieces).splitlines() == lines


def test_the_document_shows_no_other_files():
    assert {name for name, _ in PIECE.findall(DOCUMENT.read_text())} == set(BUILT)


def test_the_shortest_way_flies(monkeypatch):
    """The piece of Python at the head of the document, as it stands."""
    (piece,) = re.findall(r'<!-- run -->\n```python\n(.*?)```', DOCUMENT.read_text(), re.DOTALL)
    names = {'__name__': '__main__'}
    exec(compile(piece, DOCUMENT.name, 'exec'), names)
    run = names['run']
    assert (run.score['controller'], run.score['status']) == ('hold', 'completed')
    assert run.score['cross_track_m']['max_steady'] < 5.0
