"""The assist loop of the whole car: its margins against the plant that they are margins of."""

import math
from itertools import product

import control
import numpy as np
import pytest

from steer_env.vehicle import cars, plant
from steer_env.vehicle.analysis import assist_loop, linearised
from steer_env.vehicle.analysis.operating_point import cornering, steady, with_hands
from steer_env.vehicle.chassis.common.interface import HAND
from steer_env.vehicle.plant import CHANNEL
from steer_env.vehicle.steering import margins
from steer_env.vehicle.steering.eps import SAMPLE_TIME
from tests.by_law import pairs

CAR = cars.load("compact")
SPEED = 60.0 / 3.6  # between the speeds of the boost table [m/s]


@pytest.fixture(scope="module")
def turn():
    """A slow turn of the single track."""
    return cornering(CAR, SPEED)


def growth(point, factor=1.0, samples=0):
    """Largest eigenvalue of the closed plant with a factor on the slope of the boost, and with further delay."""
    a = point.plant.assist
    own = margins.boost_curve(a, point.torque, point.speed)[0]
    changed = a._replace(boost=own + factor * (a.boost - own), delay=a.delay + samples)
    state = point.state
    A, _ = linearised.transition(point.plant._replace(assist=changed), state=state, inputs=point.inputs)
    return np.abs(np.linalg.eigvals(A)).max()


@pytest.mark.parametrize(
    ("torque", "hands", "law"), pairs(product([1.5, 3.3], ["on", "off"], [None, "lugre", "coulomb"]))
)
def test_gain_margin_is_where_the_plant_becomes_unstable(turn, torque, hands, law):
    """The closed plant keeps still just below its gain margin and grows just above it, within 0.5 %."""
    point = with_hands(steady(turn, torque=torque), hands, law)
    found = assist_loop.margins(point)
    if law == "coulomb":  # a column that is held moves no torque with hands on, and the handwheel alone is stable
        assert (found.gain, found.stable) == (math.inf, True)
        return
    assert found.stable
    assert 3.0 < found.gain < 40.0
    assert growth(point, 0.995 * found.gain) < 1.0 + 1e-6
    assert growth(point, 1.005 * found.gain) > 1.0 + 1e-5


@pytest.mark.parametrize("torque", [0.0, 1.7])
def test_a_site_above_the_bar_holds_the_handwheel_or_nothing(turn, torque):
    """Dry friction at rest there holds a free handwheel as hands do; where hands hold it, it is not in the loop."""
    point, f = steady(turn, torque=torque), margins.FREQUENCIES
    above, below = {"upper_column": "coulomb,F_c=0.1"}, {"gear": "lugre"}
    loops = {
        (hands, law and tuple(law)): assist_loop.open_loop(with_hands(point, hands, law)).response(f)
        for hands, law in (("on", None), ("off", above), ("off", None), ("on", below), ("on", above | below))
    }
    found = loops["off", ("upper_column",)]
    np.testing.assert_allclose(found, loops["on", None], rtol=1e-6)
    assert np.abs(found / loops["off", None] - 1.0).max() > 0.01
    np.testing.assert_allclose(loops["on", ("upper_column", "gear")], loops["on", ("gear",)], rtol=1e-9)


@pytest.mark.parametrize("hands", ["on", "off"])
def test_delay_margin_is_where_the_plant_becomes_unstable(hands):
    """A boost is scaled until whole samples are its delay margin; without motor damping, which the plant delays too."""
    car = CAR._replace(assist=CAR.assist._replace(damping=0.0 * CAR.assist.damping))
    point = with_hands(steady(cornering(car, SPEED), torque=2.5), hands)
    loop, samples = assist_loop.open_loop(point), 3
    f = margins.FREQUENCIES
    L = loop.response(f)

    def delay(factor):
        return margins.read(f, factor * L).delay / SAMPLE_TIME - samples

    low, high = 0.05, 4.0
    assert delay(low) > 0.0 > delay(high)
    for _ in range(40):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if delay(middle) > 0.0 else (low, middle)
    assert growth(point, 0.99 * low, samples) < 1.0 + 1e-6
    assert growth(point, 1.01 * low, samples) > 1.0 + 1e-5


def remains(point):
    """Largest column speed from 7 to 8 s after a kick of the hands, over the largest in its first 20 ms."""
    u = np.tile(point.inputs, (8000, 1))
    u[:20, HAND] += 1e-3
    record, state = np.zeros((len(u), len(plant.channels(point.plant)))), point.state.copy()
    assert plant.run(point.plant, state, u, record, 1)
    speed = np.abs(record[:, CHANNEL["column_speed"]])
    return speed[-1000:].max() / speed[:20].max()


@pytest.mark.parametrize(
    ("kph", "share", "assist"), pairs(product([40.0, 80.0], [0.0, 0.7, 1.0], [(1.0, 0), (3.0, 0), (3.0, 4)]))
)
def test_a_motion_grows_where_the_simulation_grows(kph, share, assist):
    """Hands off, friction and the observer that compensates it at rest: a bristle that keeps its place is no growth."""
    boost, delay = assist
    a = cars.load("compact", changes={"assist.friction_share": share}).assist if share else CAR.assist
    turn = cornering(CAR._replace(assist=a._replace(boost=boost * a.boost, delay=a.delay + delay)), kph / 3.6)
    # At 40 km/h three times the boost leaves less than 3 N m to the hands.
    torques = (1.0, 2.0) if boost > 1.0 and kph == 40.0 else (1.0, 2.0, 3.0)
    for torque in torques:
        point = with_hands(steady(turn, torque=torque), "off", "lugre")
        rest = remains(point)
        assert rest < 0.1 or rest > 10.0, "the point is too near to the limit for a verdict"
        assert assist_loop.grows(point) == (rest > 10.0), (torque, rest)
    assert (rest > 10.0) == (delay > 0), "both verdicts must be met, at the largest torque"


def test_margins_of_a_known_loop():
    """Margins of a third-order loop with a delay are those of python-control, the disk margin too."""
    dt = 1e-3
    loop = control.c2d(control.tf([4e5], [1.0, 120.0, 9000.0, 1e5]), dt, "zoh") * control.tf([1.0], [1.0, 0.0], dt)
    f = np.geomspace(0.1, 490.0, 4000)
    found = margins.read(f, loop(np.exp(2j * math.pi * f * dt)))
    gain, phase, _, _, crossover, _ = control.stability_margins(control.frequency_response(loop, 2.0 * math.pi * f))
    disk, _, _ = control.disk_margins(loop, 2.0 * math.pi * f)
    assert found.gain == pytest.approx(gain, rel=1e-3)
    assert math.degrees(found.phase) == pytest.approx(phase, rel=1e-3)
    assert found.delay == pytest.approx(math.radians(phase) / crossover, rel=1e-3)
    assert found.crossover == pytest.approx(crossover / (2.0 * math.pi), rel=1e-3)
    assert found.disk == pytest.approx(disk, rel=1e-3)
