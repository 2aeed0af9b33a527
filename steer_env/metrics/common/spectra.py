"""Spectra of a recording's segments, and frequency responses of the car to its handwheel computed from them.

    S_xy = (H + H_1 d + H_2 d^2) S_xx        coherence^2 = |S_xy|^2/(S_xx S_yy)

The spectra are sums over segments of the recording: whole sweeps, or Welch's overlapping segments. H at a frequency is
fitted to the spectra at the distances d from it, by least squares with the weights of a triangle of +-0.1 Hz; a mean
alone would flatten the resonance. The coherence is that of means over the triangle. The curvature of the fit also
corrects for the smearing of a curved response by the window. Friction makes a response uneven over frequency, so that
every estimator has another value: the intervals include the value from a triangle of half that width.

The repeats of a metric are the jackknife's pseudo-values n v - (n - 1) v_i, where v_i is the value without segment i;
the metric is their mean. Segments that overlap by half under Hann's window are nearly independent (Welch 1967) except
for their phases, so two neighbours are left out at a time.

Source: Bendat, Piersol, Random Data, 2010, sections 6.2 and 9.2; the local polynomial after Pintelon, Schoukens, System
Identification, 2012, section 7.2; Efron, Tibshirani 1993, chapter 11.
"""

from collections.abc import Callable, Mapping
from itertools import groupby
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import fft, signal, stats

from steer_env.metrics.common import events
from steer_env.metrics.common.definitions import Doubt, RefusedError
from steer_env.metrics.common.filtered_channels import ANGLE, FilteredChannels
from steer_env.metrics.common.kept import anew, kept
from steer_env.recording.recording import Recording

Array = NDArray[np.float64]
Complex = NDArray[np.complexfloating[Any, Any]]
Segments = Callable[[Array, Array], list[slice]]  # (time, angle) -> segments of the recording

CUTOFF = 10.0  # low-pass of input and output alike [Hz]
SPACING, TRIANGLE = 0.05, 0.1  # spacing of the frequencies, half width of the fit around each; assumed [Hz]
NARROW = 0.5  # band by which the effect of the band on a response is estimated, over the band; assumed [1]
LINES = 1.6  # least half width of a band over the spacing of a segment's lines: three lines for a parabola [1]
STILL = 0.5  # time before a sweep that belongs to its segment [s]
COHERENT = 0.9  # least squared coherence of a meaningful response; assumed, common practice [1]
EXCITED = 0.01  # least power of the handwheel angle, as a fraction of its median over frequency; assumed [1]


class Curve(NamedTuple):
    """A frequency response with 95 % intervals, for plots; every field has shape (F,)."""

    frequency: Array  # [Hz]
    response: Complex  # output over input [SI]
    coherence: Array  # squared [1]
    gain_low: Array  # lower end of the interval of the response's size [SI]
    gain_high: Array  # upper end [SI]
    phase_low: Array  # lower end of the interval of the response's phase [rad]
    phase_high: Array  # upper end [rad]


class Spectra:
    """Spectra of the segments of a recording, and the frequency responses from them.

    Parameters
    ----------
    recording : Recording
    conditions : mapping
        Conditions ``lowest_hz`` and ``highest_hz``: the band that is read.
    segments : callable
        Finds the segments from time and handwheel angle.
    window : str
        Window of a segment, a name that scipy knows.
    fewest : int
        Least number of segments.
    shortage : str
        What is said where there are fewer, after their number.
    still : float
        Time before the handwheel moves with which every segment begins [s]. The straight line through a channel in
        these times is subtracted: it is the drift of the sensor.
    together : int
        Number of consecutive segments that count as one repeat.
    """

    def __init__(
        self,
        recording: Recording,
        conditions: Mapping[str, Any],
        segments: Segments,
        window: str,
        fewest: int,
        shortage: str,
        still: float = 0.0,
        together: int = 1,
    ) -> None:
        self._triangle = TRIANGLE
        self.rate, self._window, self._still = recording.rate, window, still
        self._smooth = FilteredChannels(recording, CUTOFF)
        self._segments = segments(self._smooth.time, self._smooth[ANGLE])
        if len(self._segments) < fewest:
            raise RefusedError(f"{len(self._segments)} {shortage}")
        self.count, self._together = len(self._segments) // together, together
        low, high = conditions["lowest_hz"], conditions["highest_hz"]
        self.frequency = low + SPACING * np.arange(round((high - low) / SPACING) + 1)
        power = self._power(ANGLE, ANGLE)[..., 0].real.sum(axis=0)
        weak = self.frequency[power < EXCITED * np.median(power)]
        if weak.size:
            raise RefusedError(
                f"{ANGLE} is not excited at {weak[0]:.2f} Hz: steer from {low:g} to {high:g} Hz, "
                "or name the band that is excited in the meta, e.g. by a mapping, [meta] lowest_hz and highest_hz"
            )

    def doubts(self) -> list[Doubt]:
        """What the recording leaves open: over which band a response that friction makes uneven is to be averaged."""
        line = self.rate / min(segment.stop - segment.start for segment in self._segments)
        narrow = anew(self, "_transform")  # which the band does not change
        narrow._triangle = max(NARROW * TRIANGLE, LINES * line)
        if narrow._triangle >= self._triangle:
            return []
        remedy = "steer further, so that friction matters less"
        return [Doubt("the band of the estimate", remedy, (narrow,))]

    @kept
    def _transform(self, name: str) -> list[Complex]:
        """Fourier transform of each segment less its mean, from 0 Hz to above the band; its square is a density."""
        channel, time = self._smooth[name], self._smooth.time
        rest = [np.arange(segment.start, segment.start + round(self._still * self.rate)) for segment in self._segments]
        still = np.concatenate(rest)
        if still.size:  # the drift of a sensor would dominate at low frequencies
            channel = channel - np.polyval(np.polyfit(time[still], channel[still], 1), time)
        found: list[Complex] = []
        for size, alike in groupby(self._segments, lambda segment: segment.stop - segment.start):  # faster together
            window, near, _ = self._weights(size)
            values = np.array([channel[segment] for segment in alike])
            values -= values.mean(axis=1, keepdims=True)
            found.extend(fft.rfft(window * values)[:, :near])  # without padding, an offset does not leak
        return found

    @kept
    def _weights(self, size: int) -> tuple[Array, int, Array]:
        """Window of a segment (T,), number of bins of its transform, and the weights of the moments (bins, F, 5)."""
        window = signal.get_window(self._window, size)
        f = np.fft.rfftfreq(size, 1.0 / self.rate)
        near = int(np.count_nonzero(f < self.frequency[-1] + 2 * TRIANGLE))
        distance = (f[:near, None] - self.frequency) / self._triangle
        weight = np.clip(1.0 - np.abs(distance), 0.0, None)
        return (
            window * np.sqrt(2.0 / (self.rate * np.sum(window**2))),
            near,
            weight[..., None] * distance[..., None] ** np.arange(5),
        )

    @kept
    def _power(self, x: str, y: str) -> Complex:
        """Moments (n, F, 5) of the cross power of each repeat around each frequency; of the power where x is y.

        Their unit is energy per frequency times bins per frequency.
        """
        found = []
        for segment, u, v in zip(self._segments, self._transform(x), self._transform(y)):
            weights = self._weights(segment.stop - segment.start)[2]
            power = (u.conj() * v) @ weights.reshape(len(u), -1).astype(complex)
            found.append(power.reshape(weights.shape[1:]))
        # Overlapping neighbours count as one repeat, so that the jackknife leaves them out together.
        return np.add.reduceat(np.array(found), np.arange(0, len(found) - self._together + 1, self._together))

    def _resolution(self) -> float:
        """Second moment of the window's power over frequency, by which it smears a curved response [triangles squared].

        By Parseval it is the energy of the window's slope over the energy of the window. It is zero for a segment that
        ends at rest, whose window is constant.
        """
        segment = self._segments[0]
        window = self._weights(segment.stop - segment.start)[0]
        moment = np.sum(np.diff(window) ** 2) * self.rate**2 / (4.0 * np.pi**2 * np.sum(window**2))
        return float(moment) / self._triangle**2

    @kept
    def responses(self, name: str) -> tuple[Complex, Complex]:
        """Response (F,) to the handwheel angle from all repeats, and (n, F) without each of them."""
        place = np.add.outer(np.arange(3), np.arange(3))
        xx, xy = self._power(ANGLE, ANGLE).real, self._power(ANGLE, name)[..., :3]

        def fit(xx: Array, xy: Complex) -> Complex:
            found = np.linalg.solve(xx[..., place].astype(complex), xy[..., None])[..., 0]
            return found[..., 0] - self._resolution() * found[..., 2]

        return fit(xx.sum(axis=0), xy.sum(axis=0)), fit(xx.sum(axis=0) - xx, xy.sum(axis=0) - xy)

    @kept
    def coherences(self, name: str) -> tuple[Array, Array]:
        """Squared coherence (F,) of all repeats, and (n, F) without each of them."""
        powers = [self._power(*pair)[..., 0] for pair in ((ANGLE, ANGLE), (name, name), (ANGLE, name))]
        (xx, yy, xy), (a, b, c) = [p.sum(axis=0) for p in powers], [p.sum(axis=0) - p for p in powers]
        return np.abs(xy) ** 2 / (xx.real * yy.real), np.abs(c) ** 2 / (a.real * b.real)

    def check(self, name: str, low: float | None = None, high: float | None = None) -> None:
        """RefusedError where the output is not coherent with the handwheel angle from ``low`` to ``high`` [Hz]."""
        low, high = self.frequency[0] if low is None else low, self.frequency[-1] if high is None else high
        inside = (self.frequency > low - SPACING) & (self.frequency < high + SPACING)
        coherence = np.where(inside, self.coherences(name)[0], 1.0)
        k = int(np.argmin(coherence))
        if not coherence[k] >= COHERENT:
            raise RefusedError(
                f"coherence of {name} is {coherence[k]:.2f} at {self.frequency[k]:.2f} Hz, below {COHERENT:g}: "
                "steer further, avoid other inputs, or record longer"
            )

    def pseudo_values(self, name: str, read: Callable[[Array, Complex], float]) -> Array:
        """The jackknife's pseudo-values (n,) of ``read(frequency, response)``."""
        response, without = self.responses(name)
        return self._jackknife(read(self.frequency, response), [read(self.frequency, h) for h in without])

    def _jackknife(self, whole: Any, without: Any) -> Array:
        return self.count * np.asarray(whole) - (self.count - 1) * np.asarray(without)

    def lowest_coherence(self, name: str) -> Array:
        """Pseudo-values (n,) of the squared coherence at the frequency at which it is lowest."""
        whole, without = self.coherences(name)
        k = int(np.argmin(whole))
        return self._jackknife(whole[k], without[:, k])

    def curve(self, name: str) -> Curve:
        """Response of a channel to the handwheel angle, with its intervals."""
        response, without = self.responses(name)
        t = stats.t.ppf(0.975, self.count - 1)
        gain = self._jackknife(np.log(np.abs(response)), np.log(np.abs(without)))
        turn = self._jackknife(0.0, np.angle(without / response))  # phase relative to that from all repeats
        phase = np.unwrap(np.angle(response))
        (g, dg), (p, dp) = ((v.mean(axis=0), t * stats.sem(v, axis=0)) for v in (gain, turn))
        return Curve(
            self.frequency,
            response,
            self.coherences(name)[0],
            np.exp(g - dg),
            np.exp(g + dg),
            phase + p - dp,
            phase + p + dp,
        )


def sweeps(time: Array, angle: Array) -> list[slice]:
    """The sections of steering between rests of a second or more, each with up to two seconds of rest after it."""
    each = time[1] - time[0]
    middle = float(np.median(angle))
    steered = np.abs(angle - middle) > 0.05 * np.abs(angle - middle).max()
    found = [(i, j) for i, j in events.true_runs(steered, gap=round(1.0 / each)) if (j - i) * each > 10.0]
    ends = [i for i, _ in found[1:]] + [angle.size + round(STILL / each)]
    before = round(STILL / each)
    return [slice(max(i - before, 0), min(j + round(2.0 / each), end - before)) for (i, j), end in zip(found, ends)]


def welch(time: Array, angle: Array, length: float = 25.0) -> list[slice]:
    """Segments of ``length`` [s] that overlap by half."""
    size = round(length / (time[1] - time[0]))
    return [slice(i, i + size) for i in range(0, angle.size - size + 1, size // 2)]
