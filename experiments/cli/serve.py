"""The command ``serve``: a part of the plant behind a port, for tools that speak no FMI."""

import argparse
import json
import sys
from typing import Any

from steer_env.experiments.cli.common import plant_options
from steer_env.experiments.cli.common.arguments import KPH, whole_number
from steer_env.experiments.output import car_options

# As in steer_env.cosimulation, whose import takes long.
FORMATS = ("text", "json", "c")
LOOPBACK = "127.0.0.1"
SILENCE = 10.0  # [s]


def add(commands: Any, common: argparse.ArgumentParser) -> None:
    """Add the command to a parser's."""
    text = "Serve the car, its steering or its chassis to another program, over UDP and step by step, until Ctrl-C."
    serve = commands.add_parser("serve", help=text, description=text, parents=[common])
    plant_options.add(
        serve,
        part="what is served",
        speed="held speed, and start value of the vehicle_speed that the steering takes",
        hands="what the hands of the other program give",
    )
    text = "port (default 0: a free one, which is printed)"
    serve.add_argument("--port", metavar="N", type=whole_number(0, 65535), default=0, help=text)
    text = f"address of this machine at which to receive (default {LOOPBACK}: programs on this machine only)"
    serve.add_argument("--address", metavar="HOST", default=LOOPBACK, help=text)
    text = f"seconds without a packet after which a session ends (default {SILENCE:.0f})"
    serve.add_argument("--silence", metavar="S", type=float, default=SILENCE, help=text)
    text = "print the layout of the packets and end; c is a header file"
    serve.add_argument("--describe", nargs="?", choices=FORMATS, const="text", help=text)
    text = "print JSON: one line at the start, one with the counts at the end"
    serve.add_argument("--json", action="store_true", help=text)
    serve.set_defaults(function=_serve)


def _serve(args: argparse.Namespace) -> None:
    from steer_env import cosimulation
    from steer_env.cosimulation.session import COUNTS
    from steer_env.fmu.parts import make_part
    from steer_env.friction.numerics.check import number

    silence = number("--silence", args.silence, minimum=0.0, above=True, maximum=1e6)
    speed = args.speed_kph * KPH
    robot = args.hands == "angle"
    p = car_options.load(args).plant(args.friction.parameters, speed, robot, args.road_friction, args.chassis)
    part = make_part(args.part, p, speed)
    if args.describe:
        sys.stdout.write(cosimulation.describe(cosimulation.layout_of(part), args.describe))
        return
    server = cosimulation.Server(part, args.address, args.port, silence)
    try:
        with server:
            _announce(args, server)
            server.wait()
    except KeyboardInterrupt:  # how a server ends
        pass
    counts = server.counts()
    if args.json:
        print(json.dumps({"counts": counts}))
    else:
        width = max(map(len, counts))
        for name, count in counts.items():
            print(f"{name:{width}s}  {count:9d}  {COUNTS[name]}")


def _announce(args: argparse.Namespace, server: Any) -> None:
    """Say where the server receives, which a program that starts it reads."""
    (address, port), layout = server.address, server.layout
    if args.json:
        told = {"part": args.part, "address": address, "port": port, "layout": layout.fingerprint}
        print(json.dumps(told), flush=True)
        return
    print(
        f"{args.part} at {address}, port {port}, in lockstep: requests of {layout.request_size} bytes, answers of "
        f"{layout.answer_size}, layout 0x{layout.fingerprint:08x}; Ctrl-C ends it",
        flush=True,
    )
