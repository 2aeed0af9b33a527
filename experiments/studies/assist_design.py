"""The assist that the design gives a car, as a section of a car file."""

import argparse
from collections.abc import Sequence

from steer_env.experiments.output import car_options
from steer_env.vehicle import assist_design


def main(argv: Sequence[str] | None = None) -> None:
    """Design boost and motor damping for a car and print them as a section of a car file (TOML)."""
    parser = argparse.ArgumentParser(prog="steer-env study assist-design", description=main.__doc__)
    car_options.add(parser)
    found = assist_design.design(car_options.load(parser.parse_args(argv)))
    print("[assist]")
    for name, values in found._asdict().items():
        if values.ndim == 1:
            print(f"{name} = {values.round(4).tolist()}")
        else:
            rows = "".join(f"    {row.tolist()},\n" for row in values)
            print(f"{name} = [\n{rows}]")
