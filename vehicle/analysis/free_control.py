"""Free control: what the car does when nobody holds the handwheel.

:func:`modes` linearises the sampled plant without friction, from the controller to the tyres. :func:`pulse` runs the
plant as it is through a pulse of hand torque and judges the motion that follows; with dry friction the two differ,
because friction holds the steering against a small motion and fades beside a large one.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eig

from steer_env.friction.numerics.check import not_negative, number
from steer_env.vehicle import plant
from steer_env.vehicle.analysis.linearised import FRICTIONLESS, transition
from steer_env.vehicle.cars import SPEED_MAX, Car
from steer_env.vehicle.chassis.common.interface import HAND, INPUTS, WHEELS
from steer_env.vehicle.layout import plant_layout
from steer_env.vehicle.plant import CHANNEL, CHASSIS_STEP, Plant
from steer_env.vehicle.steering.eps import SAMPLE_TIME

Array = NDArray[np.float64]

_PARTICIPATION = 1e-12  # of the steering in a mode: from 1e-8 up in its own modes, rounding of 1e-26 in the others
FASTEST_MODE = 50.0  # frequency up to which modes are returned, where the step of 2 ms still resolves them [Hz]

SPIN_SIDESLIP = 0.5  # sideslip angle beyond which the car counts as spinning, assumed [rad]
WINDOW = 2.0  # over which the amplitude is read [s]
FREE_TIME = 6.0  # after the pulse until the motion is judged [s]
SETTLED_AMPLITUDE = math.radians(0.5)  # amplitude of the yaw rate that may remain [rad/s]
STUCK = math.radians(0.02)  # amplitude below which the yaw rate counts as at rest, assumed [rad/s]
LOWEST, STRIDE = 10.0, 5.0  # speeds that are tried before the bisection for the limit, assumed [m/s]


def modes(p: Plant) -> NDArray[np.complex128]:
    """Eigenvalues of the free car that the steering takes part in: hands off, no friction, around straight running.

    On two tracks the left-right symmetric motions (heave, pitch, speed hold) are apart from the steering at straight
    running and do not count. They are told by the participation factors of handwheel and column, which are products of
    left and right eigenvectors and so free of units: they are zero but for rounding in a mode of these motions.
    Neutral modes (position, yaw angle, distance) are left out by
    :func:`steer_env.vehicle.analysis.linearised.transition`.

    Parameters
    ----------
    p : Plant
        The friction law and the prescribed handwheel, if any, are replaced: no friction, no hand torque.

    Returns
    -------
    (n,) array of complex
        Up to ``FASTEST_MODE``, by their distance from zero; conjugates follow one another [1/s].
    """
    free = p._replace(friction=FRICTIONLESS, robot=0.0)
    matrix, index = transition(free)
    z, left, right = eig(matrix, left=True)
    steering = index < plant_layout(free).assist  # handwheel and column
    with np.errstate(divide="ignore", invalid="ignore"):  # the zeros of the multi-step rules have no exact vectors
        shares = np.abs(left.conj() * right) / np.abs(np.sum(left.conj() * right, axis=0))
        rates = np.log(z) / CHASSIS_STEP
    found = rates[(shares[steering].sum(axis=0) > _PARTICIPATION) & (np.abs(rates) < 2.0 * math.pi * FASTEST_MODE)]
    return found[np.lexsort((found.imag, np.abs(found).round(6)))]


def least_damping_ratio(p: Plant, highest: float = 10.0) -> tuple[float, float]:
    """Damping ratio and frequency [Hz] of the least damped of the :func:`modes` below a frequency.

    The damping ratio is -Re/|eigenvalue|, negative where the motion grows, and -1 where it grows without oscillation.

    Parameters
    ----------
    p : Plant
        As in :func:`modes`.
    highest : float
        Undamped frequency up to which a mode counts, which leaves out the handwheel on its torsion bar [Hz].

    Returns
    -------
    ratio, frequency : float
        1 and 0 where nothing oscillates or grows.
    """
    highest = number("highest", highest, minimum=0.0, maximum=FASTEST_MODE, above=True)
    found = modes(p)
    found = found[((found.imag > 0.0) | (found.real > 0.0)) & (np.abs(found) < 2.0 * math.pi * highest)]
    if not found.size:
        return 1.0, 0.0
    ratios = -found.real / np.abs(found)
    least = int(np.argmin(ratios))
    return float(ratios[least]), float(np.abs(found[least]) / (2.0 * math.pi))


class Pulse(NamedTuple):
    """The motion after a pulse of hand torque, and what became of it."""

    record: Array  # (N, C) channels at the end of each sample, SI; up to the first non-finite one
    lost: str  # why the car counts as spinning: "sideslip", "wheel lift" or "non-finite"; empty where it does not
    sideslip: float  # largest sideslip angle [rad]
    amplitudes: Array  # (n,) half the range of the yaw rate in each 2 s that end 6 s after the pulse or later [rad/s]

    @property
    def spins(self) -> bool:
        """Whether the car spins, lifts a wheel, rolls over or leaves the range of numbers."""
        return bool(self.lost)

    @property
    def amplitude(self) -> float:
        """Amplitude of the yaw rate over the last 2 s [rad/s]."""
        return float(self.amplitudes[-1])

    @property
    def residual(self) -> float:
        """Mean yaw rate over the last 2 s, at which dry friction holds the car; NaN after a spin [rad/s]."""
        return math.nan if self.lost else float(self.record[-round(WINDOW / SAMPLE_TIME) :, CHANNEL["yaw_rate"]].mean())

    @property
    def decays(self) -> bool:
        """Whether the car does not spin and its motion gets smaller from window to window, or is at rest."""
        a = self.amplitudes
        return not self.lost and bool(np.all((a[1:] < a[:-1]) | (a[1:] < STUCK)))

    @property
    def settles(self) -> bool:
        """Whether the motion decays, and from 6 s on its amplitude remains below 0.5 deg/s."""
        return self.decays and bool(np.all(self.amplitudes < SETTLED_AMPLITUDE))

    @property
    def verdict(self) -> str:
        """One of "settles", "decays" (too slowly), "oscillates" (is sustained or grows), "spins"."""
        if self.lost:
            return "spins"
        return "settles" if self.settles else "decays" if self.decays else "oscillates"


def pulse(p: Plant, torque: float = 3.0, duration: float = 0.3, time: float = 10.0, substeps: int = 1) -> Pulse:
    """Run a pulse of hand torque from straight running, then free hands, and judge the motion.

    Parameters
    ----------
    p : Plant
        With hand torque as its input.
    torque : float
        Of the hands, constant during the pulse [N m].
    duration : float
        Of the pulse [s].
    time : float
        Free hands after the pulse, at least 8 [s].
    substeps : int
        As in ``plant.run``.

    Raises
    ------
    ValueError
        For a plant with a prescribed handwheel angle, or a value out of range.
    """
    if p.robot:
        raise ValueError("a pulse needs a plant whose input is the hand torque (robot=False)")
    hands = round(not_negative("duration", duration) / SAMPLE_TIME)
    free = round(number("time", time, minimum=FREE_TIME + WINDOW, maximum=1000.0) / SAMPLE_TIME)
    inputs = np.zeros((hands + free, len(INPUTS)))
    inputs[:hands, HAND] = number("torque", torque, minimum=-100.0, maximum=100.0)
    names = {name: i for i, (name, _) in enumerate(plant.channels(p))}
    record, start = np.zeros((len(inputs), len(names))), plant.initial_state(p)
    fine = plant.run(p, start, inputs, record, substeps)
    bad = np.flatnonzero(~np.isfinite(record).all(axis=1))
    record = record[: bad[0] if bad.size else None]
    forward = record[:, names["longitudinal_speed"]] if "longitudinal_speed" in names else p.chassis.v_x
    sideslip = float(np.abs(np.arctan2(record[:, CHANNEL["lateral_speed"]], forward)).max(initial=0.0))
    loads = record[:, [CHANNEL[f"wheel_load_{wheel}"] for wheel in WHEELS]]
    lost = "sideslip" if sideslip > SPIN_SIDESLIP else "wheel lift" if (loads <= 0.0).any() else ""
    lost = lost or ("" if fine else "non-finite")
    window = round(WINDOW / SAMPLE_TIME)
    count = (free - round(FREE_TIME / SAMPLE_TIME)) // window + 1
    parts = np.split(record[-count * window :, CHANNEL["yaw_rate"]], count) if not lost else []
    amplitudes = np.array([0.5 * float(np.ptp(part)) for part in parts] or [math.inf])
    return Pulse(record, lost, sideslip, amplitudes)


def limit(
    car: Car,
    law: Any = None,
    chassis: str = "single_track",
    torque: float = 3.0,
    duration: float = 0.3,
    *,
    highest: float = 60.0,
    tolerance: float = 0.5,
) -> float:
    """The highest speed up to which the car neither spins nor oscillates on after a pulse of the hands.

    The speed is raised from 10 m/s in strides of 5 m/s to the first failure, and bisected between that and the last
    pass.

    Parameters
    ----------
    car : Car
    law : str or parameters
        As in ``Car.plant``.
    chassis : str
    torque, duration : float
        As in :func:`pulse`.
    highest : float
        Speed at which the search ends, 10 to 70 [m/s].
    tolerance : float
        Accuracy, at least 0.01 [m/s].

    Returns
    -------
    float
        ``highest`` where nothing fails, 0 where the car fails at 10 m/s already [m/s].
    """
    highest = number("highest [m/s]", highest, minimum=LOWEST, maximum=SPEED_MAX)
    tolerance = number("tolerance [m/s]", tolerance, minimum=0.01, maximum=10.0)

    def decays(speed: float) -> bool:
        return pulse(car.plant(law, speed, chassis=chassis), torque, duration).decays

    low, high = 0.0, LOWEST
    while decays(high):
        if high == highest:
            return highest
        low, high = high, min(high + STRIDE, highest)
    while low and high - low > tolerance:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if decays(middle) else (low, middle)
    return low
