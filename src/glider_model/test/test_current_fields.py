# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Currents by place: the eddy and the jet, each against what makes it one."""

import math

import numpy as np
import pydantic
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad

from glider_model.ocean.current import current_initial, current_step
from glider_model.ocean.current_settings import FIELDS, CurrentSettings

quick = settings(max_examples=50)
#: An eddy that turns counterclockwise, weaker with depth, carried to the east.
EDDY = {
    **{'kind': 'eddy', 'north_m': 1000.0, 'east_m': -2000.0, 'radius_m': 3000.0},
    **{'peak_mps': -0.4, 'depth_m': 300.0, 'drift_east_mps': 0.05},
}
JET = {'kind': 'jet', 'east_m': 4000.0, 'direction_deg': 30.0, 'width_m': 2000.0, 'peak_mps': 0.5}
places = st.tuples(st.floats(-2e4, 2e4), st.floats(-2e4, 2e4), st.floats(0.0, 1000.0))


def velocity(field: dict, place=(0.0, 0.0, 0.0), t_s=0.0, **current) -> np.ndarray:
    """Velocity of the water (m/s, NED)."""
    params = CurrentSettings(field=field, **current).params()
    state = current_initial(params)
    return np.array(current_step(state, tuple(map(float, place)), t_s, params, 0.1)[1])


def gradient(field: dict, place) -> np.ndarray:
    """Derivatives of the velocity by place (1/s), float64[axis, component], over 2 m."""
    steps = np.eye(3)
    place = np.array(place) + [0.0, 0.0, 2.0]  # so that no step leaves the water
    return np.array([(velocity(field, place + h) - velocity(field, place - h)) / 2 for h in steps])


@quick
@given(places)
def test_no_water_is_made_or_lost(place):
    for field in (EDDY, JET):
        assert abs(np.trace(gradient(field, place))) < 1e-9


def test_the_eddy_is_fastest_at_its_radius_and_turns_as_it_should():
    """Seen from above, north up, + is clockwise: north of the centre the water goes east."""
    distances = np.linspace(1.0, 12000.0, 2400)
    east = [velocity(EDDY, (1000.0 + r, -2000.0, 0.0))[1] for r in distances]
    peak = np.argmin(east)
    assert distances[peak] == pytest.approx(3000.0, abs=5.0)
    assert east[peak] == pytest.approx(-0.4, abs=1e-6)
    np.testing.assert_array_equal(velocity(EDDY, (1000.0, -2000.0, 0.0)), np.zeros(3))


@pytest.mark.parametrize('radius', [500.0, 3000.0, 9000.0])
def test_circulation_of_the_eddy_is_that_of_its_vorticity(radius):
    """Stokes: flow round a circle is the vorticity in it, of a Gauss bell (Lamb, Oseen)."""
    a, peak, size = 1.2564312086261697, -0.4, 3000.0
    vorticity = 2.0 * a * peak * (1.0 + 0.5 / a) / size
    within, _ = quad(
        lambda r: 2.0 * math.pi * r * vorticity * math.exp(-a * r * r / size**2), 0.0, radius
    )
    east = velocity(EDDY, (1000.0 + radius, -2000.0, 0.0))[1]
    assert 2.0 * math.pi * radius * east == pytest.approx(within, rel=1e-9)


def test_the_eddy_moves_and_fades_with_depth():
    there = velocity(EDDY, (2500.0, -2300.0, 0.0))
    moved = velocity(EDDY, (2500.0, -2300.0 + 0.05 * 7200.0, 0.0), t_s=7200.0)
    np.testing.assert_allclose(moved, there, rtol=1e-12)
    deep = velocity(EDDY, (2500.0, -2300.0, 300.0))
    np.testing.assert_allclose(deep, there / math.e, rtol=1e-12)
    np.testing.assert_array_equal(velocity(EDDY, (2500.0, -2300.0, -0.5)), there)


def test_the_jet_flows_along_itself_and_is_fastest_in_its_middle():
    along = np.array([math.cos(math.radians(30.0)), math.sin(math.radians(30.0)), 0.0])
    starboard = np.array([-along[1], along[0], 0.0])
    middle = np.array([0.0, 4000.0, 0.0]) + 700.0 * along
    np.testing.assert_allclose(velocity(JET, middle), 0.5 * along, rtol=1e-12)
    for side in (-2000.0, 2000.0):
        flow = velocity(JET, middle + side * starboard)
        np.testing.assert_allclose(flow, 0.5 / math.cosh(1.0) ** 2 * along, rtol=1e-9)


def test_a_field_is_added_to_the_other_currents():
    place, constant = (4000.0, 500.0, 20.0), {'speed_mps': 0.25, 'direction_deg': 90.0}
    total = velocity(EDDY, place, components=[{'kind': 'constant', **constant}])
    alone = velocity(EDDY, place)
    np.testing.assert_allclose(total, alone + [0.0, 0.25, 0.0], atol=1e-15)


def test_a_field_that_is_not_there_is_refused_with_those_that_are():
    with pytest.raises(pydantic.ValidationError, match="'eddy', 'grid', 'jet'"):
        CurrentSettings(field={'kind': 'whirl'})
    assert set(FIELDS) >= {'eddy', 'grid', 'jet'}
