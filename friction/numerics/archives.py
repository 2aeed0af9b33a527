"""Archives from outside, which may be damaged."""

import errno
import lzma
import struct
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

# What zipfile raises at archives that were cut or changed: beside its own error those of what it is made of.
_DAMAGED = (
    zipfile.BadZipFile,
    zlib.error,
    lzma.LZMAError,
    EOFError,
    NotImplementedError,
    OverflowError,
    RuntimeError,
    struct.error,
)


class DamagedError(ValueError):
    """An archive cannot be read; the text names file and reason."""


@contextmanager
def open_archive(path: Path, kind: str) -> Iterator[zipfile.ZipFile]:
    """A zip archive to read; DamagedError where it is damaged, now or while it is read, OSError where there is none.

    ``kind`` says in words what the file should be.
    """
    with path.open("rb") as file:
        try:
            with zipfile.ZipFile(file) as archive:
                yield archive
        except (*_DAMAGED, UnicodeError, OSError) as error:
            # EINVAL is that of a place which no file has, and bzip2 gives no number.
            if isinstance(error, OSError) and error.errno not in (errno.EINVAL, None):
                raise
            raise DamagedError(f"{path} is no {kind}, which is a zip archive, or it is damaged: {error}") from None
