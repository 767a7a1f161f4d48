# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What is certified of a vehicle's steering, and what flights did beside it."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from glider_model.plant.trim import solve_trim
from glider_model.vehicle.file import load_vehicle
from glider_studies.bounds.certificate import Gain, Region, gain, reached, region
from glider_studies.bounds.flights import JUMPS_SHARE, fly_jumps, fly_starts
from glider_studies.bounds.glide import Glide, glides, slope, steering_loop
from glider_studies.bounds.steering_loop import BOX, INPUTS, SteeringLoop, box, sensitivity, tick

#: max |S| is to be below this.
SENSITIVITY_MAX = 2.0
#: Net buoyancies over the nominal one between which the speed exponent is taken, and the roll
#: mass or fin that turns the vehicle there (deg).
_WEIGHTS, _TURNED_DEG = (0.8, 1.25), 2.0


def bounds(
    vehicle: str, starts: int, seed: int, done: Callable[[int], None] = lambda flown: None
) -> dict[str, Any]:
    """Certificates of both phases of a vehicle, and ``starts`` flights from each region.

    They are ``vehicle``, ``box``, ``starts``, ``seed``, ``holds`` and ``phases``, by their names.
    """
    flown = 0

    def one_more() -> None:
        nonlocal flown
        flown += 1
        done(flown)

    phases = {
        name: _phase(glide, starts, seed, one_more) for name, glide in glides(vehicle).items()
    }
    return {
        'vehicle': vehicle,
        'box': BOX,
        'starts': starts,
        'seed': seed,
        'holds': all(not phase['failed'] for phase in phases.values()),
        'phases': phases,
    }


def flights(starts: int) -> int:
    """Number of flights of a study."""
    return 2 * (starts + _jumps(starts))


def _jumps(starts: int) -> int:
    return math.ceil(JUMPS_SHARE * starts)


def _phase(glide: Glide, starts: int, seed: int, done: Callable[[], None]) -> dict[str, Any]:
    loop = steering_loop(glide)
    found = region(loop, lambda reach: slope(glide, reach))
    gains = {name: gain(loop, i) for i, name in enumerate(INPUTS)}
    least = dict(zip(INPUTS, reached(loop).tolist(), strict=True))
    result = {
        'loop': _of_loop(glide, loop),
        'gains': {
            name: one and _of_gain(one, least[name], INPUTS[name]) for name, one in gains.items()
        },
        'region': found and _of_region(found),
        'starts': None,
        'jumps': None,
    }
    if starts and found:
        result['starts'] = fly_starts(glide, found, starts, seed, done)
    if starts and gains['current']:
        result['jumps'] = fly_jumps(glide, gains['current'], _jumps(starts), seed, done)
    result['failed'] = _failed(result)
    return result


def _failed(result: dict[str, Any]) -> list[str]:
    """What does not hold, in words."""
    failed = [
        f'no certificate of the gain from {name}'
        for name, one in result['gains'].items()
        if not one
    ]
    if not result['region']:
        failed.append('no certificate of a region')
    if result['loop']['sensitivity'] is None:
        failed.append('the loop is unstable somewhere in the box')
    elif result['loop']['sensitivity'] >= SENSITIVITY_MAX:
        failed.append(f'max |S| is not below {SENSITIVITY_MAX}')
    starts, jumps = result['starts'], result['jumps']
    if starts and starts['home'] < starts['starts']:
        failed.append('a start did not come home')
    if starts and starts['of_bound'] > 1.0:
        failed.append('a start went further than its bound')
    if jumps and jumps['of_bound'] > 1.0:
        failed.append('an error of the current did more than its bound')
    return failed


def _of_loop(glide: Glide, loop: SteeringLoop) -> dict[str, float | None]:
    """Numbers of a loop; the turn of the whole equations beside the one that was learnt."""
    rate, exponent = _turn(glide, loop)
    zero = abs(loop.zero) if math.isfinite(loop.zero) else None
    slowest = max(np.linalg.eigvals(tick(loop, one).f).real.max() for one in box(loop))
    stable = slowest < 0.0
    return {
        'speed_mps': glide.speed,
        'horizontal_mps': loop.speed,
        'b_radps': loop.b,
        'b_of_trim_radps': rate,
        'k': loop.k,
        'speed_exponent': exponent,
        'zero_radps': zero,
        'is_adverse': bool(loop.k) and loop.zero > 0.0,
        'bandwidth_radps': loop.bandwidth,
        'lookahead_s': loop.lookahead_s,
        'heading_filter_s': 2.0 / loop.heading_filter.frequency,
        'roll_filter_s': loop.roll_filter and 2.0 / loop.roll_filter.frequency,
        'limit_deg': math.degrees(loop.limit),
        'slowest_s': -1.0 / slowest if stable else None,
        'sensitivity': max(sensitivity(loop, one) for one in box(loop)) if stable else None,
        'leg_s': loop.leg_s,
        'zero_times_leg': zero and zero * loop.leg_s,
    }


def _turn(glide: Glide, loop: SteeringLoop) -> tuple[float | None, float | None]:
    """Turn rate over sine of roll or fin at the glide's weight, and the exponent of its speed."""
    profile = glide.scenario.profile
    vehicle = load_vehicle(glide.scenario.vehicle).params()
    sign = 1.0 if glide.descends else -1.0
    found = []
    for share in _WEIGHTS:
        weight = sign * min(share * profile.net_heaviness_kg, vehicle.m_b_max)
        turned = {'fin_deg' if loop.roll_filter is None else 'roll_mass_deg': _TURNED_DEG}
        solved = solve_trim(vehicle, weight, -sign * profile.pitch_deg, **turned)
        if not solved.converged or not solved.turn_rate_radps:
            return None, None
        angle = solved.fin_deg if loop.roll_filter is None else solved.roll_deg
        found.append((solved.speed_mps, solved.turn_rate_radps / math.sin(math.radians(angle))))
    (slow, less), (fast, more) = found
    if less * more <= 0.0:
        return None, None
    exponent = math.log(more / less) / math.log(fast / slow)
    return less * (glide.speed / slow) ** exponent, exponent


def _of_gain(one: Gain, least: float, unit: str) -> dict[str, float | str]:
    return {'m_per_unit': one.gain, 'unit': unit, 'at_least': least, 'holds_to': one.holds_to}


def _of_region(one: Region) -> dict[str, float]:
    widest = math.sqrt(np.linalg.inv(one.p)[0, 0])
    return {
        'aside_m': one.aside_m,
        'turned_deg': math.degrees(one.turned),
        'widest_m': widest,
        'times_limits': one.times,
    }
