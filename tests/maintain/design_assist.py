"""Design boost and motor damping for a car and print them as a section of a car file (TOML)."""

import argparse

import numpy as np

from steer_env.experiments.pages import car_options
from tests.tools import assist_design

GROUP = "Maintain the package"
MERGE = """\
# A file that has a section [assist] takes these keys into it, in place of its own speeds, torques, boost, boost_scale
# and damping; lists among its other keys need a number for each of these speeds. A file holds one section [assist]."""


def add(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    car_options.add(parser)


def run(args: argparse.Namespace) -> None:
    """Design and print."""
    car = car_options.load(args)
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
