"""Sets that create energy, by request: they are made, written and read again as any other."""

import json

import gymnasium
import pytest

import steer_env  # noqa: F401
from steer_env import friction

GIVEN = {"F_c": 0.9, "F_s": 1.8, "sigma_1": 2.0, "sigma_2": 0.3}  # passive from sigma_2 = 2 on
ACTIVE = friction.make("lugre", **GIVEN, allow_active=True)


def test_a_set_that_creates_energy_is_made_by_request_only():
    with pytest.raises(ValueError, match="allow_active=True"):
        friction.make("lugre", **GIVEN)
    assert ACTIVE.sigma_2 == 0.3


def test_the_request_lifts_no_other_check():
    with pytest.raises(ValueError, match="F_s must be at least"):
        friction.make("lugre", F_c=0.9, F_s=0.5, allow_active=True)
    with pytest.raises(ValueError, match=r"allow_active must be True or False \(1 or 0\), got 'perhaps'"):
        friction.make("lugre", **GIVEN, allow_active="perhaps")


@pytest.mark.parametrize("value", [True, 1, 1.0, "True", "true"])
def test_forms_of_the_request(value):
    assert friction.make("lugre", **GIVEN, allow_active=value) == ACTIVE
    text = ",".join(f"{key}={number}" for key, number in {**GIVEN, "allow_active": value}.items())
    assert friction.resolve(f"lugre,{text}") == ACTIVE


def test_the_mapping_comes_back_through_json():
    mapping = friction.as_mapping(ACTIVE)
    assert mapping["allow_active"] is True
    assert friction.resolve(json.loads(json.dumps(mapping))) == ACTIVE
    assert "allow_active" not in friction.as_mapping(friction.make("lugre"))


def test_an_environment_takes_it_and_its_spec_makes_it_again():
    with gymnasium.make("steer_env/AssistWeave-v3", friction=ACTIVE) as environment:
        again = gymnasium.envs.registration.EnvSpec.from_json(environment.spec.to_json())
    with gymnasium.make(again) as environment:
        assert environment.unwrapped.batch.usual_conditions.friction == ACTIVE


def test_ranges_of_its_parameters_are_drawn():
    ranges = {"friction": {"F_s": (1.2, 1.8)}}
    with gymnasium.make("steer_env/AssistWeave-v3", friction=ACTIVE, randomise=ranges) as environment:
        environment.reset(seed=3)
