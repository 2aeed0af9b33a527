"""The loop in real time on this machine: how it keeps its deadlines, what a sample costs, and the latency over UDP."""

import os
import platform
import time
from collections.abc import Callable, Mapping, Sequence
from functools import reduce
from operator import add
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from steer_env.cosimulation import Server, Stream
from steer_env.experiments.drawing.lateness_picture import exceeded
from steer_env.experiments.studies.common.page import Page, Picture, Section, Table
from steer_env.fmu.part import Part
from steer_env.fmu.parts import make_part
from steer_env.real_time.measure import Durations, Measured, measure
from steer_env.vehicle.cars import Car

NAME = "real_time"
SPEED = 100.0 / 3.6  # held [m/s]
FACTOR = 1.2  # of a percentile of the lateness over that of the bare loop, that a loop may have at most
WORK = 20e-6  # of a sample at the 99th percentile, that the car on two tracks may take [s]
PERCENTILES = (50.0, 99.0, 99.9)
BIN = 10e-6  # of the histogram of latencies [s]


class Row(NamedTuple):
    """One law on one chassis."""

    chassis: str
    law: str
    found: Measured


class Results(NamedTuple):
    """What a run of the command found."""

    rows: list[Row]
    latency: Durations  # from the angle sent over UDP to the torque received
    server: dict[str, int]  # counts of the server meanwhile


def part_of(car: Car, law: Any, chassis: str) -> Part:
    """The car with a prescribed handwheel angle."""
    return make_part("car", car.plant(law, SPEED, True, chassis=chassis), SPEED)


def collect(
    car: Car,
    laws: Mapping[str, Any],
    chassis: Sequence[str],
    seconds: float,
    priority: int = 0,
    notify: Callable[[float, str], None] = lambda part, text: None,
) -> Results:
    """Measure every law on every chassis, ``seconds`` in all, and the latency over UDP for a tenth of that."""
    cases = [(kind, law) for kind in chassis for law in laws]
    rows = []
    for i, (kind, law) in enumerate(cases):
        notify(i / len(cases), f"{law}, {kind}")
        rows.append(Row(kind, law, measure(part_of(car, laws[law], kind), seconds / len(cases), priority)))
    notify(1.0, "over UDP")
    kind, law = cases[-1]
    return Results(rows, *_over_udp(part_of(car, laws[law], kind), 0.1 * seconds, priority))


def _over_udp(part: Part, seconds: float, priority: int) -> tuple[Durations, dict[str, int]]:
    """Latency from an angle that is sent to the first torque that depends on it, in this process."""
    delays = []
    with (
        Server(part, mode="free-running", priority=priority) as server,
        Stream(server.layout, server.address) as stream,
    ):
        inputs, end = np.zeros(len(part.given)), time.monotonic() + seconds
        while time.monotonic() < end:
            stream.put(inputs)
            answer = stream.get(0.1)
            if answer:
                delays.append(answer.delay)
    histogram = np.bincount((np.array(delays) / BIN).astype(int))
    return Durations(histogram, BIN, max(delays)), server.counts()


def together(rows: Sequence[Row], part: Callable[[Measured], Durations]) -> Durations:
    """The durations of several rows as one."""
    return reduce(add, (part(row.found) for row in rows))


def machine() -> str:
    """Kernel, governor of the processor and load of this machine, as text."""
    file = Path("/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor")
    governor = file.read_text().strip() if file.exists() else "not told by the system"
    load = os.getloadavg()[0]
    version = platform.version()
    return (
        f"{platform.system()} {platform.release()} ({version}), {os.cpu_count()} processors, governor: {governor}, "
        f"load at the end {load:.1f}"
    )


def ratios(rows: Sequence[Row]) -> dict[float, float]:
    """Lateness of the loop over that of the bare loop, by percentile."""
    loop, bare = (together(rows, lambda found, i=i: found[i]) for i in (0, 1))  # type: ignore[misc]
    return {percent: loop.percentile(percent) / bare.percentile(percent) for percent in PERCENTILES}


def _us(value: float) -> str:
    return f"{1e6 * value:.1f}" if value < 1e-4 else f"{1e6 * value:.0f}"


def _cells(durations: Durations) -> list[str]:
    return [_us(durations.mean()), *(_us(durations.percentile(p)) for p in PERCENTILES), _us(durations.worst)]


HEAD = ("mean", *(f"{percent:g} %" for percent in PERCENTILES), "worst")


def tables(results: Results) -> list[Table]:
    """Lateness, time of a sample, and latency over UDP [us]."""
    rows = results.rows
    late = [[row.chassis, row.law, *_cells(row.found.lateness), str(row.found.counts["missed"])] for row in rows]
    late += [["all", "all", *_cells(together(rows, lambda f: f.lateness)), ""]]
    late += [["bare loop", "", *_cells(together(rows, lambda f: f.bare)), ""]]
    work = [
        [
            row.chassis,
            row.law,
            *_cells(row.found.work),
            f"{row.found.counts['clipped'] / row.found.counts['ticks']:.1%}",
        ]
        for row in rows
    ]
    return [
        Table("Lateness at the deadlines [µs]", ("chassis", "law", *HEAD, "missed"), late),
        Table("Time of a sample [µs]", ("chassis", "law", *HEAD, "clipped"), work),
        Table("From the angle sent over UDP to the torque received [µs]", HEAD, [_cells(results.latency)]),
    ]


def page(results: Results, seconds: float, conditions: str) -> Page:
    """The page of the command."""
    rows = results.rows
    late, work, latency = tables(results)
    found = ratios(rows)
    kept = all(ratio <= FACTOR for ratio in found.values())
    share = ", ".join(f"{ratio:.2f} at {percent:g} %" for percent, ratio in found.items())
    slowest = max(rows, key=lambda row: row.found.work.percentile(99.0))
    cost = slowest.found.work.percentile(99.0)
    verdict = [
        f"The lateness of the loop over that of a bare loop is {share}; {'within' if kept else 'beyond'} {FACTOR:g}.",
        f"A sample takes at most {_us(cost)} µs in 99 % ({slowest.law}, {slowest.chassis}); "
        f"{'within' if cost <= WORK else 'beyond'} {1e6 * WORK:g} µs.",
    ]
    trips = {name: sum(row.found.counts[name] for row in rows) for name in ("missed", "deadline_trips", "stale_trips")}
    pictures = [
        Picture(
            exceeded(
                {
                    kind.replace("_", " "): {
                        "loop": together([row for row in rows if row.chassis == kind], lambda f: f.lateness),
                        "bare loop": together([row for row in rows if row.chassis == kind], lambda f: f.bare),
                        "time of a sample": together([row for row in rows if row.chassis == kind], lambda f: f.work),
                    }
                    for kind in dict.fromkeys(row.chassis for row in rows)
                }
            ),
            "Share of the deadlines at which the lateness is longer, and of the samples that take longer",
        )
    ]
    limits = f"{machine()}; {conditions}. Figures of this machine say nothing about another."
    return Page(
        NAME,
        "The loop in real time on this machine",
        f"{seconds:g} s in all, a sample in every millisecond; a person is replaced by a sine of the handwheel angle.",
        [],
        [
            Section(
                "Deadlines",
                "The loop keeps its deadlines as a bare loop does that computes nothing.",
                "One thread wakes twice in every millisecond, once for each loop, by the same call of the C library.",
                f"{verdict[0]} Missed and left out: {trips['missed']} deadlines; the watchdog tripped "
                f"{trips['deadline_trips'] + trips['stale_trips']} times.",
                limits,
                pictures,
                [late],
                measured=True,
            ),
            Section(
                "Time of a sample",
                "A sample of the whole car leaves most of the millisecond to the machine.",
                "From the return of the sleep to the end of the sample, the device included.",
                verdict[1],
                limits,
                (),
                [work],
                measured=True,
            ),
            Section(
                "Latency over UDP",
                "A client at the same machine has its torque within two samples.",
                "From the time at which a client in Python sends an angle to that at which it has the answer.",
                f"{_us(results.latency.percentile(50.0))} µs in the median, "
                f"{_us(results.latency.percentile(99.0))} µs in 99 %.",
                f"{limits} The device's own latency comes on top.",
                (),
                [latency],
                measured=True,
            ),
        ],
        verdict,
    )


def data(results: Results) -> dict[str, Any]:
    """The numbers of the page for its JSON file; under ``real_time``, which no rerun compares."""

    def numbers(durations: Durations) -> dict[str, Any]:
        filled = np.flatnonzero(durations.histogram)
        histogram = {"bins": filled.tolist(), "counts": durations.histogram[filled].tolist()}
        return {
            "mean_s": durations.mean(),
            **{f"percentile_{percent:g}_s": durations.percentile(percent) for percent in PERCENTILES},
            "worst_s": durations.worst,
            "histogram": {"width_s": durations.width, **histogram},
        }

    rows = [
        {"chassis": row.chassis, "friction": row.law}
        | {name: numbers(getattr(row.found, name)) for name in ("lateness", "bare", "work")}
        | {"counts": row.found.counts}
        for row in results.rows
    ]
    over = {f"{percent:g}": ratio for percent, ratio in ratios(results.rows).items()}
    found = {"machine": machine(), "rows": rows, "over_bare": over, "udp": numbers(results.latency)}
    return {"real_time": {**found, "server": results.server}}
