"""On-centre feel."""

from collections.abc import Iterator

from steer_env import manoeuvres, metrics
from steer_env.experiments.output.words import label
from steer_env.experiments.verification.requirements.common.rows import Row, verdict
from steer_env.vehicle import cars

FEEL = {
    "torque_gradient_at_0g": (10.0, 15.0),
    "torque_at_0g": (0.6, 1.3),
    "lateral_acceleration_at_0nm": (0.03, 0.09),
    "steering_sensitivity_at_0p1g": (1.3, 1.9),
}


def rows() -> Iterator[Row]:
    """On-centre feel of the default car: weave at 100 km/h, 0.2 Hz, 2 m/s2, LuGre."""
    found = metrics.evaluate(manoeuvres.drive(cars.load(), manoeuvres.make("weave"), "lugre"))
    for name, (low, high) in FEEL.items():
        value = found[name].value
        aim = f"{low:g} to {high:g} {found[name].unit}"
        yield Row(label(name), f"{value:.4g}", aim, verdict(low <= value <= high))
