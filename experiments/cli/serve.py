"""Serve the car, its steering or its chassis to another program over UDP.

It answers step by step, or runs freely in real time. It compiles, takes its port and prints "ready", in this order: a
client that is started before finds nothing at the port.
"""

import argparse
import json
import math
import sys
from typing import Any

from steer_env.experiments.cli.common import options
from steer_env.experiments.cli.common.options import KPH, TORQUE
from steer_env.experiments.pages import car_options

GROUP = "couple"

# As in steer_env.connect.udp, whose import takes long.
FORMATS = ("text", "json", "c")
LOOPBACK = "127.0.0.1"
SILENCE = 10.0  # [s]


def add(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    options.add_plant(
        parser,
        speed="that is held, and start value of the vehicle_speed that the steering takes",
        hands="; those of the other program",
    )
    text = "port (default: 0, a free one, which is printed)"
    parser.add_argument("--port", metavar="N", type=options.whole_number(0, 65535), default=0, help=text)
    text = f"address of this machine at which to receive (default: {LOOPBACK}, programs on this machine only)"
    parser.add_argument("--address", metavar="HOST", default=LOOPBACK, help=text)
    text = "samples of 1 ms that follow the clock, with the last inputs, and not steps that the other program asks for"
    parser.add_argument("--free-running", action="store_true", help=text)
    options.add(parser, "--torque-limit", ", only with --free-running", otherwise=f"{TORQUE:g}")
    options.add(parser, "--wheel", "; only with --free-running")
    options.add(parser, "--priority", ", only with --free-running", 0, otherwise="that of every program")
    text = f"seconds without a packet after which a session ends (default: {SILENCE:.0f})"
    parser.add_argument("--silence", metavar="S", type=options.real, default=SILENCE, help=text)
    text = "print the layout of the packets and end; c is a header file"
    parser.add_argument("--describe", nargs="?", choices=FORMATS, const="text", help=text)
    text = "print JSON: one line when it is ready, one with the counts at the end"
    parser.add_argument("--json", action="store_true", help=text)


def run(args: argparse.Namespace) -> None:
    """Serve until it is ended, or describe the packets."""
    from steer_env.connect import udp as cosimulation
    from steer_env.connect.udp.server import MEANINGS
    from steer_env.friction.numerics.check import number
    from steer_env.live.real_time import Limits, haptics
    from steer_env.vehicle import subsystems

    silence = number("--silence", args.silence, minimum=0.0, above=True, maximum=1e6)
    speed = args.speed_kph * KPH
    robot = args.hands == "angle"
    car = car_options.load(args)
    law = options.friction(args, car).parameters
    p = car.plant(law, speed, robot, args.road_friction, args.chassis)
    subsystem = subsystems.make(args.subsystem, p, speed)
    if args.describe:
        sys.stdout.write(cosimulation.describe(cosimulation.layout_of(subsystem), args.describe))
        return
    mode = "free-running" if args.free_running else "lockstep"
    real_time = {"--torque-limit": args.torque_limit is not None, "--wheel": args.wheel, "--priority": args.priority}
    if not args.free_running and any(real_time.values()):
        given = ", ".join(option for option, value in real_time.items() if value)
        raise ValueError(f"{given}: only with --free-running, as nothing is real time in lockstep")
    torque = TORQUE if args.torque_limit is None else args.torque_limit
    limits = Limits(torque=number("--torque-limit", torque, minimum=0.0, maximum=50.0))
    found = haptics.stability(subsystem, haptics.make(*args.wheel)) if args.wheel else None
    if found:
        limits = limits._replace(share=found.share)
    server = cosimulation.Server(
        subsystem, args.address, args.port, silence, mode=mode, limits=limits, priority=args.priority
    )
    try:
        with server:
            _announce(args, server, found)
            server.wait()
    except KeyboardInterrupt:  # how a server ends
        pass
    counts = server.counts()
    if args.json:
        print(json.dumps({"counts": counts}))
    else:
        happened = {name: count for name, count in counts.items() if count}
        width = max(map(len, happened), default=0)
        for name, count in happened.items():
            print(f"{name:{width}s}  {count:9d}  {MEANINGS[name]}")
        print("nothing else was counted" if happened else "no datagram arrived")


def _announce(args: argparse.Namespace, server: Any, found: Any) -> None:
    """Say that the server is ready and where it receives, which a program that starts it reads; what a wheel may do."""
    from steer_env.live.real_time.haptics import MARGIN

    (address, port), layout = server.address, server.layout
    if args.json:
        told: dict[str, Any] = {
            "part": args.subsystem,
            "mode": server.mode,
            "address": address,
            "port": port,
            "layout": layout.fingerprint,
        }
        if found:
            delay = found.longest_delay if math.isfinite(found.longest_delay) else None
            told["wheel"] = {"longest_delay_s": delay, "share": found.share, "margin": MARGIN}
        print(json.dumps(told), flush=True)
        return
    if found:
        print(options.wheel_verdict(found))
    print(
        f"ready: {args.subsystem} at {address}, port {port}, {server.mode}: requests of {layout.request_size} bytes, "
        f"answers of {layout.answer_size}, layout 0x{layout.fingerprint:08x}; Ctrl-C ends it",
        flush=True,
    )
