# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""docs/interfaces.md says what the code does: its tables, its fields, and its example driver.

``python test/test_interfaces_doc.py`` writes the tables anew.
"""

import inspect
import re
import signal
from pathlib import Path
from typing import Annotated, Literal, get_args, get_origin

import pydantic
import pytest
import rclpy
from rclpy.context import Context
from rclpy.parameter import Parameter

from glider_base import files
from glider_base.errors import MAX_LINE, MAX_LINES, MAX_SHOWN
from glider_base.plugins import registered
from glider_base.ros.lockstep import health
from glider_base.ros.lockstep.block_node import BlockSettings
from glider_base.ros.lockstep.clock import ClockSettings
from glider_base.ros.lockstep.node import TickSettings
from glider_base.ros.places import MAX_DOMAIN, NAMESPACE_ALLOWED, domain_id
from glider_base.ros.wire import qos
from glider_base.ros.wire.topics import TOPICS
from glider_base.settings import BOUNDS, Settings, limits
from glider_base.wiring import JOINTS, present
from glider_bringup.cli import MAX_WORD
from glider_bringup.engines.launch_plan import ARGUMENTS
from glider_bringup.nodes.recorder_node import RecorderNode, RecorderSettings
from glider_control.nodes.control_node import ControlNode
from glider_control.settings import ControlSettings
from glider_guard.nodes.guard_node import GuardNode
from glider_guard.settings import GuardSettings
from glider_guidance.nodes.guidance_node import GuidanceNode
from glider_guidance.path.settings import PathSettings, WaypointPath
from glider_guidance.settings import GuidanceSettings
from glider_guidance.yo.stage import STAGE_NAMES
from glider_mission.scenario import Scenario
from glider_model.nodes.current_node import CurrentNode
from glider_model.nodes.plant_node import PlantNode
from glider_model.nodes.tf_node import TfSettings
from glider_model.ocean.columns import MAX_ROWS
from glider_model.ocean.current_settings import CurrentComponent, CurrentField, CurrentSettings
from glider_model.plant.faults.settings import Fault, FaultSettings
from glider_model.plant.plant import PlantSettings
from glider_navigation.nodes.navigation_node import NavigationNode
from glider_navigation.phase import PHASE_NAMES
from glider_navigation.settings import NavigationSettings
from glider_studies.sweep.plan import MAX_CELLS, MAX_VALUES, Sweep

DOCUMENT = Path(__file__).resolve().parents[1] / 'docs' / 'interfaces.md'

#: Every node, and the settings that are its parameters beside those of `TickSettings`.
NODES = {
    'plant_node': (PlantNode, PlantSettings),
    'current_node': (CurrentNode, CurrentSettings),
    'navigation_node': (NavigationNode, NavigationSettings),
    'guidance_node': (GuidanceNode, GuidanceSettings),
    'control_node': (ControlNode, ControlSettings),
    'guard_node': (GuardNode, GuardSettings),
    'recorder_node': (RecorderNode, RecorderSettings),
}
CLOCK_FIELDS = set(ClockSettings.model_fields) - set(TickSettings.model_fields)
BLOCK_FIELDS = set(BlockSettings.model_fields) - set(TickSettings.model_fields)

#: Fields that every fault has.
COMMON = set(FaultSettings.model_fields)

PROFILES = ('PER_TICK', 'FREE', 'NEWEST', 'LATCHED', 'EVENTS', 'REPEATED', 'EVERYTHING')
DEADLINE_S = 120.0


# ---------------------------------------------------------------------- tables


def table(header: tuple[str, ...], rows) -> str:
    """Markdown table."""
    lines = [header, ('---',) * len(header), *rows]
    return '\n'.join(f'| {" | ".join(line)} |' for line in lines)


#: What packages of others have registered; the document is about what everybody has.
STRANGERS = {point.name for point in registered()}


def of_everybody(text: str) -> str:
    """A list of names, and what each is, without those of others."""
    parts = text.split('; ')
    return '; '.join(part for part in parts if part.partition(':')[0] not in STRANGERS)


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
        return ', '.join(str(w) for w in get_args(field.annotation) if w not in STRANGERS)
    return ', '.join(f'{BOUNDS[name]} {limit}' for name, limit in limits(field).items())


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
        if name.partition('.')[0] not in STRANGERS and (only is None or name in only):
            yield (
                f'`{name}`',
                kind_of(field),
                default_of(field, value),
                allowed(field),
                'tunable' if is_tunable(field) else '',
                of_everybody(field.description or ''),
            )


def member_rows(union):
    """Fields of every member of a union, for parameters that hold text."""
    members = get_args(union)[0] if get_origin(union) is Annotated else union
    for model in get_args(members):
        (kind,) = get_args(model.model_fields['kind'].annotation)
        if kind in STRANGERS:
            continue
        for name, field, value in leaves(model, None):
            if name != 'kind':
                default = default_of(field, value)
                yield kind, f'`{name}`', default, allowed(field), field.description or ''


def when_rows():
    """Fields that every fault has."""
    return (row for row in member_rows(Fault) if row[0] == 'leak' and row[1].strip('`') in COMMON)


def kind_rows(union):
    """Members of a union: what each is called, what it stands for, and fields of its own."""
    for model in get_args(get_args(union)[0]):
        (kind,) = get_args(model.model_fields['kind'].annotation)
        own = [name for name in model.model_fields if name not in {*COMMON, 'kind'}]
        yield f'`{kind}`', inspect.getdoc(model), ', '.join(f'`{name}`' for name in own) or '-'


def messages_of(topic) -> str:
    if not topic.per_tick:
        return 'on change'
    return 'one per tick' if topic.name in present(TOPICS, ()) else 'one per tick, or none'


def topic_rows():
    names = {id(getattr(qos, name)): name for name in PROFILES}
    for topic in TOPICS.values():
        yield (
            f'`{topic.name}`',
            topic.type_name,
            topic.publisher,
            ', '.join(topic.readers) or '-',
            messages_of(topic),
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


def limit_rows():
    """Bounds of what a person writes."""
    longest = {
        what: next(item.max_length for item in field.metadata if hasattr(item, 'max_length'))
        for what, field in (
            ('name of a scenario or sweep', Scenario.model_fields['name']),
            ('description', Scenario.model_fields['description']),
            ('dimensions of a sweep', Sweep.model_fields['dimensions']),
            ('waypoints of a path', WaypointPath.model_fields['waypoints']),
            ('components of a current', CurrentSettings.model_fields['components']),
            ('faults', Scenario.model_fields['faults']),
        )
    }
    letters = ' characters: letters, digits, `_`, `.`, `-`'
    yield 'file', f'regular, in UTF-8, <= {files.MAX_BYTES:,} bytes'
    yield 'values in a text', f'<= {files.MAX_VALUES:,}, repeated ones counted'
    yield 'mappings and lists inside each other', f'<= {files.MAX_DEPTH}, also in JSON'
    yield 'number', f'<= {files.MAX_DIGITS} characters'
    for what, most in longest.items():
        what_of = letters if what.startswith('name') else ''
        yield what, f'<= {most:,}' + (' characters' if what == 'description' else what_of)
    yield 'cells of a sweep', f'<= {MAX_CELLS:,}, of a dimension {MAX_VALUES:,}'
    yield 'rows of a table of currents, or of water', f'<= {MAX_ROWS:,}'
    yield '`--namespace`', NAMESPACE_ALLOWED
    yield '`ROS_DOMAIN_ID`', f'0 to {MAX_DOMAIN}'
    yield (
        'word of a command line',
        f'<= {MAX_WORD:,} characters, printable, in UTF-8',
    )
    yield 'error', f'<= {MAX_LINES} lines of {MAX_LINE} characters, each value <= {MAX_SHOWN}'


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
        'blocks': table(parameters, parameter_rows(BlockSettings, BLOCK_FIELDS)),
        'paths': table(fields, member_rows(PathSettings)),
        'currents': table(fields, member_rows(CurrentComponent)),
        'current fields': table(fields, member_rows(CurrentField)),
        'faults': table(('kind', 'what happens', 'its own fields'), kind_rows(Fault)),
        'every fault': table(fields[1:], (row[1:] for row in when_rows())),
        'fields of faults': table(
            fields, (row for row in member_rows(Fault) if row[1].strip('`') not in COMMON)
        ),
        'tf_node': table(parameters, parameter_rows(TfSettings)),
        'limits': table(('what', 'allowed'), limit_rows()),
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
        documented = {
            leaf: (field, value)
            for model in (node_type.tick_settings, settings)
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
        *PHASE_NAMES,
        *(health.STARTING, health.READY, health.WAITING, health.FINISHED, health.FAILED),
        *('`abort`', '`pause`', 'std_srvs/srv/Trigger', 'std_srvs/srv/SetBool'),
        *('`stage`', '`infeasible`', '`saturation`', '`phase`', '`peer`', '`topic`'),
    ],
)
def test_word_is_explained(document, word):
    assert word in document


if __name__ == '__main__':
    DOCUMENT.write_text(with_tables(DOCUMENT.read_text(encoding='utf-8')), encoding='utf-8')
