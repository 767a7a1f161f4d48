# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Dead reckoning between fixes, as gliders navigate.

Under water the place goes on with speed through the water, by pitch and depth, on the measured
heading, and with the current that is estimated. At the surface, fixes tell where the vehicle came
up and how it drifts; what is left between that and the dead reckoning is current, and is used
in the way to come. A surfacing without a fix is one point of a longer way.
"""

import math
from typing import ClassVar, Literal, NamedTuple

from pydantic import Field

from glider_base.frames import odometry_to_wire, quaternion_from_euler, rotate_to_body
from glider_base.kernel import kernel, replace
from glider_base.settings import number
from glider_base.signals import Covariance, Odometry, Vector, minus, over, plus
from glider_model.onboard.fix_watch import DIVES_M, SURFACES_M
from glider_model.onboard.glide_polar import Polar, make_polar
from glider_model.onboard.moving_mass import MovingMass, make_moving_mass
from glider_navigation import current_estimate as estimate
from glider_navigation import flight_model, surface_interval
from glider_navigation.attitude import AttitudeState, attitude_step, initial_attitude
from glider_navigation.current_estimate import TIDE, CurrentEstimate, Regressors
from glider_navigation.flight_model import INITIAL_FLIGHT, INITIAL_ZERO, Flight, Zero
from glider_navigation.forecast import Forecast, Trust, forecast_at, make_forecast, squared, weigh
from glider_navigation.method import Estimate, NavigationMethodSettings, Start, method_step
from glider_navigation.phase import AT_SURFACE, FIXED, UNDER_WATER
from glider_navigation.surface_interval import Stay

#: Shorter than this (s) a dive segment tells no current.
SHORTEST_WAY_S = 120.0


class DeadReckonedSettings(NavigationMethodSettings):
    """Dead reckoning between fixes."""

    reads: ClassVar[tuple[str, ...]] = ('imu', 'pressure', 'fix')
    tells: ClassVar[tuple[str, ...]] = ('believed_current', 'believed_surface_current')

    start_std_m: float = number(
        5.0, (0.1, 1e5), 'error of the place where the vehicle is launched (m)'
    )
    speed_error_share: float = number(0.05, (0.0, 1.0), 'error of the speed through the water (-)')
    heading_error_deg: float = number(2.0, (0.0, 90.0), 'error of the compass (deg)')
    speed_by: Literal['rate', 'buoyancy'] = Field(
        'rate',
        description='what tells the speed with the pitch. rate: the vertical rate; buoyancy: that '
        'of the buoyancy engine, as if nothing else made the vehicle heavy or light',
    )

    def params(self, start: Start) -> 'DeadReckonedParams':
        """Kernel parameters."""
        vehicle = start.vehicle.params()
        return DeadReckonedParams(
            polar=make_polar(vehicle, to_the_end=True),
            mass=make_moving_mass(vehicle),
            forecast=make_forecast(start.forecast, start.current == 'forecast'),
            estimates_current=start.current != 'none',
            speed_variance=self.speed_error_share**2,
            heading_variance=math.radians(self.heading_error_deg) ** 2,
            is_weighed=self.speed_by == 'buoyancy',
        )

    def initial_state(self, start: Start) -> 'DeadReckonedState':
        """At the surface, where the vehicle was put into the water."""
        place = Vector(start.p_n, start.p_e)
        way = Way(place, self.start_std_m**2)
        stay = surface_interval.launched(place, self.start_std_m**2)
        current, trust = estimate.initial_estimate(start.current == 'tidal'), Trust(1.0, 0.0)
        if start.current == 'forecast':
            current = estimate.initial_estimate(False, start.forecast.error_std_mps)
            trust = Trust(1.0, start.forecast.share_std**2)
        attitude = initial_attitude(start.vehicle)
        return DeadReckonedState(attitude, place, way, stay, current, trust)


class DeadReckonedParams(NamedTuple):
    """What dead reckoning needs to know of vehicle and errors."""

    polar: Polar
    mass: MovingMass
    forecast: Forecast
    estimates_current: bool
    speed_variance: float  #: of the share by which speed is off
    heading_variance: float  #: (rad^2)
    is_weighed: bool  #: speed comes from pitch and buoyancy


_STILL = Vector(0.0, 0.0)


class Way(NamedTuple):
    """The dive segment since the last fix."""

    begun: Vector  #: where that was (m)
    variance: float  #: (m^2)
    through: Vector = _STILL  #: way through the water, and by drift where nothing fixed it (m)
    by_current: Vector = _STILL  #: way by the current that was estimated (m)
    forecast: Vector = _STILL  #: way by the current that was forecast (m)
    t_s: float = 0.0  #: time under water
    deepest: float = 0.0  #: depth that it led to (m)
    before: float = 0.0  #: that of the way before (m)
    cos_s: float = 0.0  #: integrals of cos(w t) and sin(w t) over it (s)
    sin_s: float = 0.0


_NO_WAY = Way(_STILL, 0.0)


class DeadReckonedState(NamedTuple):
    """Dead reckoning between two ticks."""

    attitude: AttitudeState
    place: Vector  #: where the vehicle estimates it is (m)
    way: Way
    stay: Stay
    current: CurrentEstimate  #: beside what is used of the forecast
    trust: Trust
    tick: int = 0
    flight: Flight = INITIAL_FLIGHT
    under: bool = False  #: it is under water
    column: Vector = _STILL  #: mean of the forecast over the last segment that showed it (m/s)
    depth: float = 0.0  #: that was shown last (m)
    zero: Zero = INITIAL_ZERO  #: what is shown at the surface


@kernel
def _regressors(way):
    """Means over the way."""
    t = max(1.0, way.t_s)
    return Regressors(1.0, way.cos_s / t, way.sin_s / t)


@kernel
def _unlike(way, current):
    """Mean velocity through the water less that of the last way: its errors are new (m/s)."""
    return minus(over(way.through, max(1.0, way.t_s)), current.glide)


@kernel
def _change_of_forecast(way, column):
    """Mean of the forecast over a way less that of the last way (m/s)."""
    return minus(over(way.forecast, max(1.0, way.t_s)), column)


@kernel
def place_covariance(way, current, trust, column, params):
    """Covariance of the place after a way (m^2)."""
    t = way.t_s
    known = way.variance + t * t * (
        estimate.mean_variance(current, _regressors(way)) + estimate.wandered(current, t)
    )
    unlike = _unlike(way, current)
    n, e = t * unlike.n, t * unlike.e
    along, across = params.speed_variance, params.heading_variance
    change, unsure = _change_of_forecast(way, column), t * t * trust.variance
    return Covariance(
        known + along * n * n + across * e * e + unsure * change.n * change.n,
        (along - across) * n * e + unsure * change.n * change.e,
        known + along * e * e + across * n * n + unsure * change.e * change.e,
    )


@kernel
def _learn(current, trust, column, way, stay, params):
    """Estimates of current and forecast after the fixes of a surface interval."""
    if way.t_s < SHORTEST_WAY_S or not params.estimates_current:
        return current, trust
    t = way.t_s
    off = over(minus(minus(minus(stay.came_up, way.begun), way.through), way.by_current), t)
    h, variance = _regressors(way), (way.variance + stay.known.cc) / (t * t)
    bias = 0.5 * (params.speed_variance + params.heading_variance)
    bias *= squared(_unlike(way, current))
    if trust.variance > 0.0 and current.way_s > 0.0:
        change = _change_of_forecast(way, column)
        noise = (
            estimate.mean_variance(current, h) + estimate.wandered(current, t) + bias + variance
        )
        weighed = weigh(trust, off, change, noise)
        more = weighed.share - trust.share
        off = plus(off, change, -more)
        current = replace(current, mean=plus(current.mean, column, -more))
        trust = weighed
    return estimate.take_in(current, off, h, t, over(way.through, t), variance, bias), trust


@kernel
def _dive(way, stay):
    """The way that begins with a dive: a new one, if the stay had a fix."""
    if stay.fixes > 0:
        before = way.deepest if way.t_s >= SHORTEST_WAY_S else way.before
        return replace(_NO_WAY, begun=stay.place, variance=stay.known.pp, before=before)
    drifted = minus(plus(way.through, stay.place), stay.came_up)
    more = surface_interval.drifted_variance(stay)
    return replace(way, variance=way.variance + more, through=drifted)


@kernel
def _go_on(way, through, current, predicted, depth, t_s, dt):
    """The way a tick later, at velocities through the water, of current and forecast (m/s)."""
    return replace(
        way,
        through=plus(way.through, through, dt),
        by_current=plus(way.by_current, current, dt),
        forecast=plus(way.forecast, predicted, dt),
        t_s=way.t_s + dt,
        deepest=max(way.deepest, depth),
        cos_s=way.cos_s + dt * math.cos(TIDE * t_s),
        sin_s=way.sin_s + dt * math.sin(TIDE * t_s),
    )


@kernel
def _at_the_top(place, t_s, current, trust, params):
    """Current (m/s) that is estimated for a place at the surface (m) and a time (s)."""
    predicted = forecast_at(params.forecast, place, 0.0, 0.0, t_s)
    return plus(estimate.current_at(current, t_s), predicted, trust.share)


@kernel
def _unforeseen(drift, place, t_s, current, trust, params):
    """A drift (m/s) at a place (m) and time (s), less the water that is expected to be there."""
    return minus(drift, _at_the_top(place, t_s, current, trust, params))


@kernel
def _carry(current, trust, stay, t_s, params):
    """The current as a surface interval ends, by how the drift has changed in it."""
    if current.way_s <= 0.0:
        return current
    first = stay.first_drift
    more, variance = surface_interval.change_of_drift(stay)
    then = _unforeseen(first, stay.came_up, t_s - stay.t_s, current, trust, params)
    now = _unforeseen(plus(first, more), stay.place, t_s, current, trust, params)
    return estimate.carry(current, minus(now, then), stay.t_s, variance)


@kernel
def _end_of(way):
    """Where a way has led to (m)."""
    return plus(plus(way.begun, way.through), way.by_current)


@kernel
def _change_over(state, under, t_s, params):
    """Way, stay, current and trust in the forecast, after a dive or a surfacing if there is one.

    Last comes the mean of the forecast over the last dive segment that showed it (m/s). ``under``
    says whether the vehicle is under water now, ``state`` is of the tick before, ``t_s`` since
    the start.
    """
    way, stay, current = state.way, state.stay, state.current
    trust, column = state.trust, state.column
    if state.tick == 0:
        column = forecast_at(params.forecast, state.place, 0.0, 0.0, t_s)
        stay = replace(stay, drift=plus(stay.drift, column, trust.share))
    if under and not state.under:
        if stay.fixes > 0:
            current, trust = _learn(current, trust, column, way, stay, params)
            if way.t_s >= SHORTEST_WAY_S:
                column = over(way.forecast, way.t_s)
            current = _carry(current, trust, stay, t_s, params)
        way = _dive(way, stay)
    elif state.under and not under:
        covariance = place_covariance(way, current, trust, column, params)
        drift = stay.drift
        if stay.fixes <= 1:
            drift = _at_the_top(state.place, t_s, current, trust, params)
        stay = surface_interval.begin(state.place, 0.5 * (covariance.nn + covariance.ee), drift)
    return way, stay, current, trust, column


@kernel
def _odometry(place, attitude, flight, velocity):
    """Odometry on the wire of a place (m) and a velocity over ground (m/s)."""
    angles = attitude.angles
    q_w, q_x, q_y, q_z = quaternion_from_euler(angles.phi, angles.theta, angles.psi)
    u, v, w = rotate_to_body(q_w, q_x, q_y, q_z, velocity.n, velocity.e, flight.rate)
    p, q, r = attitude.p, attitude.q, attitude.r
    odometry = Odometry(
        p_n=place.n,
        p_e=place.e,
        p_d=flight.depth,
        q_w=q_w,
        q_x=q_x,
        q_y=q_y,
        q_z=q_z,
        u=u,
        v=v,
        w=w,
        p=p,
        q=q,
        r=r,
    )
    return odometry_to_wire(odometry)


@method_step.body(DeadReckonedParams)
@kernel
def dead_reckoned_step(state, received, params, dt):
    """Reckon on, or take fixes; see `method_step`."""
    t_s = state.tick * dt
    followed, attitude, sampled = attitude_step(
        state.attitude, received.imu, received.joints, params.mass, dt
    )
    is_new = sampled or received.depth != state.depth
    zero = flight_model.find_zero(state.zero, received.depth, is_new, received.fix.is_fix, dt)
    flight = flight_model.set_anew(state.flight, state.zero.offset - zero.offset)
    flight = flight_model.follow_depth(flight, received.depth - zero.offset, is_new, dt)
    flight = flight_model.at_the_surface(flight, received.fix.is_fix)
    if params.is_weighed:
        flight = flight_model.weigh_speed(
            flight, attitude.angles.theta, received.joints.m_b, params.polar, dt
        )
    else:
        flight = flight_model.reckon_speed(flight, attitude.angles.theta, params.polar, dt)
    under = flight.depth > (SURFACES_M if state.under else DIVES_M)
    way, stay, current, trust, column = _change_over(state, under, t_s, params)
    if under:
        psi = attitude.angles.psi
        through = Vector(flight.speed * math.cos(psi), flight.speed * math.sin(psi))
        # in the first dive nobody knows as yet how deep it will be
        deepest = max(way.before, way.deepest) if way.before > 0.0 else 0.0
        predicted = forecast_at(params.forecast, state.place, flight.depth, deepest, t_s)
        water = plus(estimate.current_at(current, t_s), predicted, trust.share)
        way = _go_on(way, through, water, predicted, flight.depth, t_s, dt)
        place, velocity = _end_of(way), plus(through, water)
        covariance = place_covariance(way, current, trust, column, params)
        phase = UNDER_WATER
    else:
        stay = surface_interval.wait(stay, dt)
        if surface_interval.counts(stay, received.fix):
            stay = surface_interval.hear_fix(stay, received.fix)
        place, velocity, variance = stay.place, stay.drift, stay.known.pp
        covariance = Covariance(variance, 0.0, variance)
        phase = FIXED if stay.fixes > 0 else AT_SURFACE
    wandering = current.p.mm + estimate.wandered(current, current.way_s)
    estimated = Estimate(
        odom=_odometry(place, attitude, flight, velocity),
        place=covariance,
        current=plus(estimate.last_mean(current), column, trust.share),
        current_covariance=Covariance(wandering, 0.0, wandering),
        surface=stay.drift,
        surface_covariance=Covariance(stay.known.vv, 0.0, stay.known.vv),
        phase=phase,
    )
    state = DeadReckonedState(
        tick=state.tick + 1,
        attitude=followed,
        flight=flight,
        under=under,
        place=place,
        way=way,
        stay=stay,
        current=current,
        trust=trust,
        column=column,
        depth=received.depth,
        zero=zero,
    )
    return state, estimated
