# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Compiled code that several processes keep at the same time."""

import os
import subprocess
import sys

import pytest

#: A kernel in a file of its own.
KERNEL = """
from glider_model.base.kernel import kernel

@kernel
def doubled(number):
    return number + number
"""
#: Compiles it for a type, and takes its time between looking for a free name and taking it.
COMPILE = """
import sys, time
from numba.core.caching import IndexDataCacheFile
from doubling import doubled

save = IndexDataCacheFile._save_index

def save_late(self, overloads):
    time.sleep(2.0)
    save(self, overloads)

IndexDataCacheFile._save_index = save_late
doubled(eval(sys.argv[1]))
"""
#: What a later process finds.
FIND = """
from doubling import doubled

print(doubled(3), doubled(0.25), sum(doubled.stats.cache_misses.values()))
"""


@pytest.fixture
def start(tmp_path):
    """Start a program that has the kernel, with a cache of its own."""
    (tmp_path / 'doubling.py').write_text(KERNEL)
    env = {name: value for name, value in os.environ.items() if name != 'NUMBA_CACHE_DIR'}
    env['PYTHONPATH'] = os.pathsep.join([str(tmp_path), env.get('PYTHONPATH', '')])
    env['GLIDER_CACHE'] = str(tmp_path / 'cache')

    def run(program: str, *arguments: str) -> subprocess.Popen:
        command = [sys.executable, '-c', program, *arguments]
        return subprocess.Popen(command, env=env, stdout=subprocess.PIPE, text=True)

    return run


def test_processes_that_compile_for_different_types_do_not_get_each_others_code(start):
    both = [start(COMPILE, number) for number in ('3', '0.25')]
    assert [one.wait(60.0) for one in both] == [0, 0]
    found, _ = start(FIND).communicate(timeout=60.0)
    assert found.split() == ['6', '0.5', '0']
