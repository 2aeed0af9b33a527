"""Width of the on-centre loops over the level of friction, and the part of the width that friction causes.

Torsion bar and assist together carry the friction torque and the rest, which is rack force, motor damping and inertia.
So with the boost curve b the hand torque of the same motion without friction torque would be

    T_rest = T - T_tb + g^-1(g(T_tb) - T_F),    g(T) = T + b(T).

The width of the loop of T_rest comes from vehicle lag and motor damping; the rest of the width comes from friction.
Widths are signed: positive where the torque on the rising branch is above that on the falling branch. The lag of the
assist, some milliseconds, is neglected.
"""

import argparse
import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from steer_env import friction, manoeuvres
from steer_env.experiments.pages import pictures
from steer_env.experiments.pages.options import progress
from steer_env.experiments.studies.common import battery
from steer_env.experiments.sweep import Runner, run
from steer_env.friction import defaults
from steer_env.metrics.common.filtered_channels import ANGLE, AY, TORQUE
from steer_env.metrics.common.loops import Loops
from steer_env.recording.recording import Recording
from steer_env.vehicle import cars
from steer_env.vehicle.steering.by_wire import Wire
from steer_env.vehicle.steering.eps import Assist, boost_curve

Array = NDArray[np.float64]

LEVELS = (0.0, 0.125, 0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.0)  # times the default F_c
NO_FRICTION_LEVEL = 1e-6  # level that stands for no friction, as no dry law accepts zero
LAWS = ("lugre", "masing")
WEAVE_TITLE, SLOW_TITLE, SLOW_AT_SPEED_TITLE = (
    "weave, 0.2 Hz, 100 km/h",
    "slow ramp, 0.02 Hz, 50 km/h",
    "slow ramp, 0.02 Hz, 100 km/h",
)
TESTS = {  # title -> manoeuvre, cycles, speed [km/h]
    WEAVE_TITLE: ("weave", 4, 100.0),
    SLOW_TITLE: ("slow-ramp", 3, 50.0),
    SLOW_AT_SPEED_TITLE: ("slow-ramp", 3, 100.0),
}
AT_0G, DEADBAND = "torque at 0 g", "torque dead band"
WIDTHS = {AT_0G: (AY, 0.5), DEADBAND: (ANGLE, 1.0)}  # metric -> abscissa, share of the loop's height at zero abscissa
RISE = 1e-3  # change between levels that counts as growth [N m]


class Width(NamedTuple):
    """A loop's width at one level of friction, signed."""

    F_c: float  # saturated friction torque [N m]
    total: float  # [N m]
    rest: float  # of the same motion without friction torque: vehicle lag and motor damping [N m]

    @property
    def friction(self) -> float:
        """Part of the width that friction causes [N m]."""
        return self.total - self.rest


class Key(NamedTuple):
    """Identifies a curve of widths over friction."""

    car: str
    law: str
    test: str
    metric: str


Curves = dict[Key, list[Width]]


def law_at(law: str, level: float) -> Any:
    """A law at ``level`` times the default saturated torque: all torques scale, and no displacement changes."""
    part = level or NO_FRICTION_LEVEL
    F_c, sigma_0 = part * defaults.F_C, part * defaults.SIGMA_0
    if law == "lugre":
        return friction.make(law, F_c=F_c, sigma_0=sigma_0, sigma_1=part * defaults.SIGMA_1)
    return friction.make(law, F_c=F_c, x_c=F_c / (2.0 * sigma_0))


def without_friction(recording: Recording, assist: Assist) -> Recording:
    """The recording with the hand torque that the same motion would take without friction torque."""
    if isinstance(assist.wire, Wire):  # by which no friction below comes to the hands
        return recording
    speed = float(recording["vehicle_speed"].mean())
    torque = np.linspace(-2.0, 2.0, 4001) * assist.torques[-1]
    carried = torque + np.array([boost_curve(assist, T, speed)[0] for T in torque])
    bar = recording["torsion_bar_torque"]
    rest = np.interp(np.interp(bar, torque, carried) - recording["friction_torque"], carried, torque)
    channels = {**recording.channels, TORQUE: recording[TORQUE] - bar + rest}
    return replace(recording, channels=channels)


def _drive(job: tuple[cars.Car, str, str, float]) -> dict[str, Width]:
    """Widths in one drive, by metric."""
    car, law, test, level = job
    name, cycles, kph = TESTS[test]
    manoeuvre = replace(manoeuvres.make(name, cycles=cycles), speed=kph / 3.6)
    whole = battery.recording(car, manoeuvre, law_at(law, level))
    loops = [Loops(r, r.meta, fewest=1) for r in (whole, without_friction(whole, car.assist))]
    return {
        metric: Width(level * defaults.F_C, *(share * float(loop.width(TORQUE, x).mean()) for loop in loops))
        for metric, (x, share) in WIDTHS.items()
    }


def _with_bar() -> list[str]:
    """Names of the packaged cars with a torsion bar."""
    return [name for name in cars.available() if not isinstance(cars.load(name).assist.wire, Wire)]


def collect(
    chosen: Sequence[str | cars.Car] | None = None,
    laws: Sequence[str] = LAWS,
    tests: Sequence[str] = tuple(TESTS),
    levels: Sequence[float] = LEVELS,
    sweep: Runner = run,
    notify: Callable[[float, str], None] = lambda *_: None,
) -> Curves:
    """Widths over friction for every car (by default the packaged ones with a torsion bar), law, test and metric."""
    loaded = [cars.load(car) if isinstance(car, str) else car for car in chosen or _with_bar()]
    keys = list(product(loaded, laws, tests))
    jobs = [(*key, level) for key in keys for level in levels]
    found = sweep(_drive, jobs, notify=notify, words=lambda job: f"{job[0].name}, {job[1]}, {job[2]}")
    curves: Curves = {}
    for (car, law, test, _), widths in zip(jobs, found):
        for metric, width in widths.items():
            curves.setdefault(Key(car.name, law, test, metric), []).append(width)
    return curves


class Verdict(NamedTuple):
    """Whether the width determines how much friction there is."""

    signed: bool  # whether the signed width grows with friction at every level
    unsigned: bool  # whether its absolute value does
    zero: float  # friction at which the signed width changes sign [N m]; NaN if it does not
    rest: float  # width without friction: vehicle lag and motor damping [N m]


def verdict(curve: Sequence[Width]) -> Verdict:
    """The verdict on one curve."""
    F_c, total, rest = (np.array([getattr(w, name) for w in curve]) for name in ("F_c", "total", "rest"))
    fine = PchipInterpolator(F_c, total)  # monotone between monotone points, so it adds no turn
    roots = fine.roots(extrapolate=False)
    return Verdict(
        bool(np.all(np.diff(total) > RISE)),
        bool(np.all(np.diff(np.abs(fine(np.linspace(F_c[0], F_c[-1], 1001)))) > 0.0)),
        float(roots[0]) if roots.size else math.nan,
        float(rest[0]),
    )


def sentence(curves: Curves, test: str = WEAVE_TITLE) -> str:
    """The verdicts on one test in words; laws that agree to 0.01 N m are named together."""
    lines = []
    for metric in WIDTHS:
        mine = {key: verdict(curve) for key, curve in curves.items() if (key.test, key.metric) == (test, metric)}
        signed = [key for key, found in mine.items() if not found.signed]
        text = f"{metric} in the {test}: the signed width "
        text += (
            f"does not always grow with friction ({_cars_and_laws(signed)})"
            if signed
            else "grows with friction throughout"
        )
        folds: dict[tuple[str, str], list[Key]] = {}
        for key, found in mine.items():
            if not found.unsigned:
                folds.setdefault((key.car, f"{found.zero:.2f}"), []).append(key)
        if folds:
            text += "; its absolute value first falls, to zero where friction balances lag and damping, at a friction "
            text += "torque of "
            text += ", ".join(f"{zero} N m ({_cars_and_laws(keys)})" for (_, zero), keys in folds.items())
        else:
            text += ", and so does its absolute value"
        lines.append(text + ".")
    return "\n".join(lines)


def _cars_and_laws(keys: Sequence[Key]) -> str:
    """The cars and laws of some curves."""
    cars_of, laws_of = (list(dict.fromkeys(found)) for found in zip(*((key.car, key.law) for key in keys)))
    return f"{', '.join(cars_of)}: {', '.join(laws_of)}"


def table(curves: Curves) -> str:
    """Widths of every curve as text: total = lag and damping + friction [N m]."""
    lines = []
    for key, curve in curves.items():
        lines.append(f"{key.car}, {key.law}, {key.test}: {key.metric} [N m]")
        lines.append("  F_c               " + " ".join(f"{w.F_c:7.3f}" for w in curve))
        for label, name in (("total", "total"), ("lag and damping", "rest"), ("friction", "friction")):
            lines.append(f"  {label:17s} " + " ".join(f"{getattr(w, name):7.3f}" for w in curve))
    return "\n".join(lines)


def panels(curves: Curves, law: str = LAWS[0]) -> dict[str, dict[str, dict[str, list[Width]]]]:
    """Curves of one law by metric, test and car, as the picture takes them."""
    found: dict[str, dict[str, dict[str, list[Width]]]] = {}
    for key, curve in curves.items():
        if key.law == law:
            found.setdefault(key.metric, {}).setdefault(key.test, {})[key.car] = curve
    return found


def main(argv: Sequence[str] | None = None, sweep: Runner = run) -> None:
    """Print the widths over friction and the verdicts; with --figure also draw them."""
    parser = argparse.ArgumentParser(prog="steer-env study loop-width", description=main.__doc__)
    text = f"default: {' '.join(_with_bar())}"
    parser.add_argument("--cars", metavar="NAME", nargs="+", choices=cars.available(), default=_with_bar(), help=text)
    parser.add_argument("--figure", metavar="FILE.svg", type=Path, help="file for the picture")
    options = parser.parse_args(argv)
    with progress("driving") as notify:
        curves = collect(options.cars, sweep=sweep, notify=notify)
    print(table(curves))
    for test in TESTS:
        print("\n" + sentence(curves, test))
    if options.figure:
        options.figure.write_text(pictures.loop_width(panels(curves)), encoding="utf-8")
