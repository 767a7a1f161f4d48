# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""``./glider bounds``: what is certified of the steering of a vehicle, beside simulations."""

import json
from collections.abc import Callable
from functools import partial
from typing import Annotated, Any

import typer

from glider_base.errors import EXIT_FAILED
from glider_base.kernel import on_compiling
from glider_bringup.console import (
    Json,
    compiling,
    counter,
    interrupt_shown,
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
        interrupt_shown(),
        on_compiling(partial(compiling, line)),
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
    rows = [[label, *(_text(form, phase) for phase in phases)] for label, form in _ROWS]
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


def _text(form: str | Callable[[dict], str], phase: dict[str, Any]) -> str:
    """Text of a row in a phase; a dash where there is none of its numbers."""
    try:
        return form(phase) if callable(form) else form.format_map(phase)
    except TypeError:  # of None
        return 'none found' if 'm_per_unit' in form else '-'


def _ratio(phase: dict[str, Any]) -> str:
    return f'{phase["loop"]["b_of_trim_radps"] / phase["loop"]["b_radps"]:.2f}'


def _yaw(phase: dict[str, Any]) -> str:
    loop = phase['loop']
    return (
        f'{loop["k"]:.3f}, {"adverse" if loop["is_adverse"] else "proverse"}' if loop['k'] else '-'
    )


def _filters(phase: dict[str, Any]) -> str:
    loop = phase['loop']
    times_s = 1.0 / loop['bandwidth_radps'], loop['heading_filter_s'], loop['roll_filter_s']
    return ', '.join(f'{one:.0f}' for one in times_s if one)


_ROWS = (
    ('speed, horizontal speed (m/s)', '{loop[speed_mps]:.3f}, {loop[horizontal_mps]:.3f}'),
    ('b, learnt (rad/s)', '{loop[b_radps]:.4f}'),
    ('b by ./glider trim over that', _ratio),
    ('k', _yaw),
    ('n, speed exponent', '{loop[speed_exponent]:.2f}'),
    ('|z| = |b / k| (rad/s)', '{loop[zero_radps]:,.3g}'),
    ('heading bandwidth a (rad/s)', '{loop[bandwidth_radps]:,.3g}'),
    ('lookahead T (s)', '{loop[lookahead_s]:.0f}'),
    ('1 / a, heading and roll filter (s)', _filters),
    ('slowest of the box (s)', '{loop[slowest_s]:.0f}'),
    ('max |S| over the box', '{loop[sensitivity]:.2f}'),
    ('|z| T_leg', '{loop[zero_times_leg]:,.0f}'),
    ('certified: m per m/s of current error', '{gains[current][m_per_unit]:,.3g}'),
    ('  no less is true than', '{gains[current][at_least]:,.3g}'),
    ('  up to (m/s)', '{gains[current][holds_to]:,.3g}'),
    ('certified: m per rad/s of turn rate', '{gains[turn rate][m_per_unit]:,.3g}'),
    ('  no less is true than', '{gains[turn rate][at_least]:,.3g}'),
    ('  up to (rad/s)', '{gains[turn rate][holds_to]:,.3g}'),
    ('certified: m per rad of roll or fin', '{gains[roll][m_per_unit]:,.3g}'),
    ('  no less is true than', '{gains[roll][at_least]:,.3g}'),
    ('  up to (rad)', '{gains[roll][holds_to]:,.3g}'),
    ('region: cross-track (m)', '{region[aside_m]:.1f}'),
    ('region: heading (deg)', '{region[turned_deg]:.1f}'),
    ('  no further than (m)', '{region[widest_m]:.1f}'),
    ('simulated: came home', '{starts[home]} of {starts[starts]}'),
    ('simulated: largest error (m)', '{starts[largest_m]:.1f}'),
    ('  over its bound', '{starts[of_bound]:.2f}'),
    ('simulated: m per m/s of current error', '{jumps[gain]:,.3g}'),
    ('  over its bound', '{jumps[of_bound]:.2f}'),
)
