"""Fixtures that several packages' tests share."""

import gc
import importlib
import os
import re
import signal
import sys
import time
from pathlib import Path
from traceback import walk_tb

import pytest
from hypothesis import settings

TESTS = Path(__file__).parent

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


# Folders whose tests belong to the whole suite: they take compilers, browsers, devices, networks, or the clock.
WHOLE = ("connect", "experiments/explore", "live/devices", "live/drive")
# What no extra brings: programs, and a package whose pins exclude ours. Without them the whole suite may skip a test.
FOREIGN = re.compile("wine|valgrind|Chromium|Firefox|TypeScript|moviepy")
LATE = "the time of --until has come"

_run: set[str] = set()
_skipped: dict[str, str] = {}  # test, or module of tests -> reason


def pytest_addoption(parser):
    parser.addoption("--run-to", type=Path, help="write the names of the tests that ran to a file")
    parser.addoption("--rest-of", type=Path, help="the whole suite but for the tests that such a file names")
    parser.addoption("--until", type=float, help="Unix time [s] from which on no test starts")


class _Module(pytest.Module):
    """A module of tests, which is skipped where it imports a package that is not installed."""

    def _getobj(self):
        try:
            return super()._getobj()
        except self.CollectError as error:
            cause = error.__cause__
            if not (isinstance(cause, ModuleNotFoundError) and _imported_here(cause.__traceback__)):
                raise
            # xdist passes on one of several modules that say the same.
            pytest.skip(f"{self.nodeid} needs {cause.name}", allow_module_level=True)


def _imported_here(traceback):
    """Whether the last of our files before an import failed is one of the tests: the project itself asks for less."""
    frames = [Path(frame.f_code.co_filename) for frame, _ in walk_tb(traceback)]
    ours = [file for file in frames if file.is_relative_to(TESTS.parent) and not file.is_relative_to(sys.prefix)]
    return ours[-1].is_relative_to(TESTS)


def pytest_pycollect_makemodule(module_path, parent):
    return _Module.from_parent(parent, path=module_path)


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config, items):
    for item in items:
        if any(item.path.is_relative_to(TESTS / folder) for folder in WHOLE):
            item.add_marker("whole")
    if file := config.getoption("rest_of"):
        run = set(file.read_text(encoding="utf-8").splitlines())
        config.hook.pytest_deselected(items=[item for item in items if item.nodeid in run])
        items[:] = [item for item in items if item.nodeid not in run]


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item):
    until = item.config.getoption("until")
    if until and time.time() > until:
        pytest.skip(LATE)


def pytest_runtest_logreport(report):
    if report.when == "call" or report.failed:
        _run.add(report.nodeid)
    pytest_collectreport(report)


def pytest_collectreport(report):
    if report.skipped and not hasattr(report, "wasxfail"):
        _skipped[report.nodeid] = str(report.longrepr[2])


def pytest_sessionfinish(session):
    """Keep what ran; in the whole suite, which has every extra, a skip is a failure."""
    if hasattr(session.config, "workerinput"):
        return
    if file := session.config.getoption("run_to"):
        file.parent.mkdir(exist_ok=True)
        file.write_text("".join(f"{test}\n" for test in sorted(_run - {*_skipped})), encoding="utf-8")
    late = [test for test, reason in _skipped.items() if LATE in reason]
    if late:
        print(f"\n{LATE}: {len(late)} tests were not started, of", *sorted({test.split("::")[0] for test in late}))
    lacking = {test: reason for test, reason in _skipped.items() if not (FOREIGN.search(reason) or LATE in reason)}
    if session.config.getoption("rest_of") and lacking:
        print("\nskipped, though everything is to be there:", *map(": ".join, lacking.items()), sep="\n")
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


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
