"""The experiments of the LuGre paper: the numbers that the study compares, and what the numbers do not say."""

import numpy as np
import pytest

from steer_env import friction
from steer_env.experiments.studies import canudas1995 as study
from steer_env.experiments.studies.common import mass_experiments as mass
from steer_env.experiments.studies.common.mass_experiments import PAPER


@pytest.mark.parametrize("title", list(study.NUMBERS))
def test_the_numbers_of_the_paper_are_reproduced(title):
    missed = [number for number in study.NUMBERS[title]() if not number.agrees]
    assert not missed


def test_friction_lags_the_more_the_faster_the_speed_changes():
    cycles = [mass.lag(PAPER, omega) for omega in mass.LAG_OMEGAS]
    gaps = [cycle.rising - cycle.falling for cycle in cycles]
    assert gaps[0] > 0.0
    assert np.all(np.diff(gaps) > 0.0)
    static = mass.steady(PAPER, 1.5 * mass.LAG_SPEED)
    assert all(cycle.falling < static < cycle.rising for cycle in cycles)


def test_break_away_force_falls_with_the_force_rate():
    peaks = [mass.break_away(PAPER, rate) for rate in mass.RATES]
    forces = [force for _, force in peaks]
    assert np.all(np.diff(forces) < 0.0)
    assert PAPER.F_c < min(forces)
    assert max(forces) < PAPER.F_s
    for rate, (time, force) in zip(mass.RATES, peaks):
        t, _, F = mass.reference(1.6 / rate, lambda t: rate * t, 40_001)  # noqa: B023
        assert time == pytest.approx(mass.first_peak(t, F)[0], rel=1e-3)
        assert force == mass.ramp(PAPER, rate).F.max()  # what the study gives for laws without a local maximum


def test_stick_slip_repeats_itself():
    t, x, w, F = mass.stick_slip(PAPER)
    slips = mass.upward_crossings(t, w, mass.SLIP_SPEED)
    periods = np.diff(slips)
    assert len(slips) == 6
    assert np.ptp(periods) < 2e-3  # four steps
    # between slips the spring gathers what a slip lets go
    advance = np.interp(slips[1:] - 0.1, t, x) - np.interp(slips[:-1] - 0.1, t, x)
    np.testing.assert_allclose(advance, mass.DRAWN_SPEED * periods, rtol=1e-3)
    # a slip lasts half a swing, pi/sqrt(k) = 2.2 s, and the draw; then only the bristles bend, within -F_s..F_s
    stuck = (t > slips[0] + 3.5) & (t < slips[1] - 0.5)
    assert np.ptp(x[stuck]) < 2.0 * PAPER.F_s / PAPER.sigma_0
    assert F[t > 5.0].max() == pytest.approx(mass.first_peak(t, F)[1], rel=1e-3)


def test_hunting_is_a_limit_cycle():
    motion = mass.hunting(PAPER)
    late = motion.t > study.SETTLED
    periods = np.diff(mass.upward_crossings(motion.t[late], motion.x[late], 1.0))
    assert np.ptp(periods) < 3e-3  # three steps


def test_only_a_law_with_a_falling_curve_and_a_bristle_shows_every_effect():
    found = {name: study.traits(name) for name in ("lugre", "dahl", "masing", "coulomb", "viscous")}
    assert all(found["lugre"].effects.values())
    for name in ("dahl", "masing"):
        assert [effect for effect, shown in found[name].effects.items() if shown] == ["pre-sliding displacement"]
    for name in ("coulomb", "viscous"):
        assert not any(found[name].effects.values())


def test_a_number_that_does_not_agree_is_told():
    rows = [study.Number("period", 24.4, 25.0, 0.06, "s"), study.Number("least", 1.0, 1.0, 0.1, "m")]
    experiment = study.Experiment(rows, "")
    assert experiment.missed == ["period"]
    assert experiment.worst.what == "period"


def test_the_laws_take_the_scale_of_the_paper():
    for name, p in mass.laws(("dahl", "masing", "lugre"), 1.5).items():
        # the stiffness after a reversal from saturation is twice sigma_0
        x = 1e-9 * np.arange(400_001)
        path = np.concatenate([x, x[-1] - x[1:1001]])
        F = friction.response(p._replace(F_c=1.5, F_s=1.5) if name == "lugre" else p, path, 1.0)
        assert F[400_000] == pytest.approx(1.5, rel=1e-3)
        slope = (F[400_000] - F[400_500]) / (x[500] - x[0])
        assert slope == pytest.approx(
            2.0 * PAPER.sigma_0, rel=0.1 if name == "masing" else 0.02
        )  # ten chords of a smooth curve
