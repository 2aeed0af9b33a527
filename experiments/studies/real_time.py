"""Friction laws in real time: error and boundedness for every scheme and step length, and what a step costs.

All are of one case: the default car's column under a sine of 2.5 N m of hand torque at 0.5 Hz for 4 s. Errors are
against ``common.column_schemes.reference``; ``common.computing_time`` measures the cost.
"""

import argparse
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from steer_env import friction
from steer_env.experiments.studies.common import computing_time
from steer_env.experiments.studies.common.column_schemes import SCHEMES, default_case, integrate, reference
from steer_env.vehicle import cars

STEP_LENGTHS = (1e-4, 2e-4, 5e-4, 1e-3, 2e-3, 5e-3, 1e-2)  # [s], whole multiples of the first
BLOWN_UP = 3.0  # torque and speed of a bounded run stay below this many times their true peaks
USABLE = 0.01  # RMS error relative to the peak of the friction torque up to which a scheme counts as usable; assumed


class SchemeRow(NamedTuple):
    """One scheme at one step."""

    scheme: str
    step: float  # [s]
    error: float | None  # RMS, relative to the peak of the friction torque [1]; None where not finite
    bounded: bool


def accuracy(p: Any, steps: tuple[float, ...] = STEP_LENGTHS) -> list[SchemeRow]:
    """Error and boundedness of every scheme at every step length."""
    case = default_case(p)
    finest = steps[0]
    exact = reference(case, finest)
    runs = {(scheme, h): integrate(case, scheme, h) for scheme in SCHEMES for h in steps}
    peaks = BLOWN_UP * np.abs(exact).max(), BLOWN_UP * np.abs(runs["midpoint", finest][1]).max()
    rows = []
    for (scheme, h), (T_F, w) in runs.items():
        bounded = bool(np.abs(T_F).max() <= peaks[0] and np.abs(w).max() <= peaks[1])  # false for NaN
        with np.errstate(over="ignore", invalid="ignore"):
            residual = T_F - exact.reshape(T_F.size, -1).mean(axis=1)
            error = float(np.sqrt(np.mean(residual**2)) / np.abs(exact).max())
        rows.append(SchemeRow(scheme, h, error if np.isfinite(error) else None, bounded))
    return rows


def usable_step(rows: list[SchemeRow], scheme: str) -> float | None:
    """Longest step up to which a scheme is bounded and within ``USABLE`` [s]; None if no step is."""
    longest = None
    for row in sorted((row for row in rows if row.scheme == scheme), key=lambda row: row.step):
        if not row.bounded or row.error is None or row.error > USABLE:
            break
        longest = row.step
    return longest


def main(argv: Sequence[str] | None = None) -> None:
    """Print the error of every law, scheme and step length, and what a step of 1 ms costs with each law."""
    parser = argparse.ArgumentParser(prog="steer-env study real-time", description=main.__doc__)
    laws = friction.available()
    text = f"default: {' '.join(laws)}"
    parser.add_argument("--friction", metavar="LAW", nargs="+", choices=laws, default=list(laws), help=text)
    chosen = {law: friction.make(law) for law in parser.parse_args(argv).friction}
    width = 2 + max(map(len, chosen))
    print(f"{'law':{width}s}scheme          step [ms]  RMS error [%]")
    for law, p in chosen.items():
        for row in accuracy(p):
            found = f"{100.0 * row.error:13.4f}" if row.error is not None else f"{'not finite':>13s}"
            print(
                f"{law:{width}s}{row.scheme:16s}{1e3 * row.step:9.1f}  {found}{'' if row.bounded else '  not bounded'}"
            )
    print("\nComputing time of a step of 1 ms: median and what nine blocks of ten keep [ns], and over LuGre's")
    times = computing_time.of_laws(chosen, cars.load())
    if not times.measurable:
        waits, varies, known = (f"{share:.0%}" for share in times.load)
        print(
            f"not measurable now: a bare loop waits {waits} of the time and varies by {varies}; ratios within {known}"
        )
        return
    for law in chosen:
        for what in (computing_time.COLUMN, computing_time.CAR):
            ns, ratio = times.of(law, what)
            over = f"{ratio.median:7.3f} ({ratio.low:.3f} to {ratio.high:.3f})"
            word = "  integrated numerically" if law in times.integrated else ""
            print(f"{law:{width}s}{what:8s}{ns.median:8.0f}{ns.late:8.0f}  {over}{word}")
