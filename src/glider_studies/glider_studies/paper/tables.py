# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The experiments' results as tables for a person."""

import math
from collections.abc import Callable
from typing import Any

from rich.console import Console
from rich.table import Table

from glider_studies.paper.experiments import PASSED, by_case, compared, described, is_better
from glider_studies.paper.judges import figure_of

#: Failed checks that are listed; of more only the number is shown.
LISTED = 12
#: Marks a figure in which another law is better than the adaptive law.
BETTER = '*'
#: Largest steady cross-track error (m).
STEADY = 'cross_track_m.max_steady'
LAW_NAMES = {'adaptive': 'adaptive', 'backstepping': "paper's law", 'pid': 'tuned PID'}


def _number(value: float | str | None, digits: int = 2) -> str:
    if value is None:
        return '-'
    if isinstance(value, str):
        return value
    return f'{value:,.{digits if abs(value) < 100.0 else 0}f}'


def _table(names: list[str], figures: list[str]) -> Table:
    """Empty table with columns of text and columns of figures."""
    table = Table()
    for name in names:
        table.add_column(name, overflow='fold')
    for name in figures:
        table.add_column(name, justify='right')
    return table


def _by_flight(rows: list[dict], said: dict[str, Any]) -> Table:
    """One line for each flight, or row of a study, and figures by dotted name."""
    figures = said.get('figures') or compared(rows)
    texts = said.get('texts')
    if texts is None:
        columns = (
            ('case', 'case', any(row['case'] for row in rows)),
            ('controller', 'flown by', True),
            ('guidance', 'LOS', len({row['guidance'] for row in rows}) > 1),
            ('status', 'status', any(row['status'] != 'completed' for row in rows)),
        )
        texts = {field: name for field, name, is_shown in columns if is_shown}
    table = _table(list(texts.values()), list(figures.values()))
    adaptive = by_case(rows, 'adaptive')
    for row in rows:
        rival = adaptive.get((row.get('case'), row.get('guidance')))
        named = (LAW_NAMES.get(row[field], str(row[field])) for field in texts)
        table.add_row(*named, *(_marked(row, rival, name, said) for name in figures))
    return table


def _marked(row: dict | None, rival: dict | None, name: str, said: dict[str, Any]) -> str:
    """Figure of a row, marked if it is of another law and better than that of its rival."""
    if row is None:
        return '-'
    value = figure_of(row, name)
    marked = (
        rival is not None
        and row['controller'] != 'adaptive'
        and name in compared([row])
        and is_better(value, figure_of(rival, name))
    )
    return _number(value, said.get('digits', 2)) + (BETTER if marked else '')


def _side_by_side(rows: list[dict], said: dict[str, Any]) -> Table:
    """One line for each case; in every column adaptive | tuned PID."""
    figures = dict(list(compared(rows).items())[:5])
    table = _table(['adaptive | tuned PID'], list(figures.values()))
    ours, theirs = (by_case(rows, law) for law in ('adaptive', 'pid'))
    for case in dict.fromkeys((row['case'], row['guidance']) for row in rows):
        one, other = ours.get(case), theirs.get(case)
        cells = (
            f'{_marked(one, None, name, said)} | {_marked(other, one, name, said)}'
            for name in figures
        )
        table.add_row(case[0], *cells)
    return table


def _steering(rows: list[dict]) -> list[str]:
    """How vehicles whose steering is changed steer, relative to what their file says."""
    return [
        f'{row["case"]}: turn rate per roll x{row["steering"]["dive"]:.2f} in the dive, '
        f'x{row["steering"]["climb"]:.2f} in the climb (K_MY x{row["changes"]["perturb.K_MY"]:g})'
        for row in rows
        if 'steering' in row and row['controller'] == 'adaptive'
    ]


def _survey(rows: list[dict], said: dict[str, Any]) -> Table:
    """Closest pass of each waypoint, and the heading in each leg."""
    legs = max((row['legs'] for row in rows), key=len)
    table = _table(['', *(LAW_NAMES[row['controller']] for row in rows)], [])
    for i in range(len(rows[0]['waypoints_closest_m'])):
        passes = (f'{row["waypoints_closest_m"][i]:.2f} m' for row in rows)
        table.add_row(f'waypoint {i}, closest pass', *passes)
    for i, leg in enumerate(legs):
        spreads = (
            f'{row["legs"][i]["heading_spread_deg"]:.1f} deg' if i < len(row['legs']) else '-'
            for row in rows
        )
        table.add_row(f'leg on course {leg["course_deg"]:.0f} deg, spread of heading', *spreads)
    return table


def _envelope(rows: list[dict], said: dict[str, Any]) -> Table:
    """Largest error by speed and angle of the current; beyond the limit what was flagged."""
    speeds = sorted({row['speed_kn'] for row in rows})
    table = _table(['angle'], [f'{speed:g} kn' for speed in speeds])
    at = {(row['speed_kn'], row['angle_deg']): row for row in rows}
    for angle in sorted({row['angle_deg'] for row in rows}):
        cells = (
            'x' if row['status'] == 'infeasible' else _number(row['cross_track_m']['max_all'], 1)
            for row in (at[speed, angle] for speed in speeds)
        )
        table.add_row(f'{angle:g} deg', *cells)
    return table


def _ablation(rows: list[dict], said: dict[str, Any]) -> Table:
    """What each piece was built for, with it and without; and where it is missed most, steady."""
    table = _table(['off', 'built for'], ['whole', 'without', 'missed most', 'whole', 'without'])
    by_name = {row['case']: row for row in rows}
    places = dict.fromkeys(row['case'].partition(', ')[0] for row in rows)

    def figures(place: str, piece: str, name: str = STEADY) -> list[float | None]:
        return [figure_of(by_name[f'{place}, {one}'], name) for one in ('whole', piece)]

    for row in rows:
        where, _, piece = row['case'].partition(', ')
        place, name = row.get('built_for', ('', ''))
        if place == where:
            steady = {one: figures(one, piece) for one in places}
            times = {
                one: (without or math.inf) / whole if whole else 0.0
                for one, (whole, without) in steady.items()
            }
            most = max(places, key=times.get)
            built_for = f'{where}: {name.replace(".", ", ").replace("_", " ")}'
            both = (figures(where, piece, name), steady[most])
            first, second = ([*map(_number, pair)] for pair in both)
            table.add_row(piece, built_for, *first, most, *second)
    return table


_TABLES: dict[str, Callable[[list[dict], dict[str, Any]], Table]] = {
    'side_by_side': _side_by_side,
    'survey': _survey,
    'ablation': _ablation,
    'envelope': _envelope,
}


def show(result: dict[str, Any], output: Console) -> None:
    """Print experiment by experiment: the paper's figure, ours, verdict."""
    for one in result['experiments']:
        said = described(one['name'])
        head = f'{one["section"]}: {one["title"]}' if one['section'] else one['title']
        head += '' if one['paper'] == '-' else f'\npaper: {one["paper"]}'
        output.print(f'\n{head}', soft_wrap=True)
        if 'counts' in one:
            _show_search(one, output)
        else:
            table = _TABLES.get(said.get('table'), _by_flight)(one['rows'], said)
            output.print(table)
            if any(BETTER in cell for column in table.columns for cell in column.cells):
                output.print(f'{BETTER} better than the adaptive law')
        for line in _steering(one['rows']):
            output.print(line)
        if 'remark' in said:
            output.print(said['remark'])
        _show_verdict(one, output)
    verdicts = [one['verdict'] for one in result['experiments']]
    output.print(f'\n{verdicts.count(PASSED)} of {len(verdicts)} experiments passed')


def _show_search(one: dict[str, Any], output: Console) -> None:
    """Print what random faults did, and the lines that fly it again."""
    counts = one['counts']
    counted = ', '.join(f'{name.replace("_", " ")} {number:,}' for name, number in counts.items())
    output.print(counted, soft_wrap=True)
    for row in one['rows'][:LISTED]:
        output.print(f'flight {row["flight"]}: {row["kind"]}: {row["why"]}', soft_wrap=True)
        output.print(f'  {row["command"]}', soft_wrap=True)
    if len(one['rows']) > LISTED:
        output.print(f'and {len(one["rows"]) - LISTED} more')


def _show_verdict(one: dict[str, Any], output: Console) -> None:
    """Print the verdict, and the checks that failed."""
    failed = [check for check in one['checks'] if not check['passed']]
    count, style = len(one['checks']), 'green' if one['verdict'] == PASSED else 'red'
    output.print(
        f'verdict: {one["verdict"]} ({count - len(failed)} of {count} checks)', style=style
    )
    for check in failed[:LISTED]:
        value, limit = _number(check['value'], 3), _number(check['limit'], 3)
        output.print(f'  {check["what"]} = {value}, allowed {limit}', soft_wrap=True)
    if len(failed) > LISTED:
        output.print(f'  and {len(failed) - LISTED} more')
