"""A sliding-mode law: pitch and roll are held on s = e' + lambda e + lambda / T int e dt."""

import math
from typing import NamedTuple

from pydantic import Field

from glider_base.frames import wrap_angle
from glider_base.kernel import kernel
from glider_control.law import Bank, LawSettings, law_step
from glider_model.onboard.command_filter import Filtered, FilterParams, filter_command
from glider_model.onboard.learnt_steering import speed_ratio


class SlidingSettings(LawSettings):
    """Sliding mode with a boundary layer."""

    k: float = Field(
        12.0,
        gt=0.0,
        le=200.0,
        description='largest moment about either axis (N m)',
        json_schema_extra={'tunable': True},
    )
    layer_radps: float = Field(1.5, gt=0.0, le=10.0, description='boundary layer of s (rad/s)')
    slope_per_s: float = Field(0.8, gt=0.0, le=10.0, description='lambda (1/s)')
    integral_s: float = Field(100.0, ge=1.0, le=1e6, description='T of the integral (s)')
    turn_radps: float = Field(0.012, gt=0.0, le=0.1, description='largest turn rate (rad/s)')
    heading_layer_rad: float = Field(0.3, gt=0.0, le=3.0, description='boundary layer of heading')

    def params(self, vehicle, bank: Bank) -> 'SlidingParams':
        """Kernel parameters for a vehicle whose steering is known."""
        gains = (getattr(self, name) for name in SlidingSettings.model_fields)
        steering = vehicle.steering
        return SlidingParams(*gains, steering.dive.value, steering.climb.value, *bank)

    def initial_state(self) -> 'SlidingState':
        """Nothing learnt, wings level."""
        return SlidingState(0.0, 0.0, Filtered(0.0, 0.0))


class SlidingParams(NamedTuple):
    """Gains, how the vehicle steers, and how it may be rolled."""

    k: float  #: (N m)
    layer: float  #: (rad/s)
    slope: float  #: (1/s)
    integral_s: float
    turn: float  #: (rad/s)
    heading_layer: float  #: (rad)
    dive: float  #: turn rate over sin(roll) at the reference speed (rad/s), signed
    climb: float
    roll_limit: float  #: (rad)
    roll_filter: FilterParams


class SlidingState(NamedTuple):
    """Integrals of the errors (rad s), and the roll asked for."""

    pitch: float
    roll: float
    bank: Filtered


@kernel
def slide(integral, error, rate, held, params, dt):
    """Moment (N m) about one axis toward the surface s = 0, and the integral of the error."""
    if not held:
        integral += dt * error
    s = rate + params.slope * (error + integral / params.integral_s)
    return params.k * math.tanh(s / params.layer), integral


@law_step.body(SlidingParams)
@kernel
def sliding_step(state, seen, params, dt):
    """Roll and pitch moment (N m): see `law_step`."""
    now, wanted = seen.measured, seen.reference
    roll = 0.0
    if abs(now.vertical_rate) > 0.12:  # else it turns over, and cannot be steered
        steering = params.dive if now.vertical_rate > 0.0 else params.climb
        error = wrap_angle(wanted.psi - now.psi)
        turn = wanted.psi_dot + params.turn * math.tanh(error / params.heading_layer)
        limit = math.sin(params.roll_limit)
        sine = turn / (steering * speed_ratio(seen.speed))
        roll = math.asin(min(limit, max(-limit, sine)))
    bank = filter_command(state.bank, roll, params.roll_filter, dt)

    e_phi, e_theta = bank.value - now.phi, wanted.theta - now.theta
    tau_p, in_roll = slide(state.roll, e_phi, bank.rate - now.phi_dot, seen.roll_held, params, dt)
    tau_q, in_pitch = slide(
        state.pitch, e_theta, wanted.theta_dot - now.theta_dot, seen.pitch_held, params, dt
    )
    return SlidingState(in_pitch, in_roll, bank), tau_p, tau_q
