# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Watches over a case: how long it takes, and what it says."""

import signal
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from fuzzing.counts import HANG_S

#: Characters that an error may have.
MAX_TOLD = 20_000


class Hang(BaseException):
    """A case takes too long. No ``except Exception`` on the way shall take it for an answer."""


@contextmanager
def time_limit(seconds: float) -> Iterator[None]:
    """Raise `Hang` in the main thread if what is inside takes longer (s)."""

    def stop(number, frame) -> None:
        raise Hang

    before = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


@contextmanager
def time_limit_after(seconds: float) -> Iterator[None]:
    """Raise `Hang` if what is inside took longer (s): compiled code stands no signal handler."""
    start = time.monotonic()
    yield
    if time.monotonic() - start > seconds:
        raise Hang


def outcome_of(
    case: Callable[[], tuple[str, str]], limit: Callable = time_limit
) -> tuple[str, str]:
    """What a case came to: its own word, or that it hung or raised.

    Parameters
    ----------
    case : callable
    limit : context manager, optional
        Raises `Hang`: `time_limit` in the middle, `time_limit_after` of compiled code at its end.

    Returns
    -------
    outcome : str
        Empty if all is well, else 'tracebacks', 'hangs' or 'wrong'.
    why : str
    """
    try:
        with limit(HANG_S):
            return case()
    except Hang:
        return 'hangs', f'no answer within {HANG_S:g} s'
    except Exception as error:
        place = traceback.extract_tb(error.__traceback__)[-1]
        return 'tracebacks', f'{type(error).__name__}: {error} ({place.filename}:{place.lineno})'


def badly_told(text: str) -> str:
    """What is wrong with the text of an error; empty if nothing."""
    if len(text) > MAX_TOLD:
        return f'an error of {len(text)} characters'
    odd = next((one for one in text if not (one.isprintable() or one == '\n')), '')
    return f'an error with {odd!a} in it' if odd else ''
