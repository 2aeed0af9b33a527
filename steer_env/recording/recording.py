"""A recording: named channels over one time base, simulated or measured, and the operations on it.

In memory all quantities are in SI units with angles in radians; :mod:`steer_env.recording.files` has the file formats.
"""

from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Any

import numpy as np

from steer_env.friction.numerics import shown
from steer_env.friction.numerics.check import did_you_mean, number
from steer_env.recording.units import DEGREE, FILE_UNITS

__all__ = ["DEGREE", "FILE_UNITS", "Recording", "check_meta", "interpolated", "step_counts"]

SAMPLES_PER_CUTOFF = 4.0  # slowest sampling rate, as a multiple of the cutoff

LARGEST = 1e60  # reading of which a metric is computed [SI]


@dataclass(frozen=True, eq=False)
class Recording:
    """Channels sampled at common instants; the arrays are read-only copies, so a recording does not change.

    Every operation returns a new recording and keeps units and meta:

    * ``between(t0, t1)`` keeps the samples of a time range.
    * ``without(*names)`` removes channels.
    * ``without_offset(name, value)`` subtracts a sensor's offset from a channel.
    * ``delayed(name, seconds)`` shifts a channel in time and trims all channels to the common time range.
    * ``bridged(longest)`` closes short gaps (NaN or missing rows) by linear interpolation and refuses long ones.
    * ``resampled(rate)`` interpolates linearly at a uniform rate.
    * ``filtered(cutoff_hz)`` applies a low-pass without a phase shift.

    They are applied to a measured recording in this order. A row is missing where a step is longer than 1.5 times
    the median step.

    Parameters
    ----------
    time : (T,) array, T >= 2
        Strictly ascending [s]; not necessarily uniform.
    channels : mapping of str to (T,) array
        In SI units with angles in radians and signs after ISO 8855, left positive. Gaps are NaN.
    units : mapping of str to str
        Unit of each channel, a key of ``FILE_UNITS``.
    meta : mapping of str to str, int, float, bool, None, or lists and dicts of these
        Origin of the recording: manoeuvre, friction law, speed, ... with the unit in the key. Every file format keeps
        it as it is.

    Raises
    ------
    ValueError
        If the lengths differ, the time is not finite and ascending, or a unit or meta value is not known.
    """

    time: np.ndarray
    channels: Mapping[str, np.ndarray]
    units: Mapping[str, str]
    meta: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        time = _frozen(self.time, "time")
        if time.size < 2 or not np.all(np.isfinite(time)):
            raise ValueError(f"time needs at least two samples, all finite; got {time.size} samples")
        if np.any(np.diff(time) <= 0):
            k = int(np.argmax(np.diff(time) <= 0)) + 1
            raise ValueError(f"time must ascend strictly; sample {k} is {time[k]} s after {time[k - 1]} s")
        channels = {name: _frozen(values, name) for name, values in self.channels.items()}
        for name, values in channels.items():
            if values.size != time.size:
                raise ValueError(f"channel {name!r} has {values.size} samples, time has {time.size}")
        if "time" in channels:
            raise ValueError("no channel may be called 'time': that is the time base")
        if set(self.units) != set(channels):
            raise ValueError(f"units must name the channels {sorted(channels)}; got {sorted(self.units)}")
        for name, unit in self.units.items():
            if unit not in FILE_UNITS:
                raise ValueError(f"channel {name!r} has unit {unit!r}; known units are {list(FILE_UNITS)}")
        for key, value in self.meta.items():
            check_meta(key, value)
        object.__setattr__(self, "time", time)
        object.__setattr__(self, "channels", channels)
        object.__setattr__(self, "units", dict(self.units))
        object.__setattr__(self, "meta", deepcopy(dict(self.meta)))

    def __getstate__(self) -> dict[str, Any]:
        """What is pickled and copied: not what metrics have kept with the recording."""
        return {each.name: getattr(self, each.name) for each in fields(self)}

    def __getitem__(self, name: str) -> np.ndarray:
        """Samples (T,) of a channel in its unit; ValueError for an unknown name, with the names that are near."""
        try:
            return self.channels[name]
        except KeyError:
            raise ValueError(f"no channel {name!r} in this recording; {did_you_mean(name, self.channels)}") from None

    def __repr__(self) -> str:
        what = " ".join(str(self.meta[key]) for key in ("manoeuvre", "friction") if self.meta.get(key))
        span = f"{self.time.size} samples from {self.time[0]:g} to {self.time[-1]:g} s"
        return f"<Recording{f' of {what}' if what else ''}: {len(self.channels)} channels, {span}>"

    def _repr_html_(self) -> str:
        rows = []
        for name, values in self.channels.items():
            there = values[np.isfinite(values)]
            low, high = (float(there.min()), float(there.max())) if there.size else (np.nan, np.nan)
            rows.append({"channel": name, "unit": self.units[name], "least": low, "largest": high})
        return shown.html(repr(self), rows)

    def to_frame(self) -> Any:
        """The channels as columns of a ``pandas.DataFrame`` in SI units, over the time [s].

        ``attrs`` of the frame has ``units`` and ``meta``; ImportError without pandas.
        """
        found = shown.frame(dict(self.channels), index=self.time)
        found.index.name = "time"
        found.attrs = {"units": dict(self.units), "meta": deepcopy(dict(self.meta))}
        return found

    def plot(self, x: str, y: str | Sequence[str], axes: Any = None) -> Any:
        """Draw channels over the time or over another channel, angles in degrees and all else in SI units.

        Parameters
        ----------
        x : str
            A channel, or ``"time"``.
        y : str or sequence of str
            One channel, or several of one unit, which a legend then names.
        axes : matplotlib.axes.Axes, optional
            Where to draw; by default in a new figure of pyplot.

        Returns
        -------
        matplotlib.axes.Axes

        Raises
        ------
        ValueError
            There is no such channel, or those of ``y`` have several units.
        """
        names = [y] if isinstance(y, str) else list(y)
        curves = [self._drawn(name) for name in names]
        units = sorted({unit for _, unit in curves})
        if len(units) != 1:
            raise ValueError(f"y must be channels of one unit, got {names} in {units}: draw them in several plots")
        over, unit = (self.time, "s") if x == "time" else self._drawn(x)
        axes = axes if axes is not None else shown.new_axes()
        for name, (values, _) in zip(names, curves):
            axes.plot(over, values, label=name.replace("_", " "))
        about = names[0].replace("_", " ") if len(names) == 1 else ""
        axes.set(xlabel=f"{x.replace('_', ' ')} [{unit}]", ylabel=f"{about} [{units[0]}]".lstrip())
        if not about:
            axes.legend()
        return axes

    def _drawn(self, name: str) -> tuple[np.ndarray, str]:
        """A channel (T,) as a reader sees it, angles in degrees, and its unit."""
        values, unit = self[name], self.units[name]
        return (values / DEGREE, unit.replace("rad", "deg")) if unit.startswith("rad") else (values, unit)

    @cached_property
    def rate(self) -> float:
        """Sampling rate [Hz]; ValueError unless every sample is within a fifth of a step of a uniform grid."""
        uniform = np.linspace(self.time[0], self.time[-1], self.time.size)
        step = uniform[1] - uniform[0]
        if np.max(np.abs(self.time - uniform)) > 0.2 * step:  # time stamps may be rounded
            taken = np.diff(self.time)
            k = int(np.argmax(taken))
            raise ValueError(
                f"the time steps are not uniform: from {self.time[k]:g} to {self.time[k + 1]:g} s is "
                f"{taken[k] / np.median(taken):.3g} times the median step; call bridged() if rows are missing, "
                "else resampled(rate)"
            )
        return float(1 / step)

    def between(self, t0: float, t1: float) -> "Recording":
        """The samples with ``t0 <= time <= t1`` [s]; ValueError if there are fewer than two."""
        inside = (self.time >= t0) & (self.time <= t1)
        if np.count_nonzero(inside) < 2:
            raise ValueError(f"no samples from {t0} to {t1} s; time runs from {self.time[0]} to {self.time[-1]} s")
        kept = {name: values[inside] for name, values in self.channels.items()}
        return replace(self, time=self.time[inside], channels=kept)

    def without(self, *names: str) -> "Recording":
        """The recording without these channels; ValueError for an unknown name."""
        for name in names:
            self[name]
        kept = {name: values for name, values in self.channels.items() if name not in names}
        return replace(self, channels=kept, units={name: self.units[name] for name in kept})

    def without_offset(self, name: str, value: float) -> "Recording":
        """The recording with a sensor's reading at zero, ``value`` in the channel's unit, subtracted from a channel."""
        return self._with(name, self[name] - number(f"offset of {name!r}", value))

    def delayed(self, name: str, seconds: float) -> "Recording":
        """The recording with a channel shifted to later by ``seconds``, to earlier if negative, interpolated linearly.

        All channels are trimmed at the end at which the shifted channel has no samples. Values inside a gap of the
        channel are NaN. A channel that is sampled more slowly than the others, with NaN between its samples, is
        interpolated between its own samples.

        Raises
        ------
        ValueError
            If there is no such channel, or if fewer than two samples remain.
        """
        seconds = number(f"delay of {name!r}", seconds)
        read_at = self.time - seconds
        slack = 1e-6 * (self.time[1] - self.time[0])  # a delay of whole steps loses no further sample to rounding
        inside = np.flatnonzero((read_at >= self.time[0] - slack) & (read_at <= self.time[-1] + slack))
        if inside.size < 2:
            span = self.time[-1] - self.time[0]
            raise ValueError(f"delay of {name!r} is {seconds:g} s; of {span:g} s in all, fewer than two samples remain")
        moved = interpolated(np.clip(read_at, self.time[0], self.time[-1]), self.time, self[name])
        return self._with(name, moved).between(self.time[inside[0]], self.time[inside[-1]])

    def bridged(self, longest: float = 0.1) -> "Recording":
        """The recording with gaps closed by linear interpolation, and with missing rows inserted at even steps.

        Parameters
        ----------
        longest : float
            Longest gap that is closed: the number of missing samples times the median step [s].

        Raises
        ------
        ValueError
            If a gap is longer, or is at either end of a channel; with the channel, the place and the length.
        """
        longest = number("longest", longest, minimum=0.0)
        count, step = step_counts(self.time), float(np.median(np.diff(self.time)))
        missing = (count - 1) * step
        if np.any(missing > longest * (1 + 1e-9)):
            k = int(np.argmax(missing))
            raise ValueError(
                f"rows are missing in every channel from {self.time[k]:g} to {self.time[k + 1]:g} s: {missing[k]:g} s, "
                f"allowed is longest={longest:g} s; raise longest, or cut the recording there with between(t0, t1)"
            )
        start = np.concatenate([[0], np.cumsum(count)])  # index of each sample among all rows
        time = np.interp(np.arange(start[-1] + 1), start, self.time)
        time[start] = self.time
        filled = {}
        for name, values in self.channels.items():
            there = np.flatnonzero(~np.isnan(values))
            if there.size < values.size:
                self._refuse_gaps(name, there, start, step, longest)
            filled[name] = np.interp(time, self.time[there], values[there])
            filled[name][start[there]] = values[there]
        return replace(self, time=time, channels=filled)

    def _refuse_gaps(self, name: str, there: np.ndarray, start: np.ndarray, step: float, longest: float) -> None:
        """ValueError if the samples at the indices ``there`` leave a gap at an end, or one longer than ``longest``."""
        if there.size < 2:
            raise ValueError(f"channel {name!r} has {there.size} samples: leave it out with without({name!r})")
        first, last = self.time[there[0]], self.time[there[-1]]
        for missing, where in ((first - self.time[0], "begins"), (self.time[-1] - last, "ends")):
            if missing:
                raise ValueError(
                    f"channel {name!r} has a gap of {missing:g} s where the recording {where}; cut it off with "
                    f"between({first:.10g}, {last:.10g}), or leave the channel out with without({name!r})"
                )
        gaps = (np.diff(start[there]) - 1) * step
        k = int(np.argmax(gaps))
        if gaps[k] > longest * (1 + 1e-9):
            raise ValueError(
                f"channel {name!r} has a gap from {self.time[there[k]]:g} to {self.time[there[k + 1]]:g} s: "
                f"{gaps[k]:g} s, allowed is longest={longest:g} s; raise longest, "
                f"cut the recording there with between(t0, t1), or leave the channel out with without({name!r})"
            )

    def _with(self, name: str, values: np.ndarray) -> "Recording":
        return replace(self, channels={**self.channels, name: values})

    def resampled(self, rate: float) -> "Recording":
        """The recording interpolated linearly at a uniform ``rate`` [Hz] from the first sample on.

        Missing rows of any length are interpolated: call ``bridged`` first, which refuses long gaps. Beside a NaN the
        result is NaN. Nothing is smoothed: before a change to a lower rate, call ``filtered`` with less than half of
        it.
        """
        span = self.time[-1] - self.time[0]
        if not (np.isfinite(rate) and rate * span >= 1):
            raise ValueError(f"rate is {rate} Hz; it must give at least two samples in {span} s")
        time = self.time[0] + np.arange(int(rate * span + 1e-9) + 1) / rate
        read = {name: np.interp(time, self.time, values) for name, values in self.channels.items()}
        return replace(self, time=time, channels=read)

    def filtered(self, cutoff_hz: float) -> "Recording":
        """The recording after the same zero-phase Butterworth low-pass of all channels, which skews no loop.

        Parameters
        ----------
        cutoff_hz : float
            Frequency at which the amplitude is halved (-6 dB: 3 dB forwards and 3 dB backwards) [Hz].

        Raises
        ------
        ValueError
            If the time steps are not uniform, the sampling rate is below four times the cutoff, the recording is
            shorter than the filter's run-in, or a channel has a sample that is not finite.
        """
        smooth = {name: low_passed(name, v, cutoff_hz, self.rate) for name, v in self.channels.items()}
        return replace(self, channels=smooth)


def low_passed(name: str, values: np.ndarray, cutoff_hz: float, rate: float) -> np.ndarray:
    """A channel (T,) after the low-pass of :meth:`Recording.filtered`; the name appears in errors."""
    if not (np.isfinite(cutoff_hz) and cutoff_hz > 0):
        raise ValueError(f"cutoff_hz is {cutoff_hz}; it must be positive and finite")
    if rate < SAMPLES_PER_CUTOFF * cutoff_hz * (1 - 1e-9):
        raise ValueError(
            f"sampling at {rate:.4g} Hz is too slow for a low-pass at {cutoff_hz:g} Hz; "
            f"record at {SAMPLES_PER_CUTOFF * cutoff_hz:g} Hz or faster"
        )
    run_in = int(np.ceil(rate / cutoff_hz))
    if values.size <= run_in:
        raise ValueError(f"{values.size} samples are too few for a low-pass at {cutoff_hz:g} Hz: needs {run_in}")
    if not np.all(np.isfinite(values)):
        raise ValueError(
            f"channel {name!r} has samples that are not finite: close gaps with bridged(), "
            f"or leave the channel out with without({name!r})"
        )
    # here, because it imports scipy and numba, which takes longer than the start of an environment
    from steer_env.recording.zero_phase import zero_phase

    return zero_phase(values, cutoff_hz, rate, run_in)


def step_counts(time: np.ndarray) -> np.ndarray:
    """Number of median steps from each sample to the next, (T - 1,); above 1 where rows are missing."""
    step = np.diff(time)
    return np.maximum(np.rint(step / np.median(step) - 1e-9), 1.0).astype(int)


def interpolated(at: np.ndarray, time: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Linear interpolation at ``at`` of ``values`` at ``time``; NaN outside and in gaps.

    Only samples that are not NaN count. A gap is a step between them that is longer than 1.5 times their median step,
    so a channel with a sample in every tenth row has no gap.
    """
    there = ~np.isnan(values)
    time, values = time[there], values[there]
    if time.size < 2:
        return np.full(at.size, np.nan)
    read = np.interp(at, time, values, left=np.nan, right=np.nan)
    k = np.clip(np.searchsorted(time, at, side="right") - 1, 0, time.size - 2)
    slack = 1e-6 * np.median(np.diff(time))  # rounding must not miss a sample
    read[(step_counts(time)[k] > 1) & (at > time[k] + slack) & (at < time[k + 1] - slack)] = np.nan
    return read


def check_meta(key: Any, value: Any) -> None:
    """ValueError unless the key is one line of text without a colon, and the value is one that JSON holds."""
    if not (isinstance(key, str) and key and key == key.strip() and ":" not in key and len(key.splitlines()) == 1):
        raise ValueError(f"meta key {key!r} must be a single line without a colon or spaces around it")
    if not _is_json(value):
        raise ValueError(
            f"meta {key!r} is {value!r}; allowed are text, numbers, true, false, None, and lists and dicts of these"
        )


def _is_json(value: Any) -> bool:
    if isinstance(value, dict):
        return all(isinstance(key, str) and _is_json(entry) for key, entry in value.items())
    if isinstance(value, list):
        return all(map(_is_json, value))
    return value is None or isinstance(value, str | int | float)


def _frozen(values: Any, name: str) -> np.ndarray:
    """A read-only (T,) copy in double precision; an array that is one already, as of another recording, is itself."""
    kept = type(values) is np.ndarray and values.dtype == float and values.base is None and not values.flags.writeable
    array = values if kept else np.array(values, dtype=float)
    if array.ndim != 1:
        raise ValueError(f"{name!r} has shape {array.shape}; expected one value a sample, (T,)")
    array.flags.writeable = False
    return array


def require_moderate(recording: Recording) -> None:
    """ValueError for a finite sample above ``LARGEST``, whose powers exceed the numbers of a computer."""
    for name, values in recording.channels.items():
        large = np.isfinite(values) & (np.abs(values) > LARGEST)
        if large.any():
            k = int(np.argmax(large))
            raise ValueError(f"channel {name!r}, sample {k + 1}: expected at most {LARGEST:g}, got {values[k]:g}")
