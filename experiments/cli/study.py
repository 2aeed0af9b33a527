"""The command ``study``: one of the studies behind the report and the documentation."""

import argparse
import importlib
from typing import Any

from steer_env.experiments.cli.common.extras import require
from steer_env.experiments.cli.common.sweeping import add_sweep, runner
from steer_env.friction.numerics.registry import dashed, listed

SWEEPING = ("coupling", "friction", "hands-off", "held-torque", "loop-width")  # studies of many cases
EXTRAS = {"commonroad": "test", "coupling": "fmu"}  # study -> the extra that it needs


def add(commands: Any, common: argparse.ArgumentParser) -> None:
    """Add the command to a parser's."""
    studies = listed("steer_env.experiments.studies", dashed)
    text = "Run a study and print its table or write its picture."
    more = f"{text} Studies: {', '.join(studies)}. 'steer-env study NAME --help' tells the options of one."
    more += f" {', '.join(SWEEPING)} also take {_sweep_parser('NAME').format_usage().partition('NAME ')[2].strip()}."
    study = commands.add_parser("study", help=text, description=more, parents=[common])
    study.add_argument("name", metavar="NAME", choices=tuple(studies), help="name of the study")
    study.add_argument("options", metavar="...", nargs=argparse.REMAINDER, help="options of the study")
    # 'rerun' gives the place of the result and the car of its trace
    study.set_defaults(function=lambda args: _study(args, studies[args.name]), out="", vehicle=None)


def _study(args: argparse.Namespace, module: str) -> int | None:
    if args.name in EXTRAS:
        require(EXTRAS[args.name], f"the study {args.name}")
    main, words = importlib.import_module(module).main, [*args.options, *(["--out", args.out] if args.out else [])]
    if args.name not in SWEEPING:
        return main(words)
    given = argparse.Namespace(modules=args.modules)
    chosen, options = _sweep_parser(args.name).parse_known_args(words, given)
    if args.vehicle is not None:
        from steer_env.vehicle import cars

        return main(options, runner(chosen), cars.load(args.vehicle))
    return main(options, runner(chosen))


def _sweep_parser(name: str) -> argparse.ArgumentParser:
    """A parser of the options that say where the cases of a study run; the study's own parser reads the others."""
    parser = argparse.ArgumentParser(prog=f"steer-env study {name}", add_help=False, allow_abbrev=False)
    add_sweep(parser)
    return parser
