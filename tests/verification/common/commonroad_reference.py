"""CommonRoad's side of the cross-validation: a stored reference, so that nothing here needs their package."""

import json
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np

from steer_env.recording.recording import Recording
from steer_env.vehicle.chassis import two_track
from tests.verification.common.commonroad_manoeuvres import (
    MANOEUVRES,
    UNITS,
    Manoeuvre,
    meta,
    road_wheel_angle,
    sample_times,
)

FILE = Path(__file__).with_name("commonroad.npz")
CASES = ("published", "reconciled")  # of the CommonRoad model

# What reconciling changes in the CommonRoad model; ``commonroad_model`` has the values and lines of code.
PECULIARITIES = {
    "jump": "A shift of the lateral tyre force, 2 % of the load, changes its sign where a wheel passes upright.",
    "drag": "The longitudinal tyre force has an offset: a drag of 1 % of the load at zero slip.",
    "one-sided": "Shifts of combined slip are the same on both sides of the car, so left and right turns differ.",
    "load point": "The wheel load acts beside the middle of the wheel, in proportion to the lateral force.",
    "joint": "Spring and damper join body and axles sideways; the body follows the tyre forces after some 0.06 s.",
    "axle slip": "Slip angles follow the lateral speed of the body's centre of gravity, not that of the axle.",
    "centres": "The yaw moments are taken about the centre of gravity of the body, not of the whole car.",
    "lean": "Longitudinal forces give no yaw moment when the body has rolled out of the middle.",
    "spin": "Spinning wheels have no gyroscopic moments.",
    "beams": "The axles are beams with a fixed roll centre; our wheels are independent.",
    "contact": "The load of an inclined wheel acts below its centre; in our model it acts in the wheel plane.",
    "pitch": "The whole longitudinal force pitches the body, at the height of its centre of gravity.",
}


class Reference(NamedTuple):
    """Their side, as stored."""

    parameters: Any  # of the CommonRoad model, with its names: as vehiclemodels.vehicle_parameters.VehicleParameters
    about: dict[str, Any]  # source, licence, version, command, the car of this package with the same parameters
    histories: dict[str, dict[str, Recording]]  # manoeuvre -> case


STORED = (
    *("speed", "lateral_speed", "yaw_rate", "lateral_acceleration", "roll_angle"),
    *(f"wheel_load_{wheel}" for wheel in two_track.WHEELS),
)  # channels of a reference; the road-wheel angle is known


def interval(manoeuvre: Manoeuvre) -> float:
    """Time between the samples of a reference [s]."""
    return 0.2 if manoeuvre.kind == "circle" else 0.02


def _namespace(values: Mapping[str, Any]) -> SimpleNamespace:
    """Nested mappings as attributes."""
    return SimpleNamespace(**{k: _namespace(v) if isinstance(v, dict) else v for k, v in values.items()})


@lru_cache
def load(path: Path = FILE) -> Reference:
    """Read what ``python -m tests.verification.common.commonroad_model --write`` has written."""
    histories: dict[str, dict[str, Recording]] = {}
    with np.load(path) as stored:
        about = json.loads(str(stored["about"]))
        for name, manoeuvre in MANOEUVRES.items():
            times = sample_times(manoeuvre, interval(manoeuvre))
            angle = {"road_wheel_angle": road_wheel_angle(manoeuvre, times)[0]}
            histories[name] = {}
            for case in CASES:
                channels = angle | dict(zip(STORED, stored[f"{name}.{case}"].astype(float)))
                units = {channel: UNITS[channel] for channel in channels}
                histories[name][case] = Recording(times, channels, units, meta(manoeuvre))
    return Reference(_namespace(about.pop("parameters")), about, histories)
