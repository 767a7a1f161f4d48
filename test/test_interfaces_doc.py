# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""docs/interfaces.md says what the code does: its tables, its fields, and its example driver.

``python test/test_interfaces_doc.py`` writes the tables anew.
"""

import os
import re
import signal
import subprocess
import textwrap
import time
import types
from pathlib import Path
from typing import Annotated, Literal, get_args, get_origin

import pydantic
import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger

from glider_bringup.launching import ARGUMENTS
from glider_bringup.nodes.recorder_node import RecorderNode, RecorderSettings
from glider_bringup.ros.node_parameters import node_parameters, write_parameters
from glider_bringup.runner import domain_id, node_commands
from glider_bringup.scenario import load_scenario
from glider_control.control import ControlSettings
from glider_control.nodes.control_node import ControlNode
from glider_guidance.guidance import GuidanceSettings
from glider_guidance.nodes.guidance_node import GuidanceNode
from glider_guidance.path import PathSettings
from glider_guidance.profile import STAGE_NAMES
from glider_model import frames
from glider_model.current import CurrentComponent, CurrentSettings
from glider_model.nodes.current_node import CurrentNode
from glider_model.nodes.plant_node import PlantNode
from glider_model.nodes.tf_node import TfSettings
from glider_model.plant import PlantSettings, plant_joints, plant_odometry, plant_step
from glider_model.ros import health, qos
from glider_model.ros.clock import ClockSettings
from glider_model.ros.messages import JOINTS, TOPICS
from glider_model.ros.qos import EVENTS
from glider_model.ros.tick import TickSettings
from glider_model.settings import Settings
from glider_model.signals import TICK_S, Joints, Water

DOCUMENT = Path(__file__).resolve().parents[1] / 'docs' / 'interfaces.md'

#: Every node, and the settings that are its parameters beside those of `TickSettings`.
NODES = {
    'plant_node': (PlantNode, PlantSettings),
    'current_node': (CurrentNode, CurrentSettings),
    'guidance_node': (GuidanceNode, GuidanceSettings),
    'control_node': (ControlNode, ControlSettings),
    'recorder_node': (RecorderNode, RecorderSettings),
}
CLOCK_FIELDS = set(ClockSettings.model_fields) - set(TickSettings.model_fields)

PROFILES = ('PER_TICK', 'NEWEST', 'LATCHED', 'EVENTS', 'EVERYTHING')
_SIGNS = (('gt', '>'), ('ge', '>='), ('lt', '<'), ('le', '<='))
DEADLINE_S = 120.0


# ---------------------------------------------------------------------- tables


def table(header: tuple[str, ...], rows) -> str:
    """Markdown table."""
    lines = [header, ('---',) * len(header), *rows]
    return '\n'.join(f'| {" | ".join(line)} |' for line in lines)


def is_model(kind) -> bool:
    return isinstance(kind, type) and issubclass(kind, pydantic.BaseModel)


def leaves(model: type[Settings], default: Settings | None, prefix: str = ''):
    """Dotted name, field and default of everything that a settings model holds."""
    for name, field in model.model_fields.items():
        value = field.default if default is None else getattr(default, name)
        if is_model(field.annotation):
            yield from leaves(field.annotation, value, f'{prefix}{name}.')
        else:
            yield prefix + name, field, value


def kind_of(field) -> str:
    if get_origin(field.annotation) is Literal:
        return 'str'
    kind = field.annotation
    return kind.__name__ if kind in (bool, int, float, str) else 'text'


def allowed(field) -> str:
    """Range of a field, or the words that it can be."""
    if get_origin(field.annotation) is Literal:
        return ', '.join(map(str, get_args(field.annotation)))
    limits = [
        f'{sign} {getattr(item, name)}'
        for item in field.metadata
        for name, sign in _SIGNS
        if getattr(item, name, None) is not None
    ]
    return ', '.join(limits)


def default_of(field, value) -> str:
    if value is pydantic.fields.PydanticUndefined or isinstance(value, type(...)):
        return 'required'
    if kind_of(field) == 'text':
        return f'`{pydantic.TypeAdapter(field.annotation).dump_json(value).decode()}`'
    return f'`{str(value).lower() if isinstance(value, bool) else value}`'


def is_tunable(field) -> bool:
    extra = field.json_schema_extra
    return isinstance(extra, dict) and extra.get('tunable', False)


def parameter_rows(model: type[Settings], only=None):
    for name, field, value in leaves(model, model()):
        if only is None or name in only:
            yield (
                f'`{name}`',
                kind_of(field),
                default_of(field, value),
                allowed(field),
                'tunable' if is_tunable(field) else '',
                field.description or '',
            )


def member_rows(union):
    """Fields of every member of a union, for parameters that hold text."""
    members = get_args(union)[0] if get_origin(union) is Annotated else union
    for model in get_args(members):
        (kind,) = get_args(model.model_fields['kind'].annotation)
        for name, field, value in leaves(model, None):
            if name != 'kind':
                default = default_of(field, value)
                yield kind, f'`{name}`', default, allowed(field), field.description or ''


def topic_rows():
    names = {id(getattr(qos, name)): name for name in PROFILES}
    for topic in TOPICS.values():
        yield (
            f'`{topic.name}`',
            topic.type_name,
            topic.publisher,
            ', '.join(topic.readers) or '-',
            'one per tick' if topic.per_tick else 'on change',
            names[id(topic.qos)].lower(),
            'yes' if topic.recorded else 'no',
        )


def profile_rows():
    for name in PROFILES:
        profile = getattr(qos, name)
        yield (
            name.lower(),
            profile.reliability.name.lower(),
            profile.durability.name.lower(),
            f'{profile.history.name.lower()} {profile.depth}',
        )


def tables() -> dict[str, str]:
    """Every generated table of the document, by the name in its marker."""
    parameters = ('parameter', 'type', 'default', 'allowed', 'at run time', 'meaning')
    fields = ('kind', 'field', 'default', 'allowed', 'meaning')
    found = {
        'topics': table(
            ('topic', 'type', 'published by', 'needed by', 'messages', 'QoS', 'recorded'),
            topic_rows(),
        ),
        'qos': table(('QoS', 'reliability', 'durability', 'history'), profile_rows()),
        'every node': table(parameters, parameter_rows(TickSettings)),
        'clock': table(parameters, parameter_rows(ClockSettings, CLOCK_FIELDS)),
        'paths': table(fields, member_rows(PathSettings)),
        'currents': table(fields, member_rows(CurrentComponent)),
        'tf_node': table(parameters, parameter_rows(TfSettings)),
        'launch': table(
            ('argument', 'default', 'meaning'),
            (
                (f'`{a.name}`', f'`{a.default}`' * bool(a.default), a.description)
                for a in ARGUMENTS
            ),
        ),
    }
    for name, (_, settings) in NODES.items():
        found[name] = table(parameters, parameter_rows(settings))
    return found


MARKED = re.compile(r'(<!-- table: ([^>]+) -->\n)(.*?)(\n<!-- end -->)', re.DOTALL)


def with_tables(text: str) -> str:
    """The document with the tables as they should be."""
    current = tables()
    return MARKED.sub(lambda found: found[1] + current[found[2]] + found[4], text)


@pytest.fixture(scope='module')
def document() -> str:
    return DOCUMENT.read_text(encoding='utf-8')


def test_every_table_is_there_once(document):
    assert sorted(match[2] for match in MARKED.finditer(document)) == sorted(tables())


@pytest.mark.parametrize('name', tables())
def test_table_says_what_the_code_says(document, name):
    written = {match[2]: match[3] for match in MARKED.finditer(document)}[name].splitlines()
    current = tables()[name].splitlines()
    again = 'python test/test_interfaces_doc.py'
    assert [line for line in current if line not in written] == [], f'missing; run {again}'
    assert [line for line in written if line not in current] == [], f'outdated; run {again}'


# ---------------------------------------------------------------------- against the real nodes


@pytest.fixture
def context(monkeypatch):
    """ROS context in a domain of its own."""
    monkeypatch.delenv('ROS_DOMAIN_ID', raising=False)
    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    context = Context()
    with domain_id() as domain:
        rclpy.init(context=context, domain_id=domain)
        yield context
        rclpy.try_shutdown(context=context)


@pytest.fixture
def keep_signals():
    """Undo what a node does to the signals of its process."""
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.mark.parametrize('name', NODES)
def test_parameters_of_the_document_are_those_of_the_node(context, keep_signals, tmp_path, name):
    node_type, settings = NODES[name]
    overrides = [Parameter('folder', value=str(tmp_path))] if name == 'recorder_node' else []
    node = node_type(context=context, parameter_overrides=overrides)
    try:
        tick = ClockSettings if name == 'plant_node' else TickSettings
        documented = {
            leaf: (field, value)
            for model in (tick, settings)
            for leaf, field, value in leaves(model, model())
        }
        declared = set(node.list_parameters([], 0).names) - {'use_sim_time'}
        assert {n for n in declared if 'qos_overrides' not in n} == set(documented) | {
            n for n in declared if n.startswith('start_type_description_service')
        }
        for leaf, (field, value) in documented.items():
            assert node.describe_parameter(leaf).read_only is not is_tunable(field)
            if kind_of(field) != 'text' and leaf != 'folder':
                assert node.get_parameter(leaf).value == value
    finally:
        node.close()
        node.destroy_node()


@pytest.mark.parametrize('name', [topic.name for topic in TOPICS.values() if topic.per_tick])
def test_every_number_on_a_topic_is_explained(document, name):
    (section,) = re.findall(rf'\n### [^\n]*`{name}`[^\n]*\n(.*?)(?=\n##)', document, re.DOTALL)
    for field in TOPICS[name].codec.fields:
        owner = field.removeprefix('position[').rstrip(']')
        owner = owner.removesuffix('.w').removesuffix('.x').removesuffix('.y').removesuffix('.z')
        assert f'`{owner}' in section, f'{name}: {field}'


@pytest.mark.parametrize(
    'word',
    [
        *JOINTS,
        *(f'| {number} | {name} |' for number, name in enumerate(STAGE_NAMES)),
        *(health.STARTING, health.READY, health.WAITING, health.FINISHED, health.FAILED),
        *('`abort`', '`pause`', 'std_srvs/srv/Trigger', 'std_srvs/srv/SetBool'),
        *('`stage`', '`infeasible`', '`saturation`', '`phase`', '`peer`', '`topic`'),
    ],
)
def test_word_is_explained(document, word):
    assert word in document


# ---------------------------------------------------------------------- the example driver


class Vehicle:
    """Stands in for a vehicle in still water: the plant, one tick at each reading."""

    def __init__(self) -> None:
        settings = PlantSettings(initial={'depth_m': 50.0, 'pitch_deg': -20.0, 'speed_mps': 0.4})
        self.params, self.state = settings.params(), settings.initial_state()
        self.target: dict[str, float] = {}

    def navigation(self):
        target = Joints(*[self.target.get(joint, 0.0) for joint in JOINTS])
        water = Water(0.0, 0.0, 0.0)
        self.state = plant_step(self.state, target, water, self.params, TICK_S)
        wire = frames.odometry_to_wire(plant_odometry(self.state))
        return wire[:3], wire[3:7], wire[7:10], wire[10:]

    def actuators(self):
        return list(plant_joints(self.state))

    def move(self, target):
        self.target = target


@pytest.fixture
def driver_module(document) -> types.ModuleType:
    """The example of the document, as a module."""
    (source,) = re.findall(r' *```python\n(.*?)```', document, re.DOTALL)
    module = types.ModuleType('driver')
    exec(compile(textwrap.dedent(source), f'{DOCUMENT}: example', 'exec'), module.__dict__)
    return module


@pytest.fixture
def followers(context, tmp_path):
    """Guidance and control, free-running, as processes of their own."""
    changes = {'profile.prepare_s': 0.0, 'profile.depth_m': 1000.0}
    scenario = load_scenario('current_8deg', changes)
    file = tmp_path / 'parameters.yaml'
    write_parameters(node_parameters(scenario, lockstep=False), file)
    environment = {**os.environ, 'ROS_DOMAIN_ID': str(context.get_domain_id())}
    processes = [
        subprocess.Popen(node_commands(file)[name], env=environment)
        for name in ('guidance_node', 'control_node')
    ]
    yield processes
    for process in processes:
        process.kill()
        process.wait()


def test_example_driver_flies(context, followers, driver_module):
    """Commands follow the vehicle, are safe when it is silent, and follow again after that."""
    vehicle = Vehicle()
    driver = driver_module.Driver(vehicle, namespace='/glider', context=context)
    said = []
    driver.create_subscription(
        DiagnosticArray, '/diagnostics', lambda array: said.extend(array.status), EVENTS
    )
    abort = driver.create_client(Trigger, 'abort')
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(driver)
    (timer,) = driver.timers

    def wait_for(condition, what: str) -> None:
        end = time.monotonic() + DEADLINE_S
        while not condition():
            assert time.monotonic() < end, what
            assert [process.poll() for process in followers] == [None, None]
            executor.spin_once(timeout_sec=0.05)

    def is_diving() -> bool:
        return vehicle.target.get('buoyancy_engine', 0.0) > 0.2

    def has_said(text: str, level: bytes) -> bool:
        return any(
            status.name == '/glider/control_node'
            and text in status.message
            and status.level == level
            for status in said
        )

    try:
        wait_for(is_diving, 'no command to dive')
        depth = vehicle.state.motion.p_d
        wait_for(lambda: vehicle.state.motion.p_d > depth + 0.5, 'the vehicle does not sink')
        assert not has_said('stale: odom, joint_states', health.ERROR)

        timer.cancel()
        safe = {'buoyancy_engine': -1.0, 'pitch_mass': 0.0, 'roll_mass': 0.0}
        wait_for(lambda: vehicle.target == safe, 'no safe command')
        wait_for(
            lambda: has_said('odom, joint_states', health.ERROR), 'no word about stale inputs'
        )

        timer.reset()
        wait_for(is_diving, 'no command after the silence')
        assert has_said('inputs are fresh again', health.OK)

        answer = abort.call_async(Trigger.Request())
        wait_for(answer.done, 'abort has not been answered')
        assert answer.result().success
        wait_for(lambda: vehicle.target['buoyancy_engine'] < -0.2, 'abort does not surface')
        for process in followers:
            process.terminate()
        assert [process.wait(10.0) for process in followers] == [0, 0]
    finally:
        executor.shutdown()
        driver.destroy_node()


if __name__ == '__main__':
    DOCUMENT.write_text(with_tables(DOCUMENT.read_text(encoding='utf-8')), encoding='utf-8')
