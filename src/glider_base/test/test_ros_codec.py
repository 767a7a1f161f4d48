# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The codecs agree with the middleware's own serialization, to the last bit."""

import math
import struct

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import PoseStamped
from hypothesis import given, settings
from hypothesis import strategies as st
from nav_msgs.msg import Odometry, Path
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState, NavSatFix

from glider_base.ros.wire.codec import MessageError, cdr_places, set_field, to_cdr
from glider_base.ros.wire.topics import TOPICS, topic_of
from glider_base.signals import Battery
from glider_base.wiring import JOINTS

ODOM, COMMAND = TOPICS['measured_odom'].codec, TOPICS['command'].codec

PER_TICK = [topic for topic in TOPICS.values() if topic.per_tick]
STAMPS = st.integers(0, (2**31 - 1) * 10**9)
FINITE = st.floats(-1e300, 1e300, allow_nan=False)
#: What a field can hold that is no float64.
SINGLE = st.floats(-(2.0**100), 2.0**100, width=32)
NARROW = {
    'status.status': st.integers(-128, 127).map(float),
    **dict.fromkeys(('range', *Battery._fields), SINGLE),
}


def bits(values) -> list[bytes]:
    return [struct.pack('<d', value) for value in values]


def numbers_for(topic, data):
    """Numbers of a message; 0.0 for those that it does not carry."""
    fields, width = topic.codec.fields, topic.codec.width
    drawn = [data.draw(NARROW.get(field, FINITE)) for field in fields]
    return (*drawn, *(width - len(fields)) * (0.0,))


@pytest.mark.parametrize('topic', PER_TICK, ids=lambda topic: topic.name)
@given(data=st.data(), stamp_ns=STAMPS)
@settings(max_examples=20)
def test_decoding_gives_back_what_was_encoded(topic, data, stamp_ns):
    numbers = numbers_for(topic, data)
    stamp, decoded = topic.codec.decode(topic.codec.encode(stamp_ns, numbers))
    assert stamp == stamp_ns
    assert bits(decoded) == bits(numbers)


@pytest.mark.parametrize('topic', PER_TICK, ids=lambda topic: topic.name)
@given(data=st.data(), stamp_ns=STAMPS)
@settings(max_examples=20)
def test_foreign_bytes_of_the_same_message_give_the_same_numbers(topic, data, stamp_ns):
    numbers = numbers_for(topic, data)
    message = deserialize_message(topic.codec.encode(stamp_ns, numbers), topic.message_type)
    if hasattr(message, 'header'):
        message.header.frame_id = 'somewhere_else'
    stamp, decoded = topic.codec.decode(serialize_message(message))
    assert stamp == stamp_ns
    assert bits(decoded) == bits(numbers)


@pytest.mark.parametrize('topic', PER_TICK, ids=lambda topic: topic.name)
@given(data=st.data(), stamps=st.lists(STAMPS, min_size=1, max_size=5))
@settings(max_examples=10)
def test_encoding_many_is_encoding_each(topic, data, stamps):
    rows = [numbers_for(topic, data) for _ in stamps]
    many = topic.codec.encode_many(stamps, np.array(rows).reshape(len(rows), -1))
    assert [row.tobytes() for row in many] == [
        topic.codec.encode(stamp, row) for stamp, row in zip(stamps, rows, strict=True)
    ]


@given(stamp_ns=STAMPS)
def test_stamp_is_read_without_the_numbers(stamp_ns):
    raw = ODOM.encode(stamp_ns, 13 * (math.nan,))
    assert ODOM.decode_stamp(raw) == stamp_ns
    message = deserialize_message(raw, Odometry)
    message.header.frame_id = 'elsewhere'
    assert ODOM.decode_stamp(serialize_message(message)) == stamp_ns


def test_wire_order_of_a_quaternion_is_w_first():
    raw = ODOM.encode(1_500_000_000, tuple(float(i) for i in range(13)))
    message = deserialize_message(raw, Odometry)
    q = message.pose.pose.orientation
    assert (q.w, q.x, q.y, q.z) == (3.0, 4.0, 5.0, 6.0)
    assert (message.header.stamp.sec, message.header.stamp.nanosec) == (1, 500_000_000)
    assert (message.header.frame_id, message.child_frame_id) == ('map', 'base_link')
    assert message.twist.twist.angular.z == 12.0


def test_covariances_do_not_disturb():
    message = deserialize_message(ODOM.encode(7, 13 * (0.5,)), Odometry)
    message.pose.covariance[0] = 0.25
    assert ODOM.decode(serialize_message(message)) == (7, 13 * (0.5,))


def message_of(name, *numbers):
    """What a subscriber gets, of these numbers."""
    topic = TOPICS[name]
    return deserialize_message(topic.codec.encode(0, numbers), topic.message_type)


@pytest.mark.parametrize('topic', PER_TICK, ids=lambda topic: topic.name)
def test_bytes_are_whole_words_and_are_read_without_their_padding_too(topic):
    """As they are on the way from node to node, and as others may have recorded them."""
    numbers = tuple(float(i) for i, _ in enumerate(topic.codec.fields))
    raw = topic.codec.encode(7, numbers)
    message = deserialize_message(raw, topic.message_type)
    bare = to_cdr(message)
    assert len(raw) % 4 == 0
    assert raw == bare + bytes(len(raw) - len(bare))
    assert len(raw) - len(bare) < 4
    whole = (*numbers, *(topic.codec.width - len(numbers)) * (0.0,))
    for one in (raw, bare, serialize_message(message)):
        assert topic.codec.decode(one) == (7, whole)


@given(status=st.integers(-128, 127), place=st.tuples(*4 * [FINITE]))
@settings(max_examples=50)
def test_a_fix_carries_an_integer_beside_its_numbers(status, place):
    fix = message_of('fix', float(status), *place)
    assert (fix.status.status, fix.status.service, fix.position_covariance_type) == (status, 1, 2)
    assert (fix.latitude, fix.longitude) == place[:2]
    assert math.isnan(fix.altitude)
    expected = np.zeros(9)
    expected[[0, 4]] = place[2:]
    assert np.array_equal(fix.position_covariance, expected)
    codec = TOPICS['fix'].codec
    numbers = (float(status), *place)
    fix.header.frame_id = 'gps_antenna'
    before = message_of('fix', *numbers)
    before.altitude = 0.0
    older = to_cdr(before) + bytes(3)
    assert codec.decode_many(np.frombuffer(older, np.uint8)[None])[2].all()
    for raw in (codec.encode(0, numbers), serialize_message(fix), older):
        decoded = codec.decode(raw)[1]
        assert bits(decoded) == bits(numbers)
        assert {type(number) for number in decoded} == {float}


def test_fields_in_arrays_lie_where_the_message_has_them():
    odom = message_of('odom', *range(17))
    covariance = np.zeros(36)
    covariance[[0, 1, 6, 7]] = 13.0, 14.0, 15.0, 16.0  # rows of east and north
    assert np.array_equal(odom.pose.covariance, covariance)
    assert odom.twist.twist.angular.z == 12.0
    current = message_of('believed_current', *range(6))
    covariance[[0, 1, 6, 7]] = 2.0, 3.0, 4.0, 5.0
    assert np.array_equal(current.twist.covariance, covariance)
    assert (current.twist.twist.linear.x, current.twist.twist.linear.y) == (0.0, 1.0)
    imu = message_of('imu', *range(7), -1.0)
    assert (imu.angular_velocity_covariance[0], imu.linear_acceleration_covariance[0]) == (-1, -1)
    assert not any(imu.angular_velocity_covariance[1:])
    assert imu.orientation.w == 0.0
    assert imu.angular_velocity.z == 6.0
    other = message_of('odom', *range(17))
    other.pose.covariance[35] = 9.0
    assert TOPICS['odom'].codec.decode(serialize_message(other))[1] == tuple(range(17))


def test_an_imu_that_says_it_has_no_orientation_is_refused():
    """That of a message that nobody has filled in is level, and heads east."""
    imu = message_of('imu', 1.0, *(7 * (0.0,)))
    imu.orientation_covariance[0] = -1.0
    with pytest.raises(MessageError, match=r'orientation_covariance\[0\] is -1'):
        TOPICS['imu'].codec.decode(serialize_message(imu))
    imu.orientation_covariance[0] = 1e-4
    assert TOPICS['imu'].codec.decode(serialize_message(imu))[1][0] == 1.0


def test_fields_are_set_by_their_paths():
    fix = NavSatFix()
    set_field(fix, 'status.service', 3)
    set_field(fix, 'position_covariance_type', 2)
    set_field(fix, 'position_covariance[8]', 4)
    assert (fix.status.service, fix.position_covariance_type) == (3, 2)
    assert fix.position_covariance[8] == 4.0
    assert not any(fix.position_covariance[:8])


@given(order=st.permutations([*JOINTS, 'rudder']))
def test_joints_are_found_by_name(order):
    places = dict(zip(order, range(4), strict=True))
    message = JointState(
        name=list(order), position=[0.0, 1.0, 2.0, 3.0], velocity=[0.0], effort=[1.0]
    )
    _, decoded = COMMAND.decode(serialize_message(message))
    assert decoded == (*(float(places[joint]) for joint in JOINTS), 0.0)
    _, decoded = topic_of('command', 'rudder').codec.decode(serialize_message(message))
    assert decoded == tuple(float(places[joint]) for joint in (*JOINTS, 'rudder'))


def test_missing_joint_is_named():
    message = JointState(name=['buoyancy_engine', 'roll_mass'], position=[0.0, 0.0])
    with pytest.raises(MessageError, match="'pitch_mass' is missing"):
        COMMAND.decode(serialize_message(message))
    message.name = 200_000 * ['x']
    with pytest.raises(MessageError) as error:
        COMMAND.decode(serialize_message(message))
    assert len(str(error.value)) < 200  # it stands on /diagnostics, once a second


def test_joint_without_position_is_named():
    message = JointState(name=list(JOINTS), position=[0.0, 0.0])
    with pytest.raises(MessageError, match='roll_mass'):
        COMMAND.decode(serialize_message(message))


@pytest.mark.parametrize('value', [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize('place', range(13))
def test_number_that_is_not_finite_is_named(value, place):
    numbers = [0.0] * 13
    numbers[place] = value
    raw = ODOM.encode(0, numbers)
    with pytest.raises(MessageError) as error:
        ODOM.decode(raw)
    assert ODOM.fields[place] in str(error.value)


@pytest.mark.parametrize(
    ('name', 'numbers', 'read'),
    [
        ('health', (1.0, math.nan, 5.0), (1.0, -1.0, 5.0)),
        ('health', (math.nan, 23700.0, math.nan), (0.0, 23700.0, -1.0)),
        ('battery', (5.0, *(4 * (math.nan,))), (5.0, 0.0, -1.0, -1.0, -1.0)),
    ],
)
def test_what_is_not_measured_of_a_vehicle_does_not_hide_what_is(name, numbers, read):
    codec = TOPICS[name].codec
    raw = codec.encode(7, numbers)
    assert codec.decode(raw) == (7, read)
    assert codec.decode(to_cdr(deserialize_message(raw, codec.message_type))) == (7, read)
    _, values, _ = codec.decode_many(np.frombuffer(raw, np.uint8)[None])
    assert tuple(values[0]) == read
    with pytest.raises(MessageError, match='inf'):
        codec.decode(codec.encode(7, (math.inf, *numbers[1:])))


def test_a_battery_says_nan_where_it_measures_nothing_and_old_bags_are_read():
    """As its message wants it; before, 0 and less than nothing were said."""
    codec, numbers = TOPICS['battery'].codec, (15.0, 0.0, -1.0, -1.0, -1.0)
    told = message_of('battery', *numbers)
    unmeasured = ('temperature', 'charge', 'capacity', 'design_capacity', 'percentage')
    assert all(math.isnan(getattr(told, name)) for name in unmeasured)
    (many,) = codec.encode_many([0], np.array([numbers]))
    assert many.tobytes() == codec.encode(0, numbers)
    told.temperature = told.design_capacity = 0.0
    told.charge = told.capacity = told.percentage = -1.0
    raw = to_cdr(told)
    rows = np.frombuffer(raw + bytes(-len(raw) % 4), np.uint8)[None]
    _, values, own = codec.decode_many(rows)
    assert own.all()
    assert (tuple(values[0]), codec.decode(raw)[1]) == (numbers, numbers)


def test_a_stamp_of_more_nanoseconds_than_a_second_has_is_none():
    message = deserialize_message(ODOM.encode(0, 13 * (0.0,)), Odometry)
    message.header.stamp.sec, message.header.stamp.nanosec = 2**31 - 1, 2**32 - 1
    for read in (ODOM.decode, ODOM.decode_stamp):
        with pytest.raises(MessageError, match='nanosec is 4294967295'):
            read(serialize_message(message))


def test_a_stamp_from_before_the_beginning_of_time_is_none():
    raw = ODOM.encode(-1, 13 * (0.0,))
    for read in (ODOM.decode, ODOM.decode_stamp):
        with pytest.raises(MessageError, match='stamp.sec is -1 '):
            read(raw)


def test_finite_numbers_whose_sum_overflows_are_taken():
    numbers = 13 * (1.7e308,)
    assert ODOM.decode(ODOM.encode(0, numbers)) == (0, numbers)


@given(
    st.lists(
        st.tuples(
            st.sampled_from([b'\0', b'\1', b'\2']),
            st.text(st.characters(blacklist_characters='\0', blacklist_categories=['Cs'])),
            st.lists(st.tuples(st.just('key'), st.text('abc')), max_size=3),
        ),
        max_size=3,
    )
)
def test_any_message_survives_our_serialization(statuses):
    array = DiagnosticArray()
    array.header.frame_id = 'x'
    for level, message, values in statuses:
        pairs = [KeyValue(key=key, value=value) for key, value in values]
        array.status.append(DiagnosticStatus(level=level, name='n', message=message, values=pairs))
    assert deserialize_message(to_cdr(array), DiagnosticArray) == array


def test_our_serialization_of_a_path():
    path = Path()
    path.header.frame_id = 'map'
    for north in (0.0, 1.5, -2.5):
        pose = PoseStamped()
        pose.header.frame_id = 'map'
        pose.pose.position.y = north
        path.poses.append(pose)
    assert deserialize_message(to_cdr(path), Path) == path


@pytest.mark.parametrize('topic', PER_TICK, ids=lambda topic: topic.name)
@given(data=st.data(), stamps=st.lists(STAMPS, min_size=1, max_size=5))
@settings(max_examples=10)
def test_decoding_many_gives_back_what_was_encoded(topic, data, stamps):
    numbers = np.array([numbers_for(topic, data) for _ in stamps]).reshape(len(stamps), -1)
    decoded, values, own = topic.codec.decode_many(topic.codec.encode_many(stamps, numbers))
    assert list(decoded) == stamps
    assert values.tobytes() == numbers.tobytes()
    assert own.all()


@pytest.mark.parametrize('topic', PER_TICK, ids=lambda topic: topic.name)
@given(data=st.data(), stamp_ns=STAMPS)
@settings(max_examples=40)
def test_bytes_that_count_as_own_are_those_of_the_stamp_and_numbers(topic, data, stamp_ns):
    """Whatever bit is flipped: either it is told, or encoding gives it back."""
    row = topic.codec.encode_many([stamp_ns], [numbers_for(topic, data)])
    bit = data.draw(st.integers(0, 8 * row.shape[1] - 1))
    row[0, bit // 8] ^= 1 << bit % 8
    stamps, values, own = topic.codec.decode_many(row)
    again = topic.codec.encode_many(stamps, values)
    assert bool(own[0]) == (again.tobytes() == row.tobytes())


def test_places_cover_every_field_of_a_message():
    pair = KeyValue(key='stage', value='gliding')
    array = DiagnosticArray(status=[DiagnosticStatus(level=b'\1', name='node', values=[pair])])
    array.header.stamp.sec, array.header.frame_id = -7, 'map'
    raw = to_cdr(array)
    read = {}
    for place in cdr_places(array):
        data = raw[place.start : place.end]
        text = place.code == 's'
        read[place.path] = data[4:-1] if text else struct.unpack('<' + place.code, data)[0]
    assert read == {
        'header.stamp.sec': -7,
        'header.stamp.nanosec': 0,
        'header.frame_id': b'map',
        'len(status)': 1,
        'status[0].level': b'\1',
        'status[0].name': b'node',
        'status[0].message': b'',
        'status[0].hardware_id': b'',
        'len(status[0].values)': 1,
        'status[0].values[0].key': b'stage',
        'status[0].values[0].value': b'gliding',
    }


def test_a_steering_surface_is_the_last_name_of_those_vehicles_that_have_one():
    """Its number is 0.0 of a vehicle that has none, and stands in no message of it."""
    numbers = (0.1, 0.02, -0.3, 0.4)
    for name in ('joint_states', 'command'):
        without, steered = (topic_of(name, fin).codec for fin in ('', 'fin'))
        plain, raw = without.encode(7, numbers), steered.encode(7, numbers)
        assert deserialize_message(plain, JointState).name == list(JOINTS)
        assert deserialize_message(raw, JointState).name == [*JOINTS, 'fin']
        assert steered.decode(raw) == (7, numbers)
        assert without.decode(plain) == without.decode(raw) == (7, (*numbers[:3], 0.0))
        with pytest.raises(MessageError, match="'fin' is missing"):
            steered.decode(plain)
        rows = np.frombuffer(plain, np.uint8)[None]
        assert without.decode_many(rows)[1].tolist() == [[*numbers[:3], 0.0]]
    assert topic_of('odom', 'fin') is TOPICS['odom']
