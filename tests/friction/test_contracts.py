"""Every registered law keeps every contract, with its defaults and with sets that reach its other branches."""

import numpy as np
import pytest

from steer_env import friction
from steer_env.friction import law
from steer_env.testing import CHECKS, check_plain_python
from steer_env.testing.friction_law import check_steepest_fall

SETS = {name: friction.make(name) for name in friction.available()} | {
    "viscous, none": friction.make("viscous", sigma_2=0.0),
    "dahl, stiff": friction.make("dahl", sigma_0=1e5, F_c=0.3),
    "lugre, Stribeck": friction.make("lugre", sigma_1=1.0, sigma_2=0.6, F_c=0.9, F_s=1.35, v_s=0.02),
    "lugre, undamped": friction.make("lugre", sigma_1=0.0),
    "stribeck, steep": friction.make("stribeck", F_s=1.3, v_s=0.03, sigma_2=0.1),
    "exponential_spring, stiff branch": friction.make("exponential_spring", k_m=500.0, tau_m=0.2),
    "gms, wide curve": friction.make("gms", F_s=1.6, v_s=1.0, C=200.0, sigma_2=0.1),
    "gms, slow attraction": friction.make("gms", F_s=0.95, C=5.0),
    "gms, one element": friction.make("gms", k=[100.0], alpha=[1.0], F_s=1.2, C=300.0),
    "elasto_plastic, undamped, early": friction.make("elasto_plastic", sigma_1=0.0, F_ba=0.05),
    "bouc_wen, a corner": friction.make("bouc_wen", n=8.5, beta=2.0),
    "masing, damped": friction.make("masing", sigma_1=2.0),
    "masing, one element": friction.make("masing", k=[100.0], y=[0.009], sigma_1=1.0),
    "masing, coinciding yields": friction.make("masing", k=[40.0, 0.0, 60.0, 5.0], y=[0.01, 0.02, 0.01, 0.002]),
}


@pytest.mark.parametrize("check", CHECKS, ids=lambda check: check.__name__)
@pytest.mark.parametrize("p", SETS.values(), ids=SETS)
def test_contract(p, check):
    check(p)


def test_plain_python_equals_compiled():
    check_plain_python(list(SETS.values()))


def test_a_fall_that_is_understated_is_caught(monkeypatch):
    """A Stribeck curve whose law says that its torque never falls."""
    p, lugre = SETS["lugre, Stribeck"], law.LAWS["lugre"]
    monkeypatch.setitem(law.LAWS._by_class, type(p), lugre._replace(steepest_fall=lambda p, torque_scale, h: 0.0))
    with pytest.raises(AssertionError):
        check_steepest_fall(p)


def test_the_refused_lugre_set_does_create_energy():
    """Stuck at break-away and torn off at 10 rad/s, it gives back more than the bristle held."""
    active = friction.models.lugre.LuGre(sigma_0=100.0, sigma_1=2.0, sigma_2=0.0, F_c=0.9, F_s=1.8, v_s=0.1)
    memory, w, h = np.array([1.8 / 100.0]), 10.0, 1e-3
    before = law.stored_energy(active, memory)
    torque, _ = law.mean_torque(active, 1.0, memory, w, h)
    law.advance(active, 1.0, memory, w, h)
    assert torque * w * h < law.stored_energy(active, memory) - before - 0.05
