# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Tests and flights on a changed kernel: a process that forks one for each change it is given.

Nothing is compiled: to compile the tests of one change would take longer than to run them.
"""

import hashlib
import importlib.abc
import importlib.util
import json
import os
import signal
import sys
import time

import hypothesis
import numba  # noqa: F401 what takes long to load is loaded once
import numpy as np
import pytest
import scipy.optimize  # noqa: F401

from mutants.changes import Change, mutated

#: A test that takes longer (s), not compiled, is left out; with a change it has so long.
SLOW_S, HANGS_S = 2.0, 20.0
#: The flights: yos to this depth (m), for so long (s), in which every stage comes.
FLIGHT = {'dives': 0, 'duration_s': 400.0, 'profile.depth_m': 12.0}
FLIGHTS = (
    ('current_8deg', FLIGHT),
    ('current_8deg', {**FLIGHT, 'control.law': 'pid', 'guidance.los.method': 'los_zhang2021'}),
    ('current_12deg', {**FLIGHT, 'guidance.los.method': 'alos', 'perturb.K_MY': 0.3}),
    ('slocum_shelf', FLIGHT),
    ('seaglider_1000m', {**FLIGHT, 'profile.surface_every_dives': 1}),
    ('rough_water', {**FLIGHT, 'navigation.method': 'dead_reckoned'}),
    ('survey', FLIGHT),
    ('helix', {'dives': 0, 'duration_s': 400.0}),
)


class TooSlow(BaseException):
    """A test has taken too long."""


class Fastest:
    """Of pytest: tests that are fast, the fastest first, and how long each took (s)."""

    def __init__(self, known: dict[str, float]) -> None:
        self.known, self.took = known, {}

    def pytest_collection_modifyitems(self, items: list) -> None:
        """Those that are known, in order; all if none is."""
        if self.known:
            items[:] = sorted(
                (item for item in items if item.nodeid in self.known),
                key=lambda item: self.known[item.nodeid],
            )

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item, nextitem):
        """Run a test for so long and no longer."""

        def stop(*_):
            raise TooSlow(item.nodeid)

        signal.signal(signal.SIGALRM, stop)
        signal.setitimer(signal.ITIMER_REAL, HANGS_S if self.known else SLOW_S)
        begun = time.monotonic()
        try:
            return (yield)
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
            self.took[item.nodeid] = time.monotonic() - begun

    def pytest_runtest_logreport(self, report) -> None:
        """Forget a test that did not pass."""
        if report.failed or report.skipped:
            self.took[report.nodeid] = float('inf')


class _Loader(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    """Gives one module as it is after the change."""

    def __init__(self, change: Change) -> None:
        self._change = change

    def find_spec(self, name, path, target=None):
        if name == self._change.module:
            return importlib.util.spec_from_file_location(name, self._change.path, loader=self)
        return None

    def exec_module(self, module):
        code = compile(mutated(self._change), self._change.path, 'exec')
        exec(code, module.__dict__)


def run_tests(tests: str, known: dict[str, float]) -> tuple[bool, dict[str, float]]:
    """Whether a test of a folder fails, and how long (s) those took that passed."""
    hypothesis.settings.register_profile(
        'mutants', derandomize=True, deadline=None, database=None, max_examples=30
    )
    hypothesis.settings.load_profile('mutants')
    plugin = Fastest(known)
    words = ['-q', '-p', 'no:cacheprovider', '-p', 'no:faulthandler', *(['-x'] if known else [])]
    code = pytest.main([*words, tests], plugins=[plugin])
    times = {name: took for name, took in plugin.took.items() if took < SLOW_S}
    return code != pytest.ExitCode.OK, times


def fly_all() -> str:
    """Digest of all that is recorded of the flights, to the last bit."""
    from glider_base.signals import TICK_S
    from glider_bringup.engines.direct import fly
    from glider_bringup.engines.flight import mission_of
    from glider_mission.blocks import ROW
    from glider_mission.scenario import load_scenario

    digest = hashlib.sha256()
    for name, fields in FLIGHTS:
        state, params = mission_of(load_scenario(name, fields))
        log = np.empty((round(fields['duration_s'] / TICK_S), ROW))
        _, rows, _ = fly(state, params, log, TICK_S)
        digest.update(log[:rows].tobytes())
    return digest.hexdigest()


def judge(asked: dict) -> dict:
    """What became of a change: noticed by tests, by flights, or by nothing.

    With no change: how long the tests take, and what the flights are, if `fly`.
    """
    np.seterr(all='ignore')
    if asked['change'] is None:
        _, times = run_tests(asked['tests'], {})
        return {'times': times, 'flights': fly_all() if asked.get('fly', True) else None}
    sys.meta_path.insert(0, _Loader(Change(*asked['change'])))
    try:
        fails, _ = run_tests(asked['tests'], asked['times'])
        if fails:
            return {'by': 'tests'}
        signal.setitimer(signal.ITIMER_REAL, 10.0 * HANGS_S)
        return {'by': '' if fly_all() == asked['flights'] else 'flights'}
    except (Exception, TooSlow):
        return {'by': 'flights'}


def main() -> None:
    """Answer each line of standard input, which is JSON, by one of standard output."""
    for line in sys.stdin:
        reading, writing = os.pipe()
        child = os.fork()
        if not child:
            os.close(reading)
            quiet = os.open(os.devnull, os.O_RDWR)
            for stream in (0, 1, 2):
                os.dup2(quiet, stream)
            with os.fdopen(writing, 'w') as told:
                json.dump(judge(json.loads(line)), told)
            os._exit(0)
        os.close(writing)
        with os.fdopen(reading) as told:
            answer = told.read()
        os.waitpid(child, 0)
        print(answer or json.dumps({'by': 'tests'}), flush=True)


if __name__ == '__main__':
    main()
