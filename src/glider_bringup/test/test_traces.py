# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What is kept of a run: every peak, however the log comes in blocks, in bounded memory."""

import math
import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from glider_base.frames import NO_ATTITUDE
from glider_base.settings import ConfigurationError
from glider_base.signals import TICK_S
from glider_bringup.engines.direct import fly_blocks
from glider_bringup.engines.flight import mission_of
from glider_bringup.scoring import traces
from glider_bringup.scoring.score import Scorer
from glider_bringup.scoring.traces import CURVES, Tracer, load_traces, make_tracer
from glider_mission.blocks import COLUMNS, ROW
from glider_mission.rules import Rules
from glider_mission.scenario import load_scenario
from glider_model.vehicle.file import load_vehicle

quick = settings(max_examples=40)
VEHICLE = load_vehicle('zhang2021').params()
E2 = COLUMNS['tracking_error'].start + 1
TRUTH = COLUMNS['ground_truth/odom']


def make_log(ticks, **columns):
    """Level log of so many ticks; columns by index, such as ``c33=...``, set what differs."""
    log = np.zeros((ticks, ROW))
    for name in ('ground_truth/odom', 'odom', 'reference'):
        log[:, COLUMNS[name].start + 3] = 1.0
    for name, values in columns.items():
        log[:, int(name[1:])] = values
    return log


def trace(log, *cuts, vehicle=VEHICLE):
    """Traces of a log that comes in blocks, cut at these rows; what is believed is true."""
    log[:, TRUTH] = log[:, COLUMNS['odom'].start + np.arange(13)]
    tracer = Tracer(vehicle)
    for block in np.split(log, sorted(cuts)):
        tracer.add(block)
    return tracer.result()


def enu_yaw(heading_deg):
    """Quaternion columns (w, z) of a level attitude with this heading."""
    half = 0.5 * (math.pi / 2.0 - np.radians(heading_deg))
    return np.cos(half), np.sin(half)


def set_heading(log, name, heading_deg):
    start = COLUMNS[name].start
    log[:, start + 3], log[:, start + 6] = enu_yaw(heading_deg)


def reference_buckets(values, size):
    """Smallest and largest of each bucket in the order in which they came, by brute force."""
    pairs = []
    for start in range(0, len(values), size):
        bucket = values[start : start + size]
        low, high = int(np.argmin(bucket)), int(np.argmax(bucket))
        pairs += [bucket[min(low, high)], bucket[max(low, high)]]
    return pairs


@pytest.fixture
def few_buckets(monkeypatch):
    """Eight buckets only, so that a short log fills them many times over."""
    monkeypatch.setattr(traces, 'BUCKETS', 8)


@quick
@given(data=st.data())
def test_every_bucket_has_its_extremes_in_order_however_the_log_is_cut(data):
    ticks = data.draw(st.integers(1, 150))
    cuts = data.draw(st.lists(st.integers(0, ticks), max_size=4))
    seed = data.draw(st.integers(0, 2**32 - 1))
    values = np.random.default_rng(seed).permutation(ticks).astype(float)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(traces, 'BUCKETS', 8)
        kept = trace(make_log(ticks, **{f'c{E2}': values}), *cuts)
    size = round(2.0 * kept.spacing_s / TICK_S)
    assert len(kept.curves['cross_track_m']) <= 16
    assert size == 2 or math.ceil(ticks / (size // 2)) > 8, 'no coarser than it has to be'
    assert kept.curves['cross_track_m'].tolist() == reference_buckets(values, size)
    assert kept.ticks == ticks


def test_a_short_run_is_kept_whole():
    values = np.sin(np.arange(1001.0))
    kept = trace(make_log(1001, **{f'c{E2}': values}))
    assert kept.spacing_s == TICK_S
    assert np.array_equal(kept.curves['cross_track_m'][:1001], values.astype(np.float32))
    assert kept.time_s()[1000] == pytest.approx(100.0)


@pytest.mark.parametrize('at', [0, 1, 4999, 77777, 199999])
def test_a_peak_of_one_tick_is_never_lost(few_buckets, at):
    values = np.zeros(200_000)
    values[at] = -7.0
    kept = trace(make_log(len(values), **{f'c{E2}': values}), 36000, 72000, 108000, 144000)
    curve = kept.curves['cross_track_m']
    assert np.min(curve) == -7.0
    assert kept.time_s()[np.argmin(curve)] == pytest.approx(at * TICK_S, abs=2 * kept.spacing_s)


def test_memory_does_not_grow_with_the_run(monkeypatch):
    monkeypatch.setattr(traces, 'BUCKETS', 64)
    tracer, log = Tracer(VEHICLE), make_log(4000, **{f'c{E2}': np.arange(4000.0)})
    tracer.add(log)
    tracemalloc.start()
    for _ in range(3):
        tracer.add(log)
    early, _ = tracemalloc.get_traced_memory()
    for _ in range(200):
        tracer.add(log)
    late, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert late - early < 100_000
    kept = tracer.result()
    assert kept.ticks == 204 * 4000
    assert all(len(values) <= 128 for values in kept.curves.values())
    assert all(len(values) <= 65 for values in kept.samples.values())


def test_angles_are_not_drawn_where_navigation_has_no_attitude():
    log = make_log(100)
    log[:, TRUTH.start + 3] = 1.0
    log[40:60, COLUMNS['odom']][:, 3:7] = NO_ATTITUDE
    tracer = Tracer(VEHICLE)
    tracer.add(log)
    for angle in ('roll', 'pitch', 'heading'):
        assert np.all(np.isnan(tracer.result().curves[f'measured_{angle}_deg'][40:60]))
    assert np.all(np.isfinite(tracer.result().curves['measured_depth_m'][:100]))


def test_samples_are_simultaneous_and_end_at_the_last_tick(few_buckets):
    """North and east of a vehicle that goes north-east: equal at every sample."""
    way = np.arange(1000.0)
    east = COLUMNS['odom'].start
    kept = trace(make_log(1000, **{f'c{east}': way, f'c{east + 1}': way}), 333)
    north, east = kept.samples['track_north_m'], kept.samples['track_east_m']
    assert np.array_equal(north, east)
    assert (north[0], north[-1]) == (0.0, 999.0)
    size = round(2.0 * kept.spacing_s / TICK_S)
    assert np.array_equal(north[:-1], np.arange(0.0, 1000.0, size))


@pytest.mark.parametrize('value', [np.nan, np.inf, -np.inf])
def test_what_is_not_finite_is_a_gap_and_is_counted(few_buckets, value):
    values = np.ones(2048)  # buckets of 256 ticks
    values[512:1024] = value
    values[1200] = value
    kept = trace(make_log(2048, **{f'c{E2}': values}), 500)
    assert kept.missing['cross_track_m'] == 513
    curve, time_s = kept.curves['cross_track_m'], kept.time_s()
    assert np.array_equal(np.isnan(curve), (time_s > 51.1) & (time_s < 102.3))
    assert not np.any(np.isinf(curve))
    assert kept.missing['depth_m'] == 0


def test_heading_goes_on_through_180_and_the_reference_stays_near():
    """Three turns to starboard, with a reference that is 10 deg ahead; a lost tick in between."""
    heading = np.linspace(170.0, 170.0 + 1080.0, 4001)
    log = make_log(4001)
    set_heading(log, 'odom', heading)
    set_heading(log, 'reference', heading + 10.0)
    log[2000, COLUMNS['odom']] = np.nan
    kept = trace(log, 1000, 2500)
    known = np.isfinite(kept.curves['heading_deg'])
    flown = kept.curves['heading_deg'][known]
    assert flown[0] == pytest.approx(170.0, abs=1e-3)
    assert flown[-1] == pytest.approx(170.0 + 1080.0, abs=1e-3)
    ahead = kept.curves['heading_ref_deg'][known] - flown
    assert ahead == pytest.approx(10.0, abs=1e-3)


def test_inflections_are_where_the_desired_vertical_rate_changes_its_sign():
    rising = np.where(np.arange(5000) % 2000 < 1000, -0.2, 0.2)
    log = make_log(5000)
    log[:, COLUMNS['reference'].start + 9] = rising
    assert trace(log, 1234).inflections_s().tolist() == [100.0, 200.0, 300.0, 400.0]


def test_flags_are_those_of_the_control_law():
    """An actuator is at its limit when control says so: every tick of a flight into its limits."""
    scenario = load_scenario(
        'current_8deg', {'dives': 0, 'duration_s': 900.0, 'initial.heading_deg': 90.0}
    )
    log = np.concatenate([block.copy() for block in fly_blocks(*mission_of(scenario))])
    tracer = make_tracer(scenario)
    tracer.add(log)
    kept, said = tracer.result(), log[:, COLUMNS['saturation']].astype(int)
    assert np.count_nonzero(said & 1) > 0, 'the flight has something to tell'
    for bit, name in ((1, 'buoyancy_engine'), (2, 'pitch_mass'), (4, 'roll_mass')):
        assert kept.flagged[f'{name}_at_limit'] == np.count_nonzero(said & bit), name
    first = np.flatnonzero(said & 1)[0]
    assert kept.first_s('buoyancy_engine_at_limit') == pytest.approx(TICK_S * first)


def test_noise_is_taken_off_and_what_was_measured_is_kept_beside():
    """The error drawn is the error scored, and both miss what a metre of noise adds."""
    fields = {'dives': 0, 'duration_s': 1500.0, 'settle_s': 0.0, 'profile.depth_m': 60.0}
    scenario = load_scenario('noisy_sensors', fields)
    tracer, scorer = make_tracer(scenario), Scorer(scenario)
    for block in fly_blocks(*mission_of(scenario)):
        tracer.add(block)
        scorer.add(block)
    kept = tracer.result()
    score = scorer.result(Rules(depth_m=60.0))
    assert kept.largest('cross_track_m') == pytest.approx(score['cross_track_m']['max_all'])
    assert np.nanmax(kept.curves['depth_m']) == pytest.approx(score['depth_m']['max'])
    noise = kept.curves['measured_depth_m'] - kept.curves['depth_m']
    assert np.std(noise) == pytest.approx(1.0, rel=0.1)


def test_archive_gives_back_what_went_in(tmp_path):
    values = np.random.default_rng(0).normal(size=3000)
    kept = trace(make_log(3000, **{f'c{E2}': values}))
    file = tmp_path / 'traces.npz'
    kept.save(file)
    again = load_traces(file)
    assert [path.name for path in tmp_path.iterdir()] == ['traces.npz']
    for name in CURVES:
        assert np.array_equal(again.curves[name], kept.curves[name], equal_nan=True)
    for name, expected in kept.samples.items():
        assert np.array_equal(again.samples[name], expected, equal_nan=True)
    rest = ('ticks', 'spacing_s', 'missing', 'flagged')
    assert [getattr(again, name) for name in rest] == [getattr(kept, name) for name in rest]


@pytest.mark.parametrize('left', [0, 1, 100, 10_000])
def test_archive_that_is_cut_short_is_told(tmp_path, left):
    file = tmp_path / 'traces.npz'
    trace(make_log(3000)).save(file)
    whole = file.read_bytes()
    assert len(whole) > left
    file.write_bytes(whole[:left])
    with pytest.raises(ConfigurationError, match=r'traces\.npz'):
        load_traces(file)


def test_archive_of_another_version_is_told(tmp_path, monkeypatch):
    file = tmp_path / 'traces.npz'
    trace(make_log(10)).save(file)
    monkeypatch.setattr(traces, 'VERSION', traces.VERSION + 1)
    with pytest.raises(ConfigurationError, match='another version'):
        load_traces(file)


@pytest.mark.parametrize('ticks', [0, 1, 2, 3])
def test_the_shortest_runs(ticks):
    kept = trace(make_log(ticks, **{f'c{E2}': 5.0}))
    assert kept.ticks == ticks
    assert set(kept.curves['cross_track_m']) <= {5.0}
    assert len(kept.curves['cross_track_m']) == 2 * math.ceil(ticks / 2)
    assert kept.thinned(1).ticks == ticks


def test_thinner_traces_keep_the_extremes():
    values = np.random.default_rng(1).normal(size=20_001)
    kept = trace(make_log(len(values), **{f'c{E2}': values}))
    thin = kept.thinned(100)
    curve = thin.curves['cross_track_m']
    assert len(curve) <= 100
    assert (np.min(curve), np.max(curve)) == (np.float32(values.min()), np.float32(values.max()))
    assert thin.time_s()[-1] == pytest.approx(kept.time_s()[-1], abs=2.0 * thin.spacing_s)
