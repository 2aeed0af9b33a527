"""The start of the tuning ids breaks bands, random sets miss the ceiling, and a search that learns comes near it.

A share of a reward is 0 for the start of the context and 1 for its best known set, which
``python -m tests.tools.best_known_sets`` has found.
"""

import json
import math
from itertools import pairwise

import gymnasium as gym
import numpy as np
import pytest
from scipy import optimize

from steer_env.registration import TUNED, id_of
from steer_env.tuning import reward, start
from steer_env.tuning.parameters import FUNCTIONS
from tests.tools.best_known_sets import FILE, context

KNOWN = json.loads(FILE.read_text("utf-8"))
ON_CENTRE = [known for known in KNOWN if known["scenario"] == "TuneOnCentre"]
FEWEST = 5  # bands that a start breaks


def _cases():
    """All contexts of the id whose sets take less time, one of the other; in the whole suite all."""
    found = []
    for known in KNOWN:
        marks = () if known in ON_CENTRE or known["seed"] == 0 else pytest.mark.whole
        found.append(pytest.param(known, id=f"{known['scenario']}-{known['seed']}", marks=marks))
    return found


def _opened(known):
    """The environment in a context, the info of the start, and the function that gives the share of an action."""
    env = context(known["scenario"], known["seed"], known["drawn"])
    _, begun, _, _, info = env.step(env.baseline_action)
    return env, info, lambda action: (env.step(action)[1] - begun) / (known["reward"] - begun)


def test_every_id_has_known_sets():
    assert {id_of(known["scenario"]) for known in KNOWN} == set(TUNED)


@pytest.mark.whole
@pytest.mark.parametrize("known", _cases())
def test_a_hundred_random_sets_stay_below_95_percent(known):
    env, info, share = _opened(known)
    assert sum(value < 0.0 for value in info["reward_terms"].values()) >= FEWEST
    assert share(np.array(known["action"], np.float32)) == pytest.approx(1.0, abs=1e-3)  # regression
    assert share(env.own_action) > 0.7  # the ceiling is about the car's own set
    sets = np.random.default_rng(0).uniform(-1.0, 1.0, (100, *env.action_space.shape)).astype(np.float32)
    assert max(map(share, sets)) < 0.95


@pytest.mark.whole
@pytest.mark.parametrize("known", ON_CENTRE, ids=lambda known: str(known["seed"]))
def test_a_search_that_learns_comes_near_the_ceiling(known):
    """By a hundred sets, from the start, of which it knows nothing."""
    env, _, share = _opened(known)
    n = env.action_space.shape[0]
    found = []

    def loss(action):
        found.append(share(action.astype(np.float32)))
        return -found[-1]

    options = {"maxfev": 100, "initial_tr_radius": 0.3}
    optimize.minimize(loss, np.zeros(n), method="COBYQA", bounds=[(-1.0, 1.0)] * n, options=options)
    assert max(found) > 0.9


def test_the_way_to_the_own_set_rises():
    """No needle: of ten points on the straight line from the start to the car's own set, nearly each is better."""
    env, _, share = _opened(ON_CENTRE[0])
    line = [share((k / 10 * env.own_action).astype(np.float32)) for k in range(11)]
    assert sum(a < b for a, b in pairwise(line)) >= 8


@pytest.mark.parametrize("name", TUNED)
def test_a_start_is_off_in_every_parameter_and_keeps_a_share_of_the_margins(name):
    env = gym.make(name, randomise={"speed": (20, 40)}).unwrapped
    starts = []
    for seed in range(3):
        env.reset(seed=seed)
        *_, info = env.step(env.baseline_action)
        assert info["margins"]["phase_deg"] >= 20.0 - 1e-9
        assert info["margins"]["gain_db"] >= 4.0 - 1e-9
        offset = -env.own_action
        assert (np.abs(offset) >= start.LEAST_OFFSET_RATIO * env.detuning - 1e-6).all()
        assert (np.abs(offset) <= env.detuning).all()
        assert all(x > 0.0 for x, p in zip(offset, env.scenario.parameters) if p in FUNCTIONS)
        starts.append(offset)
    assert not np.array_equal(starts[0], starts[1])
    own = {key: values[2] for key, values in gym.make(name, detuning=0.0).unwrapped.parameters.items()}
    *_, info = env.step(env.own_action)
    assert {key: info["parameters"][key] for key in own} == pytest.approx(own, rel=1e-6, abs=1e-6)


def test_wanted_bands_are_narrow_and_inside_the_target_bands():
    env = context("TuneOnCentre", 0, False)
    *_, info = env.step(env.own_action)
    for name, term in env.wanted.items():
        (low, high), (least, most) = term.band.good, env.terms[name].band.good
        assert high - low == pytest.approx(0.1 * (most - least))
        assert low >= least - 1e-12
        assert high <= most + 1e-12
        if least < info["evaluated"][name] - 0.05 * (most - least) < info["evaluated"][name] < 0.95 * most:
            assert low <= info["evaluated"][name] <= high or math.isclose(low, info["evaluated"][name], rel_tol=1e-3)
        assert low < info["wanted"][name] < high
    whole = reward.wanted_terms(env.terms, env._drawn[1].own, 1.0)
    for name, term in whole.items():
        assert term.band.good == pytest.approx(env.terms[name].band.good)
