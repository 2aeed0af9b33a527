"""The linear single-track car in our manoeuvres: our metrics against the analysis of python-control."""

from collections.abc import Iterator
from typing import Any

import control
import numpy as np
from numpy.typing import NDArray

from steer_env import manoeuvres
from steer_env.metrics import CHANNELS, evaluate, frequency_response_curve
from steer_env.recording.recording import DEGREE, Recording
from steer_env.vehicle import cars
from steer_env.vehicle.analysis.linear import from_car
from steer_env.vehicle.constants import GRAVITY as G
from steer_env.vehicle.steering.eps import SAMPLE_TIME

Array = NDArray[Any]

SPEED = 80 / 3.6  # [m/s]
OUTPUTS = ("yaw_rate", "lateral_acceleration")
QUICK = 0.01  # rise time of the handwheel angle that stands for a unit step [s]


def system(car: str = "ford_escort") -> control.StateSpace:
    """The car's linear model, handwheel angle to lateral speed, yaw rate and lateral acceleration.

    The default is a car whose yaw rate has a resonance, so that every metric exists.
    """
    return from_car(cars.load(car), SPEED).state_space("handwheel")


def drive(model: control.StateSpace, name: str, amplitude: float = 0.3, **options: Any) -> Recording:
    """A recording (1 kHz) of the linear car in one of our manoeuvres.

    Parameters
    ----------
    model : control.StateSpace
        From :func:`system`.
    name : str
        Name of the manoeuvre.
    amplitude : float
        Amplitude of the handwheel angle [rad].
    options
        Options of the manoeuvre.
    """
    manoeuvre = manoeuvres.make(name, **options)
    time = SAMPLE_TIME * np.arange(round(manoeuvre.duration / SAMPLE_TIME) + 1.0)
    angle, _ = manoeuvre.hand(np.asarray(time, dtype=np.float64), amplitude)
    outputs = control.forced_response(model, time, angle).outputs
    channels = {"handwheel_angle": angle, "vehicle_speed": np.full(time.size, SPEED)}
    channels |= dict(zip(("lateral_speed", *OUTPUTS), outputs))
    meta = {"manoeuvre": name, **manoeuvre.meta}
    return Recording(time, channels, {key: CHANNELS[key] for key in channels}, meta)


def errors() -> Iterator[tuple[str, float]]:
    """Name of each comparison, and the error relative to python-control's value (of a phase: [rad])."""
    model = system()
    yield from _frequency_errors(model)
    yield from _step_errors(model)


def _frequency_errors(model: control.StateSpace) -> Iterator[tuple[str, float]]:
    # Random steering needs this length, as each segment cuts the response off at its ends, which acts as noise.
    for test, options in (("frequency-response", {}), ("random-steer", {"duration": 1440.0})):
        recording = drive(model, test, **options)
        found = {name: value.value for name, value in evaluate(recording).items()}
        for name in OUTPUTS:
            seen, own = frequency_response_curve(recording, name), model[name, "handwheel_angle"]
            true = _response(own, seen.frequency)
            yield f"{test}, {name}: gain", float(np.abs(np.abs(seen.response / true) - 1.0).max())
            yield f"{test}, {name}: phase", float(np.abs(np.angle(seen.response / true)).max())
            fine = np.arange(0.2, 3.0, 1e-4)
            true = _response(own, fine)
            gain, phase = np.abs(true), np.unwrap(np.angle(true))
            expected = {"phase_lag_at_1hz": -np.interp(1.0, fine, phase) / DEGREE}
            # Without the relaxation of the tyres the lateral acceleration hardly reaches this phase.
            if phase.min() < -np.pi / 4 - 0.05:
                expected["equivalent_time"] = 1.0 / (2.0 * np.pi * fine[np.argmax(phase <= -np.pi / 4)])
            if name == "yaw_rate":
                expected["steady_state_gain"] = gain[0]
                expected["resonance_frequency"] = fine[np.argmax(gain)]
                expected["resonance_ratio"] = gain.max() / gain[0]
            else:
                expected["steady_state_gain"] = gain[0] * 100 * DEGREE / G
                expected["bandwidth"] = fine[np.argmax(gain <= gain[0] / np.sqrt(2.0))]
            for key, value in expected.items():
                yield f"{test}, {name}: {key.replace('_', ' ')}", abs(found[f"{name}_{key}"] / value - 1.0)


def _response(own: control.StateSpace, frequency: Array) -> NDArray[np.complex128]:
    return control.frequency_response(own, 2.0 * np.pi * frequency).frdata[0, 0]


def _step_errors(model: control.StateSpace) -> Iterator[tuple[str, float]]:
    """A quick step against the system's unit step, and the manoeuvre's step against the analysis of its response."""
    for what, options in (("unit step", {"rise": QUICK}), ("step-steer", {})):
        amplitude = 4.0 / float(model.dcgain()[2, 0])
        recording = drive(model, "step-steer", amplitude, right=False, **options)
        found = {name: value.value for name, value in evaluate(recording).items()}
        rise = options.get("rise", 0.2)
        one = recording.between(1.0, 1.0 + rise + 4.8)  # from the start of the step to its end
        for name in OUTPUTS:
            own = model[name, "handwheel_angle"]
            gain = float(own.dcgain()) * (1.0 if name == "yaw_rate" else 100 * DEGREE / G)
            yield f"{what}, {name}: gain", abs(found[f"{name}_step_gain"] / gain - 1.0)
            if what == "unit step":
                info, late = control.step_info(own, T=np.arange(0.0, 5.0, 1e-3), SettlingTimeThreshold=0.05), 0.0
            else:
                final = amplitude * float(own.dcgain())
                info = control.step_info(one[name], T=one.time - 1.0, yfinal=final, SettlingTimeThreshold=0.05)
                late = 0.5 * rise  # the metrics count from the instant of half the handwheel angle
                yield f"{what}, {name}: rise time", abs(found[f"{name}_rise_time"] / info["RiseTime"] - 1.0)
            # the overshoot is relative to the steady value already
            yield f"{what}, {name}: overshoot", abs(found[f"{name}_overshoot"] - info["Overshoot"] / 100.0)
            for key, own_key in (("peak_time", "PeakTime"), ("settling_time", "SettlingTime")):
                yield (
                    f"{what}, {name}: {key.replace('_', ' ')}",
                    abs(found[f"{name}_{key}"] / (info[own_key] - late) - 1.0),
                )
