# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A command as a person gives it, for the tests of all packages."""

import os
import subprocess
import sys


def glider(*arguments, columns=160, timeout=300.0, preexec_fn=None, **variables):
    """Finished process of a command, with its output as text.

    Parameters
    ----------
    arguments : object
        Words of the command line.
    columns : int
        Width of the terminal.
    timeout : float
        Longer than the command takes (s).
    preexec_fn : callable, optional
        Called in the process before the command.
    variables : str
        Of its environment, beside those of this process.
    """
    return subprocess.run(
        [sys.executable, '-m', 'glider_bringup.cli', *map(str, arguments)],
        capture_output=True,
        text=True,
        env={**os.environ, 'COLUMNS': str(columns), 'PYTHONUTF8': '1', **variables},
        timeout=timeout,
        check=False,
        preexec_fn=preexec_fn,
    )
