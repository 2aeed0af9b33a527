"""A policy that a script of one's own saved by Stable-Baselines3's ``model.save``, as a controller.

Its file says neither the id, the control time nor what scaled the observations: it is taken to see what the environment
gives, and to act at every step.
"""

import json
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray


def training_steps(path: Path) -> int:
    """Steps of training of a saved model, read without running what its file holds; ValueError where it is none."""
    try:
        with zipfile.ZipFile(path) as archive:
            return int(json.loads(archive.read("data"))["num_timesteps"])
    except (zipfile.BadZipFile, KeyError, TypeError, ValueError) as error:
        raise ValueError(f"{path} is no policy of Stable-Baselines3, as its model.save writes it: {error!r}") from None


def _model(path: Path) -> Any:
    """The model in a file, by the class of its policy; ValueError for one that no known algorithm has."""
    import sb3_contrib
    import stable_baselines3
    from stable_baselines3.common.save_util import load_from_zip_file

    data: Any = load_from_zip_file(path, device="cpu")[0]
    kind = data["policy_class"]
    # A policy of RecurrentPPO is one of PPO, too. PPO also stands for A2C and TRPO, TD3 for DDPG: they act alike.
    algorithms = (
        *(getattr(sb3_contrib, name) for name in ("RecurrentPPO", "TQC", "CrossQ", "ARS")),
        *(getattr(stable_baselines3, name) for name in ("SAC", "TD3", "PPO")),
    )
    for algorithm in algorithms:
        if issubclass(kind, tuple(algorithm.policy_aliases.values())):
            return algorithm.load(path, device="cpu", seed=None)  # else loading reseeds the whole process
    names = ", ".join(algorithm.__name__ for algorithm in algorithms)
    raise ValueError(f"{path} has a policy of {kind.__name__}, which is of none of {names}")


class ScriptPolicy:
    """The deterministic actions of a saved model in a vector environment.

    Raises
    ------
    ValueError
        The file is no such policy, or its spaces are not those of the environment.
    """

    def __init__(self, path: Path, env: Any) -> None:
        import torch

        torch.set_num_threads(1)  # more threads are slower with networks of the usual size
        self._model = _model(path)
        for what in ("observation", "action"):
            own, given = getattr(self._model, f"{what}_space"), getattr(env, f"single_{what}_space")
            if own != given:
                raise ValueError(
                    f"{path} was trained with the {what} space {own}, and {env.unwrapped.spec.id} has {given}: give "
                    "the id of its training at its default settings; a policy behind a wrapper is entered by a class "
                    "that applies it (examples/own_wrapper.py has one)"
                )
        self._state: Any = None
        self._fresh = np.ones(env.num_envs, bool)

    def reset(self, sub_environments: Any = slice(None)) -> None:
        """Forget the episodes of some sub-environments (mask or indices), or of all."""
        self._fresh[sub_environments] = True

    def act(self, observation: NDArray[np.float32]) -> NDArray[np.float32]:
        """Actions (N, n) for observations (N, O)."""
        action, self._state = self._model.predict(
            observation, state=self._state, episode_start=self._fresh, deterministic=True
        )
        self._fresh[:] = False
        return np.asarray(action)
