"""Effects of the full vehicle: the same weave on both chassis, the causes of the difference, and parking."""

import argparse
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env import manoeuvres
from steer_env.experiments.pages.metrics_json import entries
from steer_env.friction.numerics.frozen import frozen
from steer_env.metrics import Value, evaluate
from steer_env.recording.recording import Recording
from steer_env.vehicle import cars, plant
from steer_env.vehicle.cars import Car
from steer_env.vehicle.steering.eps import SAMPLE_TIME, without_assist

Array = NDArray[np.float64]

# Effects that only the two-track model has: title -> factors on fields of two_track.Body, which take the effect out.
# Stiffer tyres or lighter wheels than these would need a shorter step.
SWITCHES: dict[str, dict[str, float]] = {
    "tyres twice as stiff": {"K_t": 2.0},
    "half the angular momentum of the wheels": {"I_w": 0.5},
    "no bore torque of the contact patch": {"sigma_z": 1e-3},
    "no drag, lift, rolling resistance": {"drag": 0.0, "lift_f": 0.0, "lift_r": 0.0},
}
RESISTANCE = "no drag, lift, rolling resistance"
SHOWN_CHANNELS = ("lateral_acceleration", "yaw_rate", "roll_angle", "handwheel_torque", "rack_force")


class Peaks(NamedTuple):
    """Peaks of one settled cycle of the same weave."""

    title: str
    values: dict[str, float]  # channel -> peak, SI


class Parking(NamedTuple):
    """The last cycle of parking, lock to lock."""

    values: dict[str, Value]
    angle: Array  # of the handwheel [rad]
    rack_force: Array  # [N]
    torque: Array  # of the hands [N m]


class Study(NamedTuple):
    """Results of the study, which the section "Vehicle" of the report shows."""

    amplitude: float  # of the handwheel in the weave [rad]
    peaks: list[Peaks]  # single track, two tracks, then two tracks with each switch
    cycles: dict[str, dict[str, Array]]  # chassis -> channel -> last cycle, every tenth sample
    parking: dict[str, Parking]  # "assisted", "unassisted"


def _switch(p: plant.Plant, car: Car, titles: Iterable[str]) -> plant.Plant:
    body, tyre = p.chassis.body.copy(), p.tyre.copy()
    for title in titles:
        for field, factor in SWITCHES[title].items():
            body[field] *= factor
        if title == RESISTANCE:
            for key in ("QSY1", "QSY2", "QSY3", "QSY4"):
                tyre[key] = 0.0
    return frozen(p._replace(chassis=p.chassis._replace(body=body), tyre=tyre))


def _weave(p: plant.Plant, u: Array, period: int) -> dict[str, Array]:
    """Channels of the last cycle."""
    record = np.zeros((len(u), len(plant.channels(p))))
    if not plant.run(p, plant.initial_state(p), u, record, 1):
        raise ValueError("the simulation of the weave diverged")
    return {name: record[-period:, plant.CHANNEL[name]] for name in ("handwheel_angle", *SHOWN_CHANNELS)}


def park(car: Car, friction: Any, assisted: bool = True) -> Parking:
    """Turn from lock to lock at standstill, with the assist on or off."""
    if not assisted:
        car = car._replace(assist=without_assist(car.assist))
    recording: Recording = manoeuvres.drive(car, manoeuvres.make("parking"), friction)
    period = round(1.0 / recording.meta["frequency_hz"] / SAMPLE_TIME)
    names = ("handwheel_angle", "rack_force", "handwheel_torque")
    return Parking(evaluate(recording), *(recording[name][-period::10] for name in names))


def collect(car: Car, friction: Any) -> Study:
    """Drive the weaves and the parking with one friction law."""
    weave = manoeuvres.make("weave", cycles=4)
    single, two = (car.plant(friction, robot=True, chassis=chassis) for chassis in ("single_track", "two_track"))
    amplitude = manoeuvres.find_amplitude(single, weave)
    u = manoeuvres.inputs(weave, amplitude, weave.duration)
    period = round(1.0 / 0.2 / SAMPLE_TIME)
    plants = {"single track": single, "two tracks": two}
    plants |= {title: _switch(two, car, [title]) for title in SWITCHES}
    plants["all of these"] = _switch(two, car, SWITCHES)
    runs = {title: _weave(p, u, period) for title, p in plants.items()}
    return Study(
        amplitude,
        [
            Peaks(title, {name: float(np.abs(run[name]).max()) for name in SHOWN_CHANNELS})
            for title, run in runs.items()
        ],
        {title: {name: x[::10] for name, x in runs[title].items()} for title in ("single track", "two tracks")},
        {state: park(car, friction, state == "assisted") for state in ("assisted", "unassisted")},
    )


def main(argv: Sequence[str] | None = None) -> None:
    """Print the peaks of the weave on both chassis, with each effect taken out, and the metrics of parking."""
    argparse.ArgumentParser(prog="steer-env study vehicle", description=main.__doc__).parse_args(argv)
    study = collect(cars.load(), "lugre")
    print(f"weave at 100 km/h, 0.2 Hz, {np.degrees(study.amplitude):.2f} deg: peaks of a settled cycle")
    print(f"{'':45s}" + "".join(f"{name:>22s}" for name in SHOWN_CHANNELS))
    for row in study.peaks:
        print(f"{row.title:45s}" + "".join(f"{row.values[name]:22.5g}" for name in SHOWN_CHANNELS))
    for state, found in study.parking.items():
        print(f"\nparking, {state}")
        for name, entry in entries(found.values).items():
            print(f"  {name:30s} {entry['value']:10.4g} {entry['unit']}")
