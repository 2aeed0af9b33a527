"""Frequency responses of yaw rate, lateral acceleration and torque to the handwheel, and the metrics of them.

The swept sine and random steering share these metrics. A metric at a frequency is refused where the squared coherence
at that frequency is below 0.9. All metrics are refused where the handwheel angle is not excited between ``lowest_hz``
and ``highest_hz``. :func:`frequency_response_curve` returns a response for plots.
"""

from collections.abc import Callable
from functools import partial
from operator import methodcaller

import numpy as np

from steer_env.metrics.common import events
from steer_env.metrics.common.definitions import RefusedError, declare, evaluation_of, metric, register_evaluation
from steer_env.metrics.common.filtered_channels import AY, TORQUE, YAW
from steer_env.metrics.common.spectra import Array, Complex, Curve, Spectra
from steer_env.recording.recording import Recording

TESTS = ("frequency-response", "random-steer")
SOURCE = "after ISO 7401 and ISO/TR 8726"


def register_frequency_response(name: str, read: Callable[..., Spectra]) -> None:
    """Register a test that gives frequency responses."""
    register_evaluation(name, read, steered=True, speed_m_s=80 / 3.6, lowest_hz=0.2, highest_hz=2.0)


def frequency_response_curve(recording: Recording, name: str, test: str | None = None) -> Curve:
    """Frequency response of a channel to the handwheel angle, with coherence and 95 % intervals.

    Parameters
    ----------
    recording : Recording
    name : str
        Name of the output channel: yaw_rate, lateral_acceleration, handwheel_torque, ...
    test : str, optional
        ``frequency-response`` or ``random-steer``; by default the manoeuvre that the recording's meta names.

    Raises
    ------
    RefusedError
        If the response cannot be computed from the recording.
    ValueError
        For another test.
    """
    entry = evaluation_of(recording, test)
    if entry.name not in TESTS:
        raise ValueError(f"no frequency response from manoeuvre {entry.name!r}; there is one from {', '.join(TESTS)}")
    conditions = {key: recording.meta.get(key) or value for key, value in entry.conditions.items()}
    return entry.read(recording, conditions).curve(name)


def _interpolate_at(frequency: Array, values: Array, where: float) -> float:
    return float(np.interp(where, frequency, values))


def _gain(where: float | None, frequency: Array, response: Complex) -> float:
    return _interpolate_at(frequency, np.abs(response), frequency[0] if where is None else where)


def _lag(where: float, frequency: Array, response: Complex) -> float:
    return -_interpolate_at(frequency, np.unwrap(np.angle(response)), where)


def _bandwidth(frequency: Array, response: Complex) -> float:
    gain = np.abs(response)
    try:
        return events.crossing(frequency, -(gain / gain[0]), -np.sqrt(0.5))
    except RefusedError:
        raise RefusedError(
            f"the gain does not fall by 3 dB up to {frequency[-1]:.3g} Hz: steer up to a higher frequency, and name it "
            f"in the meta, e.g. by a mapping, [meta] highest_hz = {2.0 * frequency[-1]:.3g}"
        ) from None


def _resonance(frequency: Array, response: Complex) -> tuple[float, float]:
    gain = np.abs(response)
    try:
        return events.peak(frequency, gain, base=gain[0])
    except RefusedError:
        raise RefusedError(f"no resonance: the gain is highest at the end of the band, {frequency[0]:g} Hz") from None


def _equivalent_frequency(frequency: Array, response: Complex) -> float:
    try:
        return events.crossing(frequency, -np.unwrap(np.angle(response)), np.pi / 4)
    except RefusedError:
        raise RefusedError(
            f"the phase does not pass -45 deg between {frequency[0]:g} and {frequency[-1]:g} Hz"
        ) from None


def _check(spectra: Spectra, name: str, high: float | None = None) -> None:
    """Refuse an output that is not coherent up to ``high`` [Hz], or opposes the handwheel at the lowest frequency."""
    spectra.check(name, high=high)
    if spectra.responses(name)[0][0].real <= 0:
        raise RefusedError(f"{name} does not follow handwheel_angle: check the signs, a left turn is positive in both")


def _value(spectra: Spectra, name: str, read: Callable[[Array, Complex], float], high: float | None = None) -> Array:
    _check(spectra, name, high)
    return spectra.pseudo_values(name, read)


def _frequency(spectra: Spectra, name: str, read: Callable[[Array, Complex], float]) -> Array:
    """Pseudo-values of a frequency up to which the output must be coherent; refused where the signs are wrong."""
    _check(spectra, name, spectra.frequency[0])
    _check(spectra, name, read(spectra.frequency, spectra.responses(name)[0]))
    return spectra.pseudo_values(name, read)


def _equivalent_time(spectra: Spectra, name: str) -> Array:
    _frequency(spectra, name, _equivalent_frequency)
    return spectra.pseudo_values(name, lambda f, h: 1.0 / (2.0 * np.pi * _equivalent_frequency(f, h)))


def _of_response(channel: str, unit: str) -> None:
    """Declare the metrics of a response of the car, whose gain has a unit."""
    name = channel.replace("_", " ")

    def of(ending: str, unit: str, definition: str, read: Callable[[Spectra], Array]) -> None:
        declare(f"{channel}_{ending}", unit, definition, read, *TESTS, source=SOURCE)

    of(
        "steady_state_gain",
        unit,
        f"{name.capitalize()} over handwheel angle at the lowest frequency that is read, 0.2 Hz.",
        lambda spectra: _value(spectra, channel, partial(_gain, None), spectra.frequency[0]),
    )
    of(
        "bandwidth",
        "Hz",
        f"Frequency at which the gain of the {name} is 3 dB below the gain at the lowest frequency.",
        lambda spectra: _frequency(spectra, channel, _bandwidth),
    )
    if channel == YAW:
        of(
            "resonance_frequency",
            "Hz",
            f"Frequency of the highest gain of the {name}, from a cubic through the top of the gain.",
            lambda spectra: _frequency(spectra, channel, lambda f, h: _resonance(f, h)[0]),
        )
        of(
            "resonance_ratio",
            "1",
            f"Highest gain of the {name} divided by the gain at the lowest frequency.",
            lambda spectra: _value(spectra, channel, lambda f, h: _resonance(f, h)[1] / abs(h[0])),
        )
    of(
        "phase_lag_at_1hz",
        "deg",
        f"Phase by which the {name} lags the handwheel angle at 1 Hz.",
        lambda spectra: _value(spectra, channel, partial(_lag, 1.0), 1.0),
    )
    of(
        "equivalent_time",
        "s",
        f"T_eq = 1/(2 pi f), where f is the frequency at which the phase of the {name} is -45 deg.",
        lambda spectra: _equivalent_time(spectra, channel),
    )
    of(
        "lowest_coherence",
        "1",
        f"Lowest squared coherence of {name} and handwheel angle in the band.",
        methodcaller("lowest_coherence", channel),
    )


_of_response(YAW, "1/s")
_of_response(AY, "g/100 deg")
_torque_metric = partial(metric, source="common use")


@_torque_metric("N m/deg", *TESTS)
def torque_steady_state_gain(spectra: Spectra) -> Array:
    """Handwheel torque over handwheel angle at the lowest frequency that is read, 0.2 Hz."""
    return _value(spectra, TORQUE, partial(_gain, None), spectra.frequency[0])


@_torque_metric("N m/deg", *TESTS)
def torque_gain_at_1hz(spectra: Spectra) -> Array:
    """Handwheel torque over handwheel angle at 1 Hz."""
    return _value(spectra, TORQUE, partial(_gain, 1.0), 1.0)


@_torque_metric("deg", *TESTS)
def torque_phase_lead_at_1hz(spectra: Spectra) -> Array:
    """Phase by which the handwheel torque leads the handwheel angle at 1 Hz, from their cross spectrum over +-0.1 Hz.

    With friction other estimators differ by some degrees; the interval includes the value from half that band.
    """
    return -_value(spectra, TORQUE, partial(_lag, 1.0), 1.0)


@_torque_metric("1", *TESTS)
def torque_lowest_coherence(spectra: Spectra) -> Array:
    """Lowest squared coherence of handwheel torque and handwheel angle in the band; friction lowers it."""
    return spectra.lowest_coherence(TORQUE)
