"""Worker processes of this machine, which end with the program, whatever ends it."""

import gc
import os
import signal
import warnings
from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, Future, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from itertools import islice
from typing import Any

from steer_env.experiments.sweep.work import KEPT, LostError, Outcome, Task, perform
from steer_env.friction.numerics.worker_process import ONE_THREAD, end_with, settle

# glibc keeps what a case has freed for the next [B]; by default it gives the memory of large arrays back to the system
# at once, and gets it again page by page.
ENVIRONMENT = {**ONE_THREAD, "MALLOC_MMAP_THRESHOLD_": str(2**25), "MALLOC_TRIM_THRESHOLD_": str(2**28)}
TRIES = 3  # deaths of workers in a row, with no case finished between them, after which a sweep gives up


def outcomes(tasks: Mapping[int, Task], workers: int) -> Iterator[Outcome]:
    """Outcomes as they come, from processes of loky.

    Processes rather than threads, as compiling holds the interpreter's lock. Where a process dies, loky ends the others
    too: the cases that are left go to new ones.

    Raises
    ------
    LostError
        If processes die again and again.
    """
    left = dict(tasks)
    deaths = 0
    while left:
        try:
            for outcome in _performed(left.values(), min(workers, len(left))):
                del left[outcome.number]
                deaths = 0
                yield outcome
        except BrokenProcessPool as error:
            deaths += 1
            if deaths == TRIES:
                raise LostError(
                    f"worker processes died {TRIES} times in a row ({_reason(error)}): is there enough memory for "
                    f"{workers} of them? Give fewer with --workers; {KEPT}"
                ) from None


def _performed(tasks: Iterable[Task], workers: int) -> Iterator[Outcome]:
    """Outcomes of tasks as they come; BrokenProcessPool where a process dies."""
    todo, jobs = iter(list(tasks)), set[Future]()
    with _pool(workers) as pool:
        while True:
            with _held():  # few at a time, as loky cannot drop a long queue when it is stopped
                jobs |= {pool.submit(_performed_here, task) for task in islice(todo, 2 * workers - len(jobs))}
            if not jobs:
                return
            done, jobs = wait(jobs, return_when=FIRST_COMPLETED)
            for job in done:
                yield job.result()


def _performed_here(task: Task) -> Outcome:
    """As :func:`perform`; what the first case has loaded stays, and no collection of garbage looks through it again."""
    outcome = perform(task)
    if not gc.get_freeze_count():
        gc.collect()
        gc.freeze()
    return outcome


def _reason(error: BrokenProcessPool) -> str:
    """The exit codes that loky's message ends with."""
    return str(error).strip().splitlines()[-1].rstrip(".")


@contextmanager
def _pool(workers: int) -> Iterator[Any]:
    from joblib.externals.loky import ProcessPoolExecutor

    with warnings.catch_warnings():
        # A worker whose memory has grown is replaced by a new one, which loses nothing.
        warnings.filterwarnings("ignore", "A worker stopped while some jobs were given", UserWarning)
        pool = ProcessPoolExecutor(workers, initializer=_begin, initargs=(os.getpid(),), env=ENVIRONMENT)
        try:
            yield pool
        finally:  # what is done has come back; that a process ends by itself takes a second
            pool.shutdown(kill_workers=True)


def _begin(parent: int) -> None:
    settle()
    end_with(parent)
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGTERM})
    else:
        signal.signal(signal.SIGINT, signal.SIG_IGN)


@contextmanager
def _held() -> Iterator[None]:
    """Hold Ctrl-C and SIGTERM back to the end of the block, as a worker that is half started would be left behind.

    The processes that start within it inherit that: Ctrl-C, which a terminal sends to them too, is for the program.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
