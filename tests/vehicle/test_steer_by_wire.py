"""Steer-by-wire: loops against python-control's assembly and the plant, power, tables, messages, what is refused."""

import math

import control
import gymnasium as gym
import numba
import numpy as np
import pytest

from steer_env import friction, manoeuvres
from steer_env.drivers.common.known_torque import acceleration_gain
from steer_env.experiments.studies import rack_observer
from steer_env.friction.sites import transmissions
from steer_env.vehicle import cars, plant
from steer_env.vehicle.analysis import understeer
from steer_env.vehicle.analysis.assist_loop import margins as margins_of_car
from steer_env.vehicle.analysis.assist_loop import open_loop
from steer_env.vehicle.analysis.linearised import linearise
from steer_env.vehicle.analysis.operating_point import cornering, steady, with_hands
from steer_env.vehicle.chassis.common.interface import ASSIST_REQUEST, HAND, HAND_SPEED, INPUTS, RACK_DISTURBANCE
from steer_env.vehicle.constants import GRAVITY
from steer_env.vehicle.plant import CHANNEL
from steer_env.vehicle.steering import linear, margins, wire_loops
from steer_env.vehicle.steering.by_wire import as_samples, ratio_at, sampled, states
from steer_env.vehicle.steering.eps import SAMPLE_TIME
from steer_env.vehicle.steering.torque_build_up import torque_build_up

CAR = cars.load("compact_steer_by_wire")
WIRE, SPEED = CAR.assist.wire, 25.0
NO_FRICTION = friction.make("viscous", sigma_2=0.0)
Z = np.exp(2j * math.pi * margins.FREQUENCIES * SAMPLE_TIME)


def run(p, hand, request=0.0, hand_speed=0.0, disturbance=0.0):
    """Channels (T,) of a plant by name that starts in straight running."""
    u, record = np.zeros((len(hand), len(INPUTS))), np.zeros((len(hand), len(plant.channels(p))))
    u[:, HAND], u[:, HAND_SPEED], u[:, ASSIST_REQUEST] = hand, hand_speed, request
    u[:, RACK_DISTURBANCE] = disturbance
    assert plant.run(p, plant.initial_state(p), u, record, 1)
    return {name: record[:, i] for name, i in CHANNEL.items()}


def motor_and_inertia(inertia, damping, stiffness, bandwidth, offset):
    """From a command, which changes ``offset`` after its sample, to angle and speed, at 1 ms, by python-control."""
    A = [[0.0, 1.0, 0.0], [-stiffness / inertia, -damping / inertia, 1.0 / inertia], [0.0, 0.0, -bandwidth]]
    whole = control.ss(A, [[0.0], [0.0], [bandwidth]], np.eye(3)[:2], 0.0)
    first, rest = (control.c2d(whole, time, "zoh") for time in (offset, SAMPLE_TIME - offset))
    phi = np.block([[rest.A @ first.A, rest.A @ first.B], [np.zeros((1, 4))]])  # the state holds the last command
    return control.ss(phi, np.vstack([rest.B, [[1.0]]]), np.eye(4)[:2], 0.0, SAMPLE_TIME)


def test_loops_are_those_of_python_control():
    """(W8) and (W9) with free and with tensed hands, within 1e-6 up to 490 Hz."""
    z, c, a, w = control.tf("z"), CAR.column, CAR.assist, WIRE
    z.dt = SAMPLE_TIME
    rack = motor_and_inertia(c.I2, c.C2, 0.0, a.bandwidth, a.offset)
    position = rack[0, 0] * w.position_gain + rack[1, 0]
    expected = w.speed_gain * position(Z) * (1.0 + w.integral_gain / w.speed_gain * SAMPLE_TIME / (Z - 1.0))
    np.testing.assert_allclose(wire_loops.position_loop(c, a).response(Z), expected, rtol=1e-6)
    for inertia, damping, stiffness in wire_loops.HANDS[::2]:
        wheel = motor_and_inertia(c.I1 + inertia, c.C1 + damping, stiffness, w.bandwidth, w.offset)
        found = wire_loops.feel_loop(c, w, 20.0, 0.7, (inertia, damping, stiffness))
        np.testing.assert_allclose(found.response(Z), 20.0 * wheel[0, 0](Z) + 0.7 * wheel[1, 0](Z), rtol=1e-6)


@pytest.mark.filterwarnings("ignore::steer_env.vehicle.cars.UnusualCar")
def test_small_sweeps_of_the_plant_are_those_of_the_loops():
    """A request shakes a handwheel in relaxed hands, and the rack follows it through the wire; within 1 %."""
    inertia, damping, stiffness = wire_loops.HANDS[1]
    car = cars.load(CAR, {"steer_by_wire.friction_law": "viscous,sigma_2=0.0", "steering.compliance": 100.0})
    w, p = car.assist.wire, car.plant(NO_FRICTION, SPEED)
    p = p._replace(column=p.column._replace(I_arm=inertia, C_arm=damping, K_arm=stiffness))
    slope = float(np.interp(SPEED, w.speeds, w.feel[:, 1] / w.angles[1]))
    loop = wire_loops.feel_loop(car.column, w, slope, float(np.interp(SPEED, w.speeds, w.damping)), wire_loops.HANDS[1])
    rack = wire_loops.position_loop(car.column, car.assist)
    t = SAMPLE_TIME * np.arange(3000)
    for frequency in (2.0, 5.0, 10.0, 20.0):
        wave = np.exp(2j * math.pi * frequency * t)
        found = run(p, 0.0 * t, 0.05 * wave.imag)
        size = {
            name: 2.0 * np.mean((found[name] * wave.conj())[-2000:]) for name in ("handwheel_angle", "column_angle")
        }
        z = np.exp([2j * math.pi * frequency * SAMPLE_TIME])
        P, P_speed = (linear.response(loop.plant._replace(C=row[None]), z)[0] for row in loop.plant.C)
        expected = 0.05 * P / (1.0 + loop.response(z)[0])
        assert abs(size["handwheel_angle"]) == pytest.approx(abs(expected), rel=0.01)
        # (W1) to (W3): angle and speed arrive two samples late, and the angle is taken ahead by the speed
        speed, late = P_speed / P, z[0] ** -w.wait
        P = linear.response(rack.plant._replace(C=rack.plant.C[:1]), z)[0]
        gain = w.speed_gain * (1.0 + w.integral_gain / w.speed_gain * SAMPLE_TIME / (z[0] - 1.0))
        wanted = w.position_gain * (1.0 + w.wait * SAMPLE_TIME * speed) + speed
        follows = ratio_at(w, SPEED) * late * gain * wanted * P / (1.0 + rack.response(z)[0])
        assert abs(size["column_angle"] / size["handwheel_angle"]) == pytest.approx(abs(follows), rel=0.01)


def test_the_car_with_its_position_loop_is_that_of_the_linear_model():
    """Yaw rate and lateral acceleration over the handwheel angle up to 3 Hz, without a delay of the wire."""
    car = cars.load(CAR, {"steer_by_wire.wire_delay": 0.0})
    s = 2j * math.pi * np.array([0.2, 1.0, 3.0])
    z = np.exp(2.0 * SAMPLE_TIME * s)
    g, own = linearise(steady(cornering(car, SPEED))), understeer.response(car, SPEED)
    found = (g(z)[:, 0] + s * g(z)[:, 1]) * z  # an angle that turns with its speed, one step ahead of the states
    for name in ("yaw_rate", "lateral_acceleration"):
        expected = own(s)[own.output_labels.index(name), 0]
        np.testing.assert_allclose(found[g.output_labels.index(name)], expected, rtol=3e-3)


def test_margins_hold_on_the_whole_map():
    """30 deg and 6 dB at every speed and angle, hands free to tensed, also behind a gear that slides."""
    passed = transmissions(friction.resolve(CAR.friction))
    for speed in [*WIRE.speeds, 14.0, 33.0]:
        found = margins.worst_margins(CAR.column, CAR.assist, speed, passed)
        assert found.stable
        assert math.degrees(found.phase) >= 30.0
        assert 20.0 * math.log10(found.gain) >= 6.0
    point = with_hands(steady(cornering(CAR, SPEED), torque=2.0), "off", "lugre")
    assert point.torque == pytest.approx(2.0, rel=1e-6)
    assert margins_of_car(point).stable


def test_rack_follows_the_handwheel():
    """1 Hz and 30 deg: the rack is at most 0.3 deg of the handwheel off its place, driving and standing."""
    t = SAMPLE_TIME * np.arange(1.0, 3001.0)
    e, w = np.minimum(t, 1.0), 2.0 * math.pi
    angle = math.radians(30.0) * e * np.sin(w * t)
    for speed, chassis in ((100.0 / 3.6, "single_track"), (0.0, "two_track")):
        p, ratio = CAR.plant(None, speed, robot=True, chassis=chassis), ratio_at(WIRE, speed)
        found = run(p, angle, hand_speed=np.gradient(angle, SAMPLE_TIME))
        off = (found["column_angle"] / ratio - found["handwheel_angle"])[1000:]
        assert 0.01 < math.degrees(np.abs(off).max()) < 0.3


def test_power_of_both_sides():
    """What hands and motors give is friction, dampers, rack and stored energy, within 0.2 % of what they move."""
    p = CAR.plant({"rack": "lugre"}, SPEED)  # without friction at the handwheel, which no channel tells
    t, c = SAMPLE_TIME * np.arange(1.0, 5001.0), p.column
    found = run(p, 2.0 * np.sin(2.0 * math.pi * 0.5 * t))

    def work(torque, name):
        """Work [J] by a torque at the ends of the samples on an angle."""
        return float(np.sum(0.5 * (torque[1:] + torque[:-1]) * np.diff(found[name])))

    w1, w2 = found["handwheel_speed"], found["column_speed"]
    hand = float(np.sum(found["handwheel_torque"][1:] * np.diff(found["handwheel_angle"])))  # the mean over a sample
    feel = work(found["torsion_bar_torque"], "handwheel_angle")
    off = hand - feel - work(c.C1 * w1, "handwheel_angle") - 0.5 * c.I1 * (w1[-1] ** 2 - w1[0] ** 2)
    assert abs(off) < 0.002 * work(np.abs(found["handwheel_torque"]) * np.sign(w1), "handwheel_angle")
    motor, lost = (
        work(found["motor_torque"], "column_angle"),
        work(found["friction_torque"] + c.C2 * w2, "column_angle"),
    )
    rack = work(p.pinion_radius * found["rack_force"], "column_angle")
    off = motor - lost - rack - 0.5 * c.I2 * (w2[-1] ** 2 - w2[0] ** 2)
    assert abs(off) < 0.002 * work(np.abs(found["motor_torque"]) * np.sign(w2), "column_angle")
    assert lost > 0.5


def test_hand_feels_map_damping_and_hysteresis():
    """A slow turn to and fro: the map on average, and twice the wanted friction in between (W4)."""
    p = CAR.plant(NO_FRICTION, SPEED, robot=True)
    t = SAMPLE_TIME * np.arange(1.0, 20001.0)
    w = 2.0 * math.pi * 0.1
    found = run(p, 0.4 * np.sin(w * t), hand_speed=0.4 * w * np.cos(w * t))
    angle, torque, last = found["handwheel_angle"], found["torsion_bar_torque"], slice(10000, None)
    rising = found["handwheel_speed"] > 0.0
    damping = np.interp(SPEED, WIRE.speeds, WIRE.damping)
    table = np.array([np.interp(SPEED, WIRE.speeds, column) for column in WIRE.feel.T])
    for at in (-0.2, 0.0, 0.2):
        near = np.abs(angle - at) < 1e-3
        up, down = (np.median(torque[last][near[last] & side[last]]) for side in (rising, ~rising))
        speed = w * math.sqrt(0.4**2 - at**2)
        assert 0.5 * (up + down) == pytest.approx(math.copysign(np.interp(abs(at), WIRE.angles, table), at), abs=0.02)
        assert 0.5 * (up - down) - damping * speed == pytest.approx(WIRE.law.F_c, abs=0.01)


def work_of_a_cycle(w, law, amplitude, frequency):
    """Work [J] that a hand does on the feel of a wire in one cycle of a small turn, at rest, after nine others."""
    own = {"steer_by_wire.friction_law": law} if law else {}
    car = cars.load(CAR, own)
    w = w._replace(law=car.assist.wire.law, law_size=car.assist.wire.law_size)
    p = CAR._replace(assist=CAR.assist._replace(wire=w)).plant(NO_FRICTION, SPEED, robot=True)
    n = round(1.0 / frequency / SAMPLE_TIME)
    t = 2.0 * math.pi * frequency * SAMPLE_TIME * np.arange(1.0, 10 * n + 1.0)
    found = run(p, amplitude * np.sin(t), hand_speed=amplitude * 2.0 * math.pi * frequency * np.cos(t))
    torque, angle = (found[name][-n - 1 :] for name in ("torsion_bar_torque", "handwheel_angle"))
    return float(np.sum(0.5 * (torque[1:] + torque[:-1]) * np.diff(angle)))


def test_feel_is_passive_up_to_the_stated_delay():
    """A lightly damped spring gives work to the hand beyond (W10), and none below it, whatever friction is inside."""
    feel = np.outer(np.ones(WIRE.speeds.size), np.minimum(20.0 * WIRE.angles, 40.0))
    spring = WIRE._replace(feel=feel, damping=np.full(WIRE.speeds.size, 0.06))
    alone = spring._replace(law=NO_FRICTION, law_size=0)
    stated = wire_loops.passive_delay(alone, SPEED)
    assert 0.0 < stated < 0.002
    for factor, sign in ((0.95, 1.0), (1.05, -1.0)):
        late = spring._replace(**as_samples(factor * stated))
        assert sign * work_of_a_cycle(late, "viscous,sigma_2=0.0", 0.01, 10.0) > 0.0
    for law in ("dahl,F_c=0.3,sigma_0=6.0", "masing,F_c=0.3,x_c=0.05"):
        w = spring._replace(law=friction.resolve(law))
        late = spring._replace(**as_samples(wire_loops.passive_delay(w, SPEED)))
        assert all(work_of_a_cycle(late, law, amplitude, 10.0) > 0.0 for amplitude in (0.002, 0.02, 0.2))


@pytest.mark.parametrize("name", ["torque_map", "rack_force", "blended"])
def test_feels_keep_their_margins_in_the_whole_car(name):
    """Wire, rack and tyres are in the loop of a feel that knows the rack force: 30 deg and 6 dB with free hands."""
    car = cars.load(CAR, {"steer_by_wire.feel_law": name})
    for speed in (11.1, 27.8):
        turn = cornering(car, speed)
        for torque, law in ((0.0, "lugre"), (2.0, None)):
            point = with_hands(steady(turn, torque=torque), "off", law)
            found = margins_of_car(point)
            assert point.torque == pytest.approx(torque, abs=1e-6)
            assert found.stable
            assert math.degrees(found.phase) >= 30.0
            assert 20.0 * math.log10(found.gain) >= 6.0
    if name == "torque_map":  # of which the rack is no part: the loop of the handwheel alone
        alone = wire_loops.feel_loop(
            car.column, car.assist.wire, *_slopes(car.assist.wire, point), wire_loops.HANDS[0]
        ).response(Z[50:300])
        np.testing.assert_allclose(open_loop(point).response(margins.FREQUENCIES[50:300]), alone, rtol=1e-4, atol=1e-4)


def _slopes(w, point):
    """Stiffness and damping of the map at a point."""
    ends = [wire_loops.torque_at(w, point.handwheel_angle + side, 0.0, point.speed) for side in (-1e-6, 1e-6)]
    return (ends[1] - ends[0]) / 2e-6, float(np.interp(point.speed, w.speeds, w.damping))


def test_feel_of_the_rack_force():
    """A held handwheel feels a force on the rack by its table, late by the wire; by the map it feels nothing."""
    push = np.where(np.arange(1500) >= 500, 600.0, 0.0)
    for name, expected in (("rack_force", 1.0), ("torque_map", 0.0), ("blended", 0.5)):
        car = cars.load(CAR, {"steer_by_wire.feel_law": name, "steer_by_wire.observer_law": "viscous,sigma_2=0.0"})
        p = car.plant(NO_FRICTION, SPEED, robot=True)
        found = run(p, np.zeros(1500), disturbance=push)
        w = car.assist.wire
        told = float(np.interp(600.0 + found["rack_force"][-1], w.forces, w.force_feel))
        assert found["torsion_bar_torque"][-1] == pytest.approx(expected * told, rel=0.01, abs=1e-9)
        assert np.abs(found["torsion_bar_torque"][:502]).max() < 1e-9


def test_a_wire_beyond_the_margin_of_the_feel_is_refused():
    late = {
        "steer_by_wire.feel_law": "rack_force",
        "steer_by_wire.wire_delay": 0.02,
        "steer_by_wire.damping": [0.2] * 8,
    }
    with pytest.raises(ValueError, match=r"feel by the rack force is unstable with steer_by_wire.wire_delay 0.02 s: "):
        manoeuvres.drive(cars.load(CAR, late), manoeuvres.make("release"), "lugre")


def test_observer_tells_the_rack_force():
    """In the weave at most 15 % off without knowledge of the friction at the rack, and 6 % with it."""
    found = rack_observer.errors(CAR, "masing")
    assert 0.10 < found.uncompensated < 0.15
    assert max(found.one_law, found.own_law) < 0.06


def test_messages_arrive_late_and_at_their_sample_time():
    """The rack's request changes when the message of a turned handwheel arrives, every third sample, five later."""
    w = cars.load(CAR, {"steer_by_wire.wire_delay": 0.005, "steer_by_wire.wire_sample_time": 0.003}).assist.wire
    x, requests = np.zeros(len(states(w))), []
    for i in range(14):
        angle = 0.1 if i >= 2 else 0.0  # after the message at sample 0; the next one is sent at sample 3
        requests.append(sampled(w, x, angle, 0.0, 0.0, 0.0, 0.0, SPEED, 0.0))
    proportional = w.speed_gain * w.position_gain * 0.1 * ratio_at(w, SPEED)
    assert np.flatnonzero(requests)[0] == 8
    assert requests[8] == pytest.approx(proportional)


def test_packaged_feel_is_the_wanted_torque_over_the_acceleration():
    """(E7) at the lateral acceleration that the linear car has at an angle, which ends at 0.9 g; to 0.01 N m."""
    base = cars.load("compact")
    for speed, ratio, row in zip(WIRE.speeds[1:], WIRE.ratio[1:], WIRE.feel[1:]):
        gain = acceleration_gain(base, speed) * ratio
        reached = 0.9 * GRAVITY * np.tanh(gain * WIRE.angles / (0.9 * GRAVITY))
        np.testing.assert_allclose(row, [torque_build_up(A) for A in reached], atol=0.011)
    assert acceleration_gain(CAR, 10.0) == pytest.approx(acceleration_gain(base, 10.0) * ratio_at(WIRE, 10.0))
    np.testing.assert_allclose(WIRE.feel[0], 3.0 * np.tanh(WIRE.angles / 2.0), atol=0.006)


def test_one_machine_code_serves_column_and_wire():
    """Neither the wire nor the wanted friction is in the type of a bound plant."""
    changes = ({}, {"steer_by_wire.friction_law": "masing"}, {"steer_by_wire.feel_law": "blended"})
    others = [cars.load(CAR, each) for each in changes]
    kinds = {numba.typeof(plant.bound(car.plant(None, SPEED))) for car in (cars.load("compact"), *others)}
    assert len(kinds) == 1


def test_car_file_and_environment_take_it():
    again = cars.load(CAR.data())
    assert again.data() == CAR.data()
    assert cars.load("compact", steering="steer_by_wire") is CAR
    changed = cars.load({"base": "compact", "steer_by_wire": {"feel_scale": 1.5}}).assist.wire
    np.testing.assert_array_equal(changed.feel[1], [0.0, 2.25, 4.5, 7.5, 12.0])
    with pytest.raises(ValueError, match="steer_by_wire was replaced in the car by what no car file gives"):
        CAR._replace(assist=CAR.assist._replace(wire=WIRE._replace(limit=3.0))).data()
    env = gym.make("steer_env/AssistWeave-v3", steering="steer_by_wire")
    env.reset(seed=1)
    assert np.isfinite(env.step(env.action_space.sample())[1])


def test_tuning_changes_the_feel():
    env = gym.make("steer_env/TuneOnCentre-v3", steering="steer_by_wire", detuning=0.0).unwrapped
    env.reset(seed=1)
    assert "lead_zero" not in env.scenario.parameters
    assert "return_gain" not in env.scenario.parameters
    stiffer = np.zeros(env.action_space.shape, np.float32)
    stiffer[env.scenario.parameters.index("boost_level")] = 0.3
    made = env.tuned_car(stiffer).assist.wire
    np.testing.assert_allclose(made.feel[-1], 2.5**0.3 * WIRE.feel[-1], rtol=1e-6)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"assist.return_gain": 5.0}, "assist.return_gain of a car with steer_by_wire follows from its section"),
        ({"column.K_tb": 100.0}, r"column.K_tb of a car with steer_by_wire follows .*, or give 0.0, got 100.0"),
        ({"rack_eps.motor_torque": 5.0}, "a car has no 'rack_eps.motor_torque'; it has .*, steer_by_wire.KEY"),
        (
            {"steer_by_wire.ratio": [-1.0, *[1.0] * 7]},
            r"steer_by_wire.ratio must hold 8 .* 0.1 to 5 \[1\], got \[-1.0, ",
        ),
        ({"steer_by_wire.wire_delay": 0.03}, "steer_by_wire.wire_delay must be finite and at least 0 and at most 0.02"),
        ({"steer_by_wire.wire_delay": 0.0025}, "steer_by_wire.wire_delay must be whole milliseconds, 0 to 0.02, got"),
        (
            {"assist.delay": 0.0035},
            r"assist.delay must be below 0.00251 s, from which on the loop of the rack's .* 0.0035",
        ),
        (
            {"steer_by_wire.feedback_delay": 0.004, "steer_by_wire.feedback_bandwidth": 7.0},
            r"steer_by_wire.feedback_delay must be below 0.00\d* s, from which on the loop of the feel at \d+ km/h",
        ),
        (
            {"steer_by_wire.friction_law": "coulomb"},
            "the loop of the feel at 0 km/h is unstable with every steer_by_wire.f",
        ),
        (
            {"steer_by_wire.feel_law": "mapp"},
            "steer_by_wire.feel_law: unknown feel 'mapp'; available: blended, rack_force",
        ),
        ({"steer_by_wire.force_share": [0.5, 1.5]}, "steer_by_wire.force_share must hold 8 values .*, each 0 to 1"),
        ({"steer_by_wire.forces": [10.0, 20.0]}, "steer_by_wire.forces must start at zero, got 10"),
        ({"steer_by_wire.observer_law": "lugrre"}, "steer_by_wire.observer_law: .*unknown friction law 'lugrre'"),
        ({"steer_by_wire.feel": [[0.0, 1.0]]}, "steer_by_wire.feel must have 8 rows of 14 torques, 0 to 100 N m"),
    ],
)
def test_what_is_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        cars.load(CAR, changes)


def test_a_column_without_torsion_bar_needs_a_wire():
    with pytest.raises(ValueError, match=r"column.K_tb must be finite and greater than 0, got 0.0"):
        cars.load({"base": "compact", "column": {"K_tb": 0.0, "C_tb": 0.0}})
