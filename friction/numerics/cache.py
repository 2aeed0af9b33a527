"""Where machine code is kept between processes: one folder for each kernel, signature and state of its sources.

The folder's name holds the hash of all that the code depends on (:mod:`steer_env.friction.numerics.source_hash`), so
nothing stale is ever found, and checkouts and versions share one parent folder. Of processes that need the same kernel
at once, one compiles it and the others wait; numba writes each file under a temporary name and renames it. A folder for
each signature is needed: two processes that add different signatures to one index of numba's can exchange their machine
code.
"""

import gc
import os
import re
import shutil
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any

import numba
import platformdirs
from filelock import FileLock, Timeout

from steer_env.friction.numerics.source_hash import source_hash

try:  # numba compiles under this lock, and a lock of our own beside it could block two threads for good
    from numba.core.compiler_lock import global_compiler_lock as _lock
except ImportError:
    _lock = threading.RLock()  # type: ignore[assignment]
if hasattr(os, "register_at_fork"):  # a child must not inherit a lock that another thread of its parent holds
    os.register_at_fork(before=_lock.acquire, after_in_parent=_lock.release, after_in_child=_lock.release)

FOLDER = "steer-env-kernels"  # in the user's cache folder, or in NUMBA_CACHE_DIR
NEWEST = 64  # folders of one kernel that are kept, by their last use: the whole suite needs fewer
UNUSED = 60 * 24 * 3600.0  # time after which a folder is deleted all the same [s]
WAIT = 300.0  # for another process that compiles the same kernel [s]
PATIENCE = 1.0  # compile time after which a line says what is going on [s]

_depth = 0  # of compilations that are under way, one within the other
_spent = 0.0  # compiling, in this process so far [s]
_said: set[str] = set()  # subjects


def say(subject: str, line: str) -> None:
    """One line on standard error, once for each subject; ``STEER_ENV_QUIET=1`` silences it."""
    if subject not in _said and sys.stderr is not None and os.environ.get("STEER_ENV_QUIET", "0") in ("", "0"):
        with suppress(OSError, ValueError):  # a full disk behind standard error, or a closed one
            print(f"steer-env: {line}", file=sys.stderr, flush=True)
    _said.add(subject)


def compile_seconds() -> float:
    """Time that this process has compiled so far [s]."""
    return _spent


def parent() -> Path:
    """Folder that holds all machine code: in ``NUMBA_CACHE_DIR`` if that is set, else in the user's cache folder."""
    return Path(os.environ.get("NUMBA_CACHE_DIR") or platformdirs.user_cache_dir("steer_env")) / FOLDER


def kernel_folder(kernel: Any, signature: tuple, compiler: str) -> Path | None:
    """Folder of a kernel's machine code; None where it has no source hash or no folder is writable."""
    function = kernel.py_func
    try:
        name = re.sub(r"[^\w.]", "_", f"{function.__module__}.{function.__qualname__}")
        folder = parent() / name / source_hash(kernel, signature, compiler)[:32]
        new = not folder.is_dir()
        folder.mkdir(parents=True, exist_ok=True)
        with TemporaryFile(dir=folder):
            pass
        os.utime(folder)
    except Exception:  # whatever it is, the kernel runs without a cache
        return None
    if new:
        prune(folder.parent)
    return folder


def prune(folder: Path) -> None:
    """Delete what one kernel's folder holds of ours beyond the newest and the recently used; never fails."""
    with suppress(OSError):
        ours = [each for each in folder.iterdir() if re.fullmatch("[0-9a-f]{32}", each.name)]
        ages = sorted((time.time() - each.stat().st_mtime, each) for each in ours)
        for rank, (age, each) in enumerate(ages):
            if rank >= NEWEST or age > UNUSED:
                shutil.rmtree(each, ignore_errors=True)


def compile_cached(kernel: Any, signature: tuple, compile: Callable[[tuple], Any], compiler: str) -> Any:
    """What ``compile(signature)`` returns, from the cache where it is there.

    A kernel that is compiled as part of another one is not cached itself. A cache that fails in any way (a full disk, a
    damaged or foreign file) is left out: the kernel is compiled all the same.

    Parameters
    ----------
    kernel : dispatcher
        That ``compile`` works on.
    signature : tuple of numba types
    compile : callable
        numba's method.
    compiler : {"numba", "fast"}
    """
    global _depth
    with _lock:
        if signature in kernel.signatures:
            return compile(signature)
        folder = None if _depth else kernel_folder(kernel, signature, compiler)
        _choose(kernel, folder)
        _depth += 1
        try:
            with _announce(kernel, folder), _compile_lock(folder), _no_collection():
                return _carefully(kernel, signature, compile, folder)
        finally:
            _depth -= 1


@contextmanager
def _compile_lock(folder: Path | None) -> Iterator[None]:
    """Keep other processes from compiling the same kernel meanwhile; without a lock where there can be none.

    The operating system frees the lock of a process that dies. No process waits in a circle, as a kernel that is
    compiled as part of another one has no folder of its own.
    """
    lock = FileLock(folder / "lock", timeout=WAIT) if folder and not any(folder.glob("*.nbi")) else None
    with suppress(OSError, NotImplementedError, Timeout):
        if lock:
            lock.acquire()
    try:
        yield
    finally:
        if lock:
            lock.release()


def _carefully(kernel: Any, signature: tuple, compile: Callable[[tuple], Any], folder: Path | None) -> Any:
    try:
        return compile(signature)
    except Exception:
        if signature in kernel.signatures:  # compiled, but not stored
            return compile(signature)
        if folder is None or kernel.stats.cache_misses[signature]:  # nothing was read: it is the compiler that failed
            raise
    shutil.rmtree(folder, ignore_errors=True)  # what was read is no machine code
    _choose(kernel, None if folder.exists() else folder)
    return _carefully(kernel, signature, compile, None)


def _choose(kernel: Any, folder: Path | None) -> None:
    """Point a kernel at a folder of the cache, or at none."""
    if folder is not None:
        config: Any = numba.config  # its names are made at run time
        before = config.CACHE_DIR
        config.CACHE_DIR = str(folder)  # read here only, when the kernel looks for its place
        try:
            kernel.enable_caching()
            if str(kernel.stats.cache_path).startswith(str(folder)):
                return
        except Exception:  # no source file (a kernel typed at a prompt): numba caches none of those
            pass
        finally:
            config.CACHE_DIR = before
    if kernel.stats.cache_path is not None:
        with suppress(AttributeError):
            kernel._cache.disable()  # numba has no public way back


@contextmanager
def _no_collection() -> Iterator[None]:
    """No search for reference cycles meanwhile: it takes a sixth of the time in which a plant is compiled."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


@contextmanager
def _announce(kernel: Any, folder: Path | None) -> Iterator[None]:
    """Say what takes so long, if it does: that a kernel is compiled rather than read from the cache."""
    global _spent
    if _depth > 1:
        yield
        return
    misses = sum(kernel.stats.cache_misses.values())

    def compiled() -> bool:
        return sum(kernel.stats.cache_misses.values()) > misses

    def tell() -> None:
        if compiled():
            once = "once, as it is kept" if folder else "in every process, as it cannot be kept"
            say("compiling", f"compiling machine code for this chassis and task, which takes a while; {once}")

    timer = threading.Timer(max(PATIENCE - _spent, 0.1), tell)
    timer.daemon = True
    start = time.monotonic()
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
        if compiled():
            _spent += time.monotonic() - start
            if _spent > PATIENCE:
                tell()
