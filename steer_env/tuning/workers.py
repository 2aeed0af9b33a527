"""Worker processes in which the sub-environments of a tuning vector environment drive their tests.

Processes, as reading the metrics takes longer than the kernels and holds the interpreter's lock: two threads were
0.9 to 1.2 times as fast as one. What a worker does depends on the context and the assist alone. It keeps the contexts
that it has prepared, and prepares one that it does not have: so any of them takes any job, and one that is lost is
replaced without a trace in the results.
"""

import os
import pickle
import warnings
from collections import OrderedDict
from collections.abc import Iterable, Sequence
from concurrent.futures.process import BrokenProcessPool
from typing import Any, NamedTuple

from steer_env.episode.randomise import Conditions
from steer_env.friction.numerics.worker_process import ONE_THREAD, end_with, settle
from steer_env.tuning import context, driving
from steer_env.tuning.context import Context
from steer_env.tuning.driving import PreparedDrive
from steer_env.tuning.scenarios.common.definition import SCENARIOS
from steer_env.vehicle.cars import Car
from steer_env.vehicle.steering.eps import Assist

TRIES = 3  # deaths of workers in a row, with no result between them, after which they are given up


class Course(NamedTuple):
    """A context as it goes to a worker."""

    scenario: str  # name
    car: Car  # without its load
    chassis: str
    drawn: Conditions


class Job(NamedTuple):
    """A context to be prepared, or an assist to be driven in it."""

    key: str  # of the context, unlike any other's
    course: bytes  # a pickled :class:`Course`
    keep: int  # contexts that a worker keeps
    assist: Assist | None = None  # None: the context is only prepared


class _Kept(NamedTuple):
    context: Context
    drives: tuple[PreparedDrive, ...]


_in_worker: OrderedDict[str, _Kept] = OrderedDict()  # by key, the last used one at the end


def perform(job: Job, kept: OrderedDict[str, _Kept] = _in_worker) -> Any:
    """The :class:`Context` of a job, or what its assist gives there (:class:`Tried`).

    Raises
    ------
    ValueError
        The car does not reach the lateral acceleration of a test.
    """
    if job.key not in kept:
        name, car, chassis, drawn = pickle.loads(job.course)
        found = context.context(car, chassis, drawn)
        kept[job.key] = _Kept(found, driving.prepare(SCENARIOS[name], car, chassis, drawn))
    kept.move_to_end(job.key)
    while len(kept) > job.keep:
        kept.popitem(last=False)
    own = kept[job.key]
    return own.context if job.assist is None else driving.tried(own.drives, job.assist)


class Workers:
    """``count`` worker processes, which start with the first job; with one, the jobs run in this process.

    The processes belong to the one that started them; a copy, and a child after a fork, starts its own.
    """

    def __init__(self, count: int) -> None:
        self.count = count
        self._kept: OrderedDict[str, _Kept] = OrderedDict()  # of this process
        self._pool: Any = None
        self._process = 0

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_kept": OrderedDict(), "_pool": None, "_process": 0}

    def run(self, jobs: Sequence[Job]) -> list[Any]:
        """Results of :func:`perform` in the order of the jobs; its errors.

        Raises
        ------
        RuntimeError
            Worker processes die again and again.
        """
        if self.count == 1:
            return [perform(job, self._kept) for job in jobs]
        results: list[Any] = []
        deaths = 0
        while len(results) < len(jobs):
            try:
                for result in self._performed(jobs[len(results) :]):
                    results.append(result)
                    deaths = 0
            except BrokenProcessPool as error:
                self.close()
                deaths += 1
                if deaths == TRIES:
                    raise RuntimeError(
                        f"worker processes died {TRIES} times in a row: is there enough memory for {self.count} of "
                        f"them? Give fewer with workers"
                    ) from error
        return results

    def _performed(self, jobs: Iterable[Job]) -> Iterable[Any]:
        if self._process != os.getpid():
            from joblib.externals.loky import ProcessPoolExecutor

            self._process = os.getpid()
            self._pool = ProcessPoolExecutor(self.count, initializer=_start, initargs=(self._process,), env=ONE_THREAD)
        with warnings.catch_warnings():
            # A worker whose memory has grown is replaced by a new one, which loses nothing.
            warnings.filterwarnings("ignore", "A worker stopped while some jobs were given", UserWarning)
            yield from self._pool.map(perform, jobs)

    def close(self) -> None:
        """End the processes."""
        if self._pool is not None and self._process == os.getpid():
            self._pool.shutdown(kill_workers=True)
        self._pool, self._process = None, 0
        self._kept.clear()


def _start(parent: int) -> None:
    settle()
    end_with(parent)
