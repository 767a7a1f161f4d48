# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What a person reads who configured something wrong."""

import math
import re
from typing import Annotated, Literal, NamedTuple

import pydantic
import pytest
from pydantic import Field

from glider_base.errors import ConfigurationError
from glider_base.files import read_yaml
from glider_base.settings import Settings, derived, number, positive, validate


class Cat(Settings):
    kind: Literal['cat']
    lives: int = Field(9, ge=1, le=9)


class Dog(Settings):
    kind: Literal['dog']
    legs: int = Field(4, ge=0, le=4)


class Inner(Settings):
    depth_m: float = Field(1.0, ge=0.0, lt=10.0)
    name: str = 'x'

    @pydantic.model_validator(mode='after')
    def _check(self):
        if self.name == 'deep' and self.depth_m < 5.0:
            raise ValueError(f'depth_m = {self.depth_m} is not deep (allowed: >= 5)')
        return self


class Outer(Settings):
    inner: Inner = Inner()
    rate: float = Field(0.5, gt=0.0)
    mode: Literal['fast', 'slow'] = 'fast'
    path: list[Inner] = []
    pets: list[Annotated[Cat | Dog, Field(discriminator='kind')]] = []
    maybe: Inner | None = None


def message(values) -> str:
    with pytest.raises(ConfigurationError) as caught:
        validate(Outer, values, 'a.yaml')
    return str(caught.value)


@pytest.mark.parametrize(
    ('values', 'expected'),
    [
        (
            {'inner': {'depth_m': -1.0}},
            'a.yaml: inner.depth_m = -1.0: should be greater than or equal to 0 '
            '(allowed: >= 0.0 and < 10.0)',
        ),
        (
            {'inner': {'depth_m': float('nan')}},
            'a.yaml: inner.depth_m = nan: should be a finite number (allowed: >= 0.0 and < 10.0)',
        ),
        (
            {'rate': float('inf')},
            'a.yaml: rate = inf: should be a finite number (allowed: > 0.0)',
        ),
        (
            {'rate': 'quick'},
            "a.yaml: rate = 'quick': should be a valid number, unable to parse string as a number "
            '(allowed: > 0.0)',
        ),
        (
            {'mode': 'idle'},
            "a.yaml: mode = 'idle': should be 'fast' or 'slow' (allowed: 'fast' or 'slow')",
        ),
        (
            {'inner': {'depht_m': 1.0}},
            'a.yaml: inner.depht_m = 1.0: unknown field (allowed fields: depth_m, name)',
        ),
        (
            {'inner': [1.0]},
            'a.yaml: inner = [1.0]: expected a mapping of fields (allowed fields: depth_m, name)',
        ),
        (
            {'path': [{}, {'depth_m': 11.0}]},
            'a.yaml: path.1.depth_m = 11.0: should be less than 10 (allowed: >= 0.0 and < 10.0)',
        ),
        (
            {'maybe': {'depth_m': 11.0}},
            'a.yaml: maybe.depth_m = 11.0: should be less than 10 (allowed: >= 0.0 and < 10.0)',
        ),
        (
            {'inner': {'name': 'deep'}},
            'a.yaml: inner: depth_m = 1.0 is not deep (allowed: >= 5)',
        ),
        (
            {'pets': [{'kind': 'cat', 'lives': 10}]},
            'a.yaml: pets.0.lives = 10: should be less than or equal to 9 '
            '(allowed: >= 1 and <= 9)',
        ),
        (
            {'pets': [{'kind': 'dog', 'lives': 1}]},
            'a.yaml: pets.0.lives = 1: unknown field (allowed fields: kind, legs)',
        ),
        (
            {'pets': [{'kind': 'cow'}]},
            "a.yaml: pets.0.kind = 'cow': unknown (allowed: 'cat', 'dog')",
        ),
        ({'pets': [{}]}, 'a.yaml: pets.0.kind: missing'),
        (
            [],
            'a.yaml: []: expected a mapping of fields '
            '(allowed fields: inner, rate, mode, path, pets, maybe)',
        ),
    ],
)
def test_message_names_file_field_value_and_range(values, expected):
    assert message(values) == expected


def test_every_mistake_has_its_line():
    lines = message({'rate': -1.0, 'inner': {'x': 1}, 'mode': 3}).split('\n')
    assert [line.split(' =')[0] for line in lines] == [
        'a.yaml: inner.x',
        'a.yaml: rate',
        'a.yaml: mode',
    ]


def test_valid_values_are_taken():
    settings = validate(Outer, {'rate': 2, 'pets': [{'kind': 'cat'}]}, 'a.yaml')
    assert settings.rate == 2.0
    assert settings.pets == [Cat(kind='cat')]


def test_settings_do_not_change():
    with pytest.raises(pydantic.ValidationError):
        Outer().rate = 1.0


# ---------------------------------------------------------------------------------------- YAML


def read(tmp_path, text):
    path = tmp_path / 'a.yaml'
    path.write_text(text, encoding='utf-8')
    return read_yaml(path)


@pytest.mark.parametrize(
    ('text', 'number'),
    [
        ('1e-3', 1e-3),
        ('1E3', 1e3),
        ('-2.5e+2', -250.0),
        ('.5e1', 5.0),
        ('1.5', 1.5),
        ('7', 7),
        ('000', 0),
        ('007', 7),
        ('-00.5', -0.5),
        ('0x1f', 31),
    ],
)
def test_numbers_are_numbers(tmp_path, text, number):
    assert read(tmp_path, f'x: {text}') == {'x': number}


@pytest.mark.parametrize(
    ('text', 'expected'),
    [
        ('a: 1\na: 2\n', r"a.yaml:2: not valid YAML: field 'a' is given twice"),
        ('b:\n  c: 1\n  c: 1\n', r"a.yaml:3: .*field 'c' is given twice"),
        ('[a, b]: 1\n', r'a.yaml:1: not valid YAML: the name of a field must be plain text'),
        ('- 1\n- 2\n', r'a.yaml: expected a mapping of fields, found \[1, 2\]'),
        ('', r'a.yaml: expected a mapping of fields, found None'),
        ('a: [1,\n', r'a.yaml:2: not valid YAML'),
        ('a: !!python/object:os.system {}\n', r'a.yaml:1: not valid YAML'),
        ('a: 1\n---\nb: 2\n', r'a.yaml:3: not valid YAML'),
        ('course_deg: 045\n', r'a.yaml:1: not valid YAML: course_deg: 045: of base 8 or 60 \('),
        ('a: 1\nb: [-010, 2]\n', r'a.yaml:2: not valid YAML: b.0: -010: of base 8'),
        ('a: 1\nb: [1:20, 36:15.5]\n', r'a.yaml:2: not valid YAML: b.0: 1:20: of base 8 or 60'),
        ('a: 1\nb: -36:15.5\n', r'a.yaml:2: not valid YAML: b: -36:15.5: of base 8 or 60'),
    ],
)
def test_what_is_no_mapping_is_refused(tmp_path, text, expected):
    with pytest.raises(ConfigurationError, match=r'(?s)' + expected):
        read(tmp_path, text)


def test_missing_file_is_named(tmp_path):
    with pytest.raises(ConfigurationError, match=r'none.yaml: No such file or directory'):
        read_yaml(tmp_path / 'none.yaml')


def test_bytes_that_are_no_text_are_refused(tmp_path):
    path = tmp_path / 'a.yaml'
    path.write_bytes(b'\xff\xfe\x00')
    with pytest.raises(ConfigurationError, match=r'a.yaml:1: not UTF-8 text, byte 0xff'):
        read_yaml(path)


class Turned(Settings):
    depth_m: float = number(5.0, (0.0, 10.0), 'a depth (m)')
    pitch_deg: float = positive(..., 60.0, 'a pitch (deg)', tunable=True)
    hold_s: float = 2.0


class TurnedParams(NamedTuple):
    depth: float
    pitch: float
    hold_s: float
    rate: float


def test_params_are_the_numbers_of_their_settings():
    settings = Turned(pitch_deg=30.0)
    assert derived(TurnedParams, settings, rate=1.0) == (5.0, math.radians(30.0), 2.0, 1.0)
    assert derived(TurnedParams, settings, rate=1.0, depth=7.0).depth == 7.0
    for wrong in ({}, {'rate': 1.0, 'speed': 1.0}):
        with pytest.raises(TypeError):
            derived(TurnedParams, settings, **wrong)


class Careless(Settings):
    share: float = 1.0

    @pydantic.field_validator('share')
    @classmethod
    def _divided(cls, share):
        return 1.0 / share


def test_what_a_validator_raises_is_named():
    with pytest.raises(ConfigurationError) as caught:
        validate(Careless, {'share': 0.0}, 'a.yaml')
    said = r'a\.yaml: \S*test_settings\.py, line \d+: ZeroDivisionError: float division by zero'
    assert re.fullmatch(said, str(caught.value))


@pytest.mark.parametrize(
    ('fields', 'allowed'),
    [
        ({'depth_m': 10.1, 'pitch_deg': 1.0}, '>= 0.0 and <= 10.0'),
        ({'pitch_deg': 0.0}, '> 0.0 and <= 60.0'),
        ({}, 'pitch_deg: missing'),
    ],
)
def test_numbers_stay_within_their_limits(fields, allowed):
    with pytest.raises(ConfigurationError) as caught:
        validate(Turned, fields, 'a.yaml')
    assert allowed in str(caught.value)
    assert Turned.model_fields['pitch_deg'].json_schema_extra == {'tunable': True}
