"""The assist that the design gives a car, as a section of a car file."""

import argparse
from collections.abc import Sequence

import numpy as np

from steer_env.experiments.pages import car_options
from steer_env.vehicle.analysis import assist_design

MERGE = """\
# A file that has a section [assist] takes these keys into it, in place of its own speeds, torques, boost, boost_scale
# and damping; lists among its other keys need a number for each of these speeds. A file holds one section [assist]."""


def main(argv: Sequence[str] | None = None) -> None:
    """Design boost and motor damping for a car and print them as a section of a car file (TOML)."""
    parser = argparse.ArgumentParser(prog="steer-env study assist-design", description=main.__doc__)
    car_options.add(parser)
    car = car_options.load(parser.parse_args(argv))
    found = assist_design.design(car)
    print(MERGE)
    if np.any(np.asarray(car.data()["assist"]["boost_scale"]) != 1.0):
        print("# The boost_scale of this car has no part in the design: the boost below is to be taken as it is.")
    print("[assist]")
    for name, values in found._asdict().items():
        if values.ndim == 1:
            print(f"{name} = {values.round(4).tolist()}")
        else:
            rows = "".join(f"    {row.tolist()},\n" for row in values)
            print(f"{name} = [\n{rows}]")
    print("boost_scale = 1.0")
