"""What happened in a drive, and the account of it at its end."""

from collections.abc import Mapping
from typing import Any

from steer_env.live.real_time import RealTime
from steer_env.live.real_time.loop import LATENESS_BIN
from steer_env.live.real_time.measure import Durations

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
