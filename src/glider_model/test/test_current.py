# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Water currents: each field against an independent reference, and the messages of wrong input."""

import math

import numpy as np
import pydantic
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from glider_base.kernel import kernel
from glider_model.ocean.current import current_initial, current_step
from glider_model.ocean.current_settings import (
    KNOT_MPS,
    M2_PERIOD_S,
    MAX_SPEED_MPS,
    CurrentSettings,
)

DT = 0.1
quick = settings(max_examples=50)
speeds = st.floats(0.0, MAX_SPEED_MPS)
directions = st.floats(-360.0, 360.0)
depths = st.floats(-10.0, 2000.0)
times = st.floats(0.0, 200_000.0)


def field(*components, **values) -> CurrentSettings:
    return CurrentSettings(components=list(components), **values)


def water(current: CurrentSettings, depth_m=0.0, t_s=0.0, seed=0) -> np.ndarray:
    """Velocity of the first step (m/s, NED)."""
    params = current.params(seed)
    state = current_initial(params)
    return np.array(current_step(state, (0.0, 0.0, float(depth_m)), float(t_s), params, DT)[1])


@kernel
def history(count, params, dt):
    """North and east velocity of ``count`` steps (m/s)."""
    state = current_initial(params)
    out = np.empty((count, 2))
    for i in range(count):
        state, now = current_step(state, (0.0, 0.0, 0.0), i * dt, params, dt)
        out[i, 0] = now.v_n
        out[i, 1] = now.v_e
    return out


def flow(speed, direction_deg):
    angle = math.radians(direction_deg)
    return np.array([speed * math.cos(angle), speed * math.sin(angle), 0.0])


# ------------------------------------------------------------------------------ speed, direction


def test_no_current_is_still_water():
    np.testing.assert_array_equal(water(CurrentSettings()), np.zeros(3))


@quick
@given(speeds, directions, depths, times)
def test_constant_is_the_same_everywhere_and_always(speed, direction, depth, t_s):
    current = CurrentSettings(speed_mps=speed, direction_deg=direction)
    np.testing.assert_allclose(water(current, depth, t_s), flow(speed, direction), atol=1e-12)


@pytest.mark.parametrize(
    ('direction_deg', 'north_east'), [(0, (1, 0)), (90, (0, 1)), (180, (-1, 0)), (-90, (0, -1))]
)
def test_direction_is_where_the_water_flows_to(direction_deg, north_east):
    current = CurrentSettings(speed_mps=1.0, direction_deg=direction_deg)
    np.testing.assert_allclose(water(current), [*north_east, 0.0], atol=1e-15)


def test_a_knot_is_one_nautical_mile_an_hour():
    current = CurrentSettings(speed_kn=1.0, direction_deg=0.0)
    assert water(current)[0] * 3600.0 == pytest.approx(1852.0, abs=1e-9)


@quick
@given(st.floats(-math.pi, math.pi), directions)
def test_angle_is_relative_to_the_first_leg_and_positive_to_starboard(course, angle):
    current = CurrentSettings(speed_mps=0.5, angle_deg=angle).resolved(course)
    expected = flow(0.5, math.degrees(course) + angle)
    np.testing.assert_allclose(water(current), expected, atol=1e-12)


def test_resolved_leaves_metres_per_second_and_absolute_directions_only():
    current = field(
        {'kind': 'constant', 'speed_kn': 1.0, 'angle_deg': 10.0},
        {'kind': 'shear', 'speed_kn': 1.0, 'angle_deg': 10.0, 'depth_m': 100.0},
        {'kind': 'tidal', 'speed_kn': 1.0, 'angle_deg': 10.0},
        {'kind': 'steps', 'steps': [{'at_s': 0.0, 'speed_kn': 1.0, 'angle_deg': 10.0}]},
        {'kind': 'gauss_markov', 'std_mps': 0.1, 'time_constant_s': 100.0},
        {'kind': 'table', 'rows': [[0.0, 0.1, 0.2]]},
        speed_kn=1.0,
        angle_deg=8.0,
        seed=5,
    ).resolved(math.radians(20.0))
    assert current.direction_deg == pytest.approx(28.0, abs=1e-9)
    assert current.seed == 5
    one_step = current.components[3].steps[0]
    for part in (current, *current.components[:3], one_step):
        assert part.speed_kn is None
        assert part.angle_deg is None
        assert part.speed_mps == KNOT_MPS
    for part in (*current.components[:3], one_step):
        assert part.direction_deg == pytest.approx(30.0, abs=1e-9)


def test_resolved_survives_json_to_the_last_bit():
    current = field(
        {'kind': 'tidal', 'speed_kn': 0.7, 'angle_deg': 10.1, 'ellipticity': 0.3},
        {'kind': 'gauss_markov', 'std_mps': 0.1, 'time_constant_s': 100.0},
        speed_kn=1.0,
        angle_deg=8.0,
    ).resolved(0.3)
    again = CurrentSettings.model_validate_json(current.model_dump_json())
    for one, other in zip(current.params(3), again.params(3), strict=True):
        np.testing.assert_array_equal(one, other)
    assert current.resolved(1.0) == current


def test_an_unresolved_angle_has_no_params():
    with pytest.raises(ValueError, match=r'angle_deg = 8.0 is relative to the path: call'):
        CurrentSettings(speed_kn=1.0, angle_deg=8.0).params()


# ------------------------------------------------------------------------------ fields of depth


@quick
@given(speeds, directions, depths, st.floats(0.1, 10.0))
def test_power_shear(speed, direction, depth, exponent):
    shear = {'speed_mps': speed, 'direction_deg': direction, 'depth_m': 500.0}
    current = field({'kind': 'shear', 'law': 'power', 'exponent': exponent, **shear})
    share = (1.0 - min(max(depth, 0.0), 500.0) / 500.0) ** exponent
    np.testing.assert_allclose(water(current, depth), share * flow(speed, direction), atol=1e-12)


@quick
@given(speeds, directions, depths)
def test_exponential_shear(speed, direction, depth):
    shear = {'speed_mps': speed, 'direction_deg': direction, 'depth_m': 200.0}
    current = field({'kind': 'shear', 'law': 'exponential', **shear})
    share = math.exp(-max(depth, 0.0) / 200.0)
    np.testing.assert_allclose(water(current, depth), share * flow(speed, direction), atol=1e-12)


@st.composite
def profiles(draw):
    count = draw(st.integers(1, 8))
    gaps = draw(st.lists(st.floats(0.5, 300.0), min_size=count, max_size=count))
    part = st.floats(-1.7, 1.7)
    parts = draw(st.lists(st.tuples(part, part, part), min_size=count, max_size=count))
    return np.column_stack((np.cumsum(gaps), parts))


@quick
@given(profiles(), st.floats(-0.5, 0.5))
def test_table_interpolates_and_holds_its_ends(rows, offset):
    current = field({'kind': 'table', 'rows': rows.tolist()})
    middles = 0.5 * (rows[1:, 0] + rows[:-1, 0])
    for depth in [-5.0, *(rows[:, 0] + offset), *middles, 5000.0]:
        expected = [np.interp(max(depth, 0.0), rows[:, 0], rows[:, j]) for j in (1, 2, 3)]
        np.testing.assert_allclose(water(current, depth), expected, atol=1e-12)


def test_a_table_file_gives_the_same_as_its_rows(tmp_path):
    (tmp_path / 'profile.csv').write_text(
        'east_mps, depth_m, north_mps\n0.1, 0, 0.5\n\n0.0, 100, 0.2\n-0.1, 400, 0.0\n'
    )
    rows = [[0.0, 0.5, 0.1], [100.0, 0.2, 0.0], [400.0, 0.0, -0.1]]
    from_file = CurrentSettings.model_validate(
        {'components': [{'kind': 'table', 'file': 'profile.csv'}]}, context={'folder': tmp_path}
    )
    assert from_file == field({'kind': 'table', 'rows': rows})


def test_two_tables_and_steps_do_not_mix_their_rows():
    one = {'kind': 'table', 'rows': [[0.0, 0.1, 0.0], [100.0, 0.2, 0.0]]}
    steps = {'kind': 'steps', 'steps': [{'at_s': 0.0, 'north_mps': 0.0, 'east_mps': 0.4}]}
    other = {'kind': 'table', 'rows': [[50.0, 1.0, 0.0, 0.05], [100.0, 2.0, 0.0, 0.07]]}
    np.testing.assert_allclose(water(field(one, steps, other), 75.0), [1.675, 0.4, 0.06])


# ------------------------------------------------------------------------------ fields of time


@quick
@given(speeds, directions, st.floats(-1.0, 1.0), st.floats(-360.0, 360.0))
def test_tide_has_zero_mean_over_a_period(speed, direction, ellipticity, phase):
    tide = {'speed_mps': speed, 'direction_deg': direction, 'ellipticity': ellipticity}
    current = field({'kind': 'tidal', 'phase_deg': phase, **tide})
    series = [water(current, t_s=t) for t in np.linspace(0.0, M2_PERIOD_S, 48, endpoint=False)]
    np.testing.assert_allclose(np.mean(series, axis=0), np.zeros(3), atol=1e-12)


@quick
@given(times)
def test_tide_runs_on_its_ellipse_clockwise(t_s):
    tide = {'speed_mps': 0.8, 'direction_deg': 0.0, 'ellipticity': 0.25, 'period_s': 40_000.0}
    angle = 2.0 * math.pi * t_s / 40_000.0
    expected = [0.8 * math.cos(angle), 0.2 * math.sin(angle), 0.0]
    np.testing.assert_allclose(
        water(field({'kind': 'tidal', **tide}), t_s=t_s), expected, atol=1e-9
    )


def test_the_default_tide_is_m2():
    tide = field({'kind': 'tidal', 'speed_mps': 1.0, 'direction_deg': 0.0})
    assert water(tide, t_s=12.4206 * 1800.0)[0] == pytest.approx(-1.0, abs=1e-12)


@pytest.mark.parametrize(
    ('t_s', 'expected'),
    [
        (0.0, (0.0, 0.0)),
        (99.9, (0.0, 0.0)),
        (100.0, (0.3, -0.1)),
        (199.9, (0.3, -0.1)),
        (200.0, (0.0, 0.5)),
        (1e6, (0.0, 0.5)),
    ],
)
def test_steps_hold_from_their_time_on(t_s, expected):
    steps = [
        {'at_s': 100.0, 'north_mps': 0.3, 'east_mps': -0.1},
        {'at_s': 200.0, 'speed_mps': 0.5, 'direction_deg': 90.0},
    ]
    current = field({'kind': 'steps', 'steps': steps})
    np.testing.assert_allclose(water(current, t_s=t_s), [*expected, 0.0], atol=1e-15)


@given(st.integers(1, 10_000))
@quick
def test_a_step_is_taken_at_its_tick_however_the_time_is_summed(tick):
    step = {'at_s': tick / 10.0, 'north_mps': 0.3, 'east_mps': 0.0}
    params = field({'kind': 'steps', 'steps': [step]}).params()
    state = current_initial(params)
    for t_s, north in (
        (tick * 0.1, 0.3),
        (np.cumsum(np.full(tick, DT))[-1], 0.3),
        ((tick - 1) * 0.1, 0.0),
    ):
        assert current_step(state, (0.0, 0.0, 0.0), t_s, params, DT)[1].v_n == north


# ------------------------------------------------------------------------------ random


def gauss_markov(std=0.1, time_constant=50.0, offset=0):
    return {
        'kind': 'gauss_markov',
        'std_mps': std,
        'time_constant_s': time_constant,
        'seed_offset': offset,
    }


@pytest.mark.parametrize('dt', [0.1, 5.0])
def test_gauss_markov_statistics(dt):
    std, tau, count = 0.2, 2.0, 400_000
    series = history(count, field(gauss_markov(std, tau)).params(seed=1), dt)
    # the number of independent samples is about count dt / (2 tau), at most count
    independent = count * min(dt / (2.0 * tau), 1.0)
    assert np.all(np.abs(series.mean(axis=0)) < 4.0 * std / math.sqrt(independent))
    np.testing.assert_allclose(series.std(axis=0), std, rtol=4.0 / math.sqrt(independent))
    for lag in (1, 10):
        for column in series.T:
            correlation = np.corrcoef(column[:-lag], column[lag:])[0, 1]
            expected = math.exp(-lag * dt / tau)
            assert correlation == pytest.approx(expected, abs=4.0 / math.sqrt(independent))
    assert abs(np.corrcoef(series.T)[0, 1]) < 4.0 / math.sqrt(independent)


def test_gauss_markov_starts_in_its_stationary_distribution():
    current = field(gauss_markov(std=0.2, time_constant=1e6))
    starts = np.concatenate([current.initial_state(seed).values for seed in range(3000)])
    assert starts.std() == pytest.approx(0.2, rel=0.05)
    assert starts.mean() == pytest.approx(0.0, abs=4.0 * 0.2 / math.sqrt(len(starts)))


def test_gauss_markov_noise_is_normal():
    stats = pytest.importorskip('scipy.stats')
    series = history(20_000, field(gauss_markov(0.1, 1.0)).params(seed=2), 50.0)
    for column in series.T:
        assert stats.kstest(column / 0.1, 'norm').pvalue > 1e-3


@quick
@given(st.integers(0, 2**63 - 1))
def test_one_seed_gives_the_same_bits_and_another_seed_others(seed):
    current = field(gauss_markov(), gauss_markov(std=0.3))
    one = history(20, current.params(seed), DT)
    np.testing.assert_array_equal(one, history(20, current.params(seed), DT))
    np.testing.assert_array_equal(
        one, history(20, current.model_copy(update={'seed': seed}).params(), DT)
    )
    other = history(20, current.params(seed ^ 1), DT)
    assert not np.any(one == other)


def test_components_have_their_own_random_numbers():
    count = 20_000
    params = [
        field(gauss_markov(0.1, 1.0)).params(seed=0),
        field(gauss_markov(0.1, 1.0)).params(seed=1),
        field(gauss_markov(0.1, 1.0, offset=1)).params(seed=0),
        field(gauss_markov(0.0, 1.0), gauss_markov(0.1, 1.0)).params(seed=0),
    ]
    series = np.array([history(count, one, 10.0)[:, 0] for one in params])
    correlations = np.corrcoef(series) - np.eye(len(series))
    assert np.max(np.abs(correlations)) < 4.5 / math.sqrt(count)


def test_without_random_parts_the_values_array_is_passed_on():
    current = CurrentSettings(speed_mps=1.0, direction_deg=0.0)
    params, state = current.params(), current.initial_state()
    after, _ = current_step(state, (0.0, 0.0, 0.0), 0.0, params, DT)
    assert after.tick == 1
    assert len(after.values) == 0


def test_a_step_does_not_change_its_inputs():
    current = field(gauss_markov())
    params, state = current.params(), current.initial_state()
    before = state.values.copy()
    after, _ = current_step(state, (0.0, 0.0, 0.0), 0.0, params, DT)
    np.testing.assert_array_equal(state.values, before)
    assert not np.any(after.values == before)


# ------------------------------------------------------------------------------ sums

MIXED = [
    {'kind': 'constant', 'speed_mps': 0.3, 'direction_deg': 100.0},
    {'kind': 'shear', 'speed_mps': 0.4, 'direction_deg': 20.0, 'depth_m': 300.0, 'exponent': 2.0},
    {'kind': 'table', 'rows': [[0.0, 0.1, 0.2], [500.0, -0.1, 0.0]]},
    {'kind': 'tidal', 'speed_mps': 0.2, 'direction_deg': 45.0, 'ellipticity': -0.5},
    {'kind': 'steps', 'steps': [{'at_s': 50.0, 'north_mps': 0.1, 'east_mps': 0.2}]},
    gauss_markov(),
]


@quick
@given(depths, times, st.permutations(MIXED))
def test_components_add_up(depth, t_s, components):
    together = water(field(*components, speed_mps=0.5, direction_deg=8.0), depth, t_s)
    parts = [water(field(one), depth, t_s) for one in components]
    alone = water(CurrentSettings(speed_mps=0.5, direction_deg=8.0), depth, t_s)
    np.testing.assert_allclose(together, sum(parts, alone), atol=1e-12)


# ------------------------------------------------------------------------------ wrong input


@pytest.mark.parametrize(
    ('values', 'message'),
    [
        (
            {'speed_kn': 1.0, 'speed_mps': 0.5, 'angle_deg': 8.0},
            'exactly one of speed_kn and speed_mps, found speed_kn = 1.0 and speed_mps = 0.5',
        ),
        ({'speed_kn': 1.0}, 'exactly one of angle_deg and direction_deg, found neither'),
        ({'angle_deg': 8.0}, 'exactly one of speed_kn and speed_mps, found neither'),
        (
            {'speed_kn': 1.0, 'angle_deg': 8.0, 'direction_deg': 8.0},
            'found angle_deg = 8.0 and direction_deg = 8.0',
        ),
        ({'speed_mps': 3.1, 'angle_deg': 8.0}, 'less than or equal to 3'),
        ({'speed_mps': -0.1, 'angle_deg': 8.0}, 'greater than or equal to 0'),
        ({'speed_kn': math.nan, 'angle_deg': 8.0}, 'finite number'),
        ({'speed_knots': 1.0}, 'speed_knots'),
    ],
)
def test_a_wrong_constant_says_what_is_allowed(values, message):
    with pytest.raises(pydantic.ValidationError, match=message):
        CurrentSettings.model_validate(values)


@pytest.mark.parametrize(
    ('component', 'message'),
    [
        ({'kind': 'whirl'}, "'constant', 'shear', 'table', 'tidal', 'gauss_markov', 'steps'"),
        ({'kind': 'constant', 'speed_kn': 1.0}, 'angle_deg and direction_deg, found neither'),
        (
            {'kind': 'shear', 'speed_kn': 1.0, 'angle_deg': 0.0, 'depth_m': 0.0},
            'greater than or equal to 1',
        ),
        ({'kind': 'table'}, 'exactly one of file and rows, found neither'),
        ({'kind': 'table', 'file': 'a', 'rows': []}, 'one of file and rows, found both'),
        ({'kind': 'table', 'rows': []}, 'rows: no rows'),
        ({'kind': 'table', 'rows': [[0.0, 0.1]]}, 'row 1: 2 columns .allowed: depth_m, north_mps'),
        (
            {'kind': 'table', 'rows': [[0.0, 0.1, 0.0], [0.0, 0.2, 0.0]]},
            'row 2, column depth_m = 0.0: depths must increase .allowed: > 0.0',
        ),
        ({'kind': 'table', 'rows': [[0.0, 2.5, 2.5]]}, 'row 1: the speed is 3.536 m/s .allowed'),
        ({'kind': 'table', 'rows': [[0.0, math.nan, 0.0]]}, r'rows.0.1\n.*finite'),
        (
            {'kind': 'tidal', 'speed_kn': 1.0, 'angle_deg': 0.0, 'ellipticity': 1.5},
            'less than or equal to 1',
        ),
        ({'kind': 'gauss_markov', 'std_mps': 0.1, 'time_constant_s': 0.0}, 'time_constant_s'),
        ({'kind': 'steps', 'steps': []}, 'at least 1 item'),
        ({'kind': 'steps', 'steps': [{'at_s': 0.0}]}, 'give north_mps and east_mps, or a speed'),
        ({'kind': 'steps', 'steps': [{'at_s': 0.0, 'north_mps': 1.0}]}, 'found only north_mps'),
        (
            {'kind': 'steps', 'steps': [{'at_s': 0.0, 'north_mps': 2.5, 'east_mps': 2.5}]},
            'north_mps and east_mps: the speed is 3.536 m/s',
        ),
        (
            {
                'kind': 'steps',
                'steps': [
                    {'at_s': 5.0, 'north_mps': 1.0, 'east_mps': 0.0},
                    {'at_s': 5.0, 'north_mps': 2.0, 'east_mps': 0.0},
                ],
            },
            'steps.1.at_s = 5.0: times must increase .allowed: > 5.0',
        ),
    ],
)
def test_a_wrong_component_says_what_is_allowed(component, message):
    with pytest.raises(pydantic.ValidationError, match=message):
        field(component)


@pytest.mark.parametrize(
    ('text', 'message'),
    [
        (None, 'profile.csv: No such file'),
        ('', 'profile.csv: row 1: column depth_m is missing .allowed: depth_m'),
        ('depth_m,north_mps\n0,1\n', 'profile.csv: row 1: column east_mps is missing'),
        ('depth_m,north_mps,east_mps\n', 'profile.csv: no rows'),
        (
            'depth_m,north_mps,east_mps,up_mps\n0,0,0,0\n',
            "profile.csv: row 1: column 'up_mps' is unknown .allowed: depth_m",
        ),
        (
            'depth_m,north_mps,east_mps,east_mps\n0,0,0,0\n',
            "profile.csv: row 1: column 'east_mps' is repeated",
        ),
        (
            'depth_m,north_mps,east_mps\n0,0.1,0\n10,nan,0\n',
            "profile.csv: row 3, column north_mps = 'nan': not a finite number",
        ),
        (
            'depth_m,north_mps,east_mps\n0,0.1,fast\n',
            "profile.csv: row 2, column east_mps = 'fast': not a finite number",
        ),
        (
            'depth_m,north_mps,east_mps\n0,0.1\n',
            'profile.csv: row 2: 2 cells for 3 columns',
        ),
        (
            'depth_m,north_mps,east_mps\n0,0,0\n\n20,0,0\n10,0,0\n',
            'profile.csv: row 5, column depth_m = 10.0: depths must increase .allowed: > 20.0, '
            'the depth of row 4',
        ),
        (
            'depth_m,north_mps,east_mps\n-5,0,0\n',
            'profile.csv: row 2, column depth_m = -5.0 .allowed: >= 0.0 and <= 12000.0',
        ),
    ],
)
def test_a_wrong_file_is_named_with_column_and_row(tmp_path, text, message):
    path = tmp_path / 'profile.csv'
    if text is not None:
        path.write_text(text)
    with pytest.raises(pydantic.ValidationError, match=message):
        field({'kind': 'table', 'file': str(path)})


def test_a_file_that_is_no_text_is_named(tmp_path):
    path = tmp_path / 'profile.csv'
    path.write_bytes(b'\xff\xfe\x00\x80')
    with pytest.raises(pydantic.ValidationError, match=r'profile.csv:1: not UTF-8 text'):
        field({'kind': 'table', 'file': str(path)})


def test_every_field_says_what_it_is():
    schema = CurrentSettings.model_json_schema()
    for model in (schema, *schema['$defs'].values()):
        for name, entry in model['properties'].items():
            assert name == 'kind' or entry['description'].endswith('.'), name
