"""Runs of the car split at the rack, against the undivided car: what the study of the coupling rests on."""

import math
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from itertools import product
from multiprocessing import get_context
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env import friction, manoeuvres, metrics
from steer_env.connect import fmu
from steer_env.connect.external import Coupled, Coupling, CouplingError, FmuVehicle, UdpVehicle, Vehicle
from steer_env.connect.udp import Server, layout_of
from steer_env.experiments.studies.common.computing_time import Block, Clocks, Measured, in_turns
from steer_env.manoeuvres.common.driving import drive_plant
from steer_env.recording.recording import Recording
from steer_env.vehicle import plant, subsystems
from steer_env.vehicle.cars import Car
from steer_env.vehicle.layout import layout_of as plant_layout
from steer_env.vehicle.steering.eps import SAMPLE_TIME

Array = NDArray[np.float64]

SPEED = 100.0 / 3.6  # of the weave, and of the other runs [m/s]
CHASSIS = "single_track"
FREQUENCY, AMPLITUDE = 15.0, 0.05  # of the handwheel in the frequency response, amplitude assumed [Hz], [rad]
PULSE, LENGTH = 8.0, 0.1  # hand torque and its duration before the hands let go, assumed [N m], [s]
DURATION = 6.0  # of the run after the pulse [s]
STEPS = (1, 2, 5, 10, 20, 50, 100, 200)  # communication steps whose stability is tried [ms]
EXCHANGES = 20  # of a block that is timed, about a millisecond
DECAYED = 0.05  # share of the motion in the first second that may be left in the last one, assumed [1]


# How steering and vehicle take turns, without the communication step. `studies.coupling` defines the words.
KINDS = {
    "vehicle after the steering": Coupling(),
    "both at once": Coupling(delay=True),
    "both at once, force held": Coupling(delay=True, extrapolated=False),
}
COMPARED = (1, 5)  # communication steps [ms]


class Cost(NamedTuple):
    """What a coupling changes for one law."""

    metrics: dict[str, float]  # metric of the weave -> its change, as a share of the undivided car's [1]
    energy: float  # residual at the interface, as a share of the energy that passes it in the weave [1]
    phase: float  # of the rack force that acts on the steering, over the rack travel at FREQUENCY [rad]
    swing: float  # change of the column's motion in the second after a pulse of the free hands, as a share [1]


class LawCost(NamedTuple):
    """One law."""

    costs: dict[str, dict[int, Cost]]  # by kind and communication step [ms]
    longest: dict[str, int | None]  # by kind: longest communication step at which the motion dies out [ms]


class Transport(NamedTuple):
    """The weave with the vehicle reached in one way."""

    name: str
    equal: bool  # every channel to the bit with that of the unit in this process


def exported(car: Car) -> bytes:
    """The chassis of a car as a unit."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "chassis.fmu")
        return fmu.export(path, subsystem="chassis", vehicle=car, chassis=CHASSIS, speed=SPEED).read_bytes()


def of_law(car: Car, law: str, unit: bytes, steps: Sequence[int] = COMPARED) -> LawCost:
    """What each coupling changes for a law; ``unit`` is the chassis of the car."""
    weave = manoeuvres.make("weave")
    p = manoeuvres.build_plant(car, weave, law)
    weave = replace(weave, amplitude=manoeuvres.find_amplitude(p, weave))
    whole = metrics.evaluate(drive_plant(car, p, weave))
    phase, swing = _undivided_response(p), _swings(_pulse(plant, car.plant(law, SPEED)))[0]
    costs: dict[str, dict[int, Cost]] = {kind: {} for kind in KINDS}
    with _vehicle(unit) as vehicle:
        for kind, step in product(KINDS, steps):
            coupled = Coupled(vehicle, SPEED, KINDS[kind]._replace(step=step))
            found = metrics.evaluate(_weave(car, law, weave, coupled))
            energy = float((coupled.work[0] - coupled.work[1]) / coupled.work[2])
            costs[kind][step] = Cost(
                metrics={name: v.value / whole[name].value - 1.0 for name, v in found.items() if not v.reason},
                energy=energy,
                phase=_difference(_response(car, law, coupled), phase),
                swing=_swings(_pulse(coupled, _free(car, law)))[0] / swing - 1.0,
            )
        longest = {kind: _longest(car, law, vehicle, coupling) for kind, coupling in KINDS.items()}
    return LawCost(costs, longest)


def transports(car: Car, law: str, unit: bytes) -> tuple[list[Transport], Measured[str]]:
    """The weave with the vehicle in this process, as a unit in its own process, and served over UDP from another.

    The times are of a communication step with that of the steering, on the wall, over those in this process.
    """
    weave = manoeuvres.make("weave", amplitude=0.25)
    ways = {
        "FMU": _vehicle(unit),
        "FMU in its own process": _vehicle(unit, own_process=True),
        "UDP, from another process": _served(car, law),
    }
    with ExitStack() as stack:
        vehicles = {name: stack.enter_context(opened) for name, opened in ways.items()}
        driven = {name: _weave(car, law, weave, Coupled(of, SPEED, Coupling())) for name, of in vehicles.items()}
        blocks = {name: _exchanges(car, law, Coupled(of, SPEED, Coupling())) for name, of in vehicles.items()}
        times = in_turns(blocks, lambda _: "FMU", clocks=Clocks(block=Clocks().wall))
    first = driven["FMU"].channels
    return [
        Transport(name, all(np.array_equal(found[c], values) for c, values in first.items()))
        for name, found in driven.items()
    ], times


def _exchanges(car: Car, law: str, coupled: Coupled) -> Block:
    """Steps with the handwheel held."""
    p = car.plant(law, SPEED, robot=True, chassis="two_track")
    state, row = coupled.settled(p)
    u, record = np.zeros((EXCHANGES, len(plant.INPUTS))), np.zeros((EXCHANGES, row.size))
    return Block(lambda: coupled.run(p, state, u, record, 1), EXCHANGES)


@contextmanager
def _vehicle(unit: bytes, own_process: bool = False) -> Iterator[Vehicle]:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "chassis.fmu")
        path.write_bytes(unit)
        vehicle = FmuVehicle(path, own_process)
        try:
            yield vehicle
        finally:
            vehicle.close()


@contextmanager
def _served(car: Car, law: str) -> Iterator[Vehicle]:
    """The chassis behind a port of another process."""
    part = subsystems.make("chassis", car.plant(law, SPEED, chassis=CHASSIS), SPEED)
    context = get_context("spawn")
    connection, other = context.Pipe()
    process = context.Process(target=_serve, args=(other, car.data(), friction.make(law)), daemon=True)
    process.start()
    other.close()
    try:
        vehicle = UdpVehicle(layout_of(part), connection.recv(), SPEED)
        yield vehicle
        vehicle.close()
    finally:
        connection.close()
        process.join()


def _serve(connection: Connection, data: dict[str, Any], law: Any) -> None:
    """Serve a chassis until the connection is closed at its other end; parameters bring the module of their law."""
    from steer_env.vehicle import cars

    p = cars.load(data).plant(law, SPEED, chassis=CHASSIS)
    with Server(subsystems.make("chassis", p, SPEED)) as server, ExitStack() as stack:
        stack.callback(connection.close)
        connection.send(server.address)
        connection.poll(None)


def _free(car: Car, law: str) -> plant.Plant:
    """The plant of a coupled steering with free hands."""
    return car.plant(law, SPEED, chassis="two_track")


def _weave(car: Car, law: str, weave: manoeuvres.Manoeuvre, coupled: Coupled) -> Recording:
    weave = coupled.suited(weave)
    return drive_plant(car, manoeuvres.build_plant(car, weave, law), weave, simulator=coupled)


def _sine() -> Array:
    """Inputs (T, I) of two seconds of the sine of the handwheel."""
    t = SAMPLE_TIME * np.arange(1.0, 2001.0)
    omega = 2.0 * math.pi * FREQUENCY
    u = np.zeros((t.size, len(plant.INPUTS)))
    u[:, plant.HAND], u[:, plant.HAND_SPEED] = AMPLITUDE * np.sin(omega * t), AMPLITUDE * omega * np.cos(omega * t)
    return u


def _fundamental(force: Sequence[float], rack: Sequence[float]) -> complex:
    """Ratio of two histories at FREQUENCY, over the last second: a force that means a step, and a travel at its end."""
    ends = 2.0 * math.pi * FREQUENCY * SAMPLE_TIME * np.arange(1.0, len(force) + 1.0)
    middles = ends - math.pi * FREQUENCY * SAMPLE_TIME
    found = []
    for phase, values in ((middles, force), (ends, rack)):
        basis = np.column_stack([np.cos(phase), np.sin(phase), np.ones(len(phase))])[-1000:]
        a, b, _ = np.linalg.lstsq(basis, np.array(values)[-1000:], rcond=None)[0]
        found.append(complex(a, -b))
    return found[0] / found[1]


def _undivided_response(p: plant.Plant) -> complex:
    """Rack force that acts on the steering over the rack travel, at FREQUENCY."""
    state, row, at = plant.initial_state(p), np.zeros((1, len(plant.channels(p)))), plant_layout(p)
    force, rack = [], []
    for u in _sine():
        s = (state[at.steps] + 0.5) / plant.STEPS_PER_CHASSIS_STEP
        force.append(state[at.rack_force] + s * (state[at.rack_force] - state[at.rack_force + 1]))  # (N1)
        plant.run(p, state, u[None], row, 1)
        rack.append(p.pinion_radius * row[0, plant.CHANNEL["column_angle"]])
    return _fundamental(force, rack)


def _response(car: Car, law: str, coupled: Coupled) -> complex:
    p = car.plant(law, SPEED, robot=True, chassis="two_track")
    state, row = coupled.settled(p)
    record, force, rack = row[None].copy(), [], []
    for u in _sine():
        coupled.run(p, state, u[None], record, 1)
        force.append(coupled.force)
        rack.append(p.pinion_radius * record[0, plant.CHANNEL["column_angle"]])
    return _fundamental(force, rack)


def _difference(one: complex, other: complex) -> float:
    """Phase of one less that of the other [rad]."""
    return math.remainder(math.atan2(one.imag, one.real) - math.atan2(other.imag, other.real), 2.0 * math.pi)


def _pulse(simulator: Any, p: plant.Plant) -> Array:
    """Column speed (T,) after a pulse of the hand torque, the hands free [rad/s]."""
    t = SAMPLE_TIME * np.arange(1.0, DURATION / SAMPLE_TIME + 1.0)
    u = np.zeros((t.size, len(plant.INPUTS)))
    u[:, plant.HAND] = np.where(t <= LENGTH, PULSE, 0.0)
    state, row = simulator.settled(p)
    record = np.zeros((t.size, row.size))
    simulator.run(p, state, u, record, 1)
    return np.asarray(record[:, plant.CHANNEL["column_speed"]])


def _swings(speed: Array) -> tuple[float, float]:
    """RMS of a column speed in the first second after the pulse, and in the last one [rad/s]."""
    first, second = round(LENGTH / SAMPLE_TIME), round(1.0 / SAMPLE_TIME)
    return float(np.sqrt(np.mean(speed[first : first + second] ** 2))), float(np.sqrt(np.mean(speed[-second:] ** 2)))


def _longest(car: Car, law: str, vehicle: Vehicle, coupling: Coupling) -> int | None:
    """The longest communication step [ms] up to which the motion after a pulse dies out; None if at none."""
    longest = None
    for step in STEPS:
        try:
            first, last = _swings(_pulse(Coupled(vehicle, SPEED, coupling._replace(step=step)), _free(car, law)))
        except CouplingError:
            break
        if not last <= DECAYED * first:
            break
        longest = step
    return longest
