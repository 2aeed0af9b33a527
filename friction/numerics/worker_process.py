"""What a worker process is, of a sweep or of a vector environment: one thread, and an end with the program."""

import os
import sys
import threading

from steer_env.friction.numerics.thread_pool import THREADS

# Libraries of linear algebra that would start threads in every worker read these when they are loaded.
ONE_THREAD = dict.fromkeys(
    [f"{name}_NUM_THREADS" for name in ("OMP", "OPENBLAS", "MKL", "BLIS", "VECLIB", "NUMEXPR", "NUMBA")], "1"
)


def settle() -> None:
    """Make this process a worker: its vector environments step in one thread."""
    os.environ[THREADS] = "1"


def end_with(parent: int) -> None:
    """End this process when its parent has gone, however that ended."""

    def watch() -> None:
        while os.getppid() == parent:
            _pause.wait(0.3)
        os._exit(1)

    if sys.platform != "win32":  # there the process id of the parent stays
        threading.Thread(target=watch, daemon=True).start()


_pause = threading.Event()
