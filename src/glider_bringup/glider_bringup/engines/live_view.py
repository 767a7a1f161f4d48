# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The live view of a run: a process beside those that fly, which none of them waits for."""

import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

from glider_base.errors import FATAL
from glider_base.ros.places import NAMESPACE, QUIET, domain_id
from glider_base.settings import ConfigurationError
from glider_bringup.engines.processes import OWN_CLOCK

#: The view has this long (s) to leave.
_LEAVE_S = 3.0
_READY = 'ready '


@contextmanager
def live_view(port: int, namespace: str | None = None) -> Iterator[tuple[str, Callable[[], None]]]:
    """Serve a run that is about to fly; everything that is started inside shares its ROS domain.

    Nodes in a namespace have their clock in it too. Yields the address that opens the view in
    Foxglove, and what is to be called once the run has begun: it subscribes only then, so that
    nobody takes it for one of the peers that they wait for. Raises ConfigurationError if the port
    cannot be used, or the server is not installed.
    """
    with domain_id() as domain, _in_domain(domain):
        ros = ['--ros-args', QUIET, '-r', f'__ns:={namespace or NAMESPACE}']
        ros += ['-p', f'port:={port}', '-p', 'led:=true']
        if namespace:
            ros += ['-r', ':='.join(OWN_CLOCK)]
        process = subprocess.Popen(
            [sys.executable, '-m', 'glider_bringup.nodes.viewer_node', *ros],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        try:
            address = process.stdout.readline()
            if not address.startswith(_READY):
                _, said = process.communicate(timeout=_LEAVE_S)
                lines = said.strip().splitlines() or [f'it ended with {process.returncode}']
                raise ConfigurationError(f'--view: {lines[-1].removeprefix(FATAL)}')
            yield address.removeprefix(_READY).strip(), lambda: _begin(process)
        finally:
            try:
                process.communicate(timeout=_LEAVE_S)
            except subprocess.TimeoutExpired:
                process.kill()
                process.communicate()


def _begin(process: subprocess.Popen) -> None:
    """Let the view look at the topics; it may be gone, which is no reason to end a flight."""
    with suppress(OSError):
        process.stdin.write('look\n')
        process.stdin.flush()


@contextmanager
def _in_domain(domain: int) -> Iterator[None]:
    """Let processes that are started inside join a ROS domain."""
    names = {'ROS_DOMAIN_ID': str(domain), 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'}
    before = {name: os.environ.get(name) for name in names}
    os.environ.update(names)
    try:
        yield
    finally:
        for name, value in before.items():
            os.environ.pop(name)
            if value is not None:
                os.environ[name] = value
