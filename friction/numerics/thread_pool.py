"""Threads that share the rows of a batch, and the one thread of linear algebra.

Kernels release the GIL, so no threading layer of numba is needed.
"""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager
from functools import cache
from itertools import pairwise
from typing import Any

THREADS = "STEER_ENV_THREADS"  # environment variable: the most threads of a vector environment by default


def most_threads() -> int:
    """Threads that a vector environment takes at most by default: ``STEER_ENV_THREADS``, or one for each processor.

    The results do not depend on it. Worker processes of a sweep set it to one.
    """
    return max(int(given), 1) if (given := os.environ.get(THREADS)) else os.cpu_count() or 1


def one_blas_thread() -> AbstractContextManager[Any]:
    """A context in which linear algebra runs in one thread: with more, the last bits of a sum depend on their number.

    Small matrices, as here, are not slower for it. What runs in threads of its own (torch) is left as it is.
    """
    return _libraries().limit(limits=1, user_api="blas")


@cache
def _libraries() -> Any:
    """The libraries of this process that have threads of their own, found once as that takes a millisecond."""
    import scipy.linalg  # noqa: F401  # brings one, which must be there to be found
    import threadpoolctl

    return threadpoolctl.ThreadpoolController()


class ThreadPool:
    """Runs work on slices of rows in ``threads`` threads.

    The threads belong to the process that started them; after a fork the child starts its own.
    """

    def __init__(self, threads: int) -> None:
        self._threads = threads
        self._executor: ThreadPoolExecutor | None = None
        self._process = 0

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_executor": None, "_process": 0}  # a copy starts threads of its own

    def run(self, n: int, work: Callable[..., Any], *arguments: Any) -> list[Any]:
        """Results of ``work(*arguments, low, high)`` for slices of ``n`` rows; the calling thread takes the first."""
        first, *rest = _slices(n, self._threads)
        if not rest:
            return [work(*arguments, *first)]
        if self._executor is None or self._process != os.getpid():  # threads do not survive a fork
            self._executor, self._process = ThreadPoolExecutor(self._threads - 1), os.getpid()
        others = [self._executor.submit(work, *arguments, *rows) for rows in rest]
        return [work(*arguments, *first), *(other.result() for other in others)]

    def close(self) -> None:
        """Stop the threads."""
        if self._executor is not None and self._process == os.getpid():
            self._executor.shutdown()
        self._executor, self._process = None, 0


@cache
def _slices(n: int, threads: int) -> list[tuple[int, int]]:
    """Ranges of rows for each of at most so many threads."""
    return list(pairwise(n * k // min(threads, n) for k in range(min(threads, n) + 1)))
