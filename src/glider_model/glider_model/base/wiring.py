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

_XYZ = ('x', 'y', 'z')
_POSE_AND_TWIST = (
    *(f'pose.pose.position.{axis}' for axis in _XYZ),
    *(f'pose.pose.orientation.{axis}' for axis in ('w', *_XYZ)),
    *(f'twist.twist.linear.{axis}' for axis in _XYZ),
    *(f'twist.twist.angular.{axis}' for axis in _XYZ),
)
_POSITIONS = tuple(f'position[{name}]' for name in JOINTS)
_TWIST = tuple(f'twist.linear.{axis}' for axis in _XYZ)

#: Numbers that a message of each per-tick topic carries, by the names of their fields, in the
#: conventions of the topics (ENU / FLU, SI, rad).
FIELDS = {
    '/clock': (),
    'odom': _POSE_AND_TWIST,
    'joint_states': _POSITIONS,
    'current_velocity': _TWIST,
    'reference': _POSE_AND_TWIST,
    'tracking_error': tuple(f'vector.{axis}' for axis in _XYZ),
    'current_estimate': _TWIST,
    'command': _POSITIONS,
    'wrench': ('wrench.force.z', 'wrench.torque.x', 'wrench.torque.y'),
    'adaptation': tuple(f'position[{name}]' for name in Adaptation._fields),
}


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
