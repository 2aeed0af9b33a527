"""Run one of the studies behind the report and the documentation.

'steer-env study NAME --help' tells the options of one.
"""

import argparse
import importlib
from collections.abc import Callable

from steer_env.experiments.cli.common import options
from steer_env.experiments.cli.common.sweeping import add_sweep, runner
from steer_env.friction.numerics.registry import modules_by_name, with_dashes

GROUP = "test"
STUDIES = modules_by_name("steer_env.experiments.studies", with_dashes)
SWEEPING = ("architecture", "friction", "friction-sites", "held-torque", "loop-width")  # studies of many cases


def add(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    words = _sweep_parser("NAME").format_usage().partition("NAME ")[2].strip()
    parser.epilog = f"Every study takes --figures DIR; {', '.join(SWEEPING)} also take {words}."
    parser.add_argument("name", metavar="NAME", choices=tuple(STUDIES), help=f"the study: {', '.join(STUDIES)}")
    parser.add_argument("options", metavar="...", nargs=argparse.REMAINDER, help="options of the study")
    # 'rerun' gives the place of the result and the car of its trace
    parser.set_defaults(out="", vehicle=None)


def run(args: argparse.Namespace) -> int | None:
    """Run the study; its exit code."""
    from steer_env.experiments.cli.main import without_imports

    main = importlib.import_module(STUDIES[args.name]).main
    modules, given = without_imports(args.options)  # which may stand before the name, too
    prog = f"steer-env study {args.name}"
    parser = argparse.ArgumentParser(prog=prog, usage=argparse.SUPPRESS, add_help=False, allow_abbrev=False)
    options.add_figures(parser.add_argument_group("pictures"))
    pictures, words = parser.parse_known_args([*given, *(["--out", args.out] if args.out else [])])
    try:
        with options.figures(pictures):
            return _study(args, main, words, [*args.modules, *modules])
    except SystemExit as stop:
        if not stop.code:  # behind the help that the study itself has printed
            if args.name in SWEEPING:
                add_sweep(parser)
            print(f"\n{parser.format_help()}", end="")
        raise


def _study(
    args: argparse.Namespace, main: Callable[..., int | None], words: list[str], modules: list[str]
) -> int | None:
    if args.name not in SWEEPING:
        return main(words)
    chosen, others = _sweep_parser(args.name).parse_known_args(words, argparse.Namespace(modules=modules))
    sweep = runner(chosen)
    args.stores = chosen.stores
    if args.vehicle is not None:
        from steer_env.vehicle import cars

        return main(others, sweep, cars.load(args.vehicle))
    return main(others, sweep)


def _sweep_parser(name: str) -> argparse.ArgumentParser:
    """A parser of the options that say where the cases of a study run; the study's own parser reads the others."""
    parser = argparse.ArgumentParser(prog=f"steer-env study {name}", add_help=False, allow_abbrev=False)
    add_sweep(parser)
    return parser
