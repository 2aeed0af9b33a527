"""Every bad value is refused by one ValueError that names it, shows it and says what is allowed."""

import re

import numpy as np
import pytest

from steer_env import friction
from steer_env.friction import law
from steer_env.friction.models.masing import from_virgin_curve
from steer_env.friction.numerics.check import one_of

NAN = float("nan")

# law, parameters, and what the message has to contain: name, value, what is allowed
PARAMETERS = [
    ("rolling", {}, ["'rolling'", "coulomb, dahl, ", " lugre, masing, masing_position, stribeck, viscous"]),
    ("lugre", {"Fs": 1.0}, ["'Fs'", "'lugre'", "sigma_0, sigma_1, sigma_2, F_c, F_s, v_s"]),
    ("coulomb", {"F_c": 0.0}, ["F_c", "greater than 0", "got 0.0"]),
    ("coulomb", {"F_c": NAN}, ["F_c", "finite", "got nan"]),
    ("coulomb", {"F_c": "much"}, ["F_c", "a number", "'much'"]),
    ("coulomb", {"F_c": [1.0, 2.0]}, ["F_c", "a number", "[1.0, 2.0]"]),
    ("coulomb", {"F_c": 10**400}, ["F_c", "a number", "got 1000"]),
    ("viscous", {"sigma_2": -1.0}, ["sigma_2", "at least 0", "got -1.0"]),
    ("lugre", {"F_s": 0.8}, ["F_s", "at least F_c = 0.9 N m", "got 0.8"]),
    ("lugre", {"F_s": 1.8, "sigma_1": 2.0, "sigma_2": 1.9}, ["sigma_2", "at least", "= 2 N m s/rad", "got 1.9"]),
    ("stribeck", {"F_s": 0.5}, ["F_s", "at least F_c = 0.9 N m", "got 0.5"]),
    ("gms", {"F_s": 0.5}, ["F_s", "at least F_c", "got 0.5"]),
    ("gms", {"k": [1.0, -1.0], "alpha": [0.5, 0.5]}, ["k and alpha", "positive", "-1."]),
    ("gms", {"k": [1.0], "alpha": [0.5, 0.5]}, ["k and alpha", "1 to ", "got 1, 2"]),
    ("masing_position", {"elements": 2, "slope": [0.0, 1.5]}, ["slope", "within -1 and 1", "1.5"]),
    ("elasto_plastic", {"F_ba": 0.9}, ["F_ba", "below F_c = 0.9 N m", "got 0.9"]),
    ("bouc_wen", {"n": 0.5}, ["n ", "at least 1", "got 0.5"]),
    ("bouc_wen", {"beta": 0.4}, ["beta", "at least 0.5", "got 0.4"]),
    ("masing", {"elements": 33}, ["elements", "at most 32", "got 33"]),
    ("masing", {"elements": 2.5}, ["elements", "whole number from 1 to 32", "got 2.5"]),
    ("masing", {"k": [1.0], "y": [1.0], "elements": 3}, ["k and y", "F_c, x_c and elements", "not both"]),
    ("masing", {"y": [1.0]}, ["k and y", "got y alone"]),
    ("masing", {"k": [1.0, 2.0], "y": [1.0]}, ["k and y", "1 to 32", "got 2 and 1"]),
    ("masing", {"k": [], "y": []}, ["k", "at least one value", "(0,)"]),
    ("masing", {"k": [[1.0]], "y": [[1.0]]}, ["k", "one-dimensional", "(1, 1)"]),
    ("masing", {"k": [1.0, "a"], "y": [1.0, 2.0]}, ["k", "array of numbers", "'a'"]),
    ("masing", {"k": [1.0, NAN], "y": [1.0, 2.0]}, ["k", "finite", "got nan at index 1"]),
    ("masing", {"k": [1.0, -1.0], "y": [1.0, 2.0]}, ["k", "not be negative", "-1."]),
    ("masing", {"k": [0.0, 0.0], "y": [1.0, 2.0]}, ["k", "zero everywhere", "[0. 0.]"]),
    ("masing", {"k": [1.0, 1.0], "y": [0.0, 2.0]}, ["y", "positive", "[0. 2.]"]),
]


def refused(contains):
    """Context in which a ValueError with all these parts, in any order, is due."""
    return pytest.raises(ValueError, match="".join(f"(?=.*{re.escape(part)})" for part in contains))


@pytest.mark.parametrize(("name", "parameters", "contains"), PARAMETERS)
def test_parameters(name, parameters, contains):
    with refused(contains):
        friction.make(name, **parameters)


@pytest.mark.parametrize("name", friction.available())
def test_every_law_lists_its_keys(name):
    with refused([repr(name), "'no_such_key'", *type(friction.make(name))._fields[:2]]):
        friction.make(name, no_such_key=1.0)


@pytest.mark.parametrize(
    ("x", "T", "contains"),
    [
        ([1.0, 2.0], [1.0, 3.0], ["concave", "[1. 2.]"]),
        ([1.0, 2.0], [1.0, 0.5], ["concave", "below zero", "-0.5"]),
        ([0.0, 1.0], [0.0, 2.0], ["x", "positive", "[0. 1.]"]),
        ([1.0, 2.0], [1.0], ["x and T", "equal length", "2 and 1"]),
        (np.arange(1.0, 34.0), np.sqrt(np.arange(1.0, 34.0)), ["1 to 32", "33"]),
    ],
)
def test_virgin_curve(x, T, contains):
    with refused(contains):
        from_virgin_curve(x, T)


@pytest.mark.parametrize(
    ("friction_law", "x", "dt", "contains"),
    [
        ("dahl", [0.0, 0.1, NAN], 1e-3, ["x", "finite", "got nan at index 2"]),
        ("dahl", [[0.0, 0.1]], 1e-3, ["x", "one-dimensional", "(1, 2)"]),
        ("dahl", [], 1e-3, ["x", "at least one value", "(0,)"]),
        ("dahl", [0.0, 0.1], 0.0, ["dt", "greater than 0", "got 0.0"]),
        ("rust", [0.0, 0.1], 1e-3, ["'rust'", "available:"]),
        (0.9, [0.0, 0.1], 1e-3, ["0.9", "friction.make"]),
    ],
)
def test_response(friction_law, x, dt, contains):
    with refused(contains):
        friction.response(friction_law, x, dt)


def test_register():
    dahl = friction.law_of(friction.make("dahl"))
    left_out = ("name", "parameters", "mean_torque", "solve", "rest_torque")
    kernels = {field: getattr(dahl, field) for field in law.Law._fields if field not in left_out}
    with refused(["'lugre'", "already registered", "steer_env.friction.models.lugre"]):
        law.register("lugre", dahl.parameters, **kernels, mean_torque=dahl.mean_torque)
    with refused(["'rust'", "mean_torque or solve"]):
        law.register("rust", dahl.parameters, **kernels)
    with refused(["'rust'", "two classes of parameters called Dahl"]):
        law.register("rust", dahl.parameters, **kernels, mean_torque=dahl.mean_torque)
    with refused(["'rust'", "cut_back", "in advance"]):
        law.register("rust", dahl.parameters, **kernels, mean_torque=dahl.mean_torque, cut_back=dahl.advance)
    del kernels["stored_energy"]
    with refused(["'rust'", "all or none", "stored_energy"]):
        law.register("rust", dahl.parameters, **kernels, mean_torque=dahl.mean_torque)
    assert "rust" not in friction.available()


def test_parameters_are_immutable():
    p = friction.make("masing")
    with pytest.raises(AttributeError):
        p.sigma_1 = 1.0
    with pytest.raises(ValueError, match="read-only"):
        p.k[0] = 1.0
    k = np.ones(2)
    friction.make("masing", k=k, y=[1.0, 2.0])
    k[0] = 5.0  # the caller's array stays his own


def test_one_of():
    """The helper of every choice; also of values that no mapping can hold."""
    assert one_of("form", "c", {"text": 1, "c": 2}) == "c"
    for value in ("d", None, ["c"]):
        with pytest.raises(ValueError, match=re.escape(f"form must be one of text, c, got {value!r}")):
            one_of("form", value, {"text": 1, "c": 2})
    with pytest.raises(ValueError, match="fmi must be one of 2, 3, got 4"):
        one_of("fmi", 4, (2, 3))
