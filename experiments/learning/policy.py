"""Trained policies: files of Stable-Baselines3 that also hold the scaling of the observation and how they were made."""

import hashlib
import json
import math
import re
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from steer_env import REGISTERED, experiments, tasks
from steer_env.experiments.learning import network
from steer_env.experiments.learning.constants import ALGORITHMS
from steer_env.experiments.learning.script_policy import ScriptPolicy
from steer_env.experiments.pages.options import Friction
from steer_env.friction.numerics import archives, toml
from steer_env.friction.numerics.check import not_negative, number, numbers, one_of, positive, whole
from steer_env.friction.numerics.extras import install
from steer_env.registration import DRIVEN, id_of

Array = NDArray[np.float64]

DESCRIPTION_NAME = "steer_env.json"  # name in the archive, beside the members of Stable-Baselines3
# Attributes of a model that hold the schedule of its training, which would be written with all that it refers to.
SCHEDULE = ("learning_rate", "lr_schedule")
# What a description must hold, with dots between the keys.
_SHAPE: dict[str, type] = {
    **dict.fromkeys(("env", "algorithm", "friction"), str),
    **dict.fromkeys(("settings.environment", "settings.algorithm", "settings.controller", "scaling"), dict),
    **dict.fromkeys(("observations", "settings.algorithm.net_arch"), list),
}
WIDEST = 10_000  # layer of a network that is built from a description
SHIPPED_IN = Path(experiments.__file__).parent / "data" / "policies"


def algorithm(name: str) -> Any:
    """Class of an algorithm by name; ValueError for an unknown one, or if the extra ``train`` is missing."""
    if name not in ALGORITHMS:
        raise ValueError(f"unknown algorithm {name!r}; there are {', '.join(ALGORITHMS)}")
    try:
        if name == "recurrent-ppo":
            from sb3_contrib import RecurrentPPO

            return RecurrentPPO
        import stable_baselines3
    except ModuleNotFoundError as error:
        raise ValueError(f"policies need {error.name}: {install('train')}") from None
    return {"ppo": stable_baselines3.PPO, "sac": stable_baselines3.SAC}[name]


def save(path: Path, model: Any, about: dict[str, Any]) -> None:
    """Write a model with its description: environment, algorithm, scaling of the observation, how it was trained."""
    part = path.with_name(f".{path.name}.part.zip")
    model.save(part, exclude=["tensorboard_log", *SCHEDULE])  # a path of the machine that trained
    with zipfile.ZipFile(part, "a") as archive:
        archive.writestr(DESCRIPTION_NAME, json.dumps(about, indent=1, allow_nan=False))
    part.replace(path)


def described(path: Path) -> bool:
    """Whether a file has the description of ``steer-env train``, or is no archive that could lack it."""
    if not zipfile.is_zipfile(path):
        return True
    with archives.open_archive(path, "policy") as archive:
        return DESCRIPTION_NAME in archive.namelist()


def read_description(path: Path) -> dict[str, Any]:
    """The description in a policy file; ValueError for a file that ``steer-env train`` has not written."""
    try:
        with archives.open_archive(path, "policy") as archive:
            text = archive.read(DESCRIPTION_NAME)
    except FileNotFoundError:
        raise ValueError(f"no file {path}") from None
    except OSError as error:
        raise ValueError(f"{path} is no policy: {error}") from None
    except KeyError:
        raise ValueError(
            f"{path} does not say what it was trained for; `steer-env train` writes files that do, and "
            "`steer-env benchmark --env ID` takes any policy of Stable-Baselines3"
        ) from None
    found: dict[str, Any] = toml.parse_file(path, text, lambda text: _checked(json.loads(text)))
    return found


def _checked(about: Any) -> Any:
    """A description, if it holds what acting needs; ValueError names the key."""
    for place, kind in _SHAPE.items():
        value = about
        for key in place.split("."):
            value = value.get(key) if isinstance(value, dict) else None
        if not isinstance(value, kind):
            raise ValueError(f"{place} in {DESCRIPTION_NAME} must be of the type {kind.__name__}, got {value!r}")
    one_of("algorithm", about["algorithm"], ALGORITHMS)
    positive("control_dt", about["settings"]["environment"].get("control_dt"))
    for width in about["settings"]["algorithm"]["net_arch"]:
        number("net_arch", whole("net_arch", width, 1), maximum=WIDEST)
    scaling, count = about["scaling"], len(about["observations"])
    for key in ("mean", "deviation"):
        values = numbers(key, scaling.get(key))
        if values.shape != (count,) or (key == "deviation" and values.min() <= 0.0):
            raise ValueError(f"{key} must hold {count} numbers, a deviation above 0, got {values.tolist()}")
    not_negative("clip", scaling.get("clip"))
    number("frames", whole("frames", observation_frames(about), 1), maximum=WIDEST)
    if (caution := guard_caution(about)) is not None:
        not_negative("guard", caution)
    return about


def shipped_policy(env_id: str) -> Path:
    """The policy that is shipped with an id; ValueError if there is none."""
    check_id(env_id)
    path = SHIPPED_IN / env_id.removeprefix("steer_env/") / "policy.zip"
    if not path.is_file():
        raise ValueError(f"no policy is shipped with {env_id}; `steer-env train` makes one")
    return path


def learning_curves(path: Path, name: str = "policy") -> dict[str, Path]:
    """Learning curves beside a policy, label -> file: that of its own run, or one for each seed of a shipped policy."""
    own = path.with_name("learning.csv")
    seeds = sorted(path.parent.glob("seed-*.csv"))
    return {name: own} if own.is_file() else {f"{name}, {f.stem.replace('-', ' ')}": f for f in seeds}


def score(reward: float, cost: float, budget: float | None) -> float:
    """What is largest for the policy that is kept: the reward within the budget, and less the larger the cost beyond.

    The reward of an episode is -1 at least, so that every policy within the budget is better than any other.
    """
    return reward if budget is None or cost <= budget else -1.0 - cost / budget


def conditions(about: Mapping[str, Any]) -> dict[str, Any]:
    """Arguments of ``make`` in the training of a policy, except the control time, which the policy keeps itself."""
    return {key: value for key, value in about["settings"]["environment"].items() if key != "control_dt"}


def guard_caution(about: Mapping[str, Any]) -> float | None:
    """The caution of the guard with which a policy was trained (:mod:`steer_env.experiments.learning.guard`)."""
    caution: float | None = about["settings"].get("controller", {}).get("guard")
    return caution


def observation_frames(about: Mapping[str, Any]) -> int:
    """The number of observations, the last ones, that a policy sees at once."""
    frames: int = about["settings"]["algorithm"].get("frames", 1)
    return frames


def is_scaled(about: Mapping[str, Any]) -> bool:
    """Whether running statistics scaled observations and rewards in the training; not so with --library-defaults."""
    scaled: bool = about["settings"]["algorithm"].get("scaled", True)
    return scaled


class Policy:
    """A trained policy as a controller of a single or vector environment, which its ``reset`` and ``act`` serve.

    It computes a new action at the control time of its training and holds it in between.

    Parameters
    ----------
    path : Path
        From ``steer-env train``.
    env : gym.Env or gym.vector.VectorEnv
        Of the id that the policy was trained for, or of another id with the same observations.

    Raises
    ------
    ValueError
        If the file is no policy, or the environment has other observations or a control time that does not fit.
    """

    def __init__(self, path: Path, env: Any) -> None:
        self.about = read_description(path)
        spec = env.unwrapped.spec
        check_observations(
            path,
            self.about,
            spec.id if spec else type(env.unwrapped).__name__,
            [quantity.name for quantity in env.unwrapped.batch.observed],
        )
        own, step = self.about["settings"]["environment"]["control_dt"], env.unwrapped.batch.control_dt
        self._hold = round(own / step)
        if not math.isclose(self._hold * step, own):
            raise ValueError(
                f"{path} acts every {own} s; control_dt must be that or a whole fraction of it, not {step}"
            )
        import torch

        torch.set_num_threads(1)  # more threads are slower with networks of this size
        self._predict = _predictor(path, self.about)
        # The policy sees observations as in its training, in SI or over their usual sizes, in any environment.
        usual = np.array([quantity.usual for quantity in env.unwrapped.batch.observed])
        trained = usual if self.about["settings"]["environment"].get("normalise", True) else 1.0
        self._units = env.unwrapped.observation_scale / trained
        scaling = self.about["scaling"]
        self._mean, self._deviation = np.array(scaling["mean"]), np.array(scaling["deviation"])
        self._clip = number("clip", scaling["clip"], minimum=0.0)
        self._state: Any = None
        n = env.unwrapped.batch.n
        self._fresh, self._since = np.ones(n, bool), np.zeros(n, np.int64)
        self._seen = np.zeros((n, observation_frames(self.about) * self._mean.size), np.float32)  # the latest one last
        self._action = np.zeros((n, 1), np.float32)
        self._guard: Any = None
        if (caution := guard_caution(self.about)) is not None:
            from steer_env.experiments.learning.guard import Guard

            self._guard = Guard(env.unwrapped.batch, env.unwrapped.observation_scale, caution)

    def reset(self, sub_environments: Any = slice(None)) -> None:
        """Forget the episodes of some sub-environments (mask or indices), or of all."""
        self._fresh[sub_environments] = True
        self._since[sub_environments] = 0
        if self._guard is not None:
            self._guard.reset(sub_environments)

    def act(self, observation: NDArray[np.float32]) -> NDArray[np.float32]:
        """The policy's mean action (1,) for an observation (O,), or (N, 1) for (N, O)."""
        deciding = self._since % self._hold == 0
        self._since += 1
        if deciding.any():
            seen = np.atleast_2d(observation) * self._units
            seen = np.clip((seen - self._mean) / self._deviation, -self._clip, self._clip)
            self._seen[self._fresh] = 0.0
            latest = np.hstack([self._seen[:, seen.shape[1] :], seen.astype(np.float32)])
            self._seen[deciding] = latest[deciding]
            action, state = self._predict(latest, self._state, self._fresh)
            self._action[deciding] = action[deciding]
            if state is not None and self._state is not None:  # (layers, sub-environments, units)
                state = tuple(np.where(deciding[:, None], new, old) for new, old in zip(state, self._state))
            self._state = state
            self._fresh &= ~deciding
        action = self._action.copy()
        if self._guard is not None:
            action = self._guard.limited(np.atleast_2d(observation), action)
        return action[0] if observation.ndim == 1 else action


def _predictor(path: Path, about: Mapping[str, Any]) -> Callable[[Any, Any, Any], tuple[Any, Any]]:
    """A function of scaled observations, state and fresh episodes that gives mean actions and the next state."""
    if about["algorithm"] in network.FORMS:
        act = network.load(path, about)
        return lambda seen, *_: (act(seen), None)
    # Without its seed, as loading would otherwise reseed the whole process.
    model = algorithm(about["algorithm"]).load(path, device="cpu", seed=None)
    return lambda seen, state, fresh: model.predict(seen, state=state, episode_start=fresh, deterministic=True)


def caution(path: Path, about: Mapping[str, Any] | None) -> str:
    """A sentence on the risk of a policy file, with its description if it has one; empty for a shipped one."""
    if shipped_file(path):
        return ""
    read = about is not None and about["algorithm"] in network.FORMS
    here = "only its weights are read here" if read else "as it does here"
    return (
        f"{path} is not shipped with steer-env. A policy file is code, which runs when Stable-Baselines3 loads it "
        f"({here}): use files of people whom you trust"
    )


@dataclass(frozen=True)
class Load:
    """Makes the controller of a policy file for an environment, in this process or in a worker."""

    path: Path  # of a shipped policy: below ``SHIPPED_IN``, wherever that is for a worker
    digest: str  # of the file as it was

    def __call__(self, env: Any) -> Policy | ScriptPolicy:
        """The controller; ValueError if the file is not as it was, or not there."""
        path = SHIPPED_IN / self.path
        if not path.is_file() or _digest(path) != self.digest:
            raise ValueError(
                f"{path} is not there, or not as it was, where it is evaluated: put it into a folder that every worker "
                "sees, and leave it as it is"
            )
        return Policy(path, env) if described(path) else ScriptPolicy(path, env)


def load(path: Path) -> Callable[[Any], Policy | ScriptPolicy]:
    """A callable that makes the controller of a policy for an environment."""
    place = path.resolve()
    return Load(place.relative_to(SHIPPED_IN.resolve()) if shipped_file(path) else place, _digest(path))


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def shipped_file(path: Path) -> bool:
    """Whether a file is one that is shipped with the package."""
    return SHIPPED_IN.resolve() in path.resolve().parents


def check_id(env_id: str) -> None:
    """ValueError for an id that is not registered."""
    if env_id not in REGISTERED:
        known = re.fullmatch(r"(steer_env/)?(\w+?)(-v\d+)?", str(env_id))
        current = id_of(known[2]) if known else ""
        words = "it is replaced by" if known and known[1] and known[3] else "did you mean"
        replaced = f"; {words} {current}" if current in REGISTERED else ""
        raise ValueError(f"unknown environment {env_id!r}{replaced}; there are {', '.join(REGISTERED)}")


def check_driven(env_id: str) -> str:
    """Name of the task of an id; ValueError for an unknown id, or for one that tunes parameters."""
    check_id(env_id)
    if env_id not in DRIVEN:
        raise ValueError(
            f"{env_id} tunes assist parameters, one set in each step; policies are trained for: {', '.join(DRIVEN)}"
        )
    return env_id.removeprefix("steer_env/").rpartition("-")[0]


def check_observations(path: Path, about: Mapping[str, Any], env_id: str, names: list[str] | None = None) -> None:
    """ValueError if the observations of an environment (``names``, or those of the id) are not those of the policy."""
    if names is None:
        names = [quantity.name for quantity in tasks.task(check_driven(env_id)).observed]
    if names != about["observations"] and about["env"] == env_id:
        raise ValueError(f"{path} was trained with other observations than {env_id} has now: train the policy anew")
    if names != about["observations"]:
        raise ValueError(
            f"{path} was trained for {about['env']} and cannot act in {env_id}, whose observations are others: "
            f"give {about['env']}"
        )


def law(label: str, path: Path) -> Friction:
    """The friction law that a policy or a run was trained on; ValueError if it is not known here."""
    try:
        return Friction(label)
    except ValueError as error:
        raise ValueError(
            f"{path} was trained on friction {label}: {error}; for a law of your own give its module with --import"
        ) from None
