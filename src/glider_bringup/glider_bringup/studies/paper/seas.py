# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Seas and stays at the surface that are hard on dead reckoning, and what is asked of it there."""

from typing import Any

import numpy as np

from glider_bringup.studies.paper.cases import Case
from glider_bringup.studies.paper.limits import Check

#: Errors of the sensors where a sea does not have its own.
_ERRORS = {
    'sensors.compass_bias_deg': 1.0,
    'sensors.compass_deviation_deg': 1.0,
    'sensors.pitch_scale': 0.96,
    'sensors.gps_std_m': 5.0,
}
_RECKONS = {'profile.surface_every_dives': 1, 'navigation.method': 'dead_reckoned', **_ERRORS}
#: Depths of the dives (m), and seeds.
_DEPTHS, _SEEDS = (250.0, 1000.0), (11, 12)
#: Time at the surface (s) that all others are compared with; these others (h); depths (m).
SHORT_S, STAYS_H, STAY_DEPTHS = 600.0, (2, 6, 12, 24), (100.0, 1000.0)
#: Share inside of the 95 % ellipse over all hard seas; mean squared innovation.
INSIDE, INNOVATION = (0.93, 0.97), (1.5, 3.0)
#: So many dives at least, of at most so long (s).
LEAST_DIVES, DIVE_S = 5, 8000.0
#: In long stays: largest error of the mean current (m/s), share inside, median error over that
#: after short stays (m).
STAY_DAC_MPS, STAY_INSIDE, STAY_MORE_M = 0.1, 0.9, 100.0


def _sea(shear: float = 0.15, tide: float = 0.08, turns: bool = False) -> dict[str, Any]:
    """The current of rough_water with other amplitudes (m/s); it may turn round, and back."""
    one = {'kind': 'shear', 'law': 'exponential', 'depth_m': 200.0, 'angle_deg': -60.0}
    other = {'kind': 'tidal', 'direction_deg': 75.0, 'ellipticity': 0.4, 'speed_mps': tide}
    wander = {'kind': 'gauss_markov', 'std_mps': 0.02, 'time_constant_s': 1800.0}
    there = {'at_s': 36000.0, 'speed_mps': 0.5, 'angle_deg': 200.0}
    back = {'at_s': 79200.0, 'speed_mps': 0.0, 'angle_deg': 0.0}
    steps = [{'kind': 'steps', 'steps': [there, back]}] if turns else []
    components = [{**one, 'speed_mps': shear}, other, wander, *steps]
    return {'current': {'speed_mps': 0.25, 'angle_deg': 20.0, 'components': components}}


#: What is hard about each sea.
_HARD = {
    'pitch read 10 % too large': {'sensors.pitch_scale': 1.1},
    'compass 3 deg off, deviation 5 deg': {
        'sensors.compass_bias_deg': 3.0,
        'sensors.compass_deviation_deg': 5.0,
    },
    'tide of 0.25 m/s': _sea(tide=0.25),
    'shear of 0.3 m/s': _sea(shear=0.3),
    'a current that turns round': _sea(turns=True),
}


def _case(name: str, changes: dict[str, Any], **facts) -> Case:
    changes = {**_RECKONS, **changes}
    return Case(name, 'adaptive', 'observer', 'rough_water', changes, facts=facts)


def hard_seas() -> list[Case]:
    """Each sea by depth and seed."""
    return [
        _case(
            f'{sea}, {depth:.0f} m, seed {seed}', {**more, 'profile.depth_m': depth, 'seed': seed}
        )
        for sea, more in _HARD.items()
        for depth in _DEPTHS
        for seed in _SEEDS
    ]


def stays() -> list[Case]:
    """Each stay by depth, with time for some dives."""
    cases = []
    for depth in STAY_DEPTHS:
        for hours in (SHORT_S / 3600.0, *STAYS_H):
            changes = {
                'profile.depth_m': depth,
                'profile.wait_s': 3600.0 * hours,
                'duration_s': max(108000.0, LEAST_DIVES * (3600.0 * hours + DIVE_S)),
            }
            name = f'{hours:.3g} h at the surface, {depth:.0f} m'
            cases.append(_case(name, changes, hours=hours, dive_m=depth))
    return cases


def _pooled(rows: list[dict]) -> tuple[float, float, int]:
    """Share inside, mean squared innovation and number of surfacings over all flights."""
    known = [row['navigation'] for row in rows]
    count = sum(one['surfacings'] for one in known)
    fixed = sum(one['fixed'] for one in known)
    inside = sum(one['ellipse_95_share'] * one['surfacings'] for one in known) / count
    return inside, sum(one['innovation_squared'] * one['fixed'] for one in known) / fixed, count


def _later(row: dict) -> float:
    """Median error (m) at the surfacings that a stay came before, without the first of all."""
    return float(np.median(row['navigation']['surfacing_error_m'][1:]))


def judge_hard(rows: list[dict]) -> list[Check]:
    """Over all of them the ellipse is as large as it has to be."""
    inside, innovation, count = _pooled(rows)
    figures = {'inside 95 %': (inside, INSIDE), 'innovation squared': (innovation, INNOVATION)}
    return [
        Check(f'{what} of {count} surfacings', value, f'{low} to {high}', low <= value <= high)
        for what, (value, (low, high)) in figures.items()
    ]


def judge_stays(rows: list[dict]) -> list[Check]:
    """Hours at the surface do not make the next surfacings worse than minutes do."""
    long = [row for row in rows if row['hours'] >= min(STAYS_H)]
    inside, _, count = _pooled(long)
    passed = inside >= STAY_INSIDE
    checks = [Check(f'inside 95 % of {count} surfacings', inside, STAY_INSIDE, passed)]
    short = {row['dive_m']: _later(row) for row in rows if row['hours'] < min(STAYS_H)}
    for row in long:
        dac, error = row['navigation']['dac_error_mps']['worst'], _later(row)
        most = short[row['dive_m']] + STAY_MORE_M
        passed = dac is not None and dac <= STAY_DAC_MPS
        checks.append(Check(f'{row["case"]}: DAC error (m/s)', dac, STAY_DAC_MPS, passed))
        checks.append(Check(f'{row["case"]}: error (m)', error, most, error <= most))
    return checks
