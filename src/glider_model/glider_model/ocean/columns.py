# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Tables of numbers in CSV files, as people write them, read and checked."""

import csv
import io
import math
from pathlib import Path

import numpy as np

from glider_base.errors import ConfigurationError, shown
from glider_base.files import read_text

#: Rows of a table: some are looked at in every tick.
MAX_ROWS = 10_000
#: Deepest point of a table (m).
MAX_DEPTH_M = 12_000.0


def read_columns(
    path: Path, known: tuple[str, ...], needed: tuple[str, ...]
) -> list[tuple[int, dict[str, float]]]:
    """Rows of a CSV file with a header: line of the file, and numbers by column.

    There may be the columns that are known, and must be those that are needed. A ValueError
    names the file, and the column and row (line of the file) at fault.
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
    missing = [name for name in needed if name not in header]
    if missing:
        raise ValueError(
            f'{source}: row {lines[0][0] if lines else 1}: column {missing[0]} is missing '
            f'(allowed: {", ".join(known)})'
        )
    for name in header:
        if name not in known or header.count(name) > 1:
            wrong = 'repeated' if name in known else 'unknown'
            raise ValueError(
                f'{source}: row {lines[0][0]}: column {shown(name)} is {wrong} '
                f'(allowed: {", ".join(known)})'
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
        rows.append((number, {n: _number(cell[n], f'{where} {n}') for n in known if n in cell}))
    return rows


def check_rows(
    rows: list[list[float]], names, source: str, columns: tuple[str, ...], alike: bool = False
) -> None:
    """Refuse rows that cannot be interpolated; ``names`` are their numbers.

    They are of numbers by the columns, of which the first is the depth (m) and the last may be
    missing; in all rows or in none, if they are ``alike``. A ValueError names the source, the
    row and the column at fault.
    """
    if not rows:
        raise ValueError(f'{source}: no rows (allowed: at least 1)')
    allowed = f'{", ".join(columns[:-1])}, and optionally {columns[-1]}'
    allowed += '; in all rows the same' if alike else ''
    above, before = None, -math.inf
    for name, row in zip(names, rows, strict=True):
        where = f'{source}: row {name}'
        if not len(columns) - 1 <= len(row) <= len(columns) or (
            alike and len(row) != len(rows[0])
        ):
            raise ValueError(f'{where}: {len(row)} columns (allowed: {allowed})')
        where += f', column depth_m = {row[0]!r}'
        if not 0.0 <= row[0] <= MAX_DEPTH_M:
            raise ValueError(f'{where} (allowed: >= 0.0 and <= {MAX_DEPTH_M})')
        if row[0] <= before:
            raise ValueError(
                f'{where}: depths must increase (allowed: > {before!r}, the depth of row {above})'
            )
        above, before = name, row[0]


def _number(text: str, where: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ValueError(f'{where} = {shown(text)}: not a finite number')
    return value


def is_height(depths: np.ndarray) -> bool:
    """Whether depths are given as heights: none is below the surface, but some above it."""
    return bool(np.any(depths < 0.0) and not np.any(depths > 0.0))
