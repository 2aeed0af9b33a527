"""Simulation of a manoeuvre: the plant that it needs, the amplitude of the hands, and the recording."""

import math
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from itertools import chain, pairwise
from typing import Any, NamedTuple, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from steer_env.courses.iso3888 import footprint
from steer_env.friction.numerics.check import positive
from steer_env.friction.numerics.kernel import bind
from steer_env.friction.numerics.packing import common_columns, kind, leaves, numbers, structure
from steer_env.friction.sites import friction_name
from steer_env.manoeuvres.common.definition import Manoeuvre
from steer_env.manoeuvres.common.shapes import ramp_and_hold
from steer_env.recording.recording import Recording
from steer_env.vehicle import chassis, plant
from steer_env.vehicle.cars import Car
from steer_env.vehicle.chassis.common.interface import Names
from steer_env.vehicle.steering import column, motor, stability
from steer_env.vehicle.steering.by_wire import Wire, handwheel_lock
from steer_env.vehicle.steering.eps import SAMPLE_TIME, without_assist
from steer_env.vehicle.tyre import BEYOND_TYRE

Array = NDArray[np.float64]
T = TypeVar("T")
BLOCK_ROWS = 1024  # rows of a record that are taken apart at once
HOLD = 10  # samples between two calls of a driver
BESIDE = 4  # plants that run side by side
CLOSE = 1e-5  # error of the lateral acceleration that is reached [1]
_RESPONSE = ("handwheel_torque", "lateral_speed", "yaw_rate")
REGRIP = 1.0  # time after which a robot that grips again has its prescribed angle, assumed [s]


class LostControlError(ValueError):
    """The car spun in a manoeuvre, or the simulation with a driver diverged."""


class Simulator(Protocol):
    """What runs the plants of a manoeuvre: the kernels of this project, or its steering with another vehicle."""

    def suited(self, manoeuvre: Manoeuvre) -> Manoeuvre:
        """The manoeuvre on the chassis of the plants that are run.

        ValueError where the manoeuvre needs an input or a channel that there is not.
        """

    def channels(self, p: plant.Plant) -> Names:
        """Names and units of the channels; those that are not given are NaN."""

    def settled(self, p: plant.Plant) -> tuple[Array, Array]:
        """State (S,) and channels (C,) of straight running."""

    def run(self, p: plant.Plant, state: Array, inputs: Array, record: Array, substeps: int) -> bool:
        """As :func:`steer_env.vehicle.plant.run`."""

    def about(self, car: Car, speed: float) -> dict[str, Any]:
        """What the meta of a recording tells of the vehicle at a speed [m/s]."""


class WholeCar:
    """The simulator of this project's own car, by the kernels of :mod:`steer_env.vehicle.plant`."""

    def __init__(self) -> None:
        self._bound: tuple[Any, Any, Callable] = None, None, plant.run  # a plant, and what runs it
        self._by_kind: dict[str, tuple[Any, Any]] = {}  # what was made last for plants of a kind

    def suited(self, manoeuvre: Manoeuvre) -> Manoeuvre:
        """The manoeuvre as it is."""
        return manoeuvre

    def channels(self, p: plant.Plant) -> Names:
        """As :func:`steer_env.vehicle.plant.channels`."""
        return plant.channels(p)

    def settled(self, p: plant.Plant) -> tuple[Array, Array]:
        """As :func:`steer_env.vehicle.plant.settled`."""
        return plant.settled(p)

    def run(self, p: plant.Plant, state: Array, inputs: Array, record: Array, substeps: int) -> bool:
        """As :func:`steer_env.vehicle.plant.run`; a plant that runs again is not bound anew."""
        if not all(each.flags.c_contiguous and each.dtype == float for each in (state, inputs, record)):
            return plant.run(p, state, inputs, record, substeps)  # a bound kernel looks at no array's type
        of, made, kernel = self._bound
        if of is not p:
            made = plant.bound(p)
            arguments = made, state, inputs, record, substeps
            kernel = self._kept("one", kind(made), lambda: bind(plant.run, *arguments))
            self._bound = p, made, kernel
        return kernel(made, state, inputs, record, substeps)

    def run_beside(self, plants: Sequence[plant.Plant], states: Sequence[Array], inputs: Array, records: Array) -> bool:
        """Run up to four plants side by side, each as :meth:`run` does to the bit, with inputs (N, T, I) and so on.

        False, and nothing is run, where they do not go side by side, or are so few that each by itself takes less time.
        """
        if not BESIDE / 2 < len(plants) <= BESIDE or not all(map(plant.side_by_side, plants)):
            return False
        p, made = plants[0], [plant.bound(each, wide=True) for each in plants]
        of, *others = {(id(each.friction.at), kind(own)) for each, own in zip(made, plants)}
        rows = np.array([numbers(each) for each in plants])
        if others or any(
            np.any(rows[:, low:high] != rows[0, low:high])
            for low, high in self._kept("common", of, lambda: common_columns(p))
        ):
            return False
        template, beside = structure(made[0]), np.array(states)
        arrays = rows, beside, np.ascontiguousarray(inputs), np.ascontiguousarray(records)
        entry = self._kept("fours", of, lambda: bind(plant.record_fours, template, *arrays))
        entry(template, *arrays)
        if arrays[-1] is not records:
            records[:] = arrays[-1]
        for state, end in zip(states, beside):
            state[:] = end
        return True

    def _kept(self, name: str, of: Any, make: Callable[[], T]) -> T:
        """What is made once for plants of a kind: numba looks longer at the types of a plant than their kinds take."""
        known, found = self._by_kind.get(name, (None, None))
        if known != of:
            found = make()
            self._by_kind[name] = of, found
        return found

    def about(self, car: Car, speed: float) -> dict[str, Any]:
        """The geometry at a speed [m/s] and the limits of the motor, which metrics need."""
        return {
            "wheelbase_m": car.chassis["front_axle"] + car.chassis["rear_axle"],
            "steering_ratio": car.steering_ratio(speed),
            "motor": {"limit": car.assist.limit, **motor.keys(car.assist.motor)},
        }


# Which tells a divergence by channels that are not finite; others raise an error of their own
OWN_SIMULATOR = WholeCar()


def build_plant(car: Car, manoeuvre: Manoeuvre, friction: Any, road_friction: float = 1.0) -> plant.Plant:
    """The plant that a manoeuvre needs: with a robot or free hands, on the road or on a rig."""
    p = car.plant(
        friction,
        speed=manoeuvre.speed,
        robot=manoeuvre.robot,
        road_friction=road_friction,
        chassis=manoeuvre.chassis,
        road=manoeuvre.road,
    )
    if not manoeuvre.rig:
        return p
    return p._replace(pinion_radius=0.0, assist=without_assist(p.assist))


def inputs(manoeuvre: Manoeuvre, amplitude: float, duration: float) -> Array:
    """Plant inputs (T, I), one row per millisecond; a row has the value at the end of its sample."""
    t: Array = SAMPLE_TIME * np.arange(1.0, round(duration / SAMPLE_TIME) + 1.0)
    u = np.zeros((t.size, len(plant.INPUTS)))
    u[:, plant.HAND], u[:, plant.HAND_SPEED] = manoeuvre.hand(t, amplitude)
    for index, value in manoeuvre.others.items():
        u[:, index] = value(t)
    return u


class FoundAmplitude(NamedTuple):
    """An amplitude that reaches a lateral acceleration."""

    amplitude: float  # of the handwheel angle [rad]
    growth: float  # of the logarithm of the acceleration with that of the amplitude [1]


# Of a car of which nothing is known but that its response is nearly proportional
FAR_START_AMPLITUDE = FoundAmplitude(0.2, 1.0)


def find_amplitude(p: plant.Plant, manoeuvre: Manoeuvre, simulator: Simulator = OWN_SIMULATOR) -> float:
    """Handwheel amplitude that reaches the manoeuvre's lateral acceleration [rad].

    Raises
    ------
    ValueError
        If the car does not reach that acceleration.
    """
    return search(p, manoeuvre, simulator).amplitude


def _sole(found: Sequence[T | ValueError]) -> T:
    """The one result there is; raises it where it is an error."""
    (result,) = found
    if isinstance(result, ValueError):
        raise result
    return result


def search(
    p: plant.Plant, manoeuvre: Manoeuvre, simulator: Simulator = OWN_SIMULATOR, near: FoundAmplitude | None = None
) -> FoundAmplitude:
    """What :func:`find_amplitude` finds, which raises the same.

    The response is nearly proportional, so each round removes most of the error. A search that begins ``near`` what was
    found for a car that differs little goes by secants over logarithms, whose slope is then known to a tenth: it takes
    an error that one more step brings below :data:`CLOSE`, and that step. A secant leaves less than the product of the
    errors at its ends. Where secants lead nowhere, the search begins anew without them.
    """
    return _sole(_search([(p, manoeuvre)], near, simulator))


def _search(
    cars: Sequence[tuple[plant.Plant, Manoeuvre]], near: FoundAmplitude | None, simulator: Simulator
) -> list[FoundAmplitude | ValueError]:
    """:func:`search` of up to :data:`BESIDE` cars in one test, which go side by side."""
    found: dict[int, FoundAmplitude | ValueError] = {}
    seeking = [_seek(positive("lateral_acceleration", m.lateral_acceleration), near) for _, m in cars]
    tried = {i: next(each) for i, each in enumerate(seeking)}
    while tried:
        going, m = [*tried], cars[0][1]
        u = np.array([inputs(m, amplitude, m.trial or m.duration) for amplitude in tried.values()])
        records = run_beside([cars[i][0] for i in going], m, u, simulator=simulator)
        for i, record in zip(going, records):
            p, m = cars[i]
            try:
                tried[i] = seeking[i].send(m.reach(record[:, plant.CHANNEL["lateral_acceleration"]]))
            except StopIteration as end:
                del tried[i]
                found[i] = end.value or ValueError("; ".join([_unreached(m), *_unstable(p, m, [m.speed])]))
    return [found[i] for i in range(len(cars))]


def _seek(target: float, near: FoundAmplitude | None) -> Generator[float, float, FoundAmplitude | None]:
    """Amplitudes to try, each of which is sent the acceleration that it reaches; None where none reaches the target."""
    (amplitude, growth), tried = near or FAR_START_AMPLITUDE, None
    for _ in range(10):
        reached = yield amplitude
        if not reached / target > 0.0:
            break
        point, left = (math.log(reached), math.log(amplitude), reached / target - 1.0), 0.1
        if tried:
            slope = (point[0] - tried[0]) / (point[1] - tried[1])
            growth = min(max(slope, 0.5), 2.0)
            left = min(left, abs(tried[2])) if growth == slope else left
        if abs(point[2]) < CLOSE:
            return FoundAmplitude(amplitude, growth)
        tried = point
        amplitude *= (target / reached) ** (1.0 / growth if near else 1.0)
        if near and left * abs(point[2]) < CLOSE:
            return FoundAmplitude(amplitude, growth)
        if not amplitude < 6.0:
            break
    return (yield from _seek(target, None)) if near else None


def _unreached(m: Manoeuvre) -> str:
    return f"{m.name}: no handwheel amplitude reaches {m.lateral_acceleration:g} m/s2 at {m.speed:g} m/s"


def _unstable(p: plant.Plant, manoeuvre: Manoeuvre, speeds: Iterable[float]) -> list[str]:
    """One sentence if the assist loop is unstable at one of some speeds, with the hands as in the manoeuvre."""
    hands = {not manoeuvre.robot, bool(manoeuvre.released)}
    reasons = (stability.reason(p.column, p.assist, v, free=free) for v in speeds for free in sorted(hands))
    return [reason for reason in chain(reasons, _unstable_by_wire(p, hands)) if reason][:1]


def _unstable_by_wire(p: plant.Plant, hands: set[bool]) -> Iterator[str]:
    """Why a feel that knows the rack force is unstable, where hands are free."""
    if isinstance(p.assist.wire, Wire) and True in hands:
        from steer_env.vehicle.analysis import assist_loop  # here, because its import takes longer than a drive

        yield assist_loop.wire_reason(p)


def _require_stable(p: plant.Plant, manoeuvre: Manoeuvre, speeds: Iterable[float]) -> None:
    """Refuse an assist loop that is unstable at one of some speeds; metrics of such a run mean nothing."""
    for reason in _unstable(p, manoeuvre, speeds):
        raise ValueError(f"{manoeuvre.name}: {reason}")


def _speeds_to_check(p: plant.Plant, speeds: Array) -> Array:
    """The least and the largest of the speeds that a run has reached, and those of the boost table between them."""
    low, high = np.abs(speeds).min(), np.abs(speeds).max()
    return np.array([low, *p.assist.speeds[(p.assist.speeds > low) & (p.assist.speeds < high)], high])


def _text(value: Any) -> str:
    """A friction parameter in the form of the command line: a number, or numbers joined by colons."""
    return ":".join(map(repr, np.ravel(value).tolist()))


def run(
    p: plant.Plant,
    manoeuvre: Manoeuvre,
    u: Array,
    straight: Array | None = None,
    substeps: int = 1,
    simulator: Simulator = OWN_SIMULATOR,
) -> Array:
    """Channels (T, C) of a plant with inputs (T, I) that starts running straight, at ``substeps`` steps in a sample.

    ``straight`` is the state of straight running; it is computed if it is not given.
    """
    return run_beside([p], manoeuvre, u[None], None if straight is None else [straight], substeps, simulator)[0]


def run_beside(
    plants: Sequence[plant.Plant],
    manoeuvre: Manoeuvre,
    u: Array,
    straight: Sequence[Array] | None = None,
    substeps: int = 1,
    simulator: Simulator = OWN_SIMULATOR,
) -> Array:
    """:func:`run` of up to :data:`BESIDE` plants, to the bit: channels (N, T, C) with inputs (N, T, I).

    Plants of one kind go side by side, in a third of the time.
    """
    states = [simulator.settled(p)[0] for p in plants] if straight is None else [each.copy() for each in straight]
    records = np.zeros((*u.shape[:2], len(simulator.channels(plants[0]))))
    changes = [min(round(t / SAMPLE_TIME), u.shape[1]) for t in manoeuvre.released]
    for k, (start, end) in enumerate(pairwise([0, *changes, u.shape[1]])):
        if start == end:
            continue
        rows, part, free = u[:, start:end], records[:, start:end], k % 2 == 1
        if k and not free:
            hands = ((x[column.HANDWHEEL_ANGLE], x[column.HANDWHEEL_SPEED]) for x in states)
            rows = np.array([_regrip(row, *hand) for row, hand in zip(rows, hands)])
        driven = [p._replace(robot=0.0) if free else p for p in plants]
        if not (simulator is OWN_SIMULATOR and substeps == 1 and OWN_SIMULATOR.run_beside(driven, states, rows, part)):
            for each in zip(driven, states, rows, part):
                simulator.run(*each, substeps)
    return records


def run_closed(
    car: Car, p: plant.Plant, manoeuvre: Manoeuvre, substeps: int = 1, simulator: Simulator = OWN_SIMULATOR
) -> Array:
    """Channels (T, C) of a plant that starts running straight, steered by the manoeuvre's driver.

    Between two calls of the driver the handwheel angle is a cubic with the given angle and speed at both ends; a hand
    torque is interpolated linearly. ValueError for a manoeuvre without a driver.
    """
    if manoeuvre.driver is None:
        raise ValueError(f"{manoeuvre.name} has no driver: run it with its inputs")
    driver, u = manoeuvre.driver(car, p), inputs(manoeuvre, 0.0, manoeuvre.duration)
    state, row = simulator.settled(p)
    record, x = np.zeros((len(u), row.size)), plant.CHANNEL["x"]
    s = np.arange(1.0, HOLD + 1.0) / HOLD
    hermite = np.array([(1 + 2 * s) * (1 - s) ** 2, s * (1 - s) ** 2, s * s * (3 - 2 * s), s * s * (s - 1)]).T
    slopes = np.array([6 * s * (s - 1), (1 - s) * (1 - 3 * s), 6 * s * (1 - s), s * (3 * s - 2)]).T
    span, hand, done = HOLD * SAMPLE_TIME, (0.0, 0.0), 0
    for done in range(HOLD, len(u) + 1, HOLD):
        last, hand = hand, driver((done - HOLD) * SAMPLE_TIME, row)
        part = slice(done - HOLD, done)
        if manoeuvre.robot:
            ends = np.array([last[0], span * last[1], hand[0], span * hand[1]])
            u[part, plant.HAND], u[part, plant.HAND_SPEED] = hermite @ ends, slopes @ ends / span
        else:
            u[part, plant.HAND] = last[0] + s * (hand[0] - last[0])
        if manoeuvre.coasts_from is not None and row[x] >= manoeuvre.coasts_from:
            u[part, chassis.COAST] = 1.0
        finite = simulator.run(p, state, u[part], record[part], substeps)
        row = record[done - 1]
        if not finite:
            row[:] = np.nan  # a state that is not finite may appear in no channel
        if not finite or (manoeuvre.ends_at is not None and row[x] >= manoeuvre.ends_at):
            break
    return record[:done]


def steering_stiffness(p: plant.Plant, run: Callable = plant.run) -> float:
    """Slope of hand torque over handwheel angle in steady turns, without friction [N m/rad].

    The plant is that of a robot; ``run`` has the arguments of :func:`steer_env.vehicle.plant.run`.
    """
    state, row = plant.settled(p, run)
    record, held = row[None].copy(), []
    for start in (0.0, 0.1):  # both angles are reached in the same direction, so friction drops out
        t = SAMPLE_TIME * np.arange(1.0, 2001.0)
        u = np.zeros((t.size, len(plant.INPUTS)))
        u[:, plant.HAND], u[:, plant.HAND_SPEED] = ramp_and_hold(t, 0.1, 1.0)
        u[:, plant.HAND] += start
        run(p, state, u, record, 1)
        held.append(record[0, plant.CHANNEL["handwheel_torque"]])
    return float(held[1] - held[0]) / 0.1


def sine_hands(t: Array, amplitude: float, frequency: float) -> tuple[Array, Array]:
    """Angle and speed of a handwheel that swings in a sine, whose amplitude rises linearly over the first period."""
    omega = 2.0 * np.pi * frequency
    rise, slope = np.minimum(t * frequency, 1.0), np.where(t * frequency < 1.0, frequency, 0.0)
    speed = amplitude * (rise * omega * np.cos(omega * t) + slope * np.sin(omega * t))
    return amplitude * rise * np.sin(omega * t), speed


def sine_response(
    p: plant.Plant, amplitude: float, frequency: float, run: Callable = plant.run
) -> NDArray[np.complex128]:
    """Hand torque, lateral speed and yaw rate over a sine of the handwheel angle, in its third period.

    Parameters
    ----------
    p : Plant
        That of a robot.
    amplitude, frequency : float
        [rad], [Hz]; the amplitude rises over the first period.
    run : callable
        With the arguments of :func:`steer_env.vehicle.plant.run`.

    Returns
    -------
    (3,) array of complex
        Of the fundamental [N m/rad, m/s/rad, 1/s]; the imaginary part is in phase with the handwheel's speed.
    """
    state, row = plant.settled(p, run)
    period, omega = round(1.0 / (frequency * SAMPLE_TIME * HOLD)), 2.0 * np.pi * frequency
    t = SAMPLE_TIME * np.arange(1.0, 3 * period * HOLD + 1.0)
    u = np.zeros((t.size, len(plant.INPUTS)))
    u[:, plant.HAND], u[:, plant.HAND_SPEED] = sine_hands(t, amplitude, frequency)
    wanted, record, found = [plant.CHANNEL[name] for name in _RESPONSE], row[None].copy(), []
    for held in u.reshape(-1, HOLD, u.shape[1]):
        run(p, state, held, record, 1)
        found.append(record[0, wanted])
    phase = omega * t[HOLD - 1 :: HOLD][-period:]
    basis = np.column_stack([np.sin(phase), np.cos(phase)])
    of_angle, of_speed = np.linalg.lstsq(basis, np.array(found[-period:]), rcond=None)[0]
    response: NDArray[np.complex128] = (of_angle + 1j * of_speed) / amplitude
    return response


def _regrip(u: Array, angle: float, speed: float) -> Array:
    """Inputs that lead the handwheel smoothly from its angle and speed to those that the robot prescribes."""
    u = u.copy()
    s = np.clip(np.arange(1.0, len(u) + 1.0) * SAMPLE_TIME / REGRIP, 0.0, 1.0)
    off, off_speed = angle - u[0, plant.HAND], REGRIP * (speed - u[0, plant.HAND_SPEED])
    u[:, plant.HAND] += off * (1.0 - s * s * (3.0 - 2.0 * s)) + off_speed * s * (1.0 - s) ** 2
    u[:, plant.HAND_SPEED] += (off_speed * (1.0 - s) * (1.0 - 3.0 * s) - 6.0 * off * s * (1.0 - s)) / REGRIP
    return u


def drive(
    car: Car,
    manoeuvre: Manoeuvre,
    friction: Any = None,
    simulator: Simulator = OWN_SIMULATOR,
    near: FoundAmplitude | None = None,
) -> Recording:
    """Drive a manoeuvre and record every channel at 1 kHz.

    Parameters
    ----------
    car : Car
    manoeuvre : Manoeuvre
    friction : str or parameters
        Name of a law, for its default parameters, or parameters from ``friction.make``.
    simulator : Simulator
        What runs the plant: the kernels of this project, or its steering with an external vehicle, as
        ``steer_env.connect.external.opened`` makes it.
    near : Found, optional
        Where the search for an amplitude begins (:func:`search`).

    Returns
    -------
    Recording
        Channels in SI units; ``meta`` names the manoeuvre, the car, the law with its parameters, speed and amplitude,
        and as ``beyond_tyre`` wheel loads and slips outside the range of the tyre (:class:`vehicle.tyre.Beyond`).

    Raises
    ------
    ValueError
        If the law is unknown, no amplitude reaches the lateral acceleration, the car spins, the assist loop is
        unstable at the speed (the message names the cause), a state does not stay finite (it names the state), or the
        simulator lacks an input or a channel that the manoeuvre needs.
    """
    manoeuvre = simulator.suited(manoeuvre)
    return drive_plant(car, build_plant(car, manoeuvre, friction), manoeuvre, simulator=simulator, near=near)


class OpenLoop(NamedTuple):
    """The inputs of a plant in an open-loop manoeuvre; plants that differ only in their assist can share them."""

    amplitude: float  # of the handwheel angle [rad] or of the hand torque [N m]
    inputs: Array  # (T, I) inputs of the plant, one row per sample
    straight: Array  # (S,) state of straight running
    record: Array | None = None  # (T, C) channels, where it has been run


def open_loop(
    p: plant.Plant, manoeuvre: Manoeuvre, simulator: Simulator = OWN_SIMULATOR, near: FoundAmplitude | None = None
) -> OpenLoop:
    """The inputs of a manoeuvre; ValueError where no amplitude reaches its lateral acceleration."""
    return _sole(open_loops([(p, manoeuvre)], simulator, near))


def open_loops(
    cars: Sequence[tuple[plant.Plant, Manoeuvre]],
    simulator: Simulator = OWN_SIMULATOR,
    near: FoundAmplitude | None = None,
) -> list[OpenLoop | ValueError]:
    """:func:`open_loop` of up to :data:`BESIDE` cars in one test, or why there is none."""
    m = cars[0][1]
    if m.amplitude is not None:
        amplitudes: list[float | ValueError] = [m.amplitude] * len(cars)
    elif m.lock:
        amplitudes = [handwheel_lock(p.rack_limit, p.pinion_radius, p.assist.wire, m.speed) for p, _ in cars]
    else:
        found = _search(cars, near, simulator)
        amplitudes = [each if isinstance(each, ValueError) else each.amplitude for each in found]
    return [
        x if isinstance(x, ValueError) else OpenLoop(x, inputs(m, x, m.duration), simulator.settled(p)[0])
        for x, (p, _) in zip(amplitudes, cars)
    ]


def drive_plant(
    car: Car,
    p: plant.Plant,
    manoeuvre: Manoeuvre,
    prepared: OpenLoop | None = None,
    substeps: int = 1,
    simulator: Simulator = OWN_SIMULATOR,
    near: FoundAmplitude | None = None,
) -> Recording:
    """:func:`drive` with a plant from :func:`build_plant`, whose parameters may have been changed.

    In an open loop the inputs are computed for this plant, unless they were prepared, perhaps with another assist.
    More ``substeps`` than one in each sample of 1 ms serve studies of convergence. With another ``simulator`` than the
    whole car, plant and manoeuvre are those of its ``suited``.
    """
    _require_stable(p, manoeuvre, [manoeuvre.speed])
    if manoeuvre.driver is None:
        prepared = prepared or open_loop(p, manoeuvre, simulator, near)
    record, steered, advice = _simulate(car, p, manoeuvre, prepared, substeps, simulator)
    names = simulator.channels(p)
    channels = {names[i][0]: values for i, values in _by_channel(record).items()}
    time = SAMPLE_TIME * np.arange(1, len(record) + 1)
    del record  # as large as all channels together
    held = channels.get("vehicle_speed", np.full(time.size, manoeuvre.speed))
    channels["vehicle_speed"] = channels.get("longitudinal_speed", held)
    if "longitudinal_speed" in channels:
        _require_stable(p, manoeuvre, _speeds_to_check(p, channels["longitudinal_speed"]))
    lateral = channels.get("lateral_speed", np.zeros(1))
    if manoeuvre.speed and np.any(np.abs(lateral) > channels["vehicle_speed"]):
        raise LostControlError(f"{manoeuvre.name}: the car spins; {advice}")
    return Recording(
        time=time,
        channels=channels,
        units={**{name: unit for name, unit in names if name in channels}, "vehicle_speed": "m/s"},
        meta={
            "manoeuvre": manoeuvre.name,
            "vehicle": car.name,
            "chassis": manoeuvre.chassis,
            "tyre": car.tyre.name,
            "friction": friction_name(p.friction),
            "friction_parameters": ",".join(
                f"{'.'.join(each.path)}={_text(each.value)}" for each in leaves(p.friction)
            ),
            "speed_m_s": manoeuvre.speed,
            **steered,
            "frequency_hz": manoeuvre.frequency,
            **simulator.about(car, manoeuvre.speed),
            **(_beyond_tyre(car, channels) if simulator is OWN_SIMULATOR else {}),
            **manoeuvre.meta,
        },
    )


def _beyond_tyre(car: Car, channels: dict[str, Array]) -> dict[str, list[dict[str, Any]]]:
    """What the meta says of loads and slips outside the range of the tyre; nothing where all are inside."""
    rolls = channels["vehicle_speed"] >= car.tyre.limits.v_x_low  # slip has no meaning at standstill
    found = []
    for quantity, channel in (("F_z", "wheel_load"), ("kappa", "kappa"), ("alpha", "tan_alpha")):
        wheels = [channels[name] for wheel in chassis.WHEELS if (name := f"{channel}_{wheel}") in channels]
        values = np.array(wheels if quantity == "F_z" else [each[rolls] for each in wheels])
        if values.size:
            found.append(car.tyre.beyond(quantity, np.arctan(values) if quantity == "alpha" else values))
    beyond = [each._asdict() for each in found if each]
    return {BEYOND_TYRE: beyond} if beyond else {}


def _by_channel(record: Array) -> dict[int, Array]:
    """Channels (T,) of a record (T, C) by their positions, read-only, so that a recording does not copy them again."""
    found = {i: np.empty(len(record)) for i in _recorded_channels(record)}
    for start in range(0, len(record), BLOCK_ROWS):  # which stays in the cache of the processor until all have read it
        rows = record[start : start + BLOCK_ROWS]
        for i, values in found.items():
            values[start : start + BLOCK_ROWS] = rows[:, i]
    for values in found.values():
        values.flags.writeable = False
    return found


def _recorded_channels(record: Array) -> list[int]:
    """Positions of the channels that a record (T, C) holds: those that a simulator does not give are NaN."""
    first = np.isnan(record[0])  # most channels are given, and are not looked at any further
    return [i for i in range(record.shape[1]) if not (first[i] and np.isnan(record[:, i]).all())]


def _simulate(
    car: Car, p: plant.Plant, manoeuvre: Manoeuvre, course: OpenLoop | None, substeps: int, simulator: Simulator
) -> tuple[Array, dict[str, float], str]:
    """Channels (T, C) of a manoeuvre, what the meta says of its hands, and advice for a car that spins."""
    if course is None:
        record, advice = run_closed(car, p, manoeuvre, substeps, simulator), "ask for less speed"
        if simulator is OWN_SIMULATOR and not np.isfinite(record[-1]).all():
            raise LostControlError(f"{manoeuvre.name} diverged: {advice}")
        return record, {f"vehicle_{key}_m": value for key, value in footprint(car)._asdict().items()}, advice
    amplitude, u, straight, driven = course
    record = run(p, manoeuvre, u, straight, substeps, simulator) if driven is None else driven
    if simulator is OWN_SIMULATOR and not np.isfinite(record[-1]).all():
        raise ValueError(f"{manoeuvre.name} diverged: {plant.first_non_finite(p, straight, u)} first")
    steered = {"amplitude_rad" if manoeuvre.robot else "amplitude_nm": amplitude}
    return record, steered, f"ask for less than {amplitude:g}, or for less speed"
