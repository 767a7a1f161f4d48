# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""``./glider bounds``: what is certified of the steering of a vehicle, beside simulations."""

import json
from functools import partial
from typing import Annotated, Any

import typer

from glider_base.errors import EXIT_FAILED
from glider_base.kernel import compiling_told
from glider_bringup.console import (
    Json,
    compiling,
    counter,
    interrupted_told,
    messages,
    output,
    print_table,
)

app = typer.Typer()


@app.command(epilog='Example: ./glider bounds zhang2021 --starts 200')
def bounds(
    vehicle: Annotated[str, typer.Argument(help='Vehicle by name or path of its YAML file.')],
    starts: Annotated[
        int,
        typer.Option(
            min=0, max=100_000, help='Simulations from inside the region, for dive and climb each.'
        ),
    ] = 200,
    seed: Annotated[
        int, typer.Option(min=0, max=2**62, help='Start i is drawn from seed and i.')
    ] = 0,
    as_json: Json = False,
) -> None:
    """Certify how far errors move a vehicle off its path, and compare with simulations.

    In a steady glide of dive and climb the loop of cross-track and heading is taken from the
    kernels of law and guidance. One quadratic function for all b / b_hat and k / k_hat of a box
    gives gains from errors to the cross-track error. It also gives a region from which the
    vehicle comes back to the path, even if filters and roll saturate. Eigenvalues verify both.
    Then the whole stack is simulated from random starts in the region, and in a current that
    jumps. Exit code 1 if something does not hold. docs/theory.md lists the assumptions.
    """
    from glider_studies.bounds import study

    line = 'compiling the mathematics of law and guidance, once; up to half a minute'
    with (
        interrupted_told(),
        compiling_told(partial(compiling, line)),
        counter('simulating', study.flights(starts)) as update,
    ):
        found = study.bounds(vehicle, starts, seed, update)
    if as_json:
        print(json.dumps(found))
    else:
        _print(found)
    if not found['holds']:
        raise typer.Exit(EXIT_FAILED)


def _print(found: dict[str, Any]) -> None:
    """Print bounds for a person."""
    phases = found['phases'].values()
    rows = [[label, *(show(phase) for phase in phases)] for label, show in _ROWS]
    low, high = found['box']
    print_table(
        f'{found["vehicle"]}: b / b_hat and k / k_hat between {low} and {high}',
        ['', *found['phases']],
        [row for row in rows if any(text != '-' for text in row[1:])],
    )
    for name, phase in found['phases'].items():
        for line in phase['failed']:
            messages.print(f'{name}: {line}', style='red')
    if found['holds']:
        output.print('all of it holds')


def _of(group: str, key: str, form: str = '{:,.3g}', factor: float = 1.0):
    """Text of a number of a phase; a dash where there is none."""

    def show(phase: dict[str, Any]) -> str:
        value = (phase[group] or {}).get(key)
        return '-' if value is None else form.format(factor * value)

    return show


def _gain(name: str, key: str = 'm_per_unit'):
    def show(phase: dict[str, Any]) -> str:
        one = phase['gains'][name]
        return f'{one[key]:,.3g}' if one else 'none found'

    return show


def _ratio(phase: dict[str, Any]) -> str:
    loop = phase['loop']
    if loop['b_of_trim_radps'] is None:
        return '-'
    return f'{loop["b_of_trim_radps"] / loop["b_radps"]:.2f}'


def _yaw(phase: dict[str, Any]) -> str:
    loop = phase['loop']
    if not loop['k']:
        return '-'
    return f'{loop["k"]:.3f}, {"adverse" if loop["is_adverse"] else "proverse"}'


def _home(phase: dict[str, Any]) -> str:
    starts = phase['starts']
    return f'{starts["home"]} of {starts["starts"]}' if starts else '-'


_ROWS = (
    (
        'speed, horizontal speed (m/s)',
        lambda x: f'{x["loop"]["speed_mps"]:.3f}, {x["loop"]["horizontal_mps"]:.3f}',
    ),
    ('b, learnt (rad/s)', _of('loop', 'b_radps', '{:.4f}')),
    ('b by ./glider trim over that', _ratio),
    ('k', _yaw),
    ('n, speed exponent', _of('loop', 'speed_exponent', '{:.2f}')),
    ('|z| = |b / k| (rad/s)', _of('loop', 'zero_radps')),
    ('heading bandwidth a (rad/s)', _of('loop', 'bandwidth_radps')),
    ('lookahead T (s)', _of('loop', 'lookahead_s', '{:.0f}')),
    (
        '1 / a, heading and roll filter (s)',
        lambda x: ', '.join(
            f'{one:.0f}'
            for one in (
                1.0 / x['loop']['bandwidth_radps'],
                x['loop']['heading_filter_s'],
                x['loop']['roll_filter_s'],
            )
            if one
        ),
    ),
    ('slowest of the box (s)', _of('loop', 'slowest_s', '{:.0f}')),
    ('max |S| over the box', _of('loop', 'sensitivity', '{:.2f}')),
    ('|z| T_leg', _of('loop', 'zero_times_leg', '{:,.0f}')),
    ('certified: m per m/s of current error', _gain('current')),
    ('  no less is true than', _gain('current', 'at_least')),
    ('  up to (m/s)', _gain('current', 'holds_to')),
    ('certified: m per rad/s of turn rate', _gain('turn rate')),
    ('  no less is true than', _gain('turn rate', 'at_least')),
    ('  up to (rad/s)', _gain('turn rate', 'holds_to')),
    ('certified: m per rad of roll or fin', _gain('roll')),
    ('  no less is true than', _gain('roll', 'at_least')),
    ('  up to (rad)', _gain('roll', 'holds_to')),
    ('region: cross-track (m)', _of('region', 'aside_m', '{:.1f}')),
    ('region: heading (deg)', _of('region', 'turned_deg', '{:.1f}')),
    ('  no further than (m)', _of('region', 'widest_m', '{:.1f}')),
    ('simulated: came home', _home),
    ('simulated: largest error (m)', _of('starts', 'largest_m', '{:.1f}')),
    ('  over its bound', _of('starts', 'of_bound', '{:.2f}')),
    ('simulated: m per m/s of current error', _of('jumps', 'gain')),
    ('  over its bound', _of('jumps', 'of_bound', '{:.2f}')),
)
