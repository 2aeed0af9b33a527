"""The steering as an object file with a header, for the firmware of a controller with a Cortex-M7: no FMU."""

from importlib import metadata
from itertools import groupby
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from steer_env.connect.fmu.object_code import module_text, object_for
from steer_env.connect.variables import Variable, described, variables
from steer_env.friction.numerics.packing import Leaf, leaves
from steer_env.friction.sites import named
from steer_env.vehicle import cars, subsystems
from steer_env.vehicle.subsystems import Subsystem

# Of a triple with three parts LLVM takes the second for the vendor, and passes floats in the registers of integers.
TRIPLE, CPU = "thumbv7em-unknown-none-eabihf", "cortex-m7"
TEMPLATES = ("steering.h", "steering.c", "steering_example.c")


class Member(NamedTuple):
    """A member of a struct of doubles."""

    declared: str  # its name, and the lengths of an array
    comment: str
    start: str  # value in C


def export_object(
    folder: str | Path,
    *,
    friction: Any = None,
    vehicle: Any = "compact",
    speed: float = 100.0 / 3.6,
    robot: bool = False,
) -> Path:
    """Write ``steering_kernels.o``, ``steering.h``, ``steering.c`` and ``steering_example.c`` for a Cortex-M7.

    Its floating-point unit must have double precision, and the firmware passes floats in its registers
    (``-mcpu=cortex-m7 -mfpu=fpv5-d16 -mfloat-abi=hard``). The steering advances by 1 ms in a call.

    Parameters
    ----------
    folder : str or Path
        Is made where it is missing; files with these names are replaced.
    friction : str, mapping or parameters
        A friction law, or sites, as :func:`steer_env.friction.resolve` takes them.
    vehicle : str, path, mapping or Car
        A car, or what makes one, as :func:`steer_env.vehicle.cars.load` takes it.
    speed : float
        Start value of the vehicle's speed, an input [m/s].
    robot : bool
        Start value of the parameter ``robot``: whether the handwheel angle is prescribed, and not the hand torque.

    Returns
    -------
    Path
        The folder.

    Raises
    ------
    ValueError
        A bad value, or kernels that are not compiled (``NUMBA_DISABLE_JIT=1``).
    """
    from jinja2 import Environment, FileSystemLoader

    car = vehicle if isinstance(vehicle, cars.Car) else cars.load(vehicle)
    p = car.plant(friction, speed, robot)
    made = subsystems.make("steering", p, speed)
    listed = variables(made, 2)
    name = car.name.replace("*/", "* /")  # which would end the comment
    told = {
        "told": f"Car {name}, friction law {named(p.friction)}; steer-env {metadata.version('steer-env')}.",
        "inputs": [_scalar(v) for v in listed if v.use == "INPUT"],
        "outputs": [_scalar(v) for v in listed if v.use == "OUTPUT"],
        "parameters": parameters(made),
        "states": made.start.size,
    }
    templates = Environment(
        loader=FileSystemLoader(Path(__file__).parent / "templates"),
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    files = {name: templates.get_template(name).render(told).encode() for name in TEMPLATES}
    files["steering_kernels.o"] = object_for(module_text(made), TRIPLE, CPU)
    Path(folder).mkdir(parents=True, exist_ok=True)
    for name, contents in files.items():
        (Path(folder) / name).write_bytes(contents)
    return Path(folder)


def parameters(subsystem: Subsystem) -> list[Member]:
    """Members of the struct of all numbers, in their order; those that belong to the chassis are one for each stretch.

    What a user may change is what an FMU has as a parameter.
    """
    known = {v.place: v for v in variables(subsystem, 2) if v.array == "NUMBERS"}
    found = []
    numbers = (leaf for leaf in leaves(subsystem.parameters) if not leaf.table)
    for own, stretch in groupby(numbers, lambda leaf: leaf.path[0] in subsystem.sections):
        members = list(stretch)
        if own:
            found += [_member(leaf, known.get(leaf.start)) for leaf in members]
        else:
            size = sum(leaf.size for leaf in members)
            found.append(Member(f"unused_{members[0].start}[{size}]", "of the chassis: has no effect", "{0.0}"))
    return found


def _scalar(v: Variable) -> Member:
    return Member(v.name.replace(".", "_"), f"{v.description} [{v.unit}]" if v.unit else v.description, _c(v.start))


def _member(leaf: Leaf, known: Variable | None) -> Member:
    """A leaf with the comment beside its field, or as the variable that it is in an FMU."""
    shape = "".join(f"[{n}]" for n in np.shape(leaf.value))
    if known and not shape:
        return _scalar(known)
    text, unit = described(leaf, leaf.path[-1], leaf.owner)
    kept = "" if known else ", not to be changed"
    return Member("_".join(leaf.path) + shape, f"{text}{kept} [{unit}]" if unit else f"{text}{kept}", _c(leaf.value))


def _c(value: Any) -> str:
    """A float or an array of floats in C, without loss."""
    return f"{{{', '.join(map(_c, value))}}}" if np.ndim(value) else repr(float(value))
