"""The loops of a steer-by-wire, linear, with their margins: that of the rack's position and that of the feel.

The wire itself is in neither: the rack's controller reads the rack, and the handwheel's the handwheel. With friction
that slides at a constant torque, the samples of 1 ms, and the motor's delay and lag, opened at the command:

    L_position = (k_w (k_p P_th + P_w)) (1 + (1 ms/T_i)/(z - 1)),   P of (C2) and (E2)                     (W8)
    L_feel = (k + k_law) P_th + D P_w,   P of (C1) with (C3) and (W6)                                      (W9)

k is a slope of the map and k_law one of the wanted friction, between 0 where it slides and its steepest, directly after
a reversal from sliding. Hands are free, or arms as those of the driver models, relaxed and tensed.
"""

from collections.abc import Callable, Iterator
from itertools import pairwise, product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.friction.law import advance, law_of
from steer_env.friction.law import torque as law_torque
from steer_env.friction.numerics.kernel import plainly
from steer_env.vehicle.steering import eps, linear
from steer_env.vehicle.steering.by_wire import MAX_DELAY, SAMPLE_TIME, SECTION, Wire, as_samples
from steer_env.vehicle.steering.column import Column
from steer_env.vehicle.steering.feels import common as feels
from steer_env.vehicle.steering.linear import System

Array = NDArray[np.float64]

# Inertia, damping and stiffness of the hands' arms [kg m2, N m s/rad, N m/rad]: free, relaxed and tensed (Pick and
# Cole, as steer_env.drivers.robot).
HANDS = ((0.0, 0.0, 0.0), (0.09, 0.45, 6.5), (0.09, 1.75, 37.0))
OUTPUTS = ("angle", "speed")
HIGHEST_OF_HANDS = 10.0  # frequency up to which hands move a handwheel, assumed [Hz]
ROUNDING = 1e-9  # angle of a pole on the real axis [rad]
STABLE = 1.0 + 1e-9  # growth in a sample that counts as none, as of a handwheel without any spring [1]
_REVERSED = 1e-4  # motion by which the steepest slope of a friction law is read, assumed [rad]


class Loop(NamedTuple):
    """A loop that is opened at the command of its motor."""

    plant: System  # from the command [N m] to angle [rad] and speed [rad/s]
    controller: System  # from these to the torque against the command [N m]

    def response(self, z: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """The open loop (F,) at points z (F,) of the unit circle; negative feedback closes it."""
        found = np.zeros(z.size, np.complex128)
        for k in range(len(OUTPUTS)):
            P = self.plant._replace(C=self.plant.C[k : k + 1], D=self.plant.D[k : k + 1])
            K = self.controller._replace(B=self.controller.B[:, k : k + 1], D=self.controller.D[:, k : k + 1])
            found += linear.response(P, z) * (linear.response(K, z) if len(K.A) else K.D[0, 0])
        return found

    def poles(self) -> NDArray[np.complex128]:
        """Eigenvalues of the closed loop over a sample."""
        (A, B, C, _), (E, F, G, H) = self.plant[:4], self.controller[:4]
        return np.linalg.eigvals(np.block([[A - B @ H @ C, -B @ G], [F @ C, E]])).astype(np.complex128)


def _turned(c: Column, a: eps.Assist) -> System:
    """From a motor's command to the angle and the speed of what it turns, a column without torsion bar."""
    from_request = linear.plant(c, a, 0.0)
    angle, speed = np.zeros((2, len(from_request.A)))
    angle[linear.TWIST], speed[linear.COLUMN_SPEED] = -1.0, 1.0
    B = from_request.B[:, :1]
    return from_request._replace(
        B=B, C=np.array([angle, speed]), D=np.zeros((2, 1)), inputs=("command",), outputs=OUTPUTS
    )


def position_loop(c: Column, a: eps.Assist) -> Loop:
    """The loop of the rack's position at the pinion (W8)."""
    w = a.wire
    error = np.array([[w.position_gain, 1.0]])  # (W8)
    K = System(
        np.eye(1),
        SAMPLE_TIME * w.integral_gain * error,
        np.eye(1),
        w.speed_gain * error,
        ("integral",),
        OUTPUTS,
        ("torque",),
    )
    return Loop(_turned(c, a), K)


def feel_loop(c: Column, w: Wire, stiffness: float, damping: float, hands: tuple[float, float, float]) -> Loop:
    """The loop of the feel (W9) at a stiffness [N m/rad] and a damping [N m s/rad] of the feedback motor's command."""
    inertia, friction, spring = hands
    handwheel = Column(I1=1.0, I2=c.I1 + inertia, K_tb=spring, C_tb=0.0, C1=0.0, C2=c.C1 + friction)
    motor = eps.make(
        speeds=(0.0, 1.0),
        torques=(0.0, 1.0),
        boost=np.zeros((2, 2)),
        damping=(0.0, 0.0),
        delay=w.delay * SAMPLE_TIME + w.offset,
        bandwidth=w.bandwidth / (2.0 * np.pi),
    )
    none = np.zeros((0, 0))
    K = System(
        none, np.zeros((0, 2)), np.zeros((1, 0)), np.array([[stiffness, damping]]), (), OUTPUTS, ("torque",)
    )  # (W9)
    return Loop(_turned(handwheel, motor), K)


def steepest(w: Wire) -> float:
    """Slope of the wanted friction directly after a reversal from sliding, over 1e-4 rad [N m/rad]."""
    memory = np.zeros(law_of(w.law).memory_size(w.law))
    run, read = plainly(advance), plainly(law_torque)
    run(w.law, 1.0, memory, 1.0, 10.0)
    before = read(w.law, 1.0, memory, 1e-3)
    run(w.law, 1.0, memory, -_REVERSED, 1.0)
    return float((before - read(w.law, 1.0, memory, -_REVERSED)) / _REVERSED)


def torque_at(w: Wire, angle: float, force: float, speed: float) -> float:
    """Torque of the feel [N m] at rest at a handwheel angle [rad], a told rack force [N] and a vehicle speed [m/s]."""
    return float(plainly(feels.FEELS.of(type(w.feel_law)).torque)(w.feel_law, w, angle, force, speed))  # type: ignore[union-attr]


def slopes(w: Wire, speed: float) -> list[tuple[float, float]]:
    """Torque [N m] in the middle of each cell of the map at a vehicle speed [m/s], and its slope [N m/rad]."""
    torques = [torque_at(w, angle, 0.0, speed) for angle in w.angles.tolist()]
    return [
        (0.5 * (low + high), (high - low) / (right - left))
        for (left, right), (low, high) in zip(pairwise(w.angles), pairwise(torques))
    ]


def feel_loops(c: Column, w: Wire, stiffness: float, speed: float) -> Iterator[Loop]:
    """The loops of the feel at a slope of the map [N m/rad] and a speed [m/s], sliding and reversed, by all hands."""
    damping = float(np.interp(abs(speed), w.speeds, w.damping))
    for more, hands in product((0.0, steepest(w)), HANDS):
        yield feel_loop(c, w, stiffness + more, damping, hands)


def passive_delay(w: Wire, speed: float) -> float:
    """Delay of the feedback motor up to which the feel takes work from any motion of the hand up to 10 Hz [s].

    At an angular frequency omega, with slopes of map and friction law as in (W9), its torque resists with

        Re [(D + (k + k_law)/(j omega)) exp(-j phi)] >= 0,   phi = omega (delay + 0.5 ms) + atan(omega/omega_f)    (W10)

    and half a sample of the hold. A passive friction law beyond its stiffness takes more.
    """
    omega = 2.0 * np.pi * np.geomspace(1e-3, HIGHEST_OF_HANDS, 100)
    damping = float(np.interp(abs(speed), w.speeds, w.damping))
    stiffness = max(slope for _, slope in slopes(w, speed)) + steepest(w)
    phase = np.arctan2(omega * damping, stiffness) - np.arctan(omega / w.bandwidth)
    return float((phase / omega).min() - 0.5 * SAMPLE_TIME)  # (W10)


def growth(c: Column, a: eps.Assist, speed: float, free: bool, slowest: float = 0.0) -> float:
    """Largest growth of an oscillation in a sample, of the rack's loop and, with free hands, of that of the feel [1].

    Oscillations above ``slowest`` [Hz] count. A handwheel without any spring stays where it is, and is none.
    """
    loops = [position_loop(c, a)]
    if free:
        steep = max(slope for _, slope in slopes(a.wire, speed))
        loops += [loop for slope in (0.0, steep) for loop in feel_loops(c, a.wire, slope, speed)]
    poles = np.concatenate([loop.poles() for loop in loops])
    fast = np.abs(np.angle(poles)) > max(2.0 * np.pi * slowest * SAMPLE_TIME, ROUNDING)
    return float(np.abs(poles[fast]).max(initial=0.0))


def _longest(holds: Callable[[float], bool]) -> float:
    """The longest delay [s] up to which a condition holds, 0 where it never does, by bisection over 4 ms."""
    low, high = 0.0, MAX_DELAY * SAMPLE_TIME
    for _ in range(20):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low


def reason(c: Column, a: eps.Assist, speed: float, free: bool) -> str:
    """Why a loop by wire is unstable: its delay with the longest stable one, or gains that no delay makes stable."""

    def calm(assist: eps.Assist, feel: bool) -> bool:
        return growth(c, assist, speed, feel) <= STABLE

    if not calm(a, False):
        longest = _longest(lambda delay: calm(a._replace(**as_samples(delay)), False))
        name, given, loop = "assist.delay", a.delay * SAMPLE_TIME + a.offset, "the loop of the rack's position"
        gains = "speed_gain or position_gain"
    else:
        longest = _longest(lambda delay: calm(a._replace(wire=a.wire._replace(**as_samples(delay))), free))
        name, given = f"{SECTION}.feedback_delay", a.wire.delay * SAMPLE_TIME + a.wire.offset
        loop, gains = f"the loop of the feel at {3.6 * speed:.4g} km/h", "feel, damping or friction_law"
    return (
        f"{name} must be below {longest:.3g} s, from which on {loop} is unstable, got {given:g} s"
        if longest
        else f"{loop} is unstable with every {name}, got {given:g} s: give less of {SECTION}.{gains}"
    )


def check(c: Column, a: eps.Assist) -> None:
    """ValueError for a steer-by-wire whose loops are unstable at a speed of its tables."""
    for speed in a.wire.speeds:
        if growth(c, a, speed, True) > STABLE:
            raise ValueError(reason(c, a, speed, True))
