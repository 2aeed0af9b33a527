"""Linear baselines: sampled controllers designed for the speed at which an episode starts.

    u = C x + D y, held within what it may ask for;    x <- A x + B y + E u

y is what is observed, u the torque asked for. The model of the design is the assist loop of :mod:`steer_env.vehicle.steering.margins`, the
handwheel's motion prescribed and the boost curve replaced by its slope, sampled at ``control_dt``.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.assists.common.definition import Array, Baseline
from steer_env.friction.numerics.kernel import bind, kernel
from steer_env.vehicle.cars import Car
from steer_env.vehicle.steering.eps import SAMPLE_TIME

if TYPE_CHECKING:
    import control

Response = NDArray[np.complex128]  # of a system or a loop, at points of the unit circle


class Linear(NamedTuple):
    """Matrices of a controller with n states and m observations."""

    A: Array  # (n, n)
    B: Array  # (n, m)
    E: Array  # (n,) of the torque as it was held within its limit
    C: Array  # (n,)
    D: Array  # (m,)


@kernel
def _step(A, B, E, C, D, limit, seen, x, new, out):
    """One sample of every lane."""
    for i in range(seen.shape[0]):
        u = 0.0
        for j in range(x.shape[1]):
            u += C[i, j] * x[i, j]
        for j in range(seen.shape[1]):
            u += D[i, j] * seen[i, j]
        u = min(max(u, -limit), limit)
        for k in range(x.shape[1]):
            new[k] = E[i, k] * u
            for j in range(x.shape[1]):
                new[k] += A[i, k, j] * x[i, j]
            for j in range(seen.shape[1]):
                new[k] += B[i, k, j] * seen[i, j]
        for k in range(x.shape[1]):
            x[i, k] = new[k]
        out[i] = u


class LinearBaseline(Baseline):
    """A baseline from a design; a subclass gives :meth:`design` and needs the speed first."""

    def __init__(self, env: Any) -> None:
        super().__init__(env)
        self._designs: dict[float, Linear] = {}
        self._matrices: list[Array] = []
        self._bound: Callable[..., None] | None = None

    authority = 1.0  # share of the action's span that it may take

    def design(self, speed: float) -> Linear:
        """The controller for a speed [m/s]."""
        raise NotImplementedError

    def signals(self, seen: Array) -> Array:
        """What enters the controller, y (n, m), from what is seen."""
        return seen[:, 1:].copy()

    def begin(self, i: int, seen: Array) -> None:
        """At rest, with the design for the speed to the nearest metre a second."""
        speed = float(round(abs(seen[0])))
        if speed not in self._designs:
            self._designs[speed] = self.design(speed)
        chosen = self._designs[speed]
        if not self._matrices:
            self._matrices = [np.zeros((self.n, *matrix.shape)) for matrix in chosen]
            self._x, self._new = np.zeros((self.n, len(chosen.A))), np.zeros(len(chosen.A))
            self._out = np.zeros(self.n)
        for held, matrix in zip(self._matrices, chosen):
            held[i] = matrix
        self._x[i] = 0.0

    def torque(self, seen: Array) -> Array:
        """What the controller asks for [N m]."""
        arguments = *self._matrices, self.authority * self.scale, self.signals(seen), self._x, self._new, self._out
        if self._bound is None:
            self._bound = bind(_step, *arguments)
        self._bound(*arguments)
        return self._out.copy()


def slopes(car: Car, speed: float) -> list[float]:
    """Slopes of the boost curve at a speed [m/s], between the torques of the table [1]."""
    from steer_env.vehicle.steering.margins import boost_gain

    edges = car.assist.torques
    return sorted({round(boost_gain(car.assist, torque, speed), 6) for torque in 0.5 * (edges[1:] + edges[:-1])})


def sampled(car: Car, gain: float, speed: float, dt: float) -> "control.StateSpace":
    """The assisted plant between control steps of ``dt`` [s], inputs held over a step: exact.

    Inputs and outputs as :func:`steer_env.vehicle.steering.margins.assisted_plant`, at a local gain of the boost curve [1].
    """
    import control

    from steer_env.vehicle.steering.margins import assisted_plant

    plant = assisted_plant(car.column, car.assist, gain, speed)
    A, B = plant.A, np.zeros_like(plant.B)
    whole = np.eye(len(A))
    for _ in range(round(dt / SAMPLE_TIME)):
        B, whole = A @ B + plant.B, A @ whole
    return control.ss(whole, B, plant.C, 0.0, dt)


def response(system: "control.StateSpace", z: Response) -> Response:
    """Frequency response of a system with one input and one output at points z (P,) of the unit circle."""
    inverse = np.linalg.solve(z[:, None, None] * np.eye(len(system.A)) - system.A, system.B)
    return (system.C @ inverse)[:, 0, 0] + system.D[0, 0]
