# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A command as a person gives it, for the tests of all packages."""

import atexit
import multiprocessing
import os
import runpy
import signal
import subprocess
import sys
import tempfile
from functools import cache
from multiprocessing import forkserver
from pathlib import Path

#: A command whose process needs nothing of its own is forked from one that has loaded what takes
#: longest: Python, the stack, and the loops of a flight.
LOADED = 'loaded_stack'


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
        Called in the process before the command; can be pickled.
    variables : str
        Of its environment, beside those of this process; with another PYTHONPATH it is not forked.
    """
    words = list(map(str, arguments))
    env = {name: value for name, value in os.environ.items() if name != 'ROS_DOMAIN_ID'}
    env |= {'COLUMNS': str(columns), 'PYTHONUTF8': '1', **variables}
    if 'PYTHONPATH' not in variables:
        return _forked(words, env, timeout, preexec_fn)
    return subprocess.run(
        [sys.executable, '-m', 'glider_bringup.cli', *words],
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        env=env,
        timeout=timeout,
        check=False,
    )


@cache
def forks():
    """Context of processes that are forked, its server running."""
    context = multiprocessing.get_context('forkserver')
    context.set_forkserver_preload([LOADED])
    before = os.environ.get('PYTHONPATH', '')
    os.environ['PYTHONPATH'] = os.pathsep.join([str(Path(__file__).parent), before])
    forkserver.ensure_running()
    os.environ['PYTHONPATH'] = before
    return context


def _forked(words, env, timeout, preexec_fn):
    """Finished process of a command, forked."""
    with tempfile.TemporaryDirectory() as folder:
        process = Started(words, env, folder, preexec_fn=preexec_fn)
        try:
            out, err = process.communicate(timeout)
        finally:
            process.kill()
    return subprocess.CompletedProcess(words, process.returncode, out, err)


class Started:
    """A command that is forked and runs: what tests use of `subprocess.Popen`.

    Parameters
    ----------
    words : list of str
        Of the command line.
    env : dict
        Environment.
    folder : path
        Gets standard output and standard error as files, ``stdout`` and ``stderr``.
    module : str
        What is run.
    preexec_fn : callable, optional
        Called in the process before the command; can be pickled.
    """

    def __init__(self, words, env, folder, module='glider_bringup.cli', preexec_fn=None) -> None:
        self._files = [Path(folder) / name for name in ('stdout', 'stderr')]
        how = list(map(str, words)), env, os.getcwd(), self._files, module, preexec_fn
        self._process = forks().Process(target=_become, args=how)
        self._process.start()
        self.pid = self._process.pid

    @property
    def returncode(self) -> int | None:
        """Exit code, negative for a signal; None while it runs."""
        return self._process.exitcode

    def poll(self) -> int | None:
        """The same."""
        return self.returncode

    def communicate(self, timeout: float | None = None) -> tuple[str, str]:
        """Standard output and standard error, once it has ended."""
        self.wait(timeout)
        return tuple(file.read_text(encoding='utf-8') for file in self._files)

    def wait(self, timeout: float | None = None) -> int:
        """Exit code, once it has ended."""
        self._process.join(timeout)
        if self.poll() is None:
            raise subprocess.TimeoutExpired('glider', timeout)
        return self.poll()

    def send_signal(self, number: int) -> None:
        """Send a signal, unless it has ended."""
        if self.poll() is None:
            os.kill(self.pid, number)

    def kill(self) -> None:
        """End it and wait for that."""
        self.send_signal(signal.SIGKILL)
        self._process.join()


def _become(words, env, folder, files, module, preexec_fn):
    """Turn this process into a command that writes to two files."""
    os.environ.clear()
    os.environ.update(env)
    os.chdir(folder)
    for number, file in enumerate([os.devnull, *files]):
        opened = os.open(file, os.O_RDWR | os.O_CREAT)
        os.dup2(opened, number)
        os.close(opened)
    sys.stdin, sys.stdout = open(0), open(1, 'w', encoding='utf-8')
    sys.stderr = open(2, 'w', encoding='utf-8', errors='backslashreplace', buffering=1)
    sys.argv = ['glider', *words]
    if preexec_fn:
        preexec_fn()
    try:
        runpy.run_module(module, run_name='__main__', alter_sys=True)
    finally:
        atexit._run_exitfuncs()
