"""Measure deadlines and latency of the loop of 'drive' and 'serve' on this machine.

The loop runs without a person. The page tells how it keeps its deadlines beside a bare loop, with and without priority,
what a sample takes, and the latency through a fake wheel, a virtual CAN bus and UDP.
"""

import argparse

from steer_env.experiments.cli.common import names, options
from steer_env.experiments.pages import car_options

GROUP = "drive"


def add(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    options.add(parser, "--seconds", "of the loop in all", 60.0)
    options.add(parser, "--friction", otherwise="every packaged law", nargs="+", action="extend")
    kinds = names.chassis()
    options.add(parser, "--chassis", default=list(kinds), otherwise="all of them", nargs="+", choices=kinds)
    car_options.add(parser)
    options.add(parser, "--priority", default=0, otherwise="that of every program")
    parser.add_argument("--lock-memory", action="store_true", help="keep the memory from being swapped out")
    options.add_page(parser, "of the page, replaced as a whole", "real-time")


def run(args: argparse.Namespace) -> None:
    """Measure, and write the page."""
    from steer_env import friction
    from steer_env.experiments.pages import provenance
    from steer_env.experiments.pages.options import progress
    from steer_env.experiments.pages.pages import check, write
    from steer_env.experiments.studies.common import real_time_loop, real_time_page
    from steer_env.friction.numerics.check import number
    from steer_env.live.real_time.measure import lock_memory

    check(args.out, real_time_page.PAGE_NAME)
    seconds = number("--seconds", args.seconds, minimum=1.0, maximum=86400.0)
    car = car_options.load(args)
    if args.friction:
        laws = {law.label: law.parameters for law in args.friction}
    else:
        laws = {law: friction.make(law) for law in friction.available()}
    if args.lock_memory:
        lock_memory()
    with progress("measuring") as notify:
        results = real_time_loop.collect(car, laws, args.chassis, seconds, args.priority, notify)
    for table in real_time_page.tables(results):
        cells = [list(table.head), *map(list, table.rows)]
        widths = [max(len(row[i]) for row in cells) for i in range(len(table.head))]
        print(table.caption)
        for row in cells:
            print("  ".join(f"{cell:{width}s}" for cell, width in zip(row, widths)).rstrip())
        print(f"{table.note}\n" if table.note else "")
    page = real_time_page.page(results, seconds, args.priority, args.lock_memory)
    trace = provenance.trace(command=args.argv, result=args.out.name, car=car, friction=laws)
    for sentence in page.timing:
        print(sentence)
    print(write(args.out, page, real_time_page.data(results), trace))
