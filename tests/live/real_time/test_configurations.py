"""Configurations of cars in one loop: a switch without a jump, whatever the next car does."""

import gc
import math
import sys
from pathlib import Path

import numpy as np
import pytest

from steer_env import friction
from steer_env.live.real_time import CarConfiguration, CarConfigurations
from steer_env.live.real_time.configurations import (
    ACTING_PLACE,
    FADE,
    HEAD,
    IMPLAUSIBLE,
    LONGEST,
    NEXT_CAR,
    NEXT_SHARE,
    RUN_IN,
)
from steer_env.live.real_time.model import make_model, restart, step
from steer_env.vehicle import cars, subsystems
from steer_env.vehicle.plant import CHANNEL, channels
from steer_env.vehicle.steering.column import HANDWHEEL_ANGLE, Column

if sys.platform != "linux":
    pytest.skip("the loop needs Linux", allow_module_level=True)

MARK = 0.05  # change of the torque by a switch, in a sample [N m]
TORQUE, ANGLE = CHANNEL["torsion_bar_torque"], CHANNEL["handwheel_angle"]
FUNCTIONS = Path(__file__).parents[3] / "examples" / "assist_functions.toml"
# Other laws, cars, assists and chassis, whose states have other names and numbers.
DIFFERENT = {
    "compact on two tracks, lugre": ("compact", "lugre", "two_track"),
    "all functions on one track, masing": (FUNCTIONS, "masing", "single_track"),
    "escort on two tracks, lugre": ("ford_escort", "lugre,F_c=2.0", "two_track"),
}
LAWS = {law: ("compact", law, "single_track") for law in friction.available()}


def configuration_of(label, kind, robot=True, speed=100.0 / 3.6):
    """A configuration by car, law and chassis."""
    car, law, chassis = kind
    return CarConfiguration(
        label, subsystems.make("car", cars.load(car).plant(law, speed, robot, chassis=chassis), speed)
    )


def configurations_of(kinds, robot=True, speed=100.0 / 3.6):
    return CarConfigurations([configuration_of(label, kind, robot, speed) for label, kind in kinds.items()])


def drive(configurations, samples, amplitude, frequency=0.5, choices=(), robot=True):
    """Channels of a sine of the handwheel's angle or torque, and the next configuration's share: (N, C + 1).

    ``choices`` are pairs of a sample and a configuration.
    """
    model, choices = make_model(configurations), dict(choices)
    omega, found = 2.0 * math.pi * frequency, np.zeros((samples, len(CHANNEL) + 1))
    for k in range(samples):
        if k in choices:
            configurations.choose(choices[k])
        t = 1e-3 * (k + 1)
        size = amplitude * min(t, 1.0)
        if robot:
            model.given[1], model.given[2] = size * math.sin(omega * t), size * omega * math.cos(omega * t)
        else:
            model.given[0] = size * math.sin(omega * t)
        assert step(model, 1)
        found[k, :-1], found[k, -1] = model.outputs[0], model.now[2]
    return found


def break_parameters(configurations, index):
    """Let a configuration not stay finite from now on."""
    m = configurations.memory
    for first in (m.numbers[index], m.held[index]):
        place = (first - m.parameters.ctypes.data) // 8
        m.parameters[place : place + 9] = math.nan  # the column


def excess(switched, one, other):
    """Largest change of the torque in a sample beyond that of the drive unswitched, with either configuration [N m]."""
    changes = (np.abs(np.diff(each[: len(switched), TORQUE])) for each in (switched, one, other))
    mine, *unswitched = changes
    return float((mine - np.maximum(*unswitched)).max())


def worst_switch(kinds, amplitude, frequency=0.5, robot=True, speed=100.0 / 3.6):
    """Largest excess from each to its neighbours, at the turning points of the second weave and between."""
    made = [configuration_of(label, kind, robot, speed) for label, kind in kinds.items()]
    turning = 1e3 * 1.25 / frequency
    ats = [round(turning - 0.25e3 / frequency), round(turning)]
    length = ats[-1] + 500
    alone = [drive(CarConfigurations([each]), length, amplitude, frequency, robot=robot) for each in made]
    found = []
    for i, j in sorted({(i, (i + side) % len(made)) for i in range(len(made)) for side in (1, -1)}):
        for at in ats:
            begin = at - RUN_IN - FADE // 2
            configurations = CarConfigurations([made[i], made[j]])
            switched = drive(configurations, at + 500, amplitude, frequency, [(begin, 1)], robot)
            assert np.array_equal(switched[: begin + RUN_IN], alone[i][: begin + RUN_IN])
            assert configurations.chosen() == 1
            if not robot:  # later, the handwheel is elsewhere than in either drive
                switched = switched[: np.flatnonzero(switched[:, -1])[-1] + 20]
            found.append((excess(switched, alone[i], alone[j]), made[i].label, made[j].label, at))
    largest = max(np.abs(each[:, TORQUE]).max() for each in alone)
    print(f"torques up to {largest:.1f} N m, largest change by a switch {max(found)}")
    return max(found)[0], largest


def test_a_switch_between_different_cars_does_not_jump():
    assert worst_switch(DIFFERENT, 1.0)[0] < MARK


def test_a_switch_at_large_torques_does_not_jump():
    """In parking, at a robot's angle."""
    worst, largest = worst_switch(dict(list(DIFFERENT.items())[:2]), 6.0, speed=3.0)
    assert largest > 8.0
    assert worst < MARK


def test_a_switch_under_a_hand_torque_does_not_jump():
    assert worst_switch(DIFFERENT, 3.0, robot=False)[0] < MARK


@pytest.mark.whole
@pytest.mark.parametrize(("amplitude", "speed", "robot"), [(4.0, 3.0, True), (8.0, 100.0 / 3.6, False)])
def test_a_switch_between_laws_does_not_jump(amplitude, speed, robot):
    """At a robot's angle in parking, and under a hand torque."""
    assert worst_switch(LAWS, amplitude, speed=speed, robot=robot)[0] < MARK


# One law, and the car's own friction at five sites.
SITES = {str(law): ("compact", law, "single_track") for law in ("lugre", None)}


@pytest.mark.parametrize(
    ("amplitude", "speed", "robot"), [(1.0, 100.0 / 3.6, True), (4.0, 3.0, True), (3.0, 27.8, False)]
)
def test_a_switch_between_sites_does_not_jump(amplitude, speed, robot):
    assert worst_switch(SITES, amplitude, speed=speed, robot=robot)[0] < MARK


def test_a_configuration_that_took_over_is_the_car_itself():
    """Soon behind the switch to an equal chassis, the torque is that of a drive with the other configuration alone."""
    kinds = {law: ("compact", law, "two_track") for law in ("lugre", "masing")}
    first, second = (configuration_of(label, kind) for label, kind in kinds.items())
    switched = drive(CarConfigurations([first, second]), 2600, 0.7, choices=[(1200, 1)])
    alone = drive(CarConfigurations([second]), 2600, 0.7)
    assert np.abs(switched[1600:, TORQUE] - alone[1600:, TORQUE]).max() < 0.05
    assert np.abs(switched[:1400, TORQUE] - alone[:1400, TORQUE]).max() > 0.09


def test_the_motion_of_the_car_goes_on_in_the_next_one():
    """In a turn, also to a chassis that calls its states otherwise; at a lower speed, without a brake or a push."""
    configurations = configurations_of(DIFFERENT)
    model = make_model(configurations)
    names = [name for name, _ in channels(configurations.configurations[0].subsystem.parameters)]
    yaw, speed = names.index("yaw_rate"), names.index("longitudinal_speed")
    model.given[1] = 0.2
    model.given[[signal.name for signal in configurations.subsystem.given].index("target_speed")] = -8.0
    for target in (1, 2, 0):
        for _ in range(6000):
            assert step(model, 1)
        acting = int(model.state[ACTING_PLACE])
        configurations.choose(target)
        assert step(model, 1)
        before, after = configurations.memory.rows[acting], configurations.memory.rows[1 - acting]
        assert abs(before[yaw]) > 0.05
        assert after[yaw] == pytest.approx(before[yaw], rel=0.05)
    assert before[speed] < 21.0  # far below that of straight running, from which the last two cars began
    for _ in range(RUN_IN):
        assert step(model, 1)
    assert after[speed] == pytest.approx(before[speed], abs=0.1)


def test_cars_under_a_hand_torque_share_one_handwheel():
    """In run-in and fade both have the same angle, which goes on without a jump, as its speed does."""
    configurations = configurations_of(DIFFERENT, robot=False)
    model, width = make_model(configurations), configurations.memory.start.shape[1]
    angles = []
    for k in range(2500):
        if k == 1500:
            configurations.choose(1)
        model.given[0] = 3.0 * math.sin(math.pi * 1e-3 * k)
        assert step(model, 1)
        both = model.state[[HEAD + HANDWHEEL_ANGLE, HEAD + width + HANDWHEEL_ANGLE]]
        if model.state[NEXT_CAR] >= 0.0:
            assert both[0] == both[1]
            assert model.outputs[0, ANGLE] == pytest.approx(both[0], abs=1e-12)
            assert model.outputs[0, CHANNEL["handwheel_torque"]] == pytest.approx(model.given[0], abs=1e-9)
        angles.append(model.outputs[0, ANGLE])
    assert configurations.chosen() == 1
    bends = np.abs(np.diff(angles, 2))
    assert bends[1490:1900].max() < 1.5 * bends[500:1490].max()


def test_a_choice_within_a_switch():
    """In the run-in the latest replaces the next configuration, and that of the acting one ends it.

    A fade turns round for the acting configuration, and goes on first for another one.
    """
    configurations = configurations_of(DIFFERENT)
    model = make_model(configurations)
    model.given[1] = 0.3
    torque = []

    def run(samples):
        for _ in range(samples):
            assert step(model, 1)
            torque.append(model.outputs[0, TORQUE])

    run(1000)
    configurations.choose(1)
    run(RUN_IN // 2)
    assert configurations.memory.now.tolist() == [0.0, 1.0, 0.0]
    configurations.choose(0)
    run(1)
    assert configurations.memory.now.tolist() == [0.0, -1.0, 0.0]
    configurations.choose(1)
    run(RUN_IN // 2)
    configurations.choose(2)
    run(RUN_IN + FADE // 2)
    assert configurations.memory.now[1] == 2.0
    assert 0.2 < configurations.memory.now[2] < 1.0
    share = configurations.memory.now[2]
    configurations.choose(1)
    configurations.choose(0)
    run(1)
    assert configurations.memory.now[2] < share
    run(RUN_IN)
    assert configurations.memory.now.tolist() == [0.0, -1.0, 0.0]
    configurations.choose(2)
    run(RUN_IN + FADE // 2)
    configurations.choose(1)
    run(1000)
    assert configurations.chosen() == 1
    assert configurations.counts() == {"switched": 2, "dropped": 0}
    assert np.abs(np.diff(torque[990:])).max() < MARK


@pytest.mark.parametrize("robot", [True, False])
def test_random_choices_never_jump(robot):
    draw = np.random.default_rng(6)
    choices = [(k, int(draw.integers(3))) for k in np.cumsum(draw.integers(1, 400, 40)) + 1000]
    length, size = choices[-1][0] + 500, 0.5 if robot else 2.0
    configurations = configurations_of(DIFFERENT, robot)
    switched = drive(configurations, length, size, choices=choices, robot=robot)
    alone = [drive(CarConfigurations([each]), length, size, robot=robot) for each in configurations.configurations]
    usual = max(np.abs(np.diff(each[:, TORQUE])).max() for each in alone)
    assert configurations.counts()["switched"] > 10
    assert np.abs(np.diff(switched[:, TORQUE])).max() < usual + MARK


@pytest.mark.parametrize("damping", [-20.0, -50.0, -150.0])
def test_a_configuration_that_diverges_and_stays_finite_is_dropped(damping):
    """It does not keep the torque, and another configuration can be chosen behind it."""
    configurations = CarConfigurations([configuration_of(label, LAWS["lugre"]) for label in "abc"])
    alone = drive(CarConfigurations([configurations.configurations[0]]), 6000, 0.3)[:, TORQUE]
    m, model, torque = configurations.memory, make_model(configurations), []
    for k in range(6000):
        if k in (1000, 4500):
            configurations.choose(1 if k == 1000 else 2)
        if k == 1000 + RUN_IN + FADE // 2:
            for first in (m.numbers[1], m.held[1]):
                m.parameters[(first - m.parameters.ctypes.data) // 8 + Column._fields.index("C2")] = damping
        t = 1e-3 * (k + 1)
        size = 0.3 * min(t, 1.0)
        model.given[1], model.given[2] = size * math.sin(math.pi * t), size * math.pi * math.cos(math.pi * t)
        assert step(model, 1)
        torque.append(model.outputs[0, TORQUE])
    beyond = np.flatnonzero(np.abs(np.array(torque) - alone) > 0.1)
    assert configurations.counts() == {"switched": 1, "dropped": 1}
    assert configurations.chosen() == 2
    assert np.abs(torque).max() <= IMPLAUSIBLE
    assert beyond.max(initial=0) < 1000 + RUN_IN + LONGEST + 4 * FADE


@pytest.mark.parametrize("robot", [True, False])
@pytest.mark.parametrize("fading", [False, True])
def test_a_configuration_that_does_not_stay_finite_is_dropped(robot, fading):
    """In the run-in at once, in the fade by fading back; the acting configuration goes on, and others can be chosen."""
    configurations = configurations_of(DIFFERENT, robot)
    alone = drive(CarConfigurations([configurations.configurations[0]]), 1500, 0.5, robot=robot)
    model, torque = make_model(configurations), []
    for k in range(3000):
        if k == 1000:
            configurations.choose(1)
        if k == 1000 + (RUN_IN + FADE // 2 if fading else RUN_IN // 2):
            break_parameters(configurations, 1)
        if k == 2000:
            configurations.choose(2)
        t = 1e-3 * (k + 1)
        size = 0.5 * min(t, 1.0)
        sine, cosine = math.sin(math.pi * t), math.cos(math.pi * t)
        model.given[0], model.given[1], model.given[2] = size * sine, size * sine, size * math.pi * cosine
        assert step(model, 1)
        torque.append(model.outputs[0, TORQUE])
        if k == 1900:
            assert configurations.memory.now.tolist() == [0.0, -1.0, 0.0]
            assert configurations.counts() == {"switched": 0, "dropped": 1}
    assert configurations.chosen() == 2
    assert np.isfinite(torque).all()
    if not fading:
        assert np.array_equal(torque[:1500], alone[:, TORQUE])
    assert np.abs(np.diff(torque)).max() < np.abs(np.diff(alone[:, TORQUE])).max() + MARK


def test_an_acting_configuration_that_does_not_stay_finite_is_a_failure_and_leaves_all_as_it_was():
    configurations = configurations_of(dict(list(DIFFERENT.items())[:2]))
    model = make_model(configurations)
    configurations.choose(1)
    for _ in range(RUN_IN + FADE // 2):
        assert step(model, 1)
    break_parameters(configurations, 0)
    before, shown = model.state.copy(), model.outputs.copy()
    assert not step(model, 1)
    assert np.array_equal(model.state, before)
    assert np.array_equal(model.outputs, shown)
    assert 0.0 < model.state[NEXT_SHARE] < 1.0


def test_a_new_session_begins_with_the_first_configuration_and_takes_the_choice_again():
    configurations = configurations_of(dict(list(DIFFERENT.items())[:2]))
    model = make_model(configurations)
    configurations.choose(1)
    for _ in range(RUN_IN + 2 * FADE):
        step(model, 1)
    assert configurations.chosen() == 1
    restart(model)
    step(model, 1)
    assert configurations.chosen() == 0
    for _ in range(RUN_IN + 2 * FADE):
        step(model, 1)
    assert configurations.chosen() == 1
    assert model.state[ACTING_PLACE] == 1.0


def test_configurations_keep_what_their_code_needs():
    configurations = configurations_of(dict(list(DIFFERENT.items())[:1]))
    expected = drive(configurations, 200, 1.0)
    model = make_model(configurations)
    del configurations
    gc.collect()
    noise = [np.random.default_rng(1).random(60_000) for _ in range(20)]  # takes the place of what was freed
    for k in range(200):
        t = 1e-3 * (k + 1)
        model.given[1], model.given[2] = t * math.sin(math.pi * t), t * math.pi * math.cos(math.pi * t)
        assert step(model, 1)
        assert np.array_equal(model.outputs[0], expected[k, :-1])
    assert noise


def test_bad_configurations_are_named():
    car = configuration_of("a", DIFFERENT["compact on two tracks, lugre"])
    with pytest.raises(ValueError, match="at least one configuration"):
        CarConfigurations([])
    with pytest.raises(ValueError, match="its own label, got 'a' twice"):
        CarConfigurations([car, car])
    other = configuration_of("b", DIFFERENT["compact on two tracks, lugre"], robot=False)
    with pytest.raises(ValueError, match="those of 'b' differ"):
        CarConfigurations([car, other])
    steering = CarConfiguration("s", subsystems.make("steering", cars.load("compact").plant(robot=True), 20.0))
    with pytest.raises(ValueError, match="made of the subsystem car, got steering for 's'"):
        CarConfigurations([steering])
    configurations = CarConfigurations([car])
    for index in (1, -1, 0.5, "a"):
        with pytest.raises(ValueError, match=r"the configuration must be one of 0 \(a\), got"):
            configurations.choose(index)
