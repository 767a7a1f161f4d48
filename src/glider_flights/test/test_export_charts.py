# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A run as OG1, GeoJSON, KML and GPX: read by libraries that are not ours, and navigated."""

import json

import numpy as np
import pytest
import xarray
from typer.testing import CliRunner

import glider_bringup as glider
from glider_base.errors import ConfigurationError
from glider_base.signals import TICK_S
from glider_bringup.cli import app
from glider_bringup.door import tracks
from glider_bringup.door.tracks import write_mafiles
from glider_bringup.showing.flown_run import read_run
from glider_mission.scenario import load_scenario

WAYPOINTS = [(47.5, -52.5), (47.51, -52.49), (47.52, -52.5)]
CHANGES = {
    'path': {'kind': 'waypoints', 'waypoints_latlon': WAYPOINTS, 'at_end': 'continue'},
    'origin.time': '2026-03-01T06:00',
    'dives': 3,
    'profile.depth_m': 60.0,
    'profile.surface_every_dives': 1,
    'profile.wait_s': 400.0,
    'sensors.gps_std_m': 0.0,
}
#: What the manual of OG1.0 calls mandatory.
VARIABLES = (
    'TIME LATITUDE LONGITUDE DEPTH TIME_GPS LATITUDE_GPS LONGITUDE_GPS TRAJECTORY WMO_IDENTIFIER '
    'PLATFORM_MODEL PLATFORM_SERIAL_NUMBER DEPLOYMENT_TIME DEPLOYMENT_LATITUDE '
    'DEPLOYMENT_LONGITUDE'
).split()
GLOBALS = (
    'title platform platform_vocabulary id comment contributor_name contributor_email '
    'contributor_role contributor_role_vocabulary contributing_institutions '
    'contributing_institutions_role contributing_institutions_role_vocabulary rtqc_method '
    'start_date date_created featureType Conventions'
).split()


@pytest.fixture(scope='module')
def flown(tmp_path_factory):
    """Three dives of a Slocum in a current, with fixes between them."""
    out = tmp_path_factory.mktemp('flown') / 'run'
    return glider.fly('slocum_shelf', CHANGES, out=out, bag=True)


@pytest.fixture(scope='module')
def export(flown, tmp_path_factory):
    """Function that exports the run, and gives the file."""

    def run(kind: str):
        file = tmp_path_factory.mktemp('export') / f'run.{kind}'
        words = ['export', str(flown.folder), '--to', kind, '--out', str(file)]
        done = CliRunner().invoke(app, words, catch_exceptions=False)
        assert done.exit_code == 0, done.output
        return file

    return run


@pytest.fixture(scope='module')
def og1(export, tmp_path_factory):
    pytest.importorskip('h5netcdf')
    return export('og1').rename(tmp_path_factory.mktemp('og1') / 'run.nc')


def test_og1_has_what_its_manual_wants(og1):
    """The checker itself, which needs the network: docs/sea.md."""
    with xarray.open_dataset(og1, engine='h5netcdf') as read:
        assert set(VARIABLES) <= set(read.variables)
        assert set(GLOBALS) <= set(read.attrs)
        assert 'vehicle: vehicle.yaml' in read.attrs['scenario_yaml']
        assert read.encoding['unlimited_dims'] == {'N_MEASUREMENTS'}
        assert all(name.isupper() for name in read.variables)
        for name, variable in read.variables.items():
            if variable.dims == ('N_MEASUREMENTS',):
                vocabulary = variable.attrs['vocabulary']
                assert vocabulary.startswith('http://vocab.nerc.ac.uk/collection/OG1/current/')
                assert vocabulary.endswith('/'), name
        assert read['TIME'].values[0] == np.datetime64('2026-03-01T06:00')
        steps_s = np.diff(read['TIME'].values) / np.timedelta64(1, 's')
        assert set(steps_s) == {1.0}  # as docs/sea.md says
        assert read['LATITUDE'].values[0] == pytest.approx(WAYPOINTS[0][0], abs=1e-4)
        assert read['LONGITUDE'].values[0] == pytest.approx(WAYPOINTS[0][1], abs=1e-4)
        phase, depth = read['PHASE'].values, read['DEPTH'].values
        assert set(phase) <= {0, 1, 2, 3, 5}
        down = np.gradient(depth)[(depth > 10.0) & (depth < 50.0) & (phase == 2)]
        assert np.mean(down > 0.0) > 0.95
        assert np.isfinite(read['LATITUDE_GPS']).sum() > 100


def test_og1_of_the_bag_alone_is_the_same(og1, flown, tmp_path):
    (bag,) = flown.folder.glob('*.mcap')
    words = ['export', str(bag), '--to', 'og1', '--out', str(tmp_path / 'bag.nc')]
    assert CliRunner().invoke(app, words, catch_exceptions=False).exit_code == 0
    with (
        xarray.open_dataset(og1, engine='h5netcdf') as run,
        xarray.open_dataset(tmp_path / 'bag.nc', engine='h5netcdf') as read,
    ):
        assert read.equals(run)


def test_og1_read_back_has_the_same_current(og1, flown):
    """What navigation believed of the current in the flight, from what it measured.

    Over dives of 13 minutes 8 mm/s are 6 m: of when it left the surface and came back.
    """
    done = CliRunner().invoke(app, ['navigate', str(og1), '--json'], catch_exceptions=False)
    report = json.loads(done.stdout)
    assert report['segments'] >= 2
    assert report['dac_difference_mps']['segments'] >= 2
    assert report['dac_difference_mps']['p90'] <= 0.01


def test_geojson_is_valid_and_where_the_vehicle_was(export, flown):
    library = pytest.importorskip('geojson')
    read = library.loads(export('geojson').read_text())
    assert read.is_valid
    by_name = {feature['properties']['name']: feature for feature in read['features']}
    longitude, latitude = np.array(by_name['route']['geometry']['coordinates']).T
    assert np.stack([latitude, longitude], axis=-1) == pytest.approx(np.array(WAYPOINTS), abs=1e-6)
    track = np.array(by_name['track']['geometry']['coordinates'])
    data = flown.to_xarray()
    assert -track[:, 2].min() == pytest.approx(
        float(data['ground_truth_odom_depth'].max()), abs=2.0
    )
    surfacings = [name for name in by_name if name.startswith('surfacing')]
    assert len(surfacings) == len(flown.score['navigation']['reports'])


def test_a_straight_path_is_a_route_from_its_start_to_its_end(tmp_path):
    run = glider.fly('slocum_shelf', duration=60.0, out=tmp_path / 'run', bag=True)
    north_m = 111_132.9 - 559.8 * np.cos(np.radians(2.0 * 36.09))  # a degree, WGS84
    start, end = (row[:2] for row in tracks.chart_of(read_run(run.folder), None).lines['route'])
    assert start == pytest.approx((36.0, 122.0), abs=1e-6)
    assert end == pytest.approx((36.0 + 20_000.0 / north_m, 122.0), abs=1e-4)


def test_a_track_of_few_points_is_at_the_last_of_them_when_the_run_ends(flown, monkeypatch):
    monkeypatch.setattr(tracks, 'MOST_POINTS', 20)
    lines = tracks.chart_of(read_run(flown.folder), 0.0).lines
    for name in lines.keys() - {'route'}:
        last = np.datetime64(lines[name][-1].time[:-1])
        last_s = (last - np.datetime64(0, 's')) / np.timedelta64(1, 's')
        assert last_s == pytest.approx(flown.to_xarray().time.values[-1], abs=1.0)


def test_lines_are_cut_where_they_cross_the_date_line(tmp_path):
    """No line goes round the world, and the box is small."""
    path = {**CHANGES['path'], 'waypoints_latlon': [(36.0, 179.9999), (36.0, -179.99)]}
    current = {'speed_kn': 1.0, 'direction_deg': 90.0}
    changes = {'path': path, 'current': current, 'origin.time': '2026-03-01'}
    run = glider.fly('survey', changes, duration=60.0, out=tmp_path / 'run', bag=True)

    def exported(kind: str):
        words = ['export', str(run.folder), '--to', kind, '--out', str(tmp_path / kind)]
        assert CliRunner().invoke(app, words, catch_exceptions=False).exit_code == 0
        return tmp_path / kind

    route, track = json.loads(exported('geojson').read_text())['features']
    for line in (route, track):
        west, east = line['geometry']['coordinates']
        assert (west[-1][0], east[0][0]) == (180.0, -180.0)
        assert max(np.ptp([place[0] for place in part]) for part in (west, east)) < 0.02
    times = track['properties']['times']
    assert [len(part) for part in times] == [len(west), len(east)]
    fastkml, gpxpy = pytest.importorskip('fastkml'), pytest.importorskip('gpxpy')
    (document,) = fastkml.KML.parse(exported('kml')).features
    for mark, line in zip(document.features, (route, track), strict=True):
        for part, ours in zip(mark.geometry.geoms, line['geometry']['coordinates'], strict=True):
            assert part.coords[0][:2] == pytest.approx(ours[0][:2], abs=1e-6)
            assert part.coords[-1][:2] == pytest.approx(ours[-1][:2], abs=1e-6)
    read = gpxpy.parse(exported('gpx').read_text())
    for parts, line in ((read.routes, route), (read.tracks[0].segments, track)):
        for part, ours in zip(parts, line['geometry']['coordinates'], strict=True):
            found = [(point.longitude, point.latitude) for point in part.points]
            assert found == pytest.approx(np.array([place[:2] for place in ours]), abs=1e-6)
            assert all(-180.0 <= east < 180.0 for east, _ in found)  # as its schema has it
    pytest.importorskip('h5netcdf')
    with xarray.open_dataset(exported('og1'), engine='h5netcdf') as read:
        assert read.geospatial_lon_min == pytest.approx(179.9999, abs=1e-5)
        assert -180.0 <= read.geospatial_lon_max < -179.99


def test_a_track_is_on_the_date_line_when_it_crosses_it():
    """A quarter of the way between two points that are four minutes apart."""
    ends = (36.0, 179.9, 0.0, '2026-03-01T00:00:00Z'), (36.2, -179.7, 40.0, '2026-03-01T00:04:00Z')
    west, east = tracks._parts([tracks.Row(*one) for one in ends])
    there = pytest.approx(36.05), 180.0, 10.0, '2026-03-01T00:01:00Z'
    assert west[-1] == there
    assert east[0] == west[-1]._replace(longitude=-180.0)


def test_kml_and_gpx_say_the_same_as_geojson(export):
    fastkml, gpxpy = pytest.importorskip('fastkml'), pytest.importorskip('gpxpy')
    features = json.loads(export('geojson').read_text())['features']
    ours = {one['properties']['name']: one['geometry']['coordinates'] for one in features}
    (document,) = fastkml.KML.parse(export('kml')).features
    marks = {mark.name: mark.geometry for mark in document.features}
    assert marks.keys() == ours.keys()
    for name, geometry in marks.items():
        places = ours[name] if geometry.geom_type == 'LineString' else [ours[name]]
        # The library leaves out a point that is the same as the one before.
        kept = [
            place for place, last in zip(places, [None, *places], strict=False) if place != last
        ]
        assert np.array(geometry.coords)[:, :2] == pytest.approx(np.array(kept)[:, :2], abs=1e-6)
    read = gpxpy.parse(export('gpx').read_text())
    for track in read.tracks:
        (segment,) = track.segments
        found = [(point.longitude, point.latitude, point.elevation) for point in segment.points]
        assert np.array(found) == pytest.approx(np.array(ours[track.name]), abs=0.01)
        assert f'{segment.points[0].time:%Y-%m-%dT%H:%M}' == '2026-03-01T06:00'
    (route,) = read.routes
    found = np.array([(point.latitude, point.longitude) for point in route.points])
    assert found == pytest.approx(np.array(WAYPOINTS), abs=1e-6)
    assert len(read.waypoints) == sum(name.startswith('surfacing') for name in ours)


def test_a_mission_of_a_slocum_out_and_in_is_the_same_flight(export, flown):
    """Path, profile, and every number of the bag; nothing of the profile is said but by files."""
    folder = export('slocum')
    own = {name: value for name, value in CHANGES.items() if not name.startswith('profile.')}
    files = {
        'path.waypoints_latlon': str(folder / 'goto_l10.ma'),
        'profile.mafiles': [str(folder / 'yo10.ma'), str(folder / 'surfac10.ma')],
    }
    again = glider.fly('slocum_shelf', {**own, **files})
    assert again.scenario.path == flown.scenario.path
    assert again.scenario.profile == flown.scenario.profile
    assert again.to_xarray().equals(flown.to_xarray())


@pytest.mark.parametrize(
    ('changes', 'named'),
    [({}, 'path.kind = spline'), ({'path.kind': 'waypoints'}, 'profile.mode = path')],
)
def test_what_no_slocum_flies_is_not_written(flown, tmp_path, changes, named):
    run = read_run(flown.folder, traced=False)._replace(scenario=load_scenario('spline', changes))
    with pytest.raises(ConfigurationError, match=named):
        write_mafiles(run, tmp_path / 'mafiles')
    assert not (tmp_path / 'mafiles').exists()


def test_the_mission_of_a_slocum_has_what_was_ordered_at_its_start(flown, tmp_path):
    """Such as a planned route; what is ordered later no file says."""
    route = {'kind': 'waypoints', 'waypoints': [[0.0, 0.0], [500.0, 0.0], [700.0, 900.0]]}
    orders = [{'at_s': 0.0, 'path': route, 'depth_m': 50.0}]
    run = read_run(flown.folder, traced=False)
    write_mafiles(run._replace(scenario=load_scenario('survey', {'orders': orders})), tmp_path)
    files = {'profile.mafiles': [str(tmp_path / 'yo10.ma')]}
    files['path'] = {'kind': 'waypoints', 'waypoints_latlon': str(tmp_path / 'goto_l10.ma')}
    read = load_scenario('survey', files)
    assert np.allclose(np.ptp(read.path.points(0), axis=0), [700.0, 900.0, 0.0], atol=0.5)
    assert read.profile.depth_m == 50.0
    orders.append({'at_s': 900.0, 'depth_m': 80.0})
    later = run._replace(scenario=load_scenario('survey', {'orders': orders}))
    with pytest.raises(ConfigurationError, match=r'orders.1: .*at_s = 0'):
        write_mafiles(later, tmp_path / 'later')


def test_netcdf_of_a_run_with_a_date_has_times_by_cf(export):
    file = export('netcdf')
    with xarray.open_dataset(file, decode_times=False) as read:
        about = dict(read.time.attrs)
        units = about.pop('units')
    assert units == 'seconds since 2026-03-01T06:00:00Z'
    assert about == {
        'long_name': 'simulated time of the tick',
        **{'standard_name': 'time', 'axis': 'T', 'calendar': 'standard'},
    }
    with xarray.open_dataset(file) as read:
        assert read.time.values[6000] == np.datetime64('2026-03-01T06:10')


def test_a_run_of_no_date_is_refused_unless_it_is_told(tmp_path):
    declination = {'sensors.declination_deg': 20.0}
    run = glider.fly('slocum_shelf', declination, duration=30.0, out=tmp_path / 'run', bag=True)

    def told(*words: str) -> str:
        with pytest.raises(ConfigurationError) as error:
            words = ['export', str(run.folder), *words]
            CliRunner().invoke(app, words, catch_exceptions=False)
        return str(error.value)

    pytest.importorskip('h5netcdf')
    assert 'origin.time' in told('--to', 'og1')
    assert 'allowed: as 2026-03-01' in told('--to', 'og1', '--start', 'noon')
    for kind in ('csv', 'mat', 'slocum'):
        assert f'not of {kind}' in told('--to', kind, '--start', '2026-03-01')
    full = told('--to', 'og1', '--start', '2026-03-01', '--out', '/dev/full')
    assert full == '/dev/full: cannot be written: No space left on device'
    words = ['export', str(run.folder), '--to', 'og1', '--start', '2026-03-01T06:00']
    assert CliRunner().invoke(app, words, catch_exceptions=False).exit_code == 0
    with xarray.open_dataset(run.folder / 'run.og1.nc', engine='h5netcdf') as read:
        assert read['TIME'].values[0] == np.datetime64('2026-03-01T06:00')
        # by a compass, which is turned by what the file says of it
        assert read['MAGNETIC_VARIATION'] == 20.0
        true_deg = np.degrees(run.to_xarray().imu_heading.values[::10])
        turned = (read['HEADING'].values + 20.0 - true_deg + 180.0) % 360.0 - 180.0
        assert np.abs(turned).max() < 1e-9


def test_the_route_is_that_of_the_orders(tmp_path):
    path = {**CHANGES['path'], 'waypoints_latlon': [WAYPOINTS[0], (47.5, -52.45)]}
    order = {'at_s': 60.0, 'when': 'once', 'path': path}
    glider.fly('slocum_shelf', {**CHANGES, 'dives': 1, 'orders': [order]}, out=tmp_path / 'run')
    words = [
        'export',
        str(tmp_path / 'run'),
        '--to',
        'geojson',
        '--out',
        str(tmp_path / 'run.json'),
    ]
    assert CliRunner().invoke(app, words).exit_code == 0
    features = json.loads((tmp_path / 'run.json').read_text())['features']
    (route,) = [one for one in features if one['properties']['name'] == 'route']
    east, north, *_ = route['geometry']['coordinates'][-1]
    assert east > WAYPOINTS[0][1] + 0.002 and abs(north - WAYPOINTS[0][0]) < 0.0005


def test_the_route_is_that_of_the_mission_until_the_time_of_an_order_comes(flown):
    run = read_run(flown.folder)
    late = {'at_s': run.traces.ticks * TICK_S, 'path': {'kind': 'straight', 'length_m': 2000.0}}
    waypoints = tracks.chart_of(run, None).lines['route']
    orders = load_scenario('current_8deg', {'orders': [late]}).orders
    run = run._replace(scenario=run.scenario.model_copy(update={'orders': orders}))
    assert tracks.chart_of(run, None).lines['route'] == waypoints
