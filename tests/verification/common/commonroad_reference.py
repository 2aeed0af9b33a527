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
