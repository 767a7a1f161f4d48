# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The matrix of faults: every kind in every phase of a dive, and how each has to end.

And missions in which nothing breaks, of which the guard has nothing to say.
"""

from typing import Any, NamedTuple

from glider_bringup.studies.paper.cases import Case
from glider_bringup.studies.paper.limits import Check
from glider_model.vehicle.file import load_vehicle

PHASES = ('dive', 'turn', 'climb', 'surface')
#: The mission: dives to 300 m, up after each, in 1.0 kn at 12 deg off the path.
MISSION = {'profile.depth_m': 300.0, 'profile.surface_every_dives': 1, 'duration_s': 18000.0}
#: Something breaks from here on, at the first tick of the phase (s).
AT_S = 3000.0
#: Farther below what the hull is rated for nobody comes whom his buoyancy can bring up (m).
BELOW_RATED_M = 20.0
#: Who surfaces for good is shallower than this at the end (m).
SURFACED_M = 5.0


class Fault(NamedTuple):
    """A fault, and the reactions that are right for it."""

    name: str
    fields: dict[str, Any]
    reactions: tuple[str, ...]
    changes: dict[str, Any] = {}
    beside_m: float | None = None  #: at the end, off a path that leads north


_FLIES_ON, _SURFACES = ('none',), ('surface',)
_COPES = ('none', 'surface')  # either it can be flown with, or the vehicle comes up


def _actuator(kind: str, actuator: str, **fields) -> dict[str, Any]:
    return {'kind': kind, 'actuator': actuator, **fields}


def _sensor(kind: str, sensor: str, **fields) -> dict[str, Any]:
    return {'kind': kind, 'sensor': sensor, **fields}


FAULTS = (
    Fault('leak', {'kind': 'leak', 'rate_kgps': 0.001, 'limit_kg': 0.5}, _SURFACES),
    Fault(
        'leak nobody tells',
        {'kind': 'leak', 'rate_kgps': 0.001, 'limit_kg': 0.5, 'detected': False},
        _COPES,
    ),
    Fault(
        'leak beyond the pump',
        {'kind': 'leak', 'rate_kgps': 0.005, 'limit_kg': 1.5, 'detected': False},
        ('drop',),
    ),
    Fault('pump stuck', _actuator('stuck', 'buoyancy_engine'), ('surface', 'drop')),
    Fault(
        'pump stuck for 15 min',
        _actuator('stuck', 'buoyancy_engine', for_s=900.0),
        ('none', 'surface', 'drop'),
    ),
    Fault('pump slow', _actuator('slow', 'buoyancy_engine', rate=0.2), _COPES),
    Fault('pump jams', _actuator('jam', 'buoyancy_engine', period_s=600.0, share=0.5), _COPES),
    Fault(
        'pump reaches half',
        _actuator('partial', 'buoyancy_engine', low=-0.3, high=0.5),
        _COPES,
    ),
    Fault('pitch mass stuck', _actuator('stuck', 'pitch_mass'), _SURFACES),
    Fault('pitch mass off', _actuator('offset', 'pitch_mass', offset=0.1), _FLIES_ON),
    Fault('roll mass stuck', _actuator('stuck', 'roll_mass'), ('none', 'hold')),
    Fault('roll mass loose', {'kind': 'loose_roll_mass'}, ('none', 'hold')),
    Fault('roll mass jams', _actuator('jam', 'roll_mass', period_s=30.0), ('none', 'hold')),
    Fault('depth frozen', _sensor('frozen', 'depth'), _SURFACES),
    Fault('depth spikes', _sensor('spike', 'depth', error=500.0, share=0.01), _FLIES_ON),
    Fault('depth noisy', _sensor('noisier', 'depth', std=0.5), _FLIES_ON),
    Fault('attitude drops out', _sensor('dropout', 'attitude', share=0.5), _FLIES_ON),
    Fault('rates spike', _sensor('spike', 'rates', error=1e4, share=0.01), _FLIES_ON),
    Fault('pitch off', _sensor('biased', 'pitch', error=5.0), _FLIES_ON),
    Fault('compass deviates', {'kind': 'compass', 'deviation_deg': 10.0}, _FLIES_ON),
    Fault('battery', {'kind': 'battery', 'drop_v': 6.0}, _SURFACES),
    Fault('vacuum', {'kind': 'vacuum', 'rate_paps': 100.0}, _SURFACES),
    Fault('no contact', {'kind': 'no_contact'}, _SURFACES, {'guard.contact_s': 6000.0}),
    Fault('drag doubles', {'kind': 'fouling', 'drag': 2.0, 'over_s': 600.0}, _FLIES_ON),
    Fault('0.3 kg heavier', {'kind': 'mass', 'mass_kg': 0.3}, _FLIES_ON),
    Fault('0.3 kg lighter', {'kind': 'mass', 'mass_kg': -0.3}, _FLIES_ON),
    Fault(
        'gust',
        {'kind': 'gust', 'east_mps': 0.8, 'for_s': 1800.0},
        _FLIES_ON,
        beside_m=100.0,
    ),
)


def cases(laws: tuple[str, ...]) -> list[Case]:
    """Every fault in every phase by every law."""
    return [
        Case(
            f'{fault.name}, {phase}',
            law,
            'observer',
            'current_12deg',
            {
                **MISSION,
                **fault.changes,
                'faults': [{**fault.fields, 'at_s': AT_S, 'phase': phase}],
            },
            measures=(),
            facts={
                'fault': fault.name,
                'reactions': list(fault.reactions),
                'beside_m': fault.beside_m,
            },
        )
        for fault in FAULTS
        for phase in PHASES
        for law in laws
    ]


#: Missions in which nothing breaks: scenario, how it navigates, simulated hours of a flight.
CLEAN = (
    ('rough_water', 'known', 30.0),
    ('rough_water', 'dead_reckoned', 30.0),
    ('noisy_sensors', 'known', 30.0),
)
CLEAN_SEEDS = range(6)
LEAST_CLEAN_H = 1000.0


def clean_cases(laws: tuple[str, ...]) -> list[Case]:
    """Missions in which nothing breaks, by seeds."""
    return [
        Case(
            f'{scenario}, position {method.replace("_", " ")}, seed {seed}',
            law,
            'observer',
            scenario,
            {
                'seed': seed,
                'duration_s': 3600.0 * hours,
                'path.length_m': 200000.0,
                'navigation.method': method,
                'profile.surface_every_dives': 1,
            },
            measures=(),
            facts={'hours': hours},
        )
        for scenario, method, hours in CLEAN
        for seed in CLEAN_SEEDS
        for law in laws
    ]


def judge_clean(rows: list[dict]) -> list[Check]:
    """Whether the guard had nothing to say, in hours enough."""
    hours = sum(row['hours'] for row in rows if row['status'] == 'completed')
    told = [
        Check(f'{row["case"]}, {row["controller"]}', event['row'], 'nothing told', False)
        for row in rows
        for event in row['guard']['events']
    ]
    enough = Check(
        'hours flown', f'{hours:,.0f} h', f'{LEAST_CLEAN_H:,.0f} h', hours >= LEAST_CLEAN_H
    )
    return [enough, Check('told by the guard', str(len(told)), '0', not told), *told]


def _faults_of(row: dict, deepest_m: float) -> str:
    """What of a flight is not as it has to be, in words; empty if all is."""
    reaction = row['guard']['reaction']
    if not row['finite']:
        return 'a number is not finite'
    if reaction not in row['reactions']:
        return f'reaction {reaction}'
    if row['faults'][0]['t_s'] is None:
        return 'it did not begin'
    _, east_m, depth_m = row['final_state']['position_ned_m']
    if reaction in ('surface', 'drop') and depth_m > SURFACED_M:
        return f'{depth_m:.0f} m deep at the end'
    if row['depth_m']['max'] > deepest_m:
        return f'{row["depth_m"]["max"]:.0f} m deep'
    if row['beside_m'] is not None and abs(east_m) > row['beside_m']:
        return f'{abs(east_m):.0f} m beside the path at the end'
    return ''


def judge(rows: list[dict]) -> list[Check]:
    """Whether each flight ended as its fault has to end."""
    deepest_m = load_vehicle('zhang2021').rated_depth_m + BELOW_RATED_M
    checks = []
    for row in rows:
        wrong = _faults_of(row, deepest_m)
        what = f'{row["case"]}, {row["controller"]}'
        checks.append(
            Check(what, wrong or 'as it has to', ' or '.join(row['reactions']), not wrong)
        )
    return checks
