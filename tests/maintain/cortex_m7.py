"""Print instructions and memory of a step of the steering on an emulated Cortex-M7, with every law."""

import argparse
import tempfile
from pathlib import Path

GROUP = "Maintain the package"


def add(parser: argparse.ArgumentParser) -> None:
    """There are no options."""


def run(args: argparse.Namespace) -> None:
    """Run the example of every law and print the table."""
    from steer_env import friction
    from tests.connect.fmu import cortex_m7

    if cortex_m7.MISSING:
        raise ValueError(cortex_m7.MISSING)
    print("law                 instructions  at most  stack [B]  code [B]  parameters [B]  RAM [B]")
    for law in friction.available():
        with tempfile.TemporaryDirectory() as folder:
            found = cortex_m7.run(Path(folder), law)
        print(
            f"{law:18s}{found.mean:14.0f}{found.most:9.0f}{found.stack:11d}{found.code:10d}{found.parameters:16d}"
            f"{found.memory:9d}"
        )
