# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The architecture and the dependencies, checked by reading every import in the source tree."""

import ast
import graphlib
import re
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest

from glider_base.kernels.cache import PACKAGES
from glider_base.wiring import PORTS

SOURCES = Path(__file__).resolve().parents[1] / 'src'

#: What a vehicle flies with, and the world around it.
ON_BOARD = {
    *('glider_base', 'glider_model', 'glider_navigation', 'glider_guidance', 'glider_control'),
    'glider_guard',
}
#: What each package may import from the others.
MAY_IMPORT = {
    'glider_base': set(),
    'glider_model': {'glider_base'},
    'glider_navigation': {'glider_base', 'glider_model'},
    'glider_guidance': {'glider_base', 'glider_model'},
    'glider_control': {'glider_base', 'glider_model'},
    'glider_guard': {'glider_base', 'glider_model'},
    'glider_mission': ON_BOARD,
    'glider_bringup': {*ON_BOARD, 'glider_mission'},
    'glider_studies': {*ON_BOARD, 'glider_mission', 'glider_bringup'},
    'glider_flights': {
        *('glider_base', 'glider_model', 'glider_navigation', 'glider_mission', 'glider_bringup'),
    },
}

#: Rooms of some packages by floors, from below: a room imports from the floors beneath it only.
FLOORS = {
    'glider_model': (('vehicle', 'ocean'), ('onboard', 'plant'), ('nodes',)),
    'glider_mission': (
        ('mafiles',),
        ('blocks', 'changes', 'chart', 'disk', 'rules'),
        ('scenario',),
        ('choices', 'planned', 'routing', 'run_folder'),
        ('recording',),
    ),
    'glider_bringup': (
        ('engines', 'nodes'),
        ('scoring',),
        ('console', 'warm_up'),
        ('showing',),
        ('door',),
        ('commands',),
        ('cli',),
    ),
    'glider_studies': (
        ('random_faults', 'workers'),
        ('montecarlo', 'sweep'),
        ('paper',),
        ('bounds', 'hunt', 'routes', 'forecasts', 'bottoms', 'showing'),
        ('door', 'commands'),
    ),
}

#: rosdep keys of modules that are no ROS packages. Each was looked up in rosdep/python.yaml of
#: ros/rosdistro, where it names an Ubuntu package for noble.
ROSDEP_KEYS = {
    'hypothesis': 'python3-hypothesis',
    'jinja2': 'python3-jinja2',
    'matplotlib': 'python3-matplotlib',
    'numba': 'python3-numba',
    'numpy': 'python3-numpy',
    'pydantic': 'python3-pydantic',
    'pytest': 'python3-pytest',
    'rich': 'python3-rich',
    'scipy': 'python3-scipy',
    'typer': 'python3-typer',
    'yaml': 'python3-yaml',
}

#: Modules for which rosdep has no key; pip brings them, from requirements.txt.
ONLY_PIP = {'dask', 'distributed', 'foxglove', 'lz4', 'mcap', 'plotly', 'xarray', 'zstandard'}
#: The same, from a file of their own: what only some commands need, and say so.
OPTIONAL = {'requirements-flights.txt': {'dbdreader', 'gliderflight', 'gsw', 'h5netcdf', 'ppigrf'}}
#: Names on PyPI that are not those of the modules.
PYPI_NAMES = {'foxglove': 'foxglove-sdk'}

#: Packages of ROS 2 Jazzy, of which rosdep takes the name as a key.
JAZZY = {
    *('ament_index_python', 'launch', 'launch_ros', 'lifecycle_msgs', 'rclpy', 'tf2_msgs'),
    *('builtin_interfaces', 'rcl_interfaces', 'rosgraph_msgs', 'std_srvs'),
    *(f'{kind}_msgs' for kind in ('diagnostic', 'geometry', 'nav', 'sensor', 'std')),
}

#: Folders of a package whose modules may speak ROS.
ROS_FOLDERS = {'nodes', 'ros'}

ROS_MODULES = {'rclpy', 'builtin_interfaces', 'std_srvs', 'ament_index_python', 'rpyutils'}


def is_ros(module: str) -> bool:
    """Tell whether a top-level module is part of ROS 2."""
    return (
        module in ROS_MODULES
        or module.endswith(('_msgs', '_interfaces'))
        or module.startswith(('rosidl', 'rcl_', 'rmw', 'tf2', 'ros2'))
    )


def is_launch(module: str) -> bool:
    """Tell whether a top-level module belongs to the launch system."""
    return module == 'launch' or module.startswith('launch_')


def imports(path: Path, package_root: Path) -> set[str]:
    """Top-level modules that a file imports anywhere, also inside functions.

    A relative import is resolved: one that leaves its package would name a module outside it.
    """
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'), str(path))):
        if isinstance(node, ast.Import):
            found.update(alias.name.partition('.')[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            found.add(node.module.partition('.')[0])
        elif isinstance(node, ast.ImportFrom):
            parents = path.relative_to(package_root).parts[: -node.level]
            found.add(parents[0] if parents else f'{"." * node.level}{node.module or ""}')
        elif (
            isinstance(node, ast.Call)
            and getattr(node.func, 'id', getattr(node.func, 'attr', None))
            in ('import_module', '__import__')
            and node.args
            and isinstance(node.args[0], ast.Constant)
        ):
            found.add(str(node.args[0].value).partition('.')[0])
    return found


def violations(sources: Path) -> list[str]:
    """One sentence for each import under ``sources`` that the architecture forbids."""
    found = []
    for package, allowed in MAY_IMPORT.items():
        root = sources / package
        for path in sorted(root.rglob('*.py')):
            place = path.relative_to(root).parts
            is_test = place[0] == 'test'
            for module in sorted(imports(path, root)):
                name = path.relative_to(sources)
                if module in MAY_IMPORT and module != package and module not in allowed:
                    found.append(f'{name}: {package} must not import {module}')
                if is_launch(module) and not (place[0] == 'launch' or is_test):
                    found.append(f'{name}: only launch files import {module}')
                is_named = place[0] == 'launch' and module.endswith('_msgs')
                speaks = ROS_FOLDERS & set(place[1:-1]) or is_named or is_test
                if is_ros(module) and not speaks:
                    found.append(f'{name}: only nodes/ and ros/ import {module}')
    return found


def modules(sources: Path) -> dict[str, set[str]]:
    """Modules of the packages by dotted name, with those that each imports, also in functions."""
    paths = {}
    for package in MAY_IMPORT:
        root = sources / package
        for path in (root / package).rglob('*.py'):
            name = '.'.join(path.relative_to(root).with_suffix('').parts)
            paths[name.removesuffix('.__init__')] = path
    found = {}
    for name, path in paths.items():
        found[name] = set()
        for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'), str(path))):
            if isinstance(node, ast.ImportFrom):
                named = {f'{node.module}.{alias.name}' for alias in node.names}
                found[name] |= {one if one in paths else node.module for one in named}
            elif isinstance(node, ast.Import):
                found[name] |= {alias.name for alias in node.names}
        found[name] &= paths.keys()
    return found


def circle(found: dict[str, set[str]]) -> list[str]:
    """Modules that import each other in a circle; none if there is no such circle."""
    try:
        graphlib.TopologicalSorter(found).prepare()
    except graphlib.CycleError as error:
        return error.args[1]
    return []


def climbs(found: dict[str, set[str]]) -> list[str]:
    """One sentence for each import between rooms of a package that goes up or sideways."""
    floor = {
        (package, room): number
        for package, floors in FLOORS.items()
        for number, rooms in enumerate(floors)
        for room in rooms
    }
    said = []
    for name, imported in sorted(found.items()):
        for other in sorted(imported):
            one, two = (tuple(f'{module}..'.split('.')[:2]) for module in (name, other))
            within = one[0] == two[0] and one[0] in FLOORS and one[1] != two[1]
            if within and one[1] and two[1] and floor[two] >= floor[one]:
                said.append(f'{name} must not import {other}: it is no floor below')
    return said


def test_no_import_goes_round_in_a_circle():
    assert circle(modules(SOURCES)) == []


def test_rooms_import_from_the_floors_below():
    found = modules(SOURCES)
    for package, floors in FLOORS.items():
        inside = {name.split('.')[1] for name in found if name.startswith(f'{package}.')}
        assert inside == {room for floor in floors for room in floor}
    assert climbs(found) == []


@pytest.mark.parametrize(
    ('one', 'other', 'is_climb'),
    [
        ('ocean/a.py', 'plant/b.py', True),
        ('onboard/a.py', 'plant/b.py', True),
        ('ocean/a.py', 'ocean/b.py', False),
        ('ocean/fields/a.py', 'ocean/b.py', False),
    ],
)
def test_circles_and_climbs_are_found(tmp_path, one, other, is_climb):
    """Also where the import stands in a function."""
    for path, imported in ((one, other), (other, one)):
        file = tmp_path / 'glider_model' / 'glider_model' / path
        file.parent.mkdir(parents=True, exist_ok=True)
        package, _, leaf = imported.removesuffix('.py').replace('/', '.').rpartition('.')
        file.write_text(f'def f():\n    from glider_model.{package} import {leaf}\n')
    found = modules(tmp_path)
    assert len(set(circle(found))) == 2
    assert bool(climbs(found)) == is_climb


# ---------------------------------------------------------------------- sizes

#: Modules that a folder may hold, and lines of a function.
MOST_MODULES, MOST_LINES = 12, 80


def crowded(sources: Path) -> list[str]:
    """One sentence for each folder with too many modules, and each function that is too long.

    A long function may say why in a comment ``# long: ...`` in the line above it.
    """
    said = []
    for init in sorted(sources.glob('*/glider_*/**/__init__.py')):
        count = len(list(init.parent.glob('*.py'))) - 1
        if count > MOST_MODULES:
            said.append(f'{init.parent.relative_to(sources)}: {count} modules')
    for path in sorted(sources.glob('*/glider_*/**/*.py')):
        text = path.read_text(encoding='utf-8')
        lines = text.splitlines()
        for node in ast.walk(ast.parse(text, str(path))):
            if not isinstance(node, ast.FunctionDef):
                continue
            first = min([node.lineno, *(one.lineno for one in node.decorator_list)])
            length = node.end_lineno - first + 1
            if length > MOST_LINES and not lines[first - 2].lstrip().startswith('# long: '):
                said.append(f'{path.relative_to(sources)}: {node.name} has {length} lines')
    return said


def test_folders_and_functions_stay_small():
    assert crowded(SOURCES) == []


def test_what_is_crowded_is_found(tmp_path):
    folder = tmp_path / 'glider_model' / 'glider_model' / 'room'
    folder.mkdir(parents=True)
    for name in ('__init__', *(f'module_{number}' for number in range(MOST_MODULES))):
        (folder / f'{name}.py').write_text('')
    body = '    pass\n' * MOST_LINES
    (folder / 'module_0.py').write_text(f'def short():\n{body[9:]}')
    assert crowded(tmp_path) == []
    (folder / 'module_1.py').write_text(f'# long: it is a table\ndef long():\n{body}')
    assert crowded(tmp_path) == []
    (folder / 'module_2.py').write_text(f'@one\ndef long():\n{body[9:]}')
    (folder / 'one_more.py').write_text('')
    assert crowded(tmp_path) == [
        f'glider_model/glider_model/room: {MOST_MODULES + 1} modules',
        f'glider_model/glider_model/room/module_2.py: long has {MOST_LINES + 1} lines',
    ]


#: What the adaptive law is made of, and how many lines and numbers it may have.
LAW = (
    'glider_control/glider_control/laws/adaptive.py',
    'glider_control/glider_control/surfaces/fin.py',
    'glider_guidance/glider_guidance/methods/los_current.py',
    'glider_model/glider_model/onboard/learnt_steering.py',
)
LAW_LINES, LAW_NUMBERS, KERNEL_LINES = 650, 45, 60
#: What may stand in its functions without a name: powers, derivatives, per 1000 s.
PLAIN = {0.0, 1.0, 2.0, 3.0, 4.0, 1000.0}


def numbers(tree: ast.Module) -> list[str]:
    """Names of the constants of a module, and of the fields of settings in it."""
    found = []
    for node in tree.body:
        if isinstance(node, ast.Assign):
            found += [one.id for one in ast.walk(node.targets[0]) if isinstance(one, ast.Name)]
    for node in ast.walk(tree):
        if isinstance(node, ast.AnnAssign) and isinstance(node.value, ast.Call):
            if getattr(node.value.func, 'id', '') in ('number', 'positive'):
                found.append(node.target.id)
    return found


def test_the_adaptive_law_goes_into_one_head():
    texts = [(SOURCES / name).read_text(encoding='utf-8') for name in LAW]
    trees = [ast.parse(text) for text in texts]
    assert sum(text.count('\n') for text in texts) <= LAW_LINES
    named = [name for tree in trees for name in numbers(tree)]
    assert {'INTEGRAL_MAX', 'MOST_DEVIATIONS', 'build_up_s', 'kp', 'prior_radps'} <= set(named)
    assert len(named) <= LAW_NUMBERS
    for node in (node for tree in trees for node in ast.walk(tree)):
        if isinstance(node, ast.FunctionDef):
            assert node.end_lineno - node.lineno < KERNEL_LINES, node.name
            inner = [one.value for one in ast.walk(node) if isinstance(one, ast.Constant)]
            assert PLAIN.issuperset(one for one in inner if isinstance(one, float)), node.name


# ---------------------------------------------------------------------- the map

MAP = SOURCES.parent / 'docs' / 'architecture.md'
MAP_BEGIN = '<!-- folders: made by ./glider python test/test_architecture.py -->\n'
MAP_END = '<!-- end of folders -->\n'


def rooms() -> str:
    """The table of rooms: each folder with the sentence of its docstring."""
    rows = ['| folder | what belongs there |', '|---|---|']
    for package in MAY_IMPORT:
        for init in sorted((SOURCES / package / package).rglob('__init__.py')):
            folder = init.parent.relative_to(SOURCES / package)
            docstring = ast.get_docstring(ast.parse(init.read_text(encoding='utf-8')))
            rows.append(f'| `{folder}` | {docstring.partition(chr(10))[0]} |')
    return '\n'.join(rows) + '\n'


def test_the_map_of_rooms_is_that_of_the_tree():
    text = MAP.read_text(encoding='utf-8')
    assert text.partition(MAP_BEGIN)[2].partition(MAP_END)[0] == rooms()


def test_the_map_names_files_that_are_there():
    text = MAP.read_text(encoding='utf-8')
    named = re.findall(r'`((?:[a-z_]+/)+[a-z_]*(?:\.py)?|[a-z_]+\.py)`', text)
    known = [str(path.relative_to(SOURCES)) for path in SOURCES.rglob('*')]
    known += [
        str(path.relative_to(SOURCES.parent)) for path in (SOURCES.parent / 'test').iterdir()
    ]
    known += PORTS  # a topic with a slash looks like a file
    lost = [name for name in named if not any(one.endswith(name.rstrip('/')) for one in known)]
    assert len(named) > 30
    assert lost == []


def test_every_package_is_checked():
    """A package that is not in the table would escape the rules."""
    assert {path.parent.name for path in SOURCES.glob('*/package.xml')} == set(MAY_IMPORT)


def test_a_change_in_any_package_makes_compiled_kernels_anew():
    assert set(PACKAGES) == set(MAY_IMPORT)


@pytest.mark.parametrize('package', MAY_IMPORT)
def test_every_folder_with_modules_is_installed(package):
    """Setuptools finds folders by their __init__.py; without, only a symlinked build has them."""
    folders = {path.parent for path in (SOURCES / package / package).rglob('*.py')}
    assert [path for path in folders if not (path / '__init__.py').is_file()] == []


def test_imports_follow_the_architecture():
    found = violations(SOURCES)
    assert not found, '\n' + '\n'.join(found)


@pytest.mark.parametrize(
    ('path', 'source', 'sentence'),
    [
        ('glider_model/glider_model/plant/plant.py', 'import rclpy', 'only nodes/ and ros/'),
        ('glider_model/glider_model/a.py', 'from nav_msgs.msg import Odometry', 'nav_msgs'),
        ('glider_model/glider_model/a.py', 'def f():\n    import std_srvs.srv', 'std_srvs'),
        ('glider_model/glider_model/a.py', 'from builtin_interfaces.msg import Time', 'builtin'),
        ('glider_model/glider_model/a.py', 'from rosidl_runtime_py import convert', 'rosidl'),
        ('glider_model/glider_model/nodes_.py', 'import rclpy', 'rclpy'),
        ('glider_bringup/launch/a.launch.py', 'import rclpy', 'only nodes/ and ros/'),
        ('glider_bringup/glider_bringup/a.py', 'import launch_ros', 'only launch files'),
        (
            'glider_model/glider_model/a.py',
            'import glider_bringup.scoring.score',
            'glider_bringup',
        ),
        ('glider_model/test/test_a.py', 'import glider_control', 'glider_control'),
        ('glider_guidance/glider_guidance/a.py', 'from glider_control import pid', 'control'),
        ('glider_control/glider_control/a.py', 'import glider_guidance.los', 'guidance'),
        ('glider_guidance/glider_guidance/a.py', 'import glider_navigation.phase', 'navigation'),
        ('glider_navigation/glider_navigation/a.py', 'import glider_guidance.los', 'guidance'),
        ('glider_navigation/glider_navigation/a.py', 'import rclpy', 'only nodes/ and ros/'),
        ('glider_control/glider_control/a.py', 'from glider_bringup import runner', 'bringup'),
        (
            'glider_control/glider_control/a.py',
            "import importlib\nimportlib.import_module('glider_guidance.los')",
            'guidance',
        ),
    ],
)
def test_a_violation_is_found(tmp_path, path, source, sentence):
    file = tmp_path / path
    file.parent.mkdir(parents=True)
    file.write_text(source + '\n')
    found = violations(tmp_path)
    assert len(found) == 1
    assert path in found[0]
    assert sentence in found[0]


@pytest.mark.parametrize(
    ('path', 'source'),
    [
        (
            'glider_model/glider_model/nodes/plant_node.py',
            'import rclpy, glider_model.plant.plant',
        ),
        ('glider_base/glider_base/ros/wire/topics.py', 'from nav_msgs.msg import Odometry'),
        ('glider_guidance/glider_guidance/los.py', 'from glider_base.frames import wrap'),
        ('glider_control/glider_control/pid.py', 'from . import allocation'),
        (
            'glider_bringup/glider_bringup/engines/direct.py',
            'import glider_control, glider_guidance',
        ),
        ('glider_bringup/launch/glider.launch.py', 'import launch, launch_ros.actions'),
        ('glider_bringup/launch/glider.launch.py', 'import lifecycle_msgs.msg'),
        ('glider_model/test/test_messages.py', 'from nav_msgs.msg import Odometry'),
    ],
)
def test_what_the_architecture_allows_is_accepted(tmp_path, path, source):
    file = tmp_path / path
    file.parent.mkdir(parents=True)
    file.write_text(source + '\n')
    assert violations(tmp_path) == []


# ---------------------------------------------------------------------- dependencies


def declared(package: str) -> set[str]:
    """Keys that a package.xml asks rosdep for, those of tests left out."""
    root = ElementTree.parse(SOURCES / package / 'package.xml').getroot()
    return {item.text for item in root if item.tag in ('depend', 'exec_depend')}


def needed(package: str) -> set[str]:
    """Top-level modules that a package and its launch files import, less the standard library."""
    root = SOURCES / package
    paths = [*(root / package).rglob('*.py'), *(root / 'launch').glob('*.py')]
    return set().union(*(imports(path, root) for path in paths)) - sys.stdlib_module_names


@pytest.mark.parametrize('package', MAY_IMPORT)
def test_package_declares_what_it_imports(package):
    modules = needed(package) - {package}.union(*OPTIONAL.values())
    keys = {ROSDEP_KEYS.get(module, module) for module in modules - ONLY_PIP}
    assert keys - declared(package) == set(), 'missing in package.xml'


@pytest.mark.parametrize('package', MAY_IMPORT)
def test_rosdep_knows_what_a_package_declares(package):
    root = ElementTree.parse(SOURCES / package / 'package.xml').getroot()
    keys = {item.text for item in root if item.tag.endswith('depend')}
    assert keys - {*ROSDEP_KEYS.values(), *JAZZY, *MAY_IMPORT} == set(), 'look it up, note it here'


def test_what_only_pip_has_is_pinned():
    text = (SOURCES.parent / 'requirements.txt').read_text(encoding='utf-8')
    pinned = set(re.findall(r'^(\w[\w-]*)==', text, re.MULTILINE))
    used = set().union(*(needed(package) for package in MAY_IMPORT))
    assert {PYPI_NAMES.get(module, module) for module in used & ONLY_PIP} <= pinned
    assert 'pydantic' in pinned  # noble has 1.10, this needs 2


@pytest.mark.parametrize('file', OPTIONAL)
def test_what_only_some_commands_need_is_pinned(file):
    text = (SOURCES.parent / file).read_text(encoding='utf-8')
    assert OPTIONAL[file] <= set(re.findall(r'^(\w[\w-]*)==', text, re.MULTILINE))


if __name__ == '__main__':
    before, _, rest = MAP.read_text(encoding='utf-8').partition(MAP_BEGIN)
    MAP.write_text(before + MAP_BEGIN + rooms() + MAP_END + rest.partition(MAP_END)[2], 'utf-8')
