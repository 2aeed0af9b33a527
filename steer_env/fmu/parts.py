"""The parts that a plant can be divided into, by the names that users type."""

from steer_env.fmu import car, chassis, steering
from steer_env.fmu.part import Part
from steer_env.friction.numerics.check import one_of
from steer_env.vehicle.plant import Plant

PARTS = ("car", "steering", "chassis")


def make_part(name: str, p: Plant, speed: float) -> Part:
    """A part of a plant; ``speed`` is the start value of the vehicle's speed, which the steering takes [m/s].

    Raises
    ------
    ValueError
        For a name that is none of ``PARTS``.
    """
    one_of("part", name, PARTS)
    return steering.part(p, speed) if name == "steering" else (car if name == "car" else chassis).part(p)
