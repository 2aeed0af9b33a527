"""The parts that a plant can be divided into, by the names that users type."""

from steer_env.friction.numerics.check import one_of
from steer_env.friction.numerics.kernel import plain
from steer_env.vehicle.chassis import chassis_of
from steer_env.vehicle.plant import Plant
from steer_env.vehicle.subsystems import car, chassis, steering
from steer_env.vehicle.subsystems.subsystem import Part

PARTS = ("car", "steering", "chassis")
ROUNDING = 1e-6  # of a speed [m/s]


def make_part(name: str, p: Plant, speed: float) -> Part:
    """A part of a plant.

    Parameters
    ----------
    name : str
        One of ``PARTS``.
    p : Plant
    speed : float
        Start value of the vehicle's speed, which the steering takes; the others drive at the plant's [m/s].

    Raises
    ------
    ValueError
        For a name that is none of ``PARTS``, and for a car or chassis whose plant has another speed.
    """
    one_of("part", name, PARTS)
    if name == "steering":
        return steering.part(p, speed)
    kind = chassis_of(p.chassis)
    own = float(plain(kind.speed)(p.chassis, kind.start(p.chassis)))
    if abs(own - speed) > ROUNDING:
        raise ValueError(
            f"the plant of the {name} drives at {own:.6g} m/s, not at {speed:.6g} m/s: make it at that speed"
        )
    return (car if name == "car" else chassis).part(p)
