# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Flights of the whole stack beside the bounds, by the direct engine: plant, law and guidance.

A start inside the region is made by the path: in the middle of a steady glide it is another one
from now on, beside the vehicle and turned against its heading. An error of the current is made by
the water: its velocity across the path jumps to and fro, and what guidance estimates lags behind.
"""

import math
from collections.abc import Callable, Iterator

import numpy as np

from glider_base.signals import TICK_S
from glider_bringup.engines.direct import HeldMission
from glider_bringup.engines.flight import mission_of
from glider_mission.blocks import COLUMNS, ROW
from glider_studies.bounds.certificate import Gain, Region
from glider_studies.bounds.glide import Glide, straight_on

#: A flight lasts so long, or until the glide is over (s).
FLIGHT_S = 1500.0
#: At home: no further from the path over the last minute (m).
HOME_M, LAST_S = 0.5, 60.0
#: Velocity across the path that the water jumps to and fro between (m/s), and for how long it
#: stays, uniformly (s).
JUMP_MPS, STAYS_S = 0.02, (50.0, 400.0)
#: In a current guidance leads the turn: no jumps so long before it (s).
LEAD_S = 260.0
#: Flights with jumps, for each start.
JUMPS_SHARE = 0.1

_ASIDE = COLUMNS['tracking_error'].start + 1
_WATER = COLUMNS['current_velocity'].start
_ESTIMATE = COLUMNS['current_estimate'].start


def _course_of(glide: Glide) -> tuple[float, float, float]:
    """Place (m) and heading (rad) of the vehicle."""
    guidance = glide.state.guidance
    place = guidance.gate.odometry
    return place.p_n, place.p_e, guidance.followed.measured.psi


def drawn(region: Region, random: np.random.Generator) -> tuple[float, float]:
    """A start (m, rad), evenly inside the ellipse of the region."""
    angle, radius = random.uniform(0.0, 2.0 * math.pi), math.sqrt(random.uniform())
    factor = np.linalg.cholesky(np.linalg.inv(region.start))
    aside, turned = radius * (factor @ (math.cos(angle), math.sin(angle)))
    return float(aside), float(turned)


def fly_start(glide: Glide, aside: float, turned: float) -> np.ndarray:
    """|e| (m) of every tick, from a start cross-track (m, + starboard) and turned (rad)."""
    north, east, heading = _course_of(glide)
    course = heading - turned
    north, east = north + aside * math.sin(course), east - aside * math.cos(course)
    params = straight_on(glide.params, north, east, course)
    log = np.empty((_ticks(glide), ROW))
    rows, _ = HeldMission(glide.state, params).fly(log)
    return np.abs(log[:rows, _ASIDE])


def _ticks(glide: Glide) -> int:
    return round(min(FLIGHT_S, glide.left_s) / TICK_S)


def fly_starts(
    glide: Glide, region: Region, starts: int, seed: int, done: Callable[[], None]
) -> dict[str, float]:
    """Fly from starts that are drawn; start i of a seed is the same whatever their number.

    Returns how many ``starts``, and of these came ``home``; ``of_bound``, the largest |e| of a
    flight over what its start allows (-); ``largest_m``, the largest |e|.
    """
    widest = math.sqrt(np.linalg.inv(region.p)[0, 0])
    home, of_bound, largest = 0, 0.0, 0.0
    for i in range(starts):
        aside, turned = drawn(region, np.random.default_rng((seed, i)))
        flown = fly_start(glide, aside, turned)
        start = np.array((aside, turned))
        allowed = widest * math.sqrt(start @ region.start @ start)
        home += bool(flown[-round(LAST_S / TICK_S) :].max() <= HOME_M)
        of_bound = max(of_bound, float(flown.max()) / allowed)
        largest = max(largest, float(flown.max()))
        done()
    return {'starts': starts, 'home': home, 'of_bound': of_bound, 'largest_m': largest}


def fly_jumps(
    glide: Glide, gain: Gain, flights: int, seed: int, done: Callable[[], None]
) -> dict[str, float]:
    """Fly on the path in water that jumps; the error of the estimate is measured.

    Returns how many ``flights``; ``gain``, the largest |e| over the largest error of its flight
    (m per m/s); ``of_bound``, that over the certified gain (-).
    """
    north, east, heading = _course_of(glide)
    waters = [_water(glide, heading, sign * JUMP_MPS) for sign in (1.0, -1.0)]
    across = -math.cos(heading), math.sin(heading)
    worst = 0.0
    for i in range(flights):
        random = np.random.default_rng((seed, 1, i))
        log = np.concatenate(
            list(_jumping(glide, straight_on(glide.params, north, east, heading), waters, random))
        )
        # on the wire x is east, y is north
        error = log[:, _WATER : _WATER + 2] - log[:, _ESTIMATE : _ESTIMATE + 2]
        largest = float(np.abs(error @ across).max())
        worst = max(worst, float(np.abs(log[:, _ASIDE]).max()) / largest)
        done()
    return {'flights': flights, 'gain': worst, 'of_bound': worst / gain.gain}


def _water(glide: Glide, heading: float, speed: float):
    """Parameters of water that goes to starboard of a heading (rad) with a speed (m/s)."""
    direction = math.degrees(heading) + math.copysign(90.0, speed)
    fields = {'speed_mps': abs(speed), 'direction_deg': math.remainder(direction, 360.0)}
    current = glide.scenario.current.model_copy(update={'speed_kn': None, **fields})
    return mission_of(glide.scenario.model_copy(update={'current': current}))[1].current


def _jumping(glide: Glide, params, waters, random: np.random.Generator) -> Iterator[np.ndarray]:
    """Log of each stay of the water."""
    held, side = HeldMission(glide.state, params), int(random.integers(2))
    left = _ticks(glide._replace(left_s=glide.left_s - LEAD_S))
    while left > 0:
        held.set_params(params._replace(current=waters[side]))
        log = np.empty((min(left, round(random.uniform(*STAYS_S) / TICK_S)), ROW))
        rows, is_over = held.fly(log)
        yield log[:rows]
        left, side = 0 if is_over else left - rows, 1 - side
