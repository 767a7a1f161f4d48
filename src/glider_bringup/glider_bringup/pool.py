# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Worker processes that fly many missions at once, and stop cleanly on Ctrl-C."""

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import contextmanager
from typing import Any

#: Called with the number of flights that are done.
Progress = Callable[[int], None]


class StoppedError(Exception):
    """The work was stopped."""


_stop = None  #: in a worker: set when the work is stopped


def check_stop() -> None:
    """Give up, in a worker whose parent was stopped; to be called now and then.

    Raises
    ------
    StoppedError
        If the parent was stopped.
    """
    if _stop is not None and _stop.is_set():
        raise StoppedError


def _start_worker(stop) -> None:
    """Prepare a worker, which does not outlive its parent."""
    global _stop
    _stop = stop

    def end_with_parent() -> None:
        multiprocessing.parent_process().join()
        os._exit(1)

    threading.Thread(target=end_with_parent, daemon=True).start()


@contextmanager
def _children_ignore_interrupts() -> Iterator[None]:
    """Ctrl-C, which a terminal sends to all processes, is for the parent to deal with."""
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


@contextmanager
def worker_pool(workers: int) -> Iterator[Callable[[Callable, Any], Future]]:
    """Worker processes; yields ``submit(function, argument)``.

    Whatever ends the block early stops the workers: those that call `check_stop` at once.
    """
    context = multiprocessing.get_context('spawn')
    stop = context.Event()
    with ProcessPoolExecutor(workers, context, _start_worker, (stop,)) as pool:

        def submit(function: Callable, argument: Any) -> Future:
            with _children_ignore_interrupts():  # the first ones start the processes
                return pool.submit(function, argument)

        try:
            yield submit
        except BaseException:
            stop.set()
            pool.shutdown(wait=True, cancel_futures=True)
            raise
