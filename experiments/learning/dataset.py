"""Data sets of episodes in Minari's format, with costs, for learning without an environment. Extra ``datasets``."""

import os
import re
import shutil
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from importlib import metadata
from pathlib import Path
from typing import Any

import gymnasium as gym
import minari
import numpy as np
from minari.data_collector import EpisodeBuffer

from steer_env import friction
from steer_env.engine.infos import require_full
from steer_env.engine.specification import plain
from steer_env.experiments.learning import held_out
from steer_env.experiments.learning.constants import QUALITIES
from steer_env.experiments.learning.controllers import Maker, ZeroAction
from steer_env.experiments.pages import provenance
from steer_env.experiments.pages.files import replaced_directory

DATA_FOLDER = "data"  # the folder that minari.MinariDataset opens
CONTENTS = frozenset({DATA_FOLDER})


def record(
    out: Path,
    env_id: str,
    name: str,
    make: Maker,
    episodes: int,
    first_seed: int,
    notify: Callable[[float, str], None] = lambda *_: None,
    quality: str | None = None,
    **arguments: Any,
) -> None:
    """Record a controller in episodes of an id, one for each seed from ``first_seed`` on.

    ``minari.MinariDataset(out / "data")`` opens the set. Its infos are the cost and the terms of reward and cost, zero
    at the reset. The metadata of an episode are its seed, its conditions and its metrics; those of the set the friction
    law and the arguments of the environment, which ``recover_environment()`` makes again. The actions replayed from the
    seed of an episode give its observations and rewards to the bit.

    Parameters
    ----------
    out : Path
        Directory of the set, which appears or is replaced as a whole.
    env_id, name : str
        Id of a driver's or assist's task, and a name for the controller.
    make : callable
        Makes the controller for an environment.
    episodes, first_seed : int
        Number of episodes, and the seed of the first.
    notify : callable
        Receives the part that is done and a text.
    quality : str, optional
        Of :data:`QUALITIES`: how much random action is mixed in. The metadata then hold it, the share, and for
        ``minari.get_normalized_score`` the mean rewards of zero action and the controller alone on the same seeds.
    arguments :
        Of ``gymnasium.make``.

    Raises
    ------
    ValueError
        An ``info_level`` without what the set holds.
    """
    require_full(arguments.get("info_level", "full"), "a data set, which holds costs, terms and conditions")
    env: Any = gym.make(env_id, **arguments)
    controller, share = make(env), QUALITIES[quality] if quality else 0.0
    buffers, about = [], []
    for k in range(episodes):
        notify(k / episodes, f"episode {k}")
        found, conditions = _episode(env, controller, first_seed + k, share)
        buffers.append(found)
        about.append(conditions)
    task, law = env.unwrapped.task.name, arguments.get("friction") or env.unwrapped.batch.car.friction
    described = {
        "friction": friction.as_mapping(friction.resolve(law)),
        "arguments": plain(arguments),
        "controller": name,
        "versions": provenance.versions(),
    }
    if quality:
        described |= {"quality": quality, "random_share": share}
        for key, who in (("ref_min_score", ZeroAction), ("ref_max_score", make)):
            described[key] = float(held_out.collect(env_id, who, episodes, first_seed, **arguments).reward.mean())
    with replaced_directory(out, CONTENTS) as part, _datasets_in(part), warnings.catch_warnings():
        # Author and link are for whoever publishes the set to add, with dataset.storage.update_metadata.
        warnings.simplefilter("ignore", UserWarning)
        written = minari.create_dataset_from_buffers(
            f"{task}-{re.sub(r'[^-a-zA-Z0-9_]', '_', quality or name)}-v0",
            buffers,
            env=env,
            algorithm_name=name,
            description=f"{episodes} episodes of {env_id} from seed {first_seed} on, driven by {name}"
            + (f", with a share of {share:g} of random action." if share else "."),
            requirements=[f"steer-env=={metadata.version('steer-env')}"],
        )
        written.storage.update_metadata(described)
        written.storage.update_episode_metadata(about)
        data = Path(written.storage.data_path)
        data.rename(part / DATA_FOLDER)
        shutil.rmtree(data.parent)
    env.close()


def mean_score(out: Path) -> tuple[float, float]:
    """Mean score and mean cost of the episodes of a set that has a quality."""
    kept = minari.MinariDataset(out / DATA_FOLDER)
    reward, cost = np.transpose([(e.rewards.sum(), e.infos["cost"].sum()) for e in kept.iterate_episodes()])
    return float(minari.get_normalized_score(kept, reward).mean()), float(cost.mean())


def _episode(env: Any, controller: Any, seed: int, share: float) -> tuple[EpisodeBuffer, dict[str, float]]:
    """An episode with a share of random action, and its conditions and metrics."""
    task = env.unwrapped.task
    terms = {"reward_terms": [t.name for t in task.rewards], "cost_terms": [t.name for t in task.costs]}
    infos: list[dict[str, Any]] = [{"cost": 0.0, **{key: dict.fromkeys(names, 0.0) for key, names in terms.items()}}]
    rng = np.random.default_rng([seed, 1])  # the seed alone would give the numbers that the environment draws
    controller.reset()
    observation, info = env.reset(seed=seed)
    about = _numbers("conditions", info)
    observations, actions, rewards = [observation], [], []
    terminated = truncated = False
    while not (terminated or truncated):
        action = np.clip(controller.act(observation), -1.0, 1.0)
        if share:
            action = ((1.0 - share) * action + share * rng.uniform(-1.0, 1.0, action.shape)).astype(np.float32)
        actions.append(action)
        observation, reward, terminated, truncated, info = env.step(actions[-1])
        observations.append(observation)
        rewards.append(reward)
        infos.append(info)
    last = np.arange(len(rewards)) == len(rewards) - 1
    columns = {key: {t: np.array([i[key][t] for i in infos]) for t in names} for key, names in terms.items()}
    buffer = EpisodeBuffer(
        seed=seed,
        observations=np.array(observations),
        actions=np.array(actions),
        rewards=np.array(rewards),
        terminations=last & terminated,
        truncations=last & truncated,
        infos={"cost": np.array([i["cost"] for i in infos]), **columns},
    )
    return buffer, about | _numbers("metrics", info)


def _numbers(key: str, info: Mapping[str, Any]) -> dict[str, float]:
    """The numbers under a key of an info, named as Minari flattens dictionaries."""
    return {f"{key}/{name}": float(value) for name, value in info[key].items() if isinstance(value, float | int)}


@contextmanager
def _datasets_in(folder: Path) -> Iterator[None]:
    """Minari writes sets into the folder that a variable of the environment names."""
    variable = "MINARI_DATASETS_PATH"
    before = os.environ.get(variable)
    os.environ[variable] = str(folder)
    try:
        yield
    finally:
        if before is None:
            del os.environ[variable]
        else:
            os.environ[variable] = before
