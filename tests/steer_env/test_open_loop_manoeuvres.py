"""Steps, sines, sweeps, noise, circles and transitions as driven by the default car: what their metrics say."""

from dataclasses import replace

import numpy as np
import pytest

from steer_env import manoeuvres, metrics
from steer_env.manoeuvres.common import driving
from steer_env.vehicle import cars, plant

CAR = cars.load()
# Metrics of the default car with LuGre: range in which they are plausible for a compact car, and refused ones.
PLAUSIBLE = {
    "step-steer": {
        "yaw_rate_step_gain": (0.2, 0.4),
        "yaw_rate_time_to_90": (0.08, 0.25),
        "yaw_rate_overshoot": (0.05, 0.4),
        "lateral_acceleration_time_to_90": (0.2, 0.5),
        "steady_step_sideslip": (-3.0, 0.0),
        "tb_factor": (0.1, 1.0),
    },
    "sine": {"yaw_rate_sine_lag": (20.0, 100.0), "lateral_acceleration_sine_lag": (80.0, 250.0)},
    "frequency-response": {
        "yaw_rate_resonance_frequency": (0.6, 1.6),
        "yaw_rate_bandwidth": (1.5, 3.0),
        "yaw_rate_equivalent_time": (0.08, 0.25),
        "lateral_acceleration_bandwidth": (0.6, 2.0),
    },
    "random-steer": {"yaw_rate_resonance_frequency": (0.6, 1.6), "yaw_rate_lowest_coherence": (0.95, 1.0)},
    "steady-circle": {"understeer_gradient": (1.0, 5.0), "roll_gradient": (3.0, 9.0), "sideslip_gradient": (-8, 0)},
    "steady-circle-speed": {"understeer_gradient": (1.0, 5.0), "characteristic_speed": (60.0, 120.0)},
    "transition": {
        "lateral_acceleration_transition_torque_deadband": (0.2, 1.5),
        "lateral_acceleration_transition_angle_deadband": (0.0, 3.0),
        "transition_sensitivity_at_1m_s2": (0.8, 1.8),
    },
}
REFUSED = {
    "random-steer": {"yaw_rate_bandwidth", "torque_gain_at_1hz", "torque_phase_lead_at_1hz"},
    "steady-circle": {"critical_speed"},
    "steady-circle-speed": {"critical_speed"},
}


@pytest.fixture(scope="module")
def recordings():
    return {name: manoeuvres.drive(CAR, manoeuvres.make(name), "lugre") for name in PLAUSIBLE}


@pytest.mark.parametrize("name", PLAUSIBLE)
def test_the_metrics_of_the_default_car_are_plausible(recordings, name):
    found = metrics.evaluate(recordings[name])
    assert {key for key, value in found.items() if value.reason} == REFUSED.get(name, set())
    for key, (low, high) in PLAUSIBLE[name].items():
        assert low < found[key].value < high, key


def test_both_circles_agree_on_understeer(recordings):
    """Two methods and two chassis: within 15 %."""
    by_radius, by_speed = (
        metrics.evaluate(recordings[name])["understeer_gradient"].value
        for name in ("steady-circle", "steady-circle-speed")
    )
    assert by_radius == pytest.approx(by_speed, rel=0.15)


def test_the_driver_holds_the_circle(recordings):
    """Speed over yaw rate within 3 % of the radius from 1 to 6 m/s2 but for a hundredth of the time, on both sides."""
    circle = recordings["steady-circle"]
    rising = np.gradient(circle["vehicle_speed"], circle.time) > 0.2
    level = np.abs(circle["lateral_acceleration"])
    turning = rising & (level > 1.0) & (level < 6.0)
    radius = circle["vehicle_speed"][turning] / circle["yaw_rate"][turning]
    assert np.quantile(np.abs(np.abs(radius) - 100.0), 0.99) < 3.0
    assert {1.0, -1.0} == set(np.sign(radius))


def test_transition_is_slow_and_random_steering_is_in_its_band(recordings):
    rate = np.degrees(np.abs(recordings["transition"]["handwheel_speed"]))
    assert rate[recordings["transition"].time < 12.0].max() < 5.0
    angle = recordings["random-steer"]["handwheel_angle"]
    power, f = np.abs(np.fft.rfft(angle)) ** 2, np.fft.rfftfreq(angle.size, 1e-3)
    assert power[(f > 0.1) & (f < 2.5)].sum() > 0.99 * power.sum()
    again = manoeuvres.make("random-steer").hand(recordings["random-steer"].time, 1.0)[0]
    other = manoeuvres.make("random-steer", seed=1).hand(recordings["random-steer"].time, 1.0)[0]
    assert np.array_equal(again, manoeuvres.make("random-steer").hand(recordings["random-steer"].time, 1.0)[0])
    assert abs(np.corrcoef(again, other)[0, 1]) < 0.2


def test_sides_and_repeats_of_the_step():
    both = manoeuvres.make("step-steer", repeats=2)
    right = manoeuvres.make("step-steer", left=False)
    t = np.arange(0.0, both.duration, 0.01)
    angle = both.hand(t, 0.5)[0]
    assert [np.interp(x, t, angle) for x in (3.0, 13.0, 23.0, 33.0)] == pytest.approx([0.5, -0.5, 0.5, -0.5])
    p = manoeuvres.build_plant(CAR, right, "viscous")
    assert driving.find_amplitude(p, right) > 0.0
    with pytest.raises(ValueError, match="no step with left=False, right=False"):
        manoeuvres.make("step-steer", left=False, right=False)


@pytest.mark.parametrize("test", ["weave", "step-steer"])
def test_a_search_near_what_another_law_found_takes_few_runs_and_comes_as_close(test, monkeypatch):
    m, run, runs = manoeuvres.make(test), driving.run_beside, []
    near = driving.search(driving.build_plant(CAR, m, "lugre"), m)
    monkeypatch.setattr(driving, "run_beside", lambda *args, **more: runs.append(args) or run(*args, **more))
    for law in ("masing", "viscous"):
        p = driving.build_plant(CAR, m, law)
        runs.clear()
        amplitude = driving.search(p, m, near=near).amplitude
        assert 1 <= len(runs) <= 3
        record = driving.run(p, m, driving.inputs(m, amplitude, m.trial or m.duration))
        reached = m.reach(record[:, plant.CHANNEL["lateral_acceleration"]])
        assert reached == pytest.approx(m.lateral_acceleration, rel=driving.CLOSE)
        assert amplitude == pytest.approx(driving.find_amplitude(p, m), rel=3.0 * driving.CLOSE)


@pytest.mark.parametrize("test", ["weave", "release"])
def test_cars_beside_each_other_have_the_amplitudes_and_the_channels_of_each_alone(test):
    """To the bit: in fours, in threes with the last one twice, in pairs that go alone, and of other laws between."""
    m = manoeuvres.make(test)
    near = driving.search(driving.build_plant(CAR, m, "lugre"), m)
    plants = [driving.build_plant(CAR.loaded(mass), m, "lugre") for mass in (0.0, 60.0, 120.0)]
    plants.append(plants[0]._replace(friction_torque_scale=1.3))
    alone = [driving.open_loop(p, m, near=near) for p in plants]
    records = [driving.run(p, m, each.inputs, each.straight) for p, each in zip(plants, alone)]
    for count in (4, 3, 2):
        beside = driving.open_loops([(p, m) for p in plants[:count]], near=near)
        assert [each.amplitude for each in beside] == [each.amplitude for each in alone[:count]]
        u, straight = np.array([each.inputs for each in beside]), [each.straight for each in beside]
        assert np.array_equal(driving.run_beside(plants[:count], m, u, straight), records[:count])
    plants[2] = driving.build_plant(CAR, m, "masing")
    straight = [plant.initial_state(p) for p in plants]
    u = np.array([each.inputs for each in alone])
    for p, rows, record in zip(plants, u, driving.run_beside(plants, m, u, straight)):
        assert np.array_equal(driving.run(p, m, rows), record)


def test_a_car_that_reaches_no_acceleration_is_told_beside_others():
    m = manoeuvres.make("weave")
    plants = [driving.build_plant(CAR, m, "lugre", mu) for mu in (1.0, 0.15, 0.9, 0.95)]
    found = driving.open_loops([(p, m) for p in plants], near=driving.search(plants[0], m))
    with pytest.raises(ValueError, match="no handwheel amplitude reaches 2 m/s2") as alone:
        driving.open_loop(plants[1], m)
    assert str(found[1]) == str(alone.value)
    assert [isinstance(each, ValueError) for each in found] == [False, True, False, False]


def test_a_simulator_binds_every_plant_that_it_runs():
    """One after the other, also one that differs in a number alone, and arrays with gaps after those without."""
    weave = manoeuvres.make("weave")
    plants = [driving.build_plant(CAR, weave, law) for law in ("lugre", "masing")]
    plants.append(plants[0]._replace(friction_torque_scale=2.0))
    u = driving.inputs(weave, 0.2, 1.0)
    for p in (*plants, *plants):
        state, record = plant.initial_state(p), np.zeros((len(u), len(plant.channels(p))))
        expected, shown = state.copy(), record.copy()
        assert driving.OWN_SIMULATOR.run(p, state, u, record, 1) == plant.run(p, expected, u, shown, 1)
        assert state.tobytes() + record.tobytes() == expected.tobytes() + shown.tobytes()
        again, spread = plant.initial_state(p), np.repeat(u, 2, axis=0)[::2]
        assert driving.OWN_SIMULATOR.run(p, again, spread, record, 1)
        assert again.tobytes() == state.tobytes()


def test_a_driver_with_torque_is_interpolated():
    """A hand torque that rises by 1 N m a second, told every 10 ms, arrives as a straight line."""
    hold = replace(manoeuvres.make("hold"), duration=1.0, driver=lambda car, p: lambda t, row: (1.0 * (t + 0.01), 0.0))
    recording = manoeuvres.drive(CAR, hold, "viscous")
    assert recording["handwheel_torque"] == pytest.approx(recording.time, abs=1e-9)
