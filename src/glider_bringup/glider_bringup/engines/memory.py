# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Memory of the nodes of a flight, and whether it grows."""

import os
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np

from glider_bringup.engines.fork_server import FORK_SERVER, nodes_of

#: Part of a flight before which memory may still grow: buffers fill, caches warm up.
_SETTLED = 0.2


def memory_mb(entry: str) -> dict[str, float]:
    """Memory (MB) of the nodes that this process has started, by an entry of /proc/PID/status."""
    found = {}
    for name, pid in nodes_of(os.getpid()).items():
        with suppress(FileNotFoundError, ProcessLookupError):
            lines = Path(f'/proc/{pid}/status').read_text(encoding='utf-8').splitlines()
            status = dict(line.split(':', 1) for line in lines)
            if name != FORK_SERVER and entry in status:
                found[name] = int(status[entry].split()[0]) / 1024.0
    return found


def growth_mb_per_h(samples: Sequence[tuple[float, float]]) -> float:
    """Slope (MB per simulated hour) of samples (h, MB), once settled; 0 of fewer than two."""
    taken = np.array(samples).reshape(-1, 2)
    settled = taken[taken[:, 0] > _SETTLED * taken[:, 0].max(initial=0.0)]
    if len(settled) < 2:
        return 0.0
    return float(np.polyfit(settled[:, 0], settled[:, 1], 1)[0])
