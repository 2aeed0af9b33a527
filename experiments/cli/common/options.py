"""Options that several commands have, each declared once, so that it means the same in every command."""

import argparse
import math
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from steer_env.experiments.cli.common import extras, names
from steer_env.experiments.learning.constants import HELD_OUT, SHIPPED, VALIDATION
from steer_env.experiments.pages import car_options
from steer_env.experiments.pages.options import FRICTION, SITES, Friction
from steer_env.recording import csv_file

if TYPE_CHECKING:
    from steer_env.experiments.explore.beside import PageBeside
    from steer_env.vehicle.cars import Car

KPH = 1.0 / 3.6  # [m/s]
MOST_EPISODES = VALIDATION - HELD_OUT  # with more, the evaluation would use the seeds of the validation
EXTERNAL = "an external vehicle: an FMU (.fmu), or a mapping (.toml) that names one (docs/fmu.md)"
TORQUE = 8.0  # default largest torque of a motor at the handwheel [N m]
SUBSYSTEMS = ("car", "steering", "chassis")  # as in steer_env.vehicle.subsystems, whose import takes long

__all__ = [
    "EXTERNAL",
    "KPH",
    "MOST_EPISODES",
    "SHIPPED",
    "SUBSYSTEMS",
    "TORQUE",
    "add",
    "add_csv",
    "add_evaluation",
    "add_figures",
    "add_noticed",
    "add_out",
    "add_page",
    "add_plant",
    "chassis",
    "external_vehicle",
    "figures",
    "friction_law",
    "noticeable_share",
    "real",
    "wheel_verdict",
    "whole_number",
]


def friction_law(text: str) -> Friction:
    """A friction law with its parameters, ``LAW[,key=value...]``, or several sites."""
    try:
        return Friction(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


OF_CAR = "LuGre at the sites of the car's steering"  # the friction of a car where none is given


def friction(args: argparse.Namespace, car: "Car") -> Friction:
    """The friction that ``--friction`` gives, else that of the car."""
    return args.friction or Friction(car.friction)


def chassis(text: str) -> str:
    """The name of a chassis of this project, or the file of an external vehicle."""
    known = names.chassis()
    return text if text in known else external_vehicle(text, f"{', '.join(known)} or ")


def external_vehicle(text: str, others: str = "") -> str:
    """The file of an external vehicle."""
    from steer_env.vehicle.chassis import is_external

    if not is_external(text):
        raise argparse.ArgumentTypeError(f"expected {others}{EXTERNAL}, got {text!r}")
    if not Path(text).is_file():
        raise argparse.ArgumentTypeError(f"there is no file {text}")
    return text


def whole_number(least: int, most: float = math.inf) -> Callable[[str], int]:
    """A type of options: whole numbers from ``least`` to ``most``."""

    def read(text: str) -> int:
        try:
            value = int(text)
            if least <= value <= most:
                return value
        except ValueError:
            pass
        upper = f" and at most {most:.0f}" if most < math.inf else ""
        raise argparse.ArgumentTypeError(f"must be a whole number of at least {least}{upper}, got {text!r}")

    return read


def real(text: str) -> float:
    """A number; what is allowed depends on the command, which says it."""
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"must be a number, got {text!r}") from None


def _wheel(text: str) -> tuple[float, float, float]:
    """Inertia [kg m2], damping [N m s/rad] and delay [s] of a wheel from text."""
    try:
        inertia, damping, delay = map(float, text.split(","))
    except ValueError:
        form = "inertia, damping and delay, as in 0.04,0.5,8"
        raise argparse.ArgumentTypeError(f"expected three numbers, {form}, got {text!r}") from None
    return inertia, damping, 1e-3 * delay


class _Declaration(NamedTuple):
    """What an option is in every command that has it."""

    text: str
    metavar: str
    type: Callable[[str], Any] | None = None


OPTIONS = {
    "--budget": _Declaration("number of candidates", "N", whole_number(1)),
    "--chassis": _Declaration("chassis model", "CHASSIS"),
    "--env": _Declaration("environment", "ID"),
    "--episodes": _Declaration("number of episodes", "N", whole_number(1)),
    "--friction": _Declaration(f"friction law: {FRICTION}; or sites, {SITES}", "LAW", friction_law),
    "--held-out": _Declaration("share of the record, its last part, that judges and is not fitted", "SHARE", real),
    "--law": _Declaration("laws to fit", "LAW"),
    "--hands": _Declaration("what the hands give", "GIVEN"),
    "--live": _Declaration("also write a page with sliders (explore) into live of --out, and link to it", ""),
    "--manoeuvre": _Declaration(f"the test: {', '.join(names.manoeuvres())}", "TEST"),
    "--parameters": _Declaration("parameters that are varied", "NAME"),
    "--subsystem": _Declaration("the whole car, its steering or its chassis", "NAME"),
    "--priority": _Declaration("priority of the loop, 1 to 99 of the scheduler SCHED_FIFO", "N", whole_number(1, 99)),
    "--rate-hz": _Declaration("samples a second", "HZ", real),
    "--road-friction": _Declaration("friction of the road over that of the tyre measurements", "MU", real),
    "--seconds": _Declaration("duration [s]", "S", real),
    "--seed": _Declaration("seed", "N", whole_number(0)),
    "--speed-kph": _Declaration("speed [km/h]", "KPH", real),
    "--steps": _Declaration("steps of the training", "N", whole_number(0)),
    "--targets": _Declaration(f"target bands: {', '.join(names.targets())}, or a .toml file", "NAME"),
    "--template": _Declaration(
        "write a mapping to fill in, which lists every column of the recording with its unit and range, and do no more",
        "FILE.toml",
    ),
    "--torque-limit": _Declaration("largest torque of a motor at the handwheel [N m]", "NM", real),
    "--wheel": _Declaration(
        "inertia [kg m2], damping [N m s/rad] and delay [ms] of a force-feedback wheel: prints the longest delay with "
        "which it is stable, and reduces the torque where its own is longer",
        "J,B,MS",
        _wheel,
    ),
}


def add(
    parser: argparse._ActionsContainer,
    name: str,
    about: str = "",
    default: Any = None,
    otherwise: str = "",
    **more: Any,
) -> None:
    """Add a declared option to a parser.

    Parameters
    ----------
    parser : argument parser or group
    name : str
        Its name, a key of :data:`OPTIONS`.
    about : str
        What the command adds to the meaning that the declaration gives, which goes on in the same sentence.
    default : optional
    otherwise : str
        What holds without the option, where its default value does not say that.
    more
        Further arguments of ``add_argument``.
    """
    declared = OPTIONS[name]
    choices = f": {', '.join(map(str, more['choices']))}" if "choices" in more and ": " not in declared.text else ""
    joint = "" if about.startswith((",", ";", ":")) else " "
    shown = otherwise or (f"{default:g}" if isinstance(default, float) else default)
    text = f"{declared.text}{choices}{about and joint + about}" + (f" (default: {shown})" if shown is not None else "")
    kind = {"type": declared.type} if declared.type else {}
    parser.add_argument(name, **{"metavar": declared.metavar, "default": default, "help": text, **kind, **more})


def add_out(
    parser: argparse.ArgumentParser,
    what: str,
    default: str | None = None,
    form: str = "DIR",
    otherwise: str = "",
    **more: Any,
) -> None:
    """Add ``--out``; ``form`` says whether it is a directory, ``DIR``, or a file, as in ``FILE.json``."""
    kind = "directory" if form == "DIR" else "file"
    shown = otherwise or default
    text = f"{kind} {what}" + (f" (default: {shown})" if shown else "")
    parser.add_argument("--out", metavar=form, type=Path, default=default and Path(default), help=text, **more)


def add_page(
    parser: argparse.ArgumentParser, what: str, default: str | None = None, otherwise: str = "", full: bool = False
) -> None:
    """Add ``--out`` for a page, ``--figures``, and with ``full`` the option ``--full`` for interactive plots."""
    add_out(parser, what, default, otherwise=otherwise)
    add_figures(parser)
    if full:
        text = "interactive plots in place of pictures; the page has some 5 MB or more"
        parser.add_argument("--full", action="store_true", help=text)


def add_live(parser: argparse._ActionsContainer, of: str) -> None:
    """Add ``--live``; the text says what the page with sliders is of."""
    parser.add_argument("--live", action="store_true", help=f"{OPTIONS['--live'].text}: {of}")


def live_page_beside(args: argparse.Namespace) -> "type[PageBeside] | None":
    """What is written beside a page, None without ``--live``; ValueError where its extra is missing."""
    if not args.live:
        return None
    extras.require("explore", "--live")

    from steer_env.experiments.explore.beside import PageBeside

    return PageBeside


def add_figures(parser: argparse._ActionsContainer) -> None:
    """Add ``--figures`` and ``--csv-decimal``."""
    text = "also write every picture into this directory, as SVG, PDF and PNG with its data as CSV"
    parser.add_argument("--figures", metavar="DIR", type=Path, help=text)
    add_csv(parser)


def add_csv(parser: argparse._ActionsContainer) -> None:
    """Add ``--csv-decimal``, which every command that writes CSV files has."""
    text = "decimal sign of the CSV files that are written; with ',' the columns are separated by ';' (default: .)"
    parser.add_argument("--csv-decimal", metavar="SIGN", choices=tuple(csv_file.SEPARATORS), default=".", help=text)


@contextmanager
def figures(args: argparse.Namespace) -> Iterator[None]:
    """The context in which pictures are also written where ``--figures`` says, and tables as ``--csv-decimal`` says.

    Raises
    ------
    ValueError
        If the directory cannot be written.
    """
    with ExitStack() as stack:
        if getattr(args, "csv_decimal", ".") != ".":
            from steer_env.experiments.pages import files

            stack.enter_context(files.csv_decimal(args.csv_decimal))
        if getattr(args, "figures", None) is not None:
            from steer_env.experiments.pages import files, style

            files.usable(args.figures)
            stack.enter_context(style.picture_folder(args.figures))
        yield


def add_evaluation(parser: argparse.ArgumentParser, out: str) -> None:
    """Add the options of an evaluation on held-out episodes: how many, and where its report goes."""
    add(parser, "--episodes", "held out from every training", 200, type=whole_number(1, MOST_EPISODES))
    add_page(parser, "of the report, replaced as a whole", out)


def add_plant(parser: argparse.ArgumentParser, speed: str, hands: str) -> None:
    """Add the options that choose a subsystem for other tools; the texts say what speed and hands are for."""
    add(parser, "--subsystem", default="car", choices=SUBSYSTEMS)
    add(parser, "--friction", otherwise=OF_CAR)
    car_options.add(parser)
    add(parser, "--chassis", default="single_track", choices=names.chassis())
    add(parser, "--speed-kph", speed, 100.0)
    add(parser, "--road-friction", default=1.0)
    add(parser, "--hands", hands, "torque", choices=("torque", "angle"))


def add_noticed(parser: argparse.ArgumentParser) -> None:
    """Add ``--noticed-percent``, which every command with differences has; :func:`noticeable_share` reads it."""
    text = (
        "a sustained handwheel torque or angle that differs by this much is perceptible [%%] (default: 15, after "
        "Newberry, Griffin and Dowson 2007)"
    )
    parser.add_argument("--noticed-percent", metavar="P", type=real, help=text)


def noticeable_share(args: argparse.Namespace) -> float:
    """The just-noticeable difference [1]; ValueError for a share that is not above 0."""
    from steer_env.friction.numerics.check import number
    from steer_env.metrics.common import just_noticeable

    if args.noticed_percent is None:
        return just_noticeable.SHARE
    return 0.01 * number("--noticed-percent", args.noticed_percent, minimum=0.0, maximum=1000.0, above=True)


def wheel_verdict(found: Any) -> str:
    """What a wheel may do, from :func:`steer_env.live.real_time.stability`."""
    from steer_env.live.real_time.haptics import MARGIN

    longest = f"delays of up to {1e3 * found.longest_delay:.1f} ms"
    longest = longest if math.isfinite(found.longest_delay) else "every delay"
    longest = longest if found.longest_delay >= 0.0 else "no delay"
    return (
        f"the wheel is stable with {longest}; with its own it gives {found.share:.0%} of the torque, at most "
        f"{MARGIN:.0%} of what oscillates"
    )
