# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What a control law is: settings, params, state, and a kernel that fills the slot `law_step`.

A law turns what control sees into a roll and a pitch moment. All else, from the odometry that is
refused to the allocation of moments to masses, is the same for every law. docs/your_law.md builds
one from nothing.
"""

import math
from typing import NamedTuple

from glider_base.kernel import kernel, replace
from glider_base.settings import Settings, number, positive
from glider_base.signals import NOTHING_LEARNT, Adaptation, Reference
from glider_base.slot import default, returns, slot
from glider_model.onboard.attitude_filter import Measured
from glider_model.onboard.command_filter import FilterParams
from glider_model.onboard.moving_mass import rights_itself
from glider_model.vehicle.file import Vehicle

#: A glide that leaves less than this share of the righting at rest hardly stops a roll;
LEAST_RIGHTING = 0.25
#: so the vehicle is then rolled to this share of its bank, and at this share of its rate.
CAREFUL_SHARE = 1.0 / 3.0


class HeadingSettings(Settings):
    """Bank to turn."""

    roll_limit_deg: float = number(30.0, (1.0, 60.0), 'largest commanded roll (deg)')
    roll_frequency_radps: float = positive(
        0.5, 5.0, 'natural frequency of the roll filter (rad/s)'
    )
    roll_rate_radps: float = positive(0.08, 1.0, 'largest rate of the desired roll (rad/s)')

    def params(self) -> 'Bank':
        """Kernel parameters."""
        return Bank(
            math.radians(self.roll_limit_deg),
            FilterParams(self.roll_frequency_radps, self.roll_rate_radps),
        )


class Bank(NamedTuple):
    """How a vehicle may be rolled to turn it."""

    limit: float  #: largest commanded roll (rad); 0 of a vehicle with a steering surface
    filter: FilterParams  #: command filter of the roll


@kernel
def bank_carefully(m_b, params):
    """Params of a law, with less bank where a net heaviness m_b (kg) hardly lets the roll stop.

    What does not right itself is stopped by the roll mass alone, which takes long to the other
    side and holds a small roll only. Rolled as far and as fast as else, it rolls over. The params
    have ``roll_limit``, ``roll_filter`` and ``righting``.
    """
    if rights_itself(m_b, LEAST_RIGHTING, params.righting):
        return params
    slow = replace(params.roll_filter, rate_limit=CAREFUL_SHARE * params.roll_filter.rate_limit)
    return replace(params, roll_limit=CAREFUL_SHARE * params.roll_limit, roll_filter=slow)


class Seen(NamedTuple):
    """What a law sees at a tick. Angles in NED / FRD."""

    measured: Measured  #: attitude, Euler rates and vertical rate, filtered
    reference: Reference  #: what guidance asks for
    speed: float  #: through the water, by the flight model (m/s)
    alpha: float  #: angle of attack, by the flight model (rad)
    m_b: float  #: net heaviness by the buoyancy engine (kg, + sinks)
    tau_p: float  #: roll moment that the moving mass makes now (N m)
    tau_q: float  #: pitch moment that it makes now (N m)
    roll_held: bool  #: the roll mass was sent to its limit: integrators wait
    pitch_held: bool  #: the pitch mass was
    delta: float  #: where the steering surface is (rad); 0 without one


class LawSettings(Settings):
    """Gains of a control law; every field has a default.

    A subclass is called by the name of its file in `glider_control.laws`, or by that of its entry
    point in the group ``glider.control_laws``. Its fields are those of ``control.NAME``.
    """

    def params(self, vehicle: Vehicle, bank: Bank) -> NamedTuple:
        """Kernel parameters, of a type of the law's own, for a vehicle as its file says."""
        raise NotImplementedError

    def initial_state(self) -> NamedTuple:
        """State before the first tick, of the type that `law_step` returns."""
        raise NotImplementedError


@slot
@returns('state after the tick', 'roll moment (N m)', 'pitch moment (N m)')
def law_step(state, seen, params, dt):
    """One tick of a control law, of ``dt`` s, by the type of its params (`LawSettings.params`).

    Of a `Seen` come its state after the tick, and the roll and the pitch moment (N m) that are
    wanted of the moving mass. At the surface, and where odometry is lost, it is not asked.
    """


@slot
@default
@returns(*Adaptation._fields)
def law_learnt(state, params):
    """`Adaptation` of a law, for the topic ``adaptation``: nothing learnt, if it does not say."""
    return NOTHING_LEARNT
