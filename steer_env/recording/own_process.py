"""Readers of other packages, called in a process of their own: damaged files may crash their compiled code."""

import importlib.util
import os
import pickle
import subprocess
import sys
import tempfile
from collections.abc import Callable
from typing import TypeVar

from steer_env.friction.numerics.extras import install

Found = TypeVar("Found")

_CHILD = """
import sys
sys.path[:] = sys.argv[1:]  # without the working directory, whose modules are the user's
import pickle
out, sys.stdout = sys.stdout.buffer, sys.stderr  # the packages print
function, arguments = pickle.load(sys.stdin.buffer)
try:
    answer = (function(*arguments),)
except Exception as error:  # damaged files raise exceptions of many types
    answer = " ".join(str(error).split()) or type(error).__name__
pickle.dump(answer, out, pickle.HIGHEST_PROTOCOL)
"""


def require(package: str, what: str, extra: str) -> None:
    """ValueError with the command that installs a package of an extra, where it is missing."""
    if importlib.util.find_spec(package) is None:
        raise ValueError(f"{what} need the package {package}: {install(extra)}")


def read(kind: str, function: Callable[..., Found], *arguments: object) -> Found:
    """What a function of a module returns in a process of its own, whose temporary files go with it.

    Raises
    ------
    ValueError
        With the reason, if the function raises anything or the process ends: the file is damaged, not ``kind``.
    """
    with tempfile.TemporaryDirectory(prefix="steer-env-") as folder:
        done = subprocess.run(
            [sys.executable, "-c", _CHILD, *sys.path],
            input=pickle.dumps((function, arguments)),
            capture_output=True,
            check=False,
            env={**os.environ, "TMPDIR": folder, "TEMP": folder},
        )
    answer: tuple[Found] | str = pickle.loads(done.stdout) if done.returncode == 0 else "the reader crashed"
    if isinstance(answer, str):
        raise ValueError(f"cannot be read as {kind} ({answer}); is it complete?")
    return answer[0]
