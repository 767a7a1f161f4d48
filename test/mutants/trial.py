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
from collections.abc import Iterator

import hypothesis
import numba  # noqa: F401 what takes long to load is loaded once
import numpy as np
import pytest
import scipy.optimize  # noqa: F401

from mutants.changes import Change, mutated

#: A test that takes longer (s), not compiled, is left out; with a change it has so long, and a
#: flight so long.
SLOW_S, HANGS_S, FLIES_S = 2.0, 20.0, 90.0
#: The flights: yos to this depth (m), for so long (s), in which every stage comes.
FLIGHT = {'dives': 0, 'duration_s': 400.0, 'profile.depth_m': 12.0}
#: One without a position under water, which comes up after each dive and hears where it is.
RECKONED = {
    **{'dives': 0, 'duration_s': 1060.0, 'profile.depth_m': 20.0, 'profile.prepare_s': 10.0},
    **{'profile.surface_every_dives': 1, 'profile.wait_s': 60.0, 'sensors.gps_first_fix_s': 10.0},
    **{'navigation.method': 'dead_reckoned'},
}
#: Orders of every kind.
ORDERS = [
    {'at_s': 60.0, 'depth_m': 10.0, 'pitch_deg': 25.0, 'wait_s': 20.0},
    {'at_s': 62.0, 'path': {'kind': 'straight', 'course_deg': 90.0, 'length_m': 500.0}},
    {'at_s': 150.0, 'hold': True},
    {'at_s': 220.0, 'resume': True},
    {'at_s': 340.0, 'abort': True},
]
#: Orders on the way, and at the end of a path: another path, which ends behind the vehicle.
SURFACE_ORDERS = [
    {'at_s': 20.0, 'hold': True},
    {'at_s': 60.0, 'resume': True},
    {'at_s': 100.0, 'depth_m': 11.0},
    {
        'at_s': 430.0,
        'path': {'kind': 'waypoints', 'waypoints': [[-900.0, 0.0], [-500.0, 0.0], [-300.0, 20.0]]},
    },
]
#: Every sample, for three seconds.
ALL = {'share': 1.0, 'for_s': 3.0}
#: A current that falls to 1/e within so much depth (m).
SHEAR = {'kind': 'shear', 'law': 'exponential', 'depth_m': 5.0}
#: Flights by their names: a scenario, and what is changed in it.
FLIGHTS = {
    'adaptive': ('current_8deg', FLIGHT),
    'pid': (
        'current_8deg',
        {**FLIGHT, 'control.law': 'pid', 'guidance.los.method': 'los_zhang2021'},
    ),
    'backstepping': ('current_8deg', {**FLIGHT, 'control.law': 'backstepping'}),
    'alos': (
        'current_12deg',
        {**FLIGHT, 'guidance.los.method': 'alos', 'perturb.K_MY': 0.3},
    ),
    'fin': ('slocum_shelf', FLIGHT),
    'seaglider': ('seaglider_1000m', {**FLIGHT, 'profile.surface_every_dives': 1}),
    'rough': ('rough_water', {**FLIGHT, 'navigation.method': 'dead_reckoned'}),
    'survey': ('survey', FLIGHT),
    'helix': ('helix', {'dives': 0, 'duration_s': 400.0}),
    'end of the path': (
        'current_8deg',
        {**FLIGHT, 'path.length_m': 150.0, 'path.at_end': 'stop', 'profile.depth_m': 20.0},
    ),
    'end of the path against the current': (
        'current_8deg',
        {
            **{**FLIGHT, 'duration_s': 600.0, 'path.length_m': 300.0, 'path.at_end': 'stop'},
            **{'profile.depth_m': 20.0, 'current.speed_kn': 0.3, 'current.angle_deg': 180.0},
        },
    ),
    'faster than its file': (
        'current_8deg',
        {**FLIGHT, 'profile.depth_m': 20.0, 'perturb.K_D0': 0.5},
    ),
    'fixes': ('reckoned_12deg', RECKONED),
    'wild fixes': (
        'reckoned_12deg',
        {
            **RECKONED,
            'faults': [
                {'kind': 'spike', 'sensor': 'fix', 'error': 900.0, 'share': 0.3, 'at_s': 60.0}
            ],
        },
    ),
    'tide, few samples': (
        'reckoned_12deg',
        {
            **{**RECKONED, 'navigation.current': 'tidal', 'sensors.fix_missed_pattern': '010'},
            **{'sensors.imu_period_s': 4.0, 'sensors.gyro': False},
        },
    ),
    'forecast': (
        'reckoned_12deg',
        {
            **{**RECKONED, 'navigation.current': 'forecast'},
            **{'navigation.forecast.speed_mps': 0.3, 'navigation.forecast.direction_deg': 20.0},
            **{'navigation.forecast.share_std': 0.5},
            'navigation.forecast.components': [
                {'kind': 'tidal', 'speed_mps': 0.2, 'direction_deg': 300.0, 'period_s': 900.0},
                {**SHEAR, 'speed_mps': 0.1, 'direction_deg': 0.0},
            ],
        },
    ),
    'orders': (
        'current_8deg',
        {**FLIGHT, 'profile.prepare_s': 0.0, 'profile.top_depth_m': 5.0, 'orders': ORDERS},
    ),
    'roll mass that sticks': (
        'current_8deg',
        {**FLIGHT, 'faults': [{'kind': 'stuck', 'actuator': 'roll_mass', 'at_s': 80.0}]},
    ),
    'wild samples': (
        'current_8deg',
        {
            **FLIGHT,
            'faults': [
                {'kind': 'spike', 'sensor': 'depth', 'error': 30.0, 'share': 0.02, 'at_s': 60.0},
                {'kind': 'spike', 'sensor': 'heading', 'error': 90.0, 'share': 0.02, 'at_s': 60.0},
            ],
        },
    ),
    'hardly turns': ('current_8deg', {**FLIGHT, 'perturb.K_MY': 0.02, 'perturb.K_MR': 0.05}),
    'light': (
        'current_8deg',
        {**FLIGHT, 'profile.depth_m': 20.0, 'perturb.net_heaviness_kg': -0.25},
    ),
    'stall': (
        'seaglider_1000m',
        {
            **{**FLIGHT, 'duration_s': 600.0, 'navigation.method': 'known'},
            **{'profile.depth_m': 20.0, 'profile.pitch_deg': 29.4},
            **{'profile.net_heaviness_kg': 0.08, 'perturb.pitch_trim_m': -0.0071},
            **{
                'perturb.K_D0': 0.82,
                'perturb.K_D': 0.78,
                'perturb.K_L': 1.16,
                'perturb.K_M': 0.86,
            },
        },
    ),
    'fin, deeper': ('slocum_shelf', {**FLIGHT, 'duration_s': 700.0, 'profile.depth_m': 60.0}),
    'near the bottom': (
        'slocum_shelf',
        {
            **{**FLIGHT, 'duration_s': 600.0, 'profile.depth_m': 40.0},
            **{'water.bottom_m': 30.0, 'profile.clearance_m': 10.0},
        },
    ),
    'few samples': (
        'current_8deg',
        {**FLIGHT, 'sensors.imu_period_s': 0.5, 'sensors.gyro': False},
    ),
    'position is lost': (
        'current_8deg',
        {
            **FLIGHT,
            'faults': [
                {'kind': 'spike', 'sensor': 'position', 'error': 5e4, **ALL, 'at_s': 100.0},
                {'kind': 'spike', 'sensor': 'velocity', 'error': 50.0, **ALL, 'at_s': 200.0},
            ],
        },
    ),
    'no progress': (
        'current_8deg',
        {
            **{**FLIGHT, 'duration_s': 700.0, 'current.angle_deg': 180.0, 'current.speed_kn': 1.2},
            **{'path.length_m': 5000.0, 'path.at_end': 'stop', 'profile.wait_s': 20.0},
            **{'guidance.no_progress_surfacings': 1, 'profile.surface_every_dives': 1},
        },
    ),
    'orders at the surface': (
        'current_8deg',
        {
            **{**FLIGHT, 'duration_s': 600.0, 'path.length_m': 60.0, 'path.at_end': 'stop'},
            **{'profile.depth_m': 20.0, 'orders': SURFACE_ORDERS},
        },
    ),
    'by its weight': (
        'reckoned_12deg',
        {
            **{**RECKONED, 'duration_s': 2300.0, 'profile.wait_s': 1850.0},
            **{'navigation.dead_reckoned.speed_by': 'buoyancy', 'sensors.depth_offset_m': 4.0},
            **{'sensors.imu_period_s': 30.0, 'sensors.imu_missed_share': 0.5},
        },
    ),
    'fixes that contradict': (
        'reckoned_12deg',
        {
            **{**RECKONED, 'duration_s': 2000.0, 'profile.depth_m': 40.0},
            'profile.surface_every_dives': 2,
            'faults': [{'kind': 'biased', 'sensor': 'fix', 'error': 900.0, 'at_s': 700.0}],
        },
    ),
    'fixes set aside': (
        'reckoned_12deg',
        {
            **{**RECKONED, 'duration_s': 900.0},
            'faults': [
                {
                    **{'kind': 'spike', 'sensor': 'fix', 'error': 3000.0, 'share': 1.0},
                    **{'at_s': 300.0, 'for_s': 300.0},
                },
            ],
        },
    ),
}


#: What is disturbed after every so many ticks of a flight, so often, in which share of all its
#: numbers, for how many ticks it is flown on, and by which factors.
DISTURBED = ('navigation', 'guidance', 'control', 'guard')
EVERY, TIMES, SHARES, TICKS = 400, 10, (0.01, 0.05, 0.3), 3
FACTORS = (-1.0, 0.0, 0.5, 0.9, 1.1, 2.0, 10.0, 1000.0)


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


def digest_of(name: str) -> str:
    """Digest of all numbers of a flight, and of some ticks from states that are disturbed."""
    from glider_bringup.engines.flight import Held, mission_of
    from glider_mission.blocks import ROW
    from glider_mission.scenario import load_scenario

    scenario, fields = FLIGHTS[name]
    scenario = load_scenario(scenario, fields)
    held, params = Held(scenario), mission_of(scenario)[1]
    rng, digest = np.random.default_rng(len(name)), hashlib.sha256()
    log, is_over = np.empty((EVERY, ROW)), False
    while not is_over:
        rows, is_over = held.fly(log)
        digest.update(np.ascontiguousarray(log[:rows]).tobytes())
        for _ in range(TIMES):
            for part in _ticks_of(held.keep().mission, params, rng):
                digest.update(part)
    return digest.hexdigest()[:32]


def _ticks_of(state, params, rng) -> Iterator[bytes]:
    """Numbers of some ticks from a state with something else in it, and the state after them."""
    from glider_bringup.engines.direct import fly
    from glider_mission.blocks import ROW

    share, log = rng.choice(SHARES), np.zeros((TICKS, ROW))
    state = disturbed(state, share, rng, (bool, int, float))
    if rng.random() < 0.5:  # whole numbers there tell what is in an array
        params = disturbed(params, share, rng, (bool, float))
    try:
        after, rows, _ = fly(state, params, log)
    except (ArithmeticError, ValueError, IndexError) as error:
        yield type(error).__name__.encode()  # as plain Python has it where compiled code has NaN
        return
    for numbers in (log[:rows], np.array(list(_numbers(after)), dtype=float)):
        yield np.where(np.isnan(numbers), np.nan, numbers).tobytes()


def disturbed(mission, share: float, rng, kinds: tuple[type, ...]):
    """State or parameters of a mission with a share of their numbers of some kinds changed.

    Of all blocks but plant and current, which are no part of what is changed by `mutants`.
    """
    return mission._replace(
        **{name: _disturbed(getattr(mission, name), share, rng, kinds) for name in DISTURBED}
    )


def _disturbed(value, share, rng, kinds):
    if isinstance(value, tuple):
        parts = [_disturbed(one, share, rng, kinds) for one in value]
        return value._make(parts) if hasattr(value, '_make') else tuple(parts)
    if type(value) not in kinds or rng.random() > share:
        return value
    if isinstance(value, bool):
        return not value
    if isinstance(value, int):
        return int(rng.integers(0, 8))
    if value == 0.0:
        return float(rng.normal())
    return value * float(rng.choice(FACTORS))


def _numbers(value) -> Iterator[float]:
    """All numbers of a state, one after another."""
    if isinstance(value, tuple | np.ndarray):
        for one in value:
            yield from _numbers(one)
    else:
        yield value


def judge(asked: dict) -> dict:
    """What became of a change: noticed by tests, by flights, or by nothing.

    With no change: how long the tests take, and what the flights are, if `fly`.
    """
    np.seterr(all='ignore')
    if asked['change'] is None:
        _, times = run_tests(asked['tests'], {})
        return {
            'times': times,
            'flights': [*map(digest_of, FLIGHTS)] if asked.get('fly', True) else [],
        }
    sys.meta_path.insert(0, _Loader(Change(*asked['change'])))
    try:
        fails, _ = run_tests(asked['tests'], asked['times'])
        if fails:
            return {'by': 'tests'}
        for name, before in zip(FLIGHTS, asked['flights'], strict=True):
            signal.setitimer(signal.ITIMER_REAL, FLIES_S)
            if digest_of(name) != before:
                return {'by': 'flights'}
        return {'by': ''}
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
