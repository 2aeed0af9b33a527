"""Fixtures that several packages' tests share."""

import gc
import importlib
import os
import signal
import sys

import pytest
from hypothesis import settings

pytest.register_assert_rewrite("steer_env.testing.friction_law")  # what differs is printed, as in a test

# A shell that starts the suite in the background makes it ignore Ctrl-C, which several tests send.
signal.signal(signal.SIGINT, signal.default_int_handler)

# Windows of render_mode="human" that no screen has to show.
os.environ.setdefault("SDL_VIDEODRIVER", "dummy")

# No line about compilation on the standard error that tests look at.
os.environ.setdefault("STEER_ENV_QUIET", "1")

# One thread for linear algebra, as commands take it: tests run side by side, and threads that wait take a processor.
# The libraries read this when they are imported.
os.environ.setdefault("OMP_NUM_THREADS", "1")

# Tests run side by side and change the program that they test: commands start no workers unless they are asked to.
os.environ.setdefault("STEER_ENV_WORKERS", "1")

# The same examples wherever tests run by themselves; `make test` draws others, by a seed that it prints.
settings.register_profile("suite", derandomize=True, deadline=None)
settings.register_profile("random", deadline=None, print_blob=True)
settings.load_profile("suite")


def pytest_collection_finish():
    """Collect garbage less often, and leave out what lives to the end anyway: it was half of the suite's time."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(10_000, 10, 10)


@pytest.fixture(scope="module")
def toy():
    """The toy law, registered for one module's tests only."""
    from steer_env.friction import law

    with law.LAWS.restored():
        module = importlib.import_module("tests.friction.toy_law")
        yield module
        del sys.modules[module.__name__]
