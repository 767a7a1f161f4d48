# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Ctrl-C where a KeyboardInterrupt would do harm."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def interrupts_noted() -> Iterator[list[bool]]:
    """Ctrl-C is noted in the list that this yields, and not raised; a second one is.

    A compiled function does not stand an exception from a signal handler: numba goes on without
    the tuples that it was about to make, and the process ends with a segmentation fault.
    """
    noted: list[bool] = []
    handler = signal.getsignal(signal.SIGINT)
    is_main = threading.current_thread() is threading.main_thread()
    if not is_main or not callable(handler):  # another thread hears it, or nobody
        yield noted
        return

    def note(number, frame) -> None:
        if noted:
            handler(number, frame)
        noted.append(True)

    signal.signal(signal.SIGINT, note)
    try:
        yield noted
    finally:
        signal.signal(signal.SIGINT, handler)
