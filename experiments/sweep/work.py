"""What a worker does with one case, the same in this process, in a process of this machine and on a cluster."""

import functools
import importlib
import pickle
import platform
import traceback
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from steer_env.experiments.pages import own_modules, provenance
from steer_env.experiments.sweep.store import Store
from steer_env.friction.numerics.thread_pool import one_blas_thread

PACKAGES = ("numpy", "numba", "llvmlite", "scipy")  # on which the bits of results depend
REFUSED = "refused"  # kind of failure beside the names of exceptions
SAME = "install there what this program runs with, and change no source while a sweep runs"
KEPT_WORK_NOTE = "finished work is kept"


class LostError(OSError):
    """Workers, or a whole cluster, that went away; what was finished is kept if the sweep has a store."""


class Task(NamedTuple):
    """A case on its way to a worker."""

    number: int
    function: str  # "module:name"
    case: bytes  # pickled
    identity: Mapping[str, str]  # of the program that sends it
    modules: tuple[str, ...] = ()  # the user's own, on which the result depends
    key: str = ""  # of the result in the store
    store: tuple[str, str] | None = None  # directory of the store and its mark


class Outcome(NamedTuple):
    """What became of a case: a result, or why there is none."""

    number: int
    result: bytes = b""  # pickled
    failure: str = ""  # name of the exception, or ``REFUSED``; empty where there is a result
    message: str = ""
    details: str = ""  # traceback
    expected: bool = False  # whether the exception is one that tells the user what to change


def identity(modules: Iterable[str] = ()) -> dict[str, str]:
    """What two programs must share for the same results.

    Parameters
    ----------
    modules : iterable of str
        Names of the user's own modules, as that of the function and those with friction laws.

    Returns
    -------
    dict
        Versions, the digest of the project's sources, and those of the modules and of all own ones that they import.

    Raises
    ------
    ValueError
        If the source of a module cannot be read.
    """
    own = {f"module {name}": digest[:16] for name, digest in own_modules.digests(modules).items()}
    return {**_program(), **own}


@functools.cache
def _program() -> dict[str, str]:
    """Versions, and the digest of the project's sources."""
    found = provenance.versions()
    packages = {name: found["packages"][name] for name in PACKAGES}
    own = {"steer-env": found["version"], "sources": found["sources"], "python": platform.python_version()}
    return {**own, **packages}


def identity_with(modules: Iterable[str]) -> dict[str, str]:
    """Import modules, and give the identity with them: of what is imported, whatever becomes of the files."""
    names = list(modules)
    for name in names:
        importlib.import_module(name)
    return identity(names)


def differences(theirs: Mapping[str, str], here: Mapping[str, str]) -> str:
    """In which parts of their identity two programs differ, in words; empty if in none."""
    unequal = [name for name in here if theirs.get(name) != here[name]]
    return ", ".join(f"{name} {theirs.get(name, 'none')} in place of {here[name]}" for name in unequal)


def importable_name(function: Callable[..., Any]) -> str:
    """The name by which a worker imports a function; ValueError for one that cannot be imported."""
    module, name = function.__module__, function.__qualname__
    if "<" in name or module == "__main__":
        raise ValueError(f"a worker cannot import {module}.{name}: define the function at the top of a module")
    return f"{module}:{name}"


def perform_case(task: Task) -> Outcome:
    """Work on a case; never raises, but for Ctrl-C and the like."""
    try:
        mine = identity_with(task.modules)
    except Exception as error:  # whatever a module does when it is imported
        return Outcome(task.number, failure=REFUSED, message=f"cannot run this program ({error}): {SAME}")
    if other := differences(mine, task.identity):
        return Outcome(task.number, failure=REFUSED, message=f"has {other}: {SAME}")
    store = Store.shared(task.store) if task.store else None
    if store and (kept := store.load(task.key)) is not None:
        return Outcome(task.number, kept)  # finished before its worker was lost
    try:
        module, name = task.function.split(":")
        function: Any = functools.reduce(getattr, name.split("."), importlib.import_module(module))
        with one_blas_thread():
            result = pickle.dumps(function(pickle.loads(task.case)), pickle.HIGHEST_PROTOCOL)
    except Exception as error:
        kind, expected = type(error).__name__, isinstance(error, ValueError)
        return Outcome(task.number, b"", kind, str(error), traceback.format_exc(), expected)
    if store:
        store.try_save(task.key, result)
    return Outcome(task.number, result)


def store_for_worker(store: Store | None) -> tuple[str, str] | None:
    """A store as a task names it to workers, which may or may not see its folder."""
    return (str(Path(store.directory).resolve()), store.mark) if store else None
