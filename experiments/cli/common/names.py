"""Names for help texts and choices, read from listings of files, so that ``--help`` imports no simulation.

``tests/experiments/test_cli_help.py`` compares each list with the registry or table that it stands for.
"""

from importlib.resources import files

from steer_env.experiments.pages.car_options import packaged_names as cars
from steer_env.friction.numerics.registry import modules_by_name, with_dashes

__all__ = [
    "CAN_FORMATS",
    "EXTRA_OF_FORMAT",
    "FORMATS",
    "RECORDED",
    "ROAD_CLASSES",
    "SAMPLE_RATE",
    "assists",
    "cars",
    "chassis",
    "devices",
    "drivers",
    "friction_records",
    "laws",
    "manoeuvres",
    "road_drives",
    "targets",
]

FORMATS = (".csv", ".mat", ".mf4", ".mdf", ".parquet")  # of steer_env.recording.files
CAN_FORMATS = (".blf", ".asc", ".log", ".trc", ".asc.gz", ".log.gz", ".trc.gz")  # .recording.can_log
RECORDED = f"{', '.join(FORMATS)}, or a CAN log: {', '.join(CAN_FORMATS)}"  # what is read
EXTRA_OF_FORMAT = {".mf4": "mdf", ".mdf": "mdf", ".parquet": "parquet", **dict.fromkeys(CAN_FORMATS, "can")}
ROAD_CLASSES = tuple("ABCDEFGH")  # of ISO 8608, as in steer_env.vehicle.road
SAMPLE_RATE = 1000.0  # of a simulated recording [Hz]


def laws() -> tuple[str, ...]:
    """Packaged friction laws."""
    return tuple(modules_by_name("steer_env.friction.models"))


def manoeuvres() -> tuple[str, ...]:
    """Packaged manoeuvres, which are also the tests that metrics are defined for."""
    return tuple(modules_by_name("steer_env.manoeuvres", with_dashes))


def chassis() -> tuple[str, ...]:
    """Chassis models."""
    return tuple(modules_by_name("steer_env.vehicle.chassis"))


def devices() -> tuple[str, ...]:
    """Devices of a drive."""
    return tuple(modules_by_name("steer_env.live.devices"))


def drivers() -> tuple[str, ...]:
    """Driver models."""
    return tuple(modules_by_name("steer_env.drivers"))


def assists() -> tuple[str, ...]:
    """Assist controllers."""
    return tuple(modules_by_name("steer_env.assists"))


def friction_records() -> tuple[str, ...]:
    """Packaged records of friction."""
    return _stems("steer_env.friction", ".csv.gz", "data")


def road_drives() -> tuple[str, ...]:
    """Packaged drives on a road."""
    return _stems("steer_env.experiments", ".csv.gz", "data", "road")


def targets() -> tuple[str, ...]:
    """Packaged sets of target bands."""
    return _stems("steer_env.targets", ".toml")


def _stems(package: str, suffix: str, *folder: str) -> tuple[str, ...]:
    """File names without suffix in a folder of a package."""
    entries = files(package).joinpath(*folder).iterdir()
    return tuple(sorted(entry.name.removesuffix(suffix) for entry in entries if entry.name.endswith(suffix)))
