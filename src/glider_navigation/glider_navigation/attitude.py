# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Attitude between samples, and angular rates where there is no gyro (docs/theory.md, 4).

Of the angles at which gravity has no moment only the change since the sample is used: what else
turns the vehicle is in the sample. A rate made of two samples would be as old as half the time
between them, and by it whoever learns how the vehicle steers learns it wrong. Only where samples
are dense, that rate is used.
"""

import math
from typing import NamedTuple

from glider_base.frames import body_rates, euler_from_quaternion, euler_rates, wrap_angle
from glider_base.kernel import kernel
from glider_model.onboard.moving_mass import first_moments
from glider_model.vehicle.file import Vehicle

#: Samples that come faster than this (s) are dense: rates are differences.
DENSE_S = 1.0
#: Standard deviation by which a change of heading from sample to sample is off (rad); share of
#: itself by which k wanders from one to the next; share by which d follows what is left.
TURN_STD, K_WANDERS, D_SHARE = math.radians(0.5), 0.01, 0.05
#: The vehicle's file may be wrong by all of k, and by this (rad/s) where it says next to nothing.
LEAST_K_STD = 0.005
#: No glider turns faster (rad/s); one that tumbles would have it learn that it does.
MOST_TURN = 0.2
#: Pitched or rolled by more than this (rad), as a vehicle that bobs at the surface is, it tells
#: nothing of turning.
STEEP = 1.0
#: Samples are no further apart (s): what has shown the same for longer was sampled again.
REPEATED_S = 60.0
#: Time constants with which roll and pitch follow the moving mass (s).
ROLL_S, PITCH_S = 2.0, 2.0
#: Time constant with which differences of samples count as rates (s).
RATE_S = 2.0


class Angles(NamedTuple):
    """Roll, pitch, heading (rad), or their rates (rad/s)."""

    phi: float
    theta: float
    psi: float


class Turning(NamedTuple):
    """How roll turns the vehicle in one phase, dive or climb."""

    k: float  #: turn rate over sine of roll (rad/s)
    p: float  #: variance of k


class Turn(NamedTuple):
    """How roll turns the vehicle, and how far it has since the last sample."""

    dive: Turning
    climb: Turning
    d: float  #: turn rate without roll (rad/s)
    roll_s: float  #: integral of the sine of roll since the sample (s)
    turned: float  #: heading since the sample (rad)


_LEVEL = Angles(0.0, 0.0, 0.0)


class AttitudeState(NamedTuple):
    """The last sample, and how it moves."""

    turn: Turn
    sample: Angles = _LEVEL
    rates: Angles = _LEVEL
    balance: Angles = _LEVEL  #: that the moving mass makes, the heading of no account
    balance_then: Angles = _LEVEL  #: that it made at the sample
    age_s: float = 0.0
    seen: bool = False
    dense: bool = False  #: it came soon after the one before


def initial_attitude(vehicle: Vehicle) -> AttitudeState:
    """Nothing is measured yet: it steers as the vehicle's file says."""
    dive, climb = (
        Turning(k, max(k * k, LEAST_K_STD * LEAST_K_STD)) for k in vehicle.steering_rates
    )
    return AttitudeState(Turn(dive, climb, 0.0, 0.0, 0.0))


class Attitude(NamedTuple):
    """Attitude and rates at a tick."""

    angles: Angles
    p: float  #: body rates (rad/s)
    q: float
    r: float


@kernel
def _follow_mass(balance, joints, mass, dt):
    """Angles that the moving mass makes a tick later, and their rates."""
    s_x, s_y, s_z = first_moments(joints.m_b, joints.x_p, joints.mu, mass)
    phi, theta = math.atan2(s_y, s_z), -math.atan2(s_x, s_z)
    rates = Angles((phi - balance.phi) / ROLL_S, (theta - balance.theta) / PITCH_S, 0.0)
    return Angles(balance.phi + dt * rates.phi, balance.theta + dt * rates.theta, 0.0), rates


@kernel
def _bounded(rate):
    """A rate of turn (rad/s) that a glider may have."""
    return min(MOST_TURN, max(-MOST_TURN, rate))


@kernel
def _learn(turning, roll_s, off):
    """How roll turns the vehicle, by how far off its heading was after a time of roll."""
    p = turning.p + (K_WANDERS * turning.k) ** 2
    gain = p * roll_s / (p * roll_s * roll_s + TURN_STD * TURN_STD)
    return Turning(_bounded(turning.k + gain * off), p * (1.0 - gain * roll_s))


@kernel
def _take_turn(turn, turned, age_s, dives):
    """What a change of heading (rad) over ``age_s`` since the sample before tells of turning."""
    off = wrap_angle(turned - turn.turned)
    dive, climb = turn.dive, turn.climb
    if dives:
        dive = _learn(dive, turn.roll_s, off)
    else:
        climb = _learn(climb, turn.roll_s, off)
    d = _bounded(turn.d + D_SHARE * off / age_s)
    if abs(turn.turned) > math.pi:
        d = 0.0  # of more than half a turn between samples nothing tells how much it was
    return Turn(dive, climb, d, 0.0, 0.0)


@kernel
def _go_on_turning(turn, phi, theta, dt):
    """Heading a tick later by roll and pitch (rad), and its rate."""
    sine = math.sin(phi)
    rate = (turn.dive.k if theta < 0.0 else turn.climb.k) * sine + turn.d
    roll_s, turned = turn.roll_s + dt * sine, turn.turned + dt * rate
    return Turn(turn.dive, turn.climb, turn.d, roll_s, turned), rate


@kernel
def _is_steep(angles):
    """Whether roll or pitch leave a heading without a meaning."""
    return abs(angles.theta) > STEEP or abs(angles.phi) > STEEP


@kernel
def attitude_step(
    state: AttitudeState, imu, joints, mass, dt: float
) -> tuple[AttitudeState, Attitude, bool]:
    """One tick of ``dt`` s with the actuators at ``joints``; and whether a sample is new."""
    balance, tilts = _follow_mass(state.balance, joints, mass, dt)
    phi, theta, psi = euler_from_quaternion(imu.q_w, imu.q_x, imu.q_y, imu.q_z)
    sample, before = Angles(phi, theta, psi), state.sample
    age_s = state.age_s + dt
    is_new = not state.seen or phi != before.phi or theta != before.theta or psi != before.psi
    is_new = is_new or age_s > REPEATED_S
    phi = wrap_angle(before.phi + balance.phi - state.balance_then.phi)
    turn, turn_rate = _go_on_turning(state.turn, phi, before.theta, dt)
    dense = state.dense and age_s <= DENSE_S
    if dense:
        turn_rate = state.rates.psi
    rates, then = Angles(tilts.phi, tilts.theta, turn_rate), state.balance_then
    if is_new:
        then, dense = balance, state.seen and age_s <= DENSE_S
        change = wrap_angle(sample.psi - before.psi)
        is_glide = not _is_steep(sample) and not _is_steep(before)
        if state.seen and age_s > DENSE_S and is_glide:
            turn = _take_turn(turn, change, age_s, before.theta < 0.0)
        else:
            turn = Turn(turn.dive, turn.climb, turn.d, 0.0, 0.0)
        if imu.has_rates:
            phi_dot, theta_dot, psi_dot = euler_rates(
                sample.phi, sample.theta, imu.p, imu.q, imu.r
            )
            rates = Angles(phi_dot, theta_dot, psi_dot)
        elif dense:
            share = 1.0 - math.exp(-age_s / RATE_S)
            psi = state.rates.psi + share * (change / age_s - state.rates.psi)
            rates = Angles(tilts.phi, tilts.theta, psi)
        before, age_s = sample, 0.0
    state = AttitudeState(
        sample=before,
        rates=rates,
        balance=balance,
        balance_then=then,
        turn=turn,
        age_s=age_s,
        seen=True,
        dense=dense,
    )
    angles = Angles(
        wrap_angle(before.phi + balance.phi - then.phi),
        before.theta + balance.theta - then.theta,
        wrap_angle(before.psi + turn.turned),
    )
    rates = state.rates
    p, q, r = body_rates(angles.phi, angles.theta, rates.phi, rates.theta, rates.psi)
    return state, Attitude(angles, p, q, r), is_new
