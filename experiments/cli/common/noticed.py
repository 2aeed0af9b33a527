"""The option for what a driver notices, which every command with differences has."""

import argparse


def add(parser: argparse.ArgumentParser) -> None:
    """Add ``--noticed-percent`` to a parser; :func:`share` reads it."""
    text = (
        "a sustained handwheel torque or angle that differs by this much is perceptible [%%] (default 15, after "
        "Newberry, Griffin and Dowson 2007)"
    )
    parser.add_argument("--noticed-percent", metavar="P", help=text)


def share(args: argparse.Namespace) -> float:
    """The just-noticeable difference [1]; ValueError for a share that is not above 0."""
    from steer_env.friction.numerics.check import number, read_number
    from steer_env.metrics.common import just_noticeable

    if args.noticed_percent is None:
        return just_noticeable.SHARE
    percent = number("--noticed-percent", read_number(args.noticed_percent), minimum=0.0, maximum=1000.0, above=True)
    return 0.01 * percent
