"""What several commands share: a friction law as an option, and a progress bar."""

import argparse
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from steer_env import friction

FRICTION = "LAW[,key=value...], a list of numbers as a:b:c"


class Friction:
    """A friction law from the command line: its label and its parameters."""

    def __init__(self, text: str) -> None:
        self.label = text
        name, *pairs = text.split(",")
        given: dict[str, Any] = {}
        for pair in pairs:
            key, equals, value = pair.partition("=")
            if not equals or key in given:
                raise argparse.ArgumentTypeError(f"expected {FRICTION}, each key once, got {text!r}")
            given[key] = value.split(":") if ":" in value else value
        try:
            self.parameters = friction.make(name, **given)
        except ValueError as error:
            raise argparse.ArgumentTypeError(str(error)) from None


@contextmanager
def progress(what: str, total: float | None = 1.0) -> Iterator[Callable[[float, str], None]]:
    """A bar on stderr, if that is a terminal; yields what sets the part that is done and what comes next.

    Without a total it only shows that something goes on.
    """
    console = Console(stderr=True)
    columns = TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn()
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as shown:
        task = shown.add_task(what, total=total)
        yield lambda part, text: shown.update(task, completed=part, description=text)
