"""Linear baselines: sampled controllers designed for the speed at which an episode starts.

    u = C x + D y, limited to its authority, times its share;    x <- A x + B y + E u

y are observations, u is the requested torque. The design model is the assist loop of
:mod:`steer_env.vehicle.steering.linear` with prescribed handwheel motion, sampled at ``control_dt``.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.assists.common.definition import Array, Baseline
from steer_env.friction.numerics.kernel import bind, kernel
from steer_env.vehicle.cars import Car
from steer_env.vehicle.steering import linear
from steer_env.vehicle.steering.eps import SAMPLE_TIME
from steer_env.vehicle.steering.margins import boost_gain

if TYPE_CHECKING:
    import control

Response = NDArray[np.complex128]  # of a system or a loop, at points of the unit circle


class Linear(NamedTuple):
    """Matrices of a controller with n states and m observations."""

    A: Array  # (n, n)
    B: Array  # (n, m)
    E: Array  # (n,) of the torque that is requested
    C: Array  # (n,)
    D: Array  # (m,)


@kernel
def _step(controllers, limit, shares, y, x, new, out):
    """One control step of every row: ``controllers`` is a :class:`Linear` with the rows' matrices one after another."""
    A, B, E, C, D = controllers
    for i in range(y.shape[0]):
        u = 0.0
        for j in range(x.shape[1]):
            u += C[i, j] * x[i, j]
        for j in range(y.shape[1]):
            u += D[i, j] * y[i, j]
        u = shares[i] * min(max(u, -limit), limit)
        for k in range(x.shape[1]):
            new[k] = E[i, k] * u
            for j in range(x.shape[1]):
                new[k] += A[i, k, j] * x[i, j]
            for j in range(y.shape[1]):
                new[k] += B[i, k, j] * y[i, j]
        for k in range(x.shape[1]):
            x[i, k] = new[k]
        out[i] = u


class LinearBaseline(Baseline):
    """A linear controller; a subclass gives :meth:`design` and :meth:`signals`, and ``speed`` is among its needs."""

    authority = 1.0  # largest torque over the action's full scale

    def __init__(self, env: Any) -> None:
        super().__init__(env)
        self._designs: dict[float, Linear] = {}
        self._controllers: Linear | None = None  # of all rows: each matrix has a first axis more
        self._kernel: Callable[..., None] | None = None

    def design(self, speed: float) -> Linear:
        """The controller for a speed [m/s]."""
        raise NotImplementedError

    def signals(self, seen: Any) -> Array:
        """The controller's inputs y (n, m) from the needed observations."""
        raise NotImplementedError

    def shares(self, seen: Any) -> Array:
        """The share (n,) of the controller's torque that is requested, 0 to 1."""
        return np.ones(self.n)

    def begin(self, i: int, seen: Any) -> None:
        """Start at rest, with the design for the speed rounded to whole m/s."""
        speed = float(round(abs(seen.speed)))
        if speed not in self._designs:
            self._designs[speed] = self.design(speed)
        design = self._designs[speed]
        if self._controllers is None:
            self._controllers = Linear(*(np.zeros((self.n, *matrix.shape)) for matrix in design))
            self._x, self._new_x = np.zeros((self.n, len(design.A))), np.zeros(len(design.A))
            self._out = np.zeros(self.n)
        for rows, matrix in zip(self._controllers, design):
            rows[i] = matrix
        self._x[i] = 0.0

    def torque(self, seen: Any) -> Array:
        """Torque that the controller requests [N m]."""
        limit = self.authority * self.scale
        arguments = self._controllers, limit, self.shares(seen), self.signals(seen), self._x, self._new_x, self._out
        if self._kernel is None:
            self._kernel = bind(_step, *arguments)
        self._kernel(*arguments)
        return self._out.copy()


def slopes(car: Car, speed: float) -> list[float]:
    """Slopes of the boost curve [1] at a speed [m/s], one for each interval of the table's torques."""
    edges = car.assist.torques
    return sorted({round(boost_gain(car.assist, torque, speed), 6) for torque in 0.5 * (edges[1:] + edges[:-1])})


def discretise(car: Car, gain: float, speed: float, dt: float) -> "control.StateSpace":
    """The assisted plant sampled at control steps of ``dt`` [s] with inputs that are constant over a step: exact.

    Inputs and outputs are those of :func:`steer_env.vehicle.steering.linear.plant`, whose boost is closed at a slope
    ``gain`` [1].
    """
    import control

    plant = linear.closed(linear.plant(car.column, car.assist, speed), linear.answer(car.assist, gain))
    A, B = plant.A, np.zeros_like(plant.B)
    whole = np.eye(len(A))
    for _ in range(round(dt / SAMPLE_TIME)):
        B, whole = A @ B + plant.B, A @ whole
    return control.ss(whole, B, plant.C, 0.0, dt, inputs=list(plant.inputs), outputs=list(plant.outputs))
