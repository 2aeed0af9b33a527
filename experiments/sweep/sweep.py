"""One function on many cases."""

import functools
import hashlib
import io
import json
import pickle
from collections.abc import Callable, Generator, Iterable, Mapping
from contextlib import closing
from typing import Any, Protocol

from steer_env.experiments.pages import own_modules
from steer_env.experiments.sweep.store import Store
from steer_env.experiments.sweep.where import SERIAL, Where
from steer_env.experiments.sweep.work import (
    KEPT_WORK_NOTE,
    REFUSED,
    LostError,
    Outcome,
    Task,
    identity,
    importable_name,
    perform_case,
    store_for_worker,
)
from steer_env.friction.numerics.worker_process import WorkersDiedError, end_processes, run_in_processes

Notify = Callable[[float, str], None]  # gets the part that is done and what was done last


class Runner(Protocol):
    """:func:`run` with its place and its store chosen, as functions take it that sweep."""

    def __call__(
        self,
        function: Callable[[Any], Any],
        cases: Iterable[Any],
        *,
        notify: Notify = ...,
        words: Any = ...,
        cost: Callable[[Any], float] = ...,
        finished: Callable[[Any, Any], None] = ...,
    ) -> list[Any]:
        """Results in the order of the cases."""


def run(
    function: Callable[[Any], Any],
    cases: Iterable[Any],
    *,
    where: Where = SERIAL,
    store: Store | None = None,
    notify: Notify = lambda *_: None,
    words: Callable[[Any], str] = str,
    modules: Iterable[str] = (),
    cost: Callable[[Any], float] = lambda _: 1,
    finished: Callable[[Any, Any], None] = lambda *_: None,
) -> list[Any]:
    """Call a function with every case, and return the results in the order of the cases.

    The results are the same to the bit wherever the cases run. A case whose worker is lost runs again on another one.

    Parameters
    ----------
    function : callable
        Of one case, defined at the top of a module that the workers can import. It should not write files, as a worker
        may be another machine: what it returns is what comes back.
    cases : iterable
        Things that pickle takes; long ones first. Each holds all that its result depends on, as the store tells cases
        apart by their contents.
    where : Where
        This process, processes of this machine, or a Dask cluster.
    store : Store, optional
        Keeps finished cases. Those that are there are not run again.
    notify : (share, text) -> None
        Is told how far the sweep is.
    words : case -> str
        A case in words, for messages.
    modules : iterable of str
        Own modules that the results depend on beside that of the function, those of the cases' classes, those that have
        registered friction laws, and what these import. The workers import all of them before they read a case.
    cost : case -> float
        What a case takes beside others, by which ``notify`` is told; by default they all take the same.
    finished : (case, result) -> None
        Gets what was not kept as it comes, and may work with it while others go on.

    Raises
    ------
    ValueError
        A case that raises one, with the case in words; a worker of another version, also of the user's own modules; a
        case that cannot be pickled; a module whose source cannot be read.
    LostError
        Workers that die again and again, or a cluster that is not there or goes away.
    RuntimeError
        A case that raises any other exception, with the traceback of the worker.
    """
    cases = list(cases)
    tasks, results = _pending_tasks(importable_name(function), cases, store, words, modules)
    total, done, costs = len(cases), len(cases) - len(tasks), list(map(cost, cases))
    left, whole = sum(costs[number] for number in tasks), sum(costs)
    if done and tasks:
        notify((whole - left) / whole, f"{done} of {total} finished before")
    with closing(_outcomes(tasks, where)) as outcomes:
        for outcome in outcomes:
            case = words(cases[outcome.number])
            if outcome.failure:
                raise _error(outcome, case)
            if store and store.load(key := tasks[outcome.number].key) is None:
                store.save(key, outcome.result)  # a worker that sees the folder has done so
            results[outcome.number] = pickle.loads(outcome.result)
            done, left = done + 1, left - costs[outcome.number]
            notify((whole - left) / whole, f"{done} of {total}, {case}")
            finished(cases[outcome.number], results[outcome.number])
    return results


def _outcomes(tasks: Mapping[int, Task], where: Where) -> Generator[Outcome, None, None]:
    """Outcomes as they come."""
    if where.cluster and tasks:
        from steer_env.experiments.sweep import dask_cluster

        yield from dask_cluster.outcomes(tasks, where)
    elif where.workers > 1 and len(tasks) > 1:
        try:
            with closing(run_in_processes(perform_case, [*tasks.values()], min(where.workers, len(tasks)))) as results:
                yield from (outcome for _, outcome in results)
        except WorkersDiedError as error:
            raise LostError(f"{error} with --workers; {KEPT_WORK_NOTE}") from None
        finally:
            end_processes()
    else:
        yield from map(perform_case, tasks.values())


def _pending_tasks(
    name: str, cases: list[Any], store: Store | None, words: Callable[[Any], str], modules: Iterable[str]
) -> tuple[dict[int, Task], list[Any]]:
    """The tasks that are left to do by index, and a list with the results that are kept."""
    tasks: dict[int, Task] = {}
    results: list[Any] = [None] * len(cases)
    place, named = store_for_worker(store), {name.partition(":")[0], *own_modules.of_laws(), *modules}
    program_of = functools.cache(identity)
    for index, case in enumerate(cases):
        try:
            data, used = _pickle(case)
        except (pickle.PicklingError, AttributeError, TypeError) as error:
            raise ValueError(f"{words(case)} cannot be sent to a worker: {error}") from None
        own = tuple(sorted({*named, *filter(own_modules.is_own, used)}))
        program = program_of(own)
        key = case_key(name, case, program) if store else ""
        if store and (kept := store.load(key)) is not None:
            results[index] = pickle.loads(kept)
        else:
            tasks[index] = Task(index, name, data, program, own, key, place)
    return tasks, results


def _pickle(case: Any) -> tuple[bytes, set[str]]:
    """A case as it goes to a worker, and the modules of the classes and functions in it."""
    modules: set[str] = set()

    class Pickler(pickle.Pickler):
        def reducer_override(self, thing: Any) -> Any:
            modules.add(getattr(thing, "__module__", None) or type(thing).__module__)
            return NotImplemented

    file = io.BytesIO()
    Pickler(file, pickle.HIGHEST_PROTOCOL).dump(case)
    if "__main__" in modules:
        raise TypeError("define its classes at the top of a module")
    return file.getvalue(), modules


def case_key(name: str, case: Any, program: Mapping[str, str] | None = None) -> str:
    """Digest of a function's name, a case, and what a program consists of (by default this one)."""
    import joblib  # takes long to import

    parts = name, joblib.hash(case, hash_name="sha1"), json.dumps(identity() if program is None else program)
    return hashlib.sha256("\n".join(map(str, parts)).encode()).hexdigest()[:40]


def _error(outcome: Outcome, case: str) -> Exception:
    if outcome.failure == REFUSED:
        return ValueError(f"{outcome.details or 'a worker'} {outcome.message}; {KEPT_WORK_NOTE}")
    if outcome.expected:
        return ValueError(f"{case}: {outcome.message}")
    if outcome.failure == "LostError":
        return LostError(outcome.message)
    return RuntimeError(f"{case}: {outcome.failure}: {outcome.message}\n{outcome.details}")
