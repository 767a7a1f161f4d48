# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Workers of a command: its bars and messages, and what ends their work early."""

from collections.abc import Callable, Iterable
from contextlib import contextmanager

import typer

from glider_base.errors import EXIT_FAILED, EXIT_INTERRUPTED, ConfigurationError
from glider_bringup.console import compiling, counter, messages
from glider_mission.choices import Combination
from glider_studies.workers import WorkError, worker_pool


@contextmanager
def workers_at_work(
    workers: int | None,
    scheduler: str | None,
    combinations: Iterable[Combination],
    flights: int,
    advice: Callable[[], str] = lambda: '',
):
    """Workers that fly laws with methods; yields their pool, and the update of a bar of flights.

    What ends their work early is told, with what ``advice`` adds, and is the exit code.
    """
    if workers and scheduler:
        raise ConfigurationError(
            f'--workers {workers}: not with --scheduler, whose cluster has workers of its own'
        )
    try:
        with (
            worker_pool(workers, scheduler, combinations, compiling) as pool,
            counter('flying', flights) as update,
        ):
            yield pool, update
        return
    except KeyboardInterrupt:
        reason, code = 'stopped by SIGINT', EXIT_INTERRUPTED
    except WorkError as error:
        reason, code = str(error), EXIT_FAILED
    messages.print(reason + advice(), style='red', soft_wrap=True)
    raise typer.Exit(code)
