# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Numbers as a person says them."""

import math


def span(seconds: float) -> str:
    """Time as a person says it."""
    minutes = round(seconds / 60.0)
    if seconds < 120.0:
        return f'{seconds:.4g} s'
    if minutes < 120:
        return f'{minutes} min'
    hours, minutes = divmod(minutes, 60)
    return f'{hours} h {minutes} min' if minutes else f'{hours} h'


def hours_of(seconds: float) -> float | None:
    """Hours of a time; None of what never comes."""
    return seconds / 3600.0 if math.isfinite(seconds) else None


def way(metres: float | None) -> str:
    """Distance as a person says it; None is not known."""
    if metres is None:
        return '-'
    return f'{metres / 1e3:,.1f} km' if metres >= 2000.0 else f'{metres:,.0f} m'


def small(metres: float) -> str:
    """Error as a person says it."""
    return f'{metres:.2f} m' if metres < 10.0 else way(metres)


def count(number: int, what: str) -> str:
    """Number of things, in words that agree."""
    return f'{number:,} {what}' if number == 1 else f'{number:,} {what}s'
