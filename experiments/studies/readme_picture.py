"""Draw docs/feel.svg, the picture of the README: friction laws under the same displacement, and friction in a weave."""

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from steer_env import friction
from steer_env.experiments.pages import pictures
from steer_env.experiments.pages.files import write_text
from steer_env.experiments.studies.common.battery import drive
from steer_env.experiments.studies.friction_laws import through
from steer_env.experiments.studies.loop_width import law_at
from steer_env.vehicle import cars

# Titles of the panels of loops; Dahl is left out, as its curves coincide with LuGre's at this speed.
LOOPS = {"coulomb": "Coulomb", "lugre": "LuGre", "masing": "Masing"}
# Turning points of the displacement: one-sided cycles on the way out, then a full cycle [deg].
TURNS = (0.0, 0.6, 0.2, 0.6, 0.2, 0.6, 0.2, 0.6, 1.2, -1.2, 1.2)
STEP, SPEED = 2e-3, 1.0  # between samples [deg], [deg/s]


def main(argv: Sequence[str] | None = None) -> None:
    """Write the picture of the README."""
    parser = argparse.ArgumentParser(prog="steer-env study readme-picture", description=main.__doc__)
    text = "file for the picture (default feel.svg; docs/feel.svg in a checkout is the picture of the README)"
    parser.add_argument("--out", metavar="FILE.svg", type=Path, default=Path("feel.svg"), help=text)
    args = parser.parse_args(argv)
    x = np.radians(through(TURNS, STEP))
    loops = {title: (law, friction.response(friction.make(law), x, STEP / SPEED)) for law, title in LOOPS.items()}
    car = cars.load()
    weaves = [drive(car, law_at("lugre", level), "weave", {"cycles": 5}).curves for level in (1.0, 0.0)]
    write_text(args.out, pictures.readme(x, loops, *weaves))
