# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The Lyapunov function of the paper's law along flights of vehicles that it does not know.

docs/theory.md, section 3: W = V1 + K2bar^T M K2bar / 2, which is the topic's ``lyapunov_2``, obeys

    W' <= -2 lambda W + mu,  2 lambda = min(L1, B2 / M),
    mu = 1/2 sum[B1 (J3 zeta + d1)^2 / L1 + delta^2 / B2],
    delta = M omega' - tau_a - Phi^T theta_hat

delta is what the law does not know of the moments, however it comes about: unknown coefficients,
coupling, the lag of the filters. It is computed here from the motion of the plant and the moment
that its mass makes, and d1 from the motion of the angles, not from the law's own error equations.
"""

import math

import numpy as np
import pytest

from glider_base.kernel import kernel
from glider_base.signals import TICK_S, Adaptation
from glider_bringup.engines.direct import HeldMission, fly_held
from glider_bringup.engines.flight import mission_of
from glider_control.allocation import moments
from glider_control.laws.backstepping import (
    SCALE_ALPHA,
    SCALE_PITCH_RATE,
    SCALE_ROLL_RATE,
    SCALE_SIDE,
    SCALE_V2,
)
from glider_mission.blocks import COLUMNS, ROW
from glider_mission.scenario import load_scenario
from glider_model.onboard.glide_polar import glide_speed
from glider_model.vehicle.rigid_body import GRAVITY

#: Dives of 100 m, so that the flight has several inflections.
FLIGHT = {
    'dives': 0,
    'duration_s': 3200.0,
    'profile.depth_m': 100.0,
    'path': {'kind': 'waypoints', 'waypoints': [[0, 0], [200, 0], [300, 200], [300, 2000]]},
    'control.law': 'backstepping',
}
UNKNOWN = {
    'trim and roll bias': {'perturb.pitch_trim_m': 0.01, 'perturb.roll_bias_deg': 10.0},
    'damping and moments': {
        'perturb.K_p': 1.3, 'perturb.K_q': 0.7, 'perturb.K_M': 1.3, 'perturb.K_MY': 0.8
    },
}  # fmt: skip

LYAPUNOV_2 = COLUMNS['adaptation'].start + Adaptation._fields.index('lyapunov_2')
#: Columns of a recorded flight: W; then for roll and pitch each body rate (rad/s), K1bar (rad),
#: K2bar (rad/s), the diagonal of J3, tau_a and Phi^T theta_hat (N m); J3 from q to roll.
W, RATE, K1, K2, J3 = 0, [1, 7], [2, 8], [3, 9], [4, 10]
APPLIED, MODEL, CROSS = [5, 11], [6, 12], 13


@kernel
def record(held, out):
    """Fly tick by tick until the mission ends or ``out`` is full; ticks that were flown."""
    log, params = np.empty((1, ROW)), held.control.params
    for tick in range(len(out)):
        joints = held.plant.state.joints
        channels = held.control.state.law.channels
        th_p, th_q = channels.roll_theta, channels.pitch_theta
        _, finished = fly_held(held, log, False, TICK_S)
        measured, channels = held.control.state.measured, held.control.state.law.channels
        roll, pitch, polar = channels.roll, channels.pitch, params.polar
        phi, theta = measured.phi, measured.theta
        s_phi, c_phi, c_theta = math.sin(phi), math.cos(phi), math.cos(theta)
        p = measured.phi_dot - math.sin(theta) * measured.psi_dot
        q = c_phi * measured.theta_dot + s_phi * c_theta * measured.psi_dot
        r = c_phi * c_theta * measured.psi_dot - s_phi * measured.theta_dot
        speed, alpha = glide_speed(theta, measured.vertical_rate, polar)
        v2 = speed * speed
        mass = params.law.mass
        side = mass * speed * r - joints.m_b * GRAVITY * c_theta * s_phi
        model_p = (
            th_p[0] + th_p[1] * side / SCALE_SIDE + th_p[2] * roll.rate.value / SCALE_ROLL_RATE
        )
        model_q = (
            th_q[0]
            + th_q[1] * v2 * alpha / SCALE_ALPHA
            + th_q[2] * v2 / SCALE_V2
            + th_q[3] * pitch.rate.value / SCALE_PITCH_RATE
        )
        tau_p, tau_q = moments(joints.m_b, joints.x_p, joints.mu, phi, theta, params.allocation)
        out[tick, W] = log[0, LYAPUNOV_2]
        out[tick, 1:7] = (p, roll.k1, roll.k2, 1.0, tau_p, model_p)
        out[tick, 7:13] = (q, pitch.k1, pitch.k2, c_phi, tau_q, model_q)
        out[tick, CROSS] = s_phi * math.tan(theta)
        if finished:
            return tick + 1
    return len(out)


def fly_unknown(changes):
    """Flight of a vehicle that differs from its file: the law's gains, and what `record` saw."""
    scenario = load_scenario('current_8deg', {**FLIGHT, **changes})
    state, params = mission_of(scenario)
    out = np.empty((round(scenario.duration_s / TICK_S), CROSS + 1))
    return params.control.law, out[: record(HeldMission(state, params).blocks, out)]


def gains(law):
    """Inertia, B1, B2 and L1 of roll and pitch."""
    channels = (law.roll, law.pitch)
    return [
        np.array([getattr(one, name) for one in channels])
        for name in ('inertia', 'b1', 'b2', 'l1')
    ]


def unknown_moment(law, seen):
    """delta between every two ticks (N m); the law credits a step with the moment at its end."""
    slope = np.diff(seen, axis=0) / TICK_S
    return gains(law)[0] * slope[:, RATE] - seen[1:, APPLIED] - seen[:-1, MODEL]


def brake(law, seen):
    """B2 K2bar + J3^T B1 K1bar (N m), what the law takes off the errors of the rates."""
    _, b1, b2, _ = gains(law)
    moment = b2 * seen[:, K2] + b1 * seen[:, J3] * seen[:, K1]
    moment[:, 1] += b1[0] * seen[:, CROSS] * seen[:, K1[0]]
    return moment


def disturbance(law, seen):
    """Between every two ticks W, and mu, in which is what a step of 0.1 s adds; and 2 lambda."""
    inertia, b1, b2, l1 = gains(law)
    middle = 0.5 * (seen[:-1] + seen[1:])
    delta = unknown_moment(law, seen) + brake(law, middle) - brake(law, seen[:-1])
    given = np.diff(seen[:, K1], axis=0) / TICK_S  # will be J3 zeta + d1
    given += l1 * middle[:, K1] - middle[:, J3] * middle[:, K2]
    given[:, 0] -= middle[:, CROSS] * middle[:, K2[1]]
    mu = 0.5 * (b1 * given**2 / l1 + delta**2 / b2).sum(axis=1)
    function = 0.5 * (b1 * middle[:, K1] ** 2 + inertia * middle[:, K2] ** 2).sum(axis=1)
    return function, mu, min(*l1, *(b2 / inertia))


def bound(start, rate, mu):
    """Solution of B' = -rate B + mu from ``start``, by the trapezoidal rule."""
    values = [start]
    half = 0.5 * TICK_S * rate
    for one in mu:
        values.append((values[-1] * (1.0 - half) + TICK_S * one) / (1.0 + half))
    return np.array(values)


@pytest.fixture(scope='module', params=UNKNOWN.values(), ids=UNKNOWN)
def flight(request):
    """An unknown vehicle, from the second tick on at which it is steered: afloat the law rests."""
    law, seen = fly_unknown(request.param)
    steered = np.flatnonzero(seen[:, W])
    return law, seen[steered[0] + 2 :]


def test_w_stays_below_its_bound_through_the_whole_mission(flight):
    """Through dives, climbs and inflections; the bound is not a loose one either."""
    law, seen = flight
    _, mu, rate = disturbance(law, seen)
    limit = bound(seen[0, W], rate, mu)
    assert np.all(seen[:, W] <= limit * (1.0 + 1e-6))
    assert np.median(limit / seen[:, W]) < 20.0


def test_w_falls_outside_its_ultimate_set(flight, capsys):
    """W' <= -2 lambda W + mu at every tick, so that W falls wherever it is above mu / 2 lambda."""
    law, seen = flight
    now, mu, rate = disturbance(law, seen)
    slope = np.diff(seen[:, W]) / TICK_S
    assert np.all(slope <= (mu - rate * now) + 1e-6 * (mu + rate * now))
    outside = now > mu / rate
    assert outside.any()
    assert np.all(slope[outside] < 0.0)
    with capsys.disabled():
        print(
            f'\nultimate bound of W {bound(now[0], rate, mu)[len(now) // 4 :].max():.4f}, largest '
            f'W {now[len(now) // 4 :].max():.4f}, median {np.median(now):.6f}'
        )


@pytest.mark.parametrize('name', UNKNOWN)
def test_what_is_learnt_makes_the_set_smaller(name):
    """With adaptation switched off, W is several times as large in the same glides."""
    still = {
        'control.backstepping.roll.gamma': 0.0,
        'control.backstepping.pitch.gamma': 0.0,
    }
    _, learning = fly_unknown(UNKNOWN[name])
    _, knowing_nothing = fly_unknown({**UNKNOWN[name], **still})
    half = len(learning) // 2
    assert 3.0 * np.median(learning[half:, W]) < np.median(knowing_nothing[half:, W])
