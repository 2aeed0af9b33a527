"""The suite for assists: it finds what is unstable, passes what is stable, and bounds the search for options."""

import json
import math
from functools import partial

import gymnasium as gym
import numpy as np
import pytest

from steer_env import assists, registration
from steer_env.assists.common import definition
from steer_env.assists.common.definition import Baseline
from steer_env.experiments.cli.main import main
from steer_env.experiments.learning import assist_drives, assist_suite, controllers, held_out, training
from steer_env.tasks import assist_release
from steer_env.vehicle import cars
from steer_env.vehicle.analysis import free_control
from steer_env.vehicle.plant import CHANNEL
from tests.maintain.__main__ import run as maintain
from tests.tools import assist_tuning

WEAVE = "steer_env/AssistWeave-v3"


class Pushing(Baseline):
    """Pushes the column in the direction in which it turns, without end: unstable by construction."""

    needs = ("column_speed",)

    def torque(self, seen):
        return 8.0 * seen.column_speed


class Delayed(Baseline):
    """Integral control of the feel as it stands in textbooks: it neither notices hands nor quick motion."""

    needs = ("torsion_bar_torque", "lateral_acceleration")

    def __init__(self, env):
        super().__init__(env)
        self.sum = np.zeros(self.n)

    def torque(self, seen):
        self.sum = np.clip(self.sum + 0.15 * (seen.torsion_bar_torque - 2.0 * seen.lateral_acceleration), -5.0, 5.0)
        return self.sum


def drive(kind, condition=assist_drives.OWN_FRICTION, env_id=WEAVE):
    """The first drive of a kind and condition."""
    every = assist_drives.suite(assist_suite.task_named(env_id))
    return next(one for one in every if (one.kind, one.condition) == (kind, condition))


def failing(make, *kinds):
    """Kinds of drives in which a controller fails somewhere."""
    return {kind for kind in kinds if not all(found.holds for found in assist_suite.judge(drive(kind), make, WEAVE))}


@pytest.mark.whole
def test_what_is_unstable_is_found():
    assert failing(Pushing, "pulse", "release", "arms") == {"pulse", "release", "arms"}
    assert failing(Delayed, "pulse", "release", "arms") == {"pulse", "release", "arms"}


@pytest.mark.whole
@pytest.mark.parametrize("name", ["boost", "integral", "lqg", "friction_compensation"])
def test_the_shipped_baselines_hold(name):
    """Where unstable assists fail first; the whole suite is in the next test."""
    assert not failing(partial(assists.make, name), "weave", "arms", "release")


@pytest.mark.whole
def test_a_shipped_baseline_holds_everywhere():
    found = assist_suite.examine(partial(assists.make, "integral"), "steer_env/AssistParking-v3")
    assert [one for one in found if not one.holds] == []
    assert sum(one.beyond + one.excused for one in found) <= 0.01 * sum(one.rows for one in found)


def test_a_quicker_loop_ripples_with_delay():
    found = assist_suite.judge(drive("weave"), partial(assists.make, "lqg", torque_noise=0.2), WEAVE)
    late = next(one for one in found if one.condition == f"{assist_drives.OWN_FRICTION}, 20 ms more delay")
    assert not late.holds
    assert late.worst > late.limit == 0.05
    assert next(one for one in found if one.condition == f"{assist_drives.OWN_FRICTION}, as it is").holds


def test_the_pulse_is_that_of_free_control():
    """Without an assist, the drive is the plant's run of :func:`steer_env.vehicle.analysis.free_control.pulse`."""
    found = assist_suite.drive_rows(drive("pulse"), partial(assists.make, "boost"), WEAVE)
    own = free_control.pulse(cars.load().plant(speed=180.0 / 3.6)).record[: 10 * len(found.angle)]
    angle = own[9::10, CHANNEL["handwheel_angle"]]
    place = [row.place for row in drive("pulse").rows].index("180 km/h")
    assert np.ptp(angle) > 0.02
    # The drive raises the torque within 10 ms, the plant's run at once.
    np.testing.assert_allclose(found.angle[:, place], angle, rtol=0.0, atol=0.02 * np.ptp(angle))


def test_the_measures_of_known_signals():
    t = np.arange(0.0, 10.0, 0.01)
    angle = np.radians(3.0) * np.sin(2.0 * math.pi * 1.0 * t)[:, None]
    torque = (2.0 * np.sin(2.0 * math.pi * 0.2 * t) + 0.1 * np.sin(2.0 * math.pi * 25.0 * t))[:, None]
    found = assist_suite.Record(angle, torque, angle, np.zeros(1, bool), 0.01)
    value = {name: judge.measure(found)[0] for name, judge in assist_suite.JUDGES.items()}
    assert value["free swing"] == pytest.approx(3.0, rel=1e-3)
    assert value["ripple"] == pytest.approx(0.1 / math.sqrt(2.0), rel=0.02)
    assert value["steering"] == pytest.approx(math.radians(3.0) / math.sqrt(2.0), rel=1e-3)


def test_a_controller_sees_what_its_task_observes():
    seen = {}

    class Watching(Baseline):
        needs = ("speed",)
        optional = ("released", "last_action")

        def torque(self, observations):
            seen.setdefault("released", []).append(observations.released[0])
            seen.setdefault("last", []).append(observations.last_action[0])
            return np.full(self.n, 0.5)

    assist_suite.drive_rows(drive("release"), Watching, "steer_env/AssistRelease-v4")
    released = np.flatnonzero(seen["released"])
    assert released[0] == 400  # 4 s: the hands turn for 1.5 s and hold for 2.5 s
    assert seen["last"][:3] == pytest.approx([0.0, 0.05, 0.05])


def test_an_assist_is_held_against_the_boost_where_that_misses_the_limit():
    """With viscous friction the handwheel is still on its way: who lets it return more slowly, or not, is worse."""
    slow = drive("release", "viscous")
    slow = slow._replace(rows=tuple(row for row in slow.rows if row.speed <= 45.0 and row.variant == "as it is"))

    def judged(make):
        (found,) = assist_suite.judge(slow, make, WEAVE)
        assert (found.beyond, found.excused, found.rows) == (1, 0, 2)
        return found

    alone = judged(partial(assists.make, "boost"))
    assert alone.holds
    assert alone.worst == pytest.approx(alone.limit / assist_suite.WORSE)
    assert judged(partial(assists.make, "active_return")).worst < 0.8 * alone.worst
    assert not judged(Pushing).holds


def test_the_suite_tells_a_wanted_return_as_the_environment_does():
    """In the suite's own release the errors are those of the task, from the angle at which the hands let go."""
    env_id, seen = "steer_env/AssistRelease-v4", []

    class Watching(Baseline):
        needs = ("handwheel_angle", "handwheel_speed", "released", "return_error", "return_speed_error")

        def torque(self, observations):
            seen.append([[*one] for one in observations[list(self.needs)].tolist()])
            return np.zeros(self.n)

    late = drive("release")
    place = next(i for i, row in enumerate(late.rows) if row.variant == "20 ms more delay")
    assist_suite.drive_rows(late, Watching, env_id)
    for row, delay in ((0, 0), (place, 2)):
        angle, speed, released, error, speed_error = np.array(seen)[:, row].T
        first = int(np.flatnonzero(released)[0])
        assert first == 400 + delay
        assert (error[:first] == 0.0).all()
        held, since = angle[first], 0.01 * np.arange(len(angle) - first)
        wanted = np.array([assist_release.wanted_return(held, each) for each in since])
        np.testing.assert_allclose(error[first:] + angle[first:], wanted[:, 0], atol=1e-6)
        np.testing.assert_allclose(speed_error[first:] + speed[first:], wanted[:, 1], atol=1e-5)


@pytest.mark.whole
def test_the_search_keeps_to_the_suite(monkeypatch):
    short = assist_drives.Drive("weave", assist_drives.OWN_FRICTION, {}, drive("weave").rows[:3])
    monkeypatch.setattr(assist_suite, "suite", lambda home, car: [short])
    rewards = {}
    collect = held_out.collect

    def counted(env_id, make, *arguments, **more):
        found = collect(env_id, make, *arguments, **more)
        rewards[json.dumps({k: v for k, v in make.keywords.items() if k != "tuned"})] = found.reward.mean()
        return found

    monkeypatch.setattr(held_out, "collect", counted)
    found = assist_tuning.tune("lqg", WEAVE, budget=5, episodes=2)
    assert len(rewards) == found.candidates == 5
    assert found.usual == rewards["{}"]
    assert found.reward == rewards[json.dumps(found.options)] >= found.usual
    again = assist_tuning.tune("lqg", WEAVE, budget=5, episodes=2)
    assert again == found
    # Where nothing holds there is no result.
    line = assist_suite.judge(short, partial(assists.make, "boost"), WEAVE)[0]._replace(holds=False)
    monkeypatch.setattr(assist_suite, "examine", lambda *_, **__: [line])
    none = assist_tuning.tune("damping", WEAVE, budget=2, episodes=1)
    assert math.isnan(none.reward)
    assert none.options == {}


def test_the_search_drives_the_conditions_of_the_training(monkeypatch):
    drawn = []
    drive_episodes = held_out.drive

    def observed(env, controller, seed, *options):
        env.reset(seed=seed)
        drawn.append(list(env.unwrapped.batch.conditions))
        return drive_episodes(env, controller, seed, *options)

    monkeypatch.setattr(held_out, "drive", observed)
    monkeypatch.setattr(assist_suite, "suite", lambda home, car: [])
    ranges = training.conditions(WEAVE)["randomise"]
    assist_tuning.tune("damping", WEAVE, budget=2, episodes=3)
    assert drawn[0] == drawn[1]  # the same for every candidate
    for name, (low, high) in ranges.items():
        values = [getattr(found, name) for found in drawn[0]]
        assert low <= min(values) < max(values) <= high
    # A search that is told others: none, and a load.
    assist_tuning.tune("boost", "steer_env/AssistLaneChange-v3", episodes=3, randomise={})
    assist_tuning.tune("boost", WEAVE, episodes=3, randomise={"load": (100.0, 100.0)})
    assert drawn[2][1:] == drawn[2][:1] * 2
    assert {(found.load, found.delay) for found in drawn[3]} == {(100.0, 0.0)}


def test_a_baseline_is_the_best_known_by_default(tmp_path, monkeypatch):
    path = tmp_path / "tuned.json"
    found = assist_tuning.Tuned({"gain": 1.5}, 2.0, 1.0, 3, 0)
    for name in ("damping", "active_return"):
        assist_tuning.keep(WEAVE, {name: assist_tuning.as_json(found, 4)}, path)
    assert list(json.loads(path.read_text())[WEAVE]) == ["damping", "active_return"]
    monkeypatch.setattr(definition, "TUNED", path)
    definition._search_results.cache_clear()
    try:
        weave, parking = gym.make(WEAVE), gym.make("steer_env/AssistParking-v3")
        assert assists.make("damping", weave).gain == 1.5
        assert assists.make("damping", weave, gain=2.0).gain == 2.0
        assert controllers.controller_named("damping", WEAVE)(weave).gain == 1.5
        usual = assists.make("damping", weave, tuned=False).gain
        assert usual == assists.make("damping", parking).gain != 1.5
    finally:
        definition._search_results.cache_clear()


def test_what_is_known_to_be_best_is_of_ids_and_options_that_there_are():
    found = json.loads(definition.TUNED.read_text(encoding="utf-8"))
    assert found.keys() <= registration.DRIVEN.keys()
    for env_id, best in found.items():
        env = gym.make(env_id)
        for name in best:
            assists.make(name, env)


def test_an_own_car_takes_the_place_of_all_others():
    stiff = cars.load("compact", changes={"column.K_tb": 143.0})
    home = assist_suite.task_named(WEAVE)
    own, usual = assist_drives.suite(home, stiff), assist_drives.suite(home)
    assert {one.arguments["vehicle"]["column"]["K_tb"] for one in own} == {143.0}
    others = [one for one in usual if "vehicle" in one.arguments]
    assert len(own) == len(usual) - len(others)
    assert others


def test_the_command(tmp_path, capsys, monkeypatch):
    change = drive("lane change")
    monkeypatch.setattr(assist_suite, "suite", lambda home, car: [change])
    out = tmp_path / "suite.json"
    assert main(["policy", "suite", "boost", "damping", "--env", WEAVE, "--out", str(out)]) == 0
    text = capsys.readouterr().out
    assert "holds in 6 of 6 conditions" in text
    assert main(["rerun", str(out)]) == 0
    found = json.loads(out.read_text())["controllers"]
    assert found["boost"]["holds"]
    assert found["boost"]["results"][0]["worst"] == pytest.approx(1.0)
    monkeypatch.setitem(assist_suite.JUDGES, "steering", assist_suite.JUDGES["steering"]._replace(limit=0.5))
    assert main(["policy", "suite", "boost", "--env", WEAVE]) == 1
    assert main(["policy", "suite", "boost", "--env", "steer_env/DriverLaneKeeping-v3"]) == 2
    assert "the suite judges assists" in capsys.readouterr().err
    assert main(["policy", "suite", "boost"]) == 2
    assert maintain(["tune-baselines", "--env", "steer_env/DriverLaneKeeping-v3"]) == 2
