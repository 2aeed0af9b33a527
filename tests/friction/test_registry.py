"""A law from one file is picked up everywhere."""

import numpy as np
import pytest

from steer_env import friction
from steer_env.testing.plain_python import trace


def test_toy_law_is_found(toy):
    assert "toy_jenkins" in friction.available()
    p = friction.make("toy_jenkins", k=50.0)
    assert p == toy.Jenkins(50.0, 0.9)
    assert friction.law_of(p).parameters is toy.Jenkins
    with pytest.raises(ValueError, match="it takes: k, F_c"):
        friction.make("toy_jenkins", sigma_0=1.0)


def test_toy_law_equals_masing_with_one_element(toy):
    """Two solvers of one law: Newton with a kink, and the exact march."""
    jenkins, masing = friction.make("toy_jenkins"), friction.make("masing", k=[100.0], y=[0.009])
    x = np.cumsum(np.random.default_rng(5).normal(0.0, 4e-3, 500))
    np.testing.assert_allclose(friction.response(jenkins, x, 1e-3), friction.response(masing, x, 1e-3), atol=1e-13)
    (rows, _), (expected, _) = trace(jenkins), trace(masing)
    np.testing.assert_allclose(rows, expected, rtol=1e-9, atol=1e-12)  # roundings carried on by 200 steps


def test_every_law_states_the_units_of_its_parameters():
    for law in friction.law.LAWS.all().values():
        if law.parameters.__module__.startswith("steer_env."):  # tests register laws of their own
            assert set(law.units) == set(law.parameters._fields), law.name
