"""Options of the commands that give a subsystem to other tools: which one, with which law, car and speed."""

import argparse

from steer_env.experiments.cli.common import names
from steer_env.experiments.cli.common.arguments import FRICTION, friction_law
from steer_env.experiments.pages import car_options

SUBSYSTEMS = ("car", "steering", "chassis")  # as in steer_env.vehicle.subsystems, whose import takes long


def add(parser: argparse.ArgumentParser, subsystem: str, speed: str, hands: str) -> None:
    """Add the options to a parser; the texts say what subsystem, speed and hands are for."""
    parser.add_argument("--subsystem", choices=SUBSYSTEMS, default="car", help=f"{subsystem} (default car)")
    text = f"{FRICTION} (default lugre)"
    parser.add_argument("--friction", metavar="LAW", type=friction_law, default="lugre", help=text)
    car_options.add(parser)
    text = "chassis model (default single_track)"
    parser.add_argument("--chassis", choices=names.chassis(), default="single_track", help=text)
    parser.add_argument("--speed-kph", metavar="V", type=float, default=100.0, help=f"{speed} (default 100)")
    text = "friction of the road over that of the tyre measurements (default 1)"
    parser.add_argument("--road-friction", metavar="MU", type=float, default=1.0, help=text)
    parser.add_argument("--hands", choices=("torque", "angle"), default="torque", help=f"{hands} (default torque)")
