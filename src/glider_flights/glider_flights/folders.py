# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Where the files of a flight are, and the libraries that read them."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from glider_base.errors import ConfigurationError


def files_in(place: Path, wanted: Callable[[Path], bool]) -> list[Path]:
    """The wanted files: the place itself, those in it, or those in the one folder below it.

    Raises
    ------
    ConfigurationError
        If several folders below it have some: they may be of several flights.
    """
    if place.is_file():
        return [place] if wanted(place) else []
    files = sorted(path for path in place.iterdir() if path.is_file() and wanted(path))
    if files:
        return files
    files = sorted(path for path in place.rglob('*') if path.is_file() and wanted(path))
    folders = sorted({path.parent for path in files})
    if len(folders) > 1:
        raise ConfigurationError(
            f'{place}: files of flights in {len(folders)} folders below it, such as '
            f'{folders[0]} and {folders[1]}; give one of them'
        )
    return files


@contextmanager
def installed(library: str) -> Iterator[None]:
    """Say of a library that is imported here, and is not there, how to get it.

    Raises
    ------
    ConfigurationError
    """
    try:
        yield
    except ImportError:
        raise ConfigurationError(
            f'{library}, is not installed; install it with: '
            './glider python -m pip install --no-deps -r requirements-flights.txt'
        ) from None
