# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Depth against a straight line through fading samples, speed against the balance of forces."""

import math

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.signal import lfilter

from glider_base.kernel import kernel
from glider_base.signals import TICK_S
from glider_model.onboard.glide_polar import make_polar
from glider_model.vehicle.file import load_vehicle
from glider_navigation.flight_model import (
    INITIAL_FLIGHT,
    INITIAL_ZERO,
    Flight,
    at_the_surface,
    find_zero,
    follow_depth,
    reckon_speed,
    weigh_speed,
)

POLARS = {name: make_polar(load_vehicle(name).params()) for name in ('zhang2021', 'seawing')}
#: Time constants of the vertical rate, and of a speed that fades (s).
RATE_S, FADES_S = 4.0, 7.5
periods = pytest.mark.parametrize('period_s', [0.1, 4.0, 10.0])


@kernel
def _follow(depths, every, dt):
    flight = INITIAL_FLIGHT
    rows = np.empty((len(depths), 2))
    for i in range(len(depths)):
        flight = follow_depth(flight, depths[i // every * every], i % every == 0, dt)
        rows[i, 0], rows[i, 1] = flight.depth, flight.rate
    return rows


def follow(depths, period_s):
    """Depth and rate, tick by tick, of depths of which some are seen."""
    return _follow(depths, round(period_s / TICK_S), TICK_S)


def ticks(period_s):
    """Time (s) of 800 samples."""
    return TICK_S * np.arange(799 * round(period_s / TICK_S) + 1)


@periods
def test_rate_and_depth_are_those_of_a_line_through_samples_that_fade(period_s):
    """The filter is the least-squares line whose samples weigh exp(-age / 4 s) (Morrison 1969)."""
    t_s = ticks(period_s)
    depths = np.cumsum(np.random.default_rng(1).normal(0.0, 0.2, len(t_s)))
    depth, rate = follow(depths, period_s)[-1]
    every = round(period_s / TICK_S)
    seen, age_s = depths[::every], t_s[-1] - t_s[::every]
    weights = np.maximum(np.exp(-0.5 * age_s / RATE_S), 1e-150)
    slope, here = np.polyfit(-age_s, seen, 1, w=weights)
    assert rate == pytest.approx(slope, rel=1e-5)
    assert depth == pytest.approx(here, rel=1e-5)


@periods
@pytest.mark.parametrize('true_rate', [0.1537, -0.2219])
def test_a_ramp_is_followed_between_the_samples(period_s, true_rate):
    t_s = ticks(period_s)
    depths = 500.0 + true_rate * t_s
    depth, rate = follow(depths, period_s)[-100:].T
    assert rate == pytest.approx(true_rate, abs=1e-6)
    assert depth == pytest.approx(depths[-100:], abs=1e-4)


@periods
@pytest.mark.parametrize('true_rate', [0.1537, -0.2219])
def test_rate_is_off_by_no_more_than_the_resolution_can_make(period_s, true_rate):
    """0.1 m: by no more than 0.05 m times the absolute sum of the filter's impulse response."""
    t_s = ticks(period_s)
    depths = np.round(10.0 * (500.0 + true_rate * t_s)) / 10.0
    rate = follow(depths, period_s)[len(t_s) // 2 :, 1]
    fade = math.exp(-period_s / RATE_S)
    pulse = np.eye(1, 2000)[0]
    gain = (1.0 - fade) ** 2 / period_s
    response = lfilter([gain, -gain], np.convolve([1.0, -fade], [1.0, -fade]), pulse)
    most = 0.05 * np.sum(np.abs(response))
    assert np.max(np.abs(rate - true_rate)) < most
    assert most < 0.025
    assert np.mean(rate) == pytest.approx(true_rate, rel=0.01)


def test_the_first_sample_is_taken_as_it_is():
    assert follow(np.full(1, 321.5), TICK_S)[0].tolist() == [321.5, 0.0]


@pytest.mark.parametrize('polar', POLARS.values(), ids=POLARS)
@pytest.mark.parametrize('pitch_deg', [15.0, 20.0, 25.0, 35.0, 50.0])
@pytest.mark.parametrize('phase', [1.0, -1.0], ids=['dive', 'climb'])
def test_speed_is_that_of_the_steady_glide(polar, pitch_deg, phase, steady_speed):
    """w / tan(theta - alpha), with the angle of attack at which forces balance."""
    theta, rate = -phase * math.radians(pitch_deg), phase * 0.17
    flight = reckon_speed(Flight(100.0, rate, 0.0, 0.0, True), theta, polar, TICK_S)
    assert flight.speed == pytest.approx(steady_speed(theta, rate, polar), rel=0.005)
    assert flight.speed > 0.0


@pytest.mark.parametrize(
    ('pitch_deg', 'rate'),
    [(-25.0, -0.15), (25.0, 0.15), (0.0, 0.15), (-5.0, 0.15), (-25.0, 0.01)],
    ids=['nose down, rises', 'nose up, sinks', 'level', 'shallow', 'slow'],
)
def test_speed_fades_where_pitch_and_rate_are_no_glide(pitch_deg, rate):
    """To 1 / e in 7.5 s."""
    flight = Flight(100.0, rate, 0.4, 0.0, True)
    for i in range(1, 301):
        flight = reckon_speed(flight, math.radians(pitch_deg), POLARS['seawing'], TICK_S)
        assert flight.speed == pytest.approx(0.4 * math.exp(-i * TICK_S / FADES_S), rel=0.03)
    assert flight.depth == 100.0 and flight.rate == rate


def test_no_glider_is_as_fast_as_a_wrong_rate_says():
    flight = Flight(100.0, 3.0, 0.4, 0.0, True)
    assert reckon_speed(flight, math.radians(-15.0), POLARS['seawing'], TICK_S).speed == 1.5


@pytest.mark.parametrize('rate', [0.2, -0.2])
def test_no_depth_is_invented_once_samples_stop(rate):
    """What the last samples say leads for a minute; a fix then says that it is at the surface."""
    flight = Flight(1.0, rate, 0.3, 0.0, True)
    for _ in range(6000):
        flight = follow_depth(flight, 1.0, False, TICK_S)
    assert flight.depth == pytest.approx(1.0 + 60.0 * rate, abs=0.1)
    assert flight.rate == 0.0
    assert at_the_surface(flight, False) == flight
    assert at_the_surface(flight, True).depth == 0.0
    seen = follow_depth(flight, 25.0, True, TICK_S)
    assert at_the_surface(seen, True) == seen


@pytest.mark.parametrize('pitch_deg', [-8.0, -15.0, -30.0, 30.0])
@pytest.mark.parametrize('weight', [0.05, 0.2])
def test_speed_by_weight_and_by_its_own_rate_are_one(pitch_deg, weight):
    """Forces balance at the speed that a weight gives; of its vertical rate the same one comes."""
    polar = make_polar(load_vehicle('seaglider').params(), to_the_end=True)
    theta, weight = math.radians(pitch_deg), math.copysign(weight, -pitch_deg)
    by_weight = weigh_speed(INITIAL_FLIGHT, theta, weight, polar, TICK_S).speed
    best = math.copysign(math.sqrt(polar.K_D0 * by_weight**polar.n / polar.K_D), -theta)
    alpha = brentq(lambda a: _across(theta, a, by_weight / math.cos(theta - a), polar), 0.0, best)
    speed = by_weight / math.cos(theta - alpha)
    drag = polar.K_D0 * speed**polar.n + polar.K_D * alpha**2
    assert drag * speed**2 == pytest.approx(-9.81 * weight * math.sin(theta - alpha), rel=0.01)
    assert weigh_speed(INITIAL_FLIGHT, theta, -weight, polar, TICK_S).speed == 0.0


def _across(theta, alpha, speed, polar):
    """Drag times sine plus lift times cosine of the path: no force acts across a weight."""
    drag = polar.K_D0 * speed**polar.n + polar.K_D * alpha**2
    return drag * math.cos(theta - alpha) + polar.K_L * alpha * math.sin(theta - alpha)


@kernel
def _zero_of(zero, depths, every, dt):
    for i in range(len(depths)):
        zero = find_zero(zero, depths[i], i % every == 0, True, dt)
    return zero


def zero_of(depths, zero=INITIAL_ZERO, period_s=TICK_S):
    """Offset (m) after a stay with a fix, of which each tick shows a depth (m)."""
    zero = find_zero(zero, 50.0, True, False, TICK_S)  # it dived before
    return _zero_of(zero, np.array(depths, float), round(period_s / TICK_S), TICK_S)


@pytest.mark.parametrize('shown', [1.0, 3.1, 4.4, -1.0, 12.0, 19.9, -19.9])
def test_what_is_shown_with_a_fix_is_the_offset(shown):
    """Once ten seconds have shown it; it stays for the next dive."""
    assert zero_of([shown] * 98).offset == 0.0
    zero = zero_of([shown] * 102)
    assert zero.offset == pytest.approx(shown)
    assert find_zero(zero, 80.0, True, False, TICK_S).offset == zero.offset
    assert zero_of([0.0] * 200, zero).offset == 0.0


@pytest.mark.parametrize('shown', [0.0, 0.8, -0.8, 20.1, -20.1])
def test_waves_and_what_no_sensor_is_off_by_are_no_offset(shown):
    assert zero_of([shown] * 600).offset == 0.0


@pytest.mark.parametrize(('shown', 'then'), [(5.8, 5.0), (4.2, 5.0), (6.0, 6.0), (4.0, 4.0)])
def test_an_offset_changes_by_more_than_waves_do(shown, then):
    assert zero_of([shown] * 102, zero_of([5.0] * 102)).offset == pytest.approx(then)


@pytest.mark.parametrize('rate', [0.1, 0.3, -0.15])
@pytest.mark.parametrize('period_s', [0.1, 4.0])
def test_fixes_on_the_way_down_or_up_show_no_offset(rate, period_s):
    """A receiver that goes on under water by itself; waves hide no offset for long."""
    depths = 3.0 + (rate < 0.0) * 60.0 + rate * TICK_S * np.arange(4000)
    assert zero_of(depths, period_s=period_s).offset == 0.0
    waves = 8.0 + 1.5 * np.cos(2.0 * math.pi * np.arange(300) / 90.0)
    assert zero_of(waves).offset == pytest.approx(8.0, abs=0.9)


def test_an_offset_is_that_of_five_samples_and_averaged():
    assert zero_of([8.0] * 160, period_s=4.0).offset == 0.0
    assert zero_of([8.0] * 162, period_s=4.0).offset == pytest.approx(8.0)
    waves = 8.0 + np.cos(2.0 * math.pi * np.arange(120) / 40.0)
    assert zero_of(waves).shown == pytest.approx(8.0, abs=0.1)
