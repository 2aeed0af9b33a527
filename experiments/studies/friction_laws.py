"""How the friction laws differ: their loops, a held torque, and how far one calibration can make them agree.

Displacement histories show the laws without a car. The held-torque test finds the cause of the vibration that Masing
friction shows under a held hand torque: LuGre and Masing are driven with and without a micro-damper, which is the same
in both.
"""

import argparse
import math
from collections.abc import Sequence
from itertools import pairwise, product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env import friction, manoeuvres
from steer_env.friction.defaults import F_C, SIGMA_0
from steer_env.friction.law import advance, law_of, torque
from steer_env.manoeuvres.hold import RISE
from steer_env.metrics.hold import SETTLING
from steer_env.recording.recording import DEGREE
from steer_env.vehicle import cars, plant
from steer_env.vehicle.cars import Car
from steer_env.vehicle.steering.eps import SAMPLE_TIME, without_assist

Array = NDArray[np.float64]

# Half of the turns from a reversal to the next span at most twice this in the packaged motorway drive [rad]; laws with
# one calibration differ most in turns that are hardly longer than their pre-sliding distance.
SMALL_TURN = math.radians(0.8)
SMALL_TURNS = {"amplitude": SMALL_TURN, "cycles": 6}  # options of the weave
HELD_TORQUE = 3.0  # of the hands, where the boost curve of the packaged cars is steep; assumed [N m]
NO_TORQUE = 1e-6  # torque of creeping below which a law counts as frictionless, as a damper of 1 kN m s/rad does [N m]


class History(NamedTuple):
    """A displacement over time that is imposed on every law."""

    title: str
    x: Array  # (T,) [rad]
    dt: float  # [s]


def turning_points_history(points: tuple[float, ...], step: float) -> Array:
    """Straight lines through turning points, in steps of about ``step``, which has the unit of the points."""
    pieces = [np.linspace(a, b, max(round(abs(b - a) / step), 1) + 1)[1:] for a, b in pairwise(points)]
    return np.concatenate([[points[0]], *pieces])


def _growing_sine() -> History:
    t = np.arange(0.0, 4.0 + 5e-4, 1e-3)
    x = 2.0 * DEGREE * t / t[-1] * np.sin(2.0 * math.pi * t)
    return History("a sine of 1 Hz that grows to 2 deg", x, 1e-3)


def _nested_loops() -> History:
    x = turning_points_history((0.0, 4.0, -4.0, 2.0, -2.0, 1.0, -1.0, 0.5, -0.5, 0.25, -0.25), 0.01)
    return History("nested loops from 4 deg down to 0.25 deg, at 0.01 deg/s", x * DEGREE, 1.0)


def _move_and_rest() -> History:
    x = np.concatenate(
        [
            turning_points_history((0.0, 0.5), 1e-3),
            np.full(500, 0.5),
            turning_points_history((0.5, 0.3), 1e-3),
            np.full(500, 0.3),
        ]
    )
    return History("a displacement that moves at 1 deg/s, rests, moves back and rests", x * DEGREE, 1e-3)


HISTORIES = {"growing_sine": _growing_sine(), "nested_loops": _nested_loops(), "held": _move_and_rest()}
# Samples of the nested loops: the reversal from saturation at 4 deg, and the first inside it, at 2 deg.
SATURATED_TURN, NESTED_TURN = 400, 1800


def characteristics(p: Any) -> dict[str, Array]:
    """Torque of a law along every history [N m]."""
    return {name: friction.response(p, history.x, history.dt) for name, history in HISTORIES.items()}


class Residual(NamedTuple):
    """RMS difference from a base law, relative to the base law's saturated torque [1]."""

    saturated: float  # on the two branches after a reversal from saturation
    nested: float  # on the loops nested in them


def residual(nested: Array, base: Array) -> Residual:
    """Residual of one law's torque in the nested loops from that of a base law."""
    part = (nested - base) / np.abs(base).max()
    branch, loops = part[SATURATED_TURN + 1 : NESTED_TURN], part[NESTED_TURN + 1 :]
    return Residual(float(np.sqrt(np.mean(branch**2))), float(np.sqrt(np.mean(loops**2))))


def _creep_torque(p: Any, distance: float) -> float:
    """Torque of a law that creeps from rest at 1 nrad/s, after a distance [rad]."""
    memory, w = np.zeros(law_of(p).memory_size(p)), 1e-9
    advance(p, 1.0, memory, w, distance / w)
    return torque(p, 1.0, memory, w)


def dry(p: Any) -> bool:
    """Whether a law has dry friction: a torque that remains as the speed of sliding goes to zero."""
    return _creep_torque(p, 100.0) > NO_TORQUE


def set_valued(p: Any) -> bool:
    """Whether the torque of a law jumps where motion begins."""
    return _creep_torque(p, 0.0) > NO_TORQUE


class Calibration(NamedTuple):
    """Saturated torque and pre-sliding stiffness that LuGre and Masing share after a reversal from saturation."""

    title: str
    F_c: float  # [N m]
    sigma_0: float  # [N m/rad]


CALIBRATIONS = (
    Calibration("default friction", F_C, SIGMA_0),
    Calibration("strong friction", 3.0, 3.0 / (0.5 * DEGREE)),
)
DAMPING_RATIOS = (0.0, 0.1, 0.44)  # of the pre-sliding mode; the last is that of the default LuGre law
HELD_LAWS = ("lugre", "masing")


def held_law(law: str, calibration: Calibration, damping_ratio: float, I2: float) -> Any:
    """LuGre or Masing with a calibration and a micro-damper, given as damping ratio at the inertia ``I2`` [kg m2]."""
    _, F_c, sigma_0 = calibration
    sigma_1 = 2.0 * damping_ratio * math.sqrt(sigma_0 * I2)
    if law == "lugre":
        return friction.make(law, F_c=F_c, sigma_0=sigma_0, sigma_1=sigma_1)
    return friction.make(law, F_c=F_c, x_c=F_c / (2.0 * sigma_0), sigma_1=sigma_1)


class HeldTest(NamedTuple):
    """One held-torque test on the car."""

    assist: str  # a key of ASSIST
    calibration: str
    law: str
    damping_ratio: float  # of the pre-sliding mode [1]
    ripple: float  # peak to peak of the torsion-bar torque from ``SETTLING`` into the hold [N m]
    ripple_fine: float  # the same at a tenth of the step [N m]
    lasting: float  # ripple in the last second over the ripple in the first second after ``SETTLING`` [1]
    torque: Array  # (T,) torsion-bar torque [N m], every ``THINNING`` samples from the start of the hold


ASSIST = {"on": "assist on", "off": "assist off"}
THINNING = 4
_SECOND = round(1.0 / SAMPLE_TIME)


def torsion_bar(car: Car, p: Any, assisted: bool = True, substeps: int = 1) -> Array:
    """Torsion-bar torque from the start of the hold on, (T,) [N m]."""
    manoeuvre = manoeuvres.make("hold", torque=HELD_TORQUE)
    whole = manoeuvres.build_plant(car, manoeuvre, p)
    if not assisted:
        whole = whole._replace(assist=without_assist(whole.assist))
    inputs = manoeuvres.inputs(manoeuvre, HELD_TORQUE, manoeuvre.duration)
    record = np.zeros((len(inputs), len(plant.CHANNELS)))
    plant.run(whole, plant.initial_state(whole), inputs, record, substeps)
    return record[round(RISE / SAMPLE_TIME) :, plant.CHANNEL["torsion_bar_torque"]]


def ripple(torque: Array) -> tuple[float, float]:
    """Ripple of a held torque and what lasts of it, as in :class:`HeldTest`."""
    settled = torque[round(SETTLING / SAMPLE_TIME) :]
    return float(np.ptp(settled)), float(np.ptp(settled[-_SECOND:]) / np.ptp(settled[:_SECOND]))


def held_torque(car: Car, law: str) -> list[HeldTest]:
    """All held-torque tests of LuGre or Masing: with and without assist, both calibrations, every damper."""
    tests = []
    for state, calibration, ratio in product(ASSIST, CALIBRATIONS, DAMPING_RATIOS):
        p = held_law(law, calibration, ratio, car.column.I2)
        coarse, fine = (torsion_bar(car, p, state == "on", substeps) for substeps in (1, 10))
        span, lasting = ripple(coarse)
        tests.append(
            HeldTest(
                state,
                calibration.title,
                law,
                ratio,
                ripple=span,
                ripple_fine=ripple(fine)[0],
                lasting=lasting,
                torque=coarse[::THINNING].copy(),
            )
        )
    return tests


def ringing(torque: Array) -> float:
    """Frequency of a decaying torque after ``SETTLING``, from its turning points [Hz]; NaN with fewer than four."""
    rate = np.diff(torque[round(SETTLING / SAMPLE_TIME / THINNING) :])
    turns = np.flatnonzero((rate[1:] >= 0.0) != (rate[:-1] >= 0.0))
    if turns.size < 4:
        return math.nan
    return float((turns.size - 1) / (2.0 * (turns[-1] - turns[0]) * THINNING * SAMPLE_TIME))


class Verdict(NamedTuple):
    """Masing and LuGre with one state of the assist and one calibration, without and with the same damper in both."""

    masing: HeldTest
    lugre: HeldTest
    masing_damped: HeldTest
    lugre_damped: HeldTest

    @property
    def share_of_damper(self) -> float:
        """Share of the difference between the ripples of Masing and LuGre that vanishes when both get the damper."""
        gap, left = self.masing.ripple - self.lugre.ripple, self.masing_damped.ripple - self.lugre_damped.ripple
        return 1.0 - left / gap if gap else math.nan


def verdicts(tests: list[HeldTest], ratio: float) -> list[Verdict]:
    """The effect of a damper of the given ratio in both laws, for every state of the assist and every calibration."""
    found = {test[:4]: test for test in tests}
    pairs = [(law, damping) for damping in (0.0, ratio) for law in ("masing", "lugre")]
    return [
        Verdict(*(found[(state, calibration.title, *pair)] for pair in pairs))
        for state, calibration in product(ASSIST, CALIBRATIONS)
    ]


def main(argv: Sequence[str] | None = None) -> None:
    """Print the residuals of every law from LuGre, and the ripple of a held torque with LuGre and with Masing."""
    argparse.ArgumentParser(prog="steer-env study friction-laws", description=main.__doc__).parse_args(argv)
    loops = {law: characteristics(friction.make(law))["nested_loops"] for law in friction.available()}
    print("RMS difference from lugre, % of its saturated torque")
    width = 2 + max(map(len, loops))
    print(f"{'':{width}s}{'saturated branches':>20s}{'nested loops':>14s}")
    for law, torque_of_law in loops.items():
        found = residual(torque_of_law, loops["lugre"])
        print(f"{law:{width}s}{100.0 * found.saturated:20.2f}{100.0 * found.nested:14.2f}")
    print(f"\nripple of a held torque of {HELD_TORQUE:g} N m [mN m], by damping ratio of the micro-damper")
    print(f"{'':36s}" + "".join(f"{ratio:>10g}" for ratio in DAMPING_RATIOS))
    tests = [test for law in HELD_LAWS for test in held_torque(cars.load(), law)]
    for state, calibration, law in product(ASSIST, CALIBRATIONS, HELD_LAWS):
        row = (test for test in tests if test[:3] == (state, calibration.title, law))
        cells = "".join(f"{1e3 * test.ripple:10.2f}" for test in row)
        print(f"{ASSIST[state]:12s}{calibration.title:18s}{law:6s}{cells}")
