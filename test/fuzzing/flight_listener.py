# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Hears from outside how far a flight over nodes is, and what of it the recorder acknowledges."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import rclpy
from rclpy.context import Context
from rclpy.node import Node

from glider_base.ros.lockstep.executor import Gate, take
from glider_base.ros.places import NAMESPACE
from glider_base.ros.wire import qos
from glider_base.ros.wire.topics import TOPICS, Topic
from glider_base.signals import TICK_NS

#: What keeps a listener out of shared memory, in which it would have a part of what is left there;
#: on this machine's own network all the same.
_UDP_ONLY = {
    'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SYSTEM_DEFAULT',
    'FASTRTPS_DEFAULT_PROFILES_FILE': str(Path(__file__).with_name('listener.xml')),
}


class Heard:
    """What was heard of a flight; -1 before anything is.

    Attributes
    ----------
    tick : int
        Newest tick that the plant has begun.
    acknowledged : int
        Newest tick that the recorder has acknowledged.
    """

    def __init__(self, node: Node) -> None:
        self.tick = self.acknowledged = -1
        self._clock = self._subscribe(node, TOPICS['/clock'], qos.NEWEST)
        self._recorded = self._subscribe(node, TOPICS['recorded'], TOPICS['recorded'].qos)

    def _subscribe(self, node: Node, topic: Topic, profile):
        name, group = topic.full_name(NAMESPACE), Gate()
        return node.create_subscription(
            topic.message_type, name, print, profile, callback_group=group
        )

    def take(self) -> 'Heard':
        """Take what has come; gives itself."""
        while (message := take(self._clock)) is not None:
            self.tick = _tick(message.clock)
        while (message := take(self._recorded)) is not None:
            self.acknowledged = _tick(message.stamp)
        return self


def _tick(stamp) -> int:
    return (stamp.sec * 1_000_000_000 + stamp.nanosec) // TICK_NS


@contextmanager
def flight_heard(domain: int) -> Iterator[Heard]:
    """Listen to the glider in a ROS domain."""
    before = {name: os.environ.get(name) for name in _UDP_ONLY}
    os.environ.update(_UDP_ONLY)
    try:
        context = Context()
        rclpy.init(context=context, domain_id=domain)
        node = Node(
            'listener', context=context, enable_rosout=False, start_parameter_services=False
        )
    finally:
        for name, value in before.items():
            del os.environ[name]
            if value is not None:
                os.environ[name] = value
    try:
        yield Heard(node)
    finally:
        node.destroy_node()
        rclpy.shutdown(context=context)
