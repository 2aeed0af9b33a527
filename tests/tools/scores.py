"""Scores of every kind of controller on the same held-out episodes of an id at its default settings, and its terms."""

import json
import math
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np

from steer_env import tasks
from steer_env.environments import default_speed, table
from steer_env.experiments.learning import held_out, policy, policy_report
from steer_env.experiments.learning.constants import HELD_OUT
from steer_env.experiments.learning.controllers import SIMPLE, Maker, baselines
from steer_env.experiments.learning.held_out import Episodes, Estimate, Job
from steer_env.experiments.pages.files import write_json
from steer_env.experiments.pages.words import number
from steer_env.experiments.sweep import Runner, run
from steer_env.friction.numerics import toml
from steer_env.registration import TUNED

TERMS = ("authority", "decides", "delay", "information")  # columns that say on which terms a controller acts
SAME = "–"
TOLD = Path(__file__).with_name("controllers.toml")  # terms of the controllers that are not trained


class Score(NamedTuple):
    """A controller's results in the held-out episodes of an id."""

    values: dict[str, Estimate]  # reward, cost and the metric that the task is judged by
    terms: dict[str, str]  # keys of ``TERMS``
    trained: bool


class Scores(NamedTuple):
    """All controllers of an id in the same held-out episodes."""

    env_id: str
    about: str  # the settings in words
    units: dict[str, str]
    scores: dict[str, Score]
    # Reward of each policy of the library's defaults less that of the best baseline, with its name, paired by seed.
    gaps: dict[str, tuple[str, Estimate]]
    scenarios: dict[str, dict[str, Estimate]]  # reward of each controller in each scenario, for a task with several


def trained(folders: Iterable[Path]) -> dict[str, list[Path]]:
    """Policies of ``steer-env train`` in folders and below them, by id."""
    found: dict[str, list[Path]] = {}
    for folder in folders:
        paths = sorted(folder.rglob("policy.zip"))
        if not paths:
            raise ValueError(f"{folder} holds no policy.zip")
        for path in paths:
            found.setdefault(policy.about(path)["env"], []).append(path)
    return found


def collect(
    env_ids: Sequence[str],
    episodes: int,
    policies: Mapping[str, Iterable[Path]] | None = None,
    notify: Callable[[float, str], None] = lambda *_: None,
    sweep: Runner = run,
) -> list[Scores]:
    """Evaluate zero action, random actions, every baseline, the shipped policy and others (by id) of ids."""
    jobs: dict[tuple[str, str, str], Job] = {}  # by id, scenario and controller
    paths: dict[str, dict[str, Path]] = {}
    for env_id in env_ids:
        policy.check_id(env_id)
        paths[env_id] = {} if env_id in TUNED else _policies(env_id, (policies or {}).get(env_id, ()))
        made = {label: policy.load(path) for label, path in paths[env_id].items()}
        makers = {**SIMPLE, **({} if env_id in TUNED else baselines(env_id)), **made}
        jobs |= {
            (env_id, scenario, label): Job(label, env_id, make, episodes, options)
            for scenario, options in _scenarios(env_id).items()
            for label, make in makers.items()
        }
    results = sweep(_evaluated, jobs.values(), notify=notify, words=lambda job: f"{job.env_id} {job.label}")
    found: dict[str, dict[str, dict[str, Any]]] = {}
    for (env_id, scenario, label), result in zip(jobs, results):
        found.setdefault(env_id, {}).setdefault(scenario, {})[label] = result
    return [
        _tuned(env_id, found[env_id][""]) if env_id in TUNED else _driven(env_id, found[env_id], paths[env_id])
        for env_id in env_ids
    ]


def _policies(env_id: str, given: Iterable[Path]) -> dict[str, Path]:
    """Policies of an id by label: those that are given, and the shipped one."""
    paths = {f"policy, {path.resolve().parent.name}": path for path in given}
    if (policy.SHIPPED_IN / env_id.removeprefix("steer_env/") / "policy.zip").is_file():
        paths["policy, shipped"] = policy.shipped(env_id)
    for path in paths.values():
        policy.check_observations(path, policy.about(path), env_id)
    return paths


def _evaluated(job: Job) -> Any:
    """Episodes of a controller, or scores of a set of parameters in each episode."""
    return _sets(job) if job.env_id in TUNED else held_out.evaluated(job)


def _driven(env_id: str, every: Mapping[str, Mapping[str, Episodes]], paths: Mapping[str, Path]) -> Scores:
    """The scores of an id, from the episodes by scenario and controller."""
    found = every[""]
    makers: dict[str, Maker] = {**SIMPLE, **baselines(env_id)}
    makers |= {label: policy.load(path) for label, path in paths.items()}
    task = tasks.task(policy.check_driven(env_id))
    units = {"reward": "", "cost": "", "failed_share": "1", **{metric.name: metric.unit for metric in task.metrics}}
    aim = policy_report.aim(found["zero"].metrics)
    shown = dict.fromkeys(("reward", "cost", "failed_share", aim))
    env: Any = gym.make(env_id)
    scores = {
        name: Score(
            {key: held_out.summary(each)[key] for key in shown},
            _terms(name, makers[name](env), env, policy.about(paths[name]) if name in paths else None),
            name in paths,
        )
        for name, each in found.items()
    }
    usual = env.unwrapped.batch.usual_conditions
    speed = f"{3.6 * usual.speed:g} km/h" if task.speeds is None else f"a speed {default_speed(task)}"
    about = (
        f"Decisions every {1e3 * env.unwrapped.control_dt:g} ms, {speed}, "
        f"sensor noise {usual.sensor_noise:g}, delay of the observation {1e3 * usual.delay:g} ms."
    )
    env.close()
    library = [name for name, path in paths.items() if not policy.is_scaled(policy.about(path))]
    scenarios = {
        name: {label: held_out.mean(each.reward) for label, each in of.items()} for name, of in every.items() if name
    }
    return Scores(env_id, about, units, scores, _gaps(found, library, paths), scenarios)


def _gaps(
    found: Mapping[str, Episodes], library: Iterable[str], policies: Collection[str]
) -> dict[str, tuple[str, Estimate]]:
    """Each policy of the library's defaults beside the best baseline."""
    others = {name: each.reward.mean() for name, each in found.items() if name not in policies and name not in SIMPLE}
    if not others:
        return {}
    best = max(others, key=lambda name: others[name])
    return {name: (best, held_out.mean(found[name].reward - found[best].reward)) for name in library}


def _scenarios(env_id: str) -> dict[str, dict[str, float]]:
    """Options of resets by scenario of an id, after those of the usual episodes, which have no name."""
    usual: dict[str, dict[str, float]] = {"": {}}
    if env_id in TUNED or (task := tasks.task(policy.check_driven(env_id))).draw_scenario is None:
        return usual
    names = dict(pair.split(" ", 1) for pair in task.options["scenario"][2].split(", "))
    return usual | {name: {"scenario": float(k)} for k, name in names.items()}


def _terms(name: str, controller: Any, env: Any, about: Mapping[str, Any] | None) -> dict[str, str]:
    """On which terms a controller acts."""
    action, dt = env.unwrapped.task.action, env.unwrapped.control_dt
    authority = 0.0 if name in ("zero", "boost") else action.scale * getattr(controller, "authority", 1.0)
    terms = {"authority": f"{authority:.3g} {action.unit}", "decides": f"{1e3 * dt:g} ms", "delay": SAME}
    if about is None:
        return terms | toml.loads(TOLD.read_text(encoding="utf-8"))[name]
    drawn = policy_report.conditions({**policy.conditions(about), "friction": about["friction"]})
    words = ", ".join(f"{key} {value}" for key, value in drawn.items())
    if not policy.is_scaled(about):
        words += f", Stable-Baselines3's own defaults, best by validation at step {about['steps']}"
    decides = f"{1e3 * about['settings']['environment']['control_dt']:g} ms"
    return terms | {"decides": decides, "information": f"the observations; trained with {words}"}


def _sets(job: Job) -> dict[str, Estimate]:
    """Reward and cost of the sets of parameters that a controller chooses, one in each episode."""
    env = gym.make(job.env_id)
    controller: Any = job.make(env)
    rewards, costs = [], []
    for k in range(job.episodes):
        observation, _ = env.reset(seed=HELD_OUT + k)
        _, reward, *_, info = env.step(controller.act(observation))
        rewards.append(float(reward))
        costs.append(float(info["cost"]))
    env.close()
    return {"reward": held_out.mean(np.array(rewards)), "cost": held_out.mean(np.array(costs))}


def _tuned(env_id: str, found: Mapping[str, dict[str, Estimate]]) -> Scores:
    """The car's own set of parameters, and random sets, one in each episode."""
    terms = {"authority": "all parameters", "decides": "once", "delay": SAME, "information": "none"}
    scores = {name: Score(values, terms, False) for name, values in found.items()}
    about = "One set of parameters in each episode: zero is the start, random is drawn from the whole range."
    return Scores(env_id, about, {"reward": "", "cost": ""}, scores, {}, {})


def threshold(found: Scores) -> float | None:
    """The reward from which an id counts as solved: the mean of its best baseline, or of its best policy without one.

    None where there is neither. It is rounded down to three digits.
    """

    def best(chosen: list[Score]) -> float | None:
        return max((score.values["reward"].value for score in chosen), default=None)

    others = {name: score for name, score in found.scores.items() if name not in SIMPLE}
    value = best([score for score in others.values() if not score.trained])
    value = best([score for score in others.values() if score.trained]) if value is None else value
    if not value:
        return value
    unit = 10.0 ** (math.floor(math.log10(abs(value))) - 2)
    return round(math.floor(value / unit) * unit, 12)


def write_thresholds(path: Path, found: Iterable[Scores]) -> None:
    """Set the thresholds of ids in a JSON file, and keep those of the others that are there."""
    old = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
    new = {each.env_id: threshold(each) for each in found}
    write_json(path, {name: value for name, value in sorted({**old, **new}.items()) if value is not None})


def markdown(found: Iterable[Scores], episodes: int) -> str:
    """The page of all tables, in Markdown."""
    lines = [
        "# Scores",
        f"`python -m tests.maintain scores --episodes {episodes}` prints this page: every controller in the same "
        f"{episodes} held-out episodes of each id, seeds from {HELD_OUT} on, at the id's default settings, mean and "
        "95 % interval. "
        "Authority is the largest torque that a controller may ask for; an action is held where its controller decides "
        "less often than the environment; the delay is the controller's own, beside that of the observation.",
    ]
    for each in found:
        first = next(iter(each.scores.values()))
        units = [f" [{each.units[key]}]" if each.units[key] not in ("", "1") else "" for key in first.values]
        heads = [key.removesuffix("_share").replace("_", " ") + unit for key, unit in zip(first.values, units)]
        rows = [
            (
                name.replace("_", " "),
                *(_shown(key, e, episodes) for key, e in score.values.items()),
                *(score.terms[key] for key in TERMS),
            )
            for name, score in each.scores.items()
        ]
        solved = threshold(each)
        last = "" if solved is None else f" `reward_threshold`: {solved:g}."
        lines += [f"## `{each.env_id}`", each.about + last, table(("controller", *heads, *TERMS), rows)]
        lines += [_gap(*item) for item in each.gaps.items()]
        if each.scenarios:
            lines.append("Reward by scenario, in as many episodes of each:")
            rows = [
                (name.replace("_", " "), *(_shown("reward", by[name], episodes) for by in each.scenarios.values()))
                for name in each.scores
            ]
            lines.append(table(("controller", *each.scenarios), rows))
    return "\n\n".join(lines) + "\n"


def _gap(name: str, against: tuple[str, Estimate]) -> str:
    """How far a policy of the library's defaults is from the best baseline, in words."""
    baseline, e = against
    size = f"{number(abs(e.value))} ± {number(0.5 * (e.high - e.low), 2)}"
    far = "above" if e.value > 0.0 else "short of"
    return f"Trained with Stable-Baselines3's own defaults ({name}): {size} {far} {baseline.replace('_', ' ')}."


def _shown(key: str, e: Estimate, episodes: int) -> str:
    """A mean with half its interval, or a number of episodes."""
    if key == "failed_share":
        return f"{round(e.value * episodes)} of {episodes}"
    half = 0.5 * (e.high - e.low)
    return number(e.value) + ("" if math.isnan(half) else f" ± {number(half, 2)}")
