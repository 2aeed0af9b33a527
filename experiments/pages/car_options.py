"""The options that choose a car: a packaged one or a file, its tyre, and single keys; quick to import."""

import argparse
from importlib.resources import files
from typing import TYPE_CHECKING, Any

from steer_env.friction.numerics import toml
from steer_env.friction.numerics.registry import modules_by_name

if TYPE_CHECKING:
    from steer_env.vehicle.cars import Car


def packaged_names() -> tuple[str, ...]:
    """Names of the packaged cars."""
    entries = files("steer_env.vehicle").joinpath("data", "cars").iterdir()
    return tuple(sorted(entry.name.removesuffix(".json") for entry in entries if entry.name.endswith(".json")))


def steerings() -> tuple[str, ...]:
    """Names of the kinds of steering."""
    return ("column_eps", *modules_by_name("steer_env.vehicle.steering.kinds"))


def setting(text: str) -> tuple[str, Any]:
    """A key of a car file and its value, from ``SECTION.KEY=VALUE`` with the value as in TOML."""
    key, equals, value = text.partition("=")
    if not equals:
        raise argparse.ArgumentTypeError(f"expected SECTION.KEY=VALUE, e.g. column.K_tb=143, got {text!r}")
    try:
        return key.strip(), toml.loads(f"value = {value}")["value"]
    except toml.TOMLDecodeError:
        forms = "a number, a list as [1, 2], or text in quotes"
        raise argparse.ArgumentTypeError(f"{key.strip()} takes {forms} (as in TOML), got {value!r}") from None


def add(
    parser: argparse.ArgumentParser,
    default: str | None = "compact",
    usual: str = "that of the environment or of the training",
) -> None:
    """Add the options of a car to a parser; :func:`load` makes the car of what they hold.

    ``usual`` says what is taken where there is no default.
    """
    text = f"{', '.join(packaged_names())}, or a .toml or .json file (default: {default or usual})"
    parser.add_argument("--vehicle", metavar="NAME", default=default, help=text)
    add_changes(parser)


def add_changes(parser: argparse.ArgumentParser) -> None:
    """Add ``--steering``, ``--tyre`` and ``--set`` to a parser that takes the car itself in another way."""
    text = "kind of steering; with rack_eps, compact is compact_rack_eps (default: that of the car)"
    parser.add_argument("--steering", choices=steerings(), help=text)
    text = "a tyre in place of the car's own: a file, or the name of a packaged tyre"
    parser.add_argument("--tyre", metavar="FILE.tir", help=text)
    text = "a key of the car in place of its own, SI units, e.g. column.K_tb=143; may be repeated"
    kept: dict[str, Any] = {"dest": "changes", "metavar": "SECTION.KEY=VALUE", "action": "append", "default": []}
    parser.add_argument("--set", type=setting, help=text, **kept)


def any_given(args: argparse.Namespace) -> bool:
    """Whether any option of a car was given, in a command that has no default car."""
    return any(each is not None for each in (args.vehicle, args.steering, args.tyre)) or bool(args.changes)


def load(args: argparse.Namespace) -> "Car":
    """The car of the options, with the errors of :func:`steer_env.vehicle.cars.load`."""
    from steer_env.vehicle import cars

    names = [key for key, _ in args.changes]
    if twice := next((key for key in names if names.count(key) > 1), None):
        raise ValueError(f"--set gives {twice} twice: give it once")
    if args.tyre is not None and "tyre" in names:
        raise ValueError("--tyre and --set tyre are both given: give one of them")
    changes = {**({} if args.tyre is None else {"tyre": args.tyre}), **dict(args.changes)}
    return cars.load(args.vehicle or "compact", changes, args.steering)
