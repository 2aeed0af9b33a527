"""Workers of a Dask cluster: on this machine, or wherever the workers of a scheduler are.

A scheduler and its workers run whatever a client sends them, so the local cluster listens on this machine alone.

The futures are Dask's own: joblib's backend of Dask (joblib 1.6) waits for ever where a case kills its workers, and
does not tell that a cluster has gone.
"""

import logging
import socket
import time
import warnings
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from typing import Any

from steer_env.experiments.sweep.where import LOCAL, Where
from steer_env.experiments.sweep.work import (
    KEPT_WORK_NOTE,
    REFUSED,
    SAME,
    LostError,
    Outcome,
    Task,
    differences,
    identity,
    identity_with,
    perform_case,
)
from steer_env.friction.numerics.worker_process import ONE_THREAD, settle

PATIENCE = 30.0  # for a scheduler to answer, or for a first worker to be there [s]
RESULT_POLL_INTERVAL, CLUSTER_CHECK_INTERVAL = (
    0.01,
    2.0,
)  # between looks for results, and for the cluster while there are none [s]
LOGGERS = ("distributed", "distributed.client", "tornado", "tornado.application")


def outcomes(tasks: Mapping[int, Task], where: Where) -> Iterator[Outcome]:
    """Outcomes as they come, from the workers of a cluster; the cases of a worker that is lost go to others.

    Raises
    ------
    LostError
        If the cluster is not there, goes away or has no workers.
    ValueError
        If a worker has another version of the program, or runs several cases at once in threads.
    """
    with _client(where) as client:
        _check(client, where, sorted({name for task in tasks.values() for name in task.modules}))
        yield from _collect(client, tasks, where)


def work(task: Task) -> Outcome:
    """Work on a case in a worker of a cluster."""
    from distributed import get_worker

    settle()
    worker = get_worker()
    if worker.state.nthreads > 1:
        found = Outcome(task.number, failure=REFUSED, message=_threads(worker.state.nthreads))
    else:
        found = perform_case(task)
    return found._replace(details=f"the worker {worker.address}") if found.failure == REFUSED else found


def _threads(count: int) -> str:
    return f"runs {count} cases at once in threads, which share one state: start it with --nthreads 1"


def _describe_worker(modules: list[str], dask_worker: Any) -> dict[str, Any]:
    """What a worker is, told by itself."""
    return {"threads": dask_worker.state.nthreads, "identity": identity_with(modules)}


@contextmanager
def _client(where: Where) -> Iterator[Any]:
    """A client of the cluster, which is made here if it is a local one."""
    from distributed import Client, LocalCluster, Security

    if where.cluster.startswith("tls:") and Security().get_connection_args("client").get("ssl_context") is None:
        raise ValueError(
            f"--cluster {where.cluster} needs a certificate of this client: name its files in Dask's configuration "
            "(docs/many_machines.md, Safety)"
        )
    with ExitStack() as stack:
        stack.enter_context(_quiet())
        place: Any = where.cluster
        if where.cluster == LOCAL:
            place = stack.enter_context(
                LocalCluster(
                    n_workers=where.workers,
                    threads_per_worker=1,
                    host="127.0.0.1",
                    dashboard_address=None,
                    worker_dashboard_address=None,
                    silence_logs=logging.CRITICAL,
                    env=ONE_THREAD,
                )
            )
        try:
            if place == where.cluster:
                _require_listener(place)
            client = stack.enter_context(Client(place, timeout=PATIENCE, set_as_default=False))
            client.wait_for_workers(1, timeout=PATIENCE)
        except TimeoutError:
            raise LostError(
                f"the cluster {where.cluster} has no worker after {PATIENCE:g} s: start some with 'dask worker "
                f"{where.cluster} --nthreads 1'; {KEPT_WORK_NOTE}"
            ) from None
        except OSError as error:
            raise LostError(
                f"there is no Dask scheduler at {where.cluster} ({error}): start one with 'dask scheduler', or look "
                f"at address and firewall; {KEPT_WORK_NOTE}"
            ) from None
        yield client


def _require_listener(address: str) -> None:
    """OSError at once where nothing listens at an address, for which a client would wait twice its patience."""
    host, port = address.split("://")[-1].rsplit(":", 1)
    try:
        socket.create_connection((host.strip("[]"), int(port)), timeout=PATIENCE).close()
    except TimeoutError:
        raise ConnectionError(f"no answer within {PATIENCE:g} s") from None


@contextmanager
def _quiet() -> Iterator[None]:
    """Silence log and advice of distributed, whose events are told in sentences here."""
    before = {logger: logger.level for logger in map(logging.getLogger, LOGGERS)}
    for logger in before:
        logger.setLevel(logging.CRITICAL)
    try:
        with warnings.catch_warnings():
            # A case holds all that its result depends on, a car of 0.4 MB among it.
            warnings.filterwarnings("ignore", "Sending large graph")
            yield
    finally:
        for logger, level in before.items():
            logger.setLevel(level)


def _check(client: Any, where: Where, modules: list[str]) -> None:
    """ValueError that names the scheduler or the first worker that must not take part."""
    here = identity(modules)
    try:
        client.run_on_scheduler(identity)  # the tasks pass through it, and it imports what they name
    except Exception as error:
        raise ValueError(
            f"the scheduler {where.cluster} cannot run this program ({error}): {SAME}; {KEPT_WORK_NOTE}"
        ) from None
    for address, found in client.run(_describe_worker, modules, on_error="return").items():
        if isinstance(found, BaseException):
            trouble = f"cannot run this program ({found}): {SAME}"
        elif found["threads"] > 1:
            trouble = _threads(found["threads"])
        elif other := differences(found["identity"], here):
            trouble = f"has {other}: {SAME}"
        else:
            continue
        raise ValueError(f"the worker {address} {trouble}; {KEPT_WORK_NOTE}")


def _collect(client: Any, tasks: Mapping[int, Task], where: Where) -> Iterator[Outcome]:
    from distributed import as_completed

    prefix = f"steer-env-{time.time_ns():x}"
    futures = client.map(work, list(tasks.values()), key=[f"{prefix}-{index}" for index in tasks], pure=False)
    index_of = {future.key: index for future, index in zip(futures, tasks)}
    ready = as_completed(futures, loop=client.loop, with_results=True, raise_errors=False)
    del futures  # a worker keeps a result as long as there is a reference to it
    checked = seen = time.monotonic()
    while index_of:
        if not ready.has_ready():
            time.sleep(RESULT_POLL_INTERVAL)
            if time.monotonic() - checked > CLUSTER_CHECK_INTERVAL:
                if _workers(client, where):
                    seen = time.monotonic()
                elif time.monotonic() - seen > PATIENCE:
                    raise LostError(
                        f"the cluster {where.cluster} has had no worker for {PATIENCE:g} s; {KEPT_WORK_NOTE}"
                    )
                checked = time.monotonic()
            continue
        for future, found in ready.next_batch(block=False):
            index = index_of.pop(future.key)
            yield found if future.status == "finished" else _lost_outcome(index, future, found, where)


def _workers(client: Any, where: Where) -> int:
    """Number of workers; LostError if the scheduler has gone."""
    try:
        if client.status == "running":
            return len(client.nthreads())
    except (OSError, TimeoutError):
        pass
    raise LostError(f"the cluster {where.cluster} went away; {KEPT_WORK_NOTE}")


def _lost_outcome(index: int, future: Any, found: Any, where: Where) -> Outcome:
    """The outcome of a case that gave none: its workers died, or the cluster has gone."""
    if future.status != "error":
        return Outcome(
            index, failure=LostError.__name__, message=f"the cluster {where.cluster} went away; {KEPT_WORK_NOTE}"
        )
    error = found[1] if isinstance(found, tuple) else found
    if type(error).__name__ == "KilledWorker":
        with suppress(AttributeError):
            return Outcome(
                index,
                failure=LostError.__name__,
                message=f"workers died again and again on one case, the last one {error.last_worker.address}: is there "
                f"enough memory for it? {KEPT_WORK_NOTE}",
            )
    return Outcome(index, b"", type(error).__name__, str(error))
