"""Double lane change."""

from collections.abc import Callable
from typing import Any

import numpy as np

from steer_env.courses import iso3888
from steer_env.manoeuvres.common.definition import Manoeuvre, register
from steer_env.vehicle.cars import Car
from steer_env.vehicle.plant import Plant

APPROACH, RUN_OUT = 60.0, 15.0  # way straight ahead before the first cone, and way behind the last cone; assumed [m]
LONGEST = 60.0  # longest duration of a run [s]


@register("double-lane-change")
def double_lane_change(edition: str = "2018", mirrored: bool = False, **driver: float) -> Manoeuvre:
    """Double lane change: a preview driver steers the car to the next lane and back at constant speed."""
    return lane_change_manoeuvre(
        "double-lane-change",
        edition,
        mirrored,
        driver,
        hands="A preview driver steers to the next lane and back",
        source=f"after ISO 3888-1:{edition}",
        speed=80.0 / 3.6,
    )


def lane_change_manoeuvre(
    name: str, edition: str, mirrored: bool, driver: dict[str, float], **fields: Any
) -> Manoeuvre:
    """A closed-loop manoeuvre through a course.

    ``driver`` has options of :func:`steer_env.drivers.common.lq.preview`; ``fields`` are those of the manoeuvre.
    """

    def preview_driver(car: Car, p: Plant) -> Callable[[float, Any], tuple[float, float]]:
        # Here, because the import of python-control takes longer than the start of an environment.
        from steer_env.drivers.common import lq

        size = iso3888.footprint(car)
        path = iso3888.path(iso3888.course(name, size.width, edition, mirrored), size)
        return lq.preview(car, p, path + np.array([APPROACH, 0.0]), **driver)

    length = iso3888.course(name, 1.8, edition).length
    return Manoeuvre(
        name=name,
        duration=LONGEST,
        hand=lambda t, amplitude: (np.zeros_like(t), np.zeros_like(t)),
        driver=preview_driver,
        ends_at=APPROACH + length + RUN_OUT,
        meta={"edition": edition, "mirrored": mirrored, "entry_x_m": APPROACH, "entry_y_m": 0.0, "entry_yaw_rad": 0.0},
        **fields,
    )
