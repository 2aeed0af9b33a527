"""Worker processes that end with the program, whatever ends it."""

import multiprocessing
import os
import signal
import threading
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager

MOST = 4  # processes by default


@contextmanager
def pool_of(workers: int | None = None) -> Iterator[ProcessPoolExecutor]:
    """A pool of processes, by default one for each processor and up to four.

    Processes rather than threads, as compiling holds the interpreter's lock. An error or Ctrl-C ends them at once.
    """
    others = set(multiprocessing.active_children())
    workers = workers or min(_processors(), MOST)
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(workers, context, signal.signal, (signal.SIGINT, signal.SIG_IGN))
    try:
        yield pool
        pool.shutdown()
    except BaseException:
        pool.shutdown(wait=False, cancel_futures=True)
        for process in set(multiprocessing.active_children()) - others:
            process.terminate()
        raise


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Hold Ctrl-C and SIGTERM back to the end of the block, as a worker that is half started would be left behind."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    held: list[int] = []
    signals = signal.SIGINT, signal.SIGTERM
    handlers = [signal.signal(number, lambda number, frame: held.append(number)) for number in signals]
    try:
        yield
    finally:
        for number, handler in zip(signals, handlers):
            signal.signal(number, handler)
        if held:
            signal.raise_signal(held[0])


def _processors() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
