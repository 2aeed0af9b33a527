"""Shipped policies in the scripts of the page, against Python: network, observations, guard, and the closed loop."""

import sys
from functools import lru_cache

import gymnasium as gym
import numpy as np
import pytest

from steer_env.courses.path import locate
from steer_env.experiments.explore import parameters, policies
from steer_env.experiments.learning import network, policy
from steer_env.friction.numerics.packing import slices
from steer_env.manoeuvres.double_lane_change import APPROACH
from steer_env.vehicle import cars
from steer_env.vehicle.chassis.common.interface import HAND, HAND_SPEED
from tests.experiments.explore.engine import engine

DRIVER, WEAVE, ALL_ROUND = (
    f"steer_env/{name}-v3" for name in ("DriverDoubleLaneChange", "AssistWeave", "AssistAllRound")
)
# Options that make the start that of the page, and seconds that are driven.
STRAIGHT = {"mirrored": 0, "entry_offset": 0.0, "entry_heading": 0.0}
CASES = {
    DRIVER: ("single_track", STRAIGHT, 9.0),
    WEAVE: ("single_track", {"amplitude": 0.26}, 4.0),
    ALL_ROUND: ("two_track", {"scenario": 0}, 4.0),
}
SEEN = ("handwheel_angle", "handwheel_torque", "motor_torque", "lateral_acceleration", "yaw_rate", "x", "y")
# As the worker of the page drives: the policy before every sample, with the hands that the environment had.
DRIVE = """{
  const numbers = simulation.packed(structure, values), record = [], observed = [], actions = [];
  car.begin(numbers);
  car.numbers[robot] = hands.length ? 1 : 0;
  const { channels } = structure, inertia = numbers[structure.places["column.I1"][0]];
  const pilot = new policies.Policy(data, Float32Array.from(weights), channels, car.outputs);
  if (path) pilot.follow(Float64Array.from(path.flat()), [begin, 0, 0]);
  const places = names.map((name) => channels.indexOf(name)), own = channels.indexOf("longitudinal_speed");
  for (let i = 0; i < samples; i++) {
    const now = own < 0 ? speed : car.outputs[own];
    if (i % data.samples === 0) {
      record.push(places.map((place) => car.outputs[place]));
      observed.push(pilot.observations(now));
    }
    car.given[data.given] = pilot.torque(now, inertia);
    if (i % data.samples === 0) actions.push(pilot.action);
    if (hands.length) [car.given[1], car.given[2]] = hands[i];
    car.advance(1);
  }
  return { record, observed, actions };
}"""


def described(env_id):
    """What the page takes of a policy, and its weights as a list."""
    data = policies.described(env_id)
    return data, data.pop("weights").tolist()


@lru_cache(None)
def driven(env_id):
    """An episode of a policy in its environment, without noise, delay or anything drawn: channels, observations [SI],
    actions, motion of the hands at every sample, and the speed."""
    body, options, seconds = CASES[env_id]
    env = gym.make(env_id, friction="lugre", chassis=body).unwrapped
    batch, controller = env.batch, policy.Policy(policy.shipped_policy(env_id), env)
    seen, _ = env.reset(seed=0, options=options)
    record, observed, actions, hands = [], [], [], []
    places = [batch.channels.index(name) for name in SEEN]
    for _ in range(round(seconds / batch.control_dt)):
        record.append(batch.arrays.channels[0, places].copy())
        observed.append(seen * batch.observation_scale)
        actions.append(controller.act(seen))
        seen, _, over, _, _ = env.step(actions[-1])
        assert not over
        hands.extend(batch.arrays.inputs[0][:, [HAND, HAND_SPEED]].tolist() if batch.task.robot else [])
    return np.array(record), np.array(observed), np.ravel(actions), hands, batch.conditions[0].speed


def test_the_page_has_assists_and_a_driver():
    assert {each["id"]: each["role"] for each in policies.listed()} == {
        DRIVER: "driver",
        WEAVE: "assist",
        ALL_ROUND: "assist",
    }
    with pytest.raises(ValueError, match="no policy is shipped with"):
        policies.described("steer_env/DriverLaneKeeping-v3")


def test_a_page_is_written_without_torch(monkeypatch):
    monkeypatch.setitem(sys.modules, "torch", None)
    assert policies.described(DRIVER)["weights"].size == 26 * 64 + 65 * 64 + 65


@pytest.mark.parametrize("env_id", CASES)
def test_the_network_acts_as_in_python(env_id):
    data, weights = described(env_id)
    path = policy.shipped_policy(env_id)
    seen = np.random.default_rng(0).normal(0.0, 1.0, (50, len(data["observed"]))).astype(np.float32)
    found = engine("lugre", "single_track").value(
        "seen.map((each) => policies.forward(data.layers, Float32Array.from(weights), each))",
        data=data,
        weights=weights,
        seen=seen.tolist(),
    )
    expected = network.load(path, policy.read_description(path))(seen)[:, 0]
    assert np.ptp(expected) > 0.5
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-6)


@pytest.mark.parametrize("env_id", CASES)
def test_a_drive_of_the_page_is_that_of_the_environment(env_id):
    """Observations, actions and channels; networks of the page are computed with 64 bits, those of Python with 32."""
    car, (body, _, seconds) = cars.load("compact"), CASES[env_id]
    record, observed, actions, hands, speed = driven(env_id)
    data, weights = described(env_id)
    made = engine("lugre", body)
    values = {q["name"]: q["value"] for q in made.structure["parameters"]} | {"speed_kph": 3.6 * speed}
    found = made.value(
        DRIVE,
        data=data,
        weights=weights,
        values=values,
        robot=slices(parameters.plant(car, "lugre", body, values))["robot"].start,
        hands=hands,
        path=policies.paths(car)["double-lane-change"].tolist() if data["follows"] else None,
        begin=APPROACH,
        names=SEEN,
        speed=speed,
        samples=round(1000 * seconds),
    )
    assert np.ptp(actions) > 0.1
    np.testing.assert_allclose(found["actions"], actions, rtol=0.0, atol=1e-6)
    for name, own, theirs in zip(SEEN, np.array(found["record"]).T, record.T):
        assert np.abs(own - theirs).max() <= 1e-6 * np.ptp(theirs), name
    sizes = [each["scale"] for each in data["observed"]]
    np.testing.assert_allclose(np.array(found["observed"]) / sizes, observed / sizes, rtol=0.0, atol=1e-5)


def test_a_driver_follows_a_path_wherever_it_begins():
    """A pose on a path that begins elsewhere in another direction is observed as that on the path itself."""
    data, weights = described(DRIVER)
    path, (x, y, yaw) = policies.paths(cars.load("compact"))["double-lane-change"], (500.0, -40.0, 2.9)
    ahead, left, turned = 31.0, 0.7, 0.05
    there = [x + ahead * np.cos(yaw) - left * np.sin(yaw), y + ahead * np.sin(yaw) + left * np.cos(yaw), yaw + turned]
    plain, moved = (
        engine("lugre", "single_track").value(
            """{
              const names = ["x", "y", "yaw_angle"], values = Float64Array.from(pose);
              const pilot = new policies.Policy(data, Float32Array.from(weights), names, values);
              pilot.follow(Float64Array.from(path.flat()), origin);
              pilot.observations(25);
              return Array.from(pilot.ahead);
            }""",
            data=data,
            weights=weights,
            path=path.tolist(),
            pose=pose,
            origin=origin,
        )
        for pose, origin in (([ahead, left, turned], [0.0, 0.0, 0.0]), (there, [x, y, yaw]))
    )
    expected = np.zeros(len(plain))
    locate(path, ahead, left, turned, 0.0, 2.5, expected)
    assert np.ptp(expected) > 1.0
    np.testing.assert_allclose(plain, expected, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(moved, expected, rtol=0.0, atol=1e-9)
