# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Ctrl-C and SIGTERM: a KeyboardInterrupt, or noted where that would do harm."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager


def end_as_interrupt(number: int, frame) -> None:
    """Handler of SIGTERM, which batch systems send: it ends a command as Ctrl-C does."""
    raise KeyboardInterrupt(signal.Signals(number).name)


def stopped_by(interrupt: KeyboardInterrupt) -> str:
    """Why a command ended."""
    return f'stopped by {str(interrupt) or "SIGINT"}'


@contextmanager
def interrupts_noted() -> Iterator[list[str]]:
    """Signals are noted by name in the list that this yields, not raised; a second one is.

    A compiled function does not stand an exception from a signal handler: numba goes on without
    the tuples that it was about to make, and the process ends with a segmentation fault.
    """
    noted: list[str] = []
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    if threading.current_thread() is not threading.main_thread():  # that one hears them
        handlers = {}
    handlers = {number: one for number, one in handlers.items() if callable(one)}

    def note(number, frame) -> None:
        if noted:
            handlers[number](number, frame)
        noted.append(signal.Signals(number).name)

    for number in handlers:
        signal.signal(number, note)
    try:
        yield noted
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
