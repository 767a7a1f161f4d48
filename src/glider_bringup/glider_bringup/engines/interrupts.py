# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Ctrl-C and SIGTERM: a KeyboardInterrupt, or noted where that would do harm."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager


def end_as_interrupt(number: int, frame) -> None:
    """Handler of SIGTERM, which batch systems send: it ends a command as Ctrl-C does."""
    handler = signal.getsignal(signal.SIGINT)
    if callable(handler) and handler is not signal.default_int_handler:
        handler(number, frame)
    else:
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
    handler = signal.getsignal(signal.SIGINT)
    is_main = threading.current_thread() is threading.main_thread()
    if not is_main or not callable(handler):  # another thread hears it, or nobody
        yield noted
        return

    def note(number, frame) -> None:
        if noted:
            handler(number, frame)
        noted.append(signal.Signals(number).name)

    signal.signal(signal.SIGINT, note)
    try:
        yield noted
    finally:
        signal.signal(signal.SIGINT, handler)
