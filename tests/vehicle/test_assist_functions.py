"""The functions of the assist: statics, transfer functions, the linear model of the margins against the kernels."""

import math
from pathlib import Path

import control
import numpy as np
import pytest

from steer_env import friction, manoeuvres, metrics
from steer_env.friction.numerics import packing
from steer_env.manoeuvres import drive
from steer_env.vehicle import cars, plant
from steer_env.vehicle.analysis import understeer
from steer_env.vehicle.layout import plant_layout, state_names, state_size
from steer_env.vehicle.steering import column, eps, linear
from steer_env.vehicle.steering.assist import active_return, functions
from steer_env.vehicle.steering.assist.functions import Functions, NoFunctions, Signals
from steer_env.vehicle.steering.margins import (
    boost_gain,
    hands_fixed_loop,
    margins,
    slopes_of_functions,
    worst_margins,
)

pytestmark = pytest.mark.filterwarnings("ignore::steer_env.vehicle.cars.UnusualCar")  # some loops are near their limit
V, T = 100.0 / 3.6, eps.SAMPLE_TIME
NONE = friction.make("viscous", sigma_2=0.0)
EXAMPLE = Path(__file__).parents[2] / "examples" / "assist_functions.toml"
EVERY = {
    "return_gain": 8.0,
    "return_hold": 1.0,
    "handwheel_damping": 0.1,
    "friction_share": 0.3,
    "inertia_compensation": 0.01,
    "lead_lag_gain": 0.1,
    "lead_lag_lag": [2.0, 8.0],
}


def compact(**changes):
    return cars.load("compact", changes={f"assist.{key}": value for key, value in changes.items()})


def torques(a, signals):
    """What the functions add in a sequence of signals."""
    x = np.zeros(len(functions.states(a.functions)))
    return np.array([functions.requested(a.functions, x, Signals(*map(float, row)), 0.0) for row in signals])


def test_off_is_off():
    zero = eps.make(return_gain=0.0, friction_share=[0.0] * 6, friction_law="masing", return_hold=2.0)
    for off in (eps.make(), zero):
        assert off.functions == NoFunctions()
        assert functions.requested(off.functions, np.zeros(0), Signals(1.0, 1.0, 1.0, 1.0, 30.0), -0.7) == -0.7
    names = [name for name, _ in state_names(cars.load().plant())]
    assert not any(name in names for name, _ in functions.STATES)
    assert np.array_equal(eps.make().boost, eps.TABLE_ASSIST)


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("boost_scale", -0.1, "one number, or 6 for as many speeds, from 0 to 10, got -0.1"),
        ("return_gain", math.nan, "one number, or 6 for as many speeds, from 0 to 200, got nan"),
        ("return_speed", math.inf, "finite and at least 0.1"),
        ("inertia_bandwidth", 451.0, "finite and at least 1 and at most 450"),
        ("lead_lag_lag", [1.0], "a pair of zero and pole"),
        ("lead_lag_lead", [0.0, 10.0], "finite and at least 0.01"),
    ],
)
def test_bad_value(key, value, message):
    with pytest.raises(ValueError, match=rf"^{key}( \[Hz\])? must be {message}"):
        eps.make(**{key: value})


def test_bad_law_and_bad_key():
    with pytest.raises(ValueError, match=r"^boost_scale must hold numbers, in rows of one length, got 1000"):
        eps.make(boost_scale=10**400)
    with pytest.raises(ValueError, match=r"^friction_law: unknown friction law 'lugr'; available: .*coulomb"):
        eps.make(friction_law="lugr")
    with pytest.raises(ValueError, match=r"assist\.friction_law must be text, got 3"):
        compact(friction_law=3)
    with pytest.raises(TypeError, match="no key 'return_gian'"):
        eps.make(return_gian=1.0)


def test_keys_make_the_same_assist():
    a = eps.make(boost_scale=[1.0, 1.1, 1.2, 1.3, 1.4, 1.5], **EVERY, friction_law="masing,F_c=0.7")
    again = eps.make(**eps.keys(a))
    assert packing.pack(again).numbers.tolist() == packing.pack(a).numbers.tolist()
    assert type(again.functions.friction_compensation.law) is type(friction.make("masing"))


def test_boost_scale_is_a_factor_by_speed():
    factors = [0.5, 1.0, 1.0, 2.0, 1.0, 1.0]
    scaled = eps.make(boost_scale=factors)
    assert np.array_equal(scaled.boost, np.array(factors)[:, None] * eps.TABLE_ASSIST)
    assert eps.boost_curve(scaled, 3.0, 80.0 / 3.6)[0] == pytest.approx(12.0)
    assert np.array_equal(eps.make(boost_scale=1.5).boost, 1.5 * np.array(eps.TABLE_ASSIST))


def test_return_drives_to_the_centre_and_fades():
    a = eps.make(return_gain=10.0, return_saturation=2.0, return_hold=0.5, return_lead=0.05)

    def torque(angle, rate=0.0, twist=0.0, speed=1e9):
        return torques(a, [(angle, rate, 0.0, twist, speed)])[0]

    assert torque(0.01) == pytest.approx(-0.1, rel=2e-3)
    assert torque(-0.3) == -torque(0.3)
    assert torque(100.0) == pytest.approx(-2.0, rel=1e-4)
    assert torque(100.0, twist=0.5) == pytest.approx(-1.0, rel=1e-4)  # held
    assert torque(100.0, speed=3.0) == pytest.approx(-1.0, rel=1e-4)
    assert torque(100.0, speed=0.0) == 0.0
    assert torque(0.1, rate=-2.0) == pytest.approx(0.0, abs=1e-12)  # brakes before the centre
    by_speed = eps.make(return_gain=[0.0, 0.0, 0.0, 5.0, 10.0, 10.0])
    halfway = torques(by_speed, [(1e-3, 0.0, 0.0, 0.0, 90.0 / 3.6)])[0]
    assert halfway == pytest.approx(-7.5e-3 * 25.0 / 28.0, rel=1e-4)


def test_damping_acts_on_the_handwheel():
    assert torques(eps.make(handwheel_damping=0.4), [(0.5, 2.0, -3.0, 1.0, V)])[0] == -0.8


def sine_response(a, f, channel, amplitude=1.0):
    """Complex gain of the functions at a frequency [Hz], from a sine of one of the signals."""
    n = np.arange(20_000)
    signals = np.zeros((n.size, 5))
    signals[:, channel] = amplitude * np.cos(2.0 * math.pi * f * T * n)
    signals[:, 4] = V
    kept = slice(n.size - round(1.0 / T), None)
    waves = np.exp(-2j * math.pi * f * T * n[kept])
    return 2.0 / amplitude * np.mean(torques(a, signals)[kept] * waves)


@pytest.mark.parametrize("f", [1.0, 3.0, 10.0, 25.0])
def test_lead_lag_has_its_transfer_function(f):
    a = eps.make(lead_lag_gain=0.3, lead_lag_lag=[2.0, 8.0], lead_lag_lead=[5.0, 50.0])
    s = 1j * f
    expected = 0.3 * (1 + s / 2.0) / (1 + s / 8.0) * (1 + s / 5.0) / (1 + s / 50.0)
    found = sine_response(a, f, 3)
    assert abs(found / expected) == pytest.approx(1.0, abs=5e-3)  # Tustin's warping at 25 Hz is 0.2 %
    assert np.degrees(np.angle(found / expected)) == pytest.approx(0.0, abs=0.3)


@pytest.mark.parametrize("f", [1.0, 10.0, 40.0])
def test_inertia_compensation_is_a_filtered_derivative(f):
    a = eps.make(inertia_compensation=0.02, inertia_bandwidth=100.0)
    s = 2j * math.pi * f
    expected = 0.02 * s / (1.0 + 1j * f / 100.0)
    assert sine_response(a, f, 2) == pytest.approx(expected, rel=0.01)


def stepped(c, a, state, law=NONE, angle=None, speed=V, substeps=20):
    """Column, assist and functions one sample later, from their states one after another; hands free or fixed."""
    state = state.copy()
    q, x, f = np.split(state, (4, 4 + eps.STATE_SIZE))  # views
    twist = c.K_tb * (q[0] - q[2])
    request = functions.requested(a.functions, f, Signals(q[0], q[1], q[3], twist, speed), 0.0)
    before, after = eps.sample(a, x, twist, q[3], speed, request)
    h, memory = T / substeps, np.zeros(0)
    for j in range(substeps):
        motor = eps.motor_step(a, x, x[:0], before, after, j * h, 0.0, h)
        if angle is None:
            column.step_torque(c, law, 1.0, q, memory, 0.0, motor, h)
        else:
            column.step_angle(c, law, 1.0, q, memory, angle, 0.0, motor, h)
    return state


def eigenvalues(step, state, left_out=()):
    """Of the Jacobian of a step by central differences."""
    kept = [i for i in range(state.size) if i not in left_out]
    columns = []
    for i in kept:
        d = 1e-5 * np.eye(state.size)[i]
        columns.append((step(state + d) - step(state - d))[kept] / 2e-5)
    return np.linalg.eigvals(np.transpose(columns))


@pytest.mark.parametrize("J", [0.0, 0.01, 0.025])
def test_inertia_compensation_lowers_the_inertia(J):
    """Hands free, the column swings on its torsion bar against the handwheel with the inertia I2 - J."""
    c = column.make(C2=0.0, C_tb=0.0)
    quick = {"bandwidth": 5e3, "delay": 0.0, "inertia_bandwidth": 450.0, "damping": [0.0] * 6}
    a = eps.make(boost=np.zeros((6, 9)), inertia_compensation=J, handwheel_damping=1e-9, **quick)
    state = np.zeros(4 + eps.STATE_SIZE + len(functions.states(a.functions)))
    z = eigenvalues(lambda s: stepped(c, a, s), state)
    rates = np.log(z[z.imag > 0.0]) / T
    swinging = rates[rates.imag < 500.0]
    expected = math.sqrt(c.K_tb * (1.0 / c.I1 + 1.0 / (c.I2 - J)))
    assert min(abs(abs(swinging) / expected - 1.0)) < 0.012  # filter, hold and motor lag by 0.9 ms in all


@pytest.mark.parametrize(("twist", "share"), [(0.25, 0.0), (0.75, 0.3), (2.25, 0.0), (3.5, 0.3)])
def test_margins_have_the_loop_of_the_kernels(twist, share):
    """Poles of the closed loop against the differentiated kernels, beside the centre, with every function."""
    law = "dahl,sigma_0=150,F_c=19"
    keys = {**EVERY, "friction_share": share, "friction_law": law, "friction_stiffness": 1e4, "friction_limit": 20.0}
    car = compact(**keys, friction_hold=0.01, limit=1e6)
    c, a, f = car.column, car.assist, car.assist.functions
    slope = active_return.slope(f.active_return, 8.0, twist, twist, V)
    if share:  # the observer is a spring as long as its law does not slide
        slope -= share * 150.0 / c.K_tb
    loop = hands_fixed_loop(c, a, boost_gain(a, twist, V), V, slope)
    expected = control.feedback(loop, 1).poles()

    angle = 50.0  # the return is saturated
    state = np.zeros(4 + eps.STATE_SIZE + len(functions.states(f)))
    state[[0, 2, 3]] = angle, angle - twist / c.K_tb, 0.3
    grip = 4 + eps.STATE_SIZE + functions.FRICTION + 2
    state[grip] = 1e3  # hands have held the handwheel
    found = eigenvalues(lambda s: stepped(c, a, s, angle=angle), state, left_out=(0, 1, grip))
    slow = [pole for pole in expected if abs(pole) > 0.2]
    assert len(slow) >= 6
    for pole in slow:
        assert np.abs(found - pole).min() < (1e-3 if share == 0.0 else 4e-3), pole


@pytest.mark.parametrize("delay", [0.0, 5e-4, 2.3e-3])
def test_stability_has_the_loop_of_the_kernels_with_free_hands(delay):
    c, a = column.make(C1=0.02), compact(**{**EVERY, "friction_share": 0.0}, limit=1e6, delay=delay).assist
    state = np.zeros(4 + eps.STATE_SIZE + len(functions.states(a.functions)))
    found = eigenvalues(lambda s: stepped(c, a, s), state)
    expected = linear.poles(linear.plant(c, a, V, free=True), a, np.array([boost_gain(a, 0.25, V)]))[0]
    slow = [pole for pole in expected if abs(pole) > 0.2]
    assert len(slow) >= 8
    for pole in slow:
        assert np.abs(found - pole).min() < 2e-3, pole


def test_tables_are_read_at_the_size_of_the_speed():
    """In reverse the assist is that of the same speed forwards, and not that at standstill."""
    a = compact(**{**EVERY, "return_gain": [0.0, 2.0, 4.0, 8.0, 10.0, 10.0, 10.0, 10.0]}).assist
    signals = (0.5, 0.1, 0.2, 3.0)
    forward, standing = (torques(a, [(*signals, v)])[0] for v in (5.0, 0.0))
    assert torques(a, [(*signals, -5.0)])[0] == forward != standing
    assert eps.boost_curve(a, 3.0, -5.0) == eps.boost_curve(a, 3.0, 5.0) != eps.boost_curve(a, 3.0, 0.0)
    assert functions.linear(a.functions, -5.0) == functions.linear(a.functions, 5.0)
    assert worst_margins(compact().column, a, -5.0) == worst_margins(compact().column, a, 5.0)


def test_margins_of_the_functions():
    plain, c = compact(), compact().column
    reference = worst_margins(c, plain.assist, V)
    for changes in ({"handwheel_damping": 0.5}, {"return_gain": 8.0, "return_hold": 5.0}, {"friction_share": 0.01}):
        m = worst_margins(c, compact(**changes).assist, V)
        assert m.phase == pytest.approx(reference.phase, abs=0.05), changes
    for changes in ({"inertia_compensation": 0.015}, {"lead_lag_gain": 0.2}, {"return_gain": 8.0, "return_hold": 0.2}):
        m = worst_margins(c, compact(**changes).assist, V)
        assert m.phase < reference.phase - 0.05, changes
    beyond = eps.make(**{**eps.keys(plain.assist), "inertia_compensation": 1.2 * c.I2})
    assert not worst_margins(c, beyond, V).stable
    a = compact(**EVERY).assist
    found = worst_margins(c, a, V)
    each = [
        margins(c, a, boost_gain(a, 0.5 * (low + high), V), V, slope)
        for low, high in zip(a.torques, a.torques[1:])
        for slope in slopes_of_functions(c, a, low, high, V)
    ]
    assert found.phase == pytest.approx(min(m.phase for m in each), rel=0.01)
    assert found.gain == pytest.approx(min(m.gain for m in each), rel=0.01)


def test_response_has_the_functions():
    """As far as the linear model goes: low frequencies, small angles, no friction."""
    from tests.vehicle.test_understeer import FREQUENCIES, sines

    keys = {"return_gain": 20.0, "handwheel_damping": 0.5, "inertia_compensation": 0.02, "lead_lag_gain": 0.3}
    car = compact(**keys, lead_lag_lead=[30.0, 30.0])
    points = [2j * math.pi * f for f in FREQUENCIES]
    model, without = (np.array([understeer.response(each, V)(s)[:, 0] for s in points]) for each in (car, compact()))
    found = sines(car, "single_track", NONE, 2e-3)
    np.testing.assert_allclose(np.abs(found / model), 1.0, atol=0.01)
    np.testing.assert_allclose(np.degrees(np.angle(found / model)), 0.0, atol=1.0)
    assert np.abs(without / model - 1.0).max() > 0.01


def test_states_are_named_and_rows_run_alone():
    """With the limits of the motor too, which warms up."""
    weak = {"motor_speeds": [0.0, 400.0], "motor_torques": [0.1, 0.0], "motor_continuous": 0.05}
    p = compact(**EVERY, **weak, friction_law="masing").plant("masing", V)
    assert isinstance(p.assist.functions, Functions)
    names, at = [name for name, _ in state_names(p)], plant_layout(p)
    assert len(names) == len(set(names)) == state_size(p)
    assert names[at.functions : at.functions + 2] == ["acceleration_filter", "lead_lag_filter_0"]
    assert names[at.memory] == "friction_memory_0"
    state, row = plant.settled(p)
    rows, inputs, finite = packing.pack(p).numbers[None], np.zeros((1, 300, len(plant.INPUTS))), np.zeros(1, bool)
    inputs[0, :, plant.HAND] = 2.0
    many, channels, record = state[None].copy(), row[None].copy(), np.zeros((1, row.size))
    plant.run_rows(plant.bound(p), rows, many, inputs, channels, finite, 0, 1)
    assert plant.run(p, state, inputs[0], record, 1)
    assert finite[0]
    assert np.array_equal(many[0], state)
    assert np.array_equal(channels, record)
    assert np.all(state[at.functions : at.functions + functions.FRICTION + 3] != 0.0)
    assert 0.0 < np.abs(record[0, plant.CHANNEL["motor_torque"]]) <= eps.available(p.assist, 0.0)
    assert state[at.motor] > 0.0


def evaluated(car, test, law="lugre"):
    return {name: found.value for name, found in metrics.evaluate(drive(car, manoeuvres.make(test), law)).items()}


def test_compensation_removes_its_share_of_the_friction_from_the_weave():
    """The observer's law may be another than the car's; the hands' fade is nearly off here."""
    full, frictionless = evaluated(compact(), "weave"), evaluated(compact(), "weave", NONE)
    car = compact(friction_share=0.6, friction_law="dahl", friction_hold=0.05)
    found = evaluated(car, "weave")
    for name in ("loop_area", "torque_deadband", "angle_deadband"):
        left = (found[name] - frictionless[name]) / (full[name] - frictionless[name])
        assert left == pytest.approx(0.4, abs=0.06), name


def test_example_car_drives():
    """Every function is on; the car is stable, and releases nearer to the centre than the packaged one."""
    car, plain = cars.load(EXAMPLE), compact()
    assert all(np.any(p.gain) for p in car.assist.functions[1:])
    for speed in car.assist.speeds:
        m = worst_margins(car.column, car.assist, speed)
        assert m.stable
        assert math.degrees(m.phase) > 30.0
        assert m.gain > 2.0
    weave, usual = evaluated(car, "weave"), evaluated(plain, "weave")
    assert weave["torque_deadband"] < usual["torque_deadband"] - 0.05
    release, before = evaluated(car, "release"), evaluated(plain, "release")
    assert abs(release["residual_handwheel_angle"]) < 0.7 * abs(before["residual_handwheel_angle"])
    assert release["free_damping_ratio"] > 0.3
