"""Where the cases of a sweep run."""

import os
import re
from typing import NamedTuple

MOST_DEFAULT_WORKERS = 4  # processes by default
WORKERS = "STEER_ENV_WORKERS"  # environment variable: their number in place of that
LOCAL = "local"
_ADDRESS = re.compile(r"(tcp|tls)://[^\s/:]+:\d+|(tcp|tls)://\[[0-9a-fA-F:]+\]:\d+")


class Where(NamedTuple):
    """Where the cases of a sweep run."""

    workers: int = 1  # processes of this machine; one without a cluster is this process itself
    cluster: str = ""  # "": none; "local": Dask workers of this machine; otherwise the address of a Dask scheduler

    @classmethod
    def parse(cls, workers: int | None = None, cluster: str | None = None) -> "Where":
        """Read the options of the command line.

        Parameters
        ----------
        workers : int, optional
            Worker processes of this machine. By default ``STEER_ENV_WORKERS``, or one for each processor up to four.
        cluster : str, optional
            ``"local"`` or ``"local:N"`` for Dask workers of this machine, or the address of a scheduler, as
            ``"tcp://10.0.0.1:8786"``.

        Raises
        ------
        ValueError
            If there is no such place, or the two contradict each other.
        """
        if workers is not None and workers < 1:
            raise ValueError(f"--workers must be a whole number of at least 1, got {workers}")
        if cluster is None:
            return cls(workers or usual_workers())
        if found := re.fullmatch(rf"{LOCAL}(?::([1-9]\d*))?", cluster):
            if found[1] and workers is not None:
                raise ValueError(f"--cluster {cluster} and --workers {workers} say the same thing: give one of them")
            return cls(int(found[1]) if found[1] else workers or usual_workers(), LOCAL)
        if not _ADDRESS.fullmatch(cluster):
            raise ValueError(
                f"--cluster must be local, local:N, or the address of a Dask scheduler as tcp://10.0.0.1:8786, got "
                f"{cluster!r}"
            )
        if workers is not None:
            raise ValueError(f"--workers counts processes of this machine; {cluster} has its own: leave --workers out")
        return cls(1, cluster)


def usual_workers() -> int:
    """Number of workers by default; ValueError if ``STEER_ENV_WORKERS`` is no number of workers."""
    given = os.environ.get(WORKERS, "")
    if given and not re.fullmatch(r"[1-9]\d*", given):
        raise ValueError(f"{WORKERS} must be a whole number of at least 1, got {given!r}")
    return int(given) if given else min(processors(), MOST_DEFAULT_WORKERS)


def processors() -> int:
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


SERIAL = Where()
