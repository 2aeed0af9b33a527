"""Observations over their usual sizes: the same environment on another scale."""

import gymnasium as gym
import numpy as np
import pytest

from steer_env.registration import DRIVEN
from tests.steer_env.test_state import equal, go_on

LANE = "steer_env/DriverLaneKeeping-v3"
EVERYTHING = {"load": (0, 300), "sensor_noise": (0.5, 1), "delay": (0, 0.05)}


@pytest.mark.parametrize("name", DRIVEN)
def test_only_the_observations_differ_and_by_their_scale(name):
    """With noise and delay, single and vector, to the bit of float32."""
    arguments = {"randomise": EVERYTHING, "control_dt": 0.02}
    plain, scaled = gym.make(name, **arguments, normalise=False), gym.make(name, **arguments)
    vector = gym.make_vec(name, num_envs=2, **arguments)
    scale = scaled.unwrapped.observation_scale
    assert np.array_equal(plain.unwrapped.observation_scale, np.ones(scale.size))
    assert np.array_equal(vector.unwrapped.observation_scale, scale)
    assert scale.tolist() == [quantity.usual for quantity in scaled.unwrapped.batch.observed]
    for space in (scaled.observation_space, vector.single_observation_space):
        assert space.high * scale == pytest.approx(plain.observation_space.high, rel=1e-6)
    one, two, both = (env.reset(seed=2)[0] for env in (plain, scaled, vector))
    rng = np.random.default_rng(0)
    for _ in range(40):
        assert two * scale == pytest.approx(one, rel=1e-6)
        assert np.array_equal(both[0], two)
        assert scaled.observation_space.contains(two)
        action = rng.uniform(-0.1, 0.1, 1).astype(np.float32)
        one, *rest = plain.step(action)
        two, *others = scaled.step(action)
        both, *_ = vector.step(np.stack([action, action]))
        assert equal(tuple(rest), tuple(others))


def test_a_clipped_observation_lies_within_the_bounds():
    env = gym.make(LANE, normalise=True).unwrapped
    env.reset(seed=0)
    for value in (1e9, -1e9):
        env.batch.arrays.noise[:] = value
        observation, *_ = env.step(np.zeros(1, np.float32))
        assert env.observation_space.contains(observation)
        assert np.array_equal(np.abs(observation), env.observation_space.high)


@pytest.mark.parametrize("vector", [False, True])
def test_a_state_goes_from_one_scale_to_the_other(vector):
    """The later observations are those of the environment that takes it; the present ones too."""

    def made(**scale):
        if vector:
            return gym.make_vec(LANE, num_envs=2, randomise=EVERYTHING, **scale)
        return gym.make(LANE, randomise=EVERYTHING, **scale).unwrapped

    plain, scaled = made(normalise=False), made()
    plain.reset(seed=3)
    go_on(plain, 10)
    scaled.set_state(plain.get_state())
    scale = scaled.observation_scale
    now = plain.get_state().observations
    assert scaled.get_state().observations * scale == pytest.approx(now, rel=1e-6)
    for one, two in zip(go_on(plain, 10), go_on(scaled, 10)):
        assert two[0] * scale == pytest.approx(one[0], rel=1e-6)
        assert equal(one[1], two[1])


@pytest.mark.parametrize("value", [1, "yes", None, 0.5])
def test_other_than_true_or_false_is_refused(value):
    for make in (gym.make, gym.make_vec):
        with pytest.raises(ValueError, match=f"normalise must be True or False, got {value!r}"):
            make(LANE, normalise=value)
