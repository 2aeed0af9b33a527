"""Checks that an optional dependency is there, made before a command begins its work."""

from collections.abc import Iterable
from importlib.util import find_spec
from pathlib import Path

from steer_env.experiments.cli.common.names import EXTRA_OF_FORMAT
from steer_env.friction.numerics.extras import install

MODULES = {
    "train": ("torch", "stable_baselines3"),
    "cluster": ("distributed",),
    "mdf": ("asammdf",),
    "parquet": ("pyarrow",),
    "can": ("can", "cantools"),
    "test": ("vehiclemodels",),
    "datasets": ("minari", "h5py"),
    "fmu": ("fmpy", "ziglang"),
    "explore": ("ziglang",),
    "tune": ("optuna",),
    "docs": ("sphinx", "myst_parser", "furo"),
}  # extra -> modules that it brings
OF_ALGORITHM = {"recurrent-ppo": "sb3_contrib"}


def require(extra: str, what: str, *more: str) -> None:
    """ValueError with the command that installs an extra, unless its modules (and ``more`` of it) are there."""
    missing = [name for name in (*MODULES[extra], *more) if find_spec(name) is None]
    if missing:
        raise ValueError(f"{what} needs {', '.join(missing)}: {install(extra)}")


def require_format(paths: Iterable[str | Path]) -> None:
    """ValueError where a path names a file of a format whose extra is missing."""
    for path in paths:
        for suffix, extra in EXTRA_OF_FORMAT.items():
            if str(path).lower().endswith(suffix):
                require(extra, str(path))
