"""Measured records of friction that come with the package: what each is, and its samples.

    from steer_env import friction
    about = friction.records.about("rig")
    record = friction.records.read("rig")   # a friction.Record, in about.units

A record is displacement and the force that resists it. A new one is a file in ``friction/data``, whose
``SOURCES.md`` has its licence, and an entry of ``MEASURED``.
"""

from collections.abc import Mapping
from importlib.resources import as_file, files
from typing import NamedTuple

import numpy as np

from steer_env.friction.identification.record import Record, checked
from steer_env.friction.numerics.check import one_of

MILLI = 1e-3


class Measured(NamedTuple):
    """A measured record, in words and numbers."""

    contact: str
    stroke: float  # largest displacement to and fro, end to end [m]
    speeds: tuple[float, ...]  # at which it slides, each the median [m/s]
    load: float  # mean normal force [N]
    source: str
    licence: str
    tells: tuple[str, ...]
    cannot_tell: tuple[str, ...]
    file: str  # CSV with one line of names: time [s], displacement [mm], force [N], normal force [N]
    sense: float  # 1 where the force of the file resists positive motion, else -1 [1]
    units: Mapping[str, str] = {"displacement": "m", "torque": "N", "load": "N"}


MEASURED = {
    "rig": Measured(
        contact="a reciprocating contact on a rig, no steering",
        stroke=0.23e-3,
        speeds=(0.22e-3,),
        load=5.0,
        source="FrictionModels.jl (J. Christopherson), examples/test_data_2.txt",
        licence="MIT",
        tells=(
            "level and pre-sliding of a saturated loop",
            "differences between the two directions and along the stroke",
            "how far one period differs from the next",
        ),
        cannot_tell=(
            "viscous part and Stribeck effect: it has one speed",
            "nested loops: it has one stroke",
            "influence of the load: it has one load",
            "friction at rest: there the displacement follows the force, by the compliance of the drive",
        ),
        file="rig.csv.gz",
        sense=-1.0,
    ),
}


def available() -> tuple[str, ...]:
    """Names of the records, in alphabetical order."""
    return tuple(sorted(MEASURED))


def about(name: str) -> Measured:
    """What a record is; raises ValueError for an unknown name, with the known ones."""
    one_of("record", name, available())
    return MEASURED[name]


def read(name: str) -> Record:
    """The samples of a record, in its ``units``; the force resists positive motion.

    Raises
    ------
    ValueError
        For an unknown name, with the known ones.
    """
    measured = about(name)
    with as_file(files("steer_env.friction").joinpath("data", measured.file)) as path:
        t, x, force, load = np.loadtxt(path, delimiter=",", skiprows=1, unpack=True)
    dt = (t[-1] - t[0]) / (t.size - 1)
    return checked(MILLI * x, measured.sense * force, dt, load)
