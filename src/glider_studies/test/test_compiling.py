# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Loops of a law, a method and a way to navigate: what they are compiled for, and when."""

import numba
import pytest

from glider_base.errors import ConfigurationError
from glider_bringup.engines import direct
from glider_bringup.engines.compiling import compile_loops, shown_once
from glider_bringup.engines.flight import mission_of
from glider_control.laws.pid import PidSettings
from glider_mission.choices import Combination, combination_of
from glider_mission.scenario import load_scenario, scenario_names
from glider_studies import workers


def types_of(scenario):
    blocks = zip(*mission_of(scenario), strict=True)
    return tuple(tuple(map(numba.typeof, block)) for block in blocks)


@pytest.fixture
def flown(monkeypatch):
    """Types of state and parameters, and rows, of each loop that is called; none is compiled.

    What another test had compiled in this process would look as if it had been here.
    """
    loops = []

    def fly_nothing(blocks, log, halts, dt):
        kinds = (block.field_dict.values() for block in numba.typeof(blocks).field_dict.values())
        loops.append((tuple(map(tuple, kinds)), len(log)))
        return 0, False

    monkeypatch.setattr(direct, 'fly_held', fly_nothing)
    return loops


def test_loop_depends_on_law_and_methods_alone():
    """Else something is compiled of which nobody is told; of water from a file who flies is."""
    chosen = [
        ('adaptive', 'los_current', 'known'),
        ('pid', 'los_current', 'dead_reckoned'),
        ('pid', 'los_zhang2021', 'known'),
        ('pid', 'los_zhang2021', 'dead_reckoned'),
    ]
    found = {}
    for law, method, navigation in chosen:
        changes = {
            'control.law': law,
            'guidance.los.method': method,
            'navigation.method': navigation,
        }
        scenarios = [load_scenario(name, changes) for name in scenario_names()]
        for one in (one for one in scenarios if one.current.field is None):
            found.setdefault(combination_of(one), set()).add(types_of(one))
        assert {one[:4] for one in found} >= {(law, method, navigation, False)}
    assert {one.steered for one in found} == {'', 'slocum_g2'}
    assert len(found) == 2 * len(chosen)
    assert [len(types) for types in found.values()] == [1] * len(found)
    assert len(set.union(*found.values())) == len(found)


def test_line_names_law_and_method():
    lines = []
    with shown_once(Combination('pid', 'los_zhang2021'), lines.append):
        numba.njit(lambda x: x + 1.0)(1.0)
    (line,) = lines
    assert 'law pid with method los_zhang2021' in line
    with shown_once(Combination('pid', 'los_zhang2021', steered='slocum_g2'), lines.append):
        numba.njit(lambda x: x + 2.0)(1.0)
    assert 'vehicle slocum_g2' in lines[-1]


def test_loops_are_there_before_workers_start(flown, monkeypatch):
    class StartedError(Exception):
        """Workers would be started now."""

    def start(*_):
        raise StartedError

    monkeypatch.setattr(workers, '_local_cluster', start)
    scenario = load_scenario(changes={'control.law': 'pid'})
    with (
        pytest.raises(StartedError),
        workers.worker_pool(1, None, [scenario] * 2),
    ):
        pass
    assert flown == [(types_of(scenario), 0)]


def test_a_law_that_refuses_its_vehicle_is_told_by_its_flights(monkeypatch):
    def params(self, vehicle, bank):
        return (bank.limit / vehicle.volume.value,)  # zhang2021 has no volume

    monkeypatch.setattr(PidSettings, 'params', params)
    scenario = load_scenario(changes={'control.law': 'pid'})
    compile_loops([scenario], pytest.fail)
    with pytest.raises(ConfigurationError, match='control.law: params: .*test_compiling.py'):
        mission_of(scenario)


@pytest.mark.parametrize('name', ['slocum_shelf', 'eddies_10d'])
def test_the_loop_of_a_vehicle_for_shallow_water_or_of_a_sea_is_compiled_too(flown, name):
    scenario = load_scenario(name)
    compile_loops([scenario, load_scenario(name)], lambda line: None)
    assert flown == [(types_of(scenario), 0)]
