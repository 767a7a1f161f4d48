# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""``./glider report``: a run as a web page."""

import webbrowser
from pathlib import Path
from typing import Annotated

import typer

from glider_bringup.console import Json, Run, beside, counter, messages, print_written
from glider_bringup.showing.scorecard import print_status

app = typer.Typer()


@app.command(epilog='Example: ./glider report runs/20260101-120000-current_8deg --open')
def report(
    run: Run,
    show: Annotated[bool, typer.Option('--open', help='Show it in the browser.')] = False,
    out: Annotated[
        Path | None, typer.Option(metavar='FILE', help='Default: report.html beside the bag.')
    ] = None,
    as_json: Json = False,
) -> None:
    """Write the report of a run again: one HTML file that needs no network."""
    from glider_bringup.showing.flown_run import read_run
    from glider_bringup.showing.report import report_page
    from glider_mission.disk import write_whole
    from glider_mission.run_folder import REPORT_FILE

    file = out or beside(run, REPORT_FILE)
    with counter('reading the bag', None) as update:
        flown = read_run(run, update)
    with messages.status('writing the report'):
        write_whole(file, report_page(flown))
    if not as_json:
        print_status(flown.card)
    print_written('report', run, file, as_json)
    if show and not webbrowser.open(file.resolve().as_uri()):
        messages.print(f'no browser found; open {file} in one', style='red', soft_wrap=True)
