"""What becomes of the car after a pulse of hand torque with free hands, over speed, friction law and chassis.

:mod:`steer_env.vehicle.analysis.free_control` runs each pulse and says what its verdicts mean.
"""

import argparse
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env import friction
from steer_env.experiments.pages import car_options, pictures
from steer_env.experiments.pages.files import write_text
from steer_env.experiments.pages.options import progress
from steer_env.experiments.sweep import Runner, run
from steer_env.vehicle import cars
from steer_env.vehicle.analysis import free_control
from steer_env.vehicle.cars import Car
from steer_env.vehicle.plant import CHANNEL

Array = NDArray[np.float64]

NONE = "no friction"
SLOWEST, FASTEST = 10.0, 60.0  # [m/s]
TORQUES, DURATION = (3.0, 5.0), 0.3  # of the pulse [N m], [s]
ROWS = 5.0  # between the speeds of the table [m/s]
SHOWN = (30.0, 40.0, 50.0)  # speeds at which the picture shows the yaw rate [m/s]
# Where the default car has to settle after the smaller pulse, with its friction and without [m/s].
WITH_FRICTION, WITHOUT = 50.0, 40.0


class Case(NamedTuple):
    """One chassis, pulse and friction law."""

    chassis: str
    torque: float  # of the pulse [N m]
    law: str


class Outcome(NamedTuple):
    """What became of one pulse."""

    verdict: str
    again: str  # the verdict at half the step
    lost: str
    amplitudes: Array  # of the yaw rate over 2 s, 6, 8 and 10 s after the pulse [rad/s]
    residual: float  # yaw rate that remains [rad/s]


def law_of(name: str) -> Any:
    """The friction of a name, which may be "no friction"."""
    return free_control.FRICTIONLESS if name == NONE else friction.resolve(name)


def outcome(car: Car, case: Case, speed: float) -> Outcome:
    """Run the pulse of a case at a speed [m/s], at the plant's step and at half of it."""
    p = car.plant(law_of(case.law), speed, chassis=case.chassis)
    first, second = (free_control.pulse(p, case.torque, DURATION, substeps=n) for n in (1, 2))
    return Outcome(first.verdict, second.verdict, first.lost, first.amplitudes, first.residual)


def _outcome(job: tuple[Car, Case, float]) -> Outcome:
    return outcome(*job)


def collect(
    car: Car,
    laws: Sequence[str],
    speeds: Sequence[float],
    sweep: Runner = run,
    notify: Callable[[float, str], None] = lambda *_: None,
) -> dict[Case, dict[float, Outcome]]:
    """Outcomes by case and speed."""
    cases = [Case(chassis, torque, law) for chassis in cars.SPEEDS for torque in TORQUES for law in laws]
    jobs = [(car, case, float(v)) for case in cases for v in speeds]
    found = iter(sweep(_outcome, jobs, notify=notify, words=lambda job: f"{job[1].law}, {job[2]:g} m/s"))
    return {case: {float(v): next(found) for v in speeds} for case in cases}


def cell(found: Outcome) -> str:
    """Verdict and amplitude [deg/s] in the window that ends 6 s after the pulse."""
    return found.lost if found.lost else f"{np.degrees(found.amplitudes[0]):.2f} {found.verdict}"


def table(outcomes: Mapping[Case, Mapping[float, Outcome]]) -> str:
    """The outcomes as text: a table for each chassis and pulse, with a row for each law."""
    lines = []
    for chassis, torque in dict.fromkeys((case.chassis, case.torque) for case in outcomes):
        rows = {c.law: of for c, of in outcomes.items() if (c.chassis, c.torque) == (chassis, torque)}
        lines.append(f"{chassis}, {torque:g} N m for {DURATION:g} s: amplitude of the yaw rate 4 to 6 s after [deg/s]")
        speeds = [v for v in next(iter(rows.values())) if v % ROWS == 0.0]
        lines.append("  " + f"{'speed [m/s]':12s}" + "".join(f"{law:>18s}" for law in rows))
        lines += [f"  {v:<12g}" + "".join(f"{cell(of[v]):>18s}" for of in rows.values()) for v in speeds]
        for label, bad in (("settles to", {"decays", "oscillates", "spins"}), ("decays to", {"oscillates", "spins"})):
            highest = [free_of(of, bad) for of in rows.values()]
            lines.append("  " + f"{label:12s}" + "".join(f"{text:>18s}" for text in highest))
        lines.append("")
    return "\n".join(lines)


def free_of(of: Mapping[float, Outcome], bad: set[str]) -> str:
    """The speed below the first bad verdict in words."""
    failed = [v for v, found in of.items() if found.verdict in bad]
    passed = [v for v in of if not failed or v < failed[0]]
    return f"{passed[-1]:g} m/s" if passed else "none"


def half_step(outcomes: Mapping[Case, Mapping[float, Outcome]]) -> str:
    """How many verdicts half the step leaves as they are, and which not."""
    every = [(case, v, found) for case, of in outcomes.items() for v, found in of.items()]
    other = [(case, v, found) for case, v, found in every if found.verdict != found.again]
    lines = [f"Half the step: the same verdict in {len(every) - len(other)} of {len(every)} runs"]
    lines += [f"  {c.chassis}, {c.torque:g} N m, {c.law}, {v:g} m/s: {f.verdict}, then {f.again}" for c, v, f in other]
    return "\n".join(lines)


def motion(found: Outcome) -> str:
    """The motion 6, 8 and 10 s after the pulse in words."""
    if found.lost:
        return f"lost by {found.lost}"
    amplitudes = ", ".join(f"{a:.3f}" for a in np.degrees(found.amplitudes))
    return f"amplitudes {amplitudes} deg/s around {np.degrees(found.residual):.2f} deg/s"


def requirement(car: Car) -> str:
    """The outcomes at the two speeds at which the default car has to settle."""
    lines = []
    for law, speed in ((car.friction, WITH_FRICTION), (NONE, WITHOUT)):
        for chassis in cars.SPEEDS:
            for torque in TORQUES:
                found = outcome(car, Case(chassis, torque, law), speed)
                ratio, frequency = free_control.least_damping_ratio(car.plant("viscous", speed, chassis=chassis))
                lines.append(
                    f"{speed:g} m/s, {law}, {chassis}, {torque:g} N m: {found.verdict}, and {found.again} at half the "
                    f"step; {motion(found)}; least damping without friction {ratio:.3f} at {frequency:.2f} Hz"
                )
    return "\n".join(lines)


def yaw_rate(car: Car, chassis: str, speed: float) -> Array:
    """Yaw rate (T,) [rad/s] from the begin of the smaller pulse, with the friction of the car."""
    found = free_control.pulse(car.plant(None, speed, chassis=chassis), TORQUES[0], DURATION)
    return found.record[:, CHANNEL["yaw_rate"]]


def main(argv: Sequence[str] | None = None, sweep: Runner = run) -> None:
    """Print what becomes of a car after a pulse of the hands, from 10 to 60 m/s, and draw it."""
    parser = argparse.ArgumentParser(prog="steer-env study hands-off", description=main.__doc__)
    car_options.add(parser)
    laws = list(friction.available())
    text = f"laws by name, beside the friction of the car and none (default {' '.join(laws)})"
    parser.add_argument("--friction", metavar="LAW", nargs="+", choices=laws, default=laws, help=text)
    parser.add_argument("--stride", metavar="M/S", type=float, default=1.0, help="between the speeds (default 1)")
    text = "file for the picture (default hands_off.svg; docs/hands_off.svg in a checkout is that of the documentation)"
    parser.add_argument("--out", metavar="FILE.svg", type=Path, default=Path("hands_off.svg"), help=text)
    args = parser.parse_args(argv)
    if not 0.1 <= args.stride <= FASTEST - SLOWEST:
        parser.error(f"--stride must be from 0.1 to {FASTEST - SLOWEST:g}, got {args.stride:g}")
    car = car_options.load(args)
    speeds = np.arange(SLOWEST, FASTEST + 0.5 * args.stride, args.stride).round(6)
    with progress("driving") as notify:
        outcomes = collect(car, [car.friction, *args.friction, NONE], [float(v) for v in speeds], sweep, notify)
    print(table(outcomes))
    print(half_step(outcomes))
    print(requirement(car))
    verdicts = {
        (case.chassis, case.torque, case.law): {v: found.verdict for v, found in of.items()}
        for case, of in outcomes.items()
    }
    curves = {chassis: {v: yaw_rate(car, chassis, v) for v in SHOWN} for chassis in cars.SPEEDS}
    write_text(args.out, pictures.hands_off(car.friction, curves, verdicts))
