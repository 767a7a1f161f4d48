# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""``./glider test --only soak``, in little."""

import json
import subprocess
import sys
from pathlib import Path

from glider_bringup.engines.memory import growth_mb_per_h
from glider_bringup.engines.processes import process_modules


def test_soak_counts_ticks_looks_at_memory_and_verifies(tmp_path):
    command = [sys.executable, Path(__file__).with_name('soak.py'), 'current_8deg', '--json']
    command += ['--duration', '100', '--out', tmp_path / 'run']
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert (result['status'], result['ticks'], result['ticks_lost']) == ('completed', 1000, 0)
    assert (result['messages_lost'], result['verify']) == (0, 'identical')
    processes = set(process_modules('together'))
    assert set(result['rss_mb']) == set(result['growth_mb_per_h']) == processes
    assert min(result['rss_mb'].values()) > 30.0


def test_growth_is_the_slope_once_settled():
    line = [(h / 10.0, 100.0 + 0.5 * h / 10.0) for h in range(300)]
    warming_up = [(h / 10.0, 50.0 + h) for h in range(50)]
    assert abs(growth_mb_per_h(line) - 0.5) < 1e-9
    assert abs(growth_mb_per_h(warming_up + line[50:]) - 0.5) < 1e-9
    assert growth_mb_per_h(line[:1]) == 0.0
