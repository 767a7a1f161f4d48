# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A rudder that nobody here has heard of: two files of a package, and a section of a vehicle file.

The package is installed by pip into a folder of its own, as a stranger would. It flies with the
vehicle of a YAML file, directly and over nodes.
"""

import json
import os
import shutil
import subprocess
import sys
from collections import defaultdict
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
import yaml
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState

from glider_base.ros.wire.topics import TOPICS
from glider_mission.recording.mcap_reader import Bag
from glider_model.vehicle.file import vehicle_path

DEADLINE_S = 300.0
PER_TICK = [topic.full_name('/glider') for topic in TOPICS.values() if topic.per_tick]
NAMES = ['buoyancy_engine', 'pitch_mass', 'roll_mass', 'rudder']

PYPROJECT = """
[build-system]
requires = ["setuptools"]
build-backend = "setuptools.build_meta"

[project]
name = "my_rudder"
version = "0.1.0"

[project.entry-points."glider.surfaces"]
rudder = "my_rudder.plant:RudderSettings"

[project.entry-points."glider.surface_laws"]
rudder = "my_rudder.control:RudderLawSettings"

[tool.setuptools]
packages = ["my_rudder"]
"""
#: For the plant: a moment, and nothing else.
PLANT = '''
import math
from typing import NamedTuple

from glider_base.kernel import kernel
from glider_model.vehicle.quantity import quantity
from glider_model.vehicle.surface import SurfaceSettings, surface_loads


class RudderSettings(SurfaceSettings):
    """Rudder that is all moment."""

    moment: quantity('kg', gt=0.0, le=1000.0)

    def params(self):
        return RudderParams(self.moment.value)


class RudderParams(NamedTuple):
    moment: float


@surface_loads.body(RudderParams)
@kernel
def rudder_loads(loads, u, v, w, p, q, r, delta, params):
    t_x, t_y, t_z, m_x, m_y, m_z = loads
    return t_x, t_y, t_z, m_x, m_y, m_z + params.moment * math.sin(delta) * u * abs(u)
'''
#: For control: all of its range for a quarter of a radian.
CONTROL = '''
import math
from typing import NamedTuple

from pydantic import Field

from glider_control.surface import SurfaceLawSettings, steer
from glider_base.frames import wrap_angle
from glider_base.kernel import kernel


class RudderLawSettings(SurfaceLawSettings):
    """Steering by a rudder, in proportion."""

    saturating_deg: float = Field(15.0, gt=0.0, le=180.0, description='error of all of it (deg)')
    ki_per_s: float = Field(0.004, ge=0.0, le=1.0, description='integral (1/s)')

    def params(self, vehicle):
        most = math.radians(vehicle.rudder.range.value)
        return RudderLawParams(most / math.radians(self.saturating_deg), self.ki_per_s, most)

    def initial_state(self):
        return RudderLawState(0.0)


class RudderLawParams(NamedTuple):
    gain: float
    ki: float
    most: float


class RudderLawState(NamedTuple):
    trim: float


@steer.body(RudderLawParams)
@kernel
def steer_by_rudder(state, seen, params, dt):
    error = wrap_angle(seen.reference.psi - seen.measured.psi)
    trim = min(0.3, max(-0.3, state.trim + dt * params.ki * params.gain * error))
    delta = params.gain * error + trim
    return RudderLawState(trim), min(params.most, max(-params.most, delta))
'''
#: The section of the vehicle file.
RUDDER = {
    'range': {'value': 30.0, 'unit': 'deg', 'source': 'made up'},
    'rate': {'value': 3.0, 'unit': 'deg/s', 'source': 'made up'},
    'moment': {'value': 30.0, 'unit': 'kg', 'source': 'made up'},
}
SHORT = ['--set', 'duration_s=60', '--set', 'initial.heading_deg=20']
SHORT += ['--set', 'profile.prepare_s=0']


class Flown(NamedTuple):
    """A run that is over."""

    folder: Path
    card: dict  #: what --json printed


class Machine:
    """A machine on which the package is installed."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.site = folder, folder / 'site'
        source = folder / 'source' / 'my_rudder'
        source.mkdir(parents=True)
        (source.parent / 'pyproject.toml').write_text(PYPROJECT)
        for name, text in (('__init__', ''), ('plant', PLANT), ('control', CONTROL)):
            (source / f'{name}.py').write_text(text)
        pip = [sys.executable, '-m', 'pip', 'install', '--no-build-isolation', '--no-index']
        quiet = ['--quiet', '--disable-pip-version-check', '--target', self.site]
        subprocess.run([*pip, *quiet, source.parent], check=True, timeout=DEADLINE_S)
        values = yaml.safe_load(vehicle_path('zhang2021').read_text())
        self.vehicle = folder / 'steered.yaml'
        self.vehicle.write_text(yaml.safe_dump({**values, 'name': 'steered', 'rudder': RUDDER}))

    def start(self, *arguments) -> subprocess.CompletedProcess:
        """Run a command to its end, with the package on its path."""
        env = {name: value for name, value in os.environ.items() if name != 'ROS_DOMAIN_ID'}
        path = [str(self.site), *filter(None, [env.get('PYTHONPATH')])]
        env['PYTHONPATH'] = os.pathsep.join(path)
        return subprocess.run(
            [sys.executable, '-m', 'glider_bringup.cli', *map(str, arguments)],
            env=env,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=DEADLINE_S,
        )

    def run(self, name: str, *options) -> Flown:
        """Fly the vehicle."""
        folder, vehicle = self.folder / name, f'vehicle={self.vehicle}'
        fixed = ['--set', vehicle, '--set', 'dives=0', '--out', folder, '--json']
        done = self.start('run', 'current_8deg', *fixed, *options)
        assert done.returncode == 0, done.stderr
        return Flown(folder, json.loads(done.stdout))


def payloads(folder: Path) -> dict[str, list[tuple[int, bytes]]]:
    """Log times and bytes of all messages of the per-tick topics of a run."""
    bag, found = Bag(folder), defaultdict(list)
    for batch in bag.batches():
        for index, topic in enumerate(batch.topic):
            if bag.topics[topic].name in PER_TICK:
                message = int(batch.log_ns[index]), batch.payload(index)
                found[bag.topics[topic].name].append(message)
    return found


def joints(folder: Path, topic: str) -> list[JointState]:
    """Messages of a topic with joints."""
    raw = payloads(folder)[f'/glider/{topic}']
    return [deserialize_message(one, JointState) for _, one in raw]


@pytest.fixture(scope='module')
def machine(tmp_path_factory) -> Machine:
    return Machine(tmp_path_factory.mktemp('machine'))


@pytest.fixture(scope='module')
def both(machine) -> tuple[Flown, Flown]:
    """A short flight directly and over nodes, at the same time: both have much to compile."""
    ways = ['direct', '--engine', 'direct', '--bag', '--no-report'], ['nodes']
    with ThreadPoolExecutor() as pool:
        direct, nodes = (pool.submit(machine.run, *way, *SHORT) for way in ways)
        return direct.result(), nodes.result()


def test_nodes_and_direct_agree_to_the_last_bit(both):
    direct, nodes = (payloads(run.folder) for run in both)
    assert {len(messages) for messages in nodes.values()} == {600}
    assert nodes == direct


def test_its_joint_is_called_like_the_section_of_the_vehicle_file(both):
    for topic in ('joint_states', 'command'):
        messages = joints(both[1].folder, topic)
        assert all(message.name == NAMES for message in messages)
        angles = np.array([message.position[3] for message in messages])
        assert 0.05 < np.abs(angles).max() <= np.radians(30.0)
    assert np.abs(np.diff(angles)).max() > 0.0
    assert both[0].card['actuator_travel'] == both[1].card['actuator_travel']
    assert both[0].card['actuator_travel']['rudder_deg'] > 1.0
    assert 'Rudder' in (both[1].folder / 'report.html').read_text(encoding='utf-8')


def test_its_runs_are_verified(machine, both):
    done = machine.start('verify', both[1].folder, '--json')
    assert done.returncode == 0, done.stderr
    assert all(one['result'] == 'identical' for one in json.loads(done.stdout)['blocks'])


@pytest.mark.parametrize('law', ['adaptive', 'pid'])
def test_it_holds_a_straight_path_in_a_current(machine, both, law):
    options = ['--controller', law, '--set', 'duration_s=12000']
    flown = machine.run(f'long_{law}', '--engine', 'direct', '--no-report', *options)
    assert flown.card['status'] == 'completed'
    assert flown.card['cross_track_m']['max_steady'] < 5.0
    assert flown.card['guard']['events'] == []


def test_its_fields_are_set_and_checked_like_any_other(machine, both):
    scenario = yaml.safe_load((both[1].folder / 'scenario.yaml').read_text())
    assert scenario['control']['rudder']['ki_per_s'] == 0.004
    options = ['--set', f'vehicle={machine.vehicle}', '--set', 'vehicle.rudder.moment=-1']
    told = machine.start('run', 'current_8deg', *options)
    assert told.returncode == 2
    assert told.stderr.endswith('rudder.moment.value = -1: should be greater than 0 '
                                '(allowed: > 0.0 and <= 1000.0)\n')  # fmt: skip


def test_without_the_package_the_vehicle_is_told_in_a_line(machine, glider):
    told = glider('run', '--set', f'vehicle={machine.vehicle}')
    assert told.returncode == 2
    (line,) = filter(str.strip, told.stderr.splitlines())
    assert 'rudder: unknown field' in line
    assert 'others come with packages that register them in the group glider.surfaces' in line


def test_a_surface_that_nothing_steers_by_is_told_in_a_line(machine):
    (points,) = machine.site.glob('my_rudder-*.dist-info/entry_points.txt')
    text = points.read_text()
    points.write_text(text.partition('[glider.surface_laws]')[0] + '[glider.surfaces]\n'
                      'rudder = my_rudder.plant:RudderSettings\n')  # fmt: skip
    told = machine.start('run', 'current_8deg', '--set', f'vehicle={machine.vehicle}')
    points.write_text(text)
    assert told.returncode == 2
    (line,) = filter(str.strip, told.stderr.splitlines())
    assert 'the vehicle has a rudder, which nothing steers by (allowed: fin; ' in line


@pytest.mark.parametrize(
    ('half', 'line', 'other', 'words'),
    [
        ('plant', 'return t_x', 'none = t_x', ['rudder_loads (', 'returns nothing', '6: force x']),
        ('plant', 'params.moment ', 'params.weight ', ['rudder_loads (', "attribute 'weight'"]),
        (
            'control',
            '    delta = ',
            '    if error > 9.0:\n        return None\n    delta = ',
            ['steer_by_rudder (', 'returns nothing', '2: state after the tick, angle'],
        ),
    ],
)
def test_a_mistake_in_either_half_is_told_in_a_line(machine, half, line, other, words):
    file = machine.site / 'my_rudder' / f'{half}.py'
    text = file.read_text()
    assert text.count(line) == 1
    file.write_text(text.replace(line, other))
    options = ['--engine', 'direct', '--no-report', '--out', machine.folder / 'mistake']
    told = machine.start('run', 'current_8deg', '--set', f'vehicle={machine.vehicle}', *options)
    file.write_text(text)
    shutil.rmtree(machine.folder / 'mistake', ignore_errors=True)
    assert told.returncode == 2 and 'Traceback' not in told.stderr
    assert all(word in told.stderr.splitlines()[-1] for word in words), told.stderr
