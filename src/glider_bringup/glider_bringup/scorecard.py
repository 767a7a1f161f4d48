# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The scorecard of a run, as a person reads it."""

from pathlib import Path

from rich.table import Table

from glider_bringup.console import output


def print_card(card: dict, folder: Path) -> None:
    """Print the scorecard for a person."""

    def show(value, unit: str, digits: int = 2) -> str:
        return '-' if value is None else f'{value:,.{digits}f} {unit}'

    track, pitch = card['cross_track_m'], card['pitch_error_deg']
    heading, depth = card['heading_fluctuation_deg'], card['depth_m']
    travel = card['actuator_travel']
    rows = (
        ('status', card['status'] + (f' ({card["reason"]})' if card['reason'] else '')),
        ('flown', f'{card["vehicle"]}, {card["controller"]}, LOS {card["guidance"]}'),
        ('engine', f'{card["engine"] or "not known"}, seed {card["seed"]}'),
        ('simulated time', show(card['sim_time_s'], 's', 1)),
        ('real-time factor', show(card['real_time_factor'], '', 0)),
        (
            'messages',
            f'{card["messages_recorded"]:,} recorded, {card["messages_lost"]} lost',
        ),
        ('dives', str(card['dives'])),
        ('along path', show(card['distance_along_path_m'], 'm', 0)),
        ('cross-track, steady', f'rms {show(track["rms_steady"], "m", 3)}, max '
         f'{show(track["max_steady"], "m", 3)}'),
        ('cross-track, all', f'max {show(track["max_all"], "m")}'),
        ('pitch error, steady', f'rms {show(pitch["rms_steady"], "deg", 3)}, max '
         f'{show(pitch["max_steady"], "deg", 3)}'),
        ('heading fluctuation', f'rms {show(heading["rms_steady"], "deg", 3)}, max '
         f'{show(heading["max_steady"], "deg", 3)}'),
        ('depth', f'max {show(depth["max"], "m", 1)}, overshoot '
         f'{show(depth["overshoot"], "m", 1)}'),
        ('actuator travel', f'pump {show(travel["buoyancy_engine_kg"], "kg", 1)}, pitch mass '
         f'{show(travel["pitch_mass_m"], "m")}, roll mass '
         f'{show(travel["roll_mass_deg"], "deg", 0)}'),
    )  # fmt: skip
    table = Table(title=card['scenario'], show_header=False, title_justify='left')
    for name, text in rows:
        table.add_row(name, text)
    output.print(table)
    output.print(f'run folder: {folder}', soft_wrap=True)
