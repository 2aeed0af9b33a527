"""What tells elasto-plastic friction from a bristle that creeps, and Bouc-Wen's shape from Dahl's."""

import math

import numpy as np
import pytest

from steer_env import friction
from steer_env.friction import law
from steer_env.friction.models.bouc_wen import BoucWen
from steer_env.testing.histories import at_rest


def drift(p, f_1, f_2, steps=2000):
    """Displacement over the third cycle of a torque between two shares of F_c, by the step equation without inertia."""
    cycle = np.r_[np.linspace(f_1, f_2, steps), np.linspace(f_2, f_1, steps)]
    memory, x, w, ends = at_rest(p), 0.0, 0.0, []
    for share in np.r_[np.linspace(0.0, f_1, steps), np.tile(cycle, 3)]:
        w, _ = law.step(p, 1.0, memory, 1e-9, share * p.F_c, 1e-3, w)
        x += 1e-3 * w
        ends.append(x)
    return ends[-1] - ends[-1 - 2 * steps]


@pytest.mark.parametrize(("f_1", "f_2"), [(-0.1, 0.45), (0.1, 0.4)])
def test_dahl_and_lugre_drift_under_a_torque_cycle_below_break_away_and_elasto_plastic_does_not(f_1, f_2):
    expected = 0.009 * math.log((1.0 - f_1**2) / (1.0 - f_2**2))
    for bristle in (friction.make("dahl"), friction.make("lugre", sigma_1=0.0)):
        assert drift(bristle, f_1, f_2) == pytest.approx(expected, rel=2e-3)  # the step mean lags by half a step
    # means over steps follow a corner of the torque with an alternation that does not decay
    assert abs(drift(friction.make("elasto_plastic", sigma_1=0.0), f_1, f_2)) < 1e-6 * expected


def test_elasto_plastic_slides_at_the_torque_that_all_laws_share():
    torque = friction.response(friction.make("elasto_plastic", sigma_1=0.0), np.linspace(0.0, 0.2, 50), 1e-3)
    assert torque[-1] == pytest.approx(0.9, rel=1e-9)
    assert np.all(np.diff(torque) >= 0.0)


def test_the_saturated_loop_of_the_default_is_within_a_twentieth_of_that_of_dahl():
    """Between turns of 0.1 rad, eleven pre-sliding distances."""
    x = 0.1 * np.sin(np.linspace(0.0, 4.0 * math.pi, 4001))
    work = {
        name: np.trapezoid(friction.response(friction.make(name, **given), x, 1e-3)[2000:], x[2000:])
        for name, given in (("dahl", {}), ("elasto_plastic", {"sigma_1": 0.0}))
    }
    assert work["elasto_plastic"] == pytest.approx(work["dahl"], rel=0.05)


def test_bouc_wen_with_beta_of_a_half_is_elastic_after_a_reversal():
    p = friction.make("bouc_wen", n=3.3, beta=0.5)
    torque = friction.response(p, [0.0, 0.1, 0.097, 0.093], 1e-3)
    np.testing.assert_allclose(np.diff(torque[1:]), [-0.3, -0.4], rtol=1e-9)


def test_bouc_wen_below_the_bound_creates_energy():
    """From saturation back by half the pre-sliding distance it gives more than its spring lets go."""
    p = BoucWen(sigma_0=100.0, F_c=0.9, n=1.0, beta=0.2)
    memory = at_rest(p)
    memory[0] = p.F_c / p.sigma_0
    before, (torque, _) = law.stored_energy(p, memory), law.mean_torque(p, 1.0, memory, -1.0, 4.5e-3)
    law.advance(p, 1.0, memory, -1.0, 4.5e-3)
    assert torque * -4.5e-3 < law.stored_energy(p, memory) - before - 1e-3
