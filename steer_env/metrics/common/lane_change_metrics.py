"""Metrics of lane changes: whether the car passes the cones, at what speed, and how far hands and car must move.

A recording is transformed into the axes of the course (:mod:`steer_env.courses.iso3888`) with the place of the first
cones, which the meta or the conditions give. A pass lasts from the car's front at the first cones to its rear at the
last cones; each pass in a recording is a repeat. Driving back beside the course does not count. The channels are
relative to their mean from two seconds to one second before the pass, where the car runs straight.
"""

from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy import stats
from scipy.integrate import trapezoid
from scipy.interpolate import CubicSpline

from steer_env.courses import iso3888
from steer_env.metrics.common.definitions import SPEED_SPREAD, Array, Bounded, RefusedError, metric, register_evaluation
from steer_env.metrics.common.filtered_channels import ANGLE, AY, SPEED, TORQUE, YAW, FilteredChannels
from steer_env.metrics.common.kept import kept
from steer_env.metrics.common.noise import in_band
from steer_env.recording.recording import DEGREE, Recording

RATE = "handwheel_speed"
CUTOFF = 10.0  # low-pass [Hz]
PLACE_TIME_STEP = 0.001  # time step at which the place of the car is computed [s]
CONE_NEIGHBOURHOOD = 1.0  # distance ahead of the outline and behind it within which a cone is considered; assumed [m]
PEAK_WINDOW = 0.08  # half width of the fourth-order polynomial from which a peak is read; assumed [s]
SPEED_WINDOW = 0.1  # half width of the window over which a speed is averaged; assumed [s]
STRAIGHT = (-2.0, -1.0)  # section, relative to the first cones, in which a sensor's zero is read; assumed [s]
LAG_STEP = 0.005  # time step at which the channels in a pass are read [s]
LAGS = LAG_STEP * np.arange(-40, 121)  # delays at which a channel is compared with the handwheel; assumed [s]
LEAST_ANGLE = 5 * DEGREE  # least handwheel angle in a lane change; assumed [rad]

NEEDED = {
    "entry_x_m": "x of the first cones in the recording's axes",
    "entry_y_m": "y of the middle between the first cones",
    "edition": "year of the standard whose course it is",
    "vehicle_width_m": "overall width of the car without mirrors",
    "vehicle_length_m": "overall length of the car",
}


class Passes:
    """The passes through a course in a recording.

    Raises RefusedError if the conditions do not say where the course is, if position or direction is missing, if no
    pass begins, or if the car enters a double lane change at another speed than ``speed_m_s``.
    """

    def __init__(self, recording: Recording, conditions: Mapping[str, Any], name: str) -> None:
        for key, meaning in NEEDED.items():
            if conditions[key] is None:
                raise RefusedError(f"{key} is not known ({meaning}): give it in the meta or as a condition, {key}=...")
        length, width, centre = (conditions[f"vehicle_{key}_m"] for key in ("length", "width", "centre"))
        self._car = iso3888.Footprint(length, width, centre)
        self._course = iso3888.course(name, self._car.width, conditions["edition"], bool(conditions["mirrored"]))
        if "yaw_angle" in recording.units:  # it may jump by a turn
            channels = {**recording.channels, "yaw_angle": np.unwrap(recording["yaw_angle"])}
            recording = replace(recording, channels=channels)
        self._smooth = FilteredChannels(recording, CUTOFF)
        self._time = self._smooth.time
        east, north = self._smooth["x"] - conditions["entry_x_m"], self._smooth["y"] - conditions["entry_y_m"]
        c, s = np.cos(conditions["entry_yaw_rad"]), np.sin(conditions["entry_yaw_rad"])
        yaw = self._smooth["yaw_angle"] - conditions["entry_yaw_rad"]
        self._pose = CubicSpline(self._time, np.column_stack([c * east + s * north, c * north - s * east, yaw]))
        self._find(self._pose(self._time)[:, 0] + self._car.centre)
        if conditions.get("speed_m_s") and SPEED in self._smooth and self._times.size:
            found = self.speed(0)
            if np.any(np.abs(found / conditions["speed_m_s"] - 1.0) > SPEED_SPREAD):
                speeds = ", ".join(f"{3.6 * v:.4g}" for v in found)
                raise RefusedError(
                    f"the car enters at {speeds} km/h, not at {3.6 * conditions['speed_m_s']:.4g} km/h "
                    f"+- {SPEED_SPREAD:.0%}: enter at that speed, or say that the test was at "
                    f"speed_m_s={found.mean():.4g}"
                )

    def _find(self, x: Array) -> None:
        """Find the passes from the place x (T,) of the outline's middle [m]; refused where none begins.

        ``_begun`` counts the passes that begin; ``_times`` holds the begin and the end of those that reach the last
        cones [s].
        """
        ahead, length = 0.5 * self._car.length, self._course.length
        inside = (x + ahead > 0.0) & (x - ahead < length)
        begins, times = [], []
        for k in np.flatnonzero(inside[1:] & ~inside[:-1]).tolist():
            if x[k] + ahead > 0.0:
                continue  # the car comes from the far end
            left = np.flatnonzero(~inside[k + 1 :])
            j = k + 1 + left[0] if left.size else -1
            begins.append(k)
            if j > 0 and x[j] - ahead >= length:
                times.append([_crossing(self._time, x + ahead, k), _crossing(self._time, x - ahead - length, j - 1)])
        if not begins:
            raise RefusedError(
                "the car's front never passes the first cones: start the recording before them, and check entry_x_m, "
                "entry_y_m and entry_yaw_rad"
            )
        self._begun, self._times = len(begins), np.array(times).reshape(-1, 2)

    @property
    def times(self) -> Array:
        """Begin and end of the passes (n, 2) that reach the last cones [s]; refused where none does."""
        if not self._times.size:
            raise RefusedError("no pass reaches the last cones: record until the car is behind them")
        return self._times

    def _instants(self, step: float = PLACE_TIME_STEP) -> list[Array]:
        return [np.linspace(a, b, int(np.ceil((b - a) / step)) + 1) for a, b in self.times]

    @cached_property
    def _distances(self) -> list[tuple[Array, NDArray[np.int64]]]:
        """For each pass the distances of the outline from cones beside it [m] and the indices of these cones, (K,)."""
        cones, found = np.concatenate([self._course.left, self._course.right]), []
        reach = 0.5 * self._car.length + abs(self._car.centre) + CONE_NEIGHBOURHOOD
        for pose in self._poses:
            instant, cone = np.nonzero(np.abs(pose[:, :1] - cones[:, 0]) <= reach)
            found.append((iso3888.cone_margins(cones[cone], self._car, *pose[instant].T), cone))
        return found

    @cached_property
    def _poses(self) -> list[Array]:
        """For each pass the position and direction (T, 3) in the course's axes [m, m, rad]."""
        return [self._pose(t) for t in self._instants()]

    @cached_property
    def margins(self) -> list[Array]:
        """For each pass the least distance to each cone (N,) [m]; infinite for a cone that the car was never beside."""
        count, found = len(self._course.left) + len(self._course.right), []
        for distances, cone in self._distances:
            least = np.full(count, np.inf)
            np.minimum.at(least, cone, distances)
            found.append(least)
        return found

    @cached_property
    def margin_bias(self) -> float:
        """Mean amount by which noise of position and direction makes a least distance too small [m].

        It is the expected minimum of the noise over those distances that differ by no more than noise from the least
        one. Two of them are independent in each period of the cutoff.
        """
        position = max(in_band(self._smooth, name, CUTOFF) for name in ("x", "y"))
        noise = float(np.hypot(position, 0.5 * self._car.length * in_band(self._smooth, "yaw_angle", CUTOFF)))
        similar = np.mean([np.count_nonzero(d < d.min() + 4.0 * noise) for d, _ in self._distances])
        return noise * float(stats.norm.isf(0.5 / max(2.0 * CUTOFF * PLACE_TIME_STEP * float(similar), 1.0)))

    def completed(self) -> Array:
        """1 (n,) for a pass that reaches the last cones with the outline's middle between the lanes' edges, else 0."""
        found = [0.0] * (self._begun - len(self._times))
        if not self._times.size:
            return np.array(found)
        for pose in self._poses:
            x, y, yaw = pose.T
            x, y = x + self._car.centre * np.cos(yaw), y + self._car.centre * np.sin(yaw)
            in_lane = [
                (gate.right < y) & (y < gate.left) | (x < gate.start) | (x > gate.end) for gate in self._course.gates
            ]
            found.append(float(np.all(in_lane)))
        return np.array(found)

    @kept
    def _curve(self, name: str) -> CubicSpline:
        return CubicSpline(self._time, self._smooth[name])

    @kept
    def _samples(self, name: str) -> list[tuple[Array, Array]]:
        """For each pass the instants [s] and the values of a channel, less its mean in straight running."""
        curve, found = self._curve(name), []
        for t in self._instants(LAG_STEP):
            before = (self._time >= t[0] + STRAIGHT[0]) & (self._time <= t[0] + STRAIGHT[1])
            if self._time[0] > t[0] + STRAIGHT[0] or before.sum() < 2:
                raise RefusedError(
                    f"the recording begins {t[0] - self._time[0]:.2g} s before the first cones: record "
                    f"{-STRAIGHT[0]:g} s of straight running before them"
                )
            found.append((t, curve(t) - self._smooth[name][before].mean()))
        return found

    def steered(self, name: str) -> list[tuple[Array, Array]]:
        """For each pass the instants [s] and the values of a channel.

        Refused where the handwheel hardly turns, or where the channel opposes it.
        """
        for _, correlation in self._lags(name):
            if correlation < 0.0:
                raise RefusedError(f"{name} runs against {ANGLE}: check the signs, a left turn is positive in both")
        return self._samples(name)

    def peak(self, name: str) -> Array:
        """Largest size of a channel (n,), from a polynomial through the values around it."""
        found = []
        for t, values in self.steered(name):
            k = int(np.argmax(np.abs(values)))
            near = np.abs(t - t[k]) <= PEAK_WINDOW
            top = np.polynomial.Polynomial.fit(t[near], values[near] * np.sign(values[k]), 4)
            found.append(np.max(top(t[near])))
        return np.array(found)

    def rms(self, name: str) -> Array:
        """Root mean square of a channel (n,), without the noise."""
        square = np.array([trapezoid(y**2, t) / (t[-1] - t[0]) for t, y in self.steered(name)])
        return np.sqrt(np.maximum(square - in_band(self._smooth, name, CUTOFF) ** 2, 0.0))

    def speed(self, end: int) -> Array:
        """Mean speed (n,) around the begin (``end`` 0) or the end (``end`` 1) of the passes [m/s]."""
        speed, half = self._smooth[SPEED], SPEED_WINDOW
        return np.array([speed[np.abs(self._time - t) <= half * (1 + 1e-9)].mean() for t in self.times[:, end]])

    def lag(self, name: str) -> Array:
        """Delay of a channel behind the handwheel angle (n,) at which they correlate best [s]."""
        self.steered(name)
        return np.array([lag for lag, _ in self._lags(name)])

    @kept
    def _lags(self, name: str) -> list[tuple[float, float]]:
        """For each pass the lag [s] of a channel's best correlation with the handwheel angle, and the correlation [1].

        The handwheel speed is compared with the derivative of the handwheel angle.
        """
        angle, other = self._curve(ANGLE), self._curve(name)
        steering = angle.derivative() if name == RATE else angle
        found = []
        for t0, t1 in self.times:
            t = np.arange(max(t0, self._time[0] - LAGS[0]), min(t1, self._time[-1] - LAGS[-1]), LAG_STEP)
            if t.size < 2 or np.max(np.abs(angle(t))) < LEAST_ANGLE:
                raise RefusedError(f"{ANGLE} stays below {LEAST_ANGLE / DEGREE:g} deg: steer through the course")
            late = t[0] + LAGS[0] + LAG_STEP * np.arange(t.size + LAGS.size - 1)
            a, b = steering(t), sliding_window_view(other(late), t.size)
            a, b = a - a.mean(), b - b.mean(axis=1, keepdims=True)
            size = np.linalg.norm(a) * np.linalg.norm(b, axis=1)
            if not np.all(size > 0.0):
                raise RefusedError(f"{name} does not change while the car passes: check the channel")
            r = b @ a / size
            k = int(np.clip(np.argmax(np.abs(r)), 1, LAGS.size - 2))
            before, here, after = r[k - 1 : k + 2]
            bend = before - 2.0 * here + after
            found.append((LAGS[k] + (0.5 * (before - after) / bend if bend else 0.0) * LAG_STEP, here))
        return found


def _crossing(time: Array, values: Array, k: int) -> float:
    """Time at which values rise through zero after sample ``k`` [s]."""
    return float(time[k] - values[k] * (time[k + 1] - time[k]) / (values[k + 1] - values[k]))


TESTS = ("double-lane-change", "obstacle-avoidance")
_COURSE_PLACE: dict[str, Any] = dict.fromkeys(NEEDED) | {
    "entry_yaw_rad": 0.0,
    "mirrored": False,
    "vehicle_centre_m": 0.0,
}
PLOTS = (("x", "y"), ("time", ANGLE), ("time", TORQUE), ("time", AY))


def register_lane_change(name: str, **conditions: Any) -> None:
    """Register a lane change whose course has the test's name, with conditions besides the place of the course."""
    read = partial(Passes, name=name)
    register_evaluation(name, read, constant_speed=False, plots=PLOTS, **conditions, **_COURSE_PLACE)


SOURCE = "after ISO 3888-1 and ISO 3888-2"
PRACTICE = "lane-change tests of steering-feel practice"


@metric("1", *TESTS, source=SOURCE)
def course_completed(passes: Passes) -> Array:
    """1 for a pass that reaches the last cones with the middle of the car between the lanes' edges, 0 for any other."""
    return passes.completed()


@metric("1", *TESTS, source=SOURCE)
def cones_hit(passes: Passes) -> Bounded:
    """Number of cones whose base the outline of the car, a rectangle, sweeps over.

    The interval includes the cones that are doubtful because of the noise of the position.
    """
    fewest, hit, most = (
        np.array([np.count_nonzero(margins < limit) for margins in passes.margins])
        for limit in (-passes.margin_bias, 0.0, passes.margin_bias)
    )
    return Bounded(hit, float(np.mean(hit - fewest)), float(np.mean(most - hit)))


@metric("m", *TESTS, source=SOURCE)
def smallest_cone_margin(passes: Passes) -> Bounded:
    """Least distance between the outline of the car and a cone; where a cone gets into the outline, minus its depth.

    Noise makes a least value too low; the interval reaches up by that amount.
    """
    return Bounded(np.array([margins.min() for margins in passes.margins]), 0.0, passes.margin_bias)


@metric("km/h", *TESTS, source=SOURCE)
def lane_change_entry_speed(passes: Passes) -> Array:
    """Speed at which the front of the car passes the first cones, as a mean over 0.2 s."""
    return passes.speed(0)


@metric("km/h", *TESTS, source=SOURCE)
def lane_change_exit_speed(passes: Passes) -> Array:
    """Speed at which the rear of the car passes the last cones, as a mean over 0.2 s."""
    return passes.speed(1)


@metric("m/s2", *TESTS, source=PRACTICE)
def lane_change_lateral_acceleration(passes: Passes) -> Array:
    """Largest lateral acceleration, to either side."""
    return passes.peak(AY)


@metric("deg/s", *TESTS, source=PRACTICE)
def lane_change_yaw_rate(passes: Passes) -> Array:
    """Largest yaw rate, to either side."""
    return passes.peak(YAW)


@metric("deg", *TESTS, source=PRACTICE)
def lane_change_handwheel_angle(passes: Passes) -> Array:
    """Largest handwheel angle, to either side."""
    return passes.peak(ANGLE)


@metric("deg/s", *TESTS, source=PRACTICE)
def lane_change_handwheel_speed(passes: Passes) -> Array:
    """Largest handwheel speed, in either direction."""
    return passes.peak(RATE)


@metric("N m", *TESTS, source=PRACTICE)
def lane_change_handwheel_torque(passes: Passes) -> Array:
    """Largest hand torque, to either side."""
    return passes.peak(TORQUE)


@metric("N m", *TESTS, source=PRACTICE)
def lane_change_torque_rms(passes: Passes) -> Array:
    """Root mean square of the hand torque; white noise, estimated from the part above 10 Hz, is subtracted."""
    return passes.rms(TORQUE)


@metric("J", *TESTS, source=PRACTICE)
def lane_change_steering_effort(passes: Passes) -> Array:
    """Integral of |hand torque x handwheel speed| over time: the work of the hands on the handwheel and against it."""
    pairs = zip(passes.steered(TORQUE), passes.steered(RATE))
    return np.array([trapezoid(np.abs(T * rate), t) for (t, T), (_, rate) in pairs])


@metric("ms", *TESTS, source=PRACTICE)
def lane_change_yaw_lag(passes: Passes) -> Array:
    """Delay of the yaw rate behind the handwheel angle at which the two correlate best, between -0.2 and 0.6 s."""
    return passes.lag(YAW)
