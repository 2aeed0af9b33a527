"""What the page needs to take a recording, and to hand on its car, an environment with it, and its drive."""

from inspect import signature
from typing import Any

from steer_env.experiments.explore import drives, parameters
from steer_env.metrics.common.filtered_channels import PLAUSIBLE
from steer_env.recording.channel_mapping import KNOWN
from steer_env.recording.recording import Recording
from steer_env.recording.table import label
from steer_env.recording.units import FILE_UNITS, parse_unit, spellings
from steer_env.registration import id_of
from steer_env.vehicle.cars import Car, contents

# Channels of a recording that is laid over: all that a picture of a drive shows, or a metric takes.
CHANNELS = tuple(
    dict.fromkeys(
        name
        for each in drives.SHOWN_MANOEUVRES.values()
        for name in (*(channel for pair in each.pictures for channel in pair), *each.channels)
        if name != drives.TIME
    )
)
# Of that recording; assumed, for what a phone computes within a second.
LARGEST, LONGEST, POINTS = 64e6, 600.0, 4000  # bytes, [s], points of a curve
TASKS = {"driven": "DriverOnCentre", "standing": "DriverParking"}  # of the environments that are nearest


def recording_settings() -> dict[str, Any]:
    """What the page reads of a recording, with the spellings of units, and the largest that it takes."""
    return {
        "channels": {name: KNOWN[name] for name in CHANNELS},
        "units": {text: parse_unit(text) for text in spellings(None).split(", ")},
        "plausible": PLAUSIBLE,
        "gap": signature(Recording.bridged).parameters["longest"].default,
        "largest": LARGEST,
        "longest": LONGEST,
        "points": POINTS,
        "rate": drives.RATE,
    }


def car_file(car: Car) -> dict[str, Any]:
    """The car as the text of a car file, and the values by speed of the keys whose largest the page has.

    ValueError for a car that no car file gives.
    """
    return {"file": contents.text(car), "bySpeed": parameters.profiles(car), "factor": f"assist.{parameters.BOOST}"}


def files() -> dict[str, Any]:
    """The columns of a recording with the unit of each in memory, and the environment with its options."""
    columns = {name: (label(name, unit), FILE_UNITS[unit][1]) for name, unit in KNOWN.items()}
    return {
        "recording": {"columns": columns},
        "rate": drives.RATE,
        "environment": {
            **{key: id_of(task) for key, task in TASKS.items()},
            "options": {parameters.SCALE_NAME: "friction_level", parameters.LOAD_NAME: "load"},
        },
    }
