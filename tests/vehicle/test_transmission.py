"""What a sliding gear with an efficiency makes of the assist loop (E25), against the plant that is stepped."""

import numpy as np
import pytest

from steer_env import friction
from steer_env.friction import sites
from steer_env.friction.numerics.frozen import frozen
from steer_env.vehicle import cars, plant
from steer_env.vehicle.analysis import assist_loop
from steer_env.vehicle.analysis.operating_point import cornering, steady
from steer_env.vehicle.chassis.common.interface import ASSIST_REQUEST, HAND, HAND_SPEED, RACK_DISTURBANCE
from steer_env.vehicle.plant import CHANNEL
from steer_env.vehicle.steering import eps, margins
from steer_env.vehicle.steering.column import COLUMN_ANGLE, HANDWHEEL_ANGLE
from steer_env.vehicle.steering.eps import SAMPLE_TIME

GEAR = "masing,F_c=0.5,efficiency=0.8:0.7@gear"
CAR = cars.load("compact", changes={"steering.friction_load": 0.0})
SPEED, RATE, SLOPE = 60.0 / 3.6, 6.0, 4.0  # of the car [m/s], of the handwheel [rad/s], of the boost [1]
RADIUS, LOAD, RISE = (
    1e-9,
    5.0,
    0.2,
)  # of the pinion, with which the wheels stay straight [m]; torque on the column [N m]; its rise [s]


def test_factors_are_those_of_the_efficiency():
    assert sites.transmissions(friction.resolve(GEAR)) == pytest.approx((1.0, 0.8, 1.0 / 0.7))
    for without in ("lugre", "masing@gear", "lugre,efficiency=1@gear+coulomb@upper_column"):
        assert sites.transmissions(friction.resolve(without)) == (1.0,)


def linear(slope):
    """The assist with a boost of one slope."""
    return frozen(CAR.assist._replace(boost=np.tile(slope * CAR.assist.torques, (CAR.assist.speeds.size, 1))))


def remains(slope, side):
    """What a kick leaves while the handwheel turns to the left against a load to a side.

    Returns
    -------
    rest : float
        Largest change of the torsion bar's torque from sample to sample after 2 s, over that after the kick [1].
    motor : float
        Mean torque of the motor before the kick [N m].
    """
    p = CAR._replace(assist=linear(slope)).plant(GEAR, SPEED, robot=True)
    p = frozen(p._replace(pinion_radius=RADIUS))
    state, t = plant.initial_state(p), 1e-3 * np.arange(1, 3001)
    u, record = np.zeros((t.size, len(plant.INPUTS))), np.zeros((t.size, len(plant.channels(p))))
    begun = 1.0 - np.exp(-t / RISE)
    u[:, HAND], u[:, HAND_SPEED] = RATE * (t - RISE * begun), RATE * begun
    u[:, RACK_DISTURBANCE] = side * LOAD / RADIUS * begun
    u[1000:1005, ASSIST_REQUEST] = 1e-2
    assert plant.run(p, state, u, record, 1)
    change = np.abs(np.diff(record[:, CHANNEL["torsion_bar_torque"]]))
    return change[-100:].max() / change[1000:1020].max(), record[900:1000, CHANNEL["motor_torque"]].mean()


@pytest.mark.parametrize(("side", "factor"), [(1.0, 0.8), (-1.0, 1.0 / 0.7)])
def test_the_gain_margin_is_where_a_kick_grows(side, factor):
    """Sliding, to 2 %: the motor drives against one load and is driven back by the other."""
    passed = margins.transmitted(linear(SLOPE), factor)
    limit = SLOPE * margins.margins(CAR.column, passed, factor * SLOPE, SPEED).gain
    (below, motor), (above, _) = (remains(share * limit, side) for share in (0.98, 1.02))
    assert side * motor > 0.5
    assert below < 0.01
    assert above > 0.5


def test_margins_are_the_smallest_over_the_factors():
    """Without an efficiency to the bit those without a gear; without damping the gain margin is 1/k of it."""
    c, a = CAR.column, frozen(CAR.assist._replace(damping=0.0 * CAR.assist.damping))
    alone, passed = margins.of_cells(c, a, SPEED), sites.transmissions(friction.resolve(GEAR))
    assert margins.of_cells(c, a, SPEED, (1.0,)) == alone
    for cell, own in zip(margins.of_cells(c, a, SPEED, passed), alone, strict=True):
        assert cell.margins.gain == pytest.approx(0.7 * own.margins.gain, rel=1e-9)
        assert cell.slope == own.slope
        assert cell.margins.phase <= own.margins.phase


def test_the_loop_is_that_of_a_column_that_is_lighter_by_the_factor():
    """Of inertia, stiffness and damping over k, whose sensor reads 1/k: so with every function of the assist."""
    keys = {"return_gain": 10.0, "inertia_compensation": 0.005, "lead_lag_gain": 0.1, "handwheel_damping": 0.5}
    c, k = CAR.column, 1.25
    a = eps.make(**eps.keys(CAR.assist) | keys)
    f = a.functions
    lighter = c._replace(I2=c.I2 / k, K_tb=c.K_tb / k, C2=c.C2 / k, C_tb=c.C_tb / k)
    answering = a._replace(functions=f._replace(lead_lag=f.lead_lag._replace(gain=k * f.lead_lag.gain)))
    fade = margins.slopes_of_functions(c, a, 0.0, 0.5, SPEED)[-1]
    passed = margins.transmitted(a, k)
    assert margins.slopes_of_functions(c, passed, 0.0, 0.5, SPEED) == pytest.approx((0.0, k * fade))
    found = margins.margins(c, passed, k * SLOPE, SPEED, k * fade)
    assert found == pytest.approx(margins.margins(lighter, answering, k * SLOPE, SPEED, k * fade), rel=1e-6)


def test_a_turn_stays_where_it_is_behind_a_sliding_gear():
    """The request makes up for the factor, which the loop has."""
    point = steady(cornering(CAR, SPEED), torque=2.0)
    passed, f = assist_loop.transmitted(point, 1.25), np.geomspace(5.0, 50.0, 20)
    after, row = passed.state.copy(), np.zeros((1, len(plant.channels(point.plant))))
    plant.run(passed.plant, after, np.tile(passed.inputs, (200, 1)), row, 1)
    torque = point.plant.column.K_tb * (after[HANDWHEEL_ANGLE] - after[COLUMN_ANGLE])
    assert torque == pytest.approx(point.torque, abs=1e-6)
    assert assist_loop.transmitted(point, 1.0) is point
    ratio = assist_loop.open_loop(passed).response(f) / assist_loop.open_loop(point).response(f)
    a, c = point.plant.assist, point.plant.column
    z, slope = np.exp(2j * np.pi * f * SAMPLE_TIME), margins.boost_gain(a, point.torque, SPEED)
    through = margins.hands_fixed_loop(c, margins.transmitted(a, 1.25), 1.25 * slope, SPEED)(z)
    np.testing.assert_allclose(ratio, through / margins.hands_fixed_loop(c, a, slope, SPEED)(z), rtol=0.03)
