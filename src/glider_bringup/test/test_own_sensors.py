# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Navigation, free-running, with sensors at their own pace, or with none that can be believed."""

import math
import re
import time

import pytest
import rclpy
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
from nav_msgs.msg import Odometry
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import FluidPressure, Imu, JointState, NavSatFix

from glider_base.frames import OriginSettings
from glider_base.ros.lockstep import step_node
from glider_base.ros.lockstep.process import Stop
from glider_base.ros.lockstep.step_node import OLD_AFTER
from glider_base.ros.wire import qos
from glider_model.ocean.density import pressure_at
from glider_navigation.nodes.navigation_node import NavigationNode

JOINTS = ['buoyancy_engine', 'pitch_mass', 'roll_mass']
IMU_PERIOD_S, MAX_AGE_S = 0.5, 0.3
PARAMETERS = {
    **{'lockstep': False, 'input_max_age_s': MAX_AGE_S},
    **{'method': 'dead_reckoned', 'imu_period_s': IMU_PERIOD_S, 'gyro': False},
}
HERE = OriginSettings()
DEADLINE_S = 200.0


class Vehicle:
    """Publishes joint_states at 10 Hz, imu every 0.5 s, pressure every second; hears odom."""

    def __init__(self, context) -> None:
        self.node = rclpy.create_node('vehicle', namespace='/glider', context=context)
        kinds = {'joint_states': JointState, 'imu': Imu}
        kinds |= {'pressure': FluidPressure, 'fix': NavSatFix}
        self.out = {
            name: self.node.create_publisher(kind, name, 10) for name, kind in kinds.items()
        }
        self.odom, self.told = [], []
        self.quaternion, self.depth_m, self.silent, self.fix = (
            (1.0, 0.0, 0.0, 0.0),
            0.0,
            set(),
            None,
        )
        self.number = 0
        self.node.create_subscription(Odometry, 'odom', self.odom.append, 10)
        self.node.create_subscription(
            DiagnosticArray, '/diagnostics', self.on_diagnostics, qos.EVENTS
        )
        self.node.create_timer(0.1, self.publish)

    def on_diagnostics(self, array) -> None:
        self.told += [status.message for status in array.status]

    def publish(self) -> None:
        self.number += 1
        self.send('joint_states', JointState(name=JOINTS, position=[0.0, 0.0, 0.0]))
        if self.number % 5 == 0:
            imu = Imu()
            imu.orientation.w, imu.orientation.x, imu.orientation.y, imu.orientation.z = (
                self.quaternion
            )
            imu.angular_velocity_covariance[0] = -1.0
            imu.orientation.x += 1e-6 * (self.number % 2)  # no two samples are the same
            self.send('imu', imu)
        if self.number % 10 == 0:
            pressure = FluidPressure(fluid_pressure=float(pressure_at(self.depth_m)))
            self.send('pressure', pressure)
            if self.fix:
                self.send('fix', self.fix)

    def send(self, name: str, message) -> None:
        if name in self.silent:
            return
        message.header.stamp = self.node.get_clock().now().to_msg()
        if name != 'joint_states':
            message.header.frame_id = 'base_link'
        self.out[name].publish(message)

    def said(self, text: str) -> bool:
        return any(text in told for told in self.told)

    def misses(self, topic: str) -> bool:
        """Whether a topic was said to be missing; on a slow machine others may be."""
        return any('missing' in told and topic in told for told in self.told)

    def north_m(self) -> float:
        return self.odom[-1].pose.pose.position.y


class Flight:
    """Navigation, free-running, and a vehicle that has begun to talk to it."""

    def __init__(self, context, **more) -> None:
        overrides = [Parameter(name, value=value) for name, value in (PARAMETERS | more).items()]
        self.vehicle = Vehicle(context)
        self.navigation = NavigationNode(
            context=context, namespace='/glider', parameter_overrides=overrides
        )
        self.executor = SingleThreadedExecutor(context=context)
        self.executor.add_node(self.vehicle.node)
        self.executor.add_node(self.navigation)

    def until(self, condition) -> None:
        end = time.monotonic() + DEADLINE_S
        while not condition():
            assert time.monotonic() < end
            self.executor.spin_once(timeout_sec=0.1)

    def go_on(self, count: int) -> None:
        """Until so many more odom have come."""
        before = len(self.vehicle.odom)
        self.until(lambda: len(self.vehicle.odom) >= before + count)

    def wait(self, wall_s: float) -> None:
        """So much wall time."""
        until_s = time.monotonic() + wall_s
        self.until(lambda: time.monotonic() > until_s)

    def close(self) -> None:
        self.executor.shutdown()
        self.navigation.close()
        self.navigation.destroy_node()
        self.vehicle.node.destroy_node()


@pytest.fixture
def flight(context):
    flight = Flight(context)
    try:
        flight.until(lambda: flight.vehicle.odom)
        flight.vehicle.told.clear()
        yield flight
    finally:
        flight.close()


def stamp_ns(message) -> int:
    """Time of a message (ns)."""
    return 1_000_000_000 * message.header.stamp.sec + message.header.stamp.nanosec


def a_fix(north_m: float, status: int = 0) -> NavSatFix:
    """Fix north of the origin."""
    fix = NavSatFix(latitude=HERE.latitude_deg + north_m / HERE.params().north)
    fix.longitude, fix.status.status = HERE.longitude_deg, status
    fix.position_covariance[0] = fix.position_covariance[4] = 1.0
    return fix


def test_slow_sensors_and_no_fix_at_all_are_neither_stale_nor_lost(flight):
    start_s = time.monotonic()
    flight.go_on(60)
    assert time.monotonic() - start_s < 12.0
    assert not any(map(flight.vehicle.misses, ('imu', 'pressure', 'fix')))
    # a machine that is busy brings several ticks at once, for a while
    flight.until(lambda: len({*map(stamp_ns, flight.vehicle.odom[-50:])}) > 40)
    counted = [item.topic.name for item in flight.navigation.inputs if item.lost or item.late]
    assert not {'imu', 'pressure', 'fix'} & set(counted)


@pytest.mark.parametrize('name', ['imu', 'pressure'])
def test_sensor_that_is_silent_for_long_makes_navigation_silent(flight, name):
    vehicle = flight.vehicle
    vehicle.silent = {name}
    start_s = time.monotonic()
    flight.until(lambda: vehicle.said(f'missing or stale: {name}; silent until then'))
    assert time.monotonic() - start_s > OLD_AFTER * IMU_PERIOD_S - 2 * IMU_PERIOD_S
    count = len(vehicle.odom)
    flight.wait(1.0)
    assert len(vehicle.odom) <= count + 1  # which was under way
    vehicle.silent = set()
    flight.until(lambda: vehicle.said('inputs are fresh again'))
    flight.go_on(3)


def test_fix_counts_at_the_surface_and_is_forgotten_when_it_is_old(flight):
    vehicle, heard, step = flight.vehicle, [], flight.navigation.step
    flight.navigation.step = lambda stamp_ns, *inputs: (
        heard.append(inputs) or step(stamp_ns, *inputs)
    )
    vehicle.depth_m = 6.0
    flight.until(lambda: vehicle.odom[-1].pose.pose.position.z < -4.0)
    vehicle.fix = a_fix(100.0)
    flight.go_on(20)
    assert abs(vehicle.north_m()) < 20.0  # nobody believes it under water
    vehicle.depth_m = 0.0
    flight.until(lambda: vehicle.north_m() > 50.0)
    assert heard[-1][-1][0] == 0.0
    vehicle.fix = None
    flight.until(lambda: heard[-1][-1] == (-1.0, 0.0, 0.0, 0.0, 0.0))
    assert not vehicle.misses('fix')


@pytest.mark.parametrize(('degrees', 'far'), [((122.0, 36.0), '9,5'), ((0.0, 0.0), '1[01],')])
def test_fix_of_another_sea_is_refused_and_named(flight, degrees, far):
    """Swapped, or with an origin that nobody has set."""
    vehicle = flight.vehicle
    vehicle.fix = a_fix(0.0)
    vehicle.fix.latitude, vehicle.fix.longitude = degrees
    flight.until(lambda: vehicle.said('km from the origin, 36, 122'))
    assert any(re.search(f'message refused: fix: .*: {far}.* km from', x) for x in vehicle.told)
    flight.go_on(20)
    assert abs(vehicle.north_m()) < 20.0


@pytest.mark.parametrize('variances', [(-1.0, 1.0), (1.0, -1.0), (1e300, 1e300)])
def test_fix_with_a_covariance_that_is_none_is_refused_and_named(flight, variances):
    vehicle = flight.vehicle
    vehicle.fix = fix = a_fix(100.0)
    fix.position_covariance[0], fix.position_covariance[4] = variances
    flight.until(lambda: vehicle.said('message refused: fix: position_covariance is '))
    flight.go_on(20)
    assert abs(vehicle.north_m()) < 20.0


@pytest.mark.parametrize('number', [0.0, math.nan])
def test_receiver_without_a_fix_is_heard_in_peace(flight, number):
    vehicle = flight.vehicle
    vehicle.fix = a_fix(100.0, status=-1)
    vehicle.fix.latitude = vehicle.fix.longitude = number
    flight.go_on(30)
    assert not vehicle.said('refused')
    assert not vehicle.misses('fix')
    assert abs(vehicle.north_m()) < 20.0


def test_who_waits_for_a_clock_that_nobody_publishes_says_so_once(context, monkeypatch):
    monkeypatch.setattr(step_node, '_STANDS_S', 0.5)
    flight = Flight(context, use_sim_time=True)
    try:
        flight.until(lambda: flight.vehicle.said('use_sim_time, and no /clock'))
        flight.wait(2.0)
        assert sum('/clock' in told for told in flight.vehicle.told) == 1
        assert not flight.vehicle.odom
    finally:
        flight.close()


def test_a_clock_that_runs_backwards_is_told(context, monkeypatch):
    monkeypatch.setattr(step_node, '_STANDS_S', 1.0)
    flight, left_s = Flight(context, use_sim_time=True), iter(range(10**6, 0, -1))
    try:
        clock = flight.vehicle.node.create_publisher(Clock, '/clock', 1)

        def is_told() -> bool:
            clock.publish(Clock(clock=Time(sec=next(left_s))))
            return flight.vehicle.said('use_sim_time, and no /clock that goes on')

        flight.until(lambda: flight.navigation.now_s() > 0.0 or is_told())
        flight.vehicle.told.clear()
        flight.until(is_told)
    finally:
        flight.close()


def test_a_negative_time_is_refused_and_ends_no_node(context):
    """As of a vehicle that counts down to its release."""
    flight = Flight(context, use_sim_time=True)
    try:
        clock = flight.vehicle.node.create_publisher(Clock, '/clock', 1)

        def is_told(sec: int, condition) -> bool:
            clock.publish(Clock(clock=Time(sec=sec)))
            return condition()

        flight.until(lambda: is_told(5, lambda: flight.navigation.now_s() == 5.0))
        said = 'message refused: /clock: clock.sec is -5 (allowed: >= 0)'
        flight.until(lambda: is_told(-5, lambda: flight.vehicle.said(said)))
        flight.until(lambda: is_told(6, lambda: flight.navigation.now_s() == 6.0))
    finally:
        flight.close()


def test_two_sources_of_time_are_named(context):
    flight = Flight(context, use_sim_time=True)
    other = rclpy.create_node('vehicle', namespace='/other', context=context)
    try:
        for node in (other, flight.vehicle.node):
            node.create_publisher(Clock, '/clock', 1)
        said = '/clock is published by /glider/vehicle and /other/vehicle'
        flight.until(lambda: flight.vehicle.said(said))
    finally:
        flight.close()
        other.destroy_node()


def test_attitude_that_is_none_is_refused_and_named(flight):
    vehicle = flight.vehicle
    vehicle.quaternion = (0.0, 0.0, 0.0, 0.0)
    flight.until(lambda: vehicle.said('message refused: imu: orientation is'))
    flight.until(lambda: vehicle.said('missing or stale: imu'))


def test_managed_node_acts_while_it_is_active_and_forgets_when_it_is_configured(context, capfd):
    flight = Flight(context, managed=True, input_max_age_s=DEADLINE_S)
    vehicle, services = flight.vehicle, '/glider/navigation_node'
    change = vehicle.node.create_client(ChangeState, f'{services}/change_state')
    tell = vehicle.node.create_client(GetState, f'{services}/get_state')

    def answer(client, request):
        said = client.call_async(request)
        flight.until(said.done)
        return said.result()

    def state_after(label: str) -> str:
        request = ChangeState.Request()
        request.transition.label = label
        assert answer(change, request).success
        return answer(tell, GetState.Request()).current_state.label

    try:
        flight.until(change.service_is_ready)
        assert 'silent until it is configured and activated' in capfd.readouterr().err
        for number in (Transition.TRANSITION_ACTIVATE, 99):  # by its number, as managers ask
            request = ChangeState.Request()
            request.transition.id = number
            assert not answer(change, request).success
        assert state_after('configure') == 'inactive'
        flight.wait(1.0)
        assert not vehicle.odom
        assert state_after('activate') == 'active'
        vehicle.depth_m = 6.0
        flight.until(lambda: vehicle.odom and vehicle.odom[-1].pose.pose.position.z < -4.0)
        vehicle.depth_m, vehicle.fix = 0.0, a_fix(100.0)
        flight.until(lambda: vehicle.north_m() > 50.0)
        vehicle.fix = None
        assert state_after('deactivate') == 'inactive'
        flight.until(lambda: vehicle.said('deactivated: silent until it is activated'))
        count = len(vehicle.odom)
        flight.wait(1.0)
        assert len(vehicle.odom) == count
        assert state_after('activate') == 'active'
        flight.go_on(5)
        assert vehicle.north_m() > 50.0  # it goes on with what it knows
        for label in ('deactivate', 'cleanup', 'configure', 'activate'):
            state_after(label)
        vehicle.odom.clear()
        flight.until(lambda: len(vehicle.odom) > 5)
        assert abs(vehicle.north_m()) < 20.0  # it knows nothing
        # it begins anew also if nothing has come since it was silenced
        vehicle.silent = {'joint_states'}
        flight.wait(0.5)
        for label in ('deactivate', 'cleanup', 'configure', 'activate'):
            state_after(label)
        vehicle.odom.clear()
        flight.go_on(2)
        with pytest.raises(Stop):
            state_after('shutdown')
            flight.wait(DEADLINE_S)
    finally:
        flight.close()
