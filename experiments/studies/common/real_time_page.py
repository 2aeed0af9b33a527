"""The page of the command ``real-time``: marks met or missed, tables, and the numbers for its JSON file.

The picture of durations: the share that is longer than each length.
"""

import os
import platform
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FormatStrFormatter

from steer_env.experiments.pages.pages import Page
from steer_env.experiments.pages.style import DASHES, PALETTE, as_svg, legend, new_figure
from steer_env.experiments.studies.common.device_latency import Latency
from steer_env.experiments.studies.common.real_time_loop import Results, Row, merge_durations
from steer_env.live.real_time.measure import Durations, Measured
from steer_env.recording.driven import MANY_MISSED


@as_svg
def exceedance(panels: Mapping[str, Mapping[str, Durations]]) -> Figure:
    """Share of durations that exceed a length, over that length, both logarithmic; a panel for each title.

    Parameters
    ----------
    panels : title -> label -> durations
    """
    figure = new_figure(4.8 * len(panels), 3.4)
    grid = figure.subplots(1, len(panels), squeeze=False, sharey=True).ravel()
    for axes, (title, lines) in zip(grid, panels.items()):
        for k, (label, durations) in enumerate(lines.items()):
            filled = np.flatnonzero(durations.histogram)
            longer = durations.histogram.sum() - np.cumsum(durations.histogram)[filled]
            axes.step(
                1e6 * durations.width * (filled + 1),
                np.where(longer > 0, longer, np.nan) / durations.histogram.sum(),
                where="post",
                color=PALETTE[k % len(PALETTE)],
                linestyle=DASHES[k % len(DASHES)],
                label=label,
            )
        axes.set(xscale="log", yscale="log", xlabel="[µs]", title=title)
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_formatter(FormatStrFormatter("%g"))  # powers would be set by matplotlib itself
    grid[0].set_ylabel("share that is longer")
    legend(figure, grid[0])
    return figure


class Table(NamedTuple):
    """A table of text."""

    caption: str
    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    note: str = ""


class Section(NamedTuple):
    """A claim and what the measurement says of it."""

    title: str
    claim: str
    evidence: str
    verdict: str
    limits: str
    table: Table


PAGE_NAME = "real_time"
FACTOR = 1.2  # of a percentile of the lateness over that of the bare loop, that a loop may have at most
WORK = 20e-6  # of a sample at the 99th percentile, that the car on two tracks may take [s]
WORK_CHASSIS = "two_track"
PERCENTILES = (50.0, 99.0, 99.9)
_ANOTHER = "A figure of this machine says nothing about another."


def machine() -> str:
    """Kernel, governor of the processor and load of this machine, as text."""
    file = Path("/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor")
    governor = file.read_text(encoding="utf-8").strip() if file.exists() else "not told by the system"
    load = os.getloadavg()[0]
    version = platform.version()
    return (
        f"{platform.system()} {platform.release()} ({version}), {os.cpu_count()} processors, governor: {governor}, "
        f"load at the end {load:.1f}"
    )


def ratios(rows: Sequence[Row]) -> dict[float, float]:
    """Lateness of the loop over that of the bare loop, by percentile."""
    loop, bare = (merge_durations(rows, lambda found, i=i: found[i]) for i in (0, 1))  # type: ignore[misc]
    return {percent: loop.percentile(percent) / bare.percentile(percent) for percent in PERCENTILES}


def _us(value: float) -> str:
    return f"{1e6 * value:.1f}" if value < 1e-4 else f"{1e6 * value:.0f}"


def _cells(durations: Durations) -> list[str]:
    return [*(_us(durations.percentile(p)) for p in PERCENTILES), _us(durations.worst)]


def _judge(kept: bool) -> str:
    return "met" if kept else "missed"


HEAD = (*(f"{percent:g} %" for percent in PERCENTILES), "worst")
_LOST_NOTE = "Lost: jumps that no torque followed before the next one, as where the watchdog had faded it."
_LATENCY_HEAD = ("way", "jumps", "50 %", "90 %", "worst", "lost", "clipped")


def tables(results: Results) -> list[Table]:
    """Lateness, time of a sample, lateness under conditions, and latency through devices [us]."""
    rows = results.rows
    under, lost = _reasons(results.conditions), f"{_LOST_NOTE} {_reasons(results.latencies)}".strip()
    late = [[row.chassis, row.law, *_cells(row.found.lateness), str(row.found.counts["missed"])] for row in rows]
    late += [["all", "all", *_cells(merge_durations(rows, lambda f: f.lateness)), ""]]
    late += [["bare loop", "", *_cells(merge_durations(rows, lambda f: f.bare)), ""]]
    work = [[row.chassis, row.law, *_cells(row.found.work), _clip(row.found)] for row in rows]
    return [
        Table("Lateness at the deadlines [µs]", ("chassis", "law", *HEAD, "missed"), late),
        Table("Time of a sample [µs]", ("chassis", "law", *HEAD, "clipped"), work),
        Table("Lateness under conditions [µs]", ("condition", "loop", *HEAD, "missed"), _conditions(results), under),
        Table("From a jump of the angle to that of the torque [µs]", _LATENCY_HEAD, _ways(results), lost),
    ]


def _clip(found: Measured) -> str:
    return f"{found.counts['clipped'] / found.counts['ticks']:.1%}"


def _conditions(results: Results) -> list[list[str]]:
    lines = []
    for name, found in results.conditions.items():
        if isinstance(found, str):
            lines.append([name, "not allowed", *[""] * (len(HEAD) + 1)])
        else:
            lines.append([name, "car", *_cells(found.lateness), str(found.counts["missed"])])
            lines.append(["", "bare", *_cells(found.bare), ""])
    return lines


def _ways(results: Results) -> list[list[str]]:
    lines = []
    for name, found in results.latencies.items():
        if isinstance(found, str):
            lines.append([name, "none", *[""] * (len(_LATENCY_HEAD) - 2)])
            continue
        d = found.durations
        times = [d.percentile(50.0), d.percentile(90.0), d.worst]
        lines.append([name, str(_number(d)), *map(_us, times), str(found.lost), f"{found.clipping:.1%}"])
    return lines


def _reasons(found: Mapping[str, Any]) -> str:
    """Why some of it is missing."""
    reasons = dict.fromkeys(reason for reason in found.values() if isinstance(reason, str))
    return " ".join(f"{reason[0].upper()}{reason[1:]}." for reason in reasons)


def _number(durations: Durations) -> int:
    return int(durations.histogram.sum())


def verdict(results: Results) -> list[str]:
    """A sentence for each mark, which is met or missed."""
    rows = results.rows
    number = _number(merge_durations(rows, lambda f: f.lateness))
    sentences = []
    for percent, ratio in ratios(rows).items():
        where = "the median" if percent == 50.0 else f"{percent:g} %"
        rests = f", which rests on the {round(number * (1.0 - percent / 100.0))} latest of {number} samples"
        sentences.append(
            f"Lateness at {where}{rests if percent > 99.0 else ''}: {ratio:.2f} times that of a bare loop; mark "
            f"{FACTOR:g}: {_judge(ratio <= FACTOR)}."
        )
    costs = {row.law: row.found.work.percentile(99.0) for row in rows if row.chassis == WORK_CHASSIS}
    if not costs:
        return [*sentences, f"Time of a sample with the car on two tracks: not measured; mark {1e6 * WORK:g} µs."]
    beyond = [f"{law} with {_us(cost)} µs" for law, cost in costs.items() if cost > WORK]
    longest = max(costs, key=lambda law: costs[law])
    found = (
        f"by {', '.join(beyond)}" if beyond else f"by every law, {longest} takes longest with {_us(costs[longest])} µs"
    )
    sentences.append(
        f"Time of a sample in 99 % with the car on two tracks; mark {1e6 * WORK:g} µs: {_judge(not beyond)} {found}."
    )
    return sentences


def marks(results: Results) -> list[tuple[str, str, str, str]]:
    """The marks of :func:`verdict` as a table: what, found, mark, met or missed."""
    found = [
        (
            "lateness over a bare loop's, " + ("median" if percent == 50.0 else f"{percent:g} %"),
            f"{ratio:.2f}",
            f"{FACTOR:g}",
            _judge(ratio <= FACTOR),
        )
        for percent, ratio in ratios(results.rows).items()
    ]
    costs = [row.found.work.percentile(99.0) for row in results.rows if row.chassis == WORK_CHASSIS]
    if costs:
        what = "time of a sample, two tracks, 99 % [µs]"
        found.append((what, _us(max(costs)), f"{1e6 * WORK:g}", _judge(max(costs) <= WORK)))
    return found


def drivable(results: Results, priority: int) -> tuple[str, str]:
    """Whether a person can drive on this machine, and what to do where not, in a sentence each."""
    counts = [row.found.counts for row in results.rows]
    share, most = _missed_share(counts), f"{MANY_MISSED:.0%} at most"
    run = f"with the priority {priority}" if priority else "without a priority"
    if share <= MANY_MISSED:
        return f"A person can drive here {run}: {share:.2%} of the deadlines were missed, {most} are wanted.", ""
    sentence = f"A person cannot drive here {run}: {share:.1%} of the deadlines were missed, {most} are wanted."
    preferred = results.conditions.get("SCHED_FIFO")
    if not priority and isinstance(preferred, Measured) and (other := _missed_share([preferred.counts])) <= MANY_MISSED:
        return sentence, f"Give --priority, with which {other:.2%} were missed."
    remedy = "end other programs" if priority else "end other programs, or allow SCHED_FIFO and give --priority"
    return sentence, f"To drive, {remedy} (docs/real_time.md)."


def _missed_share(counts: Sequence[Mapping[str, int]]) -> float:
    """Share of the deadlines that were missed [1]."""
    missed = sum(each["missed"] for each in counts)
    return missed / (missed + sum(each["ticks"] for each in counts))


def page(results: Results, seconds: float, priority: int, locked: bool) -> Page:
    """The page of the command, for a run with a priority, 0 for that of every program, and memory locked or not."""
    memory = f"memory {'' if locked else 'not '}locked"
    limits = f"{machine()}; priority {priority or 'of every program'}, {memory}. {_ANOTHER}"
    rows, (late, work, under, latency), said = results.rows, tables(results), verdict(results)
    missed = sum(row.found.counts["missed"] for row in rows)
    trips = sum(row.found.counts[name] for row in rows for name in ("deadline_trips", "stale_trips"))
    samples = _number(merge_durations(rows, lambda f: f.lateness))
    kinds = dict.fromkeys(row.chassis for row in rows)
    picture = exceedance(
        {kind.replace("_", " "): _lines([row for row in rows if row.chassis == kind]) for kind in kinds}
    )
    sections = [
        Section(
            "Deadlines",
            "The loop keeps its deadlines as a bare loop does that computes nothing.",
            "One thread wakes twice in every millisecond, once for each loop, by the same call of the C library.",
            " ".join(said[: len(PERCENTILES)])
            + f" Missed and left out: {missed} deadlines beside {samples} that had a sample; the watchdog tripped "
            f"{trips} times.",
            limits,
            late,
        ),
        Section(
            "Time of a sample",
            "A sample of the whole car leaves most of the millisecond to the machine.",
            "From the return of the sleep to the end of the sample, the device included.",
            said[-1],
            limits,
            work,
        ),
        Section(
            "Priority, memory and garbage",
            "The scheduler's priority keeps a loop's deadlines where other programs run; Python's collection of "
            "garbage is one of these, and does not stop the loop, which holds no lock of Python.",
            f"{rows[-1].law} on the chassis {rows[-1].chassis}, under each condition for an equal time, one after "
            "another in rounds; the bare loop runs beside each. Garbage is made and collected all the time.",
            _condition_sentence(results),
            f"{machine()}. {_ANOTHER} The thread that collects takes a processor, which the bare loop feels alike."
            + (" The memory is locked under every condition, as --lock-memory asks for." if locked else ""),
            under,
        ),
        Section(
            "Latency through devices",
            "The torque follows the angle within a few milliseconds, most of which is waiting for the next exchange.",
            "An angle jumps by 1 deg at uneven times; what counts is the time until the torque at the device jumps. A "
            "thread of Python exchanges both with the fake wheel and the bus every 2 ms; the client over UDP waits for "
            "each answer. The node and the client are in this process and without a priority; the loop has "
            f"{f'the priority {results.priority} of SCHED_FIFO' if results.priority else 'none either'}.",
            _ways_told(results),
            f"{machine()}. {_ANOTHER} What a real wheel, its cable or its bus add comes on top.",
            latency,
        ),
    ]
    sentence, remedy = drivable(results, priority)
    values = {
        "seconds": seconds,
        "another": _ANOTHER,
        "picture_of_lateness": picture,
        "sections": sections,
        "drivable": sentence,
        "remedy": remedy,
        "first": exceedance({"on this machine": _lines(rows)}),
        "marks": marks(results),
    }
    return Page(PAGE_NAME, values)


def _lines(rows: Sequence[Row]) -> dict[str, Durations]:
    """The durations of a chassis for the picture."""
    return {
        "loop": merge_durations(rows, lambda f: f.lateness),
        "bare loop": merge_durations(rows, lambda f: f.bare),
        "time of a sample": merge_durations(rows, lambda f: f.work),
    }


def _condition_sentence(results: Results) -> str:
    """What the conditions found, in a sentence."""
    parts = [
        f"{name} {'not allowed' if isinstance(found, str) else _us(found.lateness.percentile(99.0)) + ' µs'}"
        for name, found in results.conditions.items()
    ]
    return f"Lateness in 99 %: {'; '.join(parts)}."


def _ways_told(results: Results) -> str:
    """The latencies in a sentence."""
    parts = [
        f"{name} {'not measured' if isinstance(found, str) else _us(found.durations.percentile(50.0)) + ' µs'}"
        for name, found in results.latencies.items()
    ]
    return f"In the median {'; '.join(parts)}."


def data(results: Results) -> dict[str, Any]:
    """The numbers of the page for its JSON file; under ``real_time``, which no rerun compares."""

    def numbers(durations: Durations) -> dict[str, Any]:
        filled = np.flatnonzero(durations.histogram)
        histogram = {"bins": filled.tolist(), "counts": durations.histogram[filled].tolist()}
        return {
            **{f"percentile_{percent:g}_s": durations.percentile(percent) for percent in PERCENTILES},
            "worst_s": durations.worst,
            "histogram": {"width_s": durations.width, **histogram},
        }

    def run(found: Measured) -> dict[str, Any]:
        return {name: numbers(getattr(found, name)) for name in ("lateness", "bare", "work")} | {"counts": found.counts}

    def way(found: Latency) -> dict[str, Any]:
        return numbers(found.durations) | {"lost": found.lost, "clipping": found.clipping}

    return {
        "real_time": {
            "machine": machine(),
            "rows": [{"chassis": row.chassis, "friction": row.law} | run(row.found) for row in results.rows],
            "over_bare": {f"{percent:g}": ratio for percent, ratio in ratios(results.rows).items()},
            "conditions": {n: f if isinstance(f, str) else run(f) for n, f in results.conditions.items()},
            "latency": {n: f if isinstance(f, str) else way(f) for n, f in results.latencies.items()},
        }
    }
