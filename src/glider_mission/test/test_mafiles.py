# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Files of a Slocum's mission: written, read, and what cannot be flown refused by name."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from glider_base.settings import ConfigurationError
from glider_guidance.yo.machine import ProfileSettings
from glider_mission.mafiles import mafiles, read_goto_list, read_profile, with_mafiles
from glider_mission.scenario import load_scenario

PLACES = st.tuples(st.floats(-84.0, 84.0), st.floats(-180.0, 180.0))
PITCHES = st.floats(8.0, 60.0)
WEIGHTS = st.floats(1e-6, 20.0)
#: What a Slocum's files say of a profile.
PROFILES = st.builds(
    ProfileSettings,
    depth_m=st.floats(10.0, 12000.0),
    top_depth_m=st.floats(2.0, 1000.0),
    pitch_deg=PITCHES,
    climb_pitch_deg=st.none() | PITCHES,
    net_heaviness_kg=WEIGHTS,
    climb_net_heaviness_kg=st.none() | WEIGHTS,
    clearance_m=st.just(0.0) | st.floats(1e-6, 80.0),
    surface_every_dives=st.integers(0, 100000),
    wait_s=st.floats(0.0, 864000.0),
)

#: As pilots write them: tabs, comments, waypoints that are commented out, leading zeros.
GOTO = """behavior_name=Goto_list
# 5. M\xe4rz: moved off the bank
<start:b_arg>
\tb_arg: start_when(enum) 0
\tb_arg: list_stop_when(enum) 007
b_arg: initial_wpt(enum)     -1  # the next one
\tb_arg: num_waypoints(nodim) 2
<end:b_arg>
<start:waypoints>
#     LON     LAT
#-07300.0    3850.2
    -07318.8    3900.0   # 304  |  NM003
713.000\t-5433.500
621.6 5413.5 # beyond num_waypoints
<end:waypoints>
"""
#: With a comment before the behavior, and comments without a blank.
YO = """# calm water
behavior_name = Yo
# 12. M\xe4rz: deeper
<start:b_arg>
    b_arg: start_when(enum)      2   # pitch idle
    b_arg:  num_half_cycles_to_do(nodim)    6

    # dive
\tb_arg: d_target_depth(m)\t\t180
    b_arg: d_target_altitude(m)  20# over the bottom
    b_arg: d_use_pitch(enum)      3   # 1:battpos  2:setonce  3:servo
    b_arg: d_pitch_value(X)   -0.4538     # -26 deg
    b_arg: d_use_bpump(enum)  2
    b_arg: d_bpump_value(X) -200.0
#    b_arg: d_use_thruster(enum) 4
    b_arg: d_stop_when_hover_for(sec) 180.0
    b_arg: d_speed_min(m/s)    -100.0
    # climb
    b_arg: c_target_depth(m)     5
    b_arg: c_target_altitude(m)  -1
    b_arg: c_pitch_value(X) 0.5236
    b_arg: c_bpump_value(X) 220
    b_arg: end_action(enum)      2   # 0-quit, 2 resume
<end:b_arg>
"""
SURFACE = """behavior_name=surface
<start:b_arg>
    b_arg: start_when(enum) 2  # 12-no comms, 9-every when_secs
    b_arg: when_secs(sec) 10800
    b_arg: end_action(enum) 1
    b_arg: gps_wait_time(s) 300
    b_arg: keystroke_wait_time(sec) 599
    b_arg: c_use_pitch(enum) 3
    b_arg: c_pitch_value(X) 0.4363
    b_arg: strobe_on(bool) 1
<end:b_arg>
"""


@pytest.fixture
def write(tmp_path):
    """Function that writes a file as an old editor does, and gives its path."""

    def file(name: str, text: str) -> str:
        (tmp_path / name).write_bytes(text.encode('latin-1'))
        return str(tmp_path / name)

    return file


def numbers(profile: ProfileSettings) -> dict[str, float]:
    """Numbers of a profile; a climb that says none of its own has those of the dive."""
    said = profile.model_dump(exclude={'mode'}, exclude_none=True)
    dive = {'climb_pitch_deg': 'pitch_deg', 'climb_net_heaviness_kg': 'net_heaviness_kg'}
    return {climb: said[name] for climb, name in dive.items()} | said


@given(st.lists(PLACES, min_size=1, max_size=20), PROFILES)
def test_a_mission_out_and_in_is_the_same(tmp_path_factory, places, profile):
    folder = tmp_path_factory.mktemp('ma')
    for name, text in mafiles('a mission', places, profile).items():
        (folder / name).write_text(text)
    # A millionth of a minute is 1.9 mm.
    read = np.array(read_goto_list(folder / 'goto_l10.ma'))
    assert read == pytest.approx(np.array(places), abs=0.6e-6 / 60.0)
    files = [str(folder / name) for name in ('yo10.ma', 'surfac10.ma')]
    again = ProfileSettings(**with_mafiles({'mafiles': files}))
    assert numbers(again) == pytest.approx(numbers(profile), rel=1e-10, abs=1e-9)


@given(st.integers(80, 600), st.integers(1, 300))
def test_round_numbers_come_back_to_the_last_bit(tmp_path_factory, tenths, grams):
    profile = ProfileSettings(pitch_deg=tenths / 10.0, net_heaviness_kg=grams / 1000.0)
    places = [(47.51, -52.49), (47.523456, tenths / 10.0)]
    folder = tmp_path_factory.mktemp('ma')
    for name, text in mafiles('a mission', places, profile).items():
        (folder / name).write_text(text)
    assert read_goto_list(folder / 'goto_l10.ma') == places
    assert ProfileSettings(**read_profile(str(folder / 'yo10.ma'))) == profile


def test_lines_end_and_files_begin_as_editors_of_windows_have_them(write):
    marked = '\xef\xbb\xbf' + YO.partition('\n')[2].replace('\n', '\r\n')
    assert read_profile(write('win.ma', marked)) == read_profile(write('yo10.ma', YO))


def test_what_was_read_is_written_as_it_was(write):
    profile = ProfileSettings(**read_profile(write('yo10.ma', YO)))
    written = mafiles('a mission', [], profile)['yo10.ma'].split('\n')
    for line in ('d_target_depth(m) 180', 'd_pitch_value(X) -0.4538', 'c_pitch_value(X) 0.5236'):
        assert f'b_arg: {line}' in written


def test_a_list_without_waypoints_is_none(write):
    text = '<start:b_arg>\n<end:b_arg>\n<start:waypoints>\n# none yet\n<end:waypoints>\n'
    file = write('goto_l10.ma', f'behavior_name=goto_list\n{text}')
    with pytest.raises(ConfigurationError, match=r'goto_l10.ma: no waypoints \(allowed: one'):
        load_scenario('survey', {'path.waypoints_latlon': file})
    file = write(
        'goto_l10.ma', f'behavior_name=goto_list\n{text}'.replace('# none', '1 2\n# none')
    )
    with pytest.raises(ConfigurationError, match=r'file .*goto_l10.ma: no list .*: 2 and more'):
        load_scenario('survey', {'path.waypoints_latlon': file})


def test_a_list_by_hand_is_read_as_a_slocum_does(write):
    found = np.array(read_goto_list(write('goto_l10.ma', GOTO)))
    expected = [(39.0, -73.0 - 18.8 / 60.0), (-54.0 - 33.5 / 60.0, 7.0 + 13.0 / 60.0)]
    assert found == pytest.approx(np.array(expected), abs=1e-9)


def test_a_yo_and_surfacings_by_hand_are_the_profile(write):
    """And what they do not say is that of the scenario, whatever it says of the rest."""
    files = [write('surfac10.ma', SURFACE), write('yo10.ma', YO)]
    changes = {'profile.prepare_s': 30.0, 'profile.mafiles': files}
    profile = load_scenario('slocum_shelf', changes).profile
    assert profile.model_dump() == pytest.approx(
        {
            'mode': 'profile',
            'depth_m': 180.0,
            'top_depth_m': 5.0,
            'pitch_deg': math.degrees(0.4538),
            'climb_pitch_deg': math.degrees(0.5236),
            'net_heaviness_kg': 0.205,  # 200 cc of 1025 kg/m^3
            'climb_net_heaviness_kg': 0.2255,
            'clearance_m': 20.0,
            'prepare_s': 30.0,
            'surface_every_dives': 3,
            'wait_s': 599.0,
        },
        abs=1e-8,
    )


def test_a_yo_without_end_never_surfaces_and_off_is_off(write):
    """Whatever the scenario said before."""
    text = YO.replace('(nodim)    6', '(nodim) -1').replace('(m)  20#', '(m) -1 #')
    scenario = write('mine.yaml', 'profile: {clearance_m: 10.0, surface_every_dives: 2}\n')
    profile = load_scenario(scenario, {'profile.mafiles': write('yo10.ma', text)}).profile
    assert (profile.surface_every_dives, profile.clearance_m) == (0, 0.0)


def test_a_yo_is_a_sawtooth_though_the_mission_was_a_path_in_3d(write):
    only = 'behavior_name=yo\n<start:b_arg>\nb_arg: d_target_depth(m) 100\n<end:b_arg>\n'
    changes = {'profile.mafiles': write('yo10.ma', only)}
    assert load_scenario('spline').profile.mode == 'path'
    assert load_scenario('spline', changes).profile.mode == 'profile'


@pytest.mark.parametrize('first', ['profile.depth_m', 'profile.mafiles'])
def test_a_field_and_files_are_changed_at_once_only_if_they_agree(write, first):
    """Whichever of the two comes first."""
    for depth_m, is_same in ((180.0, True), (90.0, False)):
        changes = {'profile.depth_m': depth_m, 'profile.mafiles': write('yo10.ma', YO)}
        changes = {first: changes[first], **changes}
        if is_same:
            assert load_scenario('survey', changes).profile.depth_m == 180.0
            continue
        with pytest.raises(ConfigurationError, match='depth_m = 90.0: mafiles say 180.0'):
            load_scenario('survey', changes)


def test_a_field_is_said_once_and_a_run_does_not_need_the_files(write, tmp_path):
    file = write('yo10.ma', YO)
    scenario = tmp_path / 'mine.yaml'
    scenario.write_text(f'profile: {{mafiles: {file}, depth_m: 180.0, wait_s: 60.0}}\n')
    read = load_scenario(str(scenario))
    with pytest.raises(ConfigurationError, match='depth_m = 90.0: mafiles say 180.0'):
        load_scenario(str(scenario), {'profile.depth_m': 90.0})
    scenario.write_text(read.to_yaml())
    (tmp_path / 'yo10.ma').unlink()
    assert load_scenario(str(scenario)) == read


def test_files_of_a_scenario_lie_beside_it_wherever_it_is_flown_from(write, tmp_path, monkeypatch):
    places = [(36.1, 122.0), (36.2, 122.1)]
    for name, text in mafiles('a mission', places, ProfileSettings()).items():
        (tmp_path / name).write_text(text)
    scenario, path = tmp_path / 's.yaml', 'path: {kind: waypoints, waypoints_latlon: goto_l10.ma}'
    order = 'orders: [{at_s: 60, path: {kind: waypoints, waypoints_latlon: goto_l10.ma}}]'
    profile = 'profile: {mafiles: [yo10.ma, surfac10.ma]}'
    scenario.write_text(f'description: as in yo10.ma\n{path}\n{order}\n{profile}\n')
    (tmp_path / 'elsewhere').mkdir()
    monkeypatch.chdir(tmp_path / 'elsewhere')
    flown = load_scenario(scenario)
    assert flown.description == 'as in yo10.ma'
    assert flown.path.waypoints_latlon == [(36.1, 122.0), (36.2, 122.1)]
    assert flown.orders[0].path.waypoints == flown.path.waypoints
    (tmp_path / 'yo10.ma').unlink()
    with pytest.raises(ConfigurationError, match=str(tmp_path / 'yo10.ma')):
        load_scenario(scenario)


def test_a_mission_goes_to_the_waypoints_of_a_list(write):
    places = [(47.5, -52.5), (47.51, -52.49), (47.52, -52.5)]
    files = mafiles('a mission', places, ProfileSettings())
    path = {'path.waypoints_latlon': write('goto_l10.ma', files['goto_l10.ma'])}
    read, written = (
        load_scenario('survey', path),
        load_scenario('survey', {'path.waypoints_latlon': places}),
    )
    assert np.array(read.path.waypoints) == pytest.approx(
        np.array(written.path.waypoints), abs=0.01
    )
    # What is flown has the places themselves: the file may change.
    assert np.array(read.path.waypoints_latlon) == pytest.approx(np.array(places), abs=1e-8)


@pytest.mark.parametrize(
    ('old', 'new', 'told'),
    [
        ('Goto_list', 'Yo', 'behavior_name=goto_list'),
        ('behavior_name=', '# ', r'behavior_name = missing \(allowed: behavior_name=goto_list'),
        ('713.000', '760.000', 'line 13: .*allowed: longitude and latitude'),
        ('713.000', 'west', 'line 13'),
        ('713.000', 'inf', "line 13: 'inf\\\\t-5433.500': no waypoint"),
        ('713.000', '1e400', 'line 13'),
        ('(nodim) 2', '(nodim) 4', r'num_waypoints = 4 \(allowed: 1 to 3'),
        ('(nodim) 2', '(nodim) 1.5', r'num_waypoints = 1.5 \(allowed: 1 to 3'),
        ('<end:waypoints>', '', 'needed: <start:waypoints> and <end:waypoints>'),
        ('<end:b_arg>', '', 'needed: <start:b_arg> and <end:b_arg>'),
        ('     -1', '     1', r'line 6: initial_wpt = 1: .*allowed: 0 \(the first\), -1'),
        ('start_when(enum) 0', 'num_legs_to_run(nodim) 4', r'num_legs_to_run = 4: .*-2 \(once'),
    ],
)
def test_what_is_no_list_is_refused_by_line(write, old, new, told):
    file = write('goto_l10.ma', GOTO.replace(old, new))
    with pytest.raises(ConfigurationError, match=told):
        load_scenario('survey', {'path.waypoints_latlon': file})
    with pytest.raises(ConfigurationError, match='lost.ma'):
        load_scenario('survey', {'path.waypoints_latlon': f'{file}/lost.ma'})


@pytest.mark.parametrize(
    ('old', 'new', 'told'),
    [
        ('Yo', 'goto_list', 'allowed: behavior_name=yo or behavior_name=surface'),
        ('Yo', 'Yo\nbehavior_name=surface', "'yo', 'surface'"),
        (
            'd_use_pitch(enum)      3',
            'd_use_pitch(enum) 1',
            r'line 11: d_use_pitch = 1: .*3 \(ser',
        ),
        ('d_use_bpump(enum)  2', 'd_use_bpump(enum) 0', r'd_use_bpump = 0: .*2 \(absolute'),
        ('#    b_arg: d_use_thr', 'b_arg: d_use_thr', r'd_use_thruster = 4: .*0 \(off'),
        ('c_target_altitude(m)  -1', 'c_target_altitude(m) 9', r'line 20: c_target_altitude = 9'),
        ('end_action(enum)      2', 'end_action(enum) 0', r'end_action = 0: .*2 \(resume'),
        ('start_when(enum)      2', 'start_when(enum) 6', r'start_when = 6: not flown'),
        ('    6', '    5', r'num_half_cycles_to_do = 5: .*not 0, even, or -1 \(without end'),
        ('    6', '    0', 'num_half_cycles_to_do = 0'),
        ('(m)\t\t180', '(m) 5', r'line 9: d_target_depth = 5: .*allowed: 10 to 12000'),
        ('(m)  20#', '(m) 0 #', r'd_target_altitude = 0: .*allowed: 0 to 80, not 0, or -1 \(off'),
        ('-0.4538', '0.4538', r'd_pitch_value = 0.4538: .*allowed: -1.0472 to -0.139626'),
        ('-200.0', '200', r'd_bpump_value = 200: .*allowed: -19512.2 to 0, not 0'),
        ('0.5236', '0.1', r'c_pitch_value = 0.1: .*allowed: 0.139626 to 1.0472'),
        ('(X) -200.0', '(X)', "line 14: 'b_arg: d_bpump_value"),
        ('-200.0', 'inf', 'line 14: .*no argument'),
        ('d_speed_min', 'd_target_depth', 'line 17: d_target_depth: given twice'),
        ('d_speed_min', 'd_speed', r'line 17: d_speed: unknown \(allowed: start_when, '),
    ],
)
def test_what_no_yo_of_this_stack_does_is_refused_by_name(write, old, new, told):
    assert old in YO
    with pytest.raises(ConfigurationError, match=f'yo10.ma.*{told}'):
        load_scenario('survey', {'profile.mafiles': write('yo10.ma', YO.replace(old, new))})


@pytest.mark.parametrize(
    ('old', 'new', 'told'),
    [
        (
            'start_when(enum) 2',
            'start_when(enum) 12',
            r'line 3: start_when = 12: .*2 \(pitch idle',
        ),
        ('    b_arg: start_when(enum) 2', '#', 'start_when: missing'),
        ('end_action(enum) 1', 'end_action(enum) 0', r'end_action = 0: .*1 \(wait'),
        ('599', '1e6', 'keystroke_wait_time = 1e.06: .*allowed: 0 to 864000'),
    ],
)
def test_surfacings_by_time_or_without_a_next_dive_are_refused(write, old, new, told):
    assert old in SURFACE
    file = write('surfac10.ma', SURFACE.replace(old, new))
    with pytest.raises(ConfigurationError, match=f'surfac10.ma.*{told}'):
        load_scenario('survey', {'profile.mafiles': [file]})


def test_files_that_are_none_or_say_the_same_are_refused(write):
    one, other = write('yo10.ma', YO), write('yo11.ma', YO)
    for files, told in (
        ([one, other], 'yo11.ma: yo: .*yo10.ma is one too'),
        ([], r'mafiles = \[\]: no files'),
        ([7], r'mafiles = \[7\]: no files'),
        (f'{one}.lost', 'yo10.ma.lost: No such file'),
    ):
        with pytest.raises(ConfigurationError, match=told):
            load_scenario('survey', {'profile.mafiles': files})
