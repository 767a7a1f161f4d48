# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What a guidance method is: settings, params, state, and a kernel that fills `method_step`.

A method says in which direction to fly, of all that guidance knows. The stages of the yo, pitch,
vertical rate and the virtual target are the same for every method. docs/your_law.md builds one
from nothing.
"""

from typing import NamedTuple

from pydantic import Field

from glider_base.settings import Settings, number, positive
from glider_base.signals import TrackingError, Water
from glider_base.slot import returns, slot
from glider_model.onboard.learnt_steering import Steering, SteeringParams
from glider_model.vehicle.file import Vehicle


class LosGains(Settings):
    """Line of sight, as far as methods share it."""

    lookahead_m: float = number(
        40.0, (1.0, 10000.0), 'least lookahead of los_current (m)', tunable=True
    )
    lead_turns: bool = Field(
        True, description='share the drift of a turn between before and after (los_current)'
    )
    delta1_m: float = number(
        3.2, (0.1, 10000.0), 'Delta1, lookahead of los_zhang2021 (m)', tunable=True
    )
    delta1_per_s: float = positive(
        0.1, 5.0, 'delta1, pull of the virtual target toward the vehicle (1/s)', tunable=True
    )
    delta2: float = number(
        1.0,
        (0.05, 20.0),
        'delta2, ratio of the vertical lookahead to the distance (-)',
        tunable=True,
    )


class MethodSettings(Settings):
    """Gains of a guidance method; every field has a default.

    A subclass is called by the name of its file in `glider_guidance.methods`, or by that of its
    entry point in the group ``glider.guidance_methods``. Its fields are those of
    ``guidance.NAME``; the first line of its docstring says what it does.
    """

    def params(self, los: LosGains, vehicle: Vehicle) -> NamedTuple:
        """Kernel parameters, of a type of the method's own."""
        raise NotImplementedError

    def initial_state(self) -> NamedTuple:
        """State before the first tick, of the type that `method_step` returns."""
        raise NotImplementedError


class Leg(NamedTuple):
    """What the vehicle is doing: the stage of the yo."""

    stage: int  #: one of `glider_guidance.yo.machine`
    descends: bool  #: it is to go down, or to turn down
    is_gliding: bool  #: a steady glide
    is_surfaced: bool  #: at the surface, or on the way there for good
    turns_over: bool  #: between two glides
    begins_to_turn_over: bool  #: since this tick
    glided_s: float  #: time in this stage (s)
    glided_before_s: float  #: that of the tick before (s)
    lead_s: float  #: time by which the coming turn is led (s)
    lead_before_s: float  #: that of the tick before (s)
    to_turn_s: float  #: time until the pump starts for the next turn; infinite: none (s)


class Situation(NamedTuple):
    """What a method sees at a tick. NED, angles in rad."""

    course: float  #: gamma_d of the path at the virtual target
    elevation: float  #: rho_d of the path there, + up; 0 in a sawtooth
    error: TrackingError  #: position in the path frame; e3 = 0 in a sawtooth
    follows_path: bool  #: in three dimensions; else depth is that of a sawtooth
    ground_n: float  #: velocity over ground (m/s)
    ground_e: float
    speed: float  #: horizontal speed through the water, estimated (m/s)
    glide_speed: float  #: that of the steady glide to come, by the flight model (m/s)
    current: Water  #: estimated (m/s)
    steering: Steering  #: what is known of how the vehicle turns
    turning: SteeringParams  #: with that, how far ahead it can follow: `lookahead`
    leg: Leg
    heading: float  #: that was asked for last


class Asked(NamedTuple):
    """What a method asks for."""

    heading: float  #: through the water (rad)
    elevation: float  #: over ground, + up (rad); of no account in a sawtooth
    speed: float  #: horizontal, through the water, as it is reckoned with from now on (m/s)
    current_n: float  #: current that is reckoned with (m/s)
    current_e: float
    feasible: bool  #: the path can be held in this current


@slot
@returns('state after the tick', Asked)
def method_step(state, seen, params, dt):
    """One tick of a guidance method, of ``dt`` s, by the type of its params.

    They are those of `MethodSettings.params`; what it has ``seen`` is a `Situation`.
    """
