"""Error of the observer of the rack force by wire, for each friction law at the rack.

A car drives the weave. The observer sees the motor and the rack; what it tells is compared with the force of the plant,
without knowledge of friction, with that of one law whatever the car's is, and with the law that the car has.
"""

import argparse
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from steer_env import friction, manoeuvres
from steer_env.experiments.pages.options import progress
from steer_env.friction import defaults, sites
from steer_env.friction.law import scaled
from steer_env.manoeuvres.common import driving
from steer_env.vehicle import cars, plant
from steer_env.vehicle.layout import plant_layout
from steer_env.vehicle.steering import by_wire, rack_observer

CAR, SETTLED = "compact_steer_by_wire", 5.0  # the first cycle of the weave is left out [s]
NONE, ONE_LAW = "viscous,sigma_2=0.0", "lugre"  # laws that the observer knows of, beside the car's own
SHARE = defaults.SHARES["steer_by_wire"]["rack"]  # of the friction that stands at the rack [1]


class Errors(NamedTuple):
    """Errors over the rack force, both as root mean squares [1]."""

    law: str
    uncompensated: float
    one_law: float  # compensated by LuGre
    own_law: float  # compensated by the law of the car


def error(car: cars.Car, law: Any) -> tuple[float, float]:
    """RMS error of the observed rack force of a car by wire in the weave, and RMS of the force [N].

    Raises
    ------
    ValueError
        A car without a wire, or one that does not reach the lateral acceleration of the weave.
    """
    if not isinstance(car.assist.wire, by_wire.Wire):
        raise ValueError(f"{car.name} has no observer of the rack force: give a car with steer_by_wire")
    weave = manoeuvres.make("weave")
    p = driving.build_plant(car, weave, law)
    u = driving.inputs(weave, driving.find_amplitude(p, weave), weave.duration)
    bound, state, row = plant.bound(p), plant.initial_state(p), np.zeros((1, len(plant.channels(p))))
    place, told = plant_layout(p).wire + by_wire.OBSERVED + rack_observer.FORCE, np.zeros((2, len(u)))
    for i in range(len(u)):
        plant.run.kernel(bound, state, u[i : i + 1], row, 1)  # type: ignore[attr-defined]  # of binds
        told[:, i] = state[place], row[0, plant.CHANNEL["rack_force"]]
    observed, force = told[:, round(SETTLED / plant.SAMPLE_TIME) :]
    return float(np.sqrt(np.mean((observed - force) ** 2))), float(np.sqrt(np.mean(force**2)))


def errors(car: cars.Car, name: str) -> Errors:
    """Errors with a law at the rack alone, which has its share of the law's default."""
    found = []
    for known in (NONE, ONE_LAW, name):
        own = scaled(friction.resolve(known), SHARE)
        told = sites.as_text(own) if known != NONE else NONE
        load = car.steering["friction_load"] * SHARE if known != NONE else 0.0
        keys = {"observer_law": told, "observer_gear_loss": 0.0, "observer_load": load}
        observing = cars.load(car, {f"{by_wire.SECTION}.{key}": value for key, value in keys.items()})
        off, force = error(observing, {"rack": scaled(friction.resolve(name), SHARE)})
        found.append(off / force)
    return Errors(name, *found)


def collect(car: cars.Car, laws: Sequence[str], notify: Callable[[float, str], None] = lambda *_: None) -> list[Errors]:
    """:func:`errors` of every law."""
    found = []
    for i, name in enumerate(laws):
        notify(i / len(laws), name)
        found.append(errors(car, name))
    return found


def main(argv: Sequence[str] | None = None) -> None:
    """Print the errors of the observer for each law at the rack, in percent of the rack force."""
    parser = argparse.ArgumentParser(prog="steer-env study rack-observer", description=main.__doc__)
    parser.add_argument("--laws", metavar="LAW", nargs="+", choices=friction.available(), default=friction.available())
    parser.add_argument("--vehicle", metavar="NAME", default=CAR, help="a car by wire (default: %(default)s)")
    options = parser.parse_args(argv)
    with progress("driving") as notify:
        found = collect(cars.load(options.vehicle), options.laws, notify)
    print(f"{'law at the rack':22s}{'none':>8s}{ONE_LAW:>8s}{'own':>8s}   law that the observer knows of; errors in %")
    for each in found:
        print(f"{each.law:22s}" + "".join(f"{100.0 * value:8.1f}" for value in each[1:]))
