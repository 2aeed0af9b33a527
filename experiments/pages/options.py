"""A friction law as text, and a progress bar; quick to import, as the command line needs both before any work."""

import math
import os
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

# Those of steer_env.friction.law and steer_env.friction.sites, which take longer to import.
FRICTION = "LAW[,key=value...], a list of numbers as a:b:c, or a fitted FILE.json"
SITES = "LAW[,key=value...]@SITE, several joined by +; @column_eps, @rack_eps and @steer_by_wire are all its sites"
LONG = 3.0  # time from which on work without a terminal says what it does and how far it is [s]


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
        if fitted_file.is_file_name(text):
            self.label, self.text = Path(text).name, sites.as_text(self.parameters)


class _Pace:
    """What is left of long work by the pace since its first part was done, before which kernels are compiled."""

    def __init__(self, total: float | None) -> None:
        self.total, self.start = total, time.monotonic()
        self._first: tuple[float, float] | None = None

    def left(self, part: float) -> float | None:
        """Time that is left [s]; None where nothing is known of it yet."""
        now = time.monotonic()
        if not self.total or part <= 0.0:
            return None
        self._first = self._first or (now, part)
        since, done = now - self._first[0], part - self._first[1]
        return since / done * (self.total - part) if done > 0.0 else None


@contextmanager
def _lines(what: str, pace: _Pace, every: float) -> Iterator[Callable[[float, str], None]]:
    """Says on standard error what long work does and which tenth of it is done; ``STEER_ENV_QUIET=1`` silences it.

    A line is said at least ``every`` so many seconds.
    """
    said, last = 0, pace.start
    quiet = os.environ.get("STEER_ENV_QUIET", "0") not in ("", "0")

    def tell(text: str) -> None:
        if not quiet:
            print(f"steer-env: {text}", file=sys.stderr, flush=True)

    def notify(part: float, text: str) -> None:
        nonlocal said, last
        left = pace.left(part)
        tenths = int(10.0 * part / pace.total + 1e-9) if pace.total else 0
        seconds = time.monotonic() - pace.start
        due = time.monotonic() - last >= every
        if (said < tenths < 10 and seconds > LONG) or due:
            said, last = tenths, time.monotonic()
            rest = "" if left is None else f", {_clock(left)} left"
            tell(f"{10 * tenths} % done after {_clock(seconds)} min{rest}, {text}")

    first = threading.Timer(LONG, tell, [what])
    first.daemon = True
    first.start()
    try:
        yield notify
    finally:
        first.cancel()


def _clock(seconds: float) -> str:
    """Minutes and seconds."""
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes}:{rest:02d}"


@contextmanager
def progress(what: str, total: float | None = 1.0, every: float = math.inf) -> Iterator[Callable[[float, str], None]]:
    """A progress bar on standard error, or a line for every tenth of long work if that is no terminal.

    Yields a function of the part that is done and of what comes next. Both tell the time so far, and the time left as
    far as it can be told; without a total the bar only moves, and one line says what goes on. Without a terminal there
    is a line at least ``every`` so many seconds, as often as the function is called.
    """
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    console, pace = Console(stderr=True), _Pace(total)
    if not console.is_terminal:
        with _lines(what, pace, every) as notify:
            yield notify
        return
    rest = TextColumn("left {task.fields[left]}", style="progress.remaining")
    columns = [TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn(), *([rest] if total else [])]
    with Progress(*columns, console=console, transient=True) as shown:
        task = shown.add_task(what, total=total, left="-:--")

        def update(part: float, text: str) -> None:
            left = pace.left(part)
            shown.update(task, completed=part, description=text, left="-:--" if left is None else _clock(left))

        yield update
