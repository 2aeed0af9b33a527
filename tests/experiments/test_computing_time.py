"""Computing times: ratios from blocks in turns, and no number where the machine is too busy for one."""

import dataclasses
import importlib
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from steer_env import friction
from steer_env.experiments.studies.common import computing_time
from steer_env.experiments.studies.common.computing_time import CAR, COLUMN, Block, Clocks, estimate, in_turns
from steer_env.friction.law import LAWS
from steer_env.vehicle import cars

STEPS = 10
TRUE = {"lugre": 100_000.0, "masing": 40_000.0, "own": 1_300_000.0}  # of a block [ns]
BARE = 200_000.0  # [ns]


@dataclasses.dataclass
class Machine:
    """A machine on which time passes only where a block runs, a bare loop and a drift of its speed."""

    seed: int = 0
    noise: float = 0.01  # of the speed from block to block [1]
    drift: float = 0.0  # change of the speed in a second [1]
    waiting: float = 0.0  # part of the time that other programs have [1]
    wall: float = 0.0
    own: float = 0.0

    def __post_init__(self):
        self.random = np.random.default_rng(self.seed)

    def spend(self, ns):
        passed = ns * (1.0 + self.drift * 1e-9 * self.wall) * (1.0 + self.noise * abs(self.random.standard_normal()))
        self.own += passed
        self.wall += passed / (1.0 - self.waiting)

    def clocks(self):
        def wall():
            return round(self.wall)

        def own():
            return round(self.own)

        return Clocks(wall, own)

    def measure(self):
        blocks = {law: Block(lambda ns=ns: self.spend(ns), STEPS) for law, ns in TRUE.items()}
        return in_turns(blocks, lambda _: "lugre", clocks=self.clocks(), bare=lambda: self.spend(BARE))


def test_time_and_ratio_are_those_of_the_blocks():
    found = Machine().measure()
    assert found.measurable
    for law, ns in TRUE.items():
        cost = found.costs[law]
        assert cost.ns.median == pytest.approx(ns / STEPS, rel=0.02)
        assert cost.ratio.low <= ns / TRUE["lugre"] <= cost.ratio.high or law == "lugre"
        assert cost.ns.low <= cost.ns.median <= cost.ns.high <= cost.ns.late


def test_a_ratio_keeps_where_the_machine_becomes_slower():
    """It becomes 10 % slower over the measurement, which no ratio shows."""
    quiet, slower = Machine().measure(), Machine(seed=1, drift=1.0).measure()
    for law in TRUE:
        assert slower.costs[law].ratio.median == pytest.approx(quiet.costs[law].ratio.median, rel=0.01)
    assert slower.costs["own"].ns.median > 1.02 * quiet.costs["own"].ns.median


@pytest.mark.parametrize("waiting", [0.2, 0.33, 0.45])
def test_another_programs_share_of_the_processor_changes_no_time(waiting):
    quiet, busy = Machine().measure(), Machine(seed=2, waiting=waiting).measure()
    assert busy.load.waiting == pytest.approx(waiting, abs=0.01)
    for law in TRUE:
        assert busy.costs[law].ns.median == pytest.approx(quiet.costs[law].ns.median, rel=0.01)


@pytest.mark.parametrize("disturbed", [{"waiting": 0.6}, {"noise": 0.5}, {"drift": 12.0}])
def test_nothing_is_shown_past_a_threshold(disturbed):
    found = Machine(**disturbed).measure()
    assert not found.load.small
    assert not found.measurable
    assert found.costs == {}
    times = computing_time.Times(found, frozenset())
    assert times.ordered(TRUE) == []
    assert times.as_json()["costs"] == {}
    assert times.as_json()["measurable"] is False


def test_a_ratio_that_is_not_known_closely_is_not_shown():
    random, machine = np.random.default_rng(0), Machine(noise=0.0)
    blocks = {
        "lugre": Block(lambda: machine.spend(1e5), STEPS),
        "other": Block(lambda: machine.spend(random.choice([1e5, 3e5])), STEPS),
    }
    found = in_turns(blocks, lambda _: "lugre", clocks=machine.clocks(), bare=lambda: machine.spend(BARE))
    assert found.load.spread < computing_time.MOST_SPREAD
    assert found.load.width > computing_time.WIDEST
    assert not found.measurable


def test_the_interval_holds_the_median_of_nineteen_in_twenty():
    random = np.random.default_rng(0)
    held = [of.low <= 0.0 <= of.high for of in (estimate(random.standard_normal(200)) for _ in range(1000))]
    assert 0.93 <= np.mean(held) <= 0.98


def test_long_blocks_end_after_so_long():
    machine, rounds = Machine(), []
    blocks = {"lugre": Block(lambda: machine.spend(1e9), 1)}
    in_turns(blocks, lambda _: "lugre", rounds.append, machine.clocks(), lambda: machine.spend(BARE))
    assert len(rounds) == computing_time.LEAST_ROUNDS
    assert rounds[-1] == 1.0


@pytest.fixture
def own_law(monkeypatch):
    """A law that gives its equation alone."""
    monkeypatch.syspath_prepend(str(Path(__file__).parents[2] / "examples"))
    with LAWS.restored():
        importlib.import_module("own_friction_laws")
        yield "dahl_exponent"
        del sys.modules["own_friction_laws"]


def measured(law):
    laws = {name: friction.make(name) for name in ("lugre", "masing", law)}
    return computing_time.of_laws(laws, cars.load())


@pytest.mark.whole
def test_laws_are_measured_beside_lugre_even_where_it_is_not_asked_for(own_law, monkeypatch):
    monkeypatch.setattr(computing_time, "ROUNDS", 2)
    monkeypatch.setattr(computing_time.Load, "small", True)
    laws = {name: friction.make(name) for name in ("coulomb", own_law)}
    times = computing_time.of_laws(laws, cars.load())
    assert times.integrated == {own_law}
    assert times.ordered(laws) == ["coulomb", own_law]
    assert all(0.0 < times.of(law, what).ns.median < 1e6 for law in laws for what in (COLUMN, CAR))
    assert times.of(own_law).ratio.median > times.of(own_law, CAR).ratio.median
    assert times.share(own_law) < 1.0
    assert list(times.as_json()["costs"]) == ["lugre", *laws]
    json.dumps(times.as_json(), allow_nan=False)


@pytest.mark.whole
def test_the_bare_loop_sees_programs_on_its_processor(own_law, monkeypatch):
    """Three leave it a quarter of the time; on a quiet processor it waits for one or two hundredths."""
    monkeypatch.setattr(computing_time, "ROUNDS", 50)
    processors = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(processors)})
    try:
        others = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(3)]
        try:
            times = measured(own_law)
        finally:
            for other in others:
                other.kill()
                other.wait()
    finally:
        os.sched_setaffinity(0, processors)
    assert times.load.waiting > 0.1
