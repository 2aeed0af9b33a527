"""Drive the car in real time with a wheel, gamepad, mouse or keyboard.

The drive is recorded. Law, car and assist can be changed meanwhile. 'steer-env evaluate' reads the recording.
"""

import argparse
import os
import shlex
import signal
import sys
import threading
import time
from typing import TYPE_CHECKING, Any, NoReturn

from steer_env.experiments.cli.common import names, options
from steer_env.experiments.cli.common.options import KPH, TORQUE
from steer_env.experiments.pages import car_options
from steer_env.friction.numerics.extras import install

if TYPE_CHECKING:
    from steer_env.live.devices import Device
    from steer_env.live.drive.session import Session

GROUP = "drive"
COURSES = ("plain", "double-lane-change", "obstacle-avoidance")  # of steer_env.live.drive.scene
NICE = -10  # of the threads of Python where the loop has a priority; assumed
MOST_CONFIGURATIONS = 9  # configurations, as there are keys 1 to 9
_CONFIGURATION_KEYS = ("vehicle", "tyre", "set", "friction", "chassis")


def add(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    text = f"the device, with its options (default: keyboard); devices: {', '.join(names.devices())}"
    parser.add_argument("--device", metavar="NAME[,KEY=VALUE...]", default="keyboard", help=text)
    parser.add_argument("--list-devices", action="store_true", help="list the devices with their options, and end")
    text = f"; several make several configurations, which keys exchange; laws: {', '.join(names.laws())}"
    options.add(parser, "--friction", text, otherwise=options.OF_CAR, nargs="+", action="extend")
    car_options.add(parser)
    options.add(parser, "--chassis", default="two_track", choices=names.chassis())
    text = (
        "a further configuration by what differs from the first, as words of "
        f"{', '.join(f'{k}=...' for k in _CONFIGURATION_KEYS)}: "
        '--b "friction=dahl set=column.K_tb=143"; may be repeated'
    )
    parser.add_argument(
        "--b", dest="others", metavar="WORDS", action="append", default=[], type=_differences, help=text
    )
    options.add(parser, "--road-friction", default=1.0)
    options.add(parser, "--speed-kph", "that is held at the start", 100.0)
    text = "what stands on the road (default: plain, nothing)"
    parser.add_argument("--course", choices=COURSES, default=COURSES[0], help=text)
    options.add_out(parser, "of the recordings, of which each drive adds one", "drives")
    text = "; so that 'steer-env evaluate' knows it"
    options.add(parser, "--manoeuvre", text, otherwise="none", choices=names.manoeuvres())
    parser.add_argument("--headless", action="store_true", help="no window")
    text = "take commands from standard input, one a line: swap, set_1 to set_9, faster, slower, recentre, ..."
    parser.add_argument("--commands", action="store_true", help=text)
    options.add(parser, "--seconds", "after which the drive ends", otherwise="when you end it")
    options.add(parser, "--torque-limit", default=TORQUE)
    options.add(parser, "--wheel")
    text = "torque only while the dead-man key is held (space, or a button of the device)"
    parser.add_argument("--dead-man", action="store_true", help=text)
    options.add(parser, "--priority", default=0, otherwise="that of every program")


def run(args: argparse.Namespace) -> None:
    """Drive until it is ended."""
    if args.list_devices:
        _list()
        return

    from steer_env.experiments.pages import provenance
    from steer_env.friction.numerics.check import number
    from steer_env.live.devices.common.window_input import WindowInput
    from steer_env.live.drive.session import DriveError, Options, Session
    from steer_env.live.real_time import Limits

    signalled = _signals()
    seconds = number("--seconds", args.seconds, minimum=0.1, maximum=86400.0) if args.seconds is not None else None
    limits = Limits(torque=number("--torque-limit", args.torque_limit, minimum=0.0, maximum=50.0))
    device = _device(args.device)
    if args.headless and isinstance(device, WindowInput):
        raise ValueError(f"the device {device.name} needs the window, from which its events come: leave out --headless")
    configurations, cars = _configurations(args, device.hands)
    if args.wheel:
        limits = limits._replace(share=_share(args, configurations, device))
    window = None if args.headless else _window(args.course, cars)
    laws = {info.label: each.subsystem.parameters.friction for each, info in configurations}
    trace = provenance.trace(car=cars[0], friction=laws)  # without the command, which makes no drive again
    about = {"manoeuvre": args.manoeuvre} if args.manoeuvre else {}
    meta = {**about, **_of_first(cars[0], configurations[0][1]), "command": shlex.join(args.argv), "trace": trace}
    wanted = Options(args.speed_kph * KPH, limits, args.priority, args.dead_man, args.out, meta)
    if args.priority:
        _hurry()
    session = Session(configurations, device, wanted)
    if signalled:  # while a kernel was compiled, where Python drops what a handler raises
        raise KeyboardInterrupt
    try:
        with session:
            print(f"driving with {device.about}; recording {session.path}; Ctrl-C ends it", flush=True)
            _until_end(session, window, seconds, args.commands)
    except KeyboardInterrupt:  # how a drive ends
        pass
    finally:
        if window is not None:
            window.close()
    print("\n".join(session.summary()))
    if window is not None:
        print(f"{window.frame_rate():.0f} frames a second")
    if session.path is not None:
        print(session.path)
    if session.failure:
        raise DriveError(session.failure)


def _signals() -> list[int]:
    """Let SIGINT, SIGTERM and a terminal that closes end the drive; the signals that came, to which one may look."""
    found: list[int] = []

    def end(number: int, frame: Any) -> None:
        found.append(number)
        raise KeyboardInterrupt

    if threading.current_thread() is threading.main_thread():
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            if signal.getsignal(number) != signal.SIG_IGN:  # as behind nohup
                signal.signal(number, end)
    return found


def _of_first(car: Any, info: Any) -> dict[str, Any]:
    """What a recording tells of the car of the first configuration, as that of a robot's drive does."""
    return {
        "vehicle": car.name,
        "tyre": car.tyre.name,
        "chassis": info.chassis,
        "friction": info.law,
        "wheelbase_m": car.chassis["front_axle"] + car.chassis["rear_axle"],
        "steering_ratio": car.steering_ratio(),
    }


def _hurry() -> None:
    """Let the threads of Python go before other programs, though not before the loop."""
    try:
        os.nice(NICE)
    except PermissionError:
        print(f"steer-env drive: the device's thread has no priority (nice {NICE} is not allowed)", file=sys.stderr)


def _obey(session: "Session") -> None:
    """Do what standard input says, until its end."""
    from steer_env.live.devices.common.commands import COMMANDS

    for line in sys.stdin:
        if (command := line.strip()) in COMMANDS:
            session.command(command)
        elif command:
            print(f"steer-env drive: {command!r} is none of {', '.join(COMMANDS)}", file=sys.stderr)


def _until_end(session: "Session", window: Any, seconds: float | None, commands: bool) -> None:
    """Wait, or draw, until the drive is to end."""
    if commands:
        threading.Thread(target=_obey, args=(session,), daemon=True).start()
    if window is None:
        session.wait(*([] if seconds is None else [seconds]))
        return
    end = float("inf") if seconds is None else time.monotonic() + seconds
    while not session.over.is_set() and time.monotonic() < end:
        events, closed = window.events()
        session.device.feed(events)
        if closed:
            break
        window.show(session.shown())


def _device(text: str) -> "Device":
    """A device from ``NAME[,KEY=VALUE...]``."""
    from steer_env.live import devices

    name, *pairs = text.split(",")
    given = {}
    for pair in pairs:
        key, equals, value = pair.partition("=")
        if not equals:
            raise ValueError(f"--device takes NAME[,KEY=VALUE...], got {pair!r} in {text!r}")
        given[key.strip()] = value.strip()
    return devices.make(name, **given)


def _list() -> None:
    from steer_env.live import devices

    for name in devices.available():
        given = ", ".join(f"{key}={value}" for key, value in devices.options(name).items())
        print(f"{name}\n    {given}")


def _share(args: argparse.Namespace, configurations: list[Any], device: "Device") -> float:
    """The share of the torque with which a wheel is stable on every configuration behind the drive's filter."""
    from steer_env.live.drive.session import PERIOD
    from steer_env.live.real_time import haptics
    from steer_env.live.real_time.angle_filter import BANDWIDTH

    if device.hands != "angle":
        raise ValueError(f"--wheel is for a wheel with a motor, and {device.name} has none: leave it out")
    share = 1.0
    for each, info in configurations:
        found = haptics.stability(each.subsystem, haptics.make(*args.wheel), BANDWIDTH, PERIOD)
        print(f"{info.label}: {options.wheel_verdict(found)}")
        share = min(share, found.share)
    return share


def _window(course: str, cars: list[Any]) -> Any:
    """The window, open; one sentence where there is none."""
    from gymnasium.error import DependencyNotInstalled

    from steer_env.live.drive.scene import Scene
    from steer_env.live.drive.window import Window
    from steer_env.rendering.canvas import NoWindowError

    try:
        window = Window(Scene(course, cars[0]), cars)
        window.open()
    except DependencyNotInstalled:
        raise ValueError(f"the window needs pygame-ce: {install('drive')}, or drive with --headless") from None
    except NoWindowError as error:
        raise ValueError(f"the drive {error}: log in at a screen, or drive with --headless") from None
    return window


class _Quiet(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        raise ValueError(message)


def _differences(text: str) -> argparse.Namespace:
    """What a further configuration has of its own, from words ``KEY=VALUE``."""
    parser = _Quiet(add_help=False, allow_abbrev=False)
    parser.add_argument("--friction", type=options.friction_law)
    parser.add_argument("--chassis", choices=names.chassis())
    car_options.add(parser, default=None)
    try:
        words = shlex.split(text)
        if not words:
            raise ValueError("it is empty")
        for word in words:
            if word.partition("=")[0] not in _CONFIGURATION_KEYS or "=" not in word:
                raise ValueError(f"{word!r} is none of {', '.join(f'{key}=...' for key in _CONFIGURATION_KEYS)}")
        found = parser.parse_args([f"--{word}" for word in words])
        found.label = ", ".join(word.partition("=")[2] for word in words)
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"{text!r}: {error}") from None
    return found


def _configurations(args: argparse.Namespace, hands: str) -> tuple[list[Any], list[Any]]:
    """The configurations of the options for a device's hands, each with what is told of it, and their cars."""
    from steer_env.live.drive.hands import car_configuration

    wanted = []
    laws = args.friction or [options.friction_law(car_options.load(args).friction)]
    labels = [law.label for law in laws]
    for law in laws:
        words = [law.label if labels.count(law.label) == 1 else law.given, *([args.tyre] if args.tyre else [])]
        wanted.append((", ".join(words), args, law, args.chassis))
    for other in args.others:
        mixed = argparse.Namespace(
            vehicle=other.vehicle or args.vehicle,
            steering=args.steering,
            tyre=other.tyre or args.tyre,
            changes=[*(each for each in args.changes if each[0] not in dict(other.changes)), *other.changes],
        )
        wanted.append((other.label, mixed, other.friction or wanted[0][2], other.chassis or args.chassis))
    if len(wanted) > MOST_CONFIGURATIONS:
        raise ValueError(
            f"{len(wanted)} configurations are given, and there are keys for {MOST_CONFIGURATIONS}: leave some out"
        )
    configurations, cars = [], []
    for label, given, law, chassis in wanted:
        car = car_options.load(given)
        changed = [f"{key}={value}" for key, value in given.changes] if given is args else []
        configurations.append(
            car_configuration(
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
    return configurations, cars
