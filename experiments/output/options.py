"""A friction law as text, and a progress bar; quick to import, as the command line needs both before any work."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

# That of steer_env.friction.law, which takes longer to import.
FRICTION = "LAW[,key=value...], a list of numbers as a:b:c"


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


@contextmanager
def progress(what: str, total: float | None = 1.0) -> Iterator[Callable[[float, str], None]]:
    """A progress bar on standard error, if that is a terminal.

    Yields a function of the part that is done and of what comes next. The bar tells the time so far, and the time left
    as far as it can be told; without a total it only moves.
    """
    from rich.console import Console
    from rich.progress import BarColumn, Progress, ProgressColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    console = Console(stderr=True)
    columns: list[ProgressColumn] = [TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn()]
    if total is not None:
        columns += [TextColumn("left"), TimeRemainingColumn()]
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as shown:
        task = shown.add_task(what, total=total)
        yield lambda part, text: shown.update(task, completed=part, description=text)
