"""On-centre metrics: loops between handwheel angle, torque and lateral acceleration, in a weave and in a slow ramp.

The definitions are after ISO 13674-1; :mod:`steer_env.metrics.common.loops` describes how a loop is read. The usual
ranges are for passenger cars at 100 km/h, 0.2 Hz and 2 m/s2; they are assumed, from engineering judgement.
"""

from collections.abc import Callable

import numpy as np

from steer_env.metrics.common.definitions import metric
from steer_env.metrics.common.filtered_channels import ANGLE, AY, TORQUE, YAW
from steer_env.metrics.common.loops import Loops
from steer_env.vehicle.constants import GRAVITY as G

LINEAR = 0.35  # peak lateral acceleration up to which on-centre metrics are meaningful [g]
PLOTS = ((ANGLE, TORQUE), (AY, TORQUE), (ANGLE, AY))


def _loop_metric(
    unit: str,
    usual: tuple[float, float] | None = None,
    validity: tuple[float, float] | None = (0.0, LINEAR),
    tests: tuple[str, ...] = ("weave", "slow-ramp"),
    source: str = "after ISO 13674-1",
) -> Callable[[Callable[[Loops], np.ndarray]], Callable[[Loops], np.ndarray]]:
    return metric(unit, *tests, usual=usual, validity=validity, source=source)


@_loop_metric("N m", usual=(0.6, 2.0))
def torque_at_0g(loops: Loops) -> np.ndarray:
    """Half the height of the loop torque over lateral acceleration at 0 g; positive where the torque leads."""
    return loops.width(TORQUE, AY) / 2


@_loop_metric("N m", usual=(1.5, 3.5), validity=(0.1, LINEAR))
def torque_at_0p1g(loops: Loops) -> np.ndarray:
    """Torque at 0.1 g on the mean of both branches of torque over lateral acceleration."""
    return loops.mean_branch(TORQUE, AY, 0.1 * G)


@_loop_metric("N m/g", usual=(12.0, 30.0), validity=(0.05, LINEAR))
def torque_gradient_at_0g(loops: Loops) -> np.ndarray:
    """Slope of torque over lateral acceleration at 0 g, within +-0.05 g; mean of both branches."""
    return loops.slope(TORQUE, AY)


@_loop_metric("N m/g", usual=(5.0, 16.0), validity=(0.15, LINEAR))
def torque_gradient_at_0p1g(loops: Loops) -> np.ndarray:
    """Slope of torque over lateral acceleration at 0.1 g, within +-0.05 g; mean of both branches."""
    return loops.slope(TORQUE, AY, 0.1 * G)


@_loop_metric("1", usual=(0.3, 0.8), validity=(0.15, LINEAR))
def torque_gradient_ratio(loops: Loops) -> np.ndarray:
    """Torque gradient at 0.1 g divided by the torque gradient at 0 g."""
    return torque_gradient_at_0p1g(loops) / torque_gradient_at_0g(loops)


@_loop_metric("g", usual=(0.02, 0.09))
def lateral_acceleration_at_0nm(loops: Loops) -> np.ndarray:
    """Returnability: half the width of the loop torque over lateral acceleration at 0 N m."""
    return -loops.width(AY, TORQUE) / 2


@_loop_metric("deg", usual=(2.0, 10.0))
def angle_hysteresis(loops: Loops) -> np.ndarray:
    """Width in handwheel angle of the loop handwheel angle over lateral acceleration, at 0 g."""
    return loops.width(ANGLE, AY)


@_loop_metric("deg", usual=(3.0, 12.0))
def angle_deadband(loops: Loops) -> np.ndarray:
    """Width in handwheel angle of the loop torque over handwheel angle, at 0 N m."""
    return -loops.width(ANGLE, TORQUE)


@_loop_metric("N m", usual=(1.0, 3.5))
def torque_deadband(loops: Loops) -> np.ndarray:
    """Height in torque of the loop torque over handwheel angle, at 0 deg."""
    return loops.width(TORQUE, ANGLE)


@_loop_metric("N m/deg", usual=(0.10, 0.40))
def steering_stiffness(loops: Loops) -> np.ndarray:
    """Slope of torque over handwheel angle at 0 deg, within +-4 deg; mean of both branches."""
    return loops.slope(TORQUE, ANGLE)


@_loop_metric("g/100 deg", usual=(0.8, 1.6), validity=(0.15, LINEAR))
def steering_sensitivity_at_0p1g(loops: Loops) -> np.ndarray:
    """Lateral acceleration per handwheel angle at 0.1 g.

    It is the inverse of the mean slope of both branches of handwheel angle over lateral acceleration.
    """
    return 1 / loops.slope(ANGLE, AY, 0.1 * G)


@_loop_metric("g/100 deg", usual=(0.6, 1.3), validity=(0.15, LINEAR))
def minimum_steering_sensitivity(loops: Loops) -> np.ndarray:
    """Lowest steering sensitivity at 0, 0.05 and 0.1 g; that at 0 g unless another is lower by two standard errors."""
    sensitivity = np.array([1 / loops.slope(ANGLE, AY, level * G) for level in (0.0, 0.05, 0.1)])
    # Where the levels are similar, the lowest one would be the noisiest and biased.
    lower = sensitivity - sensitivity[0]
    clearly = lower.mean(axis=1) < -2 * lower.std(axis=1, ddof=1) / np.sqrt(loops.count)
    return sensitivity[np.where(clearly, sensitivity.mean(axis=1), np.inf).argmin()]


@_loop_metric("1/s", usual=(0.20, 0.40))
def yaw_rate_gain(loops: Loops) -> np.ndarray:
    """Slope of yaw rate over handwheel angle at 0 deg, within +-4 deg; mean of both branches."""
    return loops.slope(YAW, ANGLE)


@_loop_metric("ms", usual=(50.0, 120.0), tests=("weave",))
def yaw_lag(loops: Loops) -> np.ndarray:
    """Delay of the yaw rate behind the handwheel angle, from the first harmonics of both."""
    return loops.lag(YAW)


@_loop_metric("ms", usual=(80.0, 200.0), tests=("weave",))
def lateral_acceleration_lag(loops: Loops) -> np.ndarray:
    """Delay of the lateral acceleration behind the handwheel angle, from the first harmonics of both."""
    return loops.lag(AY)


@_loop_metric("g/(100 N m deg)", validity=(0.15, LINEAR))
def work_sensitivity(loops: Loops) -> np.ndarray:
    """Inverse of dW/da_y at 0.1 g, where dW is the torque times the change of the handwheel angle.

    Both are read on the mean of both branches over the lateral acceleration a_y.
    """
    return steering_sensitivity_at_0p1g(loops) / torque_at_0p1g(loops)


@_loop_metric("N m", validity=None, tests=("weave", "rig"), source="common use")
def peak_handwheel_torque(loops: Loops) -> np.ndarray:
    """Half the difference of two torques half a cycle apart, where it is largest in the mean of the cycles."""
    return loops.peak(TORQUE)


@_loop_metric("deg", validity=None, tests=("weave", "rig"), source="common use")
def peak_handwheel_angle(loops: Loops) -> np.ndarray:
    """Half the difference of two handwheel angles half a cycle apart, where it is largest in the mean of the cycles."""
    return loops.peak(ANGLE)


@_loop_metric("J", validity=None, tests=("weave", "slow-ramp", "rig"), source="energy balance")
def loop_area(loops: Loops) -> np.ndarray:
    """Area of the loop torque over handwheel angle: the work of the hands in a cycle that is not returned to them."""
    loops.fundamental(TORQUE)
    torque, angle = loops.cycles(TORQUE), loops.cycles(ANGLE)
    return np.sum(torque * (np.roll(angle, -1, axis=1) - np.roll(angle, 1, axis=1)), axis=1) / 2
