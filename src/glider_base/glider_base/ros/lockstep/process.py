# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The life of a node process: how it starts, spins, stops and leaves, and its exit codes."""

import gc
import os
import re
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import rclpy
from rclpy.exceptions import ParameterException
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions, get_current_signal_handlers_options

from glider_base.errors import EXIT_USAGE, leave, say_fatal
from glider_base.ros.lockstep.executor import TickExecutor
from glider_base.ros.parameters import refuse_unknown
from glider_base.settings import ConfigurationError

#: Middleware forgets messages of a node that is gone: leave them this time (s) to arrive, and to
#: be sent again if need be. A node sent away by a signal leaves others behind that may lag more.
_LINGER_S, _LINGER_SENT_AWAY_S = 0.3, 1.0
#: Where Fast DDS looks for its settings, and ours.
_FASTDDS, _PROFILES = 'FASTRTPS_DEFAULT_PROFILES_FILE', Path(__file__).with_name('fastdds.xml')
#: A parameter of one node: ``control_node:law:=pid``.
_OF_NODE = re.compile(r'(\w+):(\w[^:=]*):=(.*)', re.DOTALL)


class Stop(Exception):  # noqa: N818
    """Ends the node with an exit code; any code but 0 comes with a message for the person."""

    def __init__(self, code: int, message: str = '') -> None:
        super().__init__(message)
        self.code = code


def entry(node_type: Callable[[], Node]) -> Callable[..., int]:
    """What runs a node as a process and returns its exit code; see `run_together`."""
    return lambda args=None: run_together([node_type], args)


def run_together(node_types: Sequence[Callable[[], Node]], args=None) -> int:
    """Life of a process: init, nodes, spin, clean end. The first node to stop ends them all.

    ``node_types`` make the nodes, in the order in which they act in a tick; ``args`` are the
    command line, by default that of the process. Returns the exit code: 0 at the end of the run
    and for SIGINT and SIGTERM, 1 for a full disk or in lockstep a law that raises, 2 for a bad
    parameter, 3 for a peer that is missing, late or wrong.
    """
    os.environ.setdefault(_FASTDDS, str(_PROFILES))
    if signal.getsignal(signal.SIGINT) in (signal.default_int_handler, leave):
        signal.signal(signal.SIGINT, _leave_to_rclpy)
    try:
        with tempfile.TemporaryDirectory() as scratch:
            rclpy.init(args=_in_any_namespace(sys.argv if args is None else args, Path(scratch)))
    except Exception as error:
        what = 'no folder for logs' if 'initialize logging' in str(error) else 'bad command line'
        return _say(Stop(EXIT_USAGE, f'{what}: {error}'))
    nodes, stop = [], Stop(0)
    try:
        for node_type in node_types:
            nodes.append(node_type())
            refuse_unknown(nodes[-1])
        gc.freeze()  # compilers and libraries, which stay: else every full collection visits them
        with TickExecutor() as executor:
            for node in nodes:
                executor.add_node(node)
            executor.spin()
    except ExternalShutdownException:
        pass
    except Stop as reason:
        stop = reason
    except (ConfigurationError, ParameterException) as error:  # of a parameter of ROS itself
        stop = Stop(EXIT_USAGE, str(error))
    except Exception:
        if rclpy.ok():
            raise
    finally:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        for node in nodes:
            try:
                node.close()
            except Stop as reason:
                stop = stop if stop.code else reason
        if nodes:
            time.sleep(_LINGER_S if rclpy.ok() else _LINGER_SENT_AWAY_S)
        for node in nodes:
            node.destroy_node()
        rclpy.try_shutdown()
    return _say(stop)


def _in_any_namespace(args: Sequence[str], folder: Path) -> list[str]:
    """Command line whose ``-p NODE:name:=value`` is for NODE in a namespace, too.

    rcl takes it for one of a node in none, and has no word for others but in a file.
    """
    words = list(args)
    for i, flag in enumerate(words[:-1]):
        found = _OF_NODE.fullmatch(words[i + 1]) if flag in ('-p', '--param') else None
        if found:
            node, name, value = found.groups()
            file = folder / f'{i}.yaml'
            text = f'/**/{node}:\n  ros__parameters:\n    {name}: {value}\n'
            file.write_text(text, encoding='utf-8')
            words[i : i + 2] = ['--params-file', str(file)]
    return words


def _leave_to_rclpy(number, frame) -> None:
    """Let rclpy, which hears SIGINT too, end the node at its next turn, as it does for SIGTERM.

    A KeyboardInterrupt may come while numba makes the tuples that a step returns, and numba goes
    on without them: a segmentation fault. Before its `init` rclpy hears nothing.
    """
    if get_current_signal_handlers_options() == SignalHandlerOptions.NO:
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # another one would kill it at its end
        sys.exit()


def _say(stop: Stop) -> int:
    if stop.code:
        say_fatal(stop)
    return stop.code
