"""Several cars in one loop, of which one acts, and how another one takes over without a jump.

Each car is a function at an address (:mod:`steer_env.vehicle.subsystems.machine_code`), so that the loop is compiled
once whatever cars there are. A switch goes through these phases, each in whole samples:

run-in (``RUN_IN``)   The next car receives the states of the acting one and runs beside it with the same inputs. What
                      is shown is the acting one to the bit. Where the hands give a torque, the next car follows the
                      handwheel of the acting one.
fade (``FADE``)       Every channel shown is ``(1 - share) acting + share next``, the share rising linearly. Where
                      that would change the torsion bar's torque by more than ``LARGEST_STEP`` in a sample, the share
                      rises slower. Where the hands give a torque, one handwheel moves under the mixed torque, by the
                      equation of the column (C1), and both cars follow it.

A next car that does not stay finite, whose torsion bar passes ``IMPLAUSIBLE``, or whose fade takes longer than
``LONGEST`` is dropped: in the run-in at once, in the fade by fading back from what it showed last, its torque at most
``FARTHEST`` from that of the acting car. A choice within a run-in replaces the next car. Within a fade, the choice of
the acting car turns the fade round; another one waits for the end, and the latest wins.

The state array holds ``HEAD`` numbers of the switch and behind them two places for the state of a car, so that a sample
that fails leaves switch and cars as they were.
"""

import itertools
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.friction.numerics.bounds import within
from steer_env.friction.numerics.kernel import kernel
from steer_env.friction.numerics.packing import pack
from steer_env.vehicle.plant import CHANNEL, CHANNELS, meanings
from steer_env.vehicle.steering.column import COLUMN_ANGLE, COLUMN_SPEED, HANDWHEEL_ANGLE, HANDWHEEL_SPEED, Column
from steer_env.vehicle.steering.eps import SAMPLE_TIME
from steer_env.vehicle.subsystems import Car, Subsystem, channel_signals, is_finite, register
from steer_env.vehicle.subsystems.machine_code import address, call

RUN_IN = 200  # samples; assumed, some time constants of assist and tyres
FADE = 100  # samples
LARGEST_STEP = 0.04  # of the torque, by the fade, in a sample [N m]; half of it where the hands give a torque
LONGEST = 2000  # samples of a fade; assumed, at LARGEST_STEP a difference of 80 N m
IMPLAUSIBLE = 1000.0  # torque that no torsion bar of a car has; assumed [N m]
FARTHEST = 8.0  # torque from which it fades back, beside that of the acting car, within 0.4 s; assumed [N m]

HEAD = 8
# Positions of the switch's own numbers: which car acts, at which place its state stands, which car is next (-1: none),
# samples since the choice, share of the next car, whether it was dropped, the choice that was taken last, and whether
# the fade goes back.
ACTING_CAR, ACTING_PLACE, NEXT_CAR, NEXT_AGE, NEXT_SHARE, DROPPED_CAR, TAKEN_CHOICE, FADING_BACK = range(HEAD)
SWITCHED, FAILED = range(2)  # counts
HAND_ANGLE, HAND_SPEED = 1, 2  # among the inputs of a car, behind the hand torque
_SHOWN_CHANNELS = len(CHANNELS)
_TORQUE, _HANDWHEEL_TORQUE = CHANNEL["torsion_bar_torque"], CHANNEL["handwheel_torque"]

Addresses = NDArray[np.int64]  # (N,) one for each car


class Switch(NamedTuple):
    """Memory of N cars, whose states have up to S numbers and whose rows up to C channels."""

    code: Addresses
    parameters: NDArray[np.float64]  # (P,) of all cars, to which the next three point, and which lives as they do
    numbers: Addresses  # of the parameters as they are
    held: Addresses  # of the same with a handwheel angle that is prescribed
    tables: Addresses
    sizes: NDArray[np.int64]  # (N,) of the states
    columns: Any  # (N,) records of Column
    start: NDArray[np.float64]  # (N, S) settled states
    source: NDArray[np.int64]  # (N, N, S) where each state of the second comes from in the first; -1: from its start
    scale: NDArray[np.float64]  # (N, N, S) and by what it is multiplied
    shift: NDArray[np.float64]  # (N, N, S) and what is added
    rows: NDArray[np.float64]  # (3, C) channels at both places, and those of the next car in the sample before
    given: NDArray[np.float64]  # (G,) inputs of a car that follows
    by_torque: bool  # whether the hands give a torque
    wanted: NDArray[np.int64]  # (1,) the last choice: a number that grows, times N, plus the car
    now: NDArray[np.float64]  # (3,) car that acts, next car or -1, its share
    counts: NDArray[np.int64]  # (2,) SWITCHED and FAILED


@kernel
def _begin(m, state):
    """Take the last choice: the car that becomes the next one receives the state of the acting one."""
    wanted = m.wanted[0]  # once, as it may change meanwhile
    acting, chosen = int(state[ACTING_CAR]), wanted % m.code.size
    state[TAKEN_CHOICE] = wanted
    if chosen == acting:
        state[NEXT_CAR] = -1.0
    elif chosen != int(state[NEXT_CAR]):
        first, size = int(state[ACTING_PLACE]) * m.start.shape[1], m.start.shape[1]
        old, new = HEAD + first, HEAD + size - first
        for k in range(m.sizes[chosen]):
            source = m.source[acting, chosen, k]
            value = m.start[chosen, k]
            if source >= 0:
                value = m.scale[acting, chosen, k] * state[old + source] + m.shift[acting, chosen, k]
            state[new + k] = value
        state[NEXT_CAR], state[NEXT_AGE], state[NEXT_SHARE], state[DROPPED_CAR], state[FADING_BACK] = (
            chosen,
            0.0,
            0.0,
            0.0,
            0.0,
        )


@kernel
def _turn(m, state):
    """Within a fade, take the choice of one of its two cars."""
    wanted = m.wanted[0]  # once, as it may change meanwhile
    chosen = wanted % m.code.size
    if chosen == int(state[ACTING_CAR]):
        state[TAKEN_CHOICE], state[FADING_BACK] = wanted, 1.0
    elif chosen == int(state[NEXT_CAR]) and state[DROPPED_CAR] == 0.0:
        state[TAKEN_CHOICE], state[FADING_BACK] = wanted, 0.0


@kernel
def _run(m, car, place, follows, state, given, inputs):
    """Advance a car by a sample; whether its state is finite."""
    return call(
        m.code[car],
        m.held[car] if follows else m.numbers[car],
        m.tables[car],
        state.ctypes.data + 8 * (HEAD + place * m.start.shape[1]),
        given.ctypes.data,
        inputs.ctypes.data,
        m.rows.ctypes.data + 8 * place * m.rows.shape[1],
        1,
    )


@kernel
def _column(m, car, place, state, twist):
    """What a column adds to the equation of the handwheel, ``a w1 = r + hand torque`` (C4), over a step.

    ``twist`` is the torque of a torsion bar that no longer moves [N m]; NaN where it does. By wire there is none, and
    the motor gives the torque that it gave at the end of the last sample.
    """
    c, q = m.columns[car], state[HEAD + place * m.start.shape[1] :]
    if c.K_tb == 0.0 and twist != twist:
        twist = m.rows[place, _TORQUE]
    inertia = 2.0 * (c.I1 + c.I_arm) / SAMPLE_TIME
    a = inertia + c.C1 + c.C_arm + 0.5 * SAMPLE_TIME * c.K_arm
    r = inertia * q[HANDWHEEL_SPEED] - c.K_arm * q[HANDWHEEL_ANGLE]
    if twist == twist:
        return a, r - twist
    K = c.C_tb + 0.5 * SAMPLE_TIME * c.K_tb  # (C4)
    return a + K, r - c.K_tb * (q[HANDWHEEL_ANGLE] - q[COLUMN_ANGLE]) + K * q[COLUMN_SPEED]


@kernel
def _arms(c, angle, speed, w):
    """Torque that arms take from that of the hands over a step with the mean speed ``w`` (C3) [N m]."""
    return c.I_arm * 2.0 * (w - speed) / SAMPLE_TIME + c.C_arm * w + c.K_arm * (angle + 0.5 * SAMPLE_TIME * w)


@kernel
def _handwheel(m, state, hand):
    """Move the one handwheel of both cars by a step under a hand torque [N m].

    The column speeds are those at the begin of the step. The new angle [rad] and speed [rad/s] become inputs of the
    cars, which follow.

    Returns
    -------
    float
        Hand torque less that of arms [N m].
    """
    place, share = int(state[ACTING_PLACE]), state[NEXT_SHARE]
    acting, following = int(state[ACTING_CAR]), int(state[NEXT_CAR])
    a, r = _column(m, acting, place, state, np.nan)
    twist = m.rows[1 - place, _TORQUE] if state[DROPPED_CAR] != 0.0 else np.nan
    a_next, r_next = _column(m, following, 1 - place, state, twist)
    first = HEAD + place * m.start.shape[1]
    angle, speed = state[first + HANDWHEEL_ANGLE], state[first + HANDWHEEL_SPEED]
    # (C7), of a column between both
    w = ((1.0 - share) * r + share * r_next + hand) / ((1.0 - share) * a + share * a_next)
    m.given[HAND_ANGLE] = angle + SAMPLE_TIME * w
    m.given[HAND_SPEED] = 2.0 * w - speed
    arms = _arms(m.columns[acting], angle, speed, w), _arms(m.columns[following], angle, speed, w)
    return hand - (1.0 - share) * arms[0] - share * arms[1]


@kernel
def _drop(m, state):
    """Let the next car show what it showed last; in the run-in, where nothing of it is shown, forget it."""
    m.counts[FAILED] += 1
    state[DROPPED_CAR] = state[FADING_BACK] = 1.0
    if state[NEXT_SHARE] == 0.0:
        state[NEXT_CAR] = -1.0
    place = int(state[ACTING_PLACE])
    for j in range(m.rows.shape[1]):
        m.rows[1 - place, j] = m.rows[2, j]
    own = m.rows[place, _TORQUE]
    m.rows[1 - place, _TORQUE] = within(m.rows[2, _TORQUE], own - FARTHEST, own + FARTHEST)


@kernel
def _run_next(m, state, inputs):
    """Advance the next car, beside the acting one."""
    place = 1 - int(state[ACTING_PLACE])
    row = m.rows[place]
    for j in range(row.size):
        m.rows[2, j] = row[j]
    finite = _run(m, int(state[NEXT_CAR]), place, True, state, m.given, inputs) and is_finite(row[:_SHOWN_CHANNELS])
    if not (finite and abs(row[_TORQUE]) <= IMPLAUSIBLE and state[NEXT_AGE] <= RUN_IN + LONGEST):
        _drop(m, state)


@kernel
def _fade(m, state):
    """Move the share of the next car; at its end that car acts."""
    place = int(state[ACTING_PLACE])
    difference = abs(m.rows[1 - place, _TORQUE] - m.rows[place, _TORQUE])
    # A free handwheel answers a ramp of the torque with up to twice its slope.
    most = 0.5 * LARGEST_STEP if m.by_torque else LARGEST_STEP
    change = 1.0 / FADE
    if change * difference > most:
        change = most / difference
    state[NEXT_SHARE] = within(state[NEXT_SHARE] + (-change if state[FADING_BACK] != 0.0 else change), 0.0, 1.0)
    if state[NEXT_SHARE] == 0.0:
        state[NEXT_CAR] = -1.0
    elif state[NEXT_SHARE] >= 1.0 - 1e-9:  # a sum of hundredths is not exactly 1
        state[ACTING_CAR], state[ACTING_PLACE], state[NEXT_CAR], state[NEXT_SHARE] = (
            state[NEXT_CAR],
            1 - place,
            -1.0,
            0.0,
        )
        m.counts[SWITCHED] += 1


@kernel
def _sample(m, state, given, inputs, outputs):
    """Advance all by one sample; whether the acting car stays finite."""
    if state[TAKEN_CHOICE] != m.wanted[0]:
        if state[NEXT_SHARE] == 0.0:
            _begin(m, state)
        else:
            _turn(m, state)
    switching = state[NEXT_CAR] >= 0.0
    fading = switching and state[NEXT_AGE] >= RUN_IN
    if switching:
        state[NEXT_AGE] += 1.0
        for i in range(given.size):
            m.given[i] = given[i]
    hand = _handwheel(m, state, given[0]) if fading and m.by_torque else 0.0
    place = int(state[ACTING_PLACE])
    if not _run(m, int(state[ACTING_CAR]), place, fading, state, m.given if fading else given, inputs):
        return False
    if switching:
        if m.by_torque and not fading:
            first = HEAD + place * m.start.shape[1]
            m.given[HAND_ANGLE] = state[first + HANDWHEEL_ANGLE]
            m.given[HAND_SPEED] = state[first + HANDWHEEL_SPEED]
        if state[DROPPED_CAR] == 0.0:
            _run_next(m, state, inputs)
    if fading:
        _fade(m, state)
    _show(m, state, outputs[0])
    if fading and m.by_torque:
        outputs[0, _HANDWHEEL_TORQUE] = hand
    return True


@kernel
def _show(m, state, shown):
    """Mix the channels of both cars, and tell which acts."""
    place, share = int(state[ACTING_PLACE]), state[NEXT_SHARE]
    for j in range(shown.size):
        shown[j] = m.rows[place, j]
        if share > 0.0:
            shown[j] += share * (m.rows[1 - place, j] - m.rows[place, j])
    m.now[0], m.now[1], m.now[2] = state[ACTING_CAR], state[NEXT_CAR], share


@kernel
def _advance(subsystem, state, given, inputs, outputs, samples):
    finite = True
    for _ in range(samples):
        finite = finite and _sample(subsystem, state, given, inputs, outputs)
    return finite


register(Switch, _advance)


# One quantity under two names, of the chassis on two tracks and on one.
SAME = {"body_speed_y": "lateral_speed", "body_rate_z": "yaw_rate", "body_rate_x": "roll_rate", "tan_alpha": "slip"}
# States that are handed over by what they differ from those of straight running: each car has its own there.
FROM_SETTLED = ("travel_", "height", "pitch_angle", "kappa_", "speed_hold_integral")
WHEEL_SPEED, CAR_SPEED = "wheel_angular_velocity_", "body_speed_x"
# States that only an equal car understands, and the parameters that have to be equal.
OWN_STATES = {
    **{"gear": "chassis", "shift_time_left": "chassis"},
    **{"friction_memory_": "friction", "observer_memory_": "assist"},
}


class CarConfiguration(NamedTuple):
    """A car with its law, assist and chassis, and what the user calls it."""

    label: str
    subsystem: Subsystem  # the subsystem "car" of steer_env.vehicle.subsystems.make


class CarConfigurations:
    """Cars for one loop, which is given this in place of a subsystem; the first one acts.

    Parameters
    ----------
    configurations : sequence of CarConfiguration
        At least one, each with another label. The hands of all give an angle, or of all a torque; everything else may
        differ. The code of each structure (law, chassis, functions of the assist) is compiled once and kept on disk.

    Raises
    ------
    ValueError
        No configuration, two with one label, another subsystem than the car, hands that differ, or kernels that are not
        compiled.
    """

    def __init__(self, configurations: Sequence[CarConfiguration]) -> None:
        self.configurations = tuple(CarConfiguration(*each) for each in configurations)
        _check(self.configurations)
        cars = [each.subsystem for each in self.configurations]
        self._choices = itertools.count(1)
        self.memory = _memory(cars)
        state = np.zeros(HEAD + 2 * self.memory.start.shape[1])
        state[NEXT_CAR], state[ACTING_CAR], state[TAKEN_CHOICE] = -1.0, 0.0, 0.0
        state[HEAD : HEAD + self.memory.start.shape[1]] = self.memory.start[0]
        self.subsystem = cars[
            0
        ]._replace(
            name="configurations",
            title="Cars of which one acts",
            parameters=self.memory,
            states=(),
            given=max((car.given for car in cars), key=len),  # those of a chassis whose speed is not held, too
            outputs=channel_signals(CHANNELS, meanings(cars[0].parameters)),
            start=state,
            shown=cars[0].shown[: len(CHANNELS)].copy(),
        )

    def choose(self, index: int) -> None:
        """Let another configuration take over, from any thread, without waiting; the latest choice wins.

        Raises
        ------
        ValueError
            There is no such configuration.
        """
        if index not in range(len(self.configurations)):
            labels = ", ".join(f"{i} ({each.label})" for i, each in enumerate(self.configurations))
            raise ValueError(f"the configuration must be one of {labels}, got {index!r}")
        self.memory.wanted[0] = next(self._choices) * len(self.configurations) + index

    def chosen(self) -> int:
        """The configuration that acts: the former one until the new one has taken over entirely."""
        return int(self.memory.now[0])

    def counts(self) -> dict[str, int]:
        """How often a configuration took over, and how often one was dropped because it did not stay finite."""
        return {"switched": int(self.memory.counts[SWITCHED]), "dropped": int(self.memory.counts[FAILED])}


def _check(configurations: tuple[CarConfiguration, ...]) -> None:
    if not configurations:
        raise ValueError("a loop needs at least one configuration")
    labels = [each.label for each in configurations]
    for each in configurations:
        if labels.count(each.label) > 1:
            raise ValueError(f"each configuration needs its own label, got {each.label!r} twice")
        if each.subsystem.name != "car":
            raise ValueError(
                f"a configuration is made of the subsystem car, got {each.subsystem.name} for {each.label!r}"
            )
        if each.subsystem.parameters.robot != configurations[0].subsystem.parameters.robot:
            raise ValueError(
                f"the hands of all configurations give an angle or of all a torque; those of {each.label!r} differ"
            )


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
    return next((name.replace(own, common) for own, common in SAME.items() if name.startswith(own)), name)


def _hand_over(
    old: Subsystem, new: Subsystem, source: NDArray[np.int64], scale: NDArray[np.float64], shift: NDArray[np.float64]
) -> None:
    """Where each state of a new car comes from in an old one, what it is multiplied by and what is added."""
    places = {_common(name): i for i, name in enumerate(old.states)}
    places |= {name: i for i, name in enumerate(old.states)}
    own = tuple(name for name, field in OWN_STATES.items() if not _equal(old.parameters, new.parameters, field))
    for k, name in enumerate(new.states):
        i = places.get(name, places.get(_common(name), -1))
        if i < 0 or name.startswith(own):
            continue
        source[k] = i
        if name.startswith(FROM_SETTLED):
            shift[k] = new.start[k] - old.start[i]
        elif name.startswith(WHEEL_SPEED) and not name.endswith(("_derivative", "_before")):
            before, after = (subsystem.start[subsystem.states.index(CAR_SPEED)] for subsystem in (old, new))
            if min(abs(v) for v in (before, after, old.start[i])) > 1.0:  # at rest, no radius can be told
                scale[k] = new.start[k] / after / (old.start[i] / before)


def _equal(old: Any, new: Any, field: str) -> bool:
    """Whether a field of two plants holds the same law or chassis with the same numbers."""
    a, b = getattr(old, field), getattr(new, field)
    return type(a) is type(b) and all(map(np.array_equal, pack(a), pack(b)))
