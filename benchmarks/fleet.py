# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What gliders put on a network, and what it costs that they find each other.

Everything is counted on the loopback of a network namespace of its own, where nobody else sends,
over UDP instead of shared memory: as if every node had a computer to itself. Needs Linux with
unprivileged user namespaces, ``unshare`` and ``ip``. By hand, 40 nodes as on a network, and as
``ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST`` has them; ``met`` is what the loneliest node has met:

    python benchmarks/fleet.py discovery 40
    python benchmarks/fleet.py discovery 35 LOCALHOST
"""

import json
import math
import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

from nodes import fly_once

from glider_model.base.signals import TICK_S

DURATION_S = 15.0
COUNTS = 5, 10, 20
#: The flight counts from here on (s); before, things are still said once.
_SETTLED_S = 5.0
#: Nodes are given this long (s) to find each other.
_TIMEOUT_S = 40.0
#: How often a node tells the others that it is there (s), Fast DDS's default: the traffic of
#: silent nodes is that of one such period, after another one in which the rest has faded.
_PERIOD_S = 3.0
_DOMAIN = 1
_PRIVATE = ('unshare', '--user', '--map-root-user', '--net')
_LOOPBACK = ('ip link set lo up multicast on', 'ip route add 224.0.0.0/4 dev lo')

_PER_COUNT = {
    's': 'from the first call of rclpy until every one of {} nodes knows all others (s)',
    'cpu_s': 'processor time of that, all {} together (s)',
    'mb': 'what {} nodes have sent each other by then (MB)',
    'idle_bytes_per_s': 'what {} nodes send when they know each other and are silent (B/s)',
}
MEANING = {
    'wire_start_mb': 'a glider of seven nodes, sent until its first tick (MB)',
    'wire_bytes_per_s': 'sent by it at 10 Hz in real time: all topics, recorder too (B/s)',
    **{
        f'discovery_{count}_{name}': text.format(count)
        for count in COUNTS
        for name, text in _PER_COUNT.items()
    },
    'discovery_node_rss_mb': 'resident memory of a node that knows all others (MB)',
    'discovery_mb_exponent': 'p, if the MB grow as N^p',
    'discovery_cpu_exponent': 'p, if the processor time grows as N^p',
    'discovery_idle_exponent': 'p, if the B/s of silent nodes grow as N^p',
}


def measure(progress: Callable[[str], None]) -> dict:
    """Figures of one glider and of bare nodes; all None where no private network can be made."""
    if not _has_private_network():
        return dict.fromkeys(MEANING)
    progress(f'{DURATION_S:g} s of a glider in real time')
    figures = _in_private('wire')
    fleets = []
    for count in COUNTS:
        progress(f'{count} nodes that find each other')
        fleet = _in_private('discovery', str(count))
        if fleet['met'] < count:
            raise RuntimeError(f'a node met {fleet["met"]} of {count} within {_TIMEOUT_S:g} s')
        fleets.append(fleet)
        figures |= {f'discovery_{count}_{name}': fleet[name] for name in _PER_COUNT}
    return {
        **figures,
        'discovery_node_rss_mb': fleets[-1]['rss_mb'],
        'discovery_mb_exponent': _exponent(fleets, 'mb'),
        'discovery_cpu_exponent': _exponent(fleets, 'cpu_s'),
        'discovery_idle_exponent': _exponent(fleets, 'idle_bytes_per_s'),
    }


def _exponent(fleets: list[dict], name: str) -> float:
    """Exponent of a power law through the least and the largest fleet."""
    return math.log(fleets[-1][name] / fleets[0][name]) / math.log(COUNTS[-1] / COUNTS[0])


# ---------------------------------------------------------------------------------- namespace


def _has_private_network() -> bool:
    try:
        return not subprocess.run([*_PRIVATE, 'ip', 'link'], capture_output=True).returncode
    except FileNotFoundError:
        return False


def _in_private(*arguments: str) -> dict:
    """What this file prints for arguments, in a network namespace of its own."""
    done = subprocess.run(
        [*_PRIVATE, sys.executable, __file__, '--private', *arguments],
        env={
            **os.environ,
            'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SUBNET',
            'FASTDDS_BUILTIN_TRANSPORTS': 'UDPv4',
            'ROS_DOMAIN_ID': str(_DOMAIN),
        },
        stdout=subprocess.PIPE,
        check=True,
        text=True,
    )
    return json.loads(done.stdout)


def _sent_bytes() -> int:
    """Bytes that have gone over the loopback, headers of IP and UDP included."""
    lines = Path('/proc/net/dev').read_text(encoding='utf-8').splitlines()
    return next(int(line.split()[9]) for line in lines if line.split()[0] == 'lo:')


# ---------------------------------------------------------------------------------- in there


def wire() -> dict:
    """What a glider sends before its first tick, and in a second of real time."""
    said = []

    def note(tick: int, depth_m: float) -> None:
        said.append((tick * TICK_S, _sent_bytes()))

    fly_once(DURATION_S, 1.0, note)
    steady = [one for one in said if _SETTLED_S < one[0] < DURATION_S]
    (first_s, first), (last_s, last) = steady[0], steady[-1]
    return {
        'wire_start_mb': said[0][1] / 1e6,
        'wire_bytes_per_s': (last - first) / (last_s - first_s),
    }


def discovery(count: str, reach: str = 'SUBNET') -> dict:
    """What it costs that nodes find each other: figures of `_PER_COUNT`, and what they met."""
    program = [sys.executable, str(Path(__file__).with_name('participant.py'))]
    nodes = [
        subprocess.Popen(
            [*program, str(number), count, str(_TIMEOUT_S)],
            env={**os.environ, 'ROS_AUTOMATIC_DISCOVERY_RANGE': reach},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        for number in range(int(count))
    ]
    try:
        for node in nodes:
            node.stdout.readline()
        start_s = time.monotonic()
        for node in nodes:
            _tell(node)
        told = [json.loads(node.stdout.readline()) for node in nodes]
        sent = _sent_bytes()
        time.sleep(_PERIOD_S)
        faded = _sent_bytes()
        time.sleep(_PERIOD_S)
        idle_bytes_per_s = (_sent_bytes() - faded) / _PERIOD_S
        for node in nodes:
            _tell(node)
            node.wait()
    finally:
        for node in nodes:
            node.kill()
            node.communicate()
    return {
        'met': min(one['met'] for one in told),
        's': max(one['at_s'] for one in told) - start_s,
        'cpu_s': sum(one['cpu_s'] for one in told),
        'mb': sent / 1e6,
        'idle_bytes_per_s': idle_bytes_per_s,
        'rss_mb': max(one['rss_mb'] for one in told),
    }


def _tell(node: subprocess.Popen) -> None:
    node.stdin.write('\n')
    node.stdin.flush()


def main(what: str, *arguments: str) -> None:
    """Print figures as JSON, from a network namespace of its own."""
    if what != '--private':
        print(json.dumps(_in_private(what, *arguments), indent=2))
        return
    for command in _LOOPBACK:
        subprocess.run(command.split(), check=True)
    function, *rest = arguments
    print(json.dumps({'wire': wire, 'discovery': discovery}[function](*rest)))


if __name__ == '__main__':
    main(*sys.argv[1:])
