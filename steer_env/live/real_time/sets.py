"""Cars that a loop in real time switches between while it runs."""

import itertools
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.friction.numerics.packing import pack
from steer_env.live.real_time.switch import ACTING, FAILED, HEAD, NEXT, SWITCHED, TAKEN, Switch
from steer_env.vehicle.plant import CHANNELS
from steer_env.vehicle.steering.column import Column
from steer_env.vehicle.subsystems import Car, Subsystem, channel_signals
from steer_env.vehicle.subsystems.machine_code import address

# One quantity under two names, of the chassis on two tracks and on one.
_SAME = {"body_speed_y": "lateral_speed", "body_rate_z": "yaw_rate", "body_rate_x": "roll_rate", "tan_alpha": "slip"}
# States that are handed over by what they differ from those of straight running: each car has its own there.
_FROM_SETTLED = ("travel_", "height", "pitch_angle", "kappa_", "speed_hold_integral")
_WHEEL_SPEED, _CAR_SPEED = "wheel_angular_velocity_", "body_speed_x"
# States that only an equal car understands, and the parameters that have to be equal.
_OWN = {"gear": "chassis", "shift_time_left": "chassis", "friction_memory_": "friction", "observer_memory_": "assist"}


class CarSet(NamedTuple):
    """A car with its law, assist and chassis, and what the user calls it."""

    label: str
    subsystem: Subsystem  # the subsystem "car" of steer_env.vehicle.subsystems.make


class CarSets:
    """Cars for one loop, which is given this in place of a subsystem; the first one acts.

    Parameters
    ----------
    sets : sequence of CarSet
        At least one, each with another label. The hands of all give an angle, or of all a torque; everything else may
        differ. The code of each structure (law, chassis, functions of the assist) is compiled once and kept on disk.

    Raises
    ------
    ValueError
        No set, two with one label, another subsystem than the car, hands that differ, or kernels that are not compiled.
    """

    def __init__(self, sets: Sequence[CarSet]) -> None:
        self.sets = tuple(CarSet(*each) for each in sets)
        _check(self.sets)
        cars = [each.subsystem for each in self.sets]
        self._choices = itertools.count(1)
        self.memory = _memory(cars)
        state = np.zeros(HEAD + 2 * self.memory.start.shape[1])
        state[NEXT], state[ACTING], state[TAKEN] = -1.0, 0.0, 0.0
        state[HEAD : HEAD + self.memory.start.shape[1]] = self.memory.start[0]
        self.subsystem = cars[
            0
        ]._replace(
            name="sets",
            title="Cars of which one acts",
            parameters=self.memory,
            states=(),
            given=max((car.given for car in cars), key=len),  # those of a chassis whose speed is not held, too
            outputs=channel_signals(CHANNELS),
            begin=state,
            start=state,
            shown=cars[0].shown[: len(CHANNELS)].copy(),
        )

    def choose(self, index: int) -> None:
        """Let another set take over, from any thread, without waiting; the latest choice wins.

        Raises
        ------
        ValueError
            There is no such set.
        """
        if index not in range(len(self.sets)):
            labels = ", ".join(f"{i} ({each.label})" for i, each in enumerate(self.sets))
            raise ValueError(f"the set must be one of {labels}, got {index!r}")
        self.memory.wanted[0] = next(self._choices) * len(self.sets) + index

    def chosen(self) -> int:
        """The set that acts: the former one until the new one has taken over entirely."""
        return int(self.memory.now[0])

    def counts(self) -> dict[str, int]:
        """How often a set took over, and how often one was dropped because it did not stay finite."""
        return {"switched": int(self.memory.counts[SWITCHED]), "dropped": int(self.memory.counts[FAILED])}


def _check(sets: tuple[CarSet, ...]) -> None:
    if not sets:
        raise ValueError("a loop needs at least one set")
    labels = [each.label for each in sets]
    for each in sets:
        if labels.count(each.label) > 1:
            raise ValueError(f"each set needs its own label, got {each.label!r} twice")
        if each.subsystem.name != "car":
            raise ValueError(f"a set is made of the subsystem car, got {each.subsystem.name} for {each.label!r}")
        if each.subsystem.parameters.robot != sets[0].subsystem.parameters.robot:
            raise ValueError(f"the hands of all sets give an angle or of all a torque; those of {each.label!r} differ")


def _memory(cars: list[Subsystem]) -> Switch:
    n, most = len(cars), max(car.start.size for car in cars)
    start = np.zeros((n, most))
    for i, car in enumerate(cars):
        start[i, : car.start.size] = car.start
    source, scale, shift = np.full((n, n, most), -1), np.ones((n, n, most)), np.zeros((n, n, most))
    for old, new in itertools.permutations(range(n), 2):
        _hand_over(cars[old], cars[new], source[old, new], scale[old, new], shift[old, new])
    rows = np.zeros((3, max(len(car.outputs) for car in cars)))
    rows[0, : len(cars[0].outputs)] = cars[0].shown
    columns = np.rec.array(
        [tuple(car.parameters.column) for car in cars],
        dtype=[(name, np.float64) for name in Column._fields],
    )
    pieces = []
    for p in (car.parameters for car in cars):
        pieces += [*pack(Car(p)), pack(Car(p._replace(robot=1.0)))[0]]
    parameters = np.concatenate(pieces)
    first = np.cumsum([0, *(piece.size for piece in pieces[:-1])])
    addresses = parameters.ctypes.data + parameters.itemsize * first
    return Switch(
        code=np.array([address(car) for car in cars]),
        parameters=parameters,
        numbers=addresses[0::3].copy(),
        tables=addresses[1::3].copy(),
        held=addresses[2::3].copy(),
        sizes=np.array([car.start.size for car in cars]),
        columns=columns,
        start=start,
        source=source,
        scale=scale,
        shift=shift,
        rows=rows,
        given=np.zeros(cars[0].given_size),
        by_torque=cars[0].parameters.robot == 0.0,
        wanted=np.zeros(1, np.int64),
        now=np.array([0.0, -1.0, 0.0]),
        counts=np.zeros(2, np.int64),
    )


def _common(name: str) -> str:
    """The name of a quantity that a chassis may call otherwise."""
    return next((name.replace(own, common) for own, common in _SAME.items() if name.startswith(own)), name)


def _hand_over(
    old: Subsystem, new: Subsystem, source: NDArray[np.int64], scale: NDArray[np.float64], shift: NDArray[np.float64]
) -> None:
    """Where each state of a new car comes from in an old one, what it is multiplied by and what is added."""
    places = {_common(name): i for i, name in enumerate(old.states)}
    places |= {name: i for i, name in enumerate(old.states)}
    own = tuple(name for name, field in _OWN.items() if not _equal(old.parameters, new.parameters, field))
    for k, name in enumerate(new.states):
        i = places.get(name, places.get(_common(name), -1))
        if i < 0 or name.startswith(own):
            continue
        source[k] = i
        if name.startswith(_FROM_SETTLED):
            shift[k] = new.start[k] - old.start[i]
        elif name.startswith(_WHEEL_SPEED) and not name.endswith(("_derivative", "_before")):
            before, after = (subsystem.start[subsystem.states.index(_CAR_SPEED)] for subsystem in (old, new))
            if min(abs(v) for v in (before, after, old.start[i])) > 1.0:  # at rest, no radius can be told
                scale[k] = new.start[k] / after / (old.start[i] / before)


def _equal(old: Any, new: Any, field: str) -> bool:
    """Whether a field of two plants holds the same law or chassis with the same numbers."""
    a, b = getattr(old, field), getattr(new, field)
    return type(a) is type(b) and all(map(np.array_equal, pack(a), pack(b)))
