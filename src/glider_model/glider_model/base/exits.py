# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""How a process ends: its exit code, and the last words of a node that gives up."""

import sys

#: The machine or the result is to blame: a full disk, a failed flight, something that differs.
EXIT_FAILED = 1
#: What was asked for cannot be done: an option, a file, a parameter.
EXIT_USAGE = 2
#: A node: a peer is missing, late or wrong.
EXIT_PEER = 3
#: Stopped by SIGINT.
EXIT_INTERRUPTED = 130

#: What the last words of a node begin with, on standard error.
FATAL = 'fatal: '


def say_fatal(reason: object) -> None:
    """Last words of a node."""
    print(f'{FATAL}{reason}', file=sys.stderr, flush=True)
