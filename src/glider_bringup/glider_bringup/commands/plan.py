# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""``./glider plan``: whether a mission gets there, when, and by what route."""

import json
import math
from pathlib import Path
from typing import Annotated, Any

import typer

from glider_base.frames import to_geodetic
from glider_bringup.console import Changes, Json, Named, changed_fields, counter, print_table
from glider_bringup.showing.words import count, hours_of, span
from glider_mission.chart import place_text
from glider_mission.scenario import DEFAULT_SCENARIO, Scenario, load_scenario
from glider_model.vehicle.file import load_vehicle

app = typer.Typer()


@app.command(epilog='Example: ./glider plan eddies_10d --out plan.png')
def plan(
    scenario: Named = DEFAULT_SCENARIO,
    changes: Changes = None,
    out: Annotated[
        Path | None,
        typer.Option(help='Image file: png, svg or pdf, of route and fronts on the current.'),
    ] = None,
    as_json: Json = False,
) -> None:
    """Plan a mission by its forecast: fronts of earliest arrival, against straight legs.

    Exit code 0, whether it gets there or not.
    """
    from glider_mission.routing.plan import MEMBERS
    from glider_mission.routing.plan import plan as make_plan

    planned = load_scenario(scenario, changed_fields(changes))
    with counter('planning', MEMBERS + 1) as update:
        made = make_plan(planned, update)
    if out:
        from glider_bringup.showing.ocean import draw_plan

        draw_plan(made, planned, out)
    report = _report(made, planned)
    if as_json:
        print(json.dumps(report, allow_nan=False))
    else:
        print_table(f'{planned.name}: {planned.described}', (), _rows(report))


def _report(made: Any, scenario: Scenario) -> dict[str, Any]:
    """What a plan says, for machines."""
    origin = scenario.origin.params()
    corners = [to_geodetic(*map(float, corner), origin) for corner in made.route.corners]
    time_s, surfacings = made.arrival_s(50.0), None
    if math.isfinite(time_s):
        surfacings = math.ceil(time_s / made.pace.cycle_s)
        if not scenario.profile.surface_every_dives:  # it comes up at the end alone
            surfacings = int(scenario.path.at_end == 'stop')
    return {
        'scenario': scenario.name,
        'changed': scenario.changed,
        'reachable': made.reachable,
        'arrival_h': {f'p{p}': hours_of(made.arrival_s(float(p))) for p in (10, 50, 90)},
        'waypoints_h': [hours_of(one) for one in made.waypoints_s],
        'straight_h': hours_of(made.straight_s),
        'mission_h': made.end_s / 3600.0,
        'dives': scenario.dives if made.end_s < scenario.duration_s else None,
        'wh': made.wh,
        'surfacings': surfacings,
        'speed_mps': made.pace.speed,
        'notes': _notes(made, scenario),
        'route_latlon': [list(one) for one in corners],
    }


def _notes(made: Any, scenario: Scenario) -> list[str]:
    """What a plan does not count, and what bottom and battery do not let be."""
    from glider_mission.planned import unballasted
    from glider_mission.routing.plan import bottom_under

    orders, profile = len(scenario.orders), scenario.profile
    notes = scenario.unsteered + unballasted(scenario)
    notes += [f'{count(orders, "order")} of the mission not counted'] if orders else []
    energy = load_vehicle(scenario.vehicle).energy
    if energy and made.wh is not None and made.wh > energy.usable_wh:
        has = f'its battery has {energy.usable_wh:,.0f} Wh to use'
        notes.append(f'{has}: it is sent up on the way')
    if 'fix' in scenario.topics and not profile.surface_every_dives:
        notes.append('no surfacing for a fix: a vehicle that reckons its place is led astray')
    bottom_m = bottom_under(made.route.corners, scenario.bottom())
    if bottom_m <= 0.0:
        notes.append('no way round the land between waypoints is found in its time')
    elif bottom_m <= profile.depth_m and not profile.clearance_m:
        notes.append(f'dives to {profile.depth_m:,.0f} m touch a bottom at {bottom_m:,.0f} m')
    elif profile.clearance_m and bottom_m <= profile.clearance_m + profile.top_depth_m:
        notes.append(f'no dives where the bottom is {bottom_m:,.0f} m deep, for its clearance')
    return notes


def _rows(report: dict[str, Any]) -> list[tuple[str, str]]:
    """The same for a person."""

    def when(hours: float | None) -> str:
        return 'not in its time' if hours is None else span(3600.0 * hours)

    arrival = report['arrival_h']
    bands = when(arrival['p50'])
    if len(set(arrival.values())) > 1:
        bands += f' (p10 {when(arrival["p10"])}, p90 {when(arrival["p90"])})'
    its_time = span(3600.0 * report['mission_h'])
    if report['dives']:
        its_time = f'its {report["dives"]} dive{"s" * (report["dives"] != 1)}, {its_time}'
    reach = 'yes' if report['reachable'] else f'not in {its_time}'
    rows = [
        ('reachable', reach),
        ('arrival, planned', bands),
        ('arrival, straight legs', when(report['straight_h'])),
        ('energy', '-' if report['wh'] is None else f'{report["wh"]:.0f} Wh'),
        ('surfacings', '-' if report['surfacings'] is None else str(report['surfacings'])),
        ('through the water', f'{report["speed_mps"]:.3f} m/s, surface intervals included'),
    ]
    rows += [('note', note) for note in report['notes']]
    rows += [
        (f'corner {number}' if number else 'start', place_text(*place))
        for number, place in enumerate(report['route_latlon'])
    ]
    return rows
