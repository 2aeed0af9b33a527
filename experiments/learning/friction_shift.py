"""The benchmark of friction shift: policies that were trained on one friction law, or on a set, driven on every law.

What a controller loses on a law is the share of the range from zero action to the best entry there by which it falls
short of that entry. Policies and rewards are kept in the folder of the result, so that a run that was killed goes on.
"""

import json
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from importlib import metadata
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv, VecFrameStack, VecMonitor, VecNormalize

from steer_env.experiments.learning import held_out, policy, policy_report, training
from steer_env.experiments.learning.constants import HELD_OUT
from steer_env.experiments.learning.controllers import Maker, ZeroAction, baselines
from steer_env.experiments.learning.friction_shift_cases import (
    CANDIDATES,
    COST,
    ENTRIES,
    EPISODES,
    LAWS,
    ROBUST,
    Case,
    Entry,
)
from steer_env.experiments.learning.held_out import Estimate
from steer_env.experiments.pages import provenance
from steer_env.experiments.pages.files import write_json
from steer_env.experiments.pages.options import Friction
from steer_env.experiments.pages.pages import Page, write_page
from steer_env.experiments.pages.pictures import dots
from steer_env.experiments.sweep import Runner, run
from steer_env.friction.numerics import toml
from steer_env.registration import id_of
from steer_env.sb3 import SteerVecEnv

Array = NDArray[np.float64]

NOTHING = "zero"
PAGE_NAME, RUNS_FOLDER = "friction_shift", "runs"  # of the page, and of the folder with what is finished


class OverLaws(VecEnv):
    """The sub-environments of several environments as those of one: a policy is trained on all their laws at once.

    Parameters
    ----------
    parts : sequence of SteerVecEnv
        With the same observations.
    """

    def __init__(self, parts: Sequence[SteerVecEnv]) -> None:
        self.parts = list(parts)
        self._ends = np.cumsum([part.num_envs for part in parts])
        super().__init__(int(self._ends[-1]), parts[0].observation_space, parts[0].action_space)

    def reset(self) -> NDArray[np.float32]:
        """Start an episode in every sub-environment."""
        for part, end in zip(self.parts, self._ends):
            part._seeds = self._seeds[end - part.num_envs : end]
        self._reset_seeds()
        observations = np.concatenate([part.reset() for part in self.parts])
        self.reset_infos = [info for part in self.parts for info in part.reset_infos]
        return observations

    def step_async(self, actions: NDArray[np.float32]) -> None:
        """Keep the actions (num_envs, 1) for ``step_wait``."""
        for part, own in zip(self.parts, np.split(actions, self._ends[:-1])):
            part.step_async(own)

    def step_wait(self) -> Any:
        """Observations, rewards, whether episodes ended, infos."""
        observations, rewards, done, infos = zip(*(part.step_wait() for part in self.parts))
        every = [info for of_part in infos for info in of_part]
        return np.concatenate(observations), np.concatenate(rewards), np.concatenate(done), every

    def close(self) -> None:
        """Stop the threads of all parts."""
        for part in self.parts:
            part.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """An attribute of every sub-environment that is asked for."""
        every = [value for part in self.parts for value in part.get_attr(attr_name)]
        return [every[i] for i in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Set an attribute of all sub-environments."""
        for part in self.parts:
            part.set_attr(attr_name, value)

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]:
        """Refused, as by :class:`steer_env.sb3.SteerVecEnv`."""
        return self.parts[0].env_method(method_name)

    def env_is_wrapped(self, wrapper_class: type, indices: Any = None) -> list[bool]:
        """False for every sub-environment: none has a wrapper."""
        return [False for _ in self._get_indices(indices)]


def train(case: Case, entry: Entry, seed: int, path: Path) -> None:
    """Train a policy for the number of steps of a case, and write the last one; of a seed it is always the same one."""
    env_id, laws = id_of(case.task), entry.laws or (case.law,)
    chosen = {**training.settings(env_id, entry.algorithm)["algorithm"], **case.settings, "frames": entry.frames}
    share = max(chosen["num_envs"] // len(laws), 1)
    parts = [SteerVecEnv(env_id, share, friction=law, **case.arguments) for law in laws]
    env = VecNormalize(VecMonitor(OverLaws(parts)), gamma=chosen["gamma"])
    scaling: Any = env.obs_rms  # of a space with keys it would be a mapping
    seen = VecFrameStack(env, entry.frames) if entry.frames > 1 else env
    rate = chosen["learning_rate"]
    model = training.new_model(
        entry.algorithm, seen, {**chosen, "learning_rate": lambda left: max(left, 0.0) * rate}, seed
    )
    model.learn(case.steps)
    about = {
        "env": env_id,
        "algorithm": entry.algorithm,
        "seed": seed,
        "steps": model.num_timesteps,
        "friction": laws[0],
        "laws": laws,
        "settings": {"environment": case.arguments, "algorithm": chosen, "controller": {}},
        "observations": [quantity.name for quantity in parts[0].vector.batch.observed],
        "scaling": {
            "mean": scaling.mean.tolist(),
            "deviation": np.sqrt(scaling.var + env.epsilon).tolist(),
            "clip": env.clip_obs,
        },
        "versions": provenance.versions(),
        "trained_with": {name: metadata.version(name) for name in ("stable-baselines3", "torch")},
    }
    seen.close()
    policy.save(path, model, about)


class Job(NamedTuple):
    """A controller of a case that is driven on every law, and trained before where it is an entry of ``ENTRIES``."""

    case: str
    entry: str  # of ``ENTRIES``, the name of a baseline, or zero
    seed: int
    laws: tuple[str, ...]  # on which it is driven
    episodes: int
    first_seed: int  # of the episodes
    folder: str  # in which policies and rewards are kept

    @property
    def name(self) -> str:
        """The name of its files."""
        return f"{self.case}.{self.entry}.{self.seed}"

    @property
    def rewards_file(self) -> Path:
        """The file of its rewards; the policy lies beside it."""
        return Path(self.folder) / f"{self.name}.json"


def job_label(job: Job) -> str:
    """A job in words, for messages."""
    return job.name


def evaluate_on_laws(job: Job) -> dict[str, float]:
    """Mean reward on every law, in the same held-out episodes; empty for a baseline that refuses the case.

    What the folder holds is neither trained nor driven again.

    Raises
    ------
    ValueError
        If the folder holds the job with other settings.
    """
    case, entry = CANDIDATES[job.case], ENTRIES.get(job.entry)
    kept, path = job.rewards_file, Path(job.folder) / f"{job.name}.zip"
    identity = {
        "case": case._asdict(),
        "entry": entry and entry._asdict(),
        "episodes": job.episodes,
        "first_seed": job.first_seed,
    }
    identity = json.loads(json.dumps(identity))  # with lists in place of tuples
    found = toml.read(kept, json.loads) if kept.is_file() else {**identity, "rewards": {}}
    if others := [key for key, value in identity.items() if found.get(key) != value]:
        raise ValueError(
            f"{kept} was made with other settings ({', '.join(others)}): give another folder, or delete it"
        )
    left = [law for law in job.laws if law not in found["rewards"]]
    if not left or "refused" in found:
        return dict(found["rewards"])
    try:
        if entry is None:
            make: Maker = {NOTHING: ZeroAction, **baselines(id_of(case.task))}[job.entry]
        else:
            if not path.is_file():
                train(case, entry, job.seed, path)
            make = policy.load(path)
        found["rewards"] |= rewards(case, make, left, job.episodes, job.first_seed)
    except ValueError as error:
        if entry is not None:
            raise
        found["refused"] = str(error)
    write_json(kept, {**found, "versions": provenance.versions()})
    return dict(found["rewards"])


def rewards(
    case: Case, make: Maker, laws: Sequence[str], episodes: int, first_seed: int = HELD_OUT
) -> dict[str, float]:
    """Mean reward of a controller on every law, in the same episodes."""
    driven = partial(held_out.collect, id_of(case.task), make, episodes, first_seed, **case.arguments)
    return {law: float(driven(friction=Friction(law).parameters).reward.mean()) for law in laws}


class ShiftRow(NamedTuple):
    """An entry of a case: what it loses, as shares of the range from zero action to the best entry on each law."""

    entry: str
    laws: tuple[str, ...]  # of the training, none for a classical controller
    reward: dict[str, Estimate]  # law -> mean over the seeds
    loss: dict[str, Estimate]  # law -> mean over the seeds, with Student's interval [1]
    worst: str  # law on which it loses most in the mean
    shifted: int  # seeds in which some law costs COST more than the law of the training
    seeds: int

    @property
    def robust(self) -> bool:
        """Whether it loses less than ROBUST on every law, in the mean over the seeds."""
        return self.loss[self.worst].value < ROBUST


def rows(case: Case, found: Mapping[str, Sequence[Mapping[str, float]]]) -> list[ShiftRow]:
    """The entries of a case.

    Parameters
    ----------
    case : Case
    found : mapping
        Entry -> for each seed the mean reward on every law. The best entry on a law is that with the largest mean over
        its seeds.
    """
    laws = list(found[NOTHING][0])
    table = {name: np.array([[of[law] for law in laws] for of in seeds]) for name, seeds in found.items()}
    nothing = table[NOTHING][0]
    best = np.max([values.mean(axis=0) for values in table.values()], axis=0)
    span = np.where(best > nothing, best - nothing, np.nan)  # where nothing is the best there is no range
    made = []
    for name, values in table.items():
        losses = (best - values) / span
        entry = ENTRIES.get(name)
        trained = () if entry is None else entry.laws or (case.law,)
        home = [laws.index(law) for law in trained if law in laws]
        cost = np.nanmax(losses, axis=1) - (np.nanmax(losses[:, home], axis=1) if home else 0.0)
        made.append(
            ShiftRow(
                name,
                trained,
                {law: held_out.mean(values[:, k]) for k, law in enumerate(laws)},
                {law: held_out.mean(losses[:, k]) for k, law in enumerate(laws)},
                laws[int(np.nanargmax(losses.mean(axis=0)))],
                int((cost >= COST).sum()) if trained else 0,
                len(values),
            )
        )
    return made


class Shift(NamedTuple):
    """The benchmark, as far as it was asked for."""

    cases: dict[str, list[ShiftRow]]
    laws: tuple[str, ...]
    episodes: int
    first_seed: int  # of the episodes

    @property
    def decided(self) -> list[str]:
        """Cases in which the shift costs a policy of one law COST or more in all seeds but one at most."""
        return [
            name
            for name, made in self.cases.items()
            if any(len(row.laws) == 1 and row.shifted >= max(row.seeds - 1, 1) for row in made)
        ]

    @property
    def robust(self) -> dict[str, list[str]]:
        """Case -> the entries that lose less than ROBUST on every law."""
        return {name: [row.entry for row in made if row.robust] for name, made in self.cases.items()}


def collect(
    out: Path,
    cases: Sequence[str],
    entries: Sequence[str],
    seeds: int,
    laws: Sequence[str] = LAWS,
    episodes: int = EPISODES,
    first_seed: int = HELD_OUT,
    training_allowed: bool = True,
    notify: Callable[[float, str], None] = lambda *_: None,
    sweep: Runner = run,
) -> Shift:
    """Train and drive what is asked for, and every classical controller of the cases; what ``out`` holds is taken.

    Without ``training_allowed`` the table is of the trainings that ``out`` holds.
    """
    folder = out.resolve() / RUNS_FOLDER
    folder.mkdir(parents=True, exist_ok=True)
    asked = [(case, entry, seed) for seed in range(seeds) for case in cases for entry in entries]
    asked += [(case, name, 0) for case in cases for name in (NOTHING, *baselines(id_of(CANDIDATES[case].task)))]
    jobs = [Job(*each, tuple(laws), episodes, first_seed, str(folder)) for each in asked]
    jobs = [job for job in jobs if training_allowed or job.entry not in ENTRIES or job.rewards_file.is_file()]
    results = sweep(evaluate_on_laws, jobs, notify=notify, words=job_label)
    found: dict[str, dict[str, list[dict[str, float]]]] = {case: {} for case in cases}
    for job, rewarded in zip(jobs, results):
        if rewarded.keys() >= set(laws):
            found[job.case].setdefault(job.entry, []).append({law: rewarded[law] for law in laws})
    return Shift({case: rows(CANDIDATES[case], of) for case, of in found.items()}, tuple(laws), episodes, first_seed)


def as_json(found: Shift) -> dict[str, Any]:
    """The table as JSON."""
    return {
        "episodes": found.episodes,
        "first_seed": found.first_seed,
        "decided": found.decided,
        "robust": found.robust,
        "cases": {
            name: {"settings": CANDIDATES[name]._asdict(), "entries": [_entry(row) for row in made]}
            for name, made in found.cases.items()
        },
        "provenance": provenance.versions(),
    }


def _entry(row: ShiftRow) -> dict[str, Any]:
    """A row as JSON."""

    def of(values: Mapping[str, Estimate]) -> dict[str, Any]:
        return {law: policy_report.entry(e, "") for law, e in values.items()}

    return {**row._asdict(), "reward": of(row.reward), "loss": of(row.loss)}


def write(out: Path, found: Shift, trace: Mapping[str, Any]) -> None:
    """Write ``index.html`` and ``friction_shift.json`` beside the policies."""
    worst = {
        f"{name}, {row.entry}": row.loss[row.worst] for name, made in found.cases.items() for row in made if row.laws
    }
    values = {
        "f": found,
        "cases": CANDIDATES,
        "cost": COST,
        "robust": ROBUST,
        "picture": dots(
            worst or {"none": Estimate(0.0, 0.0, 0.0)}, "share of the range lost on the worst law [1]", (COST, "20 %")
        ),
    }
    write_page(out, Page(PAGE_NAME, values), {f"{PAGE_NAME}.json": as_json(found)}, trace)
