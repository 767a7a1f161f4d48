# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Settings become ROS parameters and come back unchanged; what is invalid is refused."""

import struct
from typing import Literal

import pytest
import rclpy
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pydantic import Field, model_validator
from rcl_interfaces.msg import ParameterType
from rclpy.context import Context
from rclpy.node import Node
from rclpy.parameter import Parameter

from glider_base.ros.parameters import (
    changed_parameters,
    declare_settings,
    from_parameters,
    parameters_yaml,
    refuse_unknown,
    to_parameters,
    with_parameters,
)
from glider_base.settings import ConfigurationError, Settings

TUNABLE = {'tunable': True}


class Gains(Settings):
    kp: float = Field(1.0, ge=0.0, le=10.0, description='gain (1)', json_schema_extra=TUNABLE)
    ki: float = Field(0.5, ge=0.0, json_schema_extra=TUNABLE)

    @model_validator(mode='after')
    def _check(self):
        if self.ki > self.kp:
            raise ValueError('ki must not be greater than kp')
        return self


class Example(Settings):
    gain: float = Field(0.25, ge=-1e9, le=1e9, description='a gain (1)')
    count: int = Field(3, ge=0, le=2**62)
    active: bool = True
    name: str = 'glider'
    law: Literal['pid', 'adaptive'] = 'pid'
    speed: float | None = None
    legs: list[tuple[float, float]] = [(0.0, 1.0)]
    gains: Gains = Gains()

    def params(self) -> float:
        """Of somebody's own law: of one gain it makes none."""
        if self.gains.kp == 7.0:
            raise ConfigurationError('params: division by zero')
        return self.gains.kp


@pytest.fixture(scope='module')
def context():
    context = Context()
    rclpy.init(context=context)
    yield context
    rclpy.shutdown(context=context)


@pytest.fixture
def make_node(context):
    nodes = []

    def make(*arguments, **overrides):
        node = Node(
            'example_node',
            namespace='/glider',
            context=context,
            use_global_arguments=False,
            cli_args=['--ros-args', *arguments] if arguments else None,
            parameter_overrides=[Parameter(name, value=v) for name, v in overrides.items()],
            start_parameter_services=False,
            enable_rosout=False,
        )
        nodes.append(node)
        return node

    yield make
    for node in nodes:
        node.destroy_node()


def float_bits(value):
    return None if value is None else struct.pack('<d', value)


FLOATS = st.one_of(
    st.sampled_from([10.0, 1e-05, 1e5, 1e22, -0.0, 0.1, 2.3e-308, 123456789.0]),
    st.floats(-1e9, 1e9, allow_nan=False, allow_subnormal=False),
)
TEXTS = st.one_of(
    st.sampled_from(['10', '1e5', 'true', 'null', '~', '', ' x ', '.inf', '0x10', '2026-01-01']),
    st.text(st.characters(min_codepoint=32, max_codepoint=0x24F), max_size=12),
)


@given(
    st.builds(
        Example,
        gain=FLOATS.filter(lambda x: abs(x) <= 1e9),
        count=st.integers(0, 2**62),
        active=st.booleans(),
        name=TEXTS,
        law=st.sampled_from(['pid', 'adaptive']),
        speed=st.one_of(st.none(), FLOATS),
        legs=st.lists(st.tuples(FLOATS, FLOATS), max_size=3),
        gains=st.builds(
            Gains, kp=st.floats(1.0, 10.0), ki=st.floats(0.0, 1.0, allow_subnormal=False)
        ),
    )
)
@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_parameter_file_gives_back_the_same_settings(make_node, tmp_path, example):
    file = tmp_path / 'parameters.yaml'
    text = parameters_yaml({'example_node': to_parameters(example)}, '/glider')
    file.write_text(text, encoding='utf-8')
    read = declare_settings(make_node('--params-file', str(file)), Example)
    assert read == example
    assert float_bits(read.gain) == float_bits(example.gain)
    assert float_bits(read.speed) == float_bits(example.speed)
    assert read.legs == example.legs


@given(
    example=st.builds(
        Example,
        gain=st.floats(-1e9, 1e9),
        speed=st.none() | FLOATS,
        law=st.sampled_from(['pid', 'adaptive']),
        legs=st.lists(st.tuples(FLOATS, FLOATS), max_size=3),
    )
)
@settings(max_examples=40)
def test_settings_come_back_from_parameters_and_from_what_was_changed(example):
    assert from_parameters(Example, {**to_parameters(example), 'other': 1}, 'file') == example
    changed = changed_parameters(Example(), example)
    assert with_parameters(Example(), changed) == example
    assert float_bits(with_parameters(Example(), changed).gain) == float_bits(example.gain)
    assert changed_parameters(example, example) == {}


@pytest.mark.parametrize(
    ('values', 'words'),
    [
        ({'gain': '2e9'}, ['gain', '2000000000.0', '1000000000.0']),
        ({'gain': 'fast'}, ['gain', 'not JSON']),
        ({'no.such': '1'}, ['no', 'unknown field']),
    ],
)
def test_change_that_cannot_be_is_refused_by_name(values, words):
    with pytest.raises(ConfigurationError) as error:
        with_parameters(Example(), values)
    for word in words:
        assert word in str(error.value)


@pytest.mark.parametrize(
    ('values', 'words'),
    [
        ({'gain': 2e9}, ['file: gain', '2000000000.0', '1000000000.0']),
        ({'legs': '[[1.0'}, ['file: legs', 'not JSON or YAML']),
    ],
)
def test_parameter_of_a_file_that_cannot_be_is_refused_by_name(values, words):
    with pytest.raises(ConfigurationError) as error:
        from_parameters(Example, values, 'file')
    for word in words:
        assert word in str(error.value)


def test_defaults_are_those_of_the_model(make_node):
    assert declare_settings(make_node(), Example) == Example()


def test_parameters_are_described(make_node):
    node = make_node()
    declare_settings(node, Example)
    gain = node.describe_parameter('gain')
    assert gain.type == ParameterType.PARAMETER_DOUBLE
    assert gain.description == 'a gain (1)'
    assert gain.read_only
    assert gain.floating_point_range[0].from_value == -1e9
    assert gain.floating_point_range[0].to_value == 1e9
    assert node.describe_parameter('count').integer_range[0].to_value == 2**62
    assert not node.describe_parameter('gains.kp').read_only
    assert 'adaptive' in node.describe_parameter('law').additional_constraints


@pytest.mark.parametrize(
    ('overrides', 'words'),
    [
        ({'gain': 2e9}, ['gain', '2000000000.0', '1000000000.0']),
        ({'gain': 3}, ['gain', '3', 'write 3.0']),
        ({'gain': 'fast'}, ['gain', "'fast'", 'float']),
        ({'gain': float('nan')}, ['gain', 'nan']),
        ({'count': -1}, ['count', '-1', '0']),
        ({'active': 1}, ['active', '1', 'bool']),
        ({'law': 'magic'}, ['law', "'magic'", 'pid', 'adaptive']),
        ({'legs': '[[1.0]'}, ['legs', 'not JSON or YAML']),
        ({'legs': '[[1.0]]'}, ['legs.0']),
        ({'speed': 'fast'}, ['speed', 'fast']),
        ({'gains.kp': 11.0}, ['gains.kp', '11.0', '10.0']),
        ({'gains.ki': 2.0}, ['gains', 'ki must not be greater than kp']),
    ],
)
def test_invalid_parameter_is_refused_by_name(make_node, overrides, words):
    with pytest.raises(ConfigurationError) as error:
        declare_settings(make_node(**overrides), Example)
    for word in ('example_node', *words):
        assert word in str(error.value)


def test_optional_number_may_be_given_as_a_number(make_node):
    assert declare_settings(make_node(speed=1.5), Example).speed == 1.5


def test_structured_parameter_may_be_yaml(make_node):
    node = make_node(legs='[[1, 2.0], [1e-5, 4.0]]')
    assert declare_settings(node, Example).legs == [(1.0, 2.0), (1e-5, 4.0)]


def test_required_parameter_has_to_be_given(make_node):
    class Required(Settings):
        mass: float = Field(ge=0.0)

    with pytest.raises(ConfigurationError, match='mass.*has to be given'):
        declare_settings(make_node(), Required)
    assert declare_settings(make_node(mass=2.0), Required).mass == 2.0


def test_tunable_parameter_reaches_the_node(make_node):
    node, seen = make_node(), []
    declare_settings(node, Example, seen.append)
    results = node.set_parameters([Parameter('gains.kp', value=2.0)])
    assert results[0].successful
    assert [example.gains.kp for example in seen] == [2.0]


@pytest.mark.parametrize(
    ('name', 'value'),
    [('gain', 0.5), ('gains.kp', 11.0), ('gains.kp', 0.25), ('gains.kp', 'x'), ('gains.kp', 7.0)],
)
def test_refused_change_changes_nothing(make_node, name, value):
    node, seen = make_node(), []
    before = declare_settings(node, Example, seen.append)
    results = node.set_parameters([Parameter(name, value=value)])
    assert not results[0].successful
    assert results[0].reason
    assert seen == []
    assert node.get_parameter('gains.kp').value == before.gains.kp


def test_parameters_that_a_node_does_not_have_are_refused_by_name(make_node):
    node = make_node(gain=1.0, gian=2.0, **{'gains.kd': 3.0})
    declare_settings(node, Example)
    with pytest.raises(ConfigurationError) as error:
        refuse_unknown(node)
    one, other = str(error.value).split('\n')
    assert one.startswith(
        'example_node: parameter gains.kd: unknown (allowed: active, count, gain'
    )
    assert other.startswith('example_node: parameter gian: unknown')


def test_parameters_of_ros_itself_are_taken(make_node):
    of_ros = {
        'use_sim_time': False,
        'start_type_description_service': True,
        'qos_overrides./odom.publisher.depth': 3,
    }
    node = make_node(gain=1.0, **of_ros)
    declare_settings(node, Example)
    assert refuse_unknown(node) is None


def test_parameters_that_a_file_has_for_other_nodes_are_none_of_its(make_node, tmp_path):
    file = tmp_path / 'parameters.yaml'
    nodes = {'example_node': to_parameters(Example()), 'other_node': {'depth': 1.0}}
    file.write_text(parameters_yaml(nodes, '/glider'), encoding='utf-8')
    node = make_node('--params-file', str(file))
    declare_settings(node, Example)
    assert refuse_unknown(node) is None


@pytest.mark.parametrize('text', ['[' * 100_000, '9' * 5000, '!!timestamp foo', '"\\u0000"'])
def test_text_that_would_do_harm_is_refused(make_node, text):
    with pytest.raises(ConfigurationError, match='example_node: parameter legs') as error:
        declare_settings(make_node(legs=text), Example)
    assert len(str(error.value)) < 400
    assert str(error.value).isprintable()
