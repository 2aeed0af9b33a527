"""Worker processes of joblib, for a sweep or a vector environment: of one thread each, they end with the program.

They are processes rather than threads, as compiling holds the interpreter's lock, and start afresh rather than by a
fork, as threads of compiled code do not survive one.
"""

import gc
import os
import re
import signal
import sys
import threading
import warnings
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from typing import Any

from steer_env.friction.numerics.thread_pool import THREADS

# Libraries of linear algebra that would start threads in every worker read these when they are loaded.
ONE_THREAD = dict.fromkeys(
    [f"{name}_NUM_THREADS" for name in ("OMP", "OPENBLAS", "MKL", "BLIS", "NUMEXPR", "NUMBA")]
    + ["VECLIB_MAXIMUM_THREADS"],
    "1",
)
# glibc keeps what a job has freed for the next [B]; by default it gives the memory of large arrays back to the system
# at once, and gets it again page by page.
ENVIRONMENT = {**ONE_THREAD, "MALLOC_MMAP_THRESHOLD_": str(2**25), "MALLOC_TRIM_THRESHOLD_": str(2**28)}
IDLE = 24 * 3600.0  # time without a job after which a process ends [s]
TRIES = 3  # deaths of processes in a row, with no job finished between them, after which they are given up


class WorkersDiedError(RuntimeError):
    """Worker processes that die again and again."""


def run_in_processes(
    function: Callable[[Any], Any], jobs: Sequence[Any], workers: int
) -> Generator[tuple[int, Any], None, None]:
    """Call a function with every job in ``workers`` processes: index and result of each as it is finished.

    The processes are those of the last call where it had as many, until :func:`end_processes`. Where one dies, the jobs
    that are left go to new ones.

    Parameters
    ----------
    function : callable
        Of one job, defined at the top of a module that the processes can import.
    jobs : sequence
        Things that pickle takes.
    workers : int
        At least 2.

    Raises
    ------
    WorkersDiedError
        If processes die ``TRIES`` times with no job finished between.
    Exception
        That of a function, at which the others stop.
    """
    waiting, deaths = dict(enumerate(jobs)), 0
    while waiting:
        try:
            for index, result in _results(function, waiting, workers):
                del waiting[index]
                deaths = 0
                yield index, result
        except BrokenProcessPool as error:
            deaths += 1
            if deaths == TRIES:
                reason = re.search(r"exit codes? .*", str(error)) or re.search(r".+", str(error))
                raise WorkersDiedError(
                    f"worker processes died {TRIES} times in a row ({reason[0] if reason else 'without a reason'}): is "
                    f"there enough memory for {workers} of them? Give fewer workers"
                ) from None


def _results(function: Callable[[Any], Any], jobs: dict[int, Any], workers: int) -> Iterator[tuple[int, Any]]:
    """Results of jobs by their index as they come; BrokenProcessPool where a process dies."""
    import joblib  # takes long to import

    with warnings.catch_warnings():
        # A process whose memory has grown is replaced by a new one, which loses nothing.
        warnings.filterwarnings("ignore", "A worker stopped while some jobs were given", UserWarning)
        # Who stops early has a reason, as an error in one job.
        warnings.filterwarnings(
            "ignore", ".*tasks which were still being processed|.*successfully executed", UserWarning
        )
        calls = (joblib.delayed(_perform)(function, index, job) for index, job in list(jobs.items()))
        with _starting():
            results = joblib.Parallel(
                workers,
                backend="loky",
                return_as="generator_unordered",
                batch_size=1,  # a process that dies takes one job with it
                max_nbytes=None,  # jobs are pickled as a whole
                idle_worker_timeout=IDLE,
                initializer=_begin,
                initargs=(os.getpid(),),
            )(calls)
        yield from results


def end_processes() -> None:
    """End the processes of the last call at once, so that later ones import what the modules have become."""
    from joblib.externals.loky import get_reusable_executor

    get_reusable_executor(reuse=True).shutdown(kill_workers=True)


def _perform(function: Callable[[Any], Any], index: int, job: Any) -> tuple[int, Any]:
    """The result of a job; what the first one has loaded stays, and no collection of garbage looks through it again."""
    result = function(job)
    if not gc.get_freeze_count():
        gc.collect()
        gc.freeze()
    return index, result


def settle() -> None:
    """Make this process a worker: its vector environments step in one thread."""
    os.environ[THREADS] = "1"


def _begin(parent: int) -> None:
    settle()
    _end_with(parent)
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGTERM})
    else:
        signal.signal(signal.SIGINT, signal.SIG_IGN)


def _end_with(parent: int) -> None:
    """End this process when its parent has gone, however that ended."""

    def watch() -> None:
        while os.getppid() == parent:
            _pause.wait(0.3)
        os._exit(1)

    if sys.platform != "win32":  # there the process id of the parent stays
        threading.Thread(target=watch, daemon=True).start()


_pause = threading.Event()


@contextmanager
def _starting() -> Iterator[None]:
    """Give processes that start within the block their environment, and keep Ctrl-C and SIGTERM waiting to its end.

    A process that is half started would be left behind. The processes inherit that: Ctrl-C, which a terminal sends to
    them too, is for the program.
    """
    masks = hasattr(signal, "pthread_sigmask")
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM}) if masks else None
    environment = {name: os.environ.get(name) for name in ENVIRONMENT}
    os.environ.update(ENVIRONMENT)
    try:
        yield
    finally:
        for name, value in environment.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
        if before is not None:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
