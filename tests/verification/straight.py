"""Rest and straight driving."""

from collections.abc import Iterator

import numpy as np

from steer_env import friction
from steer_env.experiments.studies.common.column_schemes import Case, integrate
from steer_env.vehicle import cars, plant
from steer_env.vehicle.steering import column
from tests.verification.common.rows import Row, at_most

STEP = 1e-3  # [s]
MINUTES = 10


def rows() -> Iterator[Row]:
    """Ten minutes without a disturbance: the column at rest, and the car straight ahead at 100 km/h, hands off."""
    lateral = [i for name, i in plant.CHANNEL.items() if name not in ("x", "drive_force") and "load" not in name]
    inputs, record = np.zeros((60_000, len(plant.INPUTS))), np.zeros((60, len(plant.CHANNELS)))
    for law in friction.available():
        rest = integrate(Case(column.make(), friction.make(law), 0.0, 1.0, 60.0 * MINUTES), "midpoint", STEP)
        yield at_most(f"{law}, at rest: speed and torque", np.abs(rest), 1e-12, "SI")
        p, largest = cars.load().plant(law), []
        state = plant.initial_state(p)
        for _ in range(MINUTES):
            plant.run(p, state, inputs, record, 1)
            largest.append(np.abs(record[:, lateral]).max())
        yield at_most(f"{law}, straight: any lateral channel", largest, 1e-12, "SI")
