"""The bench: runs take turns, ratios are of one round, and what is not installed is left out with a note."""

import json
import math

import gymnasium as gym
import numpy as np
import pytest

from steer_env.experiments.cli.main import main
from steer_env.experiments.studies.common import step_time
from steer_env.experiments.studies.common.step_time import Case, Start


def test_runs_take_turns_and_a_ratio_is_of_one_round():
    """A machine that slows from round to round changes no ratio."""
    order = []

    def run(name, factor):
        order.append(name)
        return factor * (1 + (len(order) - 1) // 2)

    runs = {name: (lambda name=name, factor=factor: run(name, factor)) for name, factor in (("a", 2.0), ("b", 6.0))}
    times = step_time.in_turns(runs, rounds=4)
    assert order == ["a", "b", "b", "a"] * 2
    assert times["a"] == [2.0, 4.0, 6.0, 8.0]
    ratio = step_time.ratios_to_base(times, "a")["b"]
    assert (ratio.median, ratio.low, ratio.high) == (3.0, 3.0, 3.0)


def test_a_reset_does_not_count():
    """CartPole falls after some ten steps with one action; its resets, made slow, are left out."""

    class Slow(gym.Wrapper):
        resets = 0

        def reset(self, **options):
            self.resets += 1
            for _ in range(1000):
                self.env.reset()
            return self.env.reset(**options)

    env = Slow(gym.make(step_time.CART))
    env.reset(seed=0)
    times = step_time.in_turns(
        {"slow": lambda: step_time._steps(env, 1, 1, 100), "own": step_time.make_run(gym.make(step_time.CART), 1, 1)},
        20,
    )
    assert env.resets > 20 * 5
    assert step_time.ratios_to_base(times, "own")["slow"].median < 10.0  # forty with them


def test_what_is_not_installed_is_left_out(monkeypatch):
    monkeypatch.setattr(step_time, "find_spec", lambda name: None)
    cases, notes = step_time.cases()
    assert {case.program for case in cases} == {"Gymnasium", "steer-env"}
    packages = ("EnvPool", "highway-env", "commonroad-vehicle-models")
    assert notes == [f"{name} is not installed" for name in packages]
    assert step_time.right_hand_sides() == {}
    of_vector = {(case.rows, case.threads) for case in cases if case.what.endswith("vector")}
    assert of_vector == {(1, 1), *((n, count) for n in (16, 256, 4096) for count in (1, 2))}


@pytest.mark.whole
def test_the_file_has_ratios_and_its_numbers(monkeypatch, tmp_path):
    cart = Case("Gymnasium", step_time.CART, 1, 1, lambda n: gym.make(step_time.CART), lambda n: 1)
    own = [case for case in step_time.cases(quick=True)[0] if case.program == "steer-env" and case.rows == 1]
    monkeypatch.setattr(step_time, "cases", lambda quick: ([cart, *own], ["EnvPool is not installed"]))
    monkeypatch.setattr(step_time, "starts", lambda cases, cache: [Start("CartPole-v1", math.nan, 0.5)])
    out = tmp_path / "bench"
    assert main(["bench", "--seconds", "0.2", "--out", str(out)]) == 0
    found = json.loads((out / "bench.json").read_text(encoding="utf-8"))
    row = found["environments"][0]
    assert (row["what"], row["rows"], row["over_base"]["median"]) == (step_time.CART, 1, 1.0)
    assert row["seconds_a_row"]["median"] > 0.0
    assert found["first_step_s"]["CartPole-v1"] == {"cold": None, "warm": 0.5}
    assert found["plants"][1] == {**found["plants"][1], "name": "single_track"}
    assert found["plants"][1]["over_one_track"]["median"] == 1.0


def test_shares_are_of_one_round_and_sum_to_one():
    """Whatever the machine does from round to round; the parts of a step of 10 ms, in time of 1 ms."""
    slow = np.array([1.0, 3.0, 2.0])
    step = Case("steer-env", f"{step_time.OWN_FRICTION}, single_track", 1, 1, lambda n: None, lambda n: 0)
    times = {step: list(20.0 * slow), "single_track": list(1.5 * slow)}
    times |= {f"single_track, {name}": list(0.4 * slow) for name in step_time.PLANT_PARTS}
    found = step_time._shares(times)
    assert [each.share.median for each in found] == pytest.approx([0.2, 0.2, 0.2, 0.15, 0.25])


def test_bad_input(capsys):
    assert main(["bench", "--seconds", "0"]) == 2
    assert "--seconds must be finite and greater than 0, got 0.0" in capsys.readouterr().err
