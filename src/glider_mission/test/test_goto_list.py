# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Lists of waypoints of a Slocum: written, read, and flown."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from glider_base.settings import ConfigurationError
from glider_mission.goto_list import goto_list, read_goto_list
from glider_mission.scenario import load_scenario

PLACES = st.tuples(st.floats(-84.0, 84.0), st.floats(-180.0, 180.0))

#: As pilots write them: tabs, comments, waypoints that are commented out, leading zeros.
BY_HAND = """behavior_name=Goto_list
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


@given(st.lists(PLACES, min_size=1, max_size=20))
def test_a_list_out_and_in_has_the_same_places(tmp_path_factory, places):
    file = tmp_path_factory.mktemp('ma') / 'goto_l10.ma'
    file.write_text(goto_list('a mission', places))
    # A millionth of a minute is 1.9 mm.
    assert np.array(read_goto_list(file)) == pytest.approx(np.array(places), abs=0.6e-6 / 60.0)


def test_a_list_by_hand_is_read_as_a_slocum_does(tmp_path):
    file = tmp_path / 'goto_l10.ma'
    file.write_bytes(BY_HAND.encode('latin-1'))
    found = np.array(read_goto_list(file))
    expected = [(39.0, -73.0 - 18.8 / 60.0), (-54.0 - 33.5 / 60.0, 7.0 + 13.0 / 60.0)]
    assert found == pytest.approx(np.array(expected), abs=1e-9)


def test_a_mission_goes_to_the_waypoints_of_a_list(tmp_path):
    file, places = tmp_path / 'goto_l10.ma', [(47.5, -52.5), (47.51, -52.49), (47.52, -52.5)]
    file.write_text(goto_list('a mission', places))
    path = {'path.waypoints_latlon': str(file)}
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
        ('713.000', '760.000', 'line 13: .*allowed: longitude and latitude'),
        ('713.000', 'west', 'line 13'),
        ('(nodim) 2', '(nodim) 4', r'num_waypoints = 4 \(allowed: 1 to 3'),
        ('<end:waypoints>', '', 'needed: <start:waypoints> and <end:waypoints>'),
    ],
)
def test_what_is_no_list_is_refused_by_line(tmp_path, old, new, told):
    file = tmp_path / 'goto_l10.ma'
    file.write_bytes(BY_HAND.replace(old, new).encode('latin-1'))
    with pytest.raises(ConfigurationError, match=told):
        load_scenario('survey', {'path.waypoints_latlon': str(file)})
    with pytest.raises(ConfigurationError, match='lost.ma'):
        load_scenario('survey', {'path.waypoints_latlon': str(tmp_path / 'lost.ma')})
