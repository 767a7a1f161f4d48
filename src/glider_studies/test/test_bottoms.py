# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Random bottoms: what they are, what is asked of a flight over them, and one that is flown."""

import json

import pytest
import xarray

from glider_studies import bottoms
from glider_studies.bottoms import CLEARANCE, FIRST, WITHOUT, fly_one, write_bottom
from glider_studies.paper.experiments import fly, verdict_of

#: A bottom that a yo to 200 m touches.
TOUCHED = FIRST


def test_a_bottom_has_hills_and_is_the_same_again(tmp_path):
    for file in 'one.nc', 'two.nc':
        write_bottom(TOUCHED, tmp_path / file)
    one, two = ((tmp_path / file).read_bytes() for file in ('one.nc', 'two.nc'))
    assert one == two
    heights = xarray.load_dataset(tmp_path / 'one.nc')['elevation']
    assert -300 <= heights.min() < heights.max() - 20 and heights.max() <= -50


def test_over_hills_it_is_the_clearance_that_keeps_a_vehicle_off_the_bottom():
    kept, hit = (fly_one((TOUCHED, way)) for way in (CLEARANCE, WITHOUT))
    assert (kept['touched'], kept['completed']) == (False, True) and kept['least_m'] > 5.0
    assert hit == {
        **{'touched': True, 'least_m': 0.0, 'noticed': True, 'came_up': True},
        'completed': False,
    }


@pytest.mark.parametrize(
    ('kept', 'hit', 'verdict'),
    [
        ({}, {'touched': True}, 'passed'),
        ({'touched': True}, {'touched': True}, 'failed'),
        ({}, {'touched': True, 'came_up': False}, 'failed'),
        ({}, {}, 'failed'),
    ],
    ids=['as is asked', 'touched with a clearance', 'stayed down', 'nobody can touch anything'],
)
def test_what_fails_the_study(kept, hit, verdict):
    flown = {'touched': False, 'noticed': True, 'came_up': True, 'completed': True, 'least_m': 8.0}

    class Pool:
        def results(self, function, tasks, progress):
            changes = {CLEARANCE: kept, WITHOUT: hit}
            return {key: {**flown, **changes[key[-1][-1]]} for key in tasks}

    one = bottoms.experiment(0)
    entry = json.loads(json.dumps(verdict_of(one, *fly([one], Pool(), None)[0])))
    assert entry['verdict'] == verdict
    assert [row['bottoms'] for row in entry['rows']] == [bottoms.COUNT] * 2
