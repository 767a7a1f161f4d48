# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""``./glider ocean``: what is in a file, whether it covers a mission, and its chart."""

import json

import matplotlib.image
import numpy as np
import pytest
import xarray

from glider_base.settings import ConfigurationError
from glider_bringup.commands.ocean import ocean

#: A mission of a day in the sea of `sea_file`.
MISSION = """
name: crossing
dives: 0
duration_s: 86400.0
origin: {time: 2026-03-02}
path: {kind: waypoints, waypoints_latlon: [[36.0, 122.0], [36.2, 122.3]]}
"""


@pytest.fixture(scope='module')
def sea_file(tmp_path_factory):
    """A sea of 0.3 m/s to the east and 0.4 m/s to the north, with an island."""
    path = tmp_path_factory.mktemp('sea') / 'sea.nc'
    axes = {
        'time': np.datetime64('2026-03-01') + np.arange(4) * np.timedelta64(1, 'D'),
        'depth': np.array([0.5, 100.0, 1100.0]),
        'latitude': np.arange(35.0, 37.01, 0.1),
        'longitude': np.arange(121.0, 123.01, 0.1),
    }
    shape = tuple(map(len, axes.values()))
    data = xarray.Dataset(
        {
            name: (tuple(axes), np.full(shape, speed), {'units': 'm s-1'})
            for name, speed in (('uo', 0.3), ('vo', 0.4))
        },
        {**axes, 'depth': ('depth', axes['depth'], {'units': 'm', 'positive': 'down'})},
        {'source': 'made'},
    )
    island = (data.latitude < 35.25) & (data.longitude < 121.25)
    data.where(~island).to_netcdf(path, engine='scipy')
    return path


def told(capsys, *args, **options):
    ocean(*args, as_json=True, **options)
    return json.loads(capsys.readouterr().out)


def test_it_tells_what_is_in_a_file(sea_file, capsys):
    found = told(capsys, sea_file)
    assert found['variables'] == ['uo', 'vo']
    assert found['times'] == {
        **{'first': '2026-03-01T00:00Z', 'last': '2026-03-04T00:00Z'},
        **{'count': 4, 'step_h': 24.0},
    }
    assert found['depth_m'] == {'first': 0.5, 'last': 1100.0, 'count': 3}
    assert found['land_share'] == pytest.approx(9 / 441)
    assert found['speed_mps'] == pytest.approx({'rms': 0.5, 'max': 0.5})
    assert found['mission'] is None


def test_it_tells_whether_a_mission_is_covered_and_draws_it(sea_file, tmp_path, capsys):
    mission, picture = tmp_path / 'crossing.yaml', tmp_path / 'sea.png'
    mission.write_text(MISSION)
    found = told(capsys, sea_file, mission=str(mission), out=picture)
    assert found['mission'] == {'scenario': str(mission), 'covered': True, 'reason': ''}
    assert matplotlib.image.imread(picture).std() > 0.05
    mission.write_text(MISSION.replace('36.2, 122.3', '37.2, 122.3'))
    with pytest.raises(ConfigurationError, match='latitude of the path goes from 36.000 to 37.2'):
        ocean(sea_file, mission=str(mission), as_json=True)
    found = json.loads(capsys.readouterr().out)
    assert found['mission']['covered'] is False
    assert 'allowed: within 35.000 to 37.000' in found['mission']['reason']
