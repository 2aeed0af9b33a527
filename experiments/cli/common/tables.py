"""Tables for the terminal."""

import math
import os
from collections.abc import Mapping, Sequence
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from steer_env.experiments.cli.common.messages import in_options
from steer_env.experiments.learning.assist_suite import Result
from steer_env.experiments.learning.held_out import Estimate
from steer_env.experiments.reports import friction_fit, friction_fit_page, steering_fit
from steer_env.experiments.reports.car_quantities import Quantity
from steer_env.experiments.studies.common.battery import Difference
from steer_env.friction import Compared
from steer_env.hand_torque import Identified
from steer_env.hand_torque.fit import at_ends
from steer_env.metrics import Value, definition
from steer_env.targets import Rating

PIPED_WIDTH = 160  # columns of a table that is not printed on a terminal

_STYLES = {"green": "green", "amber": "yellow", "red": "red"}


class _Console(Console):
    def on_broken_pipe(self) -> None:
        """Leave a closed pipe to ``main``, which ends the program quietly with the exit code that is usual for it."""
        raise BrokenPipeError


def console() -> Console:
    """A console as wide as the terminal, or wide enough for every table where there is none."""
    found = _Console()
    return found if found.is_terminal or "COLUMNS" in os.environ else _Console(width=PIPED_WIDTH)


def _table() -> Table:
    return Table(box=None, pad_edge=False, padding=(0, 1, 0, 0))


def _print(printer: Console, table: Table, title: str) -> None:
    """Print a table below its title, which is longer than a narrow table at times and stays on one line."""
    printer.print(title, style="table.title", highlight=False, markup=False, soft_wrap=True)
    printer.print(table)


def print_metrics(values: Mapping[str, Value], title: str, ratings: Mapping[str, Rating | None] | None = None) -> None:
    """Print metrics with their intervals and, if given, their ratings; then what is refused and why."""
    printer = console()
    if not values:
        printer.print(f"{title}: no metrics are defined for this manoeuvre", highlight=False, soft_wrap=True)
        return
    table = _table()
    headings = {"metric": "left", "value": "right", "95 % interval": "right", "unit": "left"}
    for heading, justify in {**headings, **({"rating": "left"} if ratings else {})}.items():
        table.add_column(heading, justify=justify, no_wrap=True)  # type: ignore[arg-type]
    for name, value in values.items():
        if not value.reason:
            interval = "" if math.isnan(value.low) else f"{value.low:.4g} .. {value.high:.4g}"
            cells = [name, f"{value.value:.4g}", interval, value.unit]
            table.add_row(*cells, *([_rating(ratings.get(name))] if ratings else []))
    if table.row_count:
        _print(printer, table, title)
    plain: dict[str, Any] = {"highlight": False, "soft_wrap": True, "markup": False}  # a reason may hold brackets
    reasons = dict.fromkeys(value.reason for value in values.values())
    if len(values) > 1 and len(reasons) == 1 and "" not in reasons:
        printer.print(f"every metric refused: {in_options(next(iter(reasons)))}", **plain)
        reasons = {}
    for reason in filter(None, reasons):
        refused = ", ".join(name for name, value in values.items() if value.reason == reason)
        printer.print(f"{refused} refused: {in_options(reason)}", highlight=False, soft_wrap=True)
    for note in dict.fromkeys(note for value in values.values() for note in value.notes):
        printer.print(f"note: {note}", **plain)


def _rating(rating: Rating | None) -> str:
    """A coloured word; a question mark where the interval reaches into another band."""
    if rating is None:
        return ""
    style = _STYLES[rating.colour]
    return f"[{style}]{rating.colour}[/{style}]" + ("?" if rating.sure is False else "")


def print_differences(differences: Mapping[str, Difference], title: str) -> None:
    """Print the differences of metrics with their intervals, and whether a driver notices."""
    table = _table()
    headings = {"metric": "left", "difference": "right", "±": "right", "unit": "left", "relative": "right"}
    for heading, justify in {**headings, "to a driver": "left"}.items():
        table.add_column(heading, justify=justify, no_wrap=True)  # type: ignore[arg-type]
    for name, found in differences.items():
        reach = f"{found.half_width:.2g}" if found.half_width > 0.0 else ""
        share = f"{found.share:.1%}" if math.isfinite(found.share) else ""
        table.add_row(name, f"{found.value:.3g}", reach, definition(name).unit, share, str(found.perception))
    _print(console(), table, title)


def print_estimates(values: Mapping[str, Mapping[str, Estimate]], units: Mapping[str, str], title: str) -> None:
    """Print the means of metrics, a column for each controller; the reports have the intervals."""
    table = _table()
    table.add_column("metric", overflow="fold")
    for label in values:
        heading = label.replace("_", " ")
        # A narrow terminal folds the names of the metrics rather than a word of the headings.
        least = min(max(len(word) for word in heading.split()), 12)
        table.add_column(heading, justify="right", overflow="fold", min_width=least)
    table.add_column("unit", no_wrap=True)
    for name in next(iter(values.values())):
        cells = (found[name] for found in values.values())
        table.add_row(name.replace("_", " "), *(f"{e.value:.3g}" for e in cells), units[name])
    _print(console(), table, title)


def print_shift(rows: Mapping[str, Mapping[str, Any]], aim: str, units: Mapping[str, str], title: str) -> None:
    """Print a policy beside the best baseline under each change of each condition.

    Parameters
    ----------
    rows : mapping
        Condition -> label of the change -> :class:`steer_env.experiments.learning.shift.Cell`.
    aim : str
        Name of the metric that the training is for.
    units : mapping
        Metric -> unit.
    title : str
    """
    table = _table()
    unit = f" [{units[aim]}]" if units[aim] not in ("", "1") else ""
    shown = aim.replace("_", " ") + unit
    for heading in ("condition", ""):
        table.add_column(heading, overflow="fold")
    # Text, as rich would take a unit in brackets for markup.
    for heading in ("reward", "change", shown, "best baseline", "its reward", f"its {shown}"):
        table.add_column(Text(heading), justify="right", overflow="fold")
    for over, cells in rows.items():
        for place, (label, cell) in enumerate(cells.items()):
            found = cell.values["policy"]
            others = [name for name in cell.values if name not in ("policy", "zero")]
            best = max(others, key=lambda name: cell.values[name]["reward"].value, default=None)
            of_best = [_estimate(cell.values[best][metric]) for metric in ("reward", aim)] if best else ["", ""]
            table.add_row(
                over if place == 0 else "",
                Text(label),
                *map(_estimate, (found["reward"], cell.lost, found[aim])),
                (best or "").replace("_", " "),
                *of_best,
            )
    _print(console(), table, title)


def print_friction_shift(found: Any) -> None:
    """Print what the entries of a benchmark lose on their worst law.

    Parameters
    ----------
    found : steer_env.experiments.learning.friction_shift.Shift
    """
    table = _table()
    for heading in ("case", "entry", "trained on", "worst law"):
        table.add_column(heading, overflow="fold")
    for heading in ("share of the range lost there", "seeds shifted"):
        table.add_column(heading, justify="right", overflow="fold")
    for name, rows in found.cases.items():
        for place, row in enumerate(rows):
            table.add_row(
                name if place == 0 else "",
                row.entry.replace("_", " "),
                Text(", ".join(row.laws)),
                Text(row.worst),
                _estimate(row.loss[row.worst]),
                f"{row.shifted} of {row.seeds}" if row.laws else "",
            )
    _print(console(), table, f"Friction shift, {found.episodes} held-out episodes: means over the seeds")


def _estimate(e: Estimate) -> str:
    """A mean and half the width of its interval, which is symmetric."""
    half = 0.5 * (e.high - e.low)
    return f"{e.value:.3g}" + ("" if math.isnan(half) else f" ± {half:.2g}")


def print_quantities(found: Sequence[Quantity], title: str) -> None:
    """Print derived quantities with their ranges and a mark where a value is outside, then how many are."""
    table = _table()
    headings = {"quantity": "left", "value": "right", "unit": "left", "range": "right", "": "left"}
    for heading, justify in headings.items():
        table.add_column(heading, justify=justify, no_wrap=heading != "quantity")  # type: ignore[arg-type]
    group = ""
    for quantity in found:
        if quantity.group != group:
            group = quantity.group
            table.add_row(f"[bold]{group}[/bold]")
        mark = "[bold red]outside[/bold red]" if quantity.plausible is False else ""
        value = "" if math.isnan(quantity.value) else f"{quantity.value:.4g}"
        table.add_row(quantity.title, value, quantity.unit, quantity.limits, mark)
    printer = console()
    _print(printer, table, title)
    outside = sum(quantity.plausible is False for quantity in found)
    rated = sum(quantity.plausible is not None for quantity in found)
    printer.print(f"{outside} of {rated} quantities with a range are outside it", highlight=False, soft_wrap=True)


def print_suite(found: Sequence[Result], title: str, whole: bool) -> None:
    """Print what fails in the suite for assists and the worst of each drive, or the ``whole``; then the verdict."""
    table = _table()
    headings = ("drive", "condition", "worst", "at", "limit", "unit", "holds", "beyond")
    for heading in headings:
        table.add_column(heading, justify="right" if heading in ("worst", "limit", "beyond") else "left")
    worst: dict[str, Result] = {}
    for one in found:
        if one.drive not in worst or one.worst / one.limit > worst[one.drive].worst / worst[one.drive].limit:
            worst[one.drive] = one
    for one in found:
        if whole or not one.holds or worst[one.drive] is one:
            holds = "[green]yes[/green]" if one.holds else "[red]no[/red]"
            value = "" if math.isnan(one.worst) else f"{one.worst:.3g}"
            beyond = f"{one.beyond} of {one.rows}" if one.beyond else ""
            table.add_row(one.drive, one.condition, value, one.at, f"{one.limit:g}", one.unit, holds, beyond)
    printer = console()
    _print(printer, table, title)
    kept = zip(*((one.holds, one.beyond, one.excused, one.rows) for one in found))
    holding, beyond, excused, rows = (sum(of) for of in kept)
    printer.print(
        f"holds in {holding} of {len(found)} conditions; in {beyond} of {rows} drives the car with its boost alone is "
        f"beyond the limit, and the assist is held against it; in {excused} it fails, and they are excused",
        style="bold",
    )


def print_fits(found: friction_fit.Found) -> None:
    """Print what each law leaves of the friction, its parameters, the warnings of the best ones, and the verdict."""
    table = _table()
    saturated = f"saturated [{found.record.units['torque']}]"
    alone = ("left alone [%]",) if any(each.alone is not None for each in found.laws) else ()
    for heading in ("law", "left [%]", "95 % interval", *alone, saturated, "parameters"):
        # Text, as rich would take a unit in brackets for markup.
        table.add_column(
            Text(heading), justify="left" if heading in ("law", "parameters") else "right", overflow="fold"
        )
    for each in found.laws:
        if each.fit is None:
            table.add_row(each.law, "", "", "", *("" for _ in alone), Text(f"not fitted: {each.refused}"))
            continue
        value, low, high = friction_fit_page.shares(found, each)
        shown = [
            f"{row.name} = {_first_of(row.value)}{f' {row.unit}' if row.unit != '1' else ''}"
            + ("" if row.determined else " (?)")
            for row in friction_fit_page.rows(each.fit, found.record.units)
        ]
        table.add_row(
            each.law,
            f"{value:.3g}",
            f"{low:.3g} .. {high:.3g}",
            *([] if each.alone is None else [f"{friction_fit_page.percent(found, each.alone):.3g}"]),
            f"{found.saturated[each.law]:.3g}",
            Text(", ".join(shown)),
        )
    printer = console()
    _print(printer, table, f"{found.name}: what is left of the mean friction on the part that judges")
    plain: dict[str, Any] = {"highlight": False, "soft_wrap": True, "markup": False}
    others = 0
    for each in found.laws:
        told = [] if each.fit is None else friction_fit_page.warnings(each.fit, found.record.units)
        others += len(told) if found.apart(each) else 0
        for warning in [] if found.apart(each) else told:
            printer.print(f"{each.law}: {warning}", **plain)
    for each in found.equals[:1]:
        if (text := _asymmetry(each)) is not None:
            printer.print(text, **plain)
    if others:
        printer.print(f"{others} warnings of the laws that leave more are on the page and in their files", **plain)
    printer.print(friction_fit_page.verdict(found), style="bold", **plain)


def _asymmetry(each: Compared) -> str | None:
    """What the offset of a law would be if it were none of the sensor; None where it may be zero."""
    value, low, high = (math.nan,) * 3 if each.fit is None else each.fit.asymmetry
    if not (low > 0.0 or high < 0.0):
        return None
    return (
        f"{each.law}: the offset is a zero of the sensor, or an asymmetry of {value:.3g} [{low:.3g}, {high:.3g}] "
        "(steering.friction_asymmetry), which the record does not tell apart"
    )


def _first_of(value: str) -> str:
    """The first four values of an array, which the page shows in full."""
    values = value.split(", ")
    return ", ".join([*values[:4], "…"] if len(values) > 4 else values)


def print_steering(found: Identified, names: Sequence[str]) -> None:
    """Print what each law leaves of the hand torque of drives, the kind of friction, and the verdict."""
    table = _table()
    for heading in (
        "law",
        "unseen blocks [N m]",
        "last part [N m]",
        "95 % interval",
        "better than damping by",
        "95 %",
        "level [N m]",
        "95 %",
    ):
        table.add_column(Text(heading), justify="left" if heading == "law" else "right", overflow="fold")
    for row in found.rows:
        dry = row in found.dry
        table.add_row(
            steering_fit.title(row.name),
            f"{row.crossed:.3f}",
            f"{row.residual:.3f}",
            _interval_text(row.interval),
            f"{row.adds:.3f}",
            _interval_text(row.adds_interval),
            f"{row.level:.3f}" if dry else "",
            _interval_text(row.level_interval) if dry else "",
        )
    printer = console()
    _print(printer, table, f"{', '.join(names)}: hand torque from angle and speed, where nothing was fitted")
    plain: dict[str, Any] = {"highlight": False, "soft_wrap": True, "markup": False}
    if len(found.equals) > 1:
        printer.print(f"cannot be told apart: {', '.join(found.equals)}", **plain)
    printer.print(f"kind of friction: {found.chosen}", **plain)
    for text in at_ends(found):
        printer.print(text, **plain)
    for each in found.across:
        gain = f"friction gains {each.adds:.3f} N m [{each.adds_interval[0]:.3f}, {each.adds_interval[1]:.3f}]"
        gain = gain if found.alone[each.fitted_on].dry else "without a friction law"
        judged = f"fitted on {names[each.fitted_on]} and judged on {names[each.judged_on]}"
        printer.print(f"{judged}: {each.residual:.3f} N m, {gain}", **plain)
    if found.differ:
        printer.print(f"the drives differ in {', '.join(found.differ)}: they may be of different cars", **plain)
    verdict, *details = steering_fit.make_page(found, names, "").verdict
    for text in details:
        printer.print(text, **plain)
    printer.print(verdict, style="bold", **plain)


def _interval_text(ends: tuple[float, float]) -> str:
    return f"{ends[0]:.3f} .. {ends[1]:.3f}"
