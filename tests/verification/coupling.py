"""The car split at the rack: steering and vehicle as two simulations that exchange values."""

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from steer_env import manoeuvres, metrics
from steer_env.connect.external import Coupled, Coupling, UdpVehicle
from steer_env.connect.udp import Server
from steer_env.manoeuvres.common.driving import drive_plant
from steer_env.vehicle import cars, plant, subsystems
from steer_env.vehicle.cars import Car
from steer_env.vehicle.layout import plant_layout
from steer_env.vehicle.steering.eps import SAMPLE_TIME
from tests.verification.common.rows import Row, at_most, verdict

Array = NDArray[np.float64]

LAWS = ("lugre", "masing", "coulomb")
SPEED, CYCLES = 100.0 / 3.6, 6  # [m/s], of the weave
MOST = 2e-6  # change of a metric of the weave, as a share of the undivided car's [1]
LONGEST, LEFT = 200, 0.05  # step at which the motion still dies out [ms]; share of it that may be left, assumed [1]
PULSE = 8.0  # hand torque before the hands let go [N m]
LENGTH, DURATION = 100, 6000  # of the pulse and of the run [ms]
FREQUENCY, AMPLITUDE = 15.0, 0.05  # of the handwheel where a delay is read, amplitude assumed [Hz], [rad]
TURN = 360.0 * FREQUENCY * SAMPLE_TIME  # of a delay of a step [deg]
# Delay of the rack force by coupling [steps]; a force that is held is half a step late.
LATE = {Coupling(): 0.0, Coupling(delay=True): 1.0, Coupling(delay=True, extrapolated=False): 1.5}


def rows() -> Iterator[Row]:
    """Car split at the rack, its chassis over UDP, against the undivided car: one track, 100 km/h, steps of 1 ms."""
    car = cars.load()
    for law in LAWS:
        with _served(car, law) as vehicle:
            weave = manoeuvres.make("weave", cycles=CYCLES)
            p = manoeuvres.build_plant(car, weave, law)
            weave = replace(weave, amplitude=manoeuvres.find_amplitude(p, weave))
            whole = metrics.evaluate(drive_plant(car, p, weave))
            for delay in (False, True) if law == LAWS[0] else (False,):
                change, energy = _weave(car, law, weave, Coupled(vehicle, SPEED, Coupling(delay=delay)), whole)
                if delay:  # creates energy, as the vehicle answers a motion that is past
                    yield Row(
                        f"{law}, a step of delay: largest change of a metric", f"{change:.1e}", "no limit", "pass"
                    )
                    told = f"{100.0 * energy:.2f} %"
                    yield Row(
                        f"{law}, a step of delay: energy lost", told, "< 0, of what passes", verdict(energy < 0.0)
                    )
                else:
                    yield at_most(f"{law}: change of any metric of the weave", change, MOST, "of the undivided car's")
                    yield at_most(f"{law}: energy lost at the rack", abs(energy), MOST, "of what passes")
            free = car.plant(law, SPEED, chassis="two_track")
            left = _left(free, Coupled(vehicle, SPEED, Coupling(step=LONGEST)))
            yield at_most(
                f"{law}: motion left after a pulse, steps of {LONGEST} ms", left, LEFT, "of the first second's"
            )
    with _served(car, LAWS[0]) as vehicle:
        whole_car = _undivided(car.plant(LAWS[0], SPEED, robot=True))
        p = car.plant(LAWS[0], SPEED, robot=True, chassis="two_track")
        for coupling, late in LATE.items():
            turned = math.degrees(np.angle(_divided(p, Coupled(vehicle, SPEED, coupling)) / whole_car))
            passed = abs(turned + late * TURN) < 0.02 * TURN * max(late, 1.0)
            what, due = f"{LAWS[0]}, rack force at {FREQUENCY:g} Hz, {late:g} ms late", 0.0 - late * TURN
            yield Row(what, f"{turned:.2f} deg", f"{due:.1f} deg, to 2 %", verdict(passed))


@contextmanager
def _served(car: Car, law: str) -> Iterator[UdpVehicle]:
    part = subsystems.make("chassis", car.plant(law, SPEED), SPEED)
    with Server(part) as server:
        vehicle = UdpVehicle(server.layout, server.address, SPEED)
        yield vehicle
        vehicle.close()


def _weave(
    car: Car, law: str, weave: manoeuvres.Manoeuvre, coupled: Coupled, whole: dict[str, metrics.Value]
) -> tuple[float, float]:
    """Largest change of a metric, and energy that the rack loses over what passes it, of the divided car [1]."""
    divided = coupled.suited(weave)
    found = metrics.evaluate(drive_plant(car, manoeuvres.build_plant(car, divided, law), divided, simulator=coupled))
    change = max(abs(v.value / whole[name].value - 1.0) for name, v in found.items() if not v.reason)
    return change, float((coupled.work[0] - coupled.work[1]) / coupled.work[2])


def _left(p: plant.Plant, coupled: Coupled) -> float:
    """RMS column speed of the last second of a run with free hands after a pulse over that of the first [1]."""
    u = np.zeros((DURATION, len(plant.INPUTS)))
    u[:LENGTH, plant.HAND] = PULSE
    state, row = coupled.settled(p)
    record = np.zeros((DURATION, row.size))
    coupled.run(p, state, u, record, 1)
    speed = record[:, plant.CHANNEL["column_speed"]]
    return float(np.linalg.norm(speed[-1000:]) / np.linalg.norm(speed[LENGTH : LENGTH + 1000]))


def _undivided(p: plant.Plant) -> complex:
    """Rack force that acts on the steering over the rack travel of the undivided car, at ``FREQUENCY``."""
    state, row, at = plant.initial_state(p), np.zeros((1, len(plant.channels(p)))), plant_layout(p)
    force, rack = [], []
    for u in _sine():
        s = (state[at.steps] + 0.5) / plant.STEPS_PER_CHASSIS_STEP
        force.append(state[at.rack_force] + s * (state[at.rack_force] - state[at.rack_force + 1]))  # (N1)
        plant.run(p, state, u[None], row, 1)
        rack.append(row[0, plant.CHANNEL["column_angle"]])
    return _ratio(force, rack)


def _divided(p: plant.Plant, coupled: Coupled) -> complex:
    """The same of a steering with its vehicle."""
    state, row = coupled.settled(p)
    record, force, rack = row[None].copy(), [], []
    for u in _sine():
        coupled.run(p, state, u[None], record, 1)
        force.append(coupled.force)
        rack.append(record[0, plant.CHANNEL["column_angle"]])
    return _ratio(force, rack)


def _sine() -> Array:
    """Inputs (T, I) of two seconds of the handwheel's sine."""
    omega, t = 2.0 * math.pi * FREQUENCY, SAMPLE_TIME * np.arange(1.0, 2001.0)
    u = np.zeros((t.size, len(plant.INPUTS)))
    u[:, plant.HAND], u[:, plant.HAND_SPEED] = AMPLITUDE * np.sin(omega * t), AMPLITUDE * omega * np.cos(omega * t)
    return u


def _ratio(force: Sequence[float], rack: Sequence[float]) -> complex:
    """Force over travel at ``FREQUENCY`` in the last second, which holds whole periods."""
    turning = np.exp(-2j * math.pi * FREQUENCY * SAMPLE_TIME * np.arange(1000))
    return complex(np.array(force[-1000:]) @ turning / (np.array(rack[-1000:]) @ turning))
