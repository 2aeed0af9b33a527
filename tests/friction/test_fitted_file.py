"""``friction="fitted.json"``: a file stands wherever a law does, and nothing that is made with it needs it later."""

import json

import gymnasium as gym
import pytest
from gymnasium.envs.registration import EnvSpec

import steer_env.environments  # noqa: F401
from steer_env import friction
from steer_env.experiments.pages.options import Friction
from steer_env.friction.law import parts
from tests.friction.test_bad_input import refused

LAW = {"law": "masing", "k": [40.0, 60.0], "y": [0.004, 0.012], "sigma_1": 0.5}


@pytest.fixture
def fitted(tmp_path):
    path = tmp_path / "fitted.json"
    path.write_text(json.dumps({"friction": LAW, "units": {"displacement": "rad", "torque": "N m"}, "level": None}))
    return path


def test_a_file_is_the_law_that_it_holds(fitted):
    expected = friction.as_mapping(friction.resolve(LAW))
    for form in (fitted, str(fitted)):
        assert friction.as_mapping(friction.resolve(form)) == expected
        assert parts(form) == parts(LAW)
    fitted.write_text(json.dumps(LAW))  # the mapping alone
    assert friction.as_mapping(friction.resolve(fitted)) == expected


def test_a_file_may_hold_sites(fitted):
    sites = {"upper_column": {"law": "coulomb", "F_c": 0.1}, "gear": LAW | {"driving": 0.1, "load": 2e-4}}
    fitted.write_text(json.dumps({"friction": sites}))
    option = Friction(str(fitted))
    for form in (fitted, str(fitted), option.text):
        assert friction.as_mapping(friction.resolve(form)) == friction.as_mapping(friction.resolve(sites))
    assert friction.varied(fitted, {"upper_column.F_c": 0.2}).upper_column.law.F_c == 0.2
    with refused(["fitted.json holds friction at upper_column, gear, where one law is needed"]):
        parts(fitted)
    fitted.write_text(json.dumps({"friction": {"wheel": LAW}}))
    with refused(["fitted.json: a site of friction must be", "'wheel'"]):
        friction.resolve(fitted)
    fitted.write_text(json.dumps({"friction": sites, "units": 3}))
    with pytest.raises(ValueError, match="units must be a mapping") as refusal:
        friction.resolve(fitted)
    assert str(refusal.value).count("fitted.json") == 1


def test_an_environment_does_not_need_the_file_any_more(fitted):
    text = gym.make("steer_env/AssistWeave-v3", friction=str(fitted)).spec.to_json()
    fitted.unlink()
    again = EnvSpec.from_json(text).kwargs["friction"]
    assert again == friction.as_mapping(friction.resolve(LAW))


def test_the_text_of_an_option_needs_the_file_no_longer(fitted):
    option = Friction(str(fitted))
    assert option.label == "fitted.json"
    assert friction.as_mapping(Friction(option.text).parameters) == friction.as_mapping(option.parameters)


def test_a_level_is_of_the_car(fitted):
    level = {"load": 2e-4, "asymmetry": 0.0}
    fitted.write_text(json.dumps({"friction": LAW, "level": level}))
    with pytest.warns(UserWarning, match=r"fitted\.json: the level .*load 0\.0002\).*steering\.friction_load"):
        friction.resolve(str(fitted))


def test_a_level_over_the_position_names_the_keys_of_the_car(fitted):
    level = {"load": 0.0, "position": 0.1, "order": 2.0, "peak": 0.3}
    fitted.write_text(json.dumps({"friction": LAW, "level": level}))
    with pytest.warns(UserWarning, match=r"position 0\.1, order 2, peak 0\.3\).*steering\.friction_order"):
        friction.resolve(fitted)
    fitted.write_text(json.dumps({"friction": LAW, "level": level | {"position": 0.0}}))
    friction.resolve(fitted)  # nothing is left; a warning would fail


def test_a_level_that_the_record_did_not_determine_is_told(fitted):
    law = {"law": "lugre", "sigma_1": 0.0, "F_c": 0.6, "F_s": 0.6}
    fitted.write_text(json.dumps({"friction": law, "undetermined": ["F_s", "v_s"]}))
    friction.resolve(fitted)  # without a Stribeck effect; a warning would fail
    for undetermined, told in ((["F_c", "F_s"], "F_c 0.6 N m, F_s 5.6 N m"), (["F_s"], "F_s 5.6 N m")):
        fitted.write_text(json.dumps({"friction": law | {"F_s": 5.6}, "undetermined": undetermined}))
        with pytest.warns(UserWarning, match=rf"fitted\.json: the record does not determine the level .*\({told}\)"):
            friction.resolve(fitted)


BAD = [
    (None, ["fitted.json", "No such file", "fit-friction"]),
    ("{", ["fitted.json", "line 1"]),
    ("[" * 100_000, ["fitted.json", "nested too deeply"]),
    ('{"friction": {"law": "coulomb", "F_c": -1.0}}', ["fitted.json", "F_c", "-1.0"]),
    ('{"friction": {"law": "coulomb"}, "undetermined": "F_c"}', ["fitted.json", "undetermined must be a list"]),
    ("[1]", ["fitted.json", "holds no friction law"]),
    ('{"best": "lugre"}', ["fitted.json", "holds no friction law", '"law": "lugre"']),
    ('{"friction": {"law": "lugre", "Fc": 1.0}}', ["'lugre'", "'Fc'"]),
    (
        '{"friction": {"law": "coulomb", "F_c": 2.0}, "units": {"displacement": "m", "torque": "N"}}',
        ["fitted.json", "in m and N", "--lever", "--to-column"],
    ),
    ('{"law": "coulomb", "units": ["m"]}', ["fitted.json", "units must be a mapping", "['m']"]),
    ('{"friction": {"law": "coulomb"}, "level": [1]}', ["fitted.json", "level must be a mapping", "[1]"]),
    ('{"friction": {"law": "coulomb"}, "level": {"load": "a"}}', ["level.load of", "fitted.json", "'a'"]),
]


@pytest.mark.parametrize(("text", "contains"), BAD, ids=lambda each: str(each)[:30])
def test_a_file_without_a_law_of_a_column_is_refused(fitted, text, contains):
    fitted.unlink() if text is None else fitted.write_text(text)
    with refused(contains):
        friction.resolve(str(fitted))


def test_a_law_of_a_users_module_needs_its_import(fitted):
    fitted.write_text(json.dumps({"friction": {"law": "mine", "F_c": 1.0}}))
    with refused(["fitted.json", "'mine'", "--import MODULE", "lugre"]):
        friction.resolve(str(fitted))
