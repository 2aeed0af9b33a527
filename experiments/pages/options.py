"""A friction law as text, and a progress bar; quick to import, as the command line needs both before any work."""

import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

# Those of steer_env.friction.law and steer_env.friction.sites, which take longer to import.
FRICTION = "LAW[,key=value...], a list of numbers as a:b:c, or a fitted FILE.json"
SITES = "LAW[,key=value...]@SITE, several joined by +; @column_eps and @rack_eps are all sites of that steering"
LONG = 10.0  # time from which on work without a terminal says how far it is [s]


class Friction:
    """A friction law as the command line takes it.

    Parameters
    ----------
    text : str
        ``LAW[,key=value...]``, a list of numbers as ``a:b:c``; the name of a file with a fitted law; or several sites.

    Attributes
    ----------
    given : str
        The text as it was given.
    label : str
        The text; of a file its name without the folder, so that a result does not depend on where it was.
    text : str
        The text; of a file the law that it holds as text, which needs the file no longer.
    parameters
        Parameters of the law, from ``steer_env.friction.make``.

    Raises
    ------
    ValueError
        For a text of another form, an unknown law or parameter, or a value out of range.
    """

    def __init__(self, text: str) -> None:
        from steer_env import friction
        from steer_env.friction import fitted_file, sites

        self.given = self.label = self.text = text
        self.parameters = friction.resolve(text)
        if fitted_file.named(text):
            self.label, self.text = Path(text).name, sites.as_text(self.parameters)


def _lines(total: float | None, timed: bool) -> Callable[[float, str], None]:
    """Says on standard error which tenth of long work is done, each once; ``STEER_ENV_QUIET=1`` silences it."""
    start, said = time.monotonic(), 0

    def notify(part: float, text: str) -> None:
        nonlocal said
        tenths = int(10.0 * part / total + 1e-9) if total else 0
        seconds = time.monotonic() - start
        if said < tenths < 10 and seconds > LONG and os.environ.get("STEER_ENV_QUIET", "0") in ("", "0"):
            said = tenths
            left = f", {_clock(seconds * (total / part - 1.0))} left" if timed and total else ""
            told = f"{10 * tenths} % done after {_clock(seconds)} min{left}, {text}"
            print(f"steer-env: {told}", file=sys.stderr, flush=True)

    return notify


def _clock(seconds: float) -> str:
    """Minutes and seconds."""
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes}:{rest:02d}"


@contextmanager
def progress(what: str, total: float | None = 1.0, timed: bool = False) -> Iterator[Callable[[float, str], None]]:
    """A progress bar on standard error, or a line for every tenth of long work if that is no terminal.

    Yields a function of the part that is done and of what comes next. The bar tells the time so far, and the time left
    as far as it can be told; without a total it only moves, and there are no lines. Where the parts are ``timed``, they
    are those of the time.
    """
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        Progress,
        ProgressColumn,
        Task,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )
    from rich.text import Text

    class Left(ProgressColumn):
        """The time left by the part of the time that is over; the other column has the speed of the last seconds."""

        def render(self, task: Task) -> Text:
            part, over = task.percentage / 100.0, task.elapsed or 0.0
            return Text(_clock(over / part - over) if part else "-:--", style="progress.remaining")

    console = Console(stderr=True)
    if not console.is_terminal:
        yield _lines(total, timed)
        return
    columns: list[ProgressColumn] = [TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn()]
    if total is not None:
        columns += [TextColumn("left"), Left() if timed else TimeRemainingColumn()]
    with Progress(*columns, console=console, transient=True) as shown:
        task = shown.add_task(what, total=total)
        yield lambda part, text: shown.update(task, completed=part, description=text)
