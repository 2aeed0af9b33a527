"""The documentation page and the icon that a unit contains."""

import io
from importlib import metadata
from pathlib import Path

import numpy as np

from steer_env.connect.fmu.description import STEP_NOTE
from steer_env.connect.fmu.object_code import Processor
from steer_env.connect.fmu.variables import Variable
from steer_env.vehicle.steering.eps import SAMPLE_TIME
from steer_env.vehicle.subsystems import Subsystem

_GROUPS = {
    "Inputs": "INPUT",
    "Outputs": "OUTPUT",
    "Tunable parameters": "TUNABLE",
    "Fixed parameters": "FIXED",
    "Constants": "CONSTANT",
    "Independent variable": "INDEPENDENT",
}
_SIZE = 100  # of the icon [pixels]


def page(subsystem: Subsystem, variables: list[Variable], processor: Processor, told: str) -> str:
    """The page as HTML."""
    from jinja2 import Environment, FileSystemLoader

    folder = Path(__file__).parent / "templates"
    listed = {heading: [v for v in variables if v.use == use] for heading, use in _GROUPS.items()}
    return (
        Environment(loader=FileSystemLoader(folder), autoescape=True, trim_blocks=True, lstrip_blocks=True)
        .get_template("index.html")
        .render(
            title=subsystem.title,
            told=told,
            step_note=STEP_NOTE,
            settling=f"{subsystem.settling * SAMPLE_TIME:g}",
            processor=processor.name,
            groups=[(heading, group) for heading, group in listed.items() if group],
            version=metadata.version("steer-env"),
        )
    )


def icon() -> bytes:
    """A handwheel with three spokes, as PNG."""
    from matplotlib.image import imsave

    y, x = np.mgrid[-1.0 : 1.0 : _SIZE * 1j, -1.0 : 1.0 : _SIZE * 1j]
    radius = np.hypot(x, y)
    rim, hub = np.abs(radius - 0.8) < 0.12, radius < 0.25
    spokes = (radius < 0.8) & ((np.abs(y) < 0.08) | ((np.abs(x) < 0.08) & (y > 0.0)))
    image = np.zeros((_SIZE, _SIZE, 4))
    image[rim | hub | spokes] = (0.13, 0.29, 0.53, 1.0)
    file = io.BytesIO()
    imsave(file, image, format="png")
    return file.getvalue()
