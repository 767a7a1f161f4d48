# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The wiring of a tick: which block reads and publishes what, in the order in which they act.

From it follow the table of topics, who waits for whom in lockstep, the columns of a log row, the
modules that are started, and what a recorded run is checked by.
"""

from typing import NamedTuple

from glider_model.base.signals import Adaptation

#: Joint names of joint_states and command, in the order of `glider_model.base.signals.Joints`.
JOINTS = ('buoyancy_engine', 'pitch_mass', 'roll_mass')

#: Frame names: the world (ENU), the body (FLU), the path frame of the tracking error.
MAP, BASE_LINK, PATH_FRAME = 'map', 'base_link', 'path'

_XYZ = ('x', 'y', 'z')
_POSE_AND_TWIST = (
    *(f'pose.pose.position.{axis}' for axis in _XYZ),
    *(f'pose.pose.orientation.{axis}' for axis in ('w', *_XYZ)),
    *(f'twist.twist.linear.{axis}' for axis in _XYZ),
    *(f'twist.twist.angular.{axis}' for axis in _XYZ),
)
_TWIST = tuple(f'twist.linear.{axis}' for axis in _XYZ)


class Port(NamedTuple):
    """What a per-tick topic carries, in the conventions of the topics (ENU / FLU, SI, rad)."""

    message: str  #: its ROS type
    fields: tuple[str, ...]  #: numbers that differ from tick to tick
    frame: str = ''  #: in its header
    child_frame: str = ''  #: of an odometry
    names: tuple[str, ...] = ()  #: of a JointState


def _odometry(child_frame: str) -> Port:
    return Port('nav_msgs/msg/Odometry', _POSE_AND_TWIST, MAP, child_frame)


def _named(names: tuple[str, ...]) -> Port:
    """Numbers with names and a stamp, which every plotting tool shows by name."""
    fields = tuple(f'position[{name}]' for name in names)
    return Port('sensor_msgs/msg/JointState', fields, names=names)


#: Every per-tick topic. The twist of the reference is expressed in `map`: desired velocity over
#: ground and Euler angle rates.
PORTS = {
    '/clock': Port('rosgraph_msgs/msg/Clock', ()),
    'odom': _odometry(BASE_LINK),
    'joint_states': _named(JOINTS),
    'current_velocity': Port('geometry_msgs/msg/TwistStamped', _TWIST, MAP),
    'reference': _odometry(MAP),
    'tracking_error': Port(
        'geometry_msgs/msg/Vector3Stamped', tuple(f'vector.{axis}' for axis in _XYZ), PATH_FRAME
    ),
    'current_estimate': Port('geometry_msgs/msg/TwistStamped', _TWIST, MAP),
    'command': _named(JOINTS),
    'wrench': Port(
        'geometry_msgs/msg/WrenchStamped',
        ('wrench.force.z', 'wrench.torque.x', 'wrench.torque.y'),
        BASE_LINK,
    ),
    'adaptation': _named(Adaptation._fields),
}
#: Numbers of each of them, by the names of their fields.
FIELDS = {topic: port.fields for topic, port in PORTS.items()}


class Wired(NamedTuple):
    """One block of the tick."""

    name: str
    package: str  #: that it belongs to
    inputs: tuple[str, ...]  #: topics; the one that comes last in a tick is the first here
    outputs: tuple[str, ...]  #: topics, in the order in which they are published

    @property
    def node(self) -> str:
        """Name of its node."""
        return f'{self.name}_node'

    @property
    def module(self) -> str:
        """Module of its node."""
        return f'{self.package}.nodes.{self.node}'


PLANT = Wired(
    'plant',
    'glider_model',
    inputs=('command', 'current_velocity'),
    outputs=('/clock', 'odom', 'joint_states'),
)
CURRENT = Wired('current', 'glider_model', inputs=('odom',), outputs=('current_velocity',))
GUIDANCE = Wired(
    'guidance',
    'glider_guidance',
    inputs=('odom',),
    outputs=('reference', 'tracking_error', 'current_estimate'),
)
CONTROL = Wired(
    'control',
    'glider_control',
    inputs=('reference', 'odom', 'joint_states'),
    outputs=('command', 'wrench', 'adaptation'),
)

#: In the order in which they act in a tick. The plant acts at both ends: what it measures begins
#: the tick, and it moves when all others have answered.
WIRING = (PLANT, CURRENT, GUIDANCE, CONTROL)


def publisher(topic: str) -> Wired:
    """Block that publishes a per-tick topic."""
    return next(block for block in WIRING if topic in block.outputs)


def readers(topic: str) -> tuple[Wired, ...]:
    """Blocks that cannot work without a per-tick topic."""
    return tuple(block for block in WIRING if topic in block.inputs)


def at_rest(topic: str) -> tuple[float, ...]:
    """Numbers of a message of a vehicle at rest: all zero, but for the identity quaternion."""
    return tuple(float(field.endswith('orientation.w')) for field in FIELDS[topic])
