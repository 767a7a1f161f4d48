# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What missions are told of the files that they fly in, and what their plans make of them."""

import itertools
import math

import numpy as np
import pytest
import xarray

from glider_base.frames import to_geodetic
from glider_base.settings import ConfigurationError
from glider_mission.routing.forecast_chart import forecast_of
from glider_mission.routing.fronts import current_on
from glider_mission.routing.pilot import Pilot
from glider_mission.routing.plan import plan
from glider_mission.scenario import load_scenario
from glider_model.ocean.fields.grid import grid_velocity

LATITUDES, LONGITUDES = np.arange(35.0, 37.01, 0.125), np.arange(121.0, 123.01, 0.125)
DEPTHS, HOURS = np.array([0.0, 100.0, 200.0, 500.0, 1000.0]), np.arange(-120.0, 481.0, 24.0)
#: From waypoint to waypoint the path leads over an island at 122 E, 4.5 km wide.
OVER = [[36.0, 121.9], [36.0, 122.1]]
MISSION = {'vehicle': 'seaglider', 'dives': 0, 'current': {}}
MISSION |= {'duration_s': 86_400.0, 'origin.time': '2026-03-01', 'profile.depth_m': 150.0}
MISSION |= {'profile.net_heaviness_kg': 0.2}


def island(latitude, longitude):
    """Whether there is land."""
    return (abs(latitude - 36.0) < 0.08) & (abs(longitude - 122.0) < 0.08)


def sea(path, east=lambda t, z: 0.0, land=None, hours=HOURS, latitudes=LATITUDES):
    """File of currents in the layout of CMEMS, eastward by hour and depth."""
    t, z, y, x = np.meshgrid(hours, DEPTHS, latitudes, LONGITUDES, indexing='ij')
    velocity = np.zeros_like(t) + east(t, z)
    if land:
        velocity[land(y, x)] = np.nan
    dims = ('time', 'depth', 'latitude', 'longitude')
    told = {'units': 'm s-1'}
    data = xarray.Dataset(
        {
            'uo': (dims, velocity, {'standard_name': 'eastward_sea_water_velocity', **told}),
            'vo': (
                dims,
                0.0 * velocity,
                {'standard_name': 'northward_sea_water_velocity', **told},
            ),
        },
        {
            'time': ('time', hours, {'units': 'hours since 2026-03-01'}),
            'depth': ('depth', DEPTHS, {'units': 'm', 'positive': 'down'}),
            'latitude': ('latitude', latitudes, {'units': 'degrees_north'}),
            'longitude': ('longitude', LONGITUDES, {'units': 'degrees_east'}),
        },
    )
    data.to_netcdf(path, engine='scipy')
    return {'current': {'field': {'kind': 'grid', 'file': str(path)}}}


def bottom(path, east=0.025, name='elevation', depth_m=3000.0):
    """File of a bottom of a depth with an island of a width, in the layout of GEBCO or CMEMS."""
    latitudes, longitudes = np.arange(35.5, 36.51, 0.01), np.arange(121.5, 122.51, 0.01)
    y, x = np.meshgrid(latitudes, longitudes, indexing='ij')
    height = np.where((abs(y - 36.0) < 0.025) & (abs(x - 122.0) < east), 20.0, -depth_m)
    if name == 'deptho':
        height = np.where(height < 0.0, -height, np.nan)
    data = xarray.Dataset(
        {name: (('lat', 'lon'), height, {'units': 'm'})},
        {
            'lat': ('lat', latitudes, {'units': 'degrees_north'}),
            'lon': ('lon', longitudes, {'units': 'degrees_east'}),
        },
    )
    data.to_netcdf(path, engine='scipy')
    return {'bathymetry.file': str(path)}


def mission(*files, waypoints=OVER, **changes):
    """A mission through some files."""
    told = {**MISSION, 'path': {'kind': 'waypoints', 'waypoints_latlon': waypoints}}
    for one in files:
        told |= one
    return load_scenario('current_8deg', told | changes)


def order(**told):
    """One order, in a scenario."""
    return {'orders': [{'at_s': 1000.0, **told}]}


def through(*waypoints):
    """An order of another path."""
    return order(path={'kind': 'waypoints', 'waypoints_latlon': list(waypoints)})


AWAY = [[36.3, 121.9], [36.3, 122.1]]


@pytest.mark.parametrize(
    ('waypoints', 'changes', 'says'),
    [
        (OVER, {}, r'36.0\d+, 121.9\d+ on the path is land'),
        (AWAY, through([36.3, 122.0], [36.0, 122.0]), '36.0000, 122.0000 of orders.0 is land'),
        (
            AWAY,
            through([36.3, 122.0], [36.3, 126.0]),
            r'126.0000 of orders.0 is beyond what is re',
        ),
        (AWAY, {'initial.north_m': -33_300.0, 'initial.east_m': 0.0}, 'on the path is land'),
        (AWAY, {'initial.north_m': 4e5, 'initial.east_m': 0.0}, 'on the path is beyond what is'),
    ],
)
@pytest.mark.parametrize('kind', ['current', 'bottom'])
def test_a_mission_over_land_or_out_of_its_file_is_refused(
    kind, waypoints, changes, says, tmp_path
):
    """Between waypoints, by an order, and where the vehicle is put into the water."""
    file = sea(tmp_path / 'f.nc', land=island) if kind == 'current' else bottom(tmp_path / 'f.nc')
    with pytest.raises(ConfigurationError, match=rf'file .*f.nc: .*{says}'):
        mission(file, waypoints=waypoints, **changes)
    assert mission(file, waypoints=AWAY, **through([36.3, 122.0], [36.2, 122.2]))


def test_a_start_below_the_bottom_of_a_chart_is_refused(tmp_path):
    file = bottom(tmp_path / 'f.nc', depth_m=300.0)
    assert mission(file, waypoints=AWAY, **{'initial.depth_m': 299.0})
    with pytest.raises(ConfigurationError, match='301: below the bottom .allowed: <= 300 m'):
        mission(file, waypoints=AWAY, **{'initial.depth_m': 301.0})


@pytest.mark.parametrize('name', ['elevation', 'deptho'])
def test_land_of_one_point_of_a_chart_is_land(name, tmp_path):
    file = bottom(tmp_path / 'f.nc', east=0.005, name=name)
    with pytest.raises(ConfigurationError, match=r'36.0\d+, 12[12].\d+ on the path is land'):
        mission(file, waypoints=[[36.001, 121.9], [36.002, 122.1003]])


def test_a_coarse_coast_of_the_current_does_not_close_water_that_is_charted(tmp_path):
    files = sea(tmp_path / 'sea.nc', land=island), bottom(tmp_path / 'bottom.nc')
    past = [[36.05, 121.9], [36.05, 122.1]]
    with pytest.raises(ConfigurationError, match='sea.nc: .* on the path is land'):
        mission(files[0], waypoints=past)
    assert mission(*files, waypoints=past)


@pytest.mark.parametrize('kind', ['current', 'bottom'])
def test_a_planned_route_goes_round_land_that_straight_legs_do_not(kind, tmp_path):
    files = [sea(tmp_path / 'sea.nc', land=island if kind == 'current' else None)]
    if kind == 'bottom':
        files.append(bottom(tmp_path / 'bottom.nc'))
    planned = {'guidance.route': 'planned', 'duration_s': 4e5}
    made = plan(mission(*files, **planned))
    assert made.reachable and math.isinf(made.straight_s)
    assert np.hypot(*np.diff(made.route.corners, axis=0).T).sum() > 1.05 * 18_000.0
    flown = Pilot(mission(*files, **planned)).order(0, None).path
    np.testing.assert_allclose(np.array(flown.waypoints)[:, :2], made.route.corners, atol=1e-6)


SPIT = {'lat': slice(36.03, 36.25), 'lon': slice(121.99, 122.01)}


@pytest.mark.parametrize('land', [SPIT, {'lat': slice(36.11, 36.14), 'lon': slice(121.9, 122.1)}])
def test_a_planned_route_goes_round_land_between_the_points_of_its_chart(land, tmp_path):
    """A spit 2 km wide across the way, and an island along it that is as narrow."""
    file = bottom(tmp_path / 'bottom.nc', east=-1.0)
    data = xarray.load_dataset(file['bathymetry.file'])
    data.elevation.loc[land] = 20.0
    data.to_netcdf(file['bathymetry.file'], engine='scipy')
    ways = {'waypoints': [[36.125, 121.75], [36.128, 122.25]], 'guidance.route': 'planned'}
    flown = mission(sea(tmp_path / 'sea.nc'), file, **ways, duration_s=1e6)
    corners = np.array(Pilot(flown).order(0, None).path.waypoints)
    origin = flown.origin.params()
    for one, after in itertools.pairwise(corners[:, :2]):
        at = [to_geodetic(*(one + s * (after - one)), origin) for s in np.linspace(0, 1, 2000)]
        lat, lon = (xarray.DataArray(axis, dims='place') for axis in np.array(at).T)
        assert (data.elevation.interp(lat=lat, lon=lon) < 0.0).all()


@pytest.mark.parametrize('strait', [0.0, 0.015])
def test_a_plan_says_of_a_wall_of_land_and_of_a_strait_in_it_what_is_flown(strait, tmp_path):
    """A strait is narrower than the step of the chart: straight legs alone lead through it."""
    file = bottom(tmp_path / 'bottom.nc', east=-1.0)
    data = xarray.load_dataset(file['bathymetry.file'])
    wall = (abs(data.lon - 122.0) < 0.015) & (abs(data.lat - 36.004) > strait)
    data['elevation'] = data.elevation.where(~wall, 20.0)
    data.to_netcdf(file['bathymetry.file'], engine='scipy')
    way = {'waypoints': [[36.004, 121.9], [36.004, 122.1]], 'duration_s': 4e5}
    walled = mission(sea(tmp_path / 'sea.nc'), file, **way, **{'guidance.route': 'planned'})
    made = plan(walled)
    leads_through = strait > 0.0
    assert made.reachable == np.isfinite(made.arrivals_s).all() == leads_through
    if leads_through:
        assert made.arrivals_s[0] == made.straight_s == made.waypoints_s[-1]
        assert Pilot(walled).order(0, None) is None
    else:
        with pytest.raises(ConfigurationError, match=r'guidance.route: no way round the land'):
            Pilot(walled).order(0, None)


def test_an_order_of_a_path_is_not_led_back_by_a_route_that_is_planned_anew(tmp_path):
    still, anew = sea(tmp_path / 'sea.nc'), {'guidance.route': 'planned'}
    moved = through([36.3, 122.0], [36.2, 122.2])
    assert mission(still, waypoints=AWAY, **anew, **moved)
    anew['guidance.replan'] = 'surfacing'
    assert mission(still, waypoints=AWAY, **anew, **order(depth_m=900.0))
    with pytest.raises(ConfigurationError, match='orders.0.path: not with a route that is plan'):
        mission(still, waypoints=AWAY, **anew, **moved)


def test_an_order_to_dive_deeper_meets_the_water_of_there(tmp_path):
    flown = mission(sea(tmp_path / 'sea.nc', lambda t, z: 0.3 - 6e-4 * z), **order(depth_m=900.0))
    params = flown.current_settings().params().field
    assert grid_velocity((0.0, 0.0, 800.0), 0.0, params)[1] == pytest.approx(-0.18, abs=1e-6)


def test_a_late_forecast_is_as_late_as_it_is_told(tmp_path):
    flown = mission(sea(tmp_path / 'sea.nc', lambda t, z: 1e-3 * t), **{'forecast.late_h': 60.0})
    chart = forecast_of(flown, 0.0).chart
    found = [current_on(chart, 3600.0 * h, 0.0, 0.0)[1] for h in (0.0, 12.0, 24.0)]
    assert found == pytest.approx([-0.060, -0.048, -0.036], abs=1e-6)


def test_a_plan_counts_the_wind_at_the_surface(tmp_path):
    told = {'duration_s': 4e5, 'profile.surface_every_dives': 1, 'water.wind_from_deg': 90.0}
    told |= sea(tmp_path / 'sea.nc')
    calm, against = (plan(mission(told, **{'water.wind_mps': wind})) for wind in (0.0, 10.0))
    slower = 1.0 - 0.02 * 10.0 * calm.pace.stay / calm.pace.speed
    assert against.straight_s == pytest.approx(calm.straight_s / slower, rel=1e-3)
    assert slower < 0.99


def test_files_that_begin_at_other_times_need_the_time_of_the_mission(tmp_path):
    first = sea(tmp_path / 'first.nc')
    other = sea(tmp_path / 'other.nc', hours=HOURS + 6.0)
    both = {**first, 'navigation.forecast': other['current'], 'navigation.method': 'dead_reckoned'}
    assert mission(both)
    with pytest.raises(ConfigurationError, match=r'origin.time: missing, .* 2026-02-24T06:00Z'):
        mission(both, **{'origin.time': ''})
    planned = {'forecast.file': str(tmp_path / 'other.nc'), 'origin.time': ''}
    with pytest.raises(ConfigurationError, match=r'origin.time: missing, .* forecast.file at'):
        plan(mission(first, **planned))


def test_a_plan_ends_with_the_dives_of_its_mission(tmp_path):
    still = sea(tmp_path / 'sea.nc')
    long = {'duration_s': 4e5, 'profile.surface_every_dives': 2}
    enough, few = (plan(mission(still, dives=dives, **long)) for dives in (600, 4))
    assert enough.reachable and enough.end_s == 4e5
    wait_s = mission(still, **long).profile.wait_s  # at the surface, which ends the last of them
    assert not few.reachable and few.end_s == 2.0 * few.pace.cycle_s - wait_s > wait_s


@pytest.mark.parametrize(
    ('north_m', 'east_m', 'way_m'),
    [(0.0, -20e3, 29e3), (4e3, 1e3, 12e3), (500.0, 4e3, 5025.0), (3e3, 16e3, 7616.0)],
)
def test_a_plan_joins_the_path_where_a_vehicle_does(north_m, east_m, way_m, tmp_path):
    """By the shortest way, and not back to its first waypoint."""
    path = {'kind': 'waypoints', 'waypoints': [[0.0, -9e3], [0.0, 9e3]]}
    told = {'path': path, 'initial.north_m': north_m, 'initial.east_m': east_m}
    made = plan(mission(sea(tmp_path / 'sea.nc'), **told, duration_s=4e5))
    assert made.straight_s * made.pace.speed == pytest.approx(way_m, rel=1e-3)


@pytest.mark.parametrize('latitudes', [[36.0], [35.99, 36.01]])
def test_a_plan_along_a_section_is_that_of_the_same_water_all_round(latitudes, tmp_path):
    files = sea(tmp_path / 'sea.nc', lambda t, z: 0.1, latitudes=np.array(latitudes))
    wide = sea(tmp_path / 'wide.nc', lambda t, z: 0.1)
    narrow, there = (plan(mission(one, duration_s=4e5)) for one in (files, wide))
    assert narrow.reachable
    assert narrow.straight_s == pytest.approx(there.straight_s, rel=1e-6)
    erring = plan(mission(files, **{'duration_s': 4e5, 'forecast.error_mps': 0.02}))
    assert np.isfinite(erring.arrivals_s).all() and np.ptp(erring.arrivals_s) > 100.0


def test_a_mission_that_was_flown_is_not_flown_again_in_another_sea(tmp_path):
    file = tmp_path / 'flown.yaml'
    file.write_text(mission(sea(tmp_path / 'sea.nc')).to_yaml())
    flown = load_scenario(str(file), recorded=True)
    assert flown.current_settings().params()
    sea(tmp_path / 'sea.nc', lambda t, z: 0.2)
    with pytest.raises(ConfigurationError, match='sea.nc: not the one that was flown'):
        flown.current_settings().params()
    (tmp_path / 'sea.nc').unlink()
    with pytest.raises(ConfigurationError, match='sea.nc: No such file'):
        flown.current_settings().params()
