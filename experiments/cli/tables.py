"""Tables of metrics for the terminal."""

import math
from collections.abc import Mapping

from rich.console import Console
from rich.table import Table
from rich.text import Text

from steer_env.experiments.learning.held_out import Estimate
from steer_env.metrics import Value
from steer_env.targets import Rating

_STYLES = {"green": "green", "amber": "yellow", "red": "red"}


def print_metrics(values: Mapping[str, Value], title: str, lights: Mapping[str, Rating | None] | None = None) -> None:
    """Print metrics with their intervals, with lights if there are any, then what is refused and why."""
    console = Console()
    table = Table(title=title, title_justify="left", box=None, pad_edge=False, padding=(0, 1, 0, 0))
    headings = {"metric": "left", "value": "right", "95 % interval": "right", "unit": "left"}
    for heading, justify in {**headings, **({"light": "left"} if lights else {})}.items():
        table.add_column(heading, justify=justify, no_wrap=True)  # type: ignore[arg-type]
    for name, value in values.items():
        if not value.reason:
            interval = "" if math.isnan(value.low) else f"{value.low:.4g} .. {value.high:.4g}"
            cells = [name, f"{value.value:.4g}", interval, value.unit]
            table.add_row(*cells, *([_light(lights.get(name))] if lights else []))
    if table.row_count:
        console.print(table)
    reasons = {value.reason for value in values.values()}
    if len(values) > 1 and len(reasons) == 1 and "" not in reasons:
        console.print(f"every metric refused: {reasons.pop()}", highlight=False, soft_wrap=True)
        return
    for name, value in values.items():
        if value.reason:
            console.print(f"{name} refused: {value.reason}", highlight=False, soft_wrap=True)


def _light(light: Rating | None) -> str:
    if light is None:
        return ""
    style = _STYLES[light.colour]
    return f"[{style}]{light.colour}[/{style}]" + ("?" if light.sure is False else "")


def print_estimates(values: Mapping[str, Mapping[str, Estimate]], units: Mapping[str, str], title: str) -> None:
    """Print figures, a column for each label, whose headings fold; their intervals are in the reports."""
    table = Table(title=title, title_justify="left", box=None, pad_edge=False, padding=(0, 1, 0, 0))
    table.add_column("figure", overflow="fold")
    for label in values:
        heading = label.replace("_", " ")
        # The figure's name wraps rather than a word of these.
        least = min(max(len(word) for word in heading.split()), 12)
        table.add_column(heading, justify="right", overflow="fold", min_width=least)
    table.add_column("unit", no_wrap=True)
    for name in next(iter(values.values())):
        cells = (found[name] for found in values.values())
        table.add_row(name.replace("_", " "), *(f"{e.value:.3g}" for e in cells), units[name])
    Console().print(table)


def print_laws(
    values: Mapping[str, Mapping[str, Mapping[str, Estimate]]],
    change: Mapping[str, Estimate],
    aim: str,
    units: Mapping[str, str],
    title: str,
) -> None:
    """Print a policy beside the baselines law by law: reward, the policy's change of it, and the figure aimed at.

    Parameters
    ----------
    values : mapping
        Law -> controller -> figure; the first controller is the policy.
    change : mapping
        Law -> the policy's reward less that on the law of its training.
    aim : str
        Name of a figure.
    units : mapping
    title : str
    """
    table = Table(title=title, title_justify="left", box=None, pad_edge=False, padding=(0, 1, 0, 0))
    unit = f" [{units[aim]}]" if units[aim] not in ("", "1") else ""
    for heading in ("law", "controller"):
        table.add_column(heading, overflow="fold")
    # No markup: the unit in brackets is none.
    for heading in ("reward", "change", aim.replace("_", " ") + unit):
        table.add_column(Text(heading), justify="right", overflow="fold")
    for law, controllers in values.items():
        for place, (name, found) in enumerate(controllers.items()):
            first = place == 0
            table.add_row(
                Text(law if first else ""),
                name.replace("_", " "),
                _estimate(found["reward"]),
                _estimate(change[law]) if first else "",
                _estimate(found[aim]),
            )
    Console().print(table)


def _estimate(e: Estimate) -> str:
    """A mean with half its interval, which is symmetric."""
    half = 0.5 * (e.high - e.low)
    return f"{e.value:.3g}" + ("" if math.isnan(half) else f" ± {half:.2g}")
