"""Training of policies with Stable-Baselines3: settings by id, checkpoints, resuming, validation.

Files of a training run, consistent at every moment at which the process may be killed.

Model and scaling of a checkpoint are named by their step, and ``state.json``, which a rename replaces, says which of
them count. The curve is replaced as a whole. The best policy is replaced by a rename after its row stands in the curve,
so that its reward is that of its own step there. A checkpoint comes before each validation: no row is ahead of the
checkpoint, and the time of a resumed run does not run back.

Checkpoints are made between two rollouts, with the episodes and the random numbers of the session: a PPO of a number
of steps that was killed and resumed ends with the weights of one that was not, to the bit. SAC goes on with an empty
memory.
"""

import csv
import inspect
import io
import json
import pickle
import random
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib import metadata
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from steer_env import experiments, tasks
from steer_env.experiments.learning import held_out, policy
from steer_env.experiments.learning.constants import CONSTRAINT, VALIDATION
from steer_env.experiments.pages import provenance
from steer_env.experiments.pages.files import usable, write_json, write_text
from steer_env.experiments.pages.options import Friction
from steer_env.friction.numerics import toml
from steer_env.friction.numerics.check import number
from steer_env.vehicle import cars

CHECKPOINT_FOLDER, STATE_FILE, CURVE_FILE, BEST_FILE, LATEST_FILE = (
    "checkpoint",
    "state.json",
    "learning.csv",
    "policy.zip",
    "latest.zip",
)
STATE_KEYS = ("env", "algo", "seed", "friction", "seconds", "steps", "next", "model", "scaling", "session")


def save(out: Path, state: Mapping[str, Any], model: Any, scaling: Any, session: Any) -> None:
    """Write what resuming needs; ``state`` has the entries of ``STATE_KEYS`` but for the three file names."""
    folder = out / CHECKPOINT_FOLDER
    folder.mkdir(exist_ok=True)
    steps = state["steps"]
    names = {"model": f"model-{steps}.zip", "scaling": f"scaling-{steps}.pkl", "session": f"session-{steps}.pkl"}
    if not (folder / STATE_FILE).is_file() or load(out)["steps"] != steps:  # else these files are in use, and right
        model.save(folder / names["model"], exclude=policy.SCHEDULE)
        scaling.save(str(folder / names["scaling"]))
        (folder / names["session"]).write_bytes(pickle.dumps(session))
    write_json(folder / STATE_FILE, {**state, **names})
    for path in folder.iterdir():
        if path.name not in (STATE_FILE, *names.values()):
            path.unlink()


def load(out: Path) -> dict[str, Any]:
    """State of a run at its checkpoint; ValueError if there is none or something is missing."""
    kept = out / CHECKPOINT_FOLDER / STATE_FILE
    if not kept.is_file():
        raise ValueError(f"{out} holds no checkpoint to resume")
    state = toml.read(kept, json.loads)
    if not isinstance(state, dict):
        raise ValueError(f"{kept} must hold keys and values, got {state!r}")
    for key in STATE_KEYS:
        if key not in state:
            raise ValueError(f"{kept} has no entry {key}, as with older versions: train from the start")
    return state


def finished_steps(out: Path) -> int:
    """Steps from which a training goes on where it is resumed; 0 where it begins anew."""
    return int(load(out)["steps"]) if (out / CHECKPOINT_FOLDER / STATE_FILE).is_file() else 0


def write_rows(path: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """Write a table, which appears or is replaced as a whole; nothing where there is no row."""
    if rows:
        text = io.StringIO(newline="")
        writer = csv.DictWriter(text, rows[0], lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
        write_text(path, text.getvalue())


def append(out: Path, row: Mapping[str, Any]) -> None:
    """Add a row to the curve."""
    path, text = out / CURVE_FILE, io.StringIO(newline="")
    writer = csv.DictWriter(text, row, lineterminator="\n")
    if not path.exists():
        writer.writeheader()
    writer.writerow(row)
    write_text(path, (path.read_text(encoding="utf-8") if path.exists() else "") + text.getvalue())


def best(out: Path, budget: float | None = None) -> float:
    """Score of the best policy when it was validated (:func:`policy.score`); minus infinity where there is none."""
    if not (out / BEST_FILE).is_file():
        return -np.inf
    steps = policy.read_description(out / BEST_FILE)["steps"]
    with (out / CURVE_FILE).open(encoding="utf-8", newline="") as file:
        rows = [row for row in csv.DictReader(file) if int(row["steps"]) == steps]
    return max(policy.score(float(row["reward"]), float(row["cost"]), budget) for row in rows)


def last_validation(out: Path) -> int:
    """Steps at which a policy was validated last, to the end; -1 where none was."""
    if not (out / CURVE_FILE).is_file() or (out / LATEST_FILE).is_file():
        return -1
    with (out / CURVE_FILE).open(encoding="utf-8", newline="") as file:
        return max((int(row["steps"]) for row in csv.DictReader(file)), default=-1)


def _random_state() -> tuple[Any, ...]:
    """Of all generators from which Stable-Baselines3 draws."""
    import torch

    return random.getstate(), np.random.get_state(), torch.get_rng_state()  # noqa: NPY002


def _set_random_state(state: tuple[Any, ...]) -> None:
    import torch

    random.setstate(state[0])
    np.random.set_state(state[1])  # noqa: NPY002
    torch.set_rng_state(state[2])


@contextmanager
def _random_state_kept() -> Iterator[None]:
    """Leaves the generators as they were."""
    state = _random_state()
    try:
        yield
    finally:
        _set_random_state(state)


# Intervals of wall time; a checkpoint takes a fraction of a second, a validation some seconds.
CHECKPOINT_EVERY, VALIDATE_EVERY = 60.0, 60.0  # [s]
# With a given number of steps the interval is in steps, so that the policy that is kept does not depend on the machine.
VALIDATE_STEPS = 200_000
VALIDATED = 32  # episodes of each validation
# Exploration noise has a cost too: with a budget it begins at 0.14 of the action; by trial in AssistWeave.
BUDGET_NOISE = -2.0  # log of its standard deviation
# A training with the defaults of Stable-Baselines3: sub-environments, and the sizes of the networks there.
LIBRARY_ENVS, LIBRARY_NETWORKS = 4, {"ppo": [64, 64], "recurrent-ppo": [64, 64], "sac": [256, 256]}


def settings(env_id: str, algo: str) -> dict[str, Any]:
    """Settings of an id for an algorithm, from data files.

    ``environment`` has arguments of make, ``algorithm`` those of the algorithm, and ``controller`` may have ``guard``,
    the caution of a guard around an assist (:mod:`steer_env.experiments.learning.guard`).

    The settings of an id override those of all driver or all assist ids, which override those of all ids; what is drawn
    does so name by name.

    Raises
    ------
    ValueError
        For an unknown id or algorithm.
    """
    policy.algorithm(algo)
    found: dict[str, Any] = {"environment": _environment(env_id), "algorithm": {}, "controller": {}}
    for given in _settings_of(env_id):
        found["algorithm"] |= given.get(algo, {})
        found["controller"] |= given.get("controller", {})
    return found


def conditions(env_id: str) -> dict[str, Any]:
    """Arguments of make in the training of an id, except the control time: what it draws in every episode."""
    return policy.conditions({"settings": {"environment": _environment(env_id)}})


def _environment(env_id: str) -> dict[str, Any]:
    """Arguments of make in the training of an id; of what is drawn, each file overrides the names that it has."""
    found: dict[str, Any] = {}
    drawn: dict[str, Any] = {}
    for environment in (given.get("environment", {}) for given in _settings_of(env_id)):
        found |= environment
        drawn |= environment.get("randomise", {})
    return {**found, "randomise": drawn} if drawn else found


def _settings_of(env_id: str) -> list[dict[str, Any]]:
    """Contents of the data files that hold for an id, its own last; ValueError for an unknown id."""
    policy.check_id(env_id)
    name = env_id.removeprefix("steer_env/")
    folder = files(experiments) / "data" / "training"
    role = next((role for role in ("driver", "assist") if name.lower().startswith(role)), "")
    paths = [folder / f"{file}.toml" for file in ("default", role, name)]
    return [toml.loads(path.read_text(encoding="utf-8")) for path in paths if path.is_file()]


def library_settings(env_id: str, algo: str) -> dict[str, Any]:
    """Settings in which everything is Stable-Baselines3's own default, at an id's default settings.

    Only the number of sub-environments is chosen, for the wall time. Nothing is scaled but by the environment itself.
    """
    rate = inspect.signature(policy.algorithm(algo)).parameters["learning_rate"].default
    return {
        "environment": {"control_dt": tasks.task(policy.check_driven(env_id)).control_dt},
        "algorithm": {
            "num_envs": LIBRARY_ENVS,
            "net_arch": LIBRARY_NETWORKS[algo],
            "learning_rate": rate,
            "scaled": False,
        },
        "controller": {},
    }


def new_model(algo: str, env: Any, chosen: dict[str, Any], seed: int, logs: str | None = None) -> Any:
    """A new model of Stable-Baselines3 with the settings of an id."""
    import torch

    torch.set_num_threads(1)  # more threads are slower with networks of this size
    own = {"num_envs", "net_arch", "policy_kwargs", "learning_rate_decay", "scaled", "frames", "cost_budget"}
    return policy.algorithm(algo)(
        "MlpLstmPolicy" if algo == "recurrent-ppo" else "MlpPolicy",
        env,
        seed=seed,
        device="cpu",
        policy_kwargs={"net_arch": chosen["net_arch"], **chosen.get("policy_kwargs", {})},
        tensorboard_log=logs,
        **{key: value for key, value in chosen.items() if key not in own},
    )


def time_steps(env_id: str, num_envs: int, **arguments: Any) -> Any:
    """A ``SteerVecEnv`` that counts the wall time of its steps, resets included, in ``spent`` [s]."""
    from steer_env.sb3 import SteerVecEnv

    class Timed(SteerVecEnv):
        spent = 0.0

        def step_wait(self) -> Any:
            start = time.perf_counter()
            found = super().step_wait()
            self.spent += time.perf_counter() - start
            return found

    return Timed(env_id, num_envs, **arguments)


def _checkpoint(out: Path) -> dict[str, Any]:
    """State of a run at its checkpoint, with its ``settings``; ValueError if something is missing."""
    state, chosen = load(out), out / "settings.json"
    if not chosen.is_file():
        raise ValueError(f"{out} holds a checkpoint but no settings.json, without which it cannot be resumed")
    read = toml.read(chosen, json.loads)
    parts = ("environment", "algorithm", "controller")
    if not isinstance(read, dict) or not all(isinstance(read.get(key), dict) for key in parts):
        raise ValueError(f"{chosen} must hold keys and values under {', '.join(parts)}")
    return {**state, "settings": {key: read[key] for key in parts}}


class _Clock:
    """Ends the training after a time or a number of steps, and triggers checkpoints and validations on the way."""

    def __init__(
        self, run: "Training", minutes: float | None, steps: int | None, notify: Callable[[float, str], None]
    ) -> None:
        self._run, self._minutes, self._steps, self._notify = run, minutes, steps, notify
        self._begun = time.monotonic()
        self._saved = self._begun

    @property
    def elapsed(self) -> float:
        """Wall time of training in all sessions, without validations [s]."""
        return self._run.seconds + time.monotonic() - self._begun

    def _part(self, model: Any) -> float:
        return self.elapsed / (60.0 * self._minutes) if self._minutes else model.num_timesteps / (self._steps or 1)

    def pause(self, model: Any) -> None:
        """Between two rollouts: validate and keep a checkpoint where they are due."""
        part = self._part(model)
        if part >= self._run.next_validation:
            begin, elapsed = time.monotonic(), self.elapsed
            self._run.checkpoint(model, elapsed)
            if self._run.validated != model.num_timesteps:
                self._run.validate(model, elapsed)  # of the checkpoint, so that a resumed run never goes back
            self._begun += time.monotonic() - begin
            every = VALIDATE_EVERY / (60.0 * self._minutes) if self._minutes else VALIDATE_STEPS / (self._steps or 1)
            self._run.next_validation = part + every
            self._saved = time.monotonic()
        elif time.monotonic() - self._saved >= CHECKPOINT_EVERY:
            self._run.checkpoint(model, self.elapsed)
            self._saved = time.monotonic()

    def goes_on(self, model: Any) -> bool:
        """Whether the training goes on after a step."""
        self._run.part = part = self._part(model)
        self._notify(min(part, 1.0), f"{model.num_timesteps} steps")
        return part < 1.0


class Training:
    """One run of training, kept in a directory.

    Parameters
    ----------
    env_id : str
    algo : {"ppo", "sac", "recurrent-ppo"}, optional
        Default: that of the checkpoint, or else "ppo".
    out : Path
        Directory for ``policy.zip`` (the best by validation), ``learning.csv``, ``settings.json``, ``checkpoint/`` and
        ``tensorboard/``.
    seed : int, optional
        Default: that of the checkpoint, or else 0.
    resume : bool
        Continue from the checkpoint in ``out``, with its settings.
    friction : Friction, optional
        Law to train on; default: that of the checkpoint, or else LuGre.
    library : bool
        Use :func:`library_settings` instead of the settings of the id.

    car : mapping, optional
        Contents of a car file to train on, for a new run; default: the packaged compact car.
    cost_budget : float, optional
        Of the cost of an episode, which a Lagrange multiplier keeps, for a new run; default: the reward alone counts.

    Raises
    ------
    ValueError
        If the directory holds a run that is not to be resumed, or none to resume, or if the checkpoint is of another
        id, algorithm, seed or law.
    """

    def __init__(
        self,
        env_id: str,
        algo: str | None,
        out: Path,
        *,
        seed: int | None = None,
        resume: bool = False,
        friction: Friction | None = None,
        library: bool = False,
        car: Mapping[str, Any] | None = None,
        cost_budget: float | None = None,
    ) -> None:
        policy.check_driven(env_id)
        state: dict[str, Any] = {"algo": "ppo", "seed": 0}
        self.seconds, self.best, self.validated = 0.0, -np.inf, -1  # the last in steps
        self.part = 0.0  # of the training that is done, in all sessions
        self.told = ""  # how long this session took, and what share of it the environments
        self.next_validation = 0.0  # the part at which it is due; the first one is of the untrained policy
        self._resume, self._trained = resume, 0
        if resume:
            state = _checkpoint(out)
            asked = {"env": env_id, "algo": algo, "seed": seed, "friction": friction and friction.text}
            for key, value in asked.items():
                if value is not None and state[key] != value:
                    raise ValueError(
                        f"the checkpoint in {out} is of {key} {state[key]}, not {value}: resume with "
                        f"--{key} {state[key]}, or train in another directory"
                    )
            budget = state["settings"]["algorithm"].get("cost_budget")
            if cost_budget not in (None, budget):
                raise ValueError(f"a resumed run keeps its cost_budget, here {budget}, got {cost_budget}")
            self.seconds, self._trained = state["seconds"], state["steps"]
            self.validated, self.next_validation = last_validation(out), state["next"]
        else:
            usable(out)
            if out.exists() and any(out.iterdir()):
                raise ValueError(f"{out} is not empty: give a new directory, or resume the run in it")
        self.env_id, self.out = env_id, out
        self.algo: str = algo or state["algo"]
        self.seed: int = state["seed"] if seed is None else seed
        self._files = state
        own = library_settings if library else settings
        self.settings: dict[str, Any] = state["settings"] if resume else own(env_id, self.algo)
        if car is not None and not resume:
            self.settings = {**self.settings, "environment": {**self.settings["environment"], "vehicle": dict(car)}}
        self.friction = friction or (policy.law(state["friction"], out) if resume else Friction(self._usual_friction))
        if cost_budget is not None and not resume:
            if self.algo == "sac":
                raise ValueError(
                    "cost_budget needs an algorithm that trains on rollouts, ppo or recurrent-ppo, got sac"
                )
            chosen = self.settings["algorithm"]
            chosen["cost_budget"] = number("cost_budget", cost_budget, minimum=0.0, above=True)
            if not library:
                chosen["policy_kwargs"] = {**chosen.get("policy_kwargs", {}), "log_std_init": BUDGET_NOISE}
        if resume:
            self.best = best(out, self._budget)

    def run(
        self,
        minutes: float | None = None,
        steps: int | None = None,
        notify: Callable[[float, str], None] = lambda *_: None,
    ) -> None:
        """Train for a time or for a number of steps, both of all sessions together.

        A run of a number of steps can be repeated to the bit. A run that ends early leaves a checkpoint of its last
        minute. One that is resumed where the checkpoint has reached the length trains no more, and validates what was
        not yet validated; with a greater length it goes on with new episodes.

        Parameters
        ----------
        minutes : float, optional
            Wall time of training, without validations [min].
        steps : int, optional
            Environment steps, summed over the sub-environments, at least 1.
        notify : callable
            Receives the part that is done and a text.

        Raises
        ------
        ValueError
            If both or none of the lengths are given, or one is out of range.
        """
        from stable_baselines3.common.callbacks import BaseCallback

        reached = self._is_long_enough(minutes, steps)
        model = self._model()
        # Only here, so that an error above leaves nothing behind.
        self.out.mkdir(parents=True, exist_ok=True)
        if not self._resume:
            write_json(self.out / "settings.json", {**self._identity, **self.settings})
        run, clock = self, _Clock(self, minutes, steps, notify)
        self._command = self._words(f"--minutes {minutes:g}" if minutes else f"--steps {steps}")

        class Callback(BaseCallback):
            """Passes each rollout and step to the clock."""

            def _on_rollout_start(self) -> None:
                run.update(self.model)
                clock.pause(self.model)

            def _on_step(self) -> bool:
                return clock.goes_on(self.model)

        seconds, before = self.seconds, model.num_timesteps
        try:
            if reached:
                notify(1.0, f"{model.num_timesteps} steps, which were reached before")
            else:
                model.learn(10**12, callback=Callback(), reset_num_timesteps=not self._resume, tb_log_name=self.algo)
                seconds = clock.elapsed
                self.told = (
                    f"{model.num_timesteps - before:,} steps in {seconds - self.seconds:.0f} s, of which the "
                    f"environments took {self._raw.spent / (seconds - self.seconds):.0%}"
                )
                self.checkpoint(model, seconds, within=True)
        finally:
            self._raw.close()
        if self.validated != model.num_timesteps:
            self.validate(model, seconds)

    def _model(self) -> Any:
        """The model, new or that of the checkpoint, in its environments."""
        from stable_baselines3.common.vec_env import VecMonitor, VecNormalize

        from steer_env.experiments.learning.guard import GuardedVecEnv
        from steer_env.experiments.learning.lagrange import PenalisedVecEnv

        chosen = self.settings["algorithm"]
        self._raw = time_steps(
            self.env_id, chosen["num_envs"], friction=self.friction.parameters, **self.settings["environment"]
        )
        self._observations = [quantity.name for quantity in self._raw.vector.batch.observed]
        caution = policy.guard_caution({"settings": self.settings})
        self._guarded = None if caution is None else GuardedVecEnv(self._raw, caution)
        monitored: Any = VecMonitor(self._guarded or self._raw)
        self._penalised = None
        if self._budget is not None:
            monitored = self._penalised = PenalisedVecEnv(monitored, self._budget)
        if not self._resume:
            scaled = policy.is_scaled({"settings": self.settings})
            self._env = VecNormalize(monitored, scaled, scaled, gamma=chosen.get("gamma", 0.99))
            scheduled = {**chosen, "learning_rate": self.learning_rate}
            return new_model(self.algo, self._env, scheduled, self.seed, str(self.out / "tensorboard"))
        kept = {key: self.out / CHECKPOINT_FOLDER / self._files[key] for key in ("model", "scaling", "session")}
        self._env = VecNormalize.load(str(kept["scaling"]), monitored)
        session = pickle.loads(kept["session"].read_bytes())
        if self._penalised:
            self._penalised.set_state(self._files["constraint"])
        model = policy.algorithm(self.algo).load(
            kept["model"],
            env=self._env,
            device="cpu",
            # Another seed, as the episodes of a session that reached its end would otherwise be drawn again.
            seed=(self.seed + self._trained) % 2**32,
            learning_rate=self.learning_rate,
            force_reset=session is None,
        )
        if session is not None:
            self._continue(model, session)
        return model

    def _words(self, length: str) -> str:
        """The command that trains so."""
        words = f"steer-env train --env {self.env_id} --algo {self.algo} --seed {self.seed} {length}"
        if not policy.is_scaled({"settings": self.settings}):
            words += " --library-defaults"
        if self._budget is not None:
            words += f" --cost-budget {self._budget:g}"
        if self.friction.text != self._usual_friction:
            words += f" --friction {self.friction.text}"
        return words + " --resume" * self._resume

    def learning_rate(self, _: float) -> float:
        """The learning rate of an update, as a schedule of Stable-Baselines3.

        Its argument, the part of the steps that is left, is not used: Stable-Baselines3 knows no length in minutes.
        """
        chosen = self.settings["algorithm"]
        left = max(1.0 - self.part, 0.0) if chosen.get("learning_rate_decay") else 1.0
        return left * float(chosen["learning_rate"])

    def _is_long_enough(self, minutes: float | None, steps: int | None) -> bool:
        """Whether the checkpoint has reached a length; ValueError unless exactly one is given, in its range."""
        if (minutes is None) == (steps is None):
            raise ValueError("give minutes or steps")
        if minutes is not None:
            return self.seconds >= 60.0 * number("minutes", minutes, minimum=0.0, above=True)
        return number("steps", steps, minimum=1.0) <= self._trained

    @property
    def _budget(self) -> float | None:
        """Of the cost of an episode, if there is one [1]."""
        budget: float | None = self.settings["algorithm"].get("cost_budget")
        return budget

    @property
    def _usual_friction(self) -> str:
        """The friction of the car as text."""
        return cars.load(self.settings["environment"].get("vehicle", "compact")).friction

    @property
    def _identity(self) -> dict[str, Any]:
        return {"env": self.env_id, "algo": self.algo, "seed": self.seed, "friction": self.friction.text}

    def _about(self, model: Any) -> dict[str, Any]:
        return {
            "env": self.env_id,
            "algorithm": self.algo,
            "seed": self.seed,
            "steps": model.num_timesteps,
            "command": self._command,
            "friction": self.friction.text,
            "settings": self.settings,
            "observations": self._observations,
            "scaling": self._scaling(),
            "versions": {**provenance.versions(), "random_numbers": f"seed {self.seed}"},
            "trained_with": {name: metadata.version(name) for name in ("stable-baselines3", "torch")},
        }

    def _scaling(self) -> dict[str, Any]:
        """How the policy's observations are scaled, on those of the environment."""
        space: Any = self._env.observation_space
        if not policy.is_scaled({"settings": self.settings}):
            n, most = space.shape[0], float(space.high.max())
            return {"mean": [0.0] * n, "deviation": [1.0] * n, "clip": most}
        found: Any = self._env.obs_rms
        deviation = np.sqrt(found.var + self._env.epsilon)
        return {"mean": found.mean.tolist(), "deviation": deviation.tolist(), "clip": self._env.clip_obs}

    def _session(self, model: Any) -> dict[str, Any]:
        """What decides, beside model and scaling, how a training goes on after a rollout."""
        return {
            "episodes": self._raw.vector.unwrapped.get_state(),
            "guard": self._guarded and self._guarded.get_state(),
            "returns": self._env.returns,
            "hidden": getattr(model, "_last_lstm_states", None),
            "random": _random_state(),
        }

    def _continue(self, model: Any, session: Mapping[str, Any]) -> None:
        """Go on from a session."""
        self._raw.vector.unwrapped.set_state(session["episodes"])
        if self._guarded:
            self._guarded.set_state(session["guard"])
        self._env.returns = session["returns"]
        if session["hidden"] is not None:
            model._last_lstm_states = session["hidden"]
        _set_random_state(session["random"])

    def update(self, model: Any) -> None:
        """Between two rollouts: update the multiplier of the cost, if there is a budget."""
        if self._penalised:
            self._penalised.update(model.num_timesteps)

    def checkpoint(self, model: Any, seconds: float, within: bool = False) -> None:
        """Write what resuming needs; ``within`` a rollout its session cannot go on, and a new one begins."""
        state = {**self._identity, "steps": model.num_timesteps, "seconds": seconds, "next": self.next_validation}
        if self._penalised:
            self.update(model)
            state["constraint"] = self._penalised.get_state()
        save(self.out, state, model, self._env, None if within else self._session(model))
        if self._penalised:
            write_rows(self.out / CONSTRAINT, [row._asdict() for row in self._penalised.rows])

    def validate(self, model: Any, seconds: float) -> None:
        """Evaluate the present policy on the validation seeds, and keep it if it is the best so far."""
        latest = self.out / LATEST_FILE
        policy.save(latest, model, self._about(model))
        with _random_state_kept():
            found = held_out.collect(
                self.env_id,
                policy.load(latest),
                VALIDATED,
                VALIDATION,
                friction=self.friction.parameters,
                **policy.conditions({"settings": self.settings}),
            )
        self.validated = model.num_timesteps
        reward, cost = float(found.reward.mean()), float(found.cost.mean())
        row = {
            "seconds": round(seconds, 1),
            "steps": model.num_timesteps,
            "reward": reward,
            "cost": cost,
        }
        row |= {name: float(values.mean()) for name, values in found.metrics.items()}
        append(self.out, row)
        if (score := policy.score(reward, cost, self._budget)) > self.best:
            self.best = score
            latest.replace(self.out / BEST_FILE)
        else:
            latest.unlink()
