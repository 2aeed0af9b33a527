"""The folder in which a sweep keeps what is finished, so that a later one goes on from there.

Every finished case is one file, written under another name and renamed: it is there as a whole or not at all. Its name
is a digest of the function, the case, and what the program and the user's own modules consist of. A file holds a
pickle, as Python's own between processes: a store of people whom you do not trust is not to be resumed.
"""

import hashlib
import json
import os
import shutil
import uuid
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from steer_env.experiments.pages.files import write_json

ABOUT_FILE, CASE_SUFFIX = "sweep.json", ".case"
_DIGEST = 32  # bytes of SHA-256


class Store:
    """Results of finished cases in a folder, which is made if it is missing.

    Parameters
    ----------
    directory : Path
        Of this store alone.
    identity : mapping
        Of the program, as :func:`steer_env.experiments.sweep.work.identity` gives it.
    resume : bool
        Take what is there; otherwise it is deleted.

    Raises
    ------
    ValueError
        If the folder is to be resumed and holds results of another version, or holds other files.
    OSError
        If the folder cannot be written.
    """

    def __init__(self, directory: Path, identity: Mapping[str, str], resume: bool = True) -> None:
        self.directory = directory
        about = self._about(directory)
        if directory.is_dir() and about is None and any(directory.iterdir()):
            raise ValueError(f"{directory} holds other files than those of a sweep: give a new or an empty directory")
        if about is not None and resume and about["identity"] != dict(identity):
            then = about["identity"]
            others = [name for name in {**then, **identity} if then.get(name) != identity.get(name)]
            raise ValueError(
                f"what is finished in {directory} was computed with "
                + ", ".join(f"{name} {then.get(name)} (here {identity.get(name)})" for name in others)
                + ": resume with that version, or begin anew without --resume"
            )
        if about is None or not resume:
            shutil.rmtree(directory, ignore_errors=True)
            directory.mkdir(parents=True, exist_ok=True)
            about = {"mark": uuid.uuid4().hex, "identity": dict(identity)}
            write_json(directory / ABOUT_FILE, about)
        os.utime(directory)
        self.mark: str = about["mark"]

    @staticmethod
    def _about(directory: Path) -> dict[str, Any] | None:
        try:
            return json.loads((directory / ABOUT_FILE).read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return None

    @classmethod
    def shared(cls, place: tuple[str, str]) -> "Store | None":
        """The store of a directory and mark, if this machine sees that very folder."""
        directory, mark = Path(place[0]), place[1]
        about = cls._about(directory)
        if about is None or about["mark"] != mark:
            return None
        found = cls.__new__(cls)
        found.directory, found.mark = directory, mark
        return found

    def load(self, key: str) -> bytes | None:
        """The pickled result of a case; None if it is not there, or is damaged."""
        try:
            data = (self.directory / f"{key}{CASE_SUFFIX}").read_bytes()
        except OSError:
            return None
        result = data[_DIGEST:]
        return result if hashlib.sha256(result).digest() == data[:_DIGEST] else None

    def save(self, key: str, result: bytes) -> None:
        """Keep the pickled result of a case; OSError if it cannot be written."""
        part = self.directory / f".{uuid.uuid4().hex}.part"  # workers of several machines may write at once
        try:
            part.write_bytes(hashlib.sha256(result).digest() + result)
            os.replace(part, self.directory / f"{key}{CASE_SUFFIX}")
        except OSError as error:  # a full disk has no name
            error.filename = error.filename or str(self.directory)
            raise
        finally:
            part.unlink(missing_ok=True)

    def try_save(self, key: str, result: bytes) -> None:
        """Keep a result if that is possible: the program that asked for it will try again."""
        with suppress(OSError):
            self.save(key, result)

    def count(self) -> int:
        """Number of finished cases."""
        return sum(entry.suffix == CASE_SUFFIX for entry in self.directory.iterdir()) if self.directory.is_dir() else 0

    def remove(self) -> None:
        """Delete the folder, when its results are in other hands."""
        shutil.rmtree(self.directory, ignore_errors=True)
