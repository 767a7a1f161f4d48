# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The tuned PID law: pitch, roll and heading, with yaw-rate damping and rate feed-forward.

It is the opponent that the adaptive law is measured against, so it is made as good as it gets. It
knows the vehicle: steering effectiveness and its sign in both phases, and the masses.
"""

from typing import NamedTuple

from glider_base.frames import wrap_angle
from glider_base.kernel import kernel
from glider_base.settings import derived, number
from glider_control.heading import HeadingLawSettings, HeadingParams, heading_to_roll
from glider_control.law import Bank, bank_carefully, law_step
from glider_model.onboard.command_filter import Filtered, FilterParams, filter_command
from glider_model.onboard.moving_mass import Righting, make_righting
from glider_model.vehicle.file import Vehicle


class PidSettings(HeadingLawSettings):
    """Gains of the PID law.

    Moments in N m, angles in rad.
    """

    pitch_kp: float = number(8.0, (0.0, 1000.0), 'pitch (N m/rad)', tunable=True)
    pitch_ki: float = number(0.08, (0.0, 100.0), 'pitch (N m/(rad s))', tunable=True)
    pitch_kd: float = number(10.0, (0.0, 1000.0), 'pitch rate (N m s/rad)', tunable=True)
    roll_kp: float = number(8.0, (0.0, 1000.0), 'roll (N m/rad)', tunable=True)
    roll_ki: float = number(0.4, (0.0, 100.0), 'roll (N m/(rad s))', tunable=True)
    roll_kd: float = number(2.0, (0.0, 1000.0), 'roll rate (N m s/rad)', tunable=True)

    def params(self, vehicle: Vehicle, bank: Bank) -> 'PidParams':
        """Kernel parameters for a vehicle whose steering is known."""
        return derived(
            PidParams,
            self,
            heading=self.heading_params(vehicle),
            roll_limit=bank.limit,
            roll_filter=bank.filter,
            righting=make_righting(vehicle.params()),
        )

    def initial_state(self) -> 'PidState':
        """Integrators at zero."""
        return PidState(0.0, 0.0, 0.0, Filtered(0.0, 0.0))


class PidParams(NamedTuple):
    """Gains, and how the vehicle steers."""

    pitch_kp: float
    pitch_ki: float
    pitch_kd: float
    roll_kp: float
    roll_ki: float
    roll_kd: float
    heading: HeadingParams
    roll_limit: float  #: (rad)
    roll_filter: FilterParams
    righting: Righting


class PidState(NamedTuple):
    """Integrators and the roll filter."""

    pitch_integral: float  #: (N m)
    roll_integral: float  #: (N m)
    heading_integral: float  #: (rad/s)
    roll: Filtered


#: Integrators are held within these bounds (N m).
PITCH_INTEGRAL_MAX, ROLL_INTEGRAL_MAX = 3.0, 2.0


@kernel
def _clip(number, limit):
    return min(limit, max(-limit, number))


@law_step.body(PidParams)
@kernel
def pid_step(state, seen, params, dt):
    """Roll and pitch moment (N m) of the PID law: see `law_step`."""
    measured, reference = seen.measured, seen.reference
    params = bank_carefully(seen.m_b, params)
    roll_command, heading_integral = heading_to_roll(
        state.heading_integral,
        measured,
        reference,
        seen.speed,
        params.roll_limit,
        params.heading,
        dt,
    )
    roll = filter_command(state.roll, roll_command, params.roll_filter, dt)

    e_phi = wrap_angle(roll.value - measured.phi)
    roll_integral = state.roll_integral
    if not seen.roll_held:
        roll_integral = _clip(roll_integral + dt * params.roll_ki * e_phi, ROLL_INTEGRAL_MAX)
    tau_p = (
        params.roll_kp * e_phi + params.roll_kd * (roll.rate - measured.phi_dot) + roll_integral
    )

    e_theta = reference.theta - measured.theta
    pitch_integral = state.pitch_integral
    if not seen.pitch_held:
        pitch_integral = _clip(pitch_integral + dt * params.pitch_ki * e_theta, PITCH_INTEGRAL_MAX)
    tau_q = (
        params.pitch_kp * e_theta
        + params.pitch_kd * (reference.theta_dot - measured.theta_dot)
        + pitch_integral
    )
    return PidState(pitch_integral, roll_integral, heading_integral, roll), tau_p, tau_q
