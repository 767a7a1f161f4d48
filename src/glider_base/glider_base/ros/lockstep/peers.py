# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Who takes part: peers that are matched, missing or waited for, and rivals; and how long."""

from collections.abc import Iterable

from rclpy.node import Node

from glider_base.ros.hearing.gids import shown
from glider_base.ros.hearing.inputs import Input
from glider_base.ros.lockstep import health
from glider_base.ros.lockstep.health import seconds
from glider_base.ros.wire.topics import PLANT, Topic

#: A node waits this long (wall time, s) for the recorder and its peers at the end of a run.
FAREWELL_S = 5.0
#: A node tells whom it waits for after this share of the time-out of a tick.
REPORT_AFTER = 0.4
#: What to do about a second glider.
ALONE = 'each glider in a ROS domain needs a namespace and a clock of its own'
#: What rclpy calls a node whose name has not been discovered yet.
UNKNOWN = '_NODE_NAME_UNKNOWN_'
#: What a node is called in messages until then.
_NOBODY = 'somebody without a name'


def publishers(node: Node, topic: Topic) -> dict[bytes, str]:
    """Full names of the nodes that publish a topic, by gid; empty for one not known yet."""
    return {
        bytes(info.endpoint_gid): ''
        if info.node_name == UNKNOWN
        else f'{info.node_namespace.rstrip("/")}/{info.node_name}'
        for info in node.get_publishers_info_by_topic(topic.name)
    }


def others(node: Node, topic: Topic) -> list[str]:
    """Full names of who else publishes a topic of this node; empty for one not known yet."""
    names = list(publishers(node, topic).values())
    if node.get_fully_qualified_name() in names:
        names.remove(node.get_fully_qualified_name())
    return names


def published_by(node: Node, topic: Topic, name: str, how: str = 'too') -> str:
    """That somebody publishes a topic who should not, in words."""
    return f'{node.resolve_topic_name(topic.name)} is published by {name or _NOBODY} {how}'


def rivals(node: Node, topics: Iterable[Topic]) -> list[str]:
    """Who else publishes those of the topics that only this node may publish, in words."""
    own = (topic for topic in topics if topic.publisher == node.get_name())
    return [published_by(node, topic, name) for topic in own for name in others(node, topic)]


def stranger(node: Node, item: Input, gid: bytes) -> str:
    """Who publishes an input that is not its own, in words; by gid too if that is not the name."""
    topic, names = item.topic, publishers(node, item.topic)
    name = names.get(gid) or _NOBODY
    if list(names.values()).count(name) != 1:
        name += f' ({shown(gid)})'
    how = 'too' if {*names} - {gid} else f'and not by {topic.publisher}'
    if how != 'too' and gid in item.owner.strangers:
        how = f'which spoke while {item.owner.name or _NOBODY} did: start it again'
    elif how != 'too' and name == f'{node.get_namespace().rstrip("/")}/{topic.publisher}':
        how = 'which was started when this run had begun: start all its nodes again'
    return published_by(node, topic, name, how)


def missing_readers(node: Node, topic: Topic, publisher, readers: list[str]) -> list[str]:
    """Who of ``readers`` is not connected to an output yet, in words."""
    if not readers:
        return []
    names = _peers_among(node, node.get_subscriptions_info_by_topic(topic.name))
    absent = [reader for reader in readers if reader not in names]
    missing = [f'{reader} does not subscribe to {topic.name}' for reader in absent]
    if not absent and publisher.get_subscription_count() < len(readers):
        missing.append(f'{topic.name} is not connected to {" and ".join(readers)}')
    return missing


def missing_publisher(node: Node, item: Input) -> list[str]:
    """What an input lacks to be connected to its publisher, in words."""
    topic = item.topic
    if topic.publisher not in _peers_among(node, node.get_publishers_info_by_topic(topic.name)):
        return [f'{topic.publisher} does not publish {topic.name}']
    if item.subscription.get_publisher_count() < 1:
        return [f'{topic.name} of {topic.publisher} is not connected']
    return []


def _peers_among(node: Node, endpoints) -> set[str]:
    """Names of the nodes of this namespace that have some of these endpoints."""
    own = node.get_namespace()
    return {info.node_name for info in endpoints if info.node_namespace == own}


def wait_of(missing: list[Input], count: int, due_ns: int) -> dict:
    """Whom a node waits for with some of its ``count`` inputs missing, as fields of its report.

    As long as it has none of them it is idle, not held up.
    """
    idle = len(missing) == count
    names = {item.topic.publisher: item.topic.name for item in missing}
    peer = PLANT if idle and PLANT in names else missing[0].topic.publisher
    return {
        'message': f'waits for {names[peer]} of {peer} at {seconds(due_ns)}',
        'stamp_ns': due_ns,
        'peer': peer,
        'topic': names[peer],
        'level': health.OK if idle else health.WARN,
    }
