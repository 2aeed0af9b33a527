"""Infos: the same keys and types at reset, at every step and at the end, single and vector."""

import copy
import math
import pickle

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import data_equivalence
from gymnasium.vector import AutoresetMode

from steer_env.engine.infos import LEVELS, row
from steer_env.episode import randomise
from steer_env.registration import DRIVEN
from tests.steer_env.test_state import equal

IDS = tuple(DRIVEN)
LANE, WEAVE = "steer_env/DriverLaneKeeping-v3", "steer_env/AssistWeave-v3"
RANDOM = {"load": (0, 300), "friction_level": (0.5, 1.5), "friction": {"F_c": (0.5, 1.5)}}
DICTS = ("reward_terms", "cost_terms", "conditions", "metrics")


def structure(info):
    """Keys in their order, with types."""
    return [(key, structure(value) if isinstance(value, dict) else type(value)) for key, value in info.items()]


@pytest.mark.parametrize("name", IDS)
def test_keys_and_types_are_the_same_at_reset_step_and_end(name):
    env = gym.make(name, randomise=RANDOM)
    _, info = env.reset(seed=0)
    expected, task = structure(info), env.unwrapped.task
    for key, value in info.items():
        assert type(value) is (dict if key in DICTS else int if key == "failure" else float), key
    assert all(type(value) is float for key in DICTS for value in info[key].values())
    assert tuple(info["reward_terms"]) == tuple(term.name for term in task.rewards)
    assert tuple(info["cost_terms"]) == tuple(cost.name for cost in task.costs)
    assert tuple(info["metrics"]) == tuple(metric.name for metric in task.metrics)
    scenario = ["scenario"] if env.unwrapped.task.draw_scenario else []
    assert tuple(info["conditions"]) == (*randomise.RANGES, "friction_F_c", *scenario)
    assert info["cost"] == info["failure"] == 0
    assert not any(info["reward_terms"].values())
    assert not any(info["cost_terms"].values())
    assert not any(info["metrics"].values())
    assert data_equivalence(info, env.reset(seed=0)[1])
    over = False
    while not over:
        *_, terminated, truncated, info = env.step(np.array([0.4], np.float32))
        assert structure(info) == expected
        assert all(map(math.isfinite, info["metrics"].values()))
        over = terminated or truncated
    assert structure(env.reset()[1]) == expected


def at_level(info, level):
    """What a level leaves of a full info."""
    kept = {"full": info.keys(), "metrics": {"metrics", "_metrics"}, "none": set()}[level]
    return {key: value for key, value in info.items() if key in kept}


@pytest.mark.parametrize("level", LEVELS[1:])
@pytest.mark.parametrize("name", [LANE, WEAVE])
def test_a_level_leaves_out_infos_and_changes_nothing_else(name, level):
    """At reset, at every step, at the end and at the reset after it."""
    arguments = {"randomise": RANDOM, "control_dt": 0.1}
    full, env = gym.make(name, **arguments), gym.make(name, **arguments, info_level=level)
    assert env.unwrapped.info_level == level
    for seed in (0, None):
        one, two = full.reset(seed=seed), env.reset(seed=seed)
        over = False
        while not over:
            assert equal(one[:-1], two[:-1])
            assert equal(two[-1], at_level(one[-1], level))
            one, two = full.step(np.ones(1, np.float32)), env.step(np.ones(1, np.float32))
            over = one[2] or one[3]
        assert equal(two[-1], at_level(one[-1], level))
    assert env.unwrapped.failure_text() == full.unwrapped.failure_text()


@pytest.mark.parametrize("level", LEVELS[1:])
@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_a_level_leaves_out_vector_infos(mode, level):
    arguments = {"num_envs": 3, "randomise": RANDOM, "control_dt": 0.1, "autoreset_mode": mode}
    full, vector = gym.make_vec(LANE, **arguments), gym.make_vec(LANE, **arguments, info_level=level)
    actions, ends = np.array([[1.0], [0.7], [0.0]], np.float32), 0
    assert equal(vector.reset(seed=2)[1], at_level(full.reset(seed=2)[1], level))
    for _ in range(60):
        one, two = full.step(actions), vector.step(actions)
        assert equal(one[:4], two[:4])
        left, over = at_level(one[4], level), one[2] | one[3]
        if over.any() and mode == AutoresetMode.SAME_STEP:
            told = {key: one[4][key] for key in ("final_obs", "_final_obs", "final_info", "_final_info")}
            left |= told | {"final_info": at_level(told["final_info"], level)}
        assert two[4].keys() == left.keys()
        assert equal(two[4], left)
        ends += int(over.sum())
        if over.any() and mode == AutoresetMode.DISABLED:
            chosen = {"reset_mask": over}
            assert equal(vector.reset(options=chosen)[1], at_level(full.reset(options=chosen)[1], level))
    assert ends > 3


def test_an_unknown_level_is_refused_with_the_known():
    for make in (gym.make, gym.make_vec):
        for level in ("all", None, True):
            with pytest.raises(ValueError, match=rf"info_level must be one of full, metrics, none, got {level!r}"):
                make(WEAVE, info_level=level)


def test_infos_are_the_callers_own():
    env = gym.make(LANE)
    _, info = env.reset(seed=0)
    for key in DICTS:
        info[key].clear()
    *_, info = env.step(np.zeros(1, np.float32))
    assert all(info[key] for key in DICTS)
    vector = gym.make_vec(LANE, num_envs=2)
    _, info = vector.reset(seed=0)
    kept = {key: value.copy() for key, value in info["conditions"].items()}
    for key in ("lateral_offset", "conditions"):
        assert key not in info or info[key] is not vector.step(np.zeros((2, 1), np.float32))[4][key]
    assert equal(info["conditions"], kept)


def vector_info():
    vector = gym.make_vec(WEAVE, num_envs=2)
    vector.reset(seed=0)
    return vector.step(np.full((2, 1), 0.1, np.float32))[4]


WHOLE_INFO = [
    ("iterated", lambda info: dict(zip(info, info.values()))),
    ("unpacked", lambda info: {**info}),
    ("merged", lambda info: {} | info),
    ("copied", copy.copy),
    ("pickled", lambda info: pickle.loads(pickle.dumps(info))),
    ("in order after a look at one", lambda info: [info["cost"], dict(info)][1]),
]


@pytest.mark.parametrize("read", [read for _, read in WHOLE_INFO], ids=[name for name, _ in WHOLE_INFO])
def test_vector_infos_are_whole_however_they_are_read(read):
    expected, found = dict(vector_info().items()), read(vector_info())
    assert type(found) is dict
    assert list(found) == list(expected)
    assert equal(found, expected)


def test_a_vector_info_changes_like_any_dict():
    info = vector_info()
    info["own"] = 1
    info["cost"] = None
    del info["failure"]
    assert "failure" not in info
    assert info.get("failure", 7) == 7
    assert info.pop("_cost").all()
    assert (info["cost"], list(info)[-1]) == (None, "own")
    with pytest.raises(KeyError, match="none"):
        info["none"]


def test_conditions_tell_what_was_drawn_and_set():
    env = gym.make(LANE, randomise=RANDOM, friction="masing").unwrapped
    _, info = env.reset(seed=4, options={"speed": 25.0})
    told, drawn = info["conditions"], env.batch.conditions[0]
    assert 0.5 <= told["friction_F_c"] <= 1.5  # of a law that keeps no parameter of this name
    assert drawn.friction.k @ drawn.friction.y == pytest.approx(told["friction_F_c"])
    assert told["speed"] == 25.0
    assert told["load"] == drawn.load > 0.0
    assert told["delay"] == told["sensor_noise"] == 0.0
    other = gym.make(LANE, friction="masing").unwrapped
    other.set_state(env.get_state())
    *_, info = other.step(np.zeros(1, np.float32))
    assert info["conditions"] == {key: value for key, value in told.items() if key != "friction_F_c"}
    third = gym.make(LANE, friction="masing", randomise=RANDOM).unwrapped
    third.reset(seed=0)
    third.set_state(other.get_state())  # of an environment that draws no parameters
    *_, info = third.step(np.zeros(1, np.float32))
    assert info["conditions"]["load"] == drawn.load
    third.set_state(env.get_state())
    assert third.step(np.zeros(1, np.float32))[4]["conditions"] == told


def test_metrics_so_far_are_those_of_the_recorded_channels():
    env = gym.make(WEAVE)
    env.reset(seed=0)
    torque, speed = [], []
    for k in range(1, 301):
        *_, info = env.step(np.zeros(1, np.float32))
        torque.append(info["handwheel_torque"])
        speed.append(info["handwheel_speed"])
        if k % 100 == 0:
            metrics, work = info["metrics"], 0.01 * np.abs(np.multiply(torque, speed)).sum()
            assert metrics["rms_hand_torque"] == pytest.approx(np.sqrt(np.mean(np.square(torque))), rel=1e-9)
            assert metrics["steering_work"] == pytest.approx(work, rel=1e-9)


def test_a_time_limit_of_the_user_comes_with_metrics():
    """In ``make`` and ``make_vec`` of every kind, and it stays out of the specification otherwise."""
    assert gym.spec(LANE).max_episode_steps is None
    single = gym.make(LANE, max_episode_steps=30)
    vectors = [gym.make_vec(LANE, num_envs=2, max_episode_steps=30, vectorization_mode=m) for m in (None, "sync")]
    infos = [single.reset(seed=5), *(vector.reset(seed=5) for vector in vectors)]
    for k in range(1, 31):
        *_, terminated, truncated, info = single.step(np.zeros(1, np.float32))
        assert (terminated, truncated) == (False, k == 30)
        for vector in vectors:
            *_, ended, cut, infos = vector.step(np.zeros((2, 1), np.float32))
            assert not ended.any()
            assert (cut == (k == 30)).all()
            assert equal(row(infos, 0), info)
    assert all(map(math.isfinite, info["metrics"].values()))
    again = gym.make_vec(single.spec, num_envs=1)
    again.reset(seed=5)
    for k in range(1, 31):
        assert again.step(np.zeros((1, 1), np.float32))[3][0] == (k == 30)
    vectors[0].step(np.zeros((2, 1), np.float32))  # resets
    for k in range(1, 31):
        assert vectors[0].step(np.zeros((2, 1), np.float32))[3].all() == (k == 30)
    spec = vectors[0].spec
    assert spec.kwargs["max_episode_steps"] == 30
    endless = gym.make_vec(WEAVE, num_envs=1, max_episode_steps=-1, control_dt=0.1)
    endless.reset(seed=0)
    cuts = [endless.step(np.zeros((1, 1), np.float32))[3][0] for _ in range(200)]
    assert cuts.index(True) == 199
    with pytest.raises(TypeError, match="unexpected keyword argument 'max_episode_steps'"):
        type(single.unwrapped)(max_episode_steps=30)


@pytest.mark.parametrize(
    ("mode", "way"),
    [(AutoresetMode.NEXT_STEP, "async"), (AutoresetMode.SAME_STEP, "sync"), (AutoresetMode.DISABLED, "sync")],
)
def test_vector_infos_are_those_of_gymnasiums_own_vector_environment(mode, way):
    """Every key, dtype, mask, and value that a mask marks, through the ends of episodes at different times."""
    arguments = {"num_envs": 3, "randomise": RANDOM, "control_dt": 0.1}
    ours = gym.make_vec(LANE, **arguments, autoreset_mode=mode)
    theirs = gym.make_vec(LANE, **arguments, vectorization_mode=way, vector_kwargs={"autoreset_mode": mode})
    actions, ends = np.array([[1.0], [0.7], [0.0]], np.float32), 0

    def compare(one, other, marked=True):
        assert one.keys() == other.keys()
        for key in one:
            if key[0] == "_":
                assert np.array_equal(one[key], other[key]), key
            elif isinstance(one[key], dict):
                compare(one[key], other[key], one[f"_{key}"])
            else:
                mask = one[f"_{key}"]
                assert one[key].dtype == other[key].dtype, key
                assert equal(tuple(one[key][mask]), tuple(other[key][mask])), key

    compare(ours.reset(seed=2)[1], theirs.reset(seed=2)[1])
    for _ in range(60):
        one, other = ours.step(actions), theirs.step(actions)
        assert equal(one[:4], other[:4])
        compare(one[4], other[4])
        over = one[2] | one[3]
        ends += int(over.sum())
        if over.any() and mode == AutoresetMode.DISABLED:
            chosen = {"reset_mask": over}
            compare(ours.reset(options=chosen)[1], theirs.reset(options=dict(chosen))[1])
    theirs.close()
    assert ends > 3


def test_failures_of_a_vector_environment_are_told_in_words():
    vector = gym.make_vec(LANE, num_envs=2)
    vector.reset(seed=0)
    vector.batch.arrays.states[1, 0] = math.nan
    *_, terminated, _, info = vector.step(np.zeros((2, 1), np.float32))
    assert list(terminated) == [False, True]
    assert list(info["failure"]) == [0, 4]
    assert vector.failure_text(4).startswith("a state is not finite: handwheel_angle")
