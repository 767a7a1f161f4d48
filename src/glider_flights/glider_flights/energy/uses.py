# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What a real glider took out of its battery, and the numbers of a vehicle file that say so.

A flight is cut into parts of which energy and doings were recorded: pumpings of a Seaglider, half
hours of a Slocum. Their energy is a sum of fields of a vehicle file, each times what was done of
it (seconds in a phase, cc pumped out, cc times depth). Least squares find them, none below zero.
"""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import nnls

from glider_base.errors import ConfigurationError

#: Fields of a vehicle file that are fitted, and their units.
PUMP = {'pump_out': 'J/cc', 'pump_out_per_m': 'J/cc/m'}
HOTEL = {'hotel_dive': 'W', 'hotel_climb': 'W', 'hotel_surface': 'W', 'call_power': 'W'}
UNITS = {**HOTEL, **PUMP, 'pitch_mass': 'J/m', 'roll_mass': 'J/deg'}


class Uses(NamedTuple):
    """Energy of the parts of a flight, and what it went into."""

    kind: str  #: 'slocum' or 'seaglider'
    files: int
    fields: tuple[str, ...]  #: of a vehicle file, m of them
    doings: np.ndarray  #: shape (n, m): what they multiply (s, cc, cc m)
    joules: np.ndarray  #: shape (n,)
    first_half: np.ndarray  #: bool, shape (n,)
    masses: dict[str, float]  #: what the moving masses took as they moved, where that is recorded
    notes: list[str]  #: what a person should know of the files: a sentence each


def predict(place: Path, uses: Uses, fitted: Uses | None) -> dict[str, Any]:
    """Energy of a flight as predicted and as recorded, as `--json` prints it.

    Fitted on the first half of another flight, it is all of this one that is predicted; else its
    second half by its first.

    Raises
    ------
    ConfigurationError
        If the two are not of one kind, or there is too little to be fitted.
    """
    source = fitted or uses
    if source.kind != uses.kind:
        raise ConfigurationError(
            f'{place}: a {uses.kind} cannot be predicted from a {source.kind} '
            f'(allowed: --fit-on a {uses.kind})'
        )
    predicted = np.ones(len(uses.joules), bool) if fitted else ~uses.first_half
    if source.first_half.sum() < len(uses.fields) or not predicted.any():
        raise ConfigurationError(
            f'{place}: {source.first_half.sum()} parts to fit {len(uses.fields)} numbers on '
            f'(needed: {len(uses.fields)})'
        )
    numbers, _ = nnls(source.doings[source.first_half], source.joules[source.first_half])
    recorded = float(uses.joules[predicted].sum())
    if not recorded > 0.0:
        raise ConfigurationError(f'{place}: no energy is recorded in what is to be predicted')
    told = float((uses.doings[predicted] @ numbers).sum())
    return {
        'vehicle': uses.kind,
        'files': uses.files,
        'fitted': dict(zip(uses.fields, map(float, numbers), strict=True)),
        'fitted_parts': int(source.first_half.sum()),
        'predicted_parts': int(predicted.sum()),
        'recorded_wh': recorded / 3600.0,
        'predicted_wh': told / 3600.0,
        'error_percent': 100.0 * (told / recorded - 1.0),
        'measured': uses.masses,
        'notes': uses.notes,
    }
