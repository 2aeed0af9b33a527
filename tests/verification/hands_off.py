"""The car after a pulse of the hands, which then let go."""

from collections.abc import Iterator

import numpy as np

from steer_env.vehicle import cars
from steer_env.vehicle.analysis import free_control
from tests.verification.common.rows import Row, verdict

SPEEDS = np.arange(10.0, 61.0)  # [m/s]
LAWS = {"own friction": None, "no friction": free_control.FRICTIONLESS}
SETTLES_TO = {"own friction": 50.0, "no friction": 40.0}  # speed up to which the smaller pulse has to settle [m/s]
SMALL, LARGE = 3.0, 5.0  # torque of the pulses of 0.3 s [N m]


def rows() -> Iterator[Row]:
    """Default car, hands off after a pulse of 0.3 s at 10, 11, ..., 60 m/s: highest speed before the first failure."""
    car = cars.load()
    for chassis in cars.SPEEDS:
        for name, law in LAWS.items():
            plants = [car.plant(law, float(v), chassis=chassis) for v in SPEEDS]
            settles, holds = (
                _highest(free_control.pulse(p, SMALL).settles for p in plants),
                _highest(not free_control.pulse(p, LARGE).spins for p in plants),
            )
            least = SETTLES_TO[name]
            yield Row(
                f"{chassis}, {name}, {SMALL:g} N m: settles",
                f"{settles:g} m/s",
                f">= {least:g} m/s",
                verdict(settles >= least),
            )
            yield Row(f"{chassis}, {name}, {LARGE:g} N m: does not spin", f"{holds:g} m/s", "no limit", "pass")


def _highest(passed: Iterator[bool]) -> float:
    """The speed below the first one at which a test fails [m/s]; NaN where it fails at the first."""
    count = next((i for i, each in enumerate(passed) if not each), SPEEDS.size)
    return float(SPEEDS[count - 1]) if count else float("nan")
