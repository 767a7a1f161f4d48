# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Worker processes that fly many missions at once: of this machine, or of a Dask cluster.

Workers may die at any moment. What they were doing is done again by others; only a task that kills
its worker time and again, flown with nothing else beside it, is given up.
"""

import logging
import multiprocessing
import os
import signal
import tempfile
from collections.abc import Callable, Hashable, Iterable, Iterator
from concurrent.futures import CancelledError
from contextlib import ExitStack, contextmanager, suppress
from itertools import islice
from multiprocessing import forkserver, resource_tracker
from socket import gethostname
from typing import Any, NamedTuple

import dask
import typer
from distributed import Client, Future, LocalCluster, TimeoutError, wait
from distributed.client import ClosedClientError
from distributed.comm import get_address_host_port
from distributed.protocol.pickle import dumps, loads
from distributed.scheduler import KilledWorker

from glider_base.errors import EXIT_FAILED, EXIT_INTERRUPTED, ConfigurationError
from glider_base.kernel import source_digest
from glider_bringup.console import compiling, counter, messages
from glider_bringup.engines.compiling import Tell, compile_loops
from glider_bringup.engines.interrupts import interrupts_noted, stopped_by
from glider_mission.scenario import Scenario

#: Tasks that are handed out ahead, for each thread of the workers.
TASKS_AHEAD = 2
#: How long a scheduler may take to answer, and how often it is looked at (s).
CONNECT_S, LOOK_S = 5.0, 2.0
#: Workers of this machine begin with `dask_setup`. A task whose worker died is given to one more
#: before it is tried by itself.
_CONFIG = {
    'distributed.scheduler.allowed-failures': 1,
    'distributed.worker.multiprocessing-method': 'forkserver',
    'distributed.worker.preload': [__name__],
}

WORKER_DIED = 'the worker process died each time it flew this'
SCHEDULER_GONE = 'the scheduler of the workers is gone'

#: Called with the number of flights that are done.
Progress = Callable[[int], None]


class WorkError(Exception):
    """Workers could not do what they were given; the message is meant for the person."""


class Outcome(NamedTuple):
    """What became of a task."""

    task: Any
    died: bool  #: whether it killed every worker that was given it
    result: Any = None  #: what the function returned


def dask_setup(worker: Any = None) -> None:
    """Have Dask log nothing in this process: what matters is said by the commands."""
    for name in ('distributed', 'distributed.client', 'tornado.application'):
        logging.getLogger(name).setLevel(logging.CRITICAL)


def _call(code: str, work: bytes) -> Any:
    """What a function returns for a task, both pickled, in a worker with the same program."""
    if code != source_digest():
        raise WorkError(f'the worker on {gethostname()} has another version of the program')
    function, task = loads(work)
    return function(task)


def _keyed(task: tuple[Callable, Hashable, Any]) -> tuple[Hashable, Any]:
    """Key of a task, and what its function returns."""
    function, key, argument = task
    return key, function(argument)


class Pool:
    """Workers that are connected to a client of Dask."""

    def __init__(self, client: Client) -> None:
        self._client = client

    def threads(self) -> int:
        """Number of tasks that the workers can do at once; 0 if none is connected."""
        return sum(self._client.nthreads().values())

    def outcomes(
        self,
        function: Callable,
        tasks: Iterable,
        apart: Callable[[Any], list] = lambda task: [task],
        on_wait: Callable[[], None] = lambda: None,
    ) -> Iterator[Outcome]:
        """Do tasks by a function that workers call; yields each as it is done, in any order.

        They are taken as workers become free, so that there may be many. ``apart`` splits one
        that may kill workers into smaller ones; ``on_wait`` is called every few seconds while no
        worker is connected. Raises WorkError if the scheduler is gone, or a worker has another
        version of the program.
        """
        suspects = []
        for outcome in self._together(function, iter(tasks), TASKS_AHEAD, on_wait):
            if outcome.died:
                suspects.append(outcome.task)
            else:
                yield outcome
        # Dask blames all that waited in a worker that died: each is tried again by itself.
        for task in (part for suspect in suspects for part in apart(suspect)):
            yield from self._together(function, iter([task]), 1, on_wait)

    def results(
        self, function: Callable, tasks: dict[Hashable, Any], progress: Progress
    ) -> dict[Hashable, Any]:
        """What a function returns for each task, by its key, in the order of the keys.

        Raises WorkError if a task killed its workers, and as `outcomes`.
        """
        results = {}
        for outcome in self.outcomes(_keyed, ((function, *task) for task in tasks.items())):
            if outcome.died:
                raise WorkError(WORKER_DIED)
            key, result = outcome.result
            results[key] = result
            progress(len(results))
        return {key: results[key] for key in tasks}

    def _together(self, function, tasks: Iterator, ahead: int, on_wait) -> Iterator[Outcome]:
        """Do tasks without a second chance for those that were there when workers died."""
        flying: dict[Future, Any] = {}
        try:
            while True:
                with _scheduler_answers():
                    threads = self.threads()
                    for task in islice(tasks, max(0, ahead * max(threads, 1) - len(flying))):
                        call = _call, source_digest(), dumps((function, task))
                        flying[self._client.submit(*call, pure=False)] = task
                if not flying:
                    return
                if not threads:
                    on_wait()
                for future in self._ended(flying):
                    yield _outcome(future, flying.pop(future))
        finally:
            if flying and self._client.status == 'running':
                self._client.cancel(list(flying), force=True)

    def _ended(self, flying: dict[Future, Any]) -> list[Future]:
        """Tasks that have ended, after a short wait for the first of them."""
        with _scheduler_answers():
            with suppress(TimeoutError):
                wait(list(flying), LOOK_S, 'FIRST_COMPLETED')
            if self._client.status != 'running':
                raise WorkError(SCHEDULER_GONE)
            return [future for future in flying if future.done()]


def _outcome(future: Future, task: Any) -> Outcome:
    """Outcome of a task that has ended; what its function raised is raised here."""
    with _scheduler_answers():
        error = future.exception()
        if error is None:
            return Outcome(task, died=False, result=future.result())
    if isinstance(error, KilledWorker):
        return Outcome(task, died=True)
    raise error


@contextmanager
def _scheduler_answers() -> Iterator[None]:
    """Whatever Dask raises when its scheduler is gone, as one error."""
    try:
        yield
    except (OSError, TimeoutError, CancelledError, ClosedClientError):
        raise WorkError(SCHEDULER_GONE) from None


@contextmanager
def _interrupts_held_back() -> Iterator[None]:
    """Ctrl-C is dealt with after the block; processes that are started in it never see it.

    A terminal sends it to all of them. Threads, and through them processes that are started later,
    inherit that it is blocked; only multiprocessing's tracker would unblock it, when it starts.
    """
    resource_tracker.ensure_running()
    with interrupts_noted() as interrupts:
        mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            yield
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)
    if interrupts:
        raise KeyboardInterrupt(interrupts[0])


def _local_cluster(workers: int, folder: str) -> LocalCluster:
    """Workers of this machine, which do not outlive this process.

    They are copies of one process that has imported what is imported here.
    """
    multiprocessing.set_forkserver_preload([__name__])
    forkserver.ensure_running()  # before Dask has something else imported
    return LocalCluster(
        n_workers=workers,
        threads_per_worker=1,
        host='127.0.0.1',
        dashboard_address='127.0.0.1:0',
        memory_limit=0,  # a worker that nears a limit would pause for good
        local_directory=folder,
        silence_logs=logging.CRITICAL,
    )


@contextmanager
def worker_pool(
    workers: int | None = None,
    scheduler: str | None = None,
    scenarios: Iterable[Scenario] = (),
    tell: Tell = lambda line: None,
) -> Iterator[Pool]:
    """Start worker processes, by default one per processor, or connect to those of a cluster.

    Whatever ends the block ends the workers that were started for it, at once. ``scheduler`` is
    the address of that of a cluster, such as ``tcp://10.0.0.1:8786``. Loops of ``scenarios``,
    which they will fly, are compiled here, so that workers of this machine do not all compile the
    same; ``tell`` gets a line then. Raises ConfigurationError if no scheduler answers, or there
    are ``workers`` beside it.
    """
    if workers and scheduler:
        raise ConfigurationError(
            f'--workers {workers}: not with --scheduler, whose cluster has workers of its own'
        )
    dask_setup()
    with ExitStack() as stack:
        stack.enter_context(dask.config.set(_CONFIG))
        if scheduler is None:
            compile_loops(scenarios, tell)
            folder = stack.enter_context(tempfile.TemporaryDirectory(prefix='glider-'))
            with _interrupts_held_back():
                cluster = _local_cluster(workers or os.cpu_count() or 1, folder)
                scheduler = stack.enter_context(cluster)
        yield Pool(stack.enter_context(_connect(scheduler)))


def _connect(scheduler: str | LocalCluster) -> Client:
    try:
        if not isinstance(scheduler, LocalCluster):
            get_address_host_port(str(scheduler))  # a client that fails for it leaves others none
        return Client(scheduler, timeout=CONNECT_S)
    except (OSError, TimeoutError, ValueError) as error:
        raise ConfigurationError(
            f'--scheduler {scheduler!s:.80}: no Dask scheduler answers there ({error}) '
            f'(allowed: the address that dask scheduler prints, such as tcp://127.0.0.1:8786)'
        ) from None


@contextmanager
def workers_at_work(
    workers: int | None,
    scheduler: str | None,
    scenarios: Iterable[Scenario],
    flights: int,
    advice: Callable[[], str] = lambda: '',
):
    """Workers of a command; yields their pool, and the update of a bar of flights.

    They fly ``scenarios``, or alike. What ends their work early is named, with what ``advice``
    adds, and is the exit code.
    """
    try:
        with (
            worker_pool(workers, scheduler, scenarios, compiling) as pool,
            counter('flying', flights) as update,
        ):
            yield pool, update
        return
    except KeyboardInterrupt as error:
        reason, code = stopped_by(error), EXIT_INTERRUPTED
    except WorkError as error:
        reason, code = str(error), EXIT_FAILED
    messages.print(reason + advice(), style='red', soft_wrap=True)
    raise typer.Exit(code)
