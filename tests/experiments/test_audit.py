"""The audit: a reward that pays for the wrong thing is found out, and known cheats do not pay."""

from functools import partial

import numpy as np
import pytest

from steer_env import assists
from steer_env.experiments.learning import assist_suite, training
from steer_env.registration import DRIVEN
from tests.tools import audit
from tests.tools.audit import Behaviour, Verdict
from tests.tools.policy_search import Budget

RELEASE, WEAVE = "steer_env/AssistRelease-v4", "steer_env/AssistWeave-v3"
SMALL = Budget(rounds=1, candidates=2, best=1, episodes=1, steps=0)
# A reward that pays for the return and does not mind how: the effort counts in proportion to it.
RETURN_ALONE = {"goal": 0.0, "ripple": 0.0, "smoothness": 0.0, "effort": 1.0}
SHAKE = "shake before the release"


@pytest.fixture
def short(monkeypatch):
    """Few episodes, and one drive of the suite: weaves with LuGre."""
    monkeypatch.setattr(audit, "EPISODES", 2)
    drives = assist_suite.suite(assist_suite.task_named(WEAVE))
    monkeypatch.setattr(assist_suite, "suite", lambda *_: drives[:1])


class Louder:
    """LQG with ten times its action."""

    def __init__(self, env):
        self.lqg = assists.make("lqg", env)

    def reset(self, rows=slice(None)):
        """Forget episodes."""
        self.lqg.reset(rows)

    def act(self, observation):
        return np.clip(10.0 * self.lqg.act(observation), -1.0, 1.0)


def test_an_assist_that_scores_more_is_driven_through_the_suite(short, monkeypatch):
    conditions = 6  # six variants of the weave
    assert audit.suite(WEAVE, partial(assists.make, "lqg")) == (0, conditions)
    failed, driven = audit.suite(WEAVE, Louder)
    assert driven == conditions
    assert failed > 2
    assert audit.suite("steer_env/DriverOnCentre-v3", Louder) == (0, 0)
    monkeypatch.setattr(audit, "baselines", lambda env_id: {})
    found = {one.policy: one for one in audit.audit(RELEASE, SMALL, weights=RETURN_ALONE)}
    for one in found.values():
        assert one.driven == (conditions if one.found.reward > one.best.reward else 0)
    assert found[SHAKE].driven


def test_the_search_is_under_the_conditions_of_the_training(short, monkeypatch):
    made = []

    def behaved(env_id, make, *, remembers, **arguments):
        made.append(arguments)
        return Behaviour(0.0, 0.0, 0.0, 0.0, 0.0)

    monkeypatch.setattr(audit, "behaviour", behaved)
    audit.audit(WEAVE, SMALL)
    assert made
    assert all(each == training.conditions(WEAVE) for each in made)


def test_a_reward_that_pays_for_shaking_is_found_out(short, monkeypatch):
    monkeypatch.setattr(audit, "baselines", lambda env_id: {})  # beside zero action alone
    found = {one.policy: one for one in audit.audit(RELEASE, SMALL, weights=RETURN_ALONE)}
    assert found[SHAKE].cheats
    assert found[SHAKE].worse_in == ("ripple",)


@pytest.mark.parametrize(
    ("changes", "worse"),
    [
        ({}, ()),
        ({"failures": 0.01}, ("failures",)),
        ({"ripple": 0.11}, ("ripple",)),
        ({"ripple": 0.09}, ()),  # more than the best, but within what hands do not mind or a quarter more
        ({"aim": 1.26}, ("aim",)),
        ({"cones": 0.2}, ("cones",)),
    ],
)
def test_who_scores_more_must_not_behave_worse(changes, worse):
    best = Behaviour(reward=1.0, failures=0.0, ripple=0.08, aim=1.0, cones=0.0)
    for reward, pays in ((1.1, True), (0.9, False)):
        found = best._replace(reward=reward, **changes)
        assert audit.worse_in(found, best) == worse
        assert Verdict("id", "policy", found, best, "best", worse).cheats == (pays and bool(worse))


def test_an_action_that_changes_its_sign_at_every_step_has_its_ripple(short):
    class Chatter:
        """Changes its sign between two samples of the ripple."""

        def __init__(self, env):
            self.n, self.sign = env.num_envs, 0.2

        def reset(self, rows=None):
            """Nothing is kept."""

        def act(self, observation):
            self.sign = -self.sign
            return np.full((self.n, 1), self.sign, np.float32)

    sampled, seen = (audit.behaviour(WEAVE, Chatter, remembers=known).ripple for known in (False, True))
    assert sampled > 3.0 * seen


@pytest.mark.parametrize(
    "env_id",
    [
        pytest.param(each, marks=() if "ObstacleAvoidance" in each else pytest.mark.whole)
        for each in DRIVEN
        if audit.cheats_for(each)
    ],
)
def test_known_cheats_do_not_pay(env_id, short):
    found = audit.audit(env_id, SMALL)
    assert {one.policy for one in found} > set(audit.cheats_for(env_id))
    assert [one.policy for one in found if one.cheats] == []
