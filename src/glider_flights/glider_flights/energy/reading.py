# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Reading what a flight took out of its battery, of whichever kind of vehicle its files are."""

from collections.abc import Callable
from pathlib import Path

from glider_flights.energy.seaglider import seaglider_uses
from glider_flights.energy.slocum import slocum_uses
from glider_flights.energy.uses import Uses
from glider_flights.seaglider import seaglider_files
from glider_flights.slocum import slocum_files
from glider_model.base.errors import ConfigurationError


def read_uses(place: Path, cache: Path | None, progress: Callable[[int, int], None]) -> Uses:
    """Read what a flight took out of its battery.

    Raises
    ------
    ConfigurationError
    """
    if not place.exists():
        raise ConfigurationError(f'{place}: there is no such folder or file')
    if slocum_files(place):
        return slocum_uses(place, cache, progress)
    if not seaglider_files(place):
        raise ConfigurationError(
            f'{place}: no files of a flight in it (allowed: .dbd, .mbd, .sbd, .dcd, .mcd, .scd of '
            'a Slocum, p*.nc of a Seaglider)'
        )
    return seaglider_uses(place, progress)
