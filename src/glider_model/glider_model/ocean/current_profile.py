# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Measured current profiles: velocity by depth, read from a CSV file and checked."""

import csv
import io
import math
from pathlib import Path

from glider_model.base.errors import ConfigurationError, shown
from glider_model.base.files import read_text

#: No component may be faster than this (m/s); the swiftest ocean currents reach about 2.5 m/s.
MAX_SPEED_MPS = 3.0
#: Rows of a profile: each is looked at in every tick.
MAX_ROWS = 10_000
#: Deepest point of a profile (m).
MAX_DEPTH_M = 12_000.0

_COLUMNS = ('depth_m', 'north_mps', 'east_mps', 'down_mps')


def check_speed(speed_mps: float, where: str) -> None:
    """Refuse a speed that no water has.

    Raises
    ------
    ValueError
        Naming the place ``where``.
    """
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
    if not rows:
        raise ValueError(f'{source}: no rows (allowed: at least 1)')
    names = list(names)
    for i, row in enumerate(rows):
        where = f'{source}: row {names[i]}'
        if len(row) not in (3, 4):
            raise ValueError(
                f'{where}: {len(row)} columns (allowed: {", ".join(_COLUMNS[:3])}, '
                f'and optionally {_COLUMNS[3]})'
            )
        if not 0.0 <= row[0] <= MAX_DEPTH_M:
            raise ValueError(
                f'{where}, column depth_m = {row[0]!r} (allowed: >= 0.0 and <= {MAX_DEPTH_M})'
            )
        if i > 0 and row[0] <= rows[i - 1][0]:
            raise ValueError(
                f'{where}, column depth_m = {row[0]!r}: depths must increase '
                f'(allowed: > {rows[i - 1][0]!r}, the depth of row {names[i - 1]})'
            )
        check_speed(math.hypot(*row[1:]), where)


def read_profile(path: Path) -> list[list[float]]:
    """Read and check a current profile.

    Raises
    ------
    ValueError
        Naming the file, and the column and row (line of the file) at fault.
    """
    source = f'file {path}'
    try:
        reader = csv.reader(io.StringIO(read_text(path), newline=''), skipinitialspace=True)
        lines = [(reader.line_num, cells) for cells in reader if any(map(str.strip, cells))]
    except ConfigurationError as error:
        raise ValueError(f'file {error}') from None
    except csv.Error as error:
        raise ValueError(f'{source}: not a CSV text file: {error}') from None
    header = [name.strip() for name in lines[0][1]] if lines else []
    missing = [name for name in _COLUMNS[:3] if name not in header]
    if missing:
        raise ValueError(
            f'{source}: row {lines[0][0] if lines else 1}: column {missing[0]} is missing '
            f'(allowed: {", ".join(_COLUMNS)})'
        )
    for name in header:
        if name not in _COLUMNS or header.count(name) > 1:
            wrong = 'repeated' if name in _COLUMNS else 'unknown'
            raise ValueError(
                f'{source}: row {lines[0][0]}: column {shown(name)} is {wrong} '
                f'(allowed: {", ".join(_COLUMNS)})'
            )
    if len(lines) > MAX_ROWS + 1:
        raise ValueError(f'{source}: {len(lines) - 1} rows (allowed: <= {MAX_ROWS})')
    rows = []
    for number, cells in lines[1:]:
        if len(cells) != len(header):
            raise ValueError(
                f'{source}: row {number}: {len(cells)} cells for {len(header)} columns'
            )
        cell = dict(zip(header, cells, strict=True))
        where = f'{source}: row {number}, column'
        rows.append([_number(cell[name], f'{where} {name}') for name in _COLUMNS if name in cell])
    check_profile(rows, [number for number, _ in lines[1:]], source)
    return rows


def _number(text: str, where: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ValueError(f'{where} = {shown(text)}: not a finite number')
    return value
