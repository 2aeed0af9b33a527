"""The manoeuvres of the page as data: the motion of the hands, what is drawn, and what the metrics are read with.

The hands of every manoeuvre here move in proportion to an amplitude. What they do at an amplitude of 1 is cut into as
few pieces as polynomials of Chebyshev's form can follow to the last digits at every sample, so that the page knows the
shape of no manoeuvre. A further manoeuvre is an entry in ``SHOWN_MANOEUVRES``, and where it has metrics of another
kind, a script that reads them.
"""

import inspect
from collections.abc import Callable, Iterator, Mapping
from functools import lru_cache
from types import MappingProxyType, ModuleType
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray
from scipy import signal

from steer_env import metrics
from steer_env.experiments.pages import words
from steer_env.experiments.studies.friction_laws import SMALL_TURNS
from steer_env.manoeuvres import Manoeuvre, make
from steer_env.manoeuvres.common.definition import half_span
from steer_env.manoeuvres.common.driving import REGRIP
from steer_env.metrics import catch_up, parking, step_steer
from steer_env.metrics.common import decay, events, free_control, free_hands, loops
from steer_env.metrics.common.filtered_channels import ANGLE, AY, TORQUE, YAW
from steer_env.recording.recording import DEGREE
from steer_env.recording.zero_phase import low_pass
from steer_env.vehicle import chassis as chassis_models
from steer_env.vehicle.steering import linear, stability
from steer_env.vehicle.steering.eps import SAMPLE_TIME

Array = NDArray[np.float64]
RATE = 1.0 / SAMPLE_TIME  # [Hz]
DEGREE_OF_PIECES = 23
CLOSE = 2e-13  # of a piece to the motion of the hands, over the largest value [1]
DIGITS = 16  # decimals of the coefficients
RACK, HAND_SPEED = "rack_force", "handwheel_speed"
LEFT_OUT = ("share_at_motor_limit", "motor_limit_rate")  # of the metrics: the page has no curve of a motor

TIME = "time"
# Words, unit and scale of what is drawn.
DRAWN_QUANTITIES = {
    TIME: ("time", "s", 1.0),
    ANGLE: ("handwheel angle", "deg", 1.0 / DEGREE),
    HAND_SPEED: ("handwheel speed", "deg/s", 1.0 / DEGREE),
    TORQUE: ("hand torque", "N m", 1.0),
    AY: ("lateral acceleration", "m/s²", 1.0),
    YAW: ("yaw rate", "deg/s", 1.0 / DEGREE),
    RACK: ("rack force", "kN", 1e-3),
    "motor_torque": ("motor torque", "N m", 1.0),
    "friction_torque": ("friction torque", "N m", 1.0),
    "displacement": ("column displacement", "deg", 1.0 / DEGREE),
    "sliding_speed": ("sliding speed", "deg/s", 1.0 / DEGREE),
    "frequency": ("frequency", "Hz", 1.0),
    "yaw_gain": ("gain", "1/s", 1.0),
    "yaw_phase": ("phase", "deg", 1.0 / DEGREE),
    "torque_gain": ("gain", "N m/deg", DEGREE),
}


class ShownManoeuvre(NamedTuple):
    """How the page shows a manoeuvre."""

    title: str
    reader: str  # of its metrics: a script of the page
    pictures: tuple[tuple[str, str], ...]  # channels (x, y); the first two are large
    moving: Mapping[str, Any]  # options of the shorter manoeuvre that is driven while a value changes
    fewest: tuple[int, int] = (1, 1)  # repeats that the metrics need, in the whole and in the shorter manoeuvre
    section: tuple[float, float] | None = None  # that is drawn [s]; None: the last cycle but one
    points: int = 1000  # of a curve, about: enough for no corner that is not one of the law
    channels: tuple[str, ...] = ()  # that the metrics take besides those that are drawn
    manoeuvre: str = ""  # that it is, under another name here
    options: Mapping[str, Any] = MappingProxyType({})  # of the manoeuvre


def _fewest(test: str) -> int:
    """Settled cycles that the metrics of a test need."""
    return int(inspect.signature(metrics.evaluation_by_name(test).read).parameters["fewest"].default)


_LOOPS = ((ANGLE, TORQUE), (AY, TORQUE))
# While a value changes, the ramp is steered faster and fewer sweeps are: a sample of the drive takes 1 to 2 us.
SHOWN_MANOEUVRES = {
    "weave": ShownManoeuvre(
        "weave", "loops", (*_LOOPS, (TIME, TORQUE), (TIME, AY), (TIME, RACK)), {"cycles": 3}, (_fewest("weave"), 1),
        channels=(YAW,),
    ),
    "small-turns": ShownManoeuvre(
        "small turns", "loops", (*_LOOPS, (TIME, TORQUE), (TIME, ANGLE), (TIME, RACK)), {"cycles": 3},
        (_fewest("weave"), 1), channels=(YAW,), manoeuvre="weave", options=SMALL_TURNS,
    ),
    "slow-ramp": ShownManoeuvre(
        "slow ramp", "loops", (*_LOOPS, (ANGLE, AY), (TIME, TORQUE), (TIME, RACK)), {"frequency": 0.05, "cycles": 3},
        (_fewest("slow-ramp"), 1), channels=(YAW,),
    ),
    "release": ShownManoeuvre(
        "release", "release", ((TIME, ANGLE), (TIME, YAW), (TIME, TORQUE), (TIME, AY), (ANGLE, YAW)), {"events": 1},
        section=(1.0, 9.0),
    ),
    "step-steer": ShownManoeuvre(
        "step steer", "steps", ((TIME, YAW), (TIME, AY), (TIME, ANGLE), (TIME, TORQUE), (TIME, RACK)), {"right": False},
        section=(0.8, 5.9), channels=("lateral_speed",),
    ),
    "parking": ShownManoeuvre(
        "parking", "parking", ((ANGLE, TORQUE), (ANGLE, RACK), (TIME, TORQUE), (TIME, RACK), (TIME, "motor_torque")),
        {"cycles": 1}, (parking.FEWEST, 1), (7.5, np.inf), 1500, ("column_speed",),
    ),
    "catch-up": ShownManoeuvre(
        "catch-up", "sweeps",
        ((HAND_SPEED, TORQUE), (TIME, TORQUE), (TIME, HAND_SPEED), (TIME, "motor_torque"), (TIME, ANGLE)),
        {"rates": (300.0 * DEGREE, 500.0 * DEGREE, 700.0 * DEGREE)}, section=(0.0, np.inf), points=3000,
    ),
}  # fmt: skip
# Whose constants the scripts of the metrics take.
MODULES = (loops, decay, events, free_control, free_hands, step_steer, parking, catch_up, linear, stability)


def made(name: str, moving: bool = False) -> Manoeuvre:
    """A manoeuvre of ``SHOWN_MANOEUVRES``, or the shorter one that is driven while a value changes."""
    shown = SHOWN_MANOEUVRES[name]
    return make(shown.manoeuvre or name, **{**shown.options, **(shown.moving if moving else {})})


def declared(chassis: tuple[str, ...]) -> dict[str, Any]:
    """What the page knows of the manoeuvres that can be driven on one of these chassis.

    Raises
    ------
    ValueError
        A manoeuvre of a kind that the page does not drive.
    """
    return {
        "rate": RATE,
        "regrip": REGRIP,
        "drawn": {
            name: {"label": label, "unit": unit, "scale": scale}
            for name, (label, unit, scale) in DRAWN_QUANTITIES.items()
        },
        "manoeuvres": {
            name: _manoeuvre(name, chassis) for name in SHOWN_MANOEUVRES if set(_chassis(made(name))) & set(chassis)
        },
        "constants": {module.__name__.rpartition(".")[2]: constants(module) for module in MODULES},
        "filters": {f"{cutoff:g}": _low_pass(cutoff) for cutoff in sorted(_cutoffs())},
        "functions": stability.KEYS,
    }


def _chassis(manoeuvre: Manoeuvre) -> tuple[str, ...]:
    """Chassis on which a manoeuvre can be driven: any, unless the car stands."""
    return chassis_models.available() if manoeuvre.speed else (manoeuvre.chassis,)


def _manoeuvre(name: str, chassis: tuple[str, ...]) -> dict[str, Any]:
    of, shown = made(name), SHOWN_MANOEUVRES[name]
    if of.others or of.driver or of.rig or of.road or not of.robot:
        raise ValueError(f"{of.name} needs more than the motion of a robot's hands, which is all that the page drives")
    drawn = dict.fromkeys(channel for picture in shown.pictures for channel in picture if channel != TIME)
    section = shown.section or (0.0, np.inf)
    return {
        "name": of.name,
        "title": shown.title,
        "hands": of.hands.replace("+-", "±")
        + (f", amplitude for {of.lateral_acceleration:g} m/s²" if of.lateral_acceleration else ""),
        "speed": of.speed,
        "chassis": [each for each in _chassis(of) if each in chassis],
        "amplitude": of.amplitude,
        "lock": of.lock,
        "target": of.lateral_acceleration,
        "reach": "half span" if of.reach is half_span else "last second",
        "trial": round((of.trial or of.duration) / SAMPLE_TIME),
        "free": bool(of.released),
        "whole": _course(name, shown.fewest[0], moving=False),
        "moving": _course(name, shown.fewest[1], moving=True),
        "reader": shown.reader,
        "pictures": shown.pictures,
        "channels": list(dict.fromkeys([*drawn, AY, *shown.channels])),
        "section": None if shown.section is None else [float(min(end, of.duration)) for end in section],
        "points": shown.points,
        "metrics": [_metric(name) for name in metrics.available(of.name) if name not in LEFT_OUT],
    }


def _course(name: str, fewest: int, moving: bool) -> dict[str, Any]:
    """The hands of a manoeuvre."""
    of = made(name, moving)
    return {
        "pieces": list(_pieces(name, moving)),
        "samples": round(of.duration / SAMPLE_TIME),
        "released": [round(time / SAMPLE_TIME) for time in of.released],
        "frequency": of.frequency,
        "fewest": fewest,
    }


@lru_cache
def _pieces(name: str, moving: bool) -> tuple[tuple[int, list[float], list[float]], ...]:
    of = made(name, moving)
    return tuple(pieces(of.hand, round(of.duration / SAMPLE_TIME)))


def pieces(
    hand: Callable[[Array, float], tuple[Array, Array]], samples: int
) -> Iterator[tuple[int, list[float], list[float]]]:
    """Polynomials that follow the hands at an amplitude of 1, one after the other; a held angle is one of its own.

    It is therefore held to the bit, as friction that jumps at rest needs it where it sits above the torsion bar.

    Parameters
    ----------
    hand : callable
        Of a :class:`steer_env.manoeuvres.Manoeuvre`.
    samples : int
        Number of samples, the first of which is one sample time after the start.

    Returns
    -------
    iterator of (int, list of float, list of float)
        Number of samples, and Chebyshev coefficients of angle and speed, from the first to the last of them.

    Raises
    ------
    ValueError
        Where the motion is not proportional to the amplitude.
    """
    everything = SAMPLE_TIME * np.arange(1.0, samples + 1.0)
    motion, double = np.array(hand(everything, 1.0)), np.array(hand(everything, 2.0))
    scale = np.abs(motion).max(axis=1)[:, None]
    if np.any(np.abs(double - 2.0 * motion) > CLOSE * scale):
        raise ValueError("the motion of the hands is not proportional to its amplitude")
    same = np.diff(motion[0]) == 0.0
    held = np.append(False, same) | np.append(same, False)
    ends = (held[1:] != held[:-1]) | (held[1:] & ~same)
    section = np.append(0, np.cumsum(ends))  # (T,), held ones and others
    nodes = chebyshev.chebpts1(DEGREE_OF_PIECES + 1)
    inverse = np.linalg.inv(chebyshev.chebvander(nodes, DEGREE_OF_PIECES))

    def followed(first: int, size: int) -> Array | None:
        """Coefficients (2, n) of a piece; None where they do not follow the hands."""
        t, wanted = everything[first : first + size], motion[:, first : first + size]
        if t.size < size or section[first] != section[first + size - 1]:
            return None
        if size == 1:
            return wanted
        middle, half = 0.5 * (t[0] + t[-1]), 0.5 * (t[-1] - t[0])
        found = np.array(hand(middle + half * nodes, 1.0)) @ inverse.T
        if held[first]:
            found[0] = np.where(np.arange(nodes.size) > 0, 0.0, wanted[0, 0])
        off = chebyshev.chebval((t - middle) / half, found.T) - wanted
        return found if np.all(np.abs(off) <= CLOSE * scale) else None

    first = 0
    while first < samples:
        size, step, best = 1, 1, motion[:, first : first + 1]
        while (found := followed(first, size + step)) is not None:
            size, step, best = size + step, 2 * step, found
        while step > 1:
            step //= 2
            if (found := followed(first, size + step)) is not None:
                size, best = size + step, found
        yield size, _shortened(best[0]), _shortened(best[1])
        first += size


def _shortened(coefficients: Array) -> list[float]:
    """Coefficients up to the last that counts."""
    kept = np.round(coefficients, DIGITS)
    return kept[: int(np.flatnonzero(kept).max(initial=0)) + 1].tolist()


def constants(module: ModuleType) -> dict[str, Any]:
    """The numbers that a module has under names in capitals, by these names."""
    found = {}
    for name, value in vars(module).items():
        if name.isupper() and isinstance(value, float | int | tuple | dict | np.ndarray):
            found[name] = value.tolist() if isinstance(value, np.ndarray) else value
    return {name: value for name, value in found.items() if _is_number(value)}


def _is_number(value: Any) -> bool:
    if isinstance(value, dict):
        return all(_is_number(each) for each in value.values())
    if isinstance(value, tuple | list):
        return all(_is_number(each) for each in value)
    return isinstance(value, float | int)


def _cutoffs() -> set[float]:
    """Cutoffs of the low-passes of the metrics [Hz]."""
    return {
        float(value)
        for module in MODULES
        for name, value in constants(module).items()
        if name.endswith("CUTOFF") and not name.startswith("SAMPLES")
    }


def _low_pass(cutoff: float) -> dict[str, Any]:
    sections = low_pass(cutoff, RATE)
    start = signal.sosfilt_zi(sections)
    return {"cutoff": cutoff, "b": sections[0, :3].tolist(), "a": sections[0, 3:].tolist(), "zi": start[0].tolist()}


def _metric(name: str) -> dict[str, Any]:
    entry = metrics.definition(name)
    return {
        "name": name,
        "label": words.label(name),
        "unit": entry.unit,
        "scale": metrics.UNITS[entry.unit],
        "definition": entry.definition,
        "usual": entry.usual,
        "validity": entry.validity,
    }
