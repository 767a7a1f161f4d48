# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Compiled code that is kept: by several processes at a time, and until it is stale."""

import os
import subprocess
import sys

import pytest

from glider_base.kernels import cache as kernel_cache

#: A kernel in a file of its own.
KERNEL = """
from glider_base.kernel import kernel

@kernel
def doubled(number):
    return number + number
"""
#: Compiles it for a type, and takes its time between writing what is kept and giving it its name.
COMPILE = """
import sys, time
from pathlib import Path
from doubling import doubled

replace = Path.replace

def replace_late(self, target):
    time.sleep(2.0)
    return replace(self, target)

Path.replace = replace_late
doubled(eval(sys.argv[1]))
"""
#: What a later process finds, and whether it has loaded what numba compiles with.
FIND = """
import sys
from doubling import doubled

print(doubled(3), doubled(0.25), sum(doubled.stats.cache_misses.values()))
print('numba.np.linalg' in sys.modules)
"""


@pytest.fixture
def start(tmp_path):
    """Start a program that has the kernel, with a cache of its own."""
    (tmp_path / 'doubling.py').write_text(KERNEL)
    env = dict(os.environ)
    env['PYTHONPATH'] = os.pathsep.join([str(tmp_path), env.get('PYTHONPATH', '')])
    env['GLIDER_CACHE'] = str(tmp_path / 'cache')

    def run(program: str, *arguments: str) -> subprocess.Popen:
        command = [sys.executable, '-c', program, *arguments]
        return subprocess.Popen(command, env=env, stdout=subprocess.PIPE, text=True)

    return run


def test_processes_that_compile_for_different_types_do_not_get_each_others_code(start):
    both = [start(COMPILE, number) for number in ('3', '0.25')]
    assert [one.wait(60.0) for one in both] == [0, 0]
    found, _ = start(FIND).communicate(timeout=300.0)
    assert found.split() == ['6', '0.5', '0', 'False']


@pytest.mark.parametrize('left', [0, 0.5])
def test_what_a_crash_has_cut_is_compiled_once_more(start, tmp_path, left):
    assert start(FIND).wait(300.0) == 0
    for path in (tmp_path / 'cache').rglob('doubled.*'):
        os.truncate(path, int(left * path.stat().st_size))
    for misses in ('2', '0'):
        found, _ = start(FIND).communicate(timeout=300.0)
        assert found.split()[:3] == ['6', '0.5', misses]


#: Modules of a package: one kernel calls another's, one a slot that is filled elsewhere.
PARTS = {
    'low': """
from glider_base.kernel import kernel

@kernel
def low(x):
    return x + 1.0
""",
    'high': """
from glider_base.kernel import kernel
from parts.low import low

@kernel
def high(x):
    return 2.0 * low(x)
""",
    'other': """
from glider_base.kernel import kernel

@kernel
def other(x):
    return x - 1.0
""",
    'hole': """
from glider_base.kernel import kernel
from glider_base.slot import slot

@slot
def law(x, params):
    \"\"\"What a law makes of x.\"\"\"

@kernel
def flown(x, params):
    return law(x, params)
""",
    'laws': """
from typing import NamedTuple
from glider_base.kernel import kernel
from parts.factor import FACTOR
from parts.hole import law

class Params(NamedTuple):
    gain: float

class Others(NamedTuple):
    gain: float

@law.body(Params)
@kernel
def scaled(x, params):
    return FACTOR * params.gain * x
""",
    'factor': 'FACTOR = 3.0\n',
    'box': """
from numba.core import types
from numba.experimental import structref
from glider_base.kernel import kernel
from parts.hole import flown

@structref.register
class BoxType(types.StructRef):
    pass

class Box(structref.StructRefProxy):
    pass

structref.define_proxy(Box, BoxType, ['params'])

@kernel
def put(params):
    return Box(params)

@kernel
def flown_by(box, x):
    return flown(x, box.params)
""",
    'unused': """
from parts.hole import law
from parts.laws import Others
from glider_base.kernel import kernel

@law.body(Others)
@kernel
def nothing(x, params):
    return 0.0 * x
""",
}
CALL = """
from parts.box import flown_by, put
from parts.high import high
from parts.hole import flown
from parts.laws import Params
from parts.other import other

params = Params(2.0)
calls = (high, (1.0,)), (flown, (1.0, params)), (other, (1.0,)), (flown_by, (put(params), 1.0))
for one, values in calls:
    print(one(*values), sum(one.stats.cache_misses.values()))
"""


@pytest.fixture
def package(tmp_path):
    """A package in a folder of its own, and what its kernels answer and have compiled there."""

    class Package:
        def write(self, folder: str, **changed: str) -> None:
            (tmp_path / folder / 'parts').mkdir(parents=True, exist_ok=True)
            for name, text in {'__init__': '', **PARTS, **changed}.items():
                (tmp_path / folder / 'parts' / f'{name}.py').write_text(text)

        def call(
            self, folder: str, program: str = CALL, cache: str = str(tmp_path / 'cache')
        ) -> list[tuple[float, int]]:
            env = dict(os.environ, GLIDER_CACHE=cache)
            env['PYTHONDONTWRITEBYTECODE'] = '1'  # what is written within a second looks the same
            path = [str(tmp_path / folder), env.get('PYTHONPATH', '')]
            env['PYTHONPATH'] = os.pathsep.join(path)
            command = [sys.executable, '-c', program]
            done = subprocess.run(command, env=env, stdout=subprocess.PIPE, text=True, check=True)
            words = [line.split() for line in done.stdout.splitlines()]
            return [(float(answer), int(misses)) for answer, misses in words]

    return Package()


def test_a_change_compiles_what_it_reaches_and_nothing_else(package):
    """A law is reached through the types of its params, and through what these are kept in."""
    package.write('here')
    assert package.call('here') == [(4.0, 1), (6.0, 1), (0.0, 1), (6.0, 1)]
    assert package.call('here') == [(4.0, 0), (6.0, 0), (0.0, 0), (6.0, 0)]
    package.write('here', low=PARTS['low'].replace('1.0', '5.0'))
    assert package.call('here') == [(12.0, 1), (6.0, 0), (0.0, 0), (6.0, 0)]
    package.write('here', factor='FACTOR = 4.0\n')
    assert package.call('here') == [(4.0, 0), (8.0, 1), (0.0, 0), (8.0, 1)]
    package.write('here', unused=PARTS['unused'].replace('0.0', '9.0'))
    assert package.call('here') == [(4.0, 0), (6.0, 0), (0.0, 0), (6.0, 0)]


#: A number of a file that is no Python.
READ = """
from pathlib import Path
FACTOR = float(Path(__file__).with_name('number.py').read_text())
"""


@pytest.mark.parametrize(
    'line',
    [
        'from .factor import FACTOR',
        'from . import factor; FACTOR = factor.FACTOR',
        'from parts import \\\n    factor\nFACTOR = factor.FACTOR',
        'try: from parts.factor import FACTOR\nexcept ImportError: FACTOR = 0.0',
        READ,
    ],
)
def test_a_change_is_compiled_however_it_is_imported_or_read(package, line):
    laws = PARTS['laws'].replace('from parts.factor import FACTOR', line)
    package.write('here', laws=laws, number='3.0')
    assert package.call('here') == [(4.0, 1), (6.0, 1), (0.0, 1), (6.0, 1)]
    assert package.call('here') == [(4.0, 0), (6.0, 0), (0.0, 0), (6.0, 0)]
    package.write('here', laws=laws, factor='FACTOR = 4.0\n', number='4.0')
    assert package.call('here') == [(4.0, 0), (8.0, 1), (0.0, 0), (8.0, 1)]


def test_an_installed_law_that_numba_alone_compiles_is_compiled_anew_when_it_changes(
    package, tmp_path
):
    laws = PARTS['laws'].replace('from parts.hole', 'from hole').replace('@kernel', '@numba.njit')
    laws = laws.replace('from glider_base.kernel import kernel', 'import numba')
    call = 'from hole import flown\nfrom parts.laws import Params\n'
    call += 'print(flown(1.0, Params(2.0)), sum(flown.stats.cache_misses.values()))'
    for factor, misses in ((3.0, 1), (3.0, 0), (4.0, 1)):
        package.write('site-packages', laws=laws, factor=f'FACTOR = {factor}\n')
        (tmp_path / 'site-packages' / 'hole.py').write_text(PARTS['hole'])
        assert package.call('site-packages', call) == [(2.0 * factor, misses)]


def test_another_checkout_finds_what_is_there(package):
    package.write('here')
    package.write('there')
    package.call('here')
    assert package.call('there') == [(4.0, 0), (6.0, 0), (0.0, 0), (6.0, 0)]


#: Three functions of one name, which differ in a number alone.
TWINS = """
from glider_base.kernel import kernel

def made(gain):
    @kernel
    def times(x):
        return gain * x
    return times

@kernel
def plus(x):
    return x + 1.0

both = plus, made(2.0), made(3.0)

@kernel
def plus(x):
    return x + 5.0
"""
ASK_TWINS = """
from parts.other import both, plus

for one in (*both, plus):
    print(one(1.0), sum(one.stats.cache_misses.values()))
"""


def test_functions_of_one_name_are_told_apart(package):
    package.write('here', other=TWINS)
    for misses in (1, 0):
        wanted = [(number, misses) for number in (2.0, 2.0, 3.0, 6.0)]
        assert package.call('here', ASK_TWINS) == wanted


#: An edit while a program runs: told of before and after it is imported.
EDITED = """
import importlib
from pathlib import Path
from parts import laws

def say(x):
    print(laws.made(x), sum(laws.made.stats.cache_misses.values()))

say(1.0)
path = Path(laws.__file__)
path.write_text(path.read_text().replace('* x', '* x * x'))
say(5)
importlib.reload(laws)
say(5)
"""


def test_an_edit_flies_when_it_is_imported_and_not_before(package):
    made = '\n@kernel\ndef made(x):\n    return scaled(x, Params(2.0))\n'
    package.write('here', laws=PARTS['laws'] + made)
    only = EDITED.partition('path =')[0]
    assert package.call('here', EDITED) == [(6.0, 1), (30.0, 2), (150.0, 1)]
    assert package.call('here', only.replace('1.0', '5')) == [(150.0, 1)]
    package.write('here', laws=PARTS['laws'] + made)
    assert package.call('here', only + 'say(5)') == [(6.0, 0), (30.0, 0)]


@pytest.mark.parametrize('place', ['/proc/none', '/dev/null'])
def test_what_can_be_kept_nowhere_is_compiled_and_that_is_said_once(package, capfd, place):
    package.write('here')
    wanted = [(4.0, 1), (6.0, 1), (0.0, 1), (6.0, 1)]
    assert package.call('here', cache=place) == wanted
    (line,) = capfd.readouterr().err.splitlines()
    assert line.startswith(f'compiled mathematics cannot be kept in {place}/kernels: ')
    assert 'GLIDER_CACHE' in line


def test_what_was_not_used_for_longest_is_forgotten_first(monkeypatch, tmp_path):
    monkeypatch.setenv('GLIDER_CACHE', str(tmp_path))
    inside = kernel_cache.folder() / 'parts.low'
    inside.mkdir(parents=True)
    for age, name in enumerate(('new', 'old')):
        (inside / name).write_bytes(bytes(100))
        os.utime(inside / name, (1e9 - age, 1e9 - age))
    kernel_cache.forget_old(200)
    assert len(list(inside.iterdir())) == 2
    kernel_cache.forget_old(199)
    assert [path.name for path in inside.iterdir()] == ['new']
