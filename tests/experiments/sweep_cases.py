"""Cases of sweeps in tests: what workers import, and how they tell what they did."""

import os
import signal
import time
from pathlib import Path

import numpy as np
import threadpoolctl

from steer_env import friction
from steer_env.friction.numerics.thread_pool import most_threads


def rooted(x):
    """A result with bits to compare."""
    values = np.sqrt(np.arange(1.0, 400.0) * x).reshape(3, -1)
    return values @ values.T


def as_number(x):
    """A result that depends on the class of the case."""
    return float(x)


def threads(_):
    """Threads that linear algebra and vector environments use here, and the process."""
    counts = {each["num_threads"] for each in threadpoolctl.threadpool_info() if each["user_api"] == "blas"}
    return counts, most_threads(), os.getpid()


def odd(x):
    """A case of which one is refused and one fails."""
    if x == 3:
        raise ValueError("three is odd")
    if x == 5:
        raise KeyError("five")
    return x


def mark(folder, x, what):
    """Leave a file that tells that this process did something with a case."""
    (Path(folder) / f"{what}-{x}-{os.getpid()}-{time.time_ns()}").touch()


def marks(folder, what):
    """The cases with which something was done, one entry for each time."""
    return sorted(int(file.name.split("-")[1]) for file in Path(folder).glob(f"{what}-*"))


def processes(folder):
    """Process ids of all that left a file."""
    return {int(file.name.split("-")[2]) for file in Path(folder).glob("begun-*")}


def counted(case):
    """A case that takes a while and leaves files: folder, number, duration [s], the case that kills its worker once."""
    folder, x, seconds, killer = case
    mark(folder, x, "begun")
    time.sleep(seconds)
    flag = Path(folder) / "killed"
    if x == killer and not flag.exists():
        flag.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    mark(folder, x, "done")
    return rooted(x)


def fatal(x):
    """A case that always kills its worker."""
    os.kill(os.getpid(), signal.SIGKILL)


def knows_law(name):
    """What a worker makes of a friction law that it knows by name only: its process, a parameter and the module."""
    p = friction.make(name)
    return os.getpid(), (p.k, type(p).__module__)
