# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What the tests of all packages have in common: pytest looks here from each of their folders."""

import gc
import signal
from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import settings

import command_line

gc.set_threshold(500_000)  # what is imported and compiled stays
# Started in the background by a script, tests inherit that Ctrl-C is ignored, and try it in vain.
signal.signal(signal.SIGINT, signal.default_int_handler)
# an example may wait for a compiler, or for a processor that others use
settings.register_profile('glider', deadline=None)
settings.load_profile('glider')


#: Files of tests that take longest, by name: they are begun first, those that start many processes
#: beside others that do not. Those of `FLIGHT` share a flight, and are run by one process.
FLIGHT = ('bag_readers', 'nodes_and_direct', 'report_page', 'verify_flights')
LONG = (
    *('tutorial', *FLIGHT, 'my_law', 'not_finite', 'random_faults', 'failing_parts', 'faults'),
    *('autopilot', 'validate', 'replay', 'door', 'own_sensors', 'flight_digests', 'your_vehicle'),
    *('experiments_command', 'rudder', 'bottom', 'kills', 'montecarlo', 'lockstep', 'sweep'),
    *('slow_machine', 'verify', 'two_gliders', 'guard_flights', 'runner', 'mutants'),
    *('message_faults', 'live_view', 'driver_restart', 'forecasts', 'experiments', 'benchmarks'),
    *('stability_map', 'vehicle_fields', 'soak', 'plan_command', 'model_water', 'report'),
    *('routing', 'kernel_cache', 'real_vehicles', 'end_of_path', 'outcome', 'navigate', 'afloat'),
    'fault_matrix',
)


def pytest_configure(config):
    """Have each process begin to collect elsewhere: pytest rewrites a new file in the first one.

    What commands are forked from begins meanwhile, before a test has workers of Dask forked.
    """
    if hasattr(config, 'workerinput'):
        command_line.forks()
        own = config.workerinput
        begin = len(config.args) * int(own['workerid'][2:]) // own['workercount']
        config.args[:] = config.args[begin:] + config.args[:begin]


def pytest_collection_modifyitems(items):
    """Put the longest first, that no process is left with one at the end."""
    order = {f'test_{name}.py': number for number, name in enumerate(LONG)}
    items.sort(key=lambda item: (order.get(item.path.name, len(LONG)), item.path))


def pytest_collection_finish():
    """Have Python look for no garbage in what was imported."""
    gc.freeze()


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config, log):
    """Give each process whole files, and all of `FLIGHT` to one."""
    from xdist.scheduler import LoadScopeScheduling

    class Files(LoadScopeScheduling):
        def _split_scope(self, nodeid):
            name = nodeid.partition('::')[0]
            return 'flight' if Path(name).stem.removeprefix('test_') in FLIGHT else name

    return Files(config, log)


@pytest.fixture
def context(monkeypatch):
    """Context of rclpy in a ROS domain of its own; handlers of signals stay as they were."""
    import rclpy
    from rclpy.context import Context

    from glider_base.ros.places import domain_id

    monkeypatch.delenv('ROS_DOMAIN_ID', raising=False)
    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    context = Context()
    with domain_id() as domain:
        rclpy.init(context=context, domain_id=domain)
        yield context
        rclpy.try_shutdown(context=context)
    for number, handler in before.items():
        signal.signal(number, handler)
    # Who is left has a part in the shared memory of flights that later tests kill in its domain.
    if _participants():
        gc.collect()
    assert not _participants()


def _participants() -> list[str]:
    """Names of threads by which this process takes part in ROS domains."""
    names = []
    for path in Path('/proc/self/task').glob('*/comm'):
        with suppress(OSError):  # it has ended
            names.append(path.read_text(encoding='utf-8').strip())
    return [name for name in names if name.startswith('dds.udp')]
