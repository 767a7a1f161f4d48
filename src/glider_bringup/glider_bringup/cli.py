# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The command line: ``./glider COMMAND``, or ``glider COMMAND`` in a sourced workspace."""

import sys

import typer

from glider_bringup.commands import (
    fuzz,
    recorded,
    replay,
    report,
    run,
    studies,
    sweeps,
    vehicles,
    verify,
)
from glider_bringup.console import EXIT_USAGE, messages
from glider_model.settings import ConfigurationError

app = typer.Typer(
    name='glider',
    help='Underwater gliders: simulate, guide, control, record.',
    epilog='Example: ./glider run current_8deg --controller pid',
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={'help_option_names': ['-h', '--help']},
)
# Commands in the order in which --help lists them.
for _module in (run, studies, sweeps, recorded, report, replay, verify, fuzz, vehicles):
    app.add_typer(_module.app)


def main() -> int:
    """Run the command line; mistakes of the user become one message and exit code 2."""
    try:
        app(prog_name='./glider')
    except ConfigurationError as error:
        for line in str(error).splitlines():
            messages.print(line, style='red', soft_wrap=True)
        return EXIT_USAGE
    return 0


if __name__ == '__main__':
    sys.exit(main())
