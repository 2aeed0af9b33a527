"""The command ``real-time``: the loop in real time without a person, on this machine."""

import argparse
from pathlib import Path
from typing import Any

from steer_env.experiments.cli.common import names
from steer_env.experiments.cli.common.arguments import FRICTION, friction_law, whole_number
from steer_env.experiments.pages import car_options


def add(commands: Any, common: argparse.ArgumentParser) -> None:
    """Add the command to a parser's."""
    text = (
        "Run the loop of 'steer-env drive' and 'serve --free-running' without a person, and write a page of how it "
        "keeps its deadlines on this machine beside a bare loop, with and without priority, what a sample takes, and "
        "the latency through a fake wheel, a virtual CAN bus and UDP."
    )
    command = commands.add_parser("real-time", help=text, description=text, parents=[common])
    text = "seconds that the loop runs in all (default 60)"
    command.add_argument("--seconds", metavar="S", type=float, default=60.0, help=text)
    text = f"{FRICTION} (default: every packaged law)"
    command.add_argument("--friction", metavar="LAW", nargs="+", action="extend", type=friction_law, help=text)
    kinds = names.chassis()
    text = f"default: {' '.join(kinds)}"
    command.add_argument("--chassis", nargs="+", choices=kinds, default=list(kinds), help=text)
    car_options.add(command)
    text = "priority 1 to 99 of the scheduler SCHED_FIFO (default: that of every program)"
    command.add_argument("--priority", metavar="N", type=whole_number(1, 99), default=0, help=text)
    command.add_argument("--lock-memory", action="store_true", help="keep the memory from being swapped out")
    text = "directory of the page, replaced as a whole (default real-time)"
    command.add_argument("--out", metavar="DIR", type=Path, default=Path("real-time"), help=text)
    command.set_defaults(function=_real_time)


def _real_time(args: argparse.Namespace) -> None:
    from steer_env import friction
    from steer_env.experiments.pages import provenance
    from steer_env.experiments.pages.options import progress
    from steer_env.experiments.pages.study_page import check, write
    from steer_env.experiments.verification import real_time_loop, real_time_page
    from steer_env.friction.numerics.check import number
    from steer_env.live.real_time.measure import lock_memory

    check(args.out, real_time_page.NAME)
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
