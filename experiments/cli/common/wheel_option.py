"""The option that describes a force-feedback wheel, and what it tells."""

import argparse
import math
from typing import Any


def add(parser: argparse.ArgumentParser, where: str = "") -> None:
    """Add ``--wheel`` to a parser; ``where`` says in which mode it counts."""
    text = (
        f"{where}inertia [kg m2], damping [N m s/rad] and delay [ms] of a force-feedback wheel: prints the longest "
        "delay with which it is stable, and reduces the torque where its own is longer"
    )
    parser.add_argument("--wheel", metavar="J,B,MS", type=_wheel, help=text)


def _wheel(text: str) -> tuple[float, float, float]:
    """Inertia [kg m2], damping [N m s/rad] and delay [s] of a wheel from text."""
    try:
        inertia, damping, delay = map(float, text.split(","))
    except ValueError:
        form = "inertia, damping and delay, as in 0.04,0.5,8"
        raise argparse.ArgumentTypeError(f"expected three numbers, {form}, got {text!r}") from None
    return inertia, damping, 1e-3 * delay


def sentence(found: Any) -> str:
    """What a wheel may do, from :func:`steer_env.live.real_time.stability`."""
    from steer_env.live.real_time.haptics import MARGIN

    longest = f"delays of up to {1e3 * found.longest_delay:.1f} ms"
    longest = longest if math.isfinite(found.longest_delay) else "every delay"
    longest = longest if found.longest_delay >= 0.0 else "no delay"
    return (
        f"the wheel is stable with {longest}; with its own it gives {found.share:.0%} of the torque, at most "
        f"{MARGIN:.0%} of what oscillates"
    )
