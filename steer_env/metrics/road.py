"""Free driving: the loops of torque about straight ahead from a driver's irregular motion, by regression.

A weave crosses the centre at one speed of the hands, in either direction, and its loops can be read. A driver crosses
it at all speeds and turns back before a loop is open. What a loop would show is therefore fitted to all samples of a
drive within a window of x, which is the handwheel angle or the lateral acceleration:

    T = T_0 + k x + k_3 x^3 + k_v x (v/v_m - 1) + C th' + I th'' + h D(th)        (R1)
    D' = (1 - D sgn(th')) th'/x_c

T is the torque at the torsion bar or the hands, th the handwheel angle, v the speed, with the mean v_m. The handwheel
angle counts from that at which the lateral acceleration is zero, where that is known. D goes from -1
to 1 while the handwheel moves one way by a few x_c, as the torque of dry friction does (Dahl's law), so that a motion
that ends before counts for the part that it shows. C and I take what grows with the speed and the acceleration of the
hands: damping, inertia, the lag of the car. A loop of a slow sweep has the height 2 h at x = 0 and the slope
k + 3/5 k_3 w^2 of a straight line over the window +-w. Both are read at the speed zero of the hands, so that they
compare with a slow ramp, and not with a weave at 0.2 Hz, whose loops the lag of the car widens.

(R1) is linear but for x_c, which is the value of a grid that leaves least. The drive is cut at gaps and into blocks of
ten seconds. The repeats of a metric are the jackknife's pseudo-values n v - (n - 1) v_i, where v_i is the value without
block i. The interval is widened by the change with the neighbours of x_c in the grid. The share of a value that the
form of (R1) leaves open, ``WIDTH`` or ``SLOPE``, adds to the scatter of the blocks by squares.

Source: the directions of motion after ISO 13674-1; Dahl, Aerospace Report TOR-158, 1968; Efron, Tibshirani, An
Introduction to the Bootstrap, 1993, chapter 11.
"""

from collections.abc import Mapping
from functools import partial
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.friction import response
from steer_env.hand_torque.drive import FEWEST, at_instants, prepared, reversals, uniform_samples
from steer_env.hand_torque.model import smoothed, stretched
from steer_env.metrics.common.confidence import interval
from steer_env.metrics.common.definitions import Bounded, Doubt, RefusedError, declare, metric, register_evaluation
from steer_env.metrics.common.events import true_runs
from steer_env.metrics.common.filtered_channels import ANGLE, AY, SPEED, TORQUE, YAW, DoubleFiltered
from steer_env.metrics.common.kept import anew, kept
from steer_env.metrics.common.loops import WINDOW
from steer_env.metrics.common.straight import describe_zeros
from steer_env.recording.recording import DEGREE, Recording
from steer_env.vehicle.constants import GRAVITY as G

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

SLOWEST = 8.0  # below, the loops are of more than a steady turn; assumed [m/s]
BLOCK_LENGTH = 10.0  # length of a block, longer than what the road and the driver correlate over; assumed [s]
FEWEST_BLOCKS = 6  # from which on their scatter tells an interval; assumed
LEAST_TIME_IN_WINDOW = 1.0  # of a block in the window, so that it counts; assumed [s]
X_C = np.geomspace(0.05, 2.5, 24) * DEGREE  # grid of x_c [rad]
HELD_SPEED_DEVIATION = 0.005  # standard deviation of a speed that is held, over its mean; assumed [1]
LEAST_OUTER_SHARE = 0.02  # least share of the samples beyond half the window, on either side; assumed [1]
# Share of a width and of a slope that the form of (R1) leaves open. Against their slow weaves, five simulated cars with
# four friction laws show -18 (rear-drive saloon, LuGre) to +12 % (compact, Masing) of the widths over the angle, -4 to
# +18 % of those over the lateral acceleration, and -0 to +4 % of the slopes [1].
WIDTH, SLOPE = 0.15, 0.04
CLASSES = ((30, 60), (60, 90), (90, 130))  # of speed; assumed [km/h]


class Curve(NamedTuple):
    """The terms of (R1) that a loop is read from, from all blocks (first row) and without each of them (n + 1, ...)."""

    window: float  # w [SI of x]
    k: Array  # over x/w [N m]
    k_3: Array  # over (x/w)^3 [N m]
    h: Array  # [N m]


class BuildUp(NamedTuple):
    """How dry friction builds up along a drive."""

    x_c: float  # [rad]
    D: Array  # (T,) [1]


class Road:
    """A free drive, and the loops that are fitted to it.

    Raises RefusedError where nothing can be read; the text says what to do.
    """

    def __init__(self, recording: Recording, conditions: Mapping[str, Any]) -> None:
        if TORQUE in recording.channels and "torsion_bar_torque" in recording.channels:
            recording = recording.without("torsion_bar_torque")
        drive = prepared(recording, slowest=SLOWEST)  # its ValueError refuses the whole recording, with the reason
        if isinstance(recording, DoubleFiltered):
            drive = drive._replace(angle=smoothed(drive.angle, drive.dt))
        self._recording, self.drive = recording, drive
        self._twice = isinstance(recording, DoubleFiltered)
        self.blocks = _blocks(drive.weight > 0.0, drive.dt)
        if len(self.blocks) < FEWEST_BLOCKS:
            raise RefusedError(
                f"the drive has {len(self.blocks)} blocks of {BLOCK_LENGTH:g} s without gaps, and {FEWEST_BLOCKS} are "
                "needed: record a longer drive"
            )
        rate = np.gradient(drive.angle, drive.dt)
        self._hands = np.column_stack([rate, np.gradient(rate, drive.dt)])
        self._step = 0  # from the best x_c in the grid

    def doubts(self) -> list[Doubt]:
        """What the drive leaves open: over which distance friction builds up."""
        others = []
        for step in (-1, 1):
            other = anew(self)
            other._step = step
            others.append(other)
        return [Doubt("the distance over which friction builds up", "record a longer drive", tuple(others))]

    def notes(self) -> list[str]:
        """What is told of the drive."""
        used = self.drive.weight > 0.0
        v = 3.6 * self.drive.speed[used]
        mean = f"{v.mean():.0f} km/h"
        span = mean if np.ptp(v) < 1.0 else f"{v.min():.0f} to {v.max():.0f} km/h, {mean} on average"
        found = [
            *self.drive.record_notes,
            f"read from {len(self.blocks)} blocks of about {BLOCK_LENGTH:g} s at {span}, and at the speed zero of the "
            "hands: to be compared with a slow ramp; the curve is a slow cycle by what was fitted",
        ]
        found += describe_zeros({ANGLE: self.zero()}, "where the lateral acceleration is zero")
        if TORQUE not in self._recording.channels:
            found.append("the hand torque is that of the torsion bar")
        if AY not in self._recording.channels and YAW in self._recording.channels:
            found.append(f"{AY} is not recorded: it is {SPEED} times {YAW}, without the change of the lateral speed")
        return found

    @kept
    def _motion(self) -> tuple[Array, Mask]:
        """Lateral acceleration (T,) [m/s2], and where it is known (T,)."""
        channels = self._recording.channels
        name = next((name for name in (AY, YAW) if name in channels and not np.isnan(channels[name]).all()), None)
        if name is None:
            raise RefusedError(
                f"neither {AY} nor {YAW} is recorded: record one of them, or map it from the name that it has in the "
                "file"
            )
        unit = {AY: "m/s2", YAW: "rad/s"}[name]
        if self._recording.units[name] != unit:
            raise RefusedError(f"{name} is in {self._recording.units[name]!r}: give it in {unit!r}")
        try:
            _, weight, _ = uniform_samples(self._recording, {name: name})
        except ValueError as error:
            raise RefusedError(str(error)) from None
        values = smoothed(at_instants(self._recording, name, self.drive.time), self.drive.dt)
        values = smoothed(values, self.drive.dt) if self._twice else values
        return (values if name == AY else values * self.drive.speed), weight > 0.0

    @kept
    def zero(self) -> float:
        """Handwheel angle at which the car goes straight [rad]; 0 where the recording does not tell."""
        try:
            a, known = self._motion()
        except RefusedError:
            return 0.0
        near = known & (self.drive.weight > 0.0) & (np.abs(a) <= 2.0 * WINDOW[AY])
        if near.sum() * self.drive.dt < BLOCK_LENGTH:
            return 0.0
        return float(np.polyfit(a[near], self.drive.angle[near], 1)[1])

    def _channel(self, x: str) -> tuple[Array, Mask]:
        """Values (T,) of what the torque is read over [SI], and where they are known (T,)."""
        if x == AY:
            return self._motion()
        return self.drive.angle - self.zero(), np.ones(self.drive.time.size, bool)

    @kept
    def _friction(self) -> "BuildUp":
        """That of the x_c that leaves least of the torque over the handwheel angle."""
        drive, used = self.drive, self._used(ANGLE, None)
        left, elements = [], []
        for x_c in X_C:
            elements.append(response(stretched("dahl", 1.0, float(x_c)), drive.angle, drive.dt))
            X = np.column_stack([self._columns(ANGLE, used), elements[-1]])[used]
            p = np.linalg.lstsq(X, drive.torque[used], rcond=None)[0]
            left.append(np.sum((drive.torque[used] - X @ p) ** 2))
        best = int(np.argmin(left)) + self._step
        best = min(max(best, 0), len(X_C) - 1)
        return BuildUp(float(X_C[best]), elements[best])

    def _used(self, x: str, speeds: tuple[int, int] | None) -> Mask:
        """Samples (T,) in the window of x, of the blocks, and at the speeds [km/h]."""
        values, known = self._channel(x)
        inside = np.zeros(known.size, bool)
        for block in self.blocks:
            inside[block] = True
        inside &= known & (np.abs(values) <= WINDOW[x])
        if speeds:
            inside &= (self.drive.speed >= speeds[0] / 3.6) & (self.drive.speed < speeds[1] / 3.6)
        return inside

    def _columns(self, x: str, used: Mask) -> Array:
        """The terms of (R1) without friction, (T, 5 or 6); k and k_3 come first."""
        u, v = self._channel(x)[0] / WINDOW[x], self.drive.speed
        found = [u, u**3, np.ones_like(u), self._hands]
        if np.std(v[used]) > HELD_SPEED_DEVIATION * v[used].mean():  # else the term would be none, or one with k
            found.append(u * (v / v[used].mean() - 1.0))
        return np.column_stack(found)

    @kept
    def curve(self, x: str, speeds: tuple[int, int] | None = None) -> Curve:
        """(R1) over x, from all blocks and without each of them, at all speeds or at those of a class [km/h]."""
        if self.drive.turns < FEWEST:
            raise RefusedError(
                f"{ANGLE} turns back {self.drive.turns} times after 0.5 deg or more, and a loop shows at such "
                f"corrections: {FEWEST} are needed"
            )
        used = self._used(x, speeds)
        where = f" at {speeds[0]} to {speeds[1]} km/h" if speeds else ""
        blocks = [block for block in self.blocks if used[block].sum() * self.drive.dt >= LEAST_TIME_IN_WINDOW]
        if len(blocks) < FEWEST_BLOCKS:
            raise RefusedError(
                f"{len(blocks)} blocks of the drive have {LEAST_TIME_IN_WINDOW:g} s or more{where} within the window "
                f"of {x}, and {FEWEST_BLOCKS} are needed: record a longer drive"
            )
        u = self._channel(x)[0][used] / WINDOW[x]
        if min(np.mean(u > 0.5), np.mean(u < -0.5)) < LEAST_OUTER_SHARE:
            size = {ANGLE: f"{0.5 * WINDOW[ANGLE] / DEGREE:g} deg", AY: f"{0.5 * WINDOW[AY] / G:g} g"}[x]
            raise RefusedError(
                f"{x} is seldom beyond {size} to the left and to the right{where}: drive bends both ways"
            )
        X = np.column_stack([self._columns(x, used), self._friction().D])
        size = np.sqrt(np.mean(X[used] ** 2, axis=0))
        X = X / size
        parts = [(X[block][used[block]], self.drive.torque[block][used[block]]) for block in blocks]
        grams, products = (np.array([a.T @ b for a, b in of]) for of in ([(p, p) for p, _ in parts], parts))
        sums = [(grams.sum(0), products.sum(0)), *zip(grams.sum(0) - grams, products.sum(0) - products)]
        p = np.array([np.linalg.solve(*pair) for pair in sums]) / size
        return Curve(WINDOW[x], p[:, 0], p[:, 1], p[:, -1])

    def slope(self, x: str, speeds: tuple[int, int] | None = None) -> Bounded:
        """Slope of torque over x about zero, its pseudo-values (n,) [N m over SI of x]."""
        c = self.curve(x, speeds)
        return _jackknife((c.k + 0.6 * c.k_3) / c.window, SLOPE)

    def height(self, x: str) -> Bounded:
        """Height in torque between both directions of motion at x = 0, its pseudo-values (n,) [N m]."""
        h = self.curve(x).h
        self._require_saturation()
        return _jackknife(2.0 * h, WIDTH)

    def width(self, x: str) -> Bounded:
        """Width in x between both directions of motion at the torque of straight ahead, its pseudo-values (n,) [SI]."""
        c, u = self.curve(x), np.linspace(0.0, 1.0, 201)
        self._require_saturation()
        mean = np.maximum.accumulate(c.k[:, None] * u + c.k_3[:, None] * u**3, axis=1)  # up to where it is reached
        short = mean[:, -1] <= c.h
        if short.any():
            part = "" if short[0] else " in a part of the blocks"
            raise RefusedError(
                f"half the height of the loop, {c.h[0]:.2g} N m, is beyond the torque that the window of {x} reaches, "
                f"{mean[0, -1]:.2g} N m{part}: the loop has no end there"
            )
        at = [np.interp(h, m, u) for h, m in zip(c.h, mean)]
        return _jackknife(2.0 * c.window * np.array(at), WIDTH)

    def _require_saturation(self) -> None:
        """RefusedError where friction builds up over more than the grid of x_c, so that a loop does not open."""
        if self._friction().x_c == X_C[-1]:
            raise RefusedError(
                f"friction builds up over {X_C[-1] / DEGREE:g} deg or more, or there is none: the corrections are too "
                "small to tell it from a stiffness"
            )

    def mean_cycle(self, name: str) -> Array:
        """Handwheel angle [rad] or torque less T_0 [N m] of a slow cycle by (R1), its samples (n,) for a plot."""
        if name not in (ANGLE, TORQUE):
            raise RefusedError(f"a slow cycle has no {name}")
        c, quarter = self.curve(ANGLE), np.linspace(0.0, WINDOW[ANGLE], 101)
        path = np.concatenate([quarter, quarter[-2::-1], -quarter[1:], -quarter[-2::-1]])
        path, kept = np.tile(path, 2), slice(path.size, None)
        if name == ANGLE:
            return path[kept]
        u = path / c.window
        return (
            c.k[0] * u + c.k_3[0] * u**3 + c.h[0] * response(stretched("dahl", 1.0, self._friction().x_c), path, 1.0)
        )[kept]

    def corrections(self) -> Array:
        """Corrections by time (n,), of each block [1/s]."""
        angle, dt = self.drive.angle, self.drive.dt
        return np.array([len(reversals(angle[block])) / (angle[block].size * dt) for block in self.blocks])


def _blocks(used: Mask, dt: float) -> list[slice]:
    """Blocks of about ``BLOCK_LENGTH`` of the samples (T,) that are used, none across a gap."""
    found: list[slice] = []
    for first, last in true_runs(used):
        count = round((last - first) * dt / BLOCK_LENGTH)
        ends = np.linspace(first, last, count + 1).round().astype(int) if count else np.zeros(0, int)
        found += [slice(i, j) for i, j in pairwise(ends)]
    return found


def _jackknife(values: Array, systematic: float) -> Bounded:
    """Pseudo-values (n,) of a value from all blocks (first) and without each of them.

    The bound is what a systematic share of the value adds to the half width of their interval.
    """
    n = values.size - 1
    repeats = n * values[0] - (n - 1) * values[1:]
    half = 0.5 * float(np.ptp(interval(repeats)))
    more = float(np.hypot(half, systematic * values[0])) - half
    return Bounded(repeats, more, more)


def _half(whole: Bounded) -> Bounded:
    return Bounded(whole.values / 2.0, whole.below / 2.0, whole.above / 2.0)


register_evaluation("road", Road, constant_speed=False, plots=((ANGLE, TORQUE),), steered=True, gaps=True)

SOURCE = "after ISO 13674-1, by regression of a free drive"
_road = partial(metric, source=SOURCE)


@_road("N m", "road")
def road_torque_deadband(road: Road) -> Bounded:
    """Height in torque between the two directions of motion at 0 deg, at the speed zero of the hands.

    It is the `torque_deadband` of a slow ramp at the speed of the drive.
    """
    return road.height(ANGLE)


@_road("deg", "road")
def road_angle_deadband(road: Road) -> Bounded:
    """Width in handwheel angle between the two directions of motion where the torque is that of straight ahead.

    It is the `angle_deadband` of a slow ramp at the speed of the drive.
    """
    return road.width(ANGLE)


@_road("N m/deg", "road")
def road_steering_stiffness(road: Road) -> Bounded:
    """Slope of torque over handwheel angle within +-4 deg, on the mean of both directions of motion."""
    return road.slope(ANGLE)


@_road("N m", "road")
def road_torque_at_0g(road: Road) -> Bounded:
    """Half the height in torque between the two directions of motion at 0 g, at the speed zero of the hands."""
    return _half(road.height(AY))


@_road("N m/g", "road")
def road_torque_gradient_at_0g(road: Road) -> Bounded:
    """Slope of torque over lateral acceleration within +-0.05 g, on the mean of both directions of motion."""
    return road.slope(AY)


@_road("g", "road")
def road_lateral_acceleration_at_0nm(road: Road) -> Bounded:
    """Half the width in lateral acceleration between the two directions of motion at the torque of straight ahead."""
    return _half(road.width(AY))


def _by_speed(name: str, unit: str, x: str, over: str) -> None:
    """Register the slope of torque over x in each class of speed."""
    for low, high in CLASSES:

        def read(road: Road, speeds: tuple[int, int] = (low, high)) -> Bounded:
            return road.slope(x, speeds)

        text = f"Slope of torque over {over}, as at all speeds, from {low} to below {high} km/h."
        declare(f"{name}_{low}_to_{high}_kph", unit, text, read, "road", source=SOURCE)


_by_speed("road_steering_stiffness", "N m/deg", ANGLE, "handwheel angle")
_by_speed("road_torque_gradient", "N m/g", AY, "lateral acceleration")


@_road("1/min", "road", source="common use")
def road_corrections_per_minute(road: Road) -> Array:
    """Reversals of the handwheel after a travel of 0.5 deg or more, by time."""
    return road.corrections()
