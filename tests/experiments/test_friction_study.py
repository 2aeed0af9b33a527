"""What the study says about the laws, pinned loosely enough for other processors."""

from dataclasses import replace

import numpy as np
import pytest

from steer_env import friction, manoeuvres
from steer_env.experiments.studies import friction_laws as study
from steer_env.experiments.studies import readme_picture
from steer_env.experiments.studies.common import battery
from steer_env.experiments.studies.common.friction_records import road_drive
from steer_env.hand_torque.drive import reversals
from steer_env.vehicle import cars


@pytest.fixture(scope="module")
def held():
    car = cars.load()
    return [test for law in study.HELD_LAWS for test in study.held_torque(car, law)]


def test_one_calibration_holds_on_the_saturated_branches_only():
    torques = {law: study.characteristics(friction.make(law))["nested_loops"] for law in ("lugre", "masing", "dahl")}
    masing, dahl = (study.residual(torques[law], torques["lugre"]) for law in ("masing", "dahl"))
    assert dahl.saturated < dahl.nested < 1e-3  # LuGre without its damper, which hardly acts at this speed
    assert masing.saturated < 0.01  # ten elements stand for a smooth curve
    assert 0.02 < masing.nested < 0.05


def test_laws_of_one_calibration_differ_in_small_turns_and_coincide_in_the_weave():
    def lost(law, options):
        drive = battery.drive(cars.load(), friction.make(law), "weave", options)
        return drive.values["loop_area"].value

    small, weave = ([lost(law, options) for law in readme_picture.LAWS] for options in readme_picture.TESTS.values())
    assert max(small) > 9.0 * min(small)
    assert max(weave) < 1.05 * min(weave)


def test_the_small_turns_are_those_of_hands_on_a_motorway():
    """Half of the turns span no more, to the step by which the recorded traffic tells angles apart."""
    turns = np.abs(np.diff(reversals(road_drive()["handwheel_angle"], readme_picture.LEAST_TURN)))
    assert np.median(turns) == pytest.approx(2.0 * study.SMALL_TURN, abs=0.1 * study.DEGREE)


def test_dry_and_set_valued_are_read_off_any_law(toy):
    found = {law: (study.dry(friction.make(law)), study.set_valued(friction.make(law))) for law in friction.available()}
    assert found.pop("viscous") == (False, False)
    assert found.pop("coulomb") == found.pop("stribeck") == (True, True)
    assert "toy_jenkins" in found
    assert set(found.values()) == {(True, False)}
    assert not study.dry(friction.make("viscous", sigma_2=100.0))


def test_no_amplitude_depends_on_what_was_driven_before(monkeypatch):
    """Manoeuvres that differ in anything, as in chassis, length of the trial or motion, begin their search apart."""
    car, weave = cars.load(), manoeuvres.make("weave")
    others = [replace(weave, chassis="two_track"), replace(weave, trial=7.0), manoeuvres.make("weave", frequency=0.25)]
    for other in others:
        monkeypatch.setattr(battery, "_near_amplitudes", {})
        alone = battery.near_amplitude(car, other)
        monkeypatch.setattr(battery, "_near_amplitudes", {})
        assert battery.near_amplitude(car, weave) != alone
        assert battery.near_amplitude(car, other) == alone


def test_torque_stays_while_a_displacement_is_held():
    torque = study.characteristics(friction.make("masing"))["held"]
    assert torque[-1] == torque[-400] != 0.0
    # LuGre's damper lets go at once; the bristle stays
    torque = study.characteristics(friction.make("lugre"))["held"]
    assert torque[-1] == torque[-400] != 0.0


def test_the_step_does_not_cause_the_ripple(held):
    """To 2 %; what many periods of decay leave, tenths of a millinewton metre, to 5 uN m."""
    for test in held:
        assert test.ripple_fine == pytest.approx(test.ripple, rel=0.02, abs=5e-6)


def test_masing_rings_without_a_damper_as_long_as_there_is_assist(held):
    on, off = ((s, study.CALIBRATIONS[1].title, "masing", 0.0) for s in study.ASSIST)
    found = {test[:4]: test for test in held}
    assert 0.05 < found[on].ripple < 0.15
    assert found[on].lasting > 0.9
    assert found[off].lasting < 0.5
    assert 4.0 < study.ringing(found[on].torque) < 10.0


def test_a_damper_in_both_laws_closes_the_gap(held):
    """The light damper is not enough where the assist feeds the vibration."""
    light, heavy = (study.verdicts(held, ratio) for ratio in study.DAMPING_RATIOS[1:])
    assert all(verdict.masing.ripple > 2.0 * verdict.lugre.ripple for verdict in light)
    fed = [verdict.masing.lasting > 0.9 for verdict in light]
    assert sum(fed) == 1
    for verdict, lasts in zip(light, fed):
        low, high = (0.05, 0.3) if lasts else (0.3, 1.0)
        assert low < verdict.share_of_damper < high
    assert all(verdict.share_of_damper > 0.9 for verdict in heavy)


def test_both_laws_of_the_held_test_unload_alike_after_saturation():
    x = np.linspace(0.0, 6.0, 601) * study.DEGREE
    path = np.concatenate([x, x[::-1][1:]])
    for calibration in study.CALIBRATIONS:
        lugre, masing = (study.held_law(law, calibration, 0.0, 0.05) for law in study.HELD_LAWS)
        gap = friction.response(lugre, path, 1.0)[601:] - friction.response(masing, path, 1.0)[601:]
        assert np.sqrt(np.mean(gap**2)) < 0.01 * calibration.F_c


def test_ringing_of_a_known_sine():
    t = np.arange(0.0, 5.0, study.THINNING * 1e-3)
    assert study.ringing(np.exp(-t) * np.sin(2.0 * np.pi * 6.0 * t)) == pytest.approx(6.0, rel=0.01)
    assert np.isnan(study.ringing(np.zeros_like(t)))
