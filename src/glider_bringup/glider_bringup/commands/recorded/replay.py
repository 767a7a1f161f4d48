# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""``./glider replay``."""

import json
from typing import Annotated

import typer

from glider_bringup.console import (
    REMAINING,
    STATE,
    Json,
    Run,
    interrupt_shown,
    output,
    progress_bar,
    tell,
)
from glider_mission.choices import number

app = typer.Typer()


@app.command(epilog='Example: ./glider replay runs/20260101-120000-current_8deg --rate 20')
def replay(
    run: Run,
    rate: Annotated[
        str, typer.Option(metavar='X|max', help='Times the speed of the recording.')
    ] = '1',
    topics: Annotated[
        list[str] | None,
        typer.Option(
            metavar='NAME,...',
            help='Topics, by name or as in the namespace; /clock always comes. Default: all.',
        ),
    ] = None,
    start: Annotated[
        float, typer.Option(min=0.0, metavar='S', help='Begin this far into the recording (s).')
    ] = 0.0,
    duration: Annotated[
        float | None, typer.Option(min=0.0, metavar='S', help='Recorded time to replay (s).')
    ] = None,
    loop: Annotated[
        bool, typer.Option('--loop', help='Begin again at the end, until Ctrl-C; time jumps back.')
    ] = False,
    namespace: Annotated[
        str | None, typer.Option(help="Namespace of the nodes' topics, instead of the recorded.")
    ] = None,
    wait_for: Annotated[
        int,
        typer.Option(min=0, metavar='N', help='Begin when every topic has this many subscribers.'),
    ] = 0,
    as_json: Json = False,
) -> None:
    """Publish a recording: the same bytes and stamps, with their quality of service and /clock."""
    from glider_mission.recording.mcap_reader import Bag
    from glider_mission.recording.ros import republish as work

    factor = float('inf') if rate == 'max' else number('--rate ', rate, 'max', 0.001, 1e6)
    names = [name for text in topics or () for name in text.split(',') if name]
    bag = Bag(run)
    plan = work.plan_replay(bag, names, start, duration, namespace)
    if bag.cut:
        tell(bag.cut)
    span_s = (plan.end_ns - plan.start_ns) / 1e9
    bar = progress_bar('replaying', max(span_s, 1e-9), STATE, REMAINING)
    with interrupt_shown(), work.replay(plan, factor) as player, bar as show:

        def update(passed_s: float) -> None:
            show(completed=passed_s, state=f'{passed_s:,.1f} of {span_s:,.1f} s')

        player.wait_for(wait_for, tell)
        played = player.run(update)
        while loop:
            played = player.run(update)
    if as_json:
        print(json.dumps({'run': str(run), 'recorded_s': span_s, **played}))
    else:
        count = sum(played['counts'].values())
        output.print(f'{count:,} messages, {span_s:,.1f} s in {played["wall_s"]:,.1f} s')
