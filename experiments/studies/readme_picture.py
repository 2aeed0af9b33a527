"""Draw docs/feel.svg, the picture of the README: friction laws with one calibration in small turns and in a weave."""

import argparse
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from steer_env import friction
from steer_env.experiments.pages import pictures
from steer_env.experiments.pages.files import write_text
from steer_env.experiments.studies.common.battery import drive
from steer_env.experiments.studies.common.friction_records import road_drive
from steer_env.experiments.studies.friction_laws import SMALL_TURN, SMALL_TURNS
from steer_env.hand_torque.drive import reversals
from steer_env.vehicle import cars

LAWS = ("coulomb", "lugre", "masing", "elasto_plastic")
# Travel that counts as a turn: three steps of the recorded angle of the traffic; assumed
LEAST_TURN = math.radians(0.3)
TESTS: dict[str, dict[str, Any]] = {  # title -> options of the weave
    f"turns of ±{math.degrees(SMALL_TURN):g} deg, as on a straight road": SMALL_TURNS,
    "the weave of the standard, 2 m/s²": {"cycles": 6},
}


def main(argv: Sequence[str] | None = None) -> None:
    """Write the picture of the README, and print how far hands turn on the packaged motorway drive."""
    parser = argparse.ArgumentParser(prog="steer-env study readme-picture", description=main.__doc__)
    text = "file for the picture (default feel.svg; docs/feel.svg in a checkout is the picture of the README)"
    parser.add_argument("--out", metavar="FILE.svg", type=Path, default=Path("feel.svg"), help=text)
    args = parser.parse_args(argv)
    car = cars.load()
    tests = {
        title: {law: drive(car, friction.make(law), "weave", options).curves for law in LAWS}
        for title, options in TESTS.items()
    }
    write_text(args.out, pictures.readme(tests))
    turns = np.abs(np.diff(reversals(road_drive()["handwheel_angle"], LEAST_TURN)))
    half = math.degrees(np.median(turns))
    print(f"half of the turns from a reversal to the next span at most {half:.1f} deg on the packaged motorway drive")
