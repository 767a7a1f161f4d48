# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Transforms are the odometry, at a rate that does not grow with the speed of the run."""

import math
import sys
import time
from types import ModuleType, SimpleNamespace

import pytest
import rclpy
from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import Odometry
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from rclpy.serialization import serialize_message

from glider_base.ros.wire import qos
from glider_base.settings import ConfigurationError
from glider_model.nodes.tf_node import TF_QOS, TfNode, transform_of

ANGLE = 0.7


def odometry(tick: int) -> Odometry:
    """Odometry that tells its tick."""
    message = Odometry(child_frame_id='base_link')
    message.header.frame_id = 'map'
    message.header.stamp.sec = tick
    position = message.pose.pose.position
    position.x, position.y, position.z = 1.0 * tick, -2.0, -30.0
    orientation = message.pose.pose.orientation
    orientation.w, orientation.y = math.cos(ANGLE), math.sin(ANGLE)
    return message


def stand_in(published: list):
    """A module like tf2_msgs.msg, whose messages go into a list instead of the middleware."""
    module = ModuleType('tf2_msgs.msg')
    module.TFMessage = SimpleNamespace
    create = TfNode.create_publisher

    def create_publisher(self, kind, topic, *arguments, **options):
        if kind is SimpleNamespace:
            return SimpleNamespace(publish=published.append, topic=topic, options=arguments)
        return create(self, kind, topic, *arguments, **options)

    return module, create_publisher


@pytest.fixture
def published(monkeypatch) -> list:
    """What a node publishes where tf2_msgs is only a stand-in."""
    published = []
    module, create_publisher = stand_in(published)
    monkeypatch.setitem(sys.modules, 'tf2_msgs', ModuleType('tf2_msgs'))
    monkeypatch.setitem(sys.modules, 'tf2_msgs.msg', module)
    monkeypatch.setattr(TfNode, 'create_publisher', create_publisher)
    return published


def parameters(**values) -> list[Parameter]:
    return [Parameter(name, value=value) for name, value in values.items()]


def fly(context, node, others=(), ticks=40, every_s=0.01) -> None:
    """Publish odometry of one tick after the other, to a node that is spun meanwhile."""
    plant = rclpy.create_node('plant_node', context=context)
    publisher = plant.create_publisher(Odometry, 'odom', qos.PER_TICK)
    executor = SingleThreadedExecutor(context=context)
    for one in (node, *others):
        executor.add_node(one)
    deadline = time.monotonic() + 60.0
    while not publisher.get_subscription_count() and time.monotonic() < deadline:
        executor.spin_once(timeout_sec=0.02)
    for tick in range(ticks):
        publisher.publish(odometry(tick))
        next_s = time.monotonic() + every_s
        while time.monotonic() < next_s:
            executor.spin_once(timeout_sec=every_s / 4)
    for _ in range(40):
        executor.spin_once(timeout_sec=0.02)
    plant.destroy_node()


@pytest.mark.parametrize(
    ('prefix', 'said', 'child'),
    [
        ('', 'base_link', 'base_link'),
        ('one/', 'base_link', 'one/base_link'),
        ('one/', 'one/base_link', 'one/base_link'),  # of a driver that has put it there itself
    ],
)
def test_transform_is_the_pose_of_the_odometry(prefix, said, child):
    source = odometry(7)
    source.child_frame_id = said
    transform = transform_of(source, prefix)
    assert isinstance(transform, TransformStamped)
    assert (transform.header.frame_id, transform.child_frame_id) == ('map', child)
    assert transform.header.stamp == source.header.stamp
    translation = transform.transform.translation
    assert (translation.x, translation.y, translation.z) == (7.0, -2.0, -30.0)
    assert transform.transform.rotation == source.pose.pose.orientation


def test_newest_odometry_is_published_once_each(context, published):
    node = TfNode(context=context, parameter_overrides=parameters(frame_prefix='one/'))
    assert node.publisher.topic == '/tf'
    assert node.publisher.options == (TF_QOS,)
    fly(context, node)
    (*_, last) = transforms = [message.transforms[0] for message in published]
    assert all(len(message.transforms) == 1 for message in published)
    stamps = [transform.header.stamp.sec for transform in transforms]
    assert stamps == sorted(set(stamps))
    assert (stamps[-1], last.child_frame_id) == (39, 'one/base_link')
    node.destroy_node()


def test_odometry_that_has_lost_its_attitude_is_no_transform(context, published):
    node = TfNode(context=context)
    for tick, attitude in enumerate((math.cos(ANGLE), 0.0, math.cos(ANGLE))):
        message = odometry(tick)
        q = message.pose.pose.orientation
        q.w, q.y = attitude, attitude and math.sin(ANGLE)
        node.keep(serialize_message(message))
        node.on_timer()
    assert [told.transforms[0].header.stamp.sec for told in published] == [0, 2]
    node.destroy_node()


def test_fast_run_is_thinned_out(context, published):
    """1000 ticks in a burst: far fewer transforms, and the last one among them."""
    node = TfNode(context=context, parameter_overrides=parameters(rate_hz=5.0))
    fly(context, node, ticks=1000, every_s=0.0)
    assert 1 <= len(published) < 100
    assert published[-1].transforms[0].header.stamp.sec == 999
    node.destroy_node()


@pytest.mark.parametrize(
    ('values', 'words'),
    [({'frame_prefix': 'a b'}, 'frame_prefix'), ({'rate_hz': 0.0}, 'rate_hz.*0.1 to 1000')],
)
def test_wrong_parameter_is_refused(context, published, values, words):
    with pytest.raises(ConfigurationError, match=words):
        TfNode(context=context, parameter_overrides=parameters(**values))


def test_without_tf2_msgs_it_says_what_is_missing(context, monkeypatch):
    monkeypatch.setitem(sys.modules, 'tf2_msgs', None)
    monkeypatch.setitem(sys.modules, 'tf2_msgs.msg', None)
    with pytest.raises(ConfigurationError, match='tf2_msgs is not installed'):
        TfNode(context=context)


def test_transforms_arrive_with_the_real_message(context):
    messages = pytest.importorskip('tf2_msgs.msg', reason='tf2_msgs is not installed')
    got = []
    viewer = rclpy.create_node('viewer', context=context)
    viewer.create_subscription(messages.TFMessage, '/tf', got.append, TF_QOS)
    node = TfNode(context=context, namespace='/glider')
    plant_side = TfNode(context=context, parameter_overrides=parameters(frame_prefix='two/'))
    fly(context, plant_side, others=[node, viewer])
    assert got[-1].transforms[0].child_frame_id == 'two/base_link'
    assert got[-1].transforms[0].transform.translation.x == 39.0
