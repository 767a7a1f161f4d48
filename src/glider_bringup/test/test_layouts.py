# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Every curve of the layouts for Foxglove and PlotJuggler is in a bag, under its own name."""

import json
import math
import re
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from types import SimpleNamespace

import pytest
from rosbags.highlevel import AnyReader

from glider_base.frames import euler_from_quaternion, odometry_to_wire, quaternion_from_euler
from glider_base.signals import Odometry
from glider_bringup.engines.recorded import fly_recorded
from glider_mission.run_folder import make_run_folder
from glider_mission.scenario import load_scenario

LAYOUTS = Path(__file__).parents[1] / 'layouts'
FOXGLOVE = json.loads((LAYOUTS / 'foxglove.json').read_text(encoding='utf-8'))
PLOTJUGGLER = ElementTree.parse(LAYOUTS / 'plotjuggler.xml').getroot()
#: Topics that PlotJuggler and scripts make from a quaternion, and what they call the angles.
SCRIPTS = FOXGLOVE['userNodes']
ANGLES = ('roll', 'pitch', 'yaw')


def foxglove_paths() -> list[str]:
    """Message paths of all panels."""
    found = []
    for panel in FOXGLOVE['configById'].values():
        found += [path['value'] for path in panel.get('paths', [])]
        found += [panel[key]['value'] for key in ('xAxisPath',) if key in panel]
    return found


def plotjuggler_curves() -> list[str]:
    """Names of the series of all plots."""
    found = []
    for curve in PLOTJUGGLER.iter('curve'):
        if 'curve_x' in curve.attrib:
            found += [curve.get('curve_x'), curve.get('curve_y')]
        else:
            found.append(curve.get('name'))
    return found


@pytest.fixture(scope='module')
def last(tmp_path_factory) -> dict:
    """Last message of every topic of a bag, read by a library that is not ours."""
    folder = tmp_path_factory.mktemp('run') / 'flight'
    scenario = load_scenario('survey', {'dives': 0, 'duration_s': 30.0})
    make_run_folder(scenario, folder)
    fly_recorded(scenario, folder)
    found = {}
    with AnyReader([folder]) as reader:
        for connection, _, raw in reader.messages():
            if connection.topic != '/diagnostics' or '/diagnostics' not in found:
                found[connection.topic] = reader.deserialize(raw, connection.msgtype)
    return found


def script_output(source: str, message) -> dict[str, float]:
    """What a script of the layout makes of a message: its expressions are Python's, too."""
    names = {
        'Math': SimpleNamespace(PI=math.pi, atan2=math.atan2, asin=math.asin, min=min, max=max),
        'event': SimpleNamespace(message=message),
    }
    for name, expression in re.findall(r'const (\w+) = (.+);', source.partition('{ Input }')[2]):
        if name not in ('inputs', 'output'):
            names[name] = eval(expression, {}, names)
    body = source.partition('return {')[2]
    return {
        name: eval(expression, {}, names)
        for name, expression in re.findall(r'(\w+_deg): (.+),', body)
    }


def follow(value, steps: list[str]) -> list:
    """Values that the steps of a message path lead to: names, slices and filters."""
    values = [value]
    for step in steps:
        if step == '[:]':
            values = [item for value in values for item in value]
        elif step.startswith('['):
            values = [value[int(step[1:-1])] for value in values]
        elif step.startswith('{'):
            name, wanted = re.fullmatch(r'\{(\w+)=="(\w+)"\}', step).groups()
            values = [value for value in values if getattr(value, name) == wanted]
        else:
            values = [getattr(value, step[1:]) for value in values]
    return values


@pytest.mark.parametrize('path', foxglove_paths())
def test_foxglove_path_leads_to_a_value(last, path):
    topic, rest = re.fullmatch(r'([\w/]+)(.*)', path).groups()
    steps = re.findall(r'\.\w+|\[[^\]]+\]|\{[^}]+\}', rest)
    assert ''.join(steps) == rest
    if topic.startswith('/studio_script/'):
        source = SCRIPTS[topic.removeprefix('/studio_script/')]['sourceCode']
        (name,) = steps
        assert f'export const output = "{topic}";' in source
        (input_topic,) = re.findall(r'inputs = \["(.+)"\]', source)
        assert math.isfinite(script_output(source, last[input_topic])[name[1:]])
    else:
        (value,) = follow(last[topic], steps)
        assert isinstance(value, str) or math.isfinite(value)


@pytest.mark.parametrize('panel', FOXGLOVE['configById'])
def test_foxglove_curve_of_a_joint_state_has_its_name(last, panel):
    """A path knows the number of a joint only, the curve carries its name."""
    for path in FOXGLOVE['configById'][panel].get('paths', []):
        found = re.fullmatch(r'(/glider/(?:joint_states|adaptation|command)).position\[(\d)\]',
                             path['value'])  # fmt: skip
        if found and path['label'] == 'command':
            assert last[found[1]].name[int(found[2])] == panel.removeprefix('Plot!')
        elif found:
            assert last[found[1]].name[int(found[2])] == path['label']


def test_foxglove_shows_every_panel_once():
    def leaves(node) -> list[str]:
        if isinstance(node, str):
            return [node]
        return leaves(node['first']) + leaves(node['second'])

    (tabs,) = (panel['tabs'] for name, panel in FOXGLOVE['configById'].items() if 'Tab' in name)
    shown = [name for tab in tabs for name in leaves(tab['layout'])]
    assert sorted([*shown, FOXGLOVE['layout']]) == sorted(FOXGLOVE['configById'])
    topics = {panel.get('topicToRender') for panel in FOXGLOVE['configById'].values()}
    assert topics == {None, '/diagnostics'}


@pytest.mark.parametrize('name', SCRIPTS)
@pytest.mark.parametrize(
    'euler', [(0.0, 0.0, 0.0), (0.3, -0.5, 1.0), (-0.2, 0.4, -2.5), (0.1, -1.2, 3.1)]
)
def test_foxglove_script_gives_the_angles_of_a_pilot(name, euler):
    """Against the frames of the stack: roll, pitch (+ nose up) and heading of FRD in NED."""
    q = quaternion_from_euler(*euler)
    wire = odometry_to_wire(Odometry(0.0, 0.0, 0.0, *q, *(6 * (0.0,))))
    orientation = SimpleNamespace(**dict(zip('wxyz', wire[3:7], strict=True)))
    pose = SimpleNamespace(pose=SimpleNamespace(pose=SimpleNamespace(orientation=orientation)))
    angles = script_output(SCRIPTS[name]['sourceCode'], pose)
    roll, pitch, heading = (math.degrees(angle) for angle in euler_from_quaternion(*q))
    assert angles['roll_deg'] == pytest.approx(roll, abs=1e-9)
    assert angles['pitch_deg'] == pytest.approx(pitch, abs=1e-9)
    assert angles['heading_deg'] == pytest.approx(heading % 360.0, abs=1e-9)


@pytest.mark.parametrize('curve', plotjuggler_curves())
def test_plotjuggler_curve_is_a_series(last, curve):
    """Series have the names of the fields; joints their own, and quaternions have angles."""
    topic = next(name for name in sorted(last, reverse=True) if curve.startswith(name + '/'))
    steps = curve.removeprefix(topic + '/').split('/')
    message = last[topic]
    if hasattr(message, 'position'):
        joint, kind = steps
        value = getattr(message, kind)[message.name.index(joint)]
    elif steps[-1] in ANGLES:
        (orientation,) = follow(message, ['.' + step for step in steps[:-1]])
        value = orientation.w
    else:
        (value,) = follow(message, ['.' + step for step in steps])
    assert math.isfinite(value)


def test_plotjuggler_splitters_have_what_they_count():
    for splitter in PLOTJUGGLER.iter('DockSplitter'):
        assert int(splitter.get('count')) == len(splitter) == len(splitter.get('sizes').split(';'))
    assert len(list(PLOTJUGGLER.iter('plot'))) == len(list(PLOTJUGGLER.iter('DockArea')))


def test_layouts_show_the_default_namespace():
    for name in (*foxglove_paths(), *plotjuggler_curves()):
        assert name.startswith(('/glider/', '/diagnostics', '/studio_script/'))
