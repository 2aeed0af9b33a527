"""A friction law as text, and a progress bar; quick to import, as the command line needs both before any work."""

import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

# That of steer_env.friction.law, which takes longer to import.
FRICTION = "LAW[,key=value...], a list of numbers as a:b:c"
LONG = 10.0  # time from which on work without a terminal says how far it is [s]


class Friction:
    """A friction law as the command line takes it.

    Parameters
    ----------
    text : str
        ``LAW[,key=value...]``, a list of numbers as ``a:b:c``.

    Attributes
    ----------
    label : str
        The text.
    parameters
        Parameters of the law, from ``steer_env.friction.make``.

    Raises
    ------
    ValueError
        For a text of another form, an unknown law or parameter, or a value out of range.
    """

    def __init__(self, text: str) -> None:
        from steer_env import friction

        self.label = text
        self.parameters = friction.resolve(text)


def _lines(total: float | None) -> Callable[[float, str], None]:
    """Says on standard error which tenth of long work is done, each once; ``STEER_ENV_QUIET=1`` silences it."""
    start, said = time.monotonic(), 0

    def notify(part: float, text: str) -> None:
        nonlocal said
        tenths = int(10.0 * part / total + 1e-9) if total else 0
        seconds = time.monotonic() - start
        if said < tenths < 10 and seconds > LONG and os.environ.get("STEER_ENV_QUIET", "0") in ("", "0"):
            said = tenths
            clock = f"{seconds // 60:.0f}:{seconds % 60:02.0f}"
            print(f"steer-env: {10 * tenths} % done after {clock} min, {text}", file=sys.stderr, flush=True)

    return notify


@contextmanager
def progress(what: str, total: float | None = 1.0) -> Iterator[Callable[[float, str], None]]:
    """A progress bar on standard error, or a line for every tenth of long work if that is no terminal.

    Yields a function of the part that is done and of what comes next. The bar tells the time so far, and the time left
    as far as it can be told; without a total it only moves, and there are no lines.
    """
    from rich.console import Console
    from rich.progress import BarColumn, Progress, ProgressColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    console = Console(stderr=True)
    if not console.is_terminal:
        yield _lines(total)
        return
    columns: list[ProgressColumn] = [TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn()]
    if total is not None:
        columns += [TextColumn("left"), TimeRemainingColumn()]
    with Progress(*columns, console=console, transient=True) as shown:
        task = shown.add_task(what, total=total)
        yield lambda part, text: shown.update(task, completed=part, description=text)
