# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Measured current profiles: velocity by depth, read from a CSV file and checked."""

import math
from pathlib import Path

from glider_model.ocean.columns import check_rows, read_columns

#: No component may be faster than this (m/s); the swiftest ocean currents reach about 2.5 m/s.
MAX_SPEED_MPS = 3.0

_COLUMNS = ('depth_m', 'north_mps', 'east_mps', 'down_mps')


def check_speed(speed_mps: float, where: str) -> None:
    """Refuse, by a ValueError that names the place ``where``, a speed that no water has."""
    if speed_mps > MAX_SPEED_MPS:
        raise ValueError(
            f'{where}: the speed is {speed_mps:.3f} m/s (allowed: <= {MAX_SPEED_MPS} m/s)'
        )


def check_profile(rows: list[list[float]], names, source: str) -> None:
    """Refuse a profile that cannot be interpolated; ``names`` are the numbers of its rows.

    Raises
    ------
    ValueError
        Naming the source, the row and the column at fault.
    """
    names = list(names)
    check_rows(rows, names, source, _COLUMNS)
    for name, row in zip(names, rows, strict=True):
        check_speed(math.hypot(*row[1:]), f'{source}: row {name}')


def read_profile(path: Path) -> list[list[float]]:
    """Read and check a current profile.

    Raises
    ------
    ValueError
        Naming the file, and the column and row (line of the file) at fault.
    """
    found = read_columns(path, _COLUMNS, _COLUMNS[:3])
    rows = [list(row.values()) for _, row in found]
    check_profile(rows, [number for number, _ in found], f'file {path}')
    return rows
