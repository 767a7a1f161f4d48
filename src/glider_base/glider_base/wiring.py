# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The wiring of a tick: which block reads and publishes what, in the order in which they act.

From it follow the table of topics, who waits for whom in lockstep, the columns of a log row, the
modules that are started, and what a recorded run is checked by.
"""

import math
from collections.abc import Iterable
from typing import NamedTuple

from glider_base.signals import Adaptation, Battery, Health

#: Joint names of joint_states and command, in the order of `glider_base.signals.Joints`.
JOINTS = ('buoyancy_engine', 'pitch_mass', 'roll_mass')
#: Field of a joint that comes after them: the steering surface, called as in the vehicle's file.
#: A vehicle without one has no such name in its messages, and the number 0.0 beside them.
SURFACE = 'position[<surface>]'

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
#: Covariance of the horizontal part, row by row, in a matrix of 6 x 6.
_XX_XY_YX_YY = (0, 1, 6, 7)


class Port(NamedTuple):
    """What a per-tick topic carries, in the conventions of the topics (ENU / FLU, SI, rad)."""

    message: str  #: its ROS type
    fields: tuple[str, ...]  #: numbers that differ from tick to tick
    frame: str = ''  #: in its header
    child_frame: str = ''  #: of an odometry
    names: tuple[str, ...] = ()  #: of a JointState
    constants: tuple[tuple[str, float], ...] = ()  #: other fields, the same in every message


def _odometry(child_frame: str, more: tuple[str, ...] = ()) -> Port:
    return Port('nav_msgs/msg/Odometry', (*_POSE_AND_TWIST, *more), MAP, child_frame)


def _current() -> Port:
    """Horizontal current with its covariance."""
    fields = (
        *(f'twist.twist.linear.{axis}' for axis in ('x', 'y')),
        *(f'twist.covariance[{i}]' for i in _XX_XY_YX_YY),
    )
    return Port('geometry_msgs/msg/TwistWithCovarianceStamped', fields, MAP)


def _named(names: tuple[str, ...]) -> Port:
    """Numbers with names and a stamp, which every plotting tool shows by name."""
    fields = tuple(f'position[{name}]' for name in names)
    return Port('sensor_msgs/msg/JointState', fields, names=names)


def _joints() -> Port:
    """Positions of the actuators."""
    return Port('sensor_msgs/msg/JointState', (*_named(JOINTS).fields, SURFACE), names=JOINTS)


#: An altimeter hears a bottom that is so far away (m), and says so where it hears none: by
#: sensor_msgs/Range a number outside of the two is to be thrown away.
ALTIMETER_REACH_M, NO_ECHO = (0.5, 100.0), 0.0

#: Status of a sensor_msgs/BatteryState: POWER_SUPPLY_STATUS_DISCHARGING.
DISCHARGES = 2

#: Every per-tick topic. The twist of the reference is expressed in `map`: desired velocity over
#: ground and Euler angle rates.
PORTS = {
    '/clock': Port('rosgraph_msgs/msg/Clock', ()),
    'ground_truth/odom': _odometry(BASE_LINK),
    'measured_odom': _odometry(BASE_LINK),
    'imu': Port(
        'sensor_msgs/msg/Imu',
        (
            *(f'orientation.{axis}' for axis in ('w', *_XYZ)),
            *(f'angular_velocity.{axis}' for axis in _XYZ),
            'angular_velocity_covariance[0]',
        ),
        BASE_LINK,
        constants=(('linear_acceleration_covariance[0]', -1),),
    ),
    'pressure': Port('sensor_msgs/msg/FluidPressure', ('fluid_pressure',), BASE_LINK),
    'fix': Port(
        'sensor_msgs/msg/NavSatFix',
        (
            'status.status',
            'latitude',
            'longitude',
            'position_covariance[0]',
            'position_covariance[4]',
        ),
        BASE_LINK,
        constants=(
            *(('status.service', 1), ('position_covariance_type', 2)),
            ('altitude', math.nan),  # nobody measures it
        ),
    ),
    'altitude': Port(
        'sensor_msgs/msg/Range',
        ('range',),
        BASE_LINK,
        constants=(('min_range', ALTIMETER_REACH_M[0]), ('max_range', ALTIMETER_REACH_M[1])),
    ),
    'health': _named(Health._fields),
    'battery': Port(
        'sensor_msgs/msg/BatteryState',
        Battery._fields,
        BASE_LINK,
        constants=(
            *(('temperature', math.nan), ('design_capacity', math.nan)),  # nobody measures them
            *(('power_supply_status', DISCHARGES), ('present', True)),
        ),
    ),
    'joint_states': _joints(),
    'current_velocity': Port('geometry_msgs/msg/TwistStamped', _TWIST, MAP),
    'odom': _odometry(BASE_LINK, tuple(f'pose.covariance[{i}]' for i in _XX_XY_YX_YY)),
    'believed_current': _current(),
    'believed_surface_current': _current(),
    'reference': _odometry(MAP),
    'tracking_error': Port(
        'geometry_msgs/msg/Vector3Stamped', tuple(f'vector.{axis}' for axis in _XYZ), PATH_FRAME
    ),
    'current_estimate': Port('geometry_msgs/msg/TwistStamped', _TWIST, MAP),
    'demand': _joints(),
    'wrench': Port(
        'geometry_msgs/msg/WrenchStamped',
        ('wrench.force.z', 'wrench.torque.x', 'wrench.torque.y'),
        BASE_LINK,
    ),
    'adaptation': _named(Adaptation._fields),
    'command': _joints(),
    'drop_weight': _named(('release',)),
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


#: What a vehicle may be able to measure. Each way to navigate reads some of it, and of this alone
#: there are messages in a run; where a table has a column for each topic, the others are zero.
SENSORS = ('measured_odom', 'imu', 'pressure', 'fix', 'altitude')
#: What a vehicle has samples of as often as its `imu_period_s` says, and not in every tick.
SAMPLED = ('imu', 'pressure', 'fix', 'battery')
#: Age (s) from which on a topic is silent that need not come often.
SLOW_S = {'battery': 600.0, 'health': 10.0, 'altitude': 5.0}
#: What stands for a topic that may be silent for as long as it likes: under water there is no fix,
#: far above the bottom no echo. A vehicle need not say how it is, either: less than nothing is not
#: measured.
WHEN_SILENT = {
    'fix': (-1.0, 0.0, 0.0, 0.0, 0.0),
    'altitude': (NO_ECHO,),
    'health': (0.0, -1.0, -1.0),
    'battery': (-1.0, 0.0, -1.0, -1.0, -1.0),
}
#: Of those of them, what says how the vehicle is: a number that is NaN is not measured.
CONDITION = ('health', 'battery')
#: What ways to navigate may tell beside odom; the same holds for them as for `SENSORS`.
ESTIMATES = ('believed_current', 'believed_surface_current')

PLANT = Wired(
    'plant',
    'glider_model',
    inputs=('command', 'current_velocity', 'drop_weight'),
    outputs=('/clock', 'ground_truth/odom', *SENSORS, 'health', 'battery', 'joint_states'),
)
CURRENT = Wired(
    'current', 'glider_model', inputs=('ground_truth/odom',), outputs=('current_velocity',)
)
NAVIGATION = Wired(
    'navigation',
    'glider_navigation',
    inputs=('joint_states', *SENSORS),
    outputs=('odom', *ESTIMATES),
)
GUIDANCE = Wired(
    'guidance',
    'glider_guidance',
    inputs=('odom', 'altitude'),
    outputs=('reference', 'tracking_error', 'current_estimate'),
)
CONTROL = Wired(
    'control',
    'glider_control',
    inputs=('reference', 'odom', 'joint_states'),
    outputs=('demand', 'wrench', 'adaptation'),
)
GUARD = Wired(
    'guard',
    'glider_guard',
    inputs=(
        *('demand', 'reference', 'odom', 'joint_states', 'health', 'battery', 'pressure'),
        'altitude',
    ),
    outputs=('command', 'drop_weight'),
)

#: In the order in which they act in a tick. The plant acts at both ends: what it measures begins
#: the tick, and it moves when all others have answered.
WIRING = (PLANT, CURRENT, NAVIGATION, GUIDANCE, CONTROL, GUARD)


def present(names: Iterable[str], topics: Iterable[str]) -> tuple[str, ...]:
    """Those of the names that there are in a run with these of `SENSORS` and `ESTIMATES`."""
    left_out = {*SENSORS, *ESTIMATES}.difference(topics)
    return tuple(name for name in names if name not in left_out)


def publisher(topic: str) -> Wired:
    """Block that publishes a per-tick topic."""
    return next(block for block in WIRING if topic in block.outputs)


def readers(topic: str) -> tuple[Wired, ...]:
    """Blocks that cannot work without a per-tick topic."""
    return tuple(block for block in WIRING if topic in block.inputs)


def at_rest(topic: str) -> tuple[float, ...]:
    """Numbers of a message of a vehicle at rest: all zero, but for the identity quaternion."""
    return tuple(float(field.endswith('orientation.w')) for field in FIELDS[topic])


def not_fitted(topic: str) -> tuple[float, ...]:
    """Numbers in the place of a sensor that is not fitted: all zero, and no fix."""
    return WHEN_SILENT.get(topic, len(FIELDS[topic]) * (0.0,))
