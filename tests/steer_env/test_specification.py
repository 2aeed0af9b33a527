"""Arguments in forms that JSON holds, and environments that are made again from their specification."""

import json
import pickle

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec

from steer_env import drivers, friction
from steer_env.registration import REGISTERED
from steer_env.vehicle import cars, road
from steer_env.vehicle import tyre as tyres

KEEPING, LANE_CHANGE = "steer_env/DriverLaneKeeping-v3", "steer_env/AssistLaneChange-v3"
CAR = {"base": "compact", "chassis": {"mass": 1400.0, "sprung_mass": 1268.6}}
BUMP = {"road": "bump", "height": 0.02, "length": 1.0, "at": 10.0, "side": "left"}

# One form of each argument, all that an environment takes.
FORMS = {
    "text with a list": (KEEPING, {"friction": "masing,k=30:20,y=0.002:0.01"}),
    "mapping of a law": (KEEPING, {"friction": {"law": "lugre", "F_c": 1.2}}),
    "mapping with arrays": (KEEPING, {"friction": {"law": "masing", "k": np.array([30.0, 20.0]), "y": (0.002, 0.01)}}),
    "uneven parameters": (KEEPING, {"friction": friction.make("lugre", F_c=1.0 / 3.0, sigma_0=np.pi * 30.0)}),
    "drawn parameters": (
        KEEPING,
        {
            "friction": friction.make("masing", sigma_1=0.1, elements=3),
            "randomise": {"load": (0, np.int64(300)), "friction": {"sigma_1": (0.0, 0.2)}},
        },
    ),
    "drawn beside text": (KEEPING, {"friction": "lugre,sigma_0=70", "randomise": {"friction": {"F_c": (0.6, 1.2)}}}),
    "mapping of a road": (KEEPING, {"chassis": "two_track", "road": BUMP}),
    "road": (KEEPING, {"chassis": "two_track", "road": road.iso8608(1, "B", length=300.0, friction=(0.3, 1.0))}),
    "banked road": (KEEPING, {"chassis": "two_track", "road": road.make_road(bank=0.02, grade=-0.01)}),
    "mapping of a driver": (LANE_CHANGE, {"driver": {"driver": "preview", "effort": 0.3, "co_contraction": 0.25}}),
    "driver with options": (LANE_CHANGE, {"driver": drivers.make("two_point", near=9.1, co_contraction=0.9)}),
    "driver with arms": (LANE_CHANGE, {"driver": drivers.make("preview")._replace(arm=drivers.arm(0.7, inertia=0.11))}),
    "mapping of a car": (KEEPING, {"vehicle": CAR}),
    "numbers of numpy": (KEEPING, {"speed": np.float32(25.0), "weights": {"effort": np.float64(2.0)}}),
    "truth value of numpy": (KEEPING, {"normalise": np.True_}),
}


def rollout(env, steps=30):
    """Observations and rewards from a seed under fixed actions, single or vector."""
    rng = np.random.default_rng(1)
    seen = [env.reset(seed=5)[0].ravel()]
    for _ in range(steps):
        observation, reward, *_ = env.step(rng.uniform(-0.2, 0.2, env.action_space.shape).astype(np.float32))
        seen += [observation.ravel(), np.ravel(reward)]
    env.close()
    return np.concatenate(seen)


@pytest.mark.parametrize("form", FORMS)
def test_an_environment_is_the_same_to_the_bit_after_its_specification_was_json(form):
    name, arguments = FORMS[form]
    env = gym.make(name, **arguments)
    text = env.spec.to_json()
    expected = rollout(env)
    assert np.array_equal(rollout(gym.make(EnvSpec.from_json(text))), expected)
    assert np.array_equal(rollout(env.spec.make()), expected)
    assert gym.make(EnvSpec.from_json(text)).spec.to_json() == text  # nothing changes any more
    vector = gym.make_vec(name, num_envs=2, **arguments)
    both = rollout(vector)
    assert np.array_equal(rollout(gym.make_vec(EnvSpec.from_json(text), num_envs=2)), both)
    assert np.array_equal(rollout(gym.make_vec(EnvSpec.from_json(vector.spec.to_json()))), both)


def test_the_specification_keeps_what_json_can_hold_and_says_the_rest_in_its_terms():
    kept = {"friction": "masing,elements=20", "vehicle": CAR, "driver": {"driver": "preview", "effort": 0.3}}
    assert gym.make(LANE_CHANGE, **kept).spec.kwargs == kept
    given = {"friction": friction.make("coulomb", F_c=0.5), "driver": drivers.make("free")}
    assert gym.make(LANE_CHANGE, **given).spec.kwargs == {
        "friction": {"law": "coulomb", "F_c": 0.5},
        "driver": {
            "driver": "free",
            "arm": {"inertia": 0.0, "damping": 0.0, "stiffness": 0.0, "reflex": 0.0},
            "informed": False,
        },
    }
    assert given == {"friction": friction.make("coulomb", F_c=0.5), "driver": drivers.make("free")}  # the user's own
    env = gym.make(KEEPING, chassis="two_track", road=road.flat())
    level = {"heights": [[0.0], [0.0]], "friction": [[1.0], [1.0]], "spacing": 0.05, "grade": 0.0, "bank": 0.0}
    assert env.spec.kwargs == {"chassis": "two_track", "road": {"road": "make_road", **level}}


def test_files_are_named_by_their_paths(tmp_path):
    (tmp_path / "own.json").write_text(json.dumps(CAR), encoding="utf-8")
    tyres.save(tyres.load(), tmp_path / "own.tir")
    env = gym.make(KEEPING, vehicle=tmp_path / "own.json", tyre=tmp_path / "own.tir")
    assert np.array_equal(rollout(gym.make(EnvSpec.from_json(env.spec.to_json()))), rollout(env))
    assert env.spec.kwargs == {"vehicle": str(tmp_path / "own.json"), "tyre": str(tmp_path / "own.tir")}


def test_a_vector_environment_keeps_its_reset_mode():
    vector = gym.make_vec(KEEPING, num_envs=2, autoreset_mode=gym.vector.AutoresetMode.SAME_STEP)
    again = gym.make_vec(EnvSpec.from_json(vector.spec.to_json()))
    assert (again.num_envs, again.autoreset_mode) == (2, gym.vector.AutoresetMode.SAME_STEP)


def test_a_tuning_environment_is_made_again():
    arguments = {"friction": friction.make("masing", elements=4), "vehicle": CAR}
    env = gym.make("steer_env/TuneOnCentre-v3", **arguments)
    again = gym.make(EnvSpec.from_json(env.spec.to_json()))
    assert again.spec.kwargs["friction"]["law"] == "masing"
    assert np.array_equal(again.reset(seed=1)[0], env.reset(seed=1)[0])


def test_a_specification_of_an_environment_without_make_is_none():
    env = type(gym.make(KEEPING).unwrapped)()
    assert env.spec is None
    env.spec = pickle.loads(pickle.dumps(gym.make(KEEPING, friction="dahl").spec))
    assert env.spec.kwargs == {"friction": "dahl"}


def test_a_mapping_as_json_holds_every_law_and_driver_to_the_bit():
    for package in (friction, drivers):
        for name in package.available():
            made = package.make(name)
            assert repr(package.resolve(json.loads(json.dumps(package.as_mapping(made))))) == repr(made)


def test_what_is_drawn_of_a_law_leaves_the_rest_as_given():
    elements = friction.make("masing", elements=3, F_c=1.1)
    for form in (elements, friction.as_mapping(elements), "masing,elements=3,F_c=1.1"):
        env = gym.make(KEEPING, friction=form, randomise={"friction": {"sigma_1": (0.1, 0.2)}})
        told = env.reset(seed=0)[1]["conditions"]
        drawn = env.unwrapped.batch.conditions[0].friction
        assert told["friction_sigma_1"] == drawn.sigma_1
        assert 0.1 < drawn.sigma_1 < 0.2
        assert np.array_equal(drawn.k, elements.k)
        assert np.array_equal(drawn.y, elements.y)
    with pytest.raises(ValueError, match="give either k and y, or F_c, x_c and elements, not both"):
        gym.make(KEEPING, friction=elements, randomise={"friction": {"F_c": (1.0, 1.2)}})


def test_a_car_of_a_mapping_is_that_of_a_file(tmp_path):
    (tmp_path / "own.json").write_text(json.dumps(CAR), encoding="utf-8")
    given = json.loads(json.dumps(CAR))
    assert cars.load(given).chassis == cars.load(tmp_path / "own.json").chassis
    assert given == CAR  # unchanged
    assert cars.every_key(CAR)["chassis"]["mass"] == 1400.0
    assert cars.load(cars.every_key(CAR)).chassis == cars.load(CAR).chassis


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"friction": "lugre,F_c"}, r"expected LAW\[,key=value\.\.\.\].*got 'lugre,F_c'"),
        ({"friction": "lugre,F_c=1,F_c=2"}, "each key once"),
        ({"friction": "lugre,F_x=1"}, "'lugre' has no parameter 'F_x'; it takes: sigma_0"),
        ({"friction": "lugre,F_c=much"}, "F_c must be a number, got 'much'"),
        ({"friction": {"F_c": 1.2}}, r"^\{'F_c': 1\.2\} is not a set .*a mapping as \{'law': 'lugre', 'F_c': 1\.2\}"),
        ({"friction": {"law": "glue"}}, "unknown friction law 'glue'; available: bouc_wen, coulomb"),
        ({"friction": {"law": "lugre", "name": 3}}, "'lugre' has no parameter 'name'; it takes: sigma_0"),
        ({"friction": {"law": "lugre", "F_c": -1}}, "F_c must be .*got -1"),
        ({"friction": ["lugre"]}, r"\['lugre'\] is not a set of friction parameters; .*'masing,elements=20'"),
        ({"road": "iso8608"}, r"road must be .*\{'road': 'iso8608', 'seed': 1\}.*got 'iso8608'"),
        ({"road": {"seed": 1}}, r"make_road, flat, bump, iso8608, .*got \{'seed': 1\}"),
        ({"road": {"road": "flat", "seed": 1}}, r"road 'flat' has no parameter 'seed'; it takes none"),
        ({"road": {"road": "bump", "height": 1}}, "road 'bump' lacks 'length'; it takes: height, length"),
        ({"road": {"road": "iso8608", "seed": "x"}}, "seed must be .*got 'x'"),
        ({"road": {"road": "iso8608", "seed": 1, "road_class": "Z"}}, "road_class must be one of A.*got 'Z'"),
        ({"driver": {"effort": 1}}, r"driver must be one of .*\{'driver': 'preview', 'effort': 0\.03\}.*got"),
        ({"driver": {"driver": "nobody"}}, "unknown driver 'nobody'; available: free"),
        ({"driver": {"driver": "robot", "near": 1}}, "driver 'robot' has no parameter 'near'; it takes: effort"),
        ({"driver": {"driver": "robot", "arm": {"mass": 1}}}, "arm has no parameter 'mass'; it takes: inertia"),
        ({"driver": {"driver": "robot", "arm": 3}}, "arm must map inertia, damping, stiffness, reflex .*got 3"),
        (
            {"driver": {"driver": "free", "arm": {"inertia": 0, "damping": -1, "stiffness": 0, "reflex": 0}}},
            r"arm\.damping must be .*at least 0, got -1",
        ),
        ({"vehicle": {"base": "tank"}}, "base must be one of .*, got 'tank'"),
        ({"vehicle": {"chassis": {}}}, "car lacks name, .*base: "),
        ({"vehicle": {"base": "compact", "chassis": {"mas": 1}}}, "chassis has no key 'mas'"),
        ({"vehicle": 3}, "vehicle must be a name, a path, a Car or a mapping as a car file, got a int"),
    ],
)
def test_bad_forms(arguments, message):
    with pytest.raises(ValueError, match=message):
        gym.make(LANE_CHANGE, chassis="two_track", **arguments)


@pytest.mark.parametrize("name", REGISTERED)
def test_unknown_keywords_are_refused_in_the_words_of_python(name):
    """TorchRL looks for them: it tries ``frameskip`` first, and repeats the action itself if it is refused."""
    with pytest.raises(
        TypeError, match=r"\w+\.__init__\(\) got an unexpected keyword argument 'frameskip'; .*friction"
    ):
        gym.make(name, frameskip=1)
