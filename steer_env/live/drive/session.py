"""A drive: configurations of the car, a device, the loop in real time, and a file that grows.

Three threads take part. The loop is compiled and holds the deadlines. A thread of Python, some 500 times in a second,
takes the device's readings to the loop and the torque to the device. Another writes what the loop has recorded. The
main thread is free for a window, which draws :meth:`Session.shown`, or waits.
"""

import math
import os
import sys
import threading
import time
from collections.abc import Mapping, Sequence
from contextlib import ExitStack, suppress
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.live.devices import Device, DeviceError, Reading
from steer_env.live.drive.hands import Arms, Pedals, in_order
from steer_env.live.drive.log import Log, new_file, recorded_columns
from steer_env.live.drive.shown import ConfigurationInfo, DriveMoment, History
from steer_env.live.real_time import CarConfiguration, CarConfigurations, Limits, Mailboxes, RealTime
from steer_env.live.real_time.angle_filter import BANDWIDTH
from steer_env.live.real_time.loop import LATENESS_BIN
from steer_env.live.real_time.measure import Durations
from steer_env.live.real_time.recorder import RECORD_HEAD
from steer_env.vehicle.plant import CHANNEL
from steer_env.vehicle.steering.eps import SAMPLE_TIME

# What the watchdog counts, and what to do; of a failure, the sentence that ended the drive tells.
FADED = {
    "stale_trips": "no angle arrived in time; is the device there, and the machine not too busy (--priority)?",
    "deadline_trips": "too many deadlines were missed; end other programs, or give --priority",
    "dead_man_trips": "the dead-man key was released",
}
NOTED = 6.0  # time for which the window tells what happened [s]


class Happened:
    """Keeps events with their times.

    Parameters
    ----------
    motor : bool
        Whether there is a torque that can fade.

    Attributes
    ----------
    events : list of (float, str)
        Time of the simulation [s], and words.
    """

    def __init__(self, motor: bool) -> None:
        self.events: list[tuple[float, str]] = []
        self._noted = (0.0, "")
        self._trips = dict.fromkeys(FADED, 0)
        self._fades: dict[str, list[float]] = {name: [] for name in FADED}
        self._motor = motor

    def tell(self, at: float, words: str) -> None:
        """Keep an event, and note it for the window."""
        self._noted = at, words
        self.events.append(self._noted)

    def faded(self, at: float, counts: Mapping[str, int], asked: bool) -> None:
        """Keep the fades that the watchdog has counted since the last call; ``asked``: the person ended the torque."""
        for name, words in FADED.items():
            new, self._trips[name] = counts[name] > self._trips[name], counts[name]
            if new and self._motor and not (asked and name == "dead_man_trips"):
                self._fades[name].append(at)
                self._noted = at, f"the torque faded: {words}"

    def note(self, now: float) -> str:
        """What happened last, empty where that was long ago."""
        at, words = self._noted
        return words if now - at < NOTED else ""

    def summary(self, loop: RealTime, about: str, acted: float, clipping: float) -> list[str]:
        """A drive in lines: its loop, the device, how long there was torque [s], and what the device clipped [1]."""
        counts, kept = loop.counts(), loop.loop
        ticks = max(counts["ticks"], 1)
        lines = [f"drove {1e-3 * counts['ticks']:.1f} s with {about}"]
        if self._motor:
            lines[0] += f", with torque for {acted:.1f} s"
        lines += [f"{at:8.1f} s  {words}" for at, words in self.events]
        lateness = Durations(kept.lateness, 1e-9 * LATENESS_BIN, 1e-9 * float(kept.worst[0]))
        most, worst = 1e3 * lateness.percentile(99.0), 1e3 * lateness.worst
        lines.append(f"late by {most:.2f} ms at most in 99 of 100 deadlines, {worst:.1f} ms at worst")
        missed = f"deadlines missed {counts['missed'] / (counts['missed'] + ticks):.2%}"
        limited = f", torque limited {counts['clipped'] / ticks:.2%} of the time, and by the device {clipping:.2%}"
        lines.append(missed + limited * self._motor)
        for name, times in self._fades.items():
            if times:
                often = f"{len(times)} times, first" if len(times) > 1 else "once,"
                lines.append(f"the torque faded {often} at {times[0]:.1f} s: {FADED[name]}")
        return lines


def waits_for(device: Any, paused: bool, released: bool) -> str:
    """What the torque waits for, in words for the window."""
    if not device.motor:
        return ""
    if paused:
        return "paused (P)"
    return "hold Space" if released else ""


PERIOD = 0.002  # of the exchange with the device [s]
WRITTEN = 0.1  # time between two additions to the file [s]
SWITCH_INTERVAL = 0.0005  # for which a thread of Python keeps the others waiting; by default 5 ms [s]
LATE = 2.0  # time over which the lateness is told [s]
_GAIN = list(RECORD_HEAD).index("gain")
POSE = [CHANNEL[name] for name in ("x", "y", "yaw_angle")]  # among the channels of a car
CLOCK_JUMP = 1.0  # difference of clocks that is told; assumed [s]
SILENT = 1.0  # time without a reading that is told [s]
HUNG = 0.5  # time that a device may take for its last exchange; assumed [s]


class DriveError(ValueError):
    """What ended a drive; the message says it in a sentence."""


class Options(NamedTuple):
    """How a drive is made; :class:`Session` explains."""

    speed: float  # that the plants hold [m/s]
    limits: Limits = Limits()
    priority: int = 0
    dead_man: bool = False
    folder: Path | None = None
    meta: Mapping[str, Any] = {}


class Session:
    """A drive, from the begin of its ``with`` block to the end, where the torque fades out and the file is closed.

    Parameters
    ----------
    configurations : sequence of (CarConfiguration, ConfigurationInfo)
        The first acts first.
    device : Device
        Not yet open. The configurations are made for its ``hands``, by
        :func:`steer_env.live.drive.hands.car_configuration`.
    options : Options
        ``dead_man``: whether the motor has a torque only while the device's dead-man key is held. ``folder``: of the
        recording, without which there is none. ``meta``: of the recording, beside what the session tells itself.

    Raises
    ------
    DeviceError
        The device is not there or cannot be used.
    OSError
        The folder takes no file.
    ValueError
        As of ``CarConfigurations`` and ``RealTime``.
    """

    def __init__(
        self,
        configurations: Sequence[tuple[CarConfiguration, ConfigurationInfo]],
        device: Device,
        options: Options,
    ) -> None:
        self.infos = tuple(info for _, info in configurations)
        self.device, self.options = device, options
        self.failure = ""  # what ended the drive, empty where nothing did
        self.over = threading.Event()  # whether it is to end
        self.path: Path | None = None
        self._happened = Happened(device.motor)
        self.events = self._happened.events  # with their times [s]
        self._configurations = CarConfigurations([each for each, _ in configurations])
        wheel = device.hands == "angle"
        self._mail = Mailboxes(self._configurations, angle_bandwidth=BANDWIDTH if wheel else None, dead_man=True)
        self._loop = RealTime(self._configurations, self._mail.device, options.limits, priority=options.priority)
        self._names = [signal.name for signal in self._configurations.subsystem.given]
        self._hands, self._pedals, self._paused = Arms(), Pedals(options.speed), False
        self._recentres, self._odd, self._withheld = False, False, False
        self._heard, self._silent = math.inf, False  # time of the last reading [s], and whether its lack was told
        self._reading: Reading | None = None
        self._torque = 0.0
        self._road = np.zeros(3)  # pose of the car where the road begins [m], [m], [rad]
        self._asked, self._pair, self._dropped = 0, (0, min(1, len(configurations) - 1)), 0  # configurations
        self._stop = threading.Event()  # of the threads, which outlive the loop
        self._lateness, self._late, self._looked = self._loop.loop.lateness.copy(), 0.0, time.monotonic()
        self._lost, self._acted = 0, 0  # samples that nobody recorded, and those with torque
        self._error: BaseException | None = None  # a mistake of the program

    def __enter__(self) -> "Session":
        self._stack = stack = ExitStack()
        try:
            stack.callback(sys.setswitchinterval, sys.getswitchinterval())
            sys.setswitchinterval(SWITCH_INTERVAL)
            stack.enter_context(self.device)
            columns = recorded_columns(self._configurations.subsystem, self._loop.recorder)
            file = None
            if self.options.folder is not None:
                self.path, file = new_file(self.options.folder, columns, self._meta())
            self._log = Log(columns, file)
            stack.callback(self._finish)
            self._threads = [threading.Thread(target=work, daemon=True) for work in (self._serve, self._record)]
            stack.callback(self._join)
            stack.enter_context(self._loop)
            self._heard = time.monotonic()
            for thread in self._threads:
                thread.start()
            return self  # here, so that no signal comes between the last statement and the block
        except BaseException:
            stack.__exit__(*sys.exc_info())
            raise

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            self.over.set()
        finally:
            self._stack.__exit__(kind, error, trace)
        if self._reading is None and self._silent and not self.failure:
            self.failure = f"no angle ever arrived from {self.device.about}: check it, its cable and its options"
        if self._error is not None and kind is None:
            raise self._error

    def _meta(self) -> dict[str, Any]:
        configurations = [info._asdict() for info in self.infos]
        device = {"device": self.device.about, "motor": self.device.motor}
        return {**self.options.meta, "speed_m_s": self.options.speed, **device, "sets": configurations}

    # -- the threads

    def _serve(self) -> None:
        """Exchange with the device, and behind a failure tell it time and again to give no torque."""
        self._guarded(self._exchange, PERIOD, max(self.options.priority - 1, 0))
        while not self._stop.is_set():
            self._zero()
            self._stop.wait(PERIOD)

    def _record(self) -> None:
        self._guarded(self._write, WRITTEN)

    def _zero(self) -> None:
        """End the torque of a device that may be gone, or whose program has a mistake, which is told already."""
        with suppress(Exception):
            self.device.write(0.0)

    def _guarded(self, work: Any, period: float, priority: int = 0) -> None:
        """Do a thread's work at even times until the end; whatever fails ends the drive, at zero torque."""
        due = time.monotonic()
        if priority and self._loop.runs():  # else the priority is not allowed, as the loop tells
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
        while not self._stop.is_set():
            try:
                work()
            except (DeviceError, OSError) as error:
                self._fail(str(error))
                return
            except BaseException as error:
                self._error = error
                self._fail(f"a mistake of the program: {error!r}")
                return
            due = max(due + period, time.monotonic() - period)
            time.sleep(max(due - time.monotonic(), 0.0))

    def _exchange(self) -> None:
        """Take what the device tells to the loop, and the torque to the device."""
        reading = self.device.read()
        self._listen(reading is not None)
        if reading is not None:
            self._reading = reading
            for name in reading.pressed:
                self.command(name)
            self._check_clock(reading)
            withheld = self._paused or self._recentres
            self._withheld |= withheld
            held = not withheld and (reading.dead_man or not self.options.dead_man)
            self._mail.put(self._inputs(reading), reading.stamp, dead_man=held)
        self._torque, phase, _ = self._mail.get()
        if phase == "failed":
            self._fail(
                "the torque ended at once, because the handwheel angle jumped, or it or the car made no sense: check "
                "the wheel and its options, and start again"
            )
        elif self._recentres and self.gain() == 0.0:  # an angle that jumps under torque would be a fault
            self._recentres = False
            self.device.recentre()
            self._tell("straight ahead is here")
        self.device.write(self._torque)

    def _listen(self, arrived: bool) -> None:
        """Tell a device from which nothing arrives, and one from which something does again."""
        now = time.monotonic()
        if arrived:
            self._heard = now
        silent = now - self._heard > SILENT
        if silent and not self._silent:
            self._tell(f"no angle arrives from {self.device.about}: check it, its cable and its options")
        elif self._silent and not silent:
            self._tell("the angle arrives again")
        self._silent = silent

    def _check_clock(self, reading: Reading) -> None:
        """Tell a clock that jumps; the loop takes no reading of a time to come, and fades."""
        ahead = 1e-9 * (reading.stamp - time.monotonic_ns())
        odd = abs(ahead) > CLOCK_JUMP
        if odd and not self._odd:
            side = "ahead" if ahead > 0.0 else "behind"
            self._tell(
                f"the device's clock is {abs(ahead):.1f} s {side}, so that its angles are not taken: start again"
            )
        self._odd = odd

    def _inputs(self, reading: Reading) -> list[float]:
        values = self._pedals.inputs(reading.throttle, reading.brake)
        if self.device.hands == "angle":
            values["hand_angle"] = reading.angle  # of which the mailbox makes the speed
        else:
            values["hand_torque"] = self._hands.torque(reading.angle, reading.stamp)
        return in_order(self._names, values)

    def _write(self) -> None:
        """Take what the loop has recorded to the file."""
        if not (self._loop.runs() or self.over.is_set()):
            self.over.set()  # the end of the block tells why
        asked, self._withheld = self._withheld, self._paused or self._recentres
        self._happened.faded(self.time(), self._loop.counts(), asked)
        dropped = self._configurations.counts()["dropped"]
        if dropped > self._dropped:
            self._dropped = dropped
            goes_on = self._configurations.chosen()
            self._tell(f"configuration {self._asked + 1} did not stay finite: configuration {goes_on + 1} goes on")
            self._asked = self._configurations.chosen()
        samples, lost = self._loop.recorder.drain()
        self._lost += lost
        self._acted += int((samples[:, _GAIN] > 0.0).sum())
        try:
            self._log.add(samples, lost)
        except OSError as error:
            raise OSError(f"{self.path} takes no more ({error.strerror}); what it has is kept: make room") from None

    def _fail(self, sentence: str) -> None:
        self._mail.fail()
        if not self.failure:
            self.failure = sentence
            self._tell(sentence)
        self.over.set()

    def _join(self) -> None:
        """End the threads behind the loop, which has faded out, and leave the motor without a torque."""
        self._stop.set()
        serves, records = self._threads
        if serves.ident is not None:
            serves.join(HUNG)
        if self.failure:
            self._zero()
        else:
            try:
                self.device.write(0.0)
            except DeviceError as error:
                self._fail(str(error))
        if serves.is_alive():
            self._fail(f"{self.device.about} does not answer any more: unplug it, and start again")
        if records.ident is not None:
            records.join()

    def _finish(self) -> None:
        """Write the rest, also where a thread has failed."""
        try:
            self._write()
        except OSError as error:
            self._fail(str(error))
        finally:
            self._log.close()
            if self.path is not None and not self._log.samples:
                self.path.unlink()  # nothing was driven
                self.path = None

    # -- for the main thread

    def wait(self, seconds: float = math.inf) -> None:
        """Wait until the drive is to end, or for so long."""
        self.over.wait(None if math.isinf(seconds) else seconds)

    def command(self, name: str) -> None:
        """Do what a person wants, one of ``steer_env.live.devices.COMMANDS``, from any thread."""
        if name == "quit":
            self.over.set()
        elif name == "pause":
            self._paused = not self._paused
            self._tell("torque paused" if self._paused else "torque again")
        elif name == "recentre":
            self._recentres = True
        elif name == "road":
            self._road = self._mail.get()[2][POSE]
            self._tell("the road begins anew under the car; the recording keeps its coordinates")
        elif name in ("faster", "slower"):
            self._pedals.change(1 if name == "faster" else -1, self.speed())
            given = [signal.name for signal in self._configurations.configurations[self._asked].subsystem.given]
            kept = "" if "target_speed" in given else ", but not by this chassis, whose speed does not change"
            self._tell(f"speed held at {3.6 * self._pedals.held:.0f} km/h{kept}")
        else:
            a, b = self._pair
            self._choose((b if self._asked == a else a) if name == "swap" else int(name.removeprefix("set_")) - 1)

    def _choose(self, wanted: int) -> None:
        """Let a configuration take over; the pair that swaps is the present and the former one."""
        if wanted >= len(self.infos) or len(self.infos) == 1:
            self._tell(f"there is no configuration {max(wanted + 1, 2)}")
        elif wanted != self._asked:
            if wanted not in self._pair:
                self._pair = (self._asked, wanted)
            self._asked = wanted
            self._configurations.choose(wanted)
            self._tell(f"configuration {wanted + 1}: {self.infos[wanted].label}")

    def _tell(self, words: str) -> None:
        self._happened.tell(self.time(), words)

    def time(self) -> float:
        """Time of the simulation since the begin [s]."""
        return 1e-3 * self._loop.counts()["ticks"]

    def speed(self) -> float:
        """Forward speed of the car [m/s]."""
        return self.options.speed if math.isnan(self._log.speed) else self._log.speed

    def gain(self) -> float:
        """Share of the torque that the watchdog lets through [1]."""
        return float(self._loop.loop.safety[0].gain)

    def late(self) -> float:
        """Lateness that 99 of 100 deadlines of the last seconds kept [s]."""
        now = time.monotonic()
        if now - self._looked > LATE:
            lateness = self._loop.loop.lateness.copy()
            reached = np.cumsum(lateness - self._lateness)
            self._late = 1e-9 * LATENESS_BIN * float(np.argmax(reached >= 0.99 * reached[-1]))
            self._lateness, self._looked = lateness, now
        return self._late

    def shown(self) -> DriveMoment:
        """The present moment, for one thread."""
        _, phase, outputs = self._mail.get()
        counts, reading = self._loop.counts(), self._reading
        kept = self._log.history()
        outputs[POSE], kept[:, :3] = self._on_road(outputs[POSE]), self._on_road(kept[:, :3])
        ticks = max(counts["ticks"], 1)
        virtual = self.device.hands == "torque" and reading is not None
        return DriveMoment(
            time=1e-3 * ticks,
            channels=outputs,
            speed=self.speed(),
            held=math.nan if self._pedals.coasts else self._pedals.held,
            wanted=reading.angle if virtual and reading else math.nan,
            torque=self._torque,
            phase=phase,
            gain=self.gain(),
            clipped=max(counts["clipped"] / ticks, self.device.clipping()),
            late=self.late(),
            missed=counts["missed"] / (counts["missed"] + ticks),
            configurations=self.infos,
            chosen=self._configurations.chosen(),
            pair=self._pair,
            waits=waits_for(self.device, self._paused, self.options.dead_man and not (reading and reading.dead_man)),
            note=self._happened.note(1e-3 * counts["ticks"]),
            file=self.path.name if self.path else "",
            device=self.device.about,
            motor=self.device.motor,
            keyboard=self.device.name == "keyboard",
            dead_man=self.options.dead_man,
            history=History(kept[:, :3], kept[:, 3], kept[:, 4], kept[:, 5].astype(np.int64) - 1),
        )

    def _on_road(self, pose: NDArray[np.float64]) -> NDArray[np.float64]:
        """Poses (..., 3) relative to where the road begins."""
        x, y, yaw = np.moveaxis(pose - self._road, -1, 0)
        c, s = math.cos(self._road[2]), math.sin(self._road[2])
        return np.stack([c * x + s * y, c * y - s * x, yaw], axis=-1)

    def summary(self) -> list[str]:
        """What the drive was, in lines, once it is over."""
        about, clipping = self.device.about, self.device.clipping()
        lines = self._happened.summary(self._loop, about, SAMPLE_TIME * self._acted, clipping)
        if self._lost:
            lines.append(f"{self._lost} samples are not in the recording, as nobody wrote them in time")
        return lines
