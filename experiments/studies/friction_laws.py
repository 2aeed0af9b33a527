"""What sets the friction laws apart: their loops, what they do while held, and how far one calibration can go.

Displacement histories show the laws alone. The held-torque test settles where Masing's vibration under held steering
comes from: LuGre and Masing run with and without a micro-damper, the same one in both.
"""

import math
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
from steer_env.vehicle import plant
from steer_env.vehicle.cars import Car
from steer_env.vehicle.steering.eps import SAMPLE_TIME, without_assist

Array = NDArray[np.float64]

HELD_TORQUE = 2.0  # of the hands [N m]
NO_TORQUE = 1e-6  # below this a creeping law counts as free [N m]; a damper of 1 kN m s/rad is


class History(NamedTuple):
    """A displacement that every law is led through."""

    title: str
    x: Array  # (T,) [rad]
    dt: float  # [s]


def _through(points: tuple[float, ...], step: float) -> Array:
    """Straight lines through turning points, in steps of about ``step``; points and step in one unit."""
    pieces = [np.linspace(a, b, max(round(abs(b - a) / step), 1) + 1)[1:] for a, b in pairwise(points)]
    return np.concatenate([[points[0]], *pieces])


def _growing_sine() -> History:
    t = np.arange(0.0, 4.0 + 5e-4, 1e-3)
    x = 2.0 * DEGREE * t / t[-1] * np.sin(2.0 * math.pi * t)
    return History("sine at 1 Hz that grows to 2 deg", x, 1e-3)


def _nested_loops() -> History:
    x = _through((0.0, 4.0, -4.0, 2.0, -2.0, 1.0, -1.0, 0.5, -0.5, 0.25, -0.25), 0.01)
    return History("nested loops from 4 deg down, at 0.01 deg/s", x * DEGREE, 1.0)


def _held() -> History:
    x = np.concatenate([_through((0.0, 0.5), 1e-3), np.full(500, 0.5), _through((0.5, 0.3), 1e-3), np.full(500, 0.3)])
    return History("moved at 1 deg/s, held, moved back, held", x * DEGREE, 1e-3)


HISTORIES = {"growing_sine": _growing_sine(), "nested_loops": _nested_loops(), "held": _held()}
# Samples of the nested loops: the reversal from saturation at 4 deg, and the first inside it, at 2 deg.
SATURATED_TURN, NESTED_TURN = 400, 1800


def characteristics(p: Any) -> dict[str, Array]:
    """Torque of a law along every history [N m]."""
    return {name: friction.response(p, history.x, history.dt) for name, history in HISTORIES.items()}


class Residual(NamedTuple):
    """RMS difference to a base law, of the base law's saturated torque [1]."""

    saturated: float  # on the two branches after a reversal from saturation
    nested: float  # on the loops nested in them


def residual(nested: Array, base: Array) -> Residual:
    """Residual of one law's torque in the nested loops against another's."""
    part = (nested - base) / np.abs(base).max()
    branch, loops = part[SATURATED_TURN + 1 : NESTED_TURN], part[NESTED_TURN + 1 :]
    return Residual(float(np.sqrt(np.mean(branch**2))), float(np.sqrt(np.mean(loops**2))))


def _creep_torque(p: Any, distance: float) -> float:
    """Torque of a law that creeps at 1 nrad/s, from rest, after a distance [rad]."""
    memory, w = np.zeros(law_of(p).memory_size(p)), 1e-9
    advance(p, 1.0, memory, w, distance / w)
    return torque(p, 1.0, memory, w)


def dry(p: Any) -> bool:
    """Whether a law has dry friction: a torque that stays as the speed of a slide goes to zero."""
    return _creep_torque(p, 100.0) > NO_TORQUE


def set_valued(p: Any) -> bool:
    """Whether the torque of a law jumps where motion begins."""
    return _creep_torque(p, 0.0) > NO_TORQUE


class Calibration(NamedTuple):
    """Saturated torque and pre-sliding stiffness that LuGre and Masing share after a saturated reversal."""

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
    """LuGre or Masing with a calibration and the micro-damper of a damping ratio at the inertia ``I2`` [kg m2]."""
    _, F_c, sigma_0 = calibration
    sigma_1 = 2.0 * damping_ratio * math.sqrt(sigma_0 * I2)
    if law == "lugre":
        return friction.make(law, F_c=F_c, sigma_0=sigma_0, sigma_1=sigma_1)
    return friction.make(law, F_c=F_c, x_c=F_c / (2.0 * sigma_0), sigma_1=sigma_1)


class Held(NamedTuple):
    """One held-torque test on the car."""

    assist: str  # a key of ASSIST
    calibration: str
    law: str
    damping_ratio: float  # of the pre-sliding mode [1]
    ripple: float  # peak to peak of the torsion-bar torque from ``SETTLING`` into the hold [N m]
    ripple_fine: float  # the same at a tenth of the step [N m]
    lasting: float  # ripple in the last second over that in the first second after ``SETTLING`` [1]
    torque: Array  # (T,) torsion-bar torque [N m], every ``THIN`` samples from the start of the hold


ASSIST = {"on": "assist on", "off": "assist off"}
THIN = 4
_SECOND = round(1.0 / SAMPLE_TIME)


def _torsion_bar(car: Car, p: Any, assisted: bool, substeps: int) -> Array:
    manoeuvre = manoeuvres.make("hold", torque=HELD_TORQUE)
    whole = manoeuvres.build_plant(car, manoeuvre, p)
    if not assisted:
        whole = whole._replace(assist=without_assist(whole.assist))
    inputs = manoeuvres.inputs(manoeuvre, HELD_TORQUE, manoeuvre.duration)
    record = np.zeros((len(inputs), len(plant.CHANNELS)))
    plant.run(whole, plant.initial_state(whole), inputs, record, substeps)
    return record[round(RISE / SAMPLE_TIME) :, plant.CHANNEL["torsion_bar_torque"]]


def held_torque(car: Car, law: str) -> list[Held]:
    """Every held-torque test of LuGre or Masing: with and without assist, both calibrations, every damper."""
    tests = []
    for state, calibration, ratio in product(ASSIST, CALIBRATIONS, DAMPING_RATIOS):
        p = held_law(law, calibration, ratio, car.column.I2)
        coarse, fine = (_torsion_bar(car, p, state == "on", substeps) for substeps in (1, 10))
        settled, settled_fine = (run[round(SETTLING / SAMPLE_TIME) :] for run in (coarse, fine))
        tests.append(
            Held(
                state,
                calibration.title,
                law,
                ratio,
                ripple=float(np.ptp(settled)),
                ripple_fine=float(np.ptp(settled_fine)),
                lasting=float(np.ptp(settled[-_SECOND:]) / np.ptp(settled[:_SECOND])),
                torque=coarse[::THIN].copy(),
            )
        )
    return tests


def ringing(torque: Array) -> float:
    """Frequency of a decaying torque after ``SETTLING`` [Hz]: of its turning points; NaN below four of them."""
    rate = np.diff(torque[round(SETTLING / SAMPLE_TIME / THIN) :])
    turns = np.flatnonzero((rate[1:] >= 0.0) != (rate[:-1] >= 0.0))
    if turns.size < 4:
        return math.nan
    return float((turns.size - 1) / (2.0 * (turns[-1] - turns[0]) * THIN * SAMPLE_TIME))


class Verdict(NamedTuple):
    """Masing and LuGre in one state of the assist and one calibration, undamped and with the same damper in both."""

    masing: Held
    lugre: Held
    masing_damped: Held
    lugre_damped: Held

    @property
    def share_of_damper(self) -> float:
        """Part of the gap between Masing's ripple and LuGre's that goes when both get the damper."""
        gap, left = self.masing.ripple - self.lugre.ripple, self.masing_damped.ripple - self.lugre_damped.ripple
        return 1.0 - left / gap if gap else math.nan


def verdicts(tests: list[Held], ratio: float) -> list[Verdict]:
    """What a damper of the given ratio in both laws does, in every state of the assist and every calibration."""
    found = {test[:4]: test for test in tests}
    pairs = [(law, damping) for damping in (0.0, ratio) for law in ("masing", "lugre")]
    return [
        Verdict(*(found[(state, calibration.title, *pair)] for pair in pairs))
        for state, calibration in product(ASSIST, CALIBRATIONS)
    ]
