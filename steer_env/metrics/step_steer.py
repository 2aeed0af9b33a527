"""Step steer: the responses of yaw rate and lateral acceleration to a quick turn of the handwheel.

Times count from the instant at which the handwheel has turned half its way. Every step from straight ahead in a
recording, to either side, is a repeat; a step back to straight ahead is not. Responses are relative to their mean
before the step, so that an offset of a sensor drops out, and are positive in the direction of the step. A steady value
is the mean over the last second in which the handwheel is held, which ends 0.1 s before it leaves its angle.
"""

from collections.abc import Callable, Mapping
from operator import methodcaller
from typing import Any, NamedTuple

import numpy as np
from scipy import stats

from steer_env.metrics.common import events
from steer_env.metrics.common.definitions import Bounded, RefusedError, declare, metric, register_evaluation
from steer_env.metrics.common.filtered_channels import ANGLE, AY, SPEED, TORQUE, YAW, FilteredChannels
from steer_env.metrics.common.kept import anew, kept
from steer_env.recording.recording import DEGREE, Recording
from steer_env.vehicle.constants import GRAVITY as G

CUTOFF = 25.0  # low-pass; a quarter of the sampling rate where that is lower [Hz]
SETTLING_CUTOFF = 5.0  # low-pass of the responses whose settling time is read; assumed [Hz]
BAND = 0.05  # half width of the band in which a response has settled, as a fraction of the steady value [1]
AROUND = 0.1  # half width of the parabola from which a settling time is read; assumed [s]
# Least handwheel speed of a step: the standard's 200 deg/s less the effect of the low-pass; assumed [rad/s].
SLOWEST = 150 * DEGREE
FAST = 0.2  # the handwheel moves where its speed exceeds this fraction of the highest speed; assumed [1]
# Time straight ahead before a step, least time for which it is held, time in which the steady value is read.
BEFORE, HOLD, STEADY = 0.5, 3.0, 1.0  # assumed [s]
HELD = 0.1  # largest deviation of a held angle, as a fraction of the step; assumed [1]
STILL = 0.002  # least deviation that is the beginning of a return, as a fraction of the step; assumed [1]
SOURCE = "after ISO 7401"


class Step(NamedTuple):
    """One step of the handwheel."""

    start: float  # instant at which the handwheel has turned half its way [s]
    size: float  # change of the handwheel angle [rad]
    before: slice  # samples straight ahead
    response: slice  # samples from the start of `before` to where the handwheel leaves the held angle


class Steps:
    """Responses to the steps of a recording; every method returns one value for each step, (n,)."""

    def __init__(self, recording: Recording, conditions: Mapping[str, Any]) -> None:
        self._smooth = FilteredChannels(recording, min(CUTOFF, recording.rate / 4))
        self.time, self._speed = self._smooth.time, conditions["speed_m_s"]
        self.steps = _find(self.time, self._smooth[ANGLE])

    def _low_passed(self, cutoff: float) -> "Steps":
        """The same steps with another low-pass [Hz]."""
        other = anew(self)
        other._smooth = FilteredChannels(self._smooth.recording, min(cutoff, self._smooth.recording.rate / 4))
        return other

    def response(
        self, channel: str | Callable[[FilteredChannels], np.ndarray], step: Step, centred: bool = True
    ) -> tuple[np.ndarray, np.ndarray]:
        """Time from the start of a step and a channel (m,), less its mean before, positive in the step's direction."""
        values = channel(self._smooth) if callable(channel) else self._smooth[channel]
        offset = values[step.before].mean() if centred else 0.0
        return self.time[step.response] - step.start, (values[step.response] - offset) * np.sign(step.size)

    @kept
    def steady(self, channel: str | Callable[[FilteredChannels], np.ndarray], centred: bool = True) -> np.ndarray:
        """Steady values (n,)."""
        found = []
        for step in self.steps:
            t, y = self.response(channel, step, centred)
            found.append(y[t > t[-1] - STEADY].mean())
        if channel in (YAW, AY) and np.mean(found) <= 0:
            raise RefusedError(f"{channel} does not follow {ANGLE}: check the signs, a left turn is positive in both")
        return np.array(found)

    def gain(self, channel: str) -> np.ndarray:
        """Steady values over the changes of the handwheel angle (n,)."""
        return self.steady(channel) / np.abs([step.size for step in self.steps])

    def _each(self, channel: str, read: Callable[[np.ndarray, np.ndarray], float]) -> np.ndarray:
        """The result of read(t, y) for every step, where y is the response over its steady value."""
        steady = self.steady(channel)
        responses = [self.response(channel, step) for step in self.steps]
        return np.array([read(t, y / level) for (t, y), level in zip(responses, steady)])

    def response_time(self, channel: str) -> np.ndarray:
        """Time (n,) to nine tenths of the steady value [s]."""
        return self._each(channel, lambda t, y: events.crossing(t, y, 0.9))

    def rise_time(self, channel: str) -> np.ndarray:
        """Time (n,) from one to nine tenths of the steady value [s]."""

        def read(t: np.ndarray, y: np.ndarray) -> float:
            end = events.crossing(t, y, 0.9)
            under = np.flatnonzero((y < 0.1) & (t < end))[-1]  # last noise before the rise
            return end - events.crossing(t[under:], y[under:], 0.1)

        return self._each(channel, read)

    @kept
    def peak(self, channel: str) -> np.ndarray:
        """Time of the peak [s] and its height over the steady value [1], (n, 2)."""

        def read(t: np.ndarray, y: np.ndarray) -> Any:
            early = t < t[-1] - STEADY
            return events.peak(t[early], y[early], base=1.0)

        return self._each(channel, read)

    def settling_time(self, channel: str) -> Bounded:
        """Time (n,) until the response stays within 5 % of the steady value [s].

        The mean of the steps shows which crossing of the band is the last one. A parabola through each step around that
        crossing gives its time. Where noise could move an extreme of the response into the band or out of it, the
        bounds include the crossing before or after the last one.
        """
        calm = self._low_passed(SETTLING_CUTOFF)
        steady, each = calm.steady(channel), [calm.response(channel, step) for step in self.steps]
        t = each[int(np.argmin([len(y) for _, y in each]))][0]
        y = np.array([np.interp(t, at, values / level) for (at, values), level in zip(each, steady)]) - 1.0
        mean = y.mean(axis=0)
        late = t > t[-1] - STEADY
        noise = 2.0 * float(np.median(stats.sem(y[:, late]))) if len(y) > 1 else 0.0

        def last(band: float) -> float:
            k = int(np.flatnonzero(np.abs(mean) > band)[-1])
            if late[k]:
                raise RefusedError(f"{channel} does not settle within 5 %: hold the handwheel longer")
            return events.crossing(t[k : k + 2], -np.abs(mean[k : k + 2]), -band)

        at = last(BAND)
        near = np.abs(t - at) <= AROUND
        side = np.sign(mean[near][0])
        level, slope, _ = np.polynomial.polynomial.polyfit(t[near] - at, side * y[:, near].T - BAND, 2)
        slope = slope.mean()
        if not slope < 0.0:
            raise RefusedError(f"{channel} only touches the band of 5 %, so its settling time is not defined")
        jumps = (abs(last(band) - at) for band in (BAND + noise, max(BAND - noise, 0.5 * BAND)))
        below, above = (jump if jump > 3.0 * noise / -slope else 0.0 for jump in jumps)
        return Bounded(at - level / slope, below, above)

    @kept
    def peak_acceleration(self) -> float:
        """Mean of the steady lateral accelerations, or of yaw rate times speed where that is not recorded [g]."""
        if AY in self._smooth:
            return float(self.steady(AY).mean()) / G
        speed = self._smooth[SPEED].mean() if SPEED in self._smooth else self._speed
        return float(self.steady(YAW).mean() * speed) / G


def _find(time: np.ndarray, angle: np.ndarray) -> list[Step]:
    """The steps from straight ahead; the handwheel is assumed to be straight before the first of them."""
    rate = np.gradient(angle, time)
    fastest = np.abs(rate).max()
    if fastest < SLOWEST:
        raise RefusedError(f"{ANGLE} changes by {fastest / DEGREE:.0f} deg/s at most: step at 200 to 500 deg/s")
    each = time[1] - time[0]
    found, too_short, straight, largest = [], 0, None, 0.0
    for i, j in events.true_runs(np.abs(rate) > FAST * fastest, gap=round(0.1 / each)):
        rest = slice(max(i - round((BEFORE + 0.1) / each), 0), max(i - round(0.1 / each), 0))
        settled = angle[j + round(0.1 / each) : j + round(0.6 / each)]
        if rest.stop - rest.start < 2 or np.ptp(time[rest]) < 0.5 * BEFORE or not settled.size:
            too_short += 1
            continue
        before, level = angle[rest].mean(), float(np.median(settled))
        straight = before if straight is None else straight
        size = level - before
        largest = max(largest, abs(size))
        if abs(before - straight) > 0.2 * abs(size):
            continue  # a step back to straight ahead
        late = np.flatnonzero(np.abs(angle[j:] - level) <= HELD * abs(size))
        first = j + int(late[0]) if late.size else j
        away = np.flatnonzero(np.abs(angle[first:] - level) > HELD * abs(size))
        end = (
            _end_of_hold(angle, first, first + int(away[0]), abs(size)) - round(0.1 / each) if away.size else angle.size
        )
        if end <= first or time[end - 1] - time[first] < HOLD or np.ptp(angle[rest]) > HELD * abs(size):
            too_short += 1
            continue
        held = angle[first:end][time[first:end] > time[end - 1] - STEADY].mean()
        a, b = max(i - round(0.1 / each), 0), first + 1
        start = events.crossing(time[a:b], (angle[a:b] - before) / (held - before), 0.5)
        found.append(Step(start, float(held - before), rest, slice(rest.start, end)))
    steps = [step for step in found if abs(step.size) > 0.5 * largest]
    if not steps:
        raise RefusedError(
            f"no step from straight ahead held for {HOLD:g} s with {BEFORE:g} s straight before it "
            f"({too_short} moves of {ANGLE} are too short): hold longer"
        )
    return steps


def _end_of_hold(angle: np.ndarray, first: int, away: int, size: float) -> int:
    """Sample before ``away`` at which the handwheel leaves the angle that it holds from ``first`` on.

    A return begins gently, so that the angle is off by little for some time: the hold ends where the angle was last
    within its own scatter.
    """
    off = np.abs(angle[first:away] - np.median(angle[first:away]))
    band = max(STILL * size, 3.0 * 1.4826 * float(np.median(off)))
    return first + int(np.flatnonzero(off <= band)[-1]) + 1


register_evaluation("step-steer", Steps, steered=True, speed_m_s=80 / 3.6)


# A range around the standard's 4 m/s2; assumed. Above it the tyres saturate; below it friction and noise dominate.
VALID = (0.15, 0.65)  # peak lateral acceleration [g]


def _of_response(channel: str, gain: str, top: str, steady: str) -> None:
    """Declare the metrics of a response: unit of its gain, what is said of its top, its name where it comes again."""
    name = channel.replace("_", " ")

    def of(ending: str, unit: str, definition: str, read: Callable[[Steps], Any], source: str = SOURCE) -> None:
        declare(f"{channel}_{ending}", unit, definition, read, "step-steer", validity=VALID, source=source)

    half = "from half of the handwheel angle"
    of("step_gain", gain, f"Steady {name} divided by the steady handwheel angle.", methodcaller("gain", channel))
    of(
        "time_to_90",
        "s",
        f"Response time {half} to 90 % of the steady {name}.",
        methodcaller("response_time", channel),
    )
    of(
        "rise_time",
        "s",
        f"Time from 10 % to 90 % of the steady {name}.",
        methodcaller("rise_time", channel),
        "common use",
    )
    of(
        "peak_time",
        "s",
        f"Peak response time {half} to the highest {name}{top}",
        lambda steps: steps.peak(channel)[:, 0],
    )
    above = f"Highest {name}, the top of a cubic through the peak, divided by the steady {steady}, minus one."
    of("overshoot", "1", above, lambda steps: steps.peak(channel)[:, 1] - 1.0)
    settled = f"Time {half} until the {name} stays within 5 % of its steady value. The response is low-passed at 5 Hz."
    of("settling_time", "s", settled, methodcaller("settling_time", channel), "common use")


_of_response(YAW, "1/s", ". The highest yaw rate is the top of a cubic through the peak.", "yaw rate")
_of_response(AY, "g/100 deg", ", as for the yaw rate.", "one")


def _step_metric(unit: str, source: str = SOURCE) -> Callable:
    return metric(unit, "step-steer", validity=VALID, source=source)


@_step_metric("N m")
def steady_step_torque(steps: Steps) -> np.ndarray:
    """Steady handwheel torque in the direction of the step; a torque left by friction before it is not subtracted."""
    return steps.steady(TORQUE, centred=False)


@_step_metric("deg")
def steady_step_sideslip(steps: Steps) -> np.ndarray:
    """Steady sideslip angle in the direction of the step; negative where the car's nose points into the turn."""
    return steps.steady(FilteredChannels.sideslip)


@_step_metric("deg s", source="after Lincke, Richter, Schmidt, SAE paper 730489, 1973, and ISO 7401")
def tb_factor(steps: Steps) -> np.ndarray:
    """Peak response time of the yaw rate times the size of the steady sideslip angle."""
    return steps.peak(YAW)[:, 0] * np.abs(steady_step_sideslip(steps))
