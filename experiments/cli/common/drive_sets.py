"""Options that choose the sets of a drive: cars with their laws and chassis, which a key exchanges."""

import argparse
import shlex
from typing import Any, NoReturn

from steer_env.experiments.cli.common import names
from steer_env.experiments.cli.common.arguments import FRICTION, KPH, friction_law
from steer_env.experiments.pages import car_options

MOST = 9  # sets, as there are keys 1 to 9
_KEYS = ("vehicle", "tyre", "set", "friction", "chassis")


class _Quiet(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        raise ValueError(message)


def add(parser: argparse.ArgumentParser) -> None:
    """Add the options to a parser."""
    text = f"{FRICTION}; several laws make several sets; laws: {', '.join(names.laws())} (default lugre)"
    parser.add_argument("--friction", metavar="LAW", nargs="+", action="extend", type=friction_law, help=text)
    car_options.add(parser)
    text = "chassis model (default two_track)"
    parser.add_argument("--chassis", choices=names.chassis(), default="two_track", help=text)
    text = (
        f"a further set by what differs from the first, as words of {', '.join(f'{key}=...' for key in _KEYS)}: "
        '--b "friction=dahl set=column.K_tb=143"; may be repeated'
    )
    parser.add_argument(
        "--b", dest="others", metavar="WORDS", action="append", default=[], type=_differences, help=text
    )
    text = "friction of the road over that of the tyre measurements (default 1)"
    parser.add_argument("--road-friction", metavar="MU", type=float, default=1.0, help=text)
    text = "speed that is held at the start, in km/h (default 100)"
    parser.add_argument("--speed-kph", metavar="V", type=float, default=100.0, help=text)


def _differences(text: str) -> argparse.Namespace:
    """What a further set has of its own, from words ``KEY=VALUE``."""
    parser = _Quiet(add_help=False, allow_abbrev=False)
    parser.add_argument("--friction", type=friction_law)
    parser.add_argument("--chassis", choices=names.chassis())
    car_options.add(parser, default=None)
    try:
        words = shlex.split(text)
        if not words:
            raise ValueError("it is empty")
        for word in words:
            if word.partition("=")[0] not in _KEYS or "=" not in word:
                raise ValueError(f"{word!r} is none of {', '.join(f'{key}=...' for key in _KEYS)}")
        found = parser.parse_args([f"--{word}" for word in words])
        found.label = ", ".join(word.partition("=")[2] for word in words)
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"{text!r}: {error}") from None
    return found


def make(args: argparse.Namespace, hands: str) -> tuple[list[Any], list[Any]]:
    """The sets of the options for a device's hands, each a set with what is told of it, and their cars."""
    from steer_env.live.drive.sets import car_set

    wanted = []
    laws = args.friction or [friction_law("lugre")]
    labels = [law.label for law in laws]
    for law in laws:
        words = [law.label if labels.count(law.label) == 1 else law.given, *([args.tyre] if args.tyre else [])]
        wanted.append((", ".join(words), args, law, args.chassis))
    for other in args.others:
        mixed = argparse.Namespace(
            vehicle=other.vehicle or args.vehicle,
            tyre=other.tyre or args.tyre,
            changes=[*(each for each in args.changes if each[0] not in dict(other.changes)), *other.changes],
        )
        wanted.append((other.label, mixed, other.friction or wanted[0][2], other.chassis or args.chassis))
    if len(wanted) > MOST:
        raise ValueError(f"{len(wanted)} sets are given, and there are keys for {MOST}: leave some out")
    sets, cars = [], []
    for label, options, law, chassis in wanted:
        car = car_options.load(options)
        changed = [f"{key}={value}" for key, value in options.changes] if options is args else []
        sets.append(
            car_set(
                ", ".join([label, *changed]),
                car,
                law.parameters,
                speed=args.speed_kph * KPH,
                hands=hands,
                chassis=chassis,
                road_friction=args.road_friction,
                law=law.label if law.label == law.text else f"{law.text.partition(',')[0]} of {law.label}",
            )
        )
        cars.append(car)
    return sets, cars
