"""Where the evaluated sets of a study are kept: a journal in its folder, or a database.

A journal of Optuna has no heartbeat, so that a set whose process was killed would count as running for ever. Here each
process holds a lock on a file of its own for as long as it lives, which the system releases however it ends; a running
set whose process has gone is enqueued again. The journal's own lock is released in the same way.
"""

import io
import json
import os
import shlex
import socket
import time
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from optuna.storages import BaseStorage, JournalStorage, RDBStorage
from optuna.storages.journal import JournalFileBackend
from optuna.study import Study
from optuna.trial import FrozenTrial, TrialState

JOURNAL, PROCESSES = "journal.log", ".processes"
PATIENCE = 30.0  # for the lock of a journal, which is held for milliseconds [s]
POLL = 0.02  # between looks at a lock [s]


def _locked(descriptor: int) -> bool:
    """Lock an open file for this process, unless another has it."""
    try:
        if os.name == "nt":
            import msvcrt

            msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined]
        else:
            import fcntl

            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True


class FileLock:
    """A lock on a file, which the system releases when its process ends, whatever ends it."""

    def __init__(self, path: Path, patience: float = PATIENCE) -> None:
        self.path, self.patience = path, patience
        self._descriptor = -1

    def try_lock(self) -> bool:
        """Take the lock if it is free."""
        self.path.parent.mkdir(parents=True, exist_ok=True)
        descriptor = os.open(self.path, os.O_RDWR | os.O_CREAT, 0o644)
        if not _locked(descriptor):
            os.close(descriptor)
            return False
        self._descriptor = descriptor
        return True

    def acquire(self) -> bool:
        """Take the lock, and wait for it.

        Raises
        ------
        OSError
            If another process keeps it.
        """
        end = time.monotonic() + self.patience
        while not self.try_lock():
            if time.monotonic() > end:
                raise OSError(
                    f"{self.path} has been locked by another process for {self.patience:g} s: end that process, or "
                    "wait until it has finished; the lock goes with it, and finished sets are kept"
                )
            time.sleep(POLL)
        return True

    def release(self) -> None:
        """Give the lock back."""
        os.close(self._descriptor)

    def __enter__(self) -> "FileLock":
        self.acquire()
        return self

    def __exit__(self, *_: Any) -> None:
        self.release()


class Process:
    """This process as one that works on a study: a name, and a lock that lives as long as it does."""

    def __init__(self, out: Path) -> None:
        self.name = f"{socket.gethostname()}-{os.getpid()}-{uuid.uuid4().hex[:8]}"
        self._lock = FileLock(out / PROCESSES / self.name)

    def __enter__(self) -> "Process":
        self._lock.acquire()
        return self

    def __exit__(self, *_: Any) -> None:
        self._lock.path.unlink(missing_ok=True)
        self._lock.release()


def _gone(out: Path, name: str | None) -> bool:
    """Whether a process that has worked on a study has ended."""
    if name is None:  # a set is taken and marked with its process by one process at a time
        return True
    path = out / PROCESSES / name
    if not path.is_file():
        return name.startswith(f"{socket.gethostname()}-")  # one of another machine may have another folder
    lock = FileLock(path)
    if not lock.try_lock():
        return False
    path.unlink(missing_ok=True)
    lock.release()
    return True


def requeue_abandoned(study: Study, out: Path) -> int:
    """Enqueue the running sets of processes that have gone again; returns their number.

    To be called by one process at a time.
    """
    count = 0
    for trial in study.get_trials(deepcopy=False, states=(TrialState.RUNNING,)):
        if not _gone(out, trial.user_attrs.get("process")):
            continue
        study.tell(trial.number, state=TrialState.FAIL)
        study.enqueue_trial(trial.params, user_attrs={"again": trial.number})
        count += 1
    return count


def is_on_other_machine(out: Path, trial: FrozenTrial) -> bool:
    """Whether a running set belongs to a process of another machine, whose end cannot be seen from here."""
    name = trial.user_attrs.get("process", "")
    return not name.startswith(f"{socket.gethostname()}-") and not (out / PROCESSES / name).is_file()


def require_whole(path: Path, notify: Any = lambda text: None) -> None:
    """Check a journal; a last line that is torn, as of a process killed while it wrote, is cut off and told.

    Raises
    ------
    ValueError
        A line before the last is no record.
    """
    if not path.is_file():
        return
    with FileLock(path.with_name(f"{path.name}.lock")):
        lines = io.BytesIO(path.read_bytes()).readlines()  # which end with \n alone, as those that head counts
        kept = 0
        for number, line in enumerate(lines, 1):
            try:
                whole = line.endswith(b"\n") and isinstance(json.loads(line), dict)
            except (ValueError, RecursionError):
                whole = False
            if whole:
                kept += len(line)
            elif number == len(lines):
                os.truncate(path, kept)
                notify(f"{path} ended within a line, as of a process killed while it wrote: the torn line is cut off")
            else:
                old, new = (shlex.quote(str(file.resolve())) for file in (path, path.with_name("whole.log")))
                raise ValueError(
                    f"{path}, line {number} of {len(lines)}, is torn: keep the sets before it with `head -n "
                    f"{number - 1} {old} > {new} && mv {new} {old}` while no process works on it, or begin anew with "
                    "another --out"
                )


def study_exists(out: Path, address: str | None = None) -> bool:
    """Whether there can be a study: a journal in the folder, or the address of a database."""
    return address is not None or (out / JOURNAL).is_file()


def open_storage(out: Path, address: str | None = None) -> BaseStorage:
    """The storage of a study: the journal in its folder, or the database at an address of SQLAlchemy.

    Raises
    ------
    ValueError
        The address is none of a database, or nothing answers there.
    """
    if address is None:
        path = out / JOURNAL
        lock: Any = FileLock(path.with_name(f"{path.name}.lock"))  # Optuna only takes and releases it
        return JournalStorage(JournalFileBackend(str(path), lock))
    try:
        return RDBStorage(address)
    except Exception as error:  # of SQLAlchemy or of the driver that the address names
        reason = str(error).strip().splitlines()[0] if str(error).strip() else type(error).__name__
        raise ValueError(
            f"--storage {address} cannot be opened ({reason}): give an address as sqlite:///study.db or "
            "postgresql://USER@HOST/NAME, whose driver is installed, or leave it out for a journal in --out"
        ) from None


@contextmanager
def exclusive_folder(out: Path) -> Iterator[None]:
    """One process at a time, of those that share a folder."""
    with FileLock(out / PROCESSES / "ask", 300.0):
        yield
