# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What people write is read without trusting it: bounds, scalars, special files, messages."""

import os
import socket
import time

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from glider_base import files
from glider_base.errors import MAX_LINE, MAX_LINES, MAX_SHOWN, ConfigurationError, printable, shown
from glider_base.files import (
    is_file,
    parse_json,
    parse_yaml,
    read_json,
    read_text,
    read_yaml,
    yaml_line,
    yaml_text,
)
from glider_model.vehicle.file import VEHICLE_FOLDER

#: Some 400 bytes that stand for 400 million values.
BOMB = 'a: &a [x, x, x, x, x, x, x, x, x]\n' + ''.join(
    f'{one}: &{one} [{", ".join([f"*{before}"] * 9)}]\n'
    for before, one in zip('abcdefgh', 'bcdefghi', strict=True)
)


def short(value) -> str:
    """Name of a case."""
    return ascii(shown(value))[:30]


def refusal(text: str) -> str:
    """The one message about a text, which comes at once."""
    start = time.monotonic()
    with pytest.raises(ConfigurationError) as caught:
        parse_yaml(text, 'a.yaml')
    assert time.monotonic() - start < 5.0
    told = str(caught.value)
    assert told.startswith('a.yaml') and len(told) < 300 and told.isprintable()
    return told


@pytest.mark.parametrize(
    ('text', 'words'),
    [
        ('!!bool x', ["tag '!!bool'"]),
        ('!!timestamp foo', ["tag '!!timestamp'"]),
        ('!!int ""', ["tag '!!int'"]),
        ('x: 1\ny: !local z', ['a.yaml:2:', "tag '!local'"]),
        ('[' * 3000, ['nested more than 40 deep']),
        ('[' * 900_000, ['nested more than 40 deep']),
        ('{a: ' * 3000, ['nested more than 40 deep']),
        ('- ' * 3000, ['nested more than 40 deep']),
        (BOMB, ['a.yaml:6:', '200,000 values']),
        ('[' + 'x,' * 250_000 + ']', ['200,000 values']),
        ('&a [*a]', ["alias 'a' of nothing above"]),
        ('*a', ["alias 'a' of nothing above"]),
        ('9' * 5000, ['a number of 5000 characters', '100']),
        ('1' + ':59' * 100_000, ['a number of 300001 characters']),
        ('0b_', ["'0b_' is not a number"]),
        ('"\\e[31m"', [r"control character '\x1b'"]),
        ('x: 1\ny: \x1b[31m', ['a.yaml:2:', r"control character '\x1b'"]),
        ('"a\\0b"', [r"control character '\x00'"]),
        ('\udcff', [r"control character '\udcff'"]),
        ('"\\ud800"', ['not valid YAML']),
        ('{"\\a": 1}', ['control character in the name']),
        ('{a: 1, a: 2}', ["field 'a' is given twice"]),
        ('{' + 'a' * 500 + ': 1, ' + 'a' * 500 + ': 1}', ['is given twice']),
        ('? [1]\n: 2', ['a.yaml:1:', 'the name of a field must be plain text']),
        ('{&a a: 1}', ['the name of a field must be plain text']),
        ('1\n---\n2', ['a.yaml:3:', 'a second document']),
        ('%TAG ! tag:x,2000:\n---\n1', ['a.yaml:1:', 'directive']),
        ('{a: b: c}', ['not valid YAML']),
    ],
    ids=short,
)
def test_text_that_would_do_harm_is_refused_in_one_line(text, words):
    told = refusal(text)
    for word in ('not valid YAML', *words):
        assert word in told


@pytest.mark.parametrize(
    'text',
    [
        *('null', '~', '', 'true', 'Yes', 'on', 'OFF', '0', '-7', '+3', '1_000', '007', '0o17'),
        *('0x1F', '0b101', '1.5', '.5', '-.5', '1.0e+3', '.inf', '-.Inf', '.nan'),
        *("'1'", '"yes"', 'text', 'a b', 'y', '1e', '0x', '1.2.3', '08', '-'),
        *('[1, 2.0, x]', '{a: {b: [1]}}', '| \n  a\n  b\n', '> \n  a\n  b\n', '1 # comment'),
    ],
)
def test_value_is_what_pyyaml_makes_of_it(text):
    """Files that people have keep their meaning."""
    assert repr(parse_yaml(text, 'a.yaml')) == repr(yaml.safe_load(text))


@pytest.mark.parametrize(
    ('text', 'value'), [('1e3', 1000.0), ('-6.02E23', -6.02e23), ('.5e-1', 0.05), ('=', '=')]
)
def test_value_that_pyyaml_takes_for_something_else(text, value):
    assert repr(parse_yaml(text, 'a.yaml')) == repr(value)


@pytest.mark.parametrize('text', ['2024-13-45', '2024-01-01', '2024-01-01 10:00:00'])
def test_date_is_text(text):
    assert parse_yaml(text, 'a.yaml') == text


def test_names_of_fields_are_text():
    assert parse_yaml('{1: a, on: b, 2024-01-01: c, ~: d, x: e}', 'a.yaml') == dict(
        zip(('1', 'on', '2024-01-01', '~', 'x'), 'abcde', strict=True)
    )


def test_alias_repeats_a_value_that_can_be_changed_by_itself():
    values = parse_yaml('a: &a {x: [1]}\nb: *a\nc: &n 5\nd: *n\n', 'a.yaml')
    assert values == {'a': {'x': [1]}, 'b': {'x': [1]}, 'c': 5, 'd': 5}
    values['a']['x'].append(2)
    assert values['b'] == {'x': [1]}
    assert parse_yaml('a: &a {x: [1]}\nb: *a\nc: &n 5\nd: *n\n', 'a.yaml')['a'] == {'x': [1]}


JSON = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(10**20), 10**20)
    | st.floats(allow_nan=False)
    | st.text(st.characters(exclude_categories=['C']), max_size=10)
    | st.sampled_from(['1e5', '1e-3', '2024-01-01', 'yes', '', '<<', '=', '0o17', '1:30', '017']),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(
            st.text(st.characters(exclude_categories=['C']), max_size=5), inner, max_size=3
        )
    ),
    max_leaves=10,
)


@given(JSON)
@settings(max_examples=60)
def test_written_values_are_read_again(values):
    assert repr(parse_yaml(yaml_text(values), 'a.yaml')) == repr(values)


@pytest.mark.parametrize('file', sorted(VEHICLE_FOLDER.glob('*.yaml')), ids=lambda file: file.stem)
def test_shipped_vehicle_reads_as_before(file):
    assert read_yaml(file) == yaml.safe_load(file.read_text(encoding='utf-8'))


def test_line_of_a_value_or_of_its_owner(tmp_path):
    path = tmp_path / 'a.yaml'
    path.write_text('a:\n  b: [1,\n    2]\n  c:\n    d: 5\n', encoding='utf-8')
    lines = [
        yaml_line(path, where)
        for where in (('a', 'b', '1'), ('a', 'c', 'd'), ('a', 'c', 'missing'), ('z',))
    ]
    assert lines == [3, 5, 4, None]


# ----------------------------------------------------------------------------------- files


def special(folder, kind):
    """Path of something that is no regular file."""
    if kind == 'fifo':
        os.mkfifo(folder / 'x')
    elif kind == 'folder':
        (folder / 'x').mkdir()
    elif kind == 'socket':
        with socket.socket(socket.AF_UNIX) as one:
            one.bind(os.path.relpath(folder / 'x'))
    else:
        (folder / 'x').symlink_to(kind)
    return folder / 'x'


@pytest.mark.parametrize('kind', ['fifo', 'folder', 'socket', '/dev/zero'])
def test_only_regular_files_are_read(tmp_path, kind):
    with pytest.raises(ConfigurationError, match='x: not a regular file'):
        read_text(special(tmp_path, kind))


def test_large_file_is_refused(tmp_path):
    path = tmp_path / 'x'
    path.write_bytes(b'#' * files.MAX_BYTES)
    assert len(read_text(path)) == files.MAX_BYTES
    path.write_bytes(b'#' * (files.MAX_BYTES + 1))
    with pytest.raises(ConfigurationError, match='larger than 1,000,000 bytes'):
        read_text(path)


@pytest.mark.parametrize('name', ['a' * 300, 'a\0b', 'missing', 'x/y'])
def test_name_that_cannot_be_is_told(tmp_path, name):
    (tmp_path / 'x').write_text('', encoding='utf-8')
    assert not is_file(tmp_path / name)
    with pytest.raises(ConfigurationError):
        read_text(tmp_path / name)


def test_bytes_that_are_no_text_are_named_with_their_line(tmp_path):
    path = tmp_path / 'x'
    path.write_bytes(b'a: 1\nb: \xff\n')
    with pytest.raises(ConfigurationError, match='x:2: not UTF-8 text, byte 0xff'):
        read_text(path)


# ------------------------------------------------------------------------------------ JSON


@pytest.mark.parametrize(
    ('text', 'word'),
    [
        ('[' * 100_000 + ']' * 100_000, 'nested'),
        ('[' * 42 + ']' * 42, 'nested more than 40 deep'),
        ('9' * 5000, 'a number of 5000 characters'),
        ('{"a": ', 'not valid JSON'),
        (b'\xff', 'not valid JSON'),
    ],
    ids=short,
)
def test_json_that_would_do_harm_is_refused(text, word):
    with pytest.raises(ConfigurationError, match='a.json: not valid JSON') as caught:
        parse_json(text, 'a.json')
    assert word in str(caught.value)


def test_json_is_read(tmp_path):
    path = tmp_path / 'a.json'
    path.write_text('{"a": [1, 2.5, "x", null], "b": 123456789012345678901}', encoding='utf-8')
    assert read_json(path) == {'a': [1, 2.5, 'x', None], 'b': 123456789012345678901}


# ---------------------------------------------------------------------------------- errors


@pytest.mark.parametrize(
    'value',
    [
        'x' * 10**6,
        ['x' * 1000] * 1000,
        {str(i): i for i in range(10**5)},
        [[[[[[[[[['deep']]]]]]]]]],
        10**5000,
        -(10**5000),
        b'x' * 10**5,
        '\x1b[31m\udcff\n' * 100,
    ],
    ids=short,
)
def test_shown_value_is_short_and_printable(value):
    assert 0 < len(shown(value)) <= MAX_SHOWN
    assert shown(value).isprintable()


@pytest.mark.parametrize('value', [1, -2.5, 'x', [1.0], {'a': 1}, None, True, 10**70])
def test_short_value_is_shown_whole(value):
    assert shown(value) == repr(value)


def test_message_is_short_and_printable():
    told = str(ConfigurationError('\n'.join(['\x1b[31m' + 'x' * 10**5 + 'end'] * 1000)))
    lines = told.split('\n')
    assert len(lines) == MAX_LINES + 1
    assert lines[-1] == 'and 980 more'
    assert all(one.startswith('\\x1b[31mxxx') and one.endswith('xend') for one in lines[:-1])
    assert len(told) < (MAX_LINES + 1) * (MAX_LINE + 20)
    assert str(ConfigurationError(told)) == told


def test_printable_keeps_what_it_is_told_to():
    assert printable('é\n\t\x1b\u202e', keep='\n\t') == 'é\n\t\\x1b\\u202e'
