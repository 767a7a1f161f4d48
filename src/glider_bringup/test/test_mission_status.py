# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""How a mission goes, as a pilot is told: what is foretold comes true, and orders are answered."""

import math

import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from rclpy.qos import ReliabilityPolicy
from sensor_msgs.msg import BatteryState
from std_srvs.srv import Trigger

import glider_bringup as glider
from glider_base.ros.wire import qos
from glider_base.ros.wire.codec import to_cdr
from glider_base.ros.wire.topics import TOPICS
from glider_base.wiring import at_rest
from glider_guidance.nodes.guidance_node import GuidanceNode
from glider_model.vehicle.file import load_vehicle

DIVES = {'profile.depth_m': 100.0, 'profile.surface_every_dives': 2, 'profile.wait_s': 60.0}
STILL = {'current.speed_mps': 0.0, 'dives': 0}
LEGS = {'kind': 'waypoints', 'waypoints': [[0, 0], [700, 0], [700, 500]], 'at_end': 'stop'}


def surfaced(flight) -> float:
    """Time of the next surfacing (s)."""
    flight.until('surfacing')
    return flight.t_s


def test_next_surfacing_and_arrival_come_when_they_are_foretold():
    flight = glider.Flight('current_8deg', {**DIVES, **STILL, 'path': LEGS})
    assert flight.status.next_surfacing_s == 0.0 and flight.status.legs == 2
    flight.until(t_s=300.0)
    told = flight.status
    assert (told.leg, told.dives, told.stage) == (1, 0, 'gliding down')
    assert 900.0 < told.to_go_m < 1200.0
    up_s = surfaced(flight)
    assert told.t_s + told.next_surfacing_s == pytest.approx(up_s, rel=0.1)
    assert flight.until('arrival').name == 'arrival'
    assert told.t_s + told.eta_s == pytest.approx(flight.t_s, rel=0.2)
    assert flight.status.leg == 2 and abs(flight.status.to_go_m) < 30.0


@pytest.mark.parametrize('sets_deg', [0.0, 180.0])
def test_arrival_comes_when_it_is_foretold_though_the_current_acts_on_at_the_surface(sets_deg):
    path = {'kind': 'straight', 'length_m': 3000.0, 'at_end': 'stop'}
    stays = {'profile.surface_every_dives': 1, 'profile.wait_s': 600.0, 'path': path}
    current = {'current.speed_mps': 0.1, 'current.direction_deg': sets_deg}
    flight = glider.Flight('current_8deg', {**DIVES, **STILL, **stays, **current}, duration=60000)
    flight.until(t_s=3000.0)  # by then it knows the current
    told = flight.status
    assert flight.until('arrival').name == 'arrival'
    assert told.eta_s == pytest.approx(flight.t_s - told.t_s, rel=0.08)


def test_energy_that_is_left_is_what_the_ledger_has_not_spent():
    flight = glider.Flight('current_8deg', {**DIVES, **STILL, 'path': LEGS})
    assert flight.status.energy_left_wh == float('inf')  # nothing was heard yet
    flight.until(t_s=300.0)
    before, told = flight.state, flight.status
    flight.until(t_s=600.0)
    *spent_j, _power, _call = flight.state.kept.mission.plant.ledger
    capacity_wh = load_vehicle('zhang2021').energy.capacity.value
    left_wh = flight.status.energy_left_wh
    assert left_wh == pytest.approx(capacity_wh - sum(spent_j) / 3600.0, abs=1e-3)
    assert told.energy_left_wh > left_wh + 0.01
    assert flight.restore(before).status == told


def test_to_go_grows_for_who_is_carried_back():
    flight = glider.Flight(
        'current_8deg', {**DIVES, 'current.speed_mps': 0.6, 'current.direction_deg': 180.0}
    )
    flight.until(t_s=2000.0)
    assert flight.status.to_go_m > 25000.0
    assert flight.status.eta_s == float('inf')


def test_nobody_knows_when_one_arrives_that_holds_or_has_aborted():
    flight = glider.Flight('current_8deg', {**DIVES, 'current.speed_kn': 0.0})
    flight.until(t_s=900.0)
    eta_s = [flight.status.eta_s]
    for asked in ('hold', 'resume', 'abort'):
        flight.order(**{asked: True})
        flight.step(10)
        eta_s.append(flight.status.eta_s)
    assert [math.isinf(one) for one in eta_s] == [False, True, False, True]


def test_who_holds_is_told_when_it_is_up():
    flight = glider.Flight('current_8deg', DIVES)
    flight.until(t_s=900.0)
    flight.order(hold=True)
    flight.step(10)
    told = flight.status
    assert told.t_s + told.next_surfacing_s == pytest.approx(surfaced(flight), abs=120.0)


def test_a_node_tells_it_once_a_second_and_answers_orders(context):
    node = GuidanceNode(context=context, parameter_overrides=[])
    listener = rclpy.create_node('listener', context=context)
    heard, executor = [], SingleThreadedExecutor(context=context)
    listener.create_subscription(DiagnosticArray, 'mission/status', heard.append, qos.LATCHED)
    executor.add_node(listener)
    inputs = at_rest('odom'), at_rest('altitude')

    def told(tick: int) -> dict[str, str]:
        node.step(tick * 10**8, *inputs[: len(node.inputs)])
        before = len(heard)
        while len(heard) == before:
            executor.spin_once(timeout_sec=30.0)
        (status,) = heard[-1].status
        return {pair.key: pair.value for pair in status.values}

    try:
        first = told(0)
        assert first['stage'] == 'surface preparation' and first['order'] == ''
        assert float(first['to_go_m']) == pytest.approx(25000.0)
        assert first['energy_left_wh'] == 'inf'  # no battery has said anything
        node.set_parameters_atomically([Parameter('profile.depth_m', value=200.0)])
        node.step(5 * 10**8, *inputs[: len(node.inputs)])
        assert told(10)['order'] == 'taken: profile.depth_m'
        assert len(heard) == 2
        node.set_parameters_atomically([Parameter('profile.depth_m', value=9000.0)])
        node.on_battery(TOPICS['battery'].codec.encode(0, (12.0, -0.5, 15.5, 20.0, 0.775)))
        last = told(20)
        assert last['order'].startswith('order refused: ')
        assert float(last['energy_left_wh']) == pytest.approx(12.0 * 15.5)
        assert told(7000)['energy_left_wh'] == 'inf'  # the battery has been silent too long
        node.on_battery(
            TOPICS['battery'].codec.encode(7 * 10**11, (12.0, -0.5, 15.5, 20.0, 0.775))
        )
        assert float(told(7010)['energy_left_wh']) == pytest.approx(12.0 * 15.5)
        # sensor_msgs says of what is not measured NaN
        node.on_battery(to_cdr(BatteryState(voltage=12.0, charge=15.5, current=math.nan)))
        assert told(7020)['energy_left_wh'] == 'inf'
        node.on_battery(b'no battery')
        assert told(7030)['energy_left_wh'] == 'inf'
        degrees = '{"kind": "waypoints", "waypoints_latlon": [[36.0, 122.0], [36.05, 122.0]]}'
        said = node.set_parameters_atomically([Parameter('path', value=degrees)])
        assert not said.successful and 'no chart on board (allowed: waypoints, in m' in said.reason
        # after an abort there are no more orders, as for a flight in one's hands
        assert node.on_abort(None, Trigger.Response()).success
        for order in (Parameter('profile.depth_m', value=300.0), Parameter('hold', value=True)):
            said = node.set_parameters_atomically([order])
            assert not said.successful and 'the mission is aborted' in said.reason
        assert 'hold: the mission is aborted' in told(7040)['order']
        assert node.set_parameters_atomically([Parameter('los.delta2', value=2.0)]).successful
    finally:
        node.close()
        node.destroy_node()
        listener.destroy_node()


def test_a_free_running_node_hears_a_battery_that_is_not_reliable(context):
    """As drivers publish what sensors say."""
    node = GuidanceNode(context=context, parameter_overrides=[Parameter('lockstep', value=False)])
    try:
        (heard,) = node.get_subscriptions_info_by_topic('battery')
        assert heard.qos_profile.reliability is ReliabilityPolicy.BEST_EFFORT
    finally:
        node.close()
        node.destroy_node()


@pytest.mark.parametrize('set_by_s', [56 * 365.25 * 86400.0, -900.0])
def test_orders_that_are_known_before_hold_in_time_though_the_clock_is_set(context, set_by_s):
    """By a first fix, as that of a vehicle is: they count the time that passes."""
    told = {'lockstep': False, 'orders': '[{"at_s": 5.0, "depth_m": 300.0}]'}
    overrides = [Parameter(name, value=value) for name, value in told.items()]
    node = GuidanceNode(context=context, parameter_overrides=overrides)
    try:
        followed = []
        for tick in range(70):
            stamp_ns = 10**12 + 10**8 * tick + round(1e9 * set_by_s) * (tick > 5)
            for item in node.inputs:
                raw = item.topic.codec.encode(stamp_ns, at_rest(item.topic.name))
                item.accept_newest(raw, node.now_s(), 1.0)
            node._on_cycle()
            followed.append(node.settings.profile.depth_m == 300.0)
        assert 40 <= followed.index(True) <= 50
    finally:
        node.destroy_node()


def test_an_abort_before_a_node_is_configured_is_not_forgotten(context):
    told = {'lockstep': False, 'managed': True}
    overrides = [Parameter(name, value=value) for name, value in told.items()]
    node = GuidanceNode(context=context, parameter_overrides=overrides)
    try:
        assert node.on_abort(Trigger.Request(), Trigger.Response()).success
        node.on_configure(None)
        assert node.state.profile.aborted
        node.orders.clear()  # it has been told
        node.on_configure(None)
        assert not node.state.profile.aborted
    finally:
        node.destroy_node()
