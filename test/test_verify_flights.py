# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Flights over nodes verify: with orders in flight, and free-running as on a vehicle."""

import json
import os
import re
import time

import numpy as np
import pytest
import rclpy
from mcap.reader import make_reader
from rcl_interfaces.srv import SetParameters
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_srvs.srv import SetBool, Trigger

from command_line import Started
from glider_base.errors import EXIT_SURFACED
from glider_base.frames import (
    odometry_from_wire,
    odometry_to_wire,
    reference_from_wire,
    reference_to_wire,
    water_to_wire,
    wrench_to_wire,
)
from glider_base.ros.lockstep import health
from glider_base.ros.lockstep.health import ABORT, PARAMETERS_SET
from glider_base.ros.lockstep.step_node import Passing
from glider_base.ros.places import NAMESPACE, domain_id
from glider_base.ros.wire.codec import to_cdr
from glider_base.ros.wire.qos import EVENTS
from glider_base.ros.wire.topics import TOPICS
from glider_base.signals import TICK_S, Joints, Water
from glider_base.wiring import NO_ECHO
from glider_bringup.engines.flight import mission_of
from glider_control import block as control
from glider_control.control import control_step
from glider_guidance import block as guidance
from glider_guidance.guidance import guidance_abort, guidance_step
from glider_guidance.nodes.guidance_node import path_message
from glider_mission.recording.ros.rosbag2 import BagWriter
from glider_mission.scenario import load_scenario
from glider_model.plant.plant import plant_odometry, plant_step

DEADLINE_S = 200.0


def verified(glider, folder) -> tuple[int, dict[str, dict]]:
    """Exit code, and what is said about each block."""
    done = glider('verify', folder, '--json')
    assert done.stdout, done.stderr
    return done.returncode, {one['block']: one for one in json.loads(done.stdout)['blocks']}


def test_shared_flights_are_identical(glider, over_nodes, direct):
    for flight in (over_nodes, direct):
        code, blocks = verified(glider, flight.folder)
        assert code == 0
        assert {one['result'] for one in blocks.values()} == {'identical'}
        compared = sum(sum(one['compared'].values()) for one in blocks.values())
        assert compared == flight.card['messages_recorded']


# ---------------------------------------------------------------------- orders in flight


@pytest.fixture
def bystander(monkeypatch):
    """A node in the domain of a run that is about to be started."""
    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    context = Context()
    with domain_id() as domain:
        rclpy.init(context=context, domain_id=domain)
        node = Node('bystander', namespace='/glider', context=context)
        executor = SingleThreadedExecutor(context=context)
        executor.add_node(node)
        yield node, executor, domain
        executor.shutdown()
        node.destroy_node()
        rclpy.try_shutdown(context=context)


def test_orders_in_flight_are_on_record_and_verified(glider, bystander, tmp_path):
    """An abort, two parameters and a pause: the run is identical all the same."""
    node, executor, domain = bystander
    stages = []

    def on_event(array) -> None:
        for status in array.status:
            stages.extend(pair.value for pair in status.values if pair.key == 'stage')

    topic = TOPICS['/diagnostics']
    node.create_subscription(topic.message_type, topic.name, on_event, EVENTS)
    abort = node.create_client(Trigger, 'abort')
    pause = node.create_client(SetBool, 'pause')
    tune = {
        name: node.create_client(SetParameters, f'{name}/set_parameters')
        for name in ('control_node', 'guidance_node')
    }
    out = tmp_path / 'run'
    command = ('run', '--duration', 60, '--speed', 8, '--set', 'profile.prepare_s=2.0')
    environment = {**os.environ, 'ROS_DOMAIN_ID': str(domain)}
    process = Started([*command, '--out', out], environment, tmp_path)
    end = time.monotonic() + DEADLINE_S

    def wait_for(condition, what: str) -> None:
        while not condition():
            assert time.monotonic() < end, what
            assert process.poll() is None, f'{what}: {process.communicate()}'
            executor.spin_once(timeout_sec=0.05)

    def call(client, request):
        wait_for(client.service_is_ready, client.srv_name)
        answer = client.call_async(request)
        wait_for(answer.done, client.srv_name)
        return answer.result()

    def set_to(name: str, parameter: str, value: float) -> None:
        parameters = [Parameter(parameter, value=value).to_parameter_msg()]
        answer = call(tune[name], SetParameters.Request(parameters=parameters))
        assert answer.results[0].successful

    try:
        wait_for(lambda: 'gliding down' in stages, 'the dive')
        set_to('control_node', 'adaptive.pitch.kp', 7.25)
        set_to('guidance_node', 'observer.k3_per_s', 0.03)
        assert call(pause, SetBool.Request(data=True)).success
        assert call(pause, SetBool.Request(data=False)).success
        assert call(abort, Trigger.Request()).success
        _, error = process.communicate(timeout=DEADLINE_S)
        assert process.returncode == EXIT_SURFACED, error
        assert 'ordered to the surface' in error
    finally:
        process.kill()
    (file,) = out.glob('*.mcap')
    with file.open('rb') as stream:
        events = [m.data for _, _, m in make_reader(stream).iter_messages(['/diagnostics'])]
    text = b'|'.join(events)
    for word in (ABORT, PARAMETERS_SET, 'adaptive.pitch.kp', '7.25', 'observer.k3_per_s', '0.03'):
        assert word.encode() in text
    code, blocks = verified(glider, out)
    assert code == 0, blocks
    assert {one['result'] for one in blocks.values()} == {'identical'}


# ---------------------------------------------------------------------- free-running


class Vehicle:
    """A flight on a vehicle's own clock: steps that come when they come, as the nodes take them.

    Steps are computed here, not by what is tested. Each block takes the newest inputs it has; now
    and then one is late, comes twice, or is not there in time. Without a new stamp a node says its
    answer again, and a step stands for the ticks by which the stamps have gone on.
    """

    def __init__(self, scenario, folder) -> None:
        state, self.params = mission_of(scenario)
        self.plant, _, _, self.guidance, self.control, _ = state
        self.begin = self.control
        self.bag = BagWriter(folder, 'flight')
        self.order = 0
        self.told, self.saturation = None, (0, 0)
        self.command = Joints(0.0, 0.0, 0.0, 0.0)
        self.passing = {'guidance': Passing(1.0), 'control': Passing(1.0)}
        self.answers = {}
        points = scenario.path.points(500)
        self.put('path', to_cdr(path_message(points)))

    def put(self, name: str, raw: bytes) -> None:
        """Record in the order of arrival, as rosbag2 does."""
        self.order += 1
        self.bag.write(name, 1_700_000_000_000_000_000 + self.order, raw)

    def publish(self, name: str, stamp_ns: int, values) -> None:
        self.put(name, TOPICS[name].codec.encode(stamp_ns, values))

    def repeat(self, block: str) -> None:
        for answer in self.answers[block]:
            self.publish(*answer)

    def measure(self, stamp_ns: int) -> None:
        water = Water(0.1, 0.0, 0.0)
        self.plant = plant_step(self.plant, self.command, water, self.params.plant, TICK_S)
        self.joints = (stamp_ns, self.plant.joints)
        self.odom = (stamp_ns, odometry_to_wire(plant_odometry(self.plant)))
        self.publish('joint_states', stamp_ns, self.joints[1])
        self.publish('odom', stamp_ns, (*self.odom[1], 4.0, 0.5, 0.5, 4.0))

    def guide(self) -> None:
        stamp_ns, odom = self.odom
        odometry = odometry_from_wire(odom)
        passed = self.passing['guidance'].ticks(stamp_ns)
        for _ in range(passed):
            self.guidance, out = guidance_step(
                self.guidance, odometry, NO_ECHO, self.params.guidance, TICK_S
            )
        if not passed:
            self.repeat('guidance')
            return
        if (out.stage, out.infeasible) != self.told:
            self.told = (out.stage, out.infeasible)
            self.put(
                '/diagnostics',
                to_cdr(
                    health.said_array(
                        stamp_ns, f'{NAMESPACE}/guidance_node', guidance.say(*self.told)
                    )
                ),
            )
        self.reference = (stamp_ns, reference_to_wire(out.reference))
        self.answers['guidance'] = [
            ('tracking_error', stamp_ns, out.error),
            ('current_estimate', stamp_ns, water_to_wire(out.current)),
            ('reference', *self.reference),
        ]
        self.repeat('guidance')

    def abort(self) -> None:
        self.guidance = guidance_abort(self.guidance)
        stamp_ns = self.odom[0]
        event = health.status_array(stamp_ns, f'{NAMESPACE}/guidance_node', health.OK, ABORT, {})
        self.put('/diagnostics', to_cdr(event))

    def steer(self) -> None:
        inputs = (self.reference, self.odom, self.joints)
        stamp_ns = max(one[0] for one in inputs)
        passed = self.passing['control'].ticks(stamp_ns)
        for _ in range(passed):
            self.control, out = control_step(
                self.control,
                odometry_from_wire(self.odom[1]),
                self.joints[1],
                reference_from_wire(self.reference[1]),
                self.params.control,
                TICK_S,
            )
        if not passed:
            self.repeat('control')
            return
        told, told_ns = self.saturation
        if out.saturation != told and not 0 <= stamp_ns - told_ns < 1_000_000_000:
            self.saturation = (out.saturation, stamp_ns)
            self.put(
                '/diagnostics',
                to_cdr(
                    health.said_array(
                        stamp_ns, f'{NAMESPACE}/control_node', control.say(out.saturation)
                    )
                ),
            )
        self.answers['control'] = [
            ('wrench', stamp_ns, wrench_to_wire(out.wrench)),
            ('adaptation', stamp_ns, out.adaptation),
            ('demand', stamp_ns, out.command),
        ]
        self.repeat('control')
        self.command = out.command


@pytest.fixture
def free_flight(tmp_path):
    """Fly 60 s and record it; ``spoil`` is called with the vehicle at every tick."""

    def fly(spoil=lambda vehicle, tick: None):
        folder = tmp_path / 'free'
        scenario = load_scenario('current_8deg', {'profile.prepare_s': 3.0})
        vehicle = Vehicle(scenario, folder)
        chance = np.random.default_rng(5)
        stamp_ns = 1_700_000_000_123_456_789
        for tick in range(600):
            stamp_ns += int(chance.integers(80_000_000, 120_000_000))
            vehicle.measure(stamp_ns)
            guides_first = tick < 3 or tick // 100 % 2 == 0
            if guides_first:
                vehicle.guide()
            for _ in range(1 if tick < 3 else chance.choice([1, 1, 1, 1, 0, 2])):
                vehicle.steer()
            if not guides_first:
                for _ in range(chance.choice([1, 1, 1, 1, 0, 2])):
                    vehicle.guide()
            if tick == 400:
                vehicle.measure(stamp_ns + 50_000_000)
                vehicle.abort()
                vehicle.guide()
            spoil(vehicle, tick)
        vehicle.bag.close()
        (folder / 'scenario.yaml').write_text(scenario.to_yaml())
        return folder

    return fly


def test_flight_on_a_clock_of_its_own_is_identical(glider, free_flight):
    code, blocks = verified(glider, free_flight())
    assert code == 0, blocks
    assert {name: one['result'] for name, one in blocks.items()} == {
        'plant': 'skipped',
        'current': 'skipped',
        'navigation': 'skipped',
        'guidance': 'identical',
        'control': 'identical',
        'guard': 'skipped',
    }
    assert blocks['guidance']['compared']['/diagnostics'] >= 3
    assert blocks['control']['compared']['demand'] == blocks['control']['ticks'] > 400


@pytest.mark.parametrize('block', ['guidance', 'control'])
def test_first_difference_of_such_a_flight_is_named(glider, free_flight, block):
    topic = {'guidance': 'current_estimate', 'control': 'adaptation'}[block]
    stamps = []

    def spoil(vehicle, tick: int) -> None:
        if tick != 300:
            return
        publish = vehicle.publish

        def wrong(name, stamp_ns, values) -> None:
            if name == topic and not stamps:
                stamps.append(stamp_ns)
                values = (np.nextafter(values[0], 1.0), *values[1:])
            publish(name, stamp_ns, values)

        vehicle.publish = wrong

    folder = free_flight(spoil)
    code, blocks = verified(glider, folder)
    assert code == 1
    assert [name for name, one in blocks.items() if one['result'] == 'different'] == [block]
    first = blocks[block]['first']
    assert (first['topic'], first['stamp_ns']) == (topic, stamps[0])
    assert not [note for note in blocks[block]['notes'] if 'is not on record' in note]


def test_hole_in_such_a_recording_is_named_beside_the_difference(glider, free_flight):
    """What the recorder missed is no change of the code, and no damage."""

    def spoil(vehicle, tick: int) -> None:
        missed = ('odom', 'joint_states') if 300 <= tick < 310 else ()
        vehicle.put = lambda name, raw: name in missed or Vehicle.put(vehicle, name, raw)

    code, blocks = verified(glider, free_flight(spoil))
    assert code == 1
    for name in ('guidance', 'control'):
        (note,) = (said for said in blocks[name]['notes'] if said.startswith('odom is not'))
        first_s, last_s = (float(word) for word in re.findall(r't = (\S+) s', note))
        assert 0.9 < last_s - first_s < 1.3
        assert first_s < blocks[name]['first']['t_s'] < last_s + 0.1


def test_a_recorder_that_came_late_is_no_difference(glider, free_flight, monkeypatch):
    """On a busy machine it hears of one node seconds after another."""
    put, missed = Vehicle.put, []

    def late(vehicle, name, raw) -> None:
        if name == 'joint_states' and len(missed) < 20:
            missed.append(raw)
        else:
            put(vehicle, name, raw)

    monkeypatch.setattr(Vehicle, 'put', late)
    code, blocks = verified(glider, free_flight())
    assert (code, blocks['guidance']['result'], blocks['control']['result']) == (
        *(0, 'identical', 'skipped'),
    )
    assert 'joint_states is recorded from t = ' in blocks['control']['reason']


def test_node_that_was_configured_again_is_named_beside_the_difference(glider, free_flight):
    """It is back at once: no topic is silent."""

    def spoil(vehicle, tick: int) -> None:
        if tick != 300:
            return
        vehicle.control, vehicle.passing['control'] = vehicle.begin, Passing(1.0)
        told = f'{NAMESPACE}/control_node', health.OK, health.CONFIGURED
        vehicle.put('/diagnostics', to_cdr(health.status_array(vehicle.odom[0], *told, {})))

    code, blocks = verified(glider, free_flight(spoil))
    assert (code, blocks['guidance']['result']) == (1, 'identical')
    first, notes = blocks['control']['first'], blocks['control']['notes']
    (note,) = (said for said in notes if said.startswith('control_node was configured at'))
    assert abs(float(re.search(r't = (\S+) s', note)[1]) - first['t_s']) < 0.3


def test_order_after_the_clock_was_set_back_is_followed_where_it_was(glider, free_flight):
    def spoil(vehicle, tick: int) -> None:
        if tick == 300:
            vehicle.measure = lambda stamp_ns: Vehicle.measure(vehicle, stamp_ns - 10**11)

    code, blocks = verified(glider, free_flight(spoil))
    assert code == 0, blocks['control']['first']
