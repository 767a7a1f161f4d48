# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What a process compiled the next one finds, unless it cannot tell the types again."""

import subprocess
import sys

PROGRAM = """
from numba.core import event

with event.install_recorder('numba:compile') as compiled:
    import glider_bringup as glider

    for name in 'current_8deg', 'seaglider_1000m', 'slocum_shelf':
        glider.fly(name, {'duration_s': 30.0})
print([one.data['dispatcher'].py_func.__name__ for _, one in compiled.buffer if one.is_start])
"""


def test_a_second_process_compiles_nothing():
    command = [sys.executable, '-c', PROGRAM]
    _, second = (subprocess.run(command, stdout=subprocess.PIPE, text=True) for _ in range(2))
    assert second.returncode == 0
    assert second.stdout.splitlines()[-1] == '[]'
