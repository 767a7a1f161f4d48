# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""security/policy.xml allows every node what it does, and nothing else.

Run as a program, this file writes it anew, from the wiring.
"""

import xml.etree.ElementTree as ET
from pathlib import Path

import pytest
import rclpy
from rclpy.context import Context
from rclpy.parameter import Parameter

from glider_base.ros.places import domain_id
from glider_base.ros.wire.topics import GUARD, GUIDANCE, PLANT, RECORDER, TOPICS
from glider_base.wiring import ESTIMATES, SENSORS, WIRING
from glider_bringup.engines.processes import AUTOPILOT, ON_BOARD
from glider_bringup.nodes.recorder_node import RecorderNode
from glider_control.nodes.control_node import ControlNode
from glider_guard.nodes.guard_node import GuardNode
from glider_guidance.nodes.guidance_node import GuidanceNode
from glider_model.nodes.current_node import CurrentNode
from glider_model.nodes.plant_node import PlantNode
from glider_navigation.nodes.navigation_node import NavigationNode

POLICY = Path(__file__).resolve().parents[1] / 'security' / 'policy.xml'
NAMESPACE = '/glider'
#: Where the nodes of the test are: those of other tests may be around for a while.
APART = '/rights'
#: What every node of rclpy says, and answers.
SAYS = ('/parameter_events', '/rosout')
PARAMETERS = tuple(
    f'~/{name}'
    for name in (
        'describe_parameters',
        'get_parameter_types',
        'get_parameters',
        'get_type_description',
        'list_parameters',
        'set_parameters',
        'set_parameters_atomically',
    )
)
#: What a managed one answers, beside what it says of its transitions.
LIFECYCLE = tuple(
    f'~/{name}'
    for name in (
        'change_state',
        'get_available_states',
        'get_available_transitions',
        'get_state',
        'get_transition_graph',
    )
)
SERVICES = {PLANT: ('pause',), GUIDANCE: ('abort',), GUARD: ('clear_guard',)}
COMMENT = (
    ' What each node may do, for installations with DDS Security; docs/security.md says how. '
    'Written by src/glider_bringup/test/test_security_policy.py. '
)


def rights(node: str) -> dict[str, set[str]]:
    """Topics that a node may publish and subscribe, and services that it may reply to."""
    block = next((wired for wired in WIRING if wired.node == node), None)
    publish = {'/diagnostics', 'lockstep', 'told', *SAYS}
    subscribe = {'lockstep', '/clock', '/parameter_events'}
    if block:
        publish |= {*block.outputs}
        subscribe |= {*block.inputs}
    if node == GUIDANCE:
        publish |= {'path', 'mission/status'}
        subscribe.add('battery')
    replies = {*PARAMETERS, *SERVICES.get(node, ())}
    if block in ON_BOARD:
        publish.add('~/transition_event')
        replies |= {*LIFECYCLE}
    if node == PLANT:
        subscribe |= {'recorded', 'heard'}
    if node == RECORDER:
        publish |= {'recorded', 'heard'}
        subscribe.add('told')
        subscribe |= {topic.name for topic in TOPICS.values() if topic.recorded}
    return {
        'publish': publish,
        'subscribe': subscribe,
        'reply': replies,
    }


def _profile(parent: ET.Element, node: str) -> None:
    profile = ET.SubElement(parent, 'profile', ns=NAMESPACE, node=node)
    allowed = rights(node)
    for right, kind in (('publish', 'topic'), ('subscribe', 'topic'), ('reply', 'service')):
        group = ET.SubElement(profile, f'{kind}s', {right: 'ALLOW'})
        for name in sorted(allowed[right]):
            ET.SubElement(group, kind).text = name


def policy() -> str:
    """The policy as a file: an enclave for each process."""
    root = ET.Element('policy', version='0.2.0')
    root.append(ET.Comment(COMMENT))
    enclaves = ET.SubElement(root, 'enclaves')
    nodes = [*(wired.node for wired in WIRING), RECORDER]
    processes = {node: [node] for node in nodes} | {AUTOPILOT: [one.node for one in ON_BOARD]}
    for name, parts in processes.items():
        enclave = ET.SubElement(enclaves, 'enclave', path=f'{NAMESPACE}/{name}')
        profiles = ET.SubElement(enclave, 'profiles')
        for node in parts:
            _profile(profiles, node)
    ET.indent(root)
    head = '<?xml version="1.0" encoding="UTF-8"?>\n'
    return f'{head}{ET.tostring(root, encoding="unicode")}\n'


def test_the_policy_is_that_of_the_wiring():
    assert POLICY.read_text(encoding='utf-8') == policy(), f'run {Path(__file__).name}'


@pytest.fixture(scope='module')
def graph(tmp_path_factory):
    """What every node really has: topics and services by right, by node."""
    nodes = (PlantNode, CurrentNode, NavigationNode, GuidanceNode, ControlNode, GuardNode)
    folder = tmp_path_factory.mktemp('recording') / 'run'
    folder.mkdir()
    context = Context()
    with domain_id() as domain:
        rclpy.init(context=context, domain_id=domain)
        record = Parameter('record', value=True)
        managed = [Parameter('managed', value=True), Parameter('lockstep', value=False)]
        aboard = {wired.node: managed for wired in ON_BOARD}
        said = {'context': context, 'namespace': APART}
        made = []
        for node, wired in zip(nodes, WIRING, strict=True):
            made.append(node(parameter_overrides=aboard.get(wired.node, [record]), **said))
            if wired in ON_BOARD:
                made[-1].on_ready()
        given = [record, Parameter('folder', value=str(folder))]
        made.append(RecorderNode(parameter_overrides=given, **said))
        yield {node.get_name(): _rights_of(node) for node in made}
        for node in made:
            node.destroy_node()
        rclpy.try_shutdown(context=context)


def _rights_of(node) -> dict[str, set[str]]:
    name, place = node.get_name(), node.get_namespace()
    found = {
        'publish': node.get_publisher_names_and_types_by_node(name, place),
        'subscribe': node.get_subscriber_names_and_types_by_node(name, place),
        'reply': node.get_service_names_and_types_by_node(name, place),
    }
    return {
        right: {topic.replace(f'{APART}/', f'{NAMESPACE}/') for topic, _ in several}
        for right, several in found.items()
    }


def _absolute(name: str, node: str) -> str:
    if name.startswith('~/'):
        return f'{NAMESPACE}/{node}/{name[2:]}'
    return name if name.startswith('/') else f'{NAMESPACE}/{name}'


def _written() -> dict[str, dict[str, set[str]]]:
    """Rights in the file, by node, in the enclaves of one node each."""
    found = {}
    for enclave in ET.parse(POLICY).iter('enclave'):
        for profile in enclave.iter('profile'):
            if enclave.get('path') != f'{NAMESPACE}/{profile.get("node")}':
                continue
            rights = found.setdefault(profile.get('node'), {})
            for group in profile:
                (right,) = group.attrib
                names = {_absolute(one.text, profile.get('node')) for one in group}
                rights[right] = names
    return found


def test_every_node_is_allowed_what_it_does(graph):
    written = _written()
    assert set(written) == set(graph)
    for node, found in graph.items():
        for right, names in found.items():
            assert names <= written[node][right], (node, right)


def test_no_node_is_allowed_more(graph):
    """But what depends on the run: sensors and estimates, simulated time, who tells types."""
    varies = {*SENSORS, *ESTIMATES, '/clock', '/parameter_events', '~/get_type_description'}
    for node, allowed in _written().items():
        may = {_absolute(name, node) for name in varies}
        for right, names in allowed.items():
            assert names - graph[node][right] <= may, (node, right)


if __name__ == '__main__':
    POLICY.write_text(policy(), encoding='utf-8')
