"""Types of options, and options that several commands have."""

import argparse
import math
from collections.abc import Callable
from pathlib import Path

from steer_env.experiments.cli.common import names
from steer_env.experiments.learning.constants import HELD_OUT, SHIPPED, VALIDATION
from steer_env.experiments.pages.options import FRICTION, Friction

KPH = 1.0 / 3.6  # [m/s]
MOST_EPISODES = VALIDATION - HELD_OUT  # with more, the evaluation would use the seeds of the validation

__all__ = [
    "EXTERNAL",
    "FRICTION",
    "KPH",
    "MOST_EPISODES",
    "SHIPPED",
    "add_evaluation",
    "chassis",
    "external_vehicle",
    "friction_law",
    "minutes",
    "whole_number",
]


def friction_law(text: str) -> Friction:
    """A friction law with its parameters, ``LAW[,key=value...]``."""
    try:
        return Friction(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


EXTERNAL = "an external vehicle: a unit (.fmu), or a mapping (.toml) that names one, as docs/fmu.md tells"


def chassis(text: str) -> str:
    """The name of a chassis of this project, or the file of an external vehicle."""
    known = names.chassis()
    return text if text in known else external_vehicle(text, f"{', '.join(known)} or ")


def external_vehicle(text: str, others: str = "") -> str:
    """The file of an external vehicle."""
    from steer_env.vehicle.chassis import is_external

    if not is_external(text):
        raise argparse.ArgumentTypeError(f"expected {others}{EXTERNAL}, got {text!r}")
    if not Path(text).is_file():
        raise argparse.ArgumentTypeError(f"there is no file {text}")
    return text


def whole_number(least: int, most: float = math.inf) -> Callable[[str], int]:
    """A type of options: whole numbers from ``least`` to ``most``."""

    def read(text: str) -> int:
        try:
            value = int(text)
            if least <= value <= most:
                return value
        except ValueError:
            pass
        upper = f" and at most {most:.0f}" if most < math.inf else ""
        raise argparse.ArgumentTypeError(f"must be a whole number of at least {least}{upper}, got {text!r}")

    return read


def minutes(text: str) -> float:
    """A duration above zero [min]."""
    from steer_env.friction.numerics.check import number, read_number

    try:
        return number("minutes", read_number(text), minimum=0.0, above=True)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def add_evaluation(parser: argparse.ArgumentParser, out: str) -> None:
    """Add the options of an evaluation on held-out episodes: how many, and where its report goes."""
    text = "number of held-out episodes (default 200)"
    parser.add_argument("--episodes", metavar="N", type=whole_number(1, MOST_EPISODES), default=200, help=text)
    text = f"directory of the report, replaced as a whole (default {out})"
    parser.add_argument("--out", metavar="DIR", default=out, help=text)
