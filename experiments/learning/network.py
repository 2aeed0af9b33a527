"""The deterministic network of a policy file from its weights alone, without unpickling, which can run code.

A file of Stable-Baselines3 has its settings pickled in the member ``data`` and the weights as tensors in
``policy.pth``. Here the layers are built from the description that ``steer-env train`` adds as JSON, and only the
tensors are read, with ``weights_only=True``.
"""

import io
from collections.abc import Callable, Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.friction.numerics import archives

# What torch raises at weights that were changed, and what those of another shape raise here.
_DAMAGED = (LookupError, RuntimeError, EOFError, ValueError, TypeError, AttributeError)


class Form(NamedTuple):
    """How Stable-Baselines3 builds and names the network of an algorithm's actions."""

    hidden: str  # prefix of the hidden layers, which are numbered with the functions between them
    last: str
    activation: str  # name in torch.nn, of the hidden layers
    squashed: bool  # whether the hyperbolic tangent bounds the action, which is clipped otherwise


FORMS = {
    "ppo": Form("mlp_extractor.policy_net", "action_net", "Tanh", False),
    "sac": Form("actor.latent_pi", "actor.mu", "ReLU", True),
}


def load(path: Path, about: Mapping[str, Any]) -> Callable[[NDArray[np.float32]], NDArray[np.float32]]:
    """A function of scaled observations (N, O) that gives the mean actions (N, 1) in [-1, 1].

    Its results are those of Stable-Baselines3's ``predict(..., deterministic=True)`` to the bit.

    Parameters
    ----------
    path : Path
        A policy file of an algorithm in ``FORMS``.
    about : mapping
        Its description, from :func:`steer_env.experiments.learning.policy.about`.

    Raises
    ------
    ValueError
        The weights cannot be read without running code, or are not those that the description tells.
    """
    import pickle

    import torch

    form = FORMS[about["algorithm"]]
    seen = len(about["observations"]) * about["settings"]["algorithm"].get("frames", 1)
    sizes = [seen, *about["settings"]["algorithm"]["net_arch"], 1]
    layers = [torch.nn.Linear(n, m) for n, m in pairwise(sizes)]
    names = [*(f"{form.hidden}.{2 * k}" for k in range(len(layers) - 1)), form.last]
    try:
        with archives.opened(path, "policy") as archive:
            weights = io.BytesIO(archive.read("policy.pth"))
        tensors = torch.load(weights, map_location="cpu", weights_only=True)
        own = {key.rpartition(".")[0] for key in tensors if key.startswith((form.hidden, form.last))}
        if own != set(names):
            raise KeyError(f"layers {', '.join(sorted(own))}")
        for name, layer in zip(names, layers):
            layer.load_state_dict({key: tensors[f"{name}.{key}"] for key in ("weight", "bias")})
    except archives.DamagedError:
        raise
    except (*_DAMAGED, pickle.UnpicklingError) as error:
        raise ValueError(f"{path} does not hold the weights that it describes: {error}".splitlines()[0]) from None
    activation = getattr(torch.nn, form.activation)()

    def act(observation: NDArray[np.float32]) -> NDArray[np.float32]:
        with torch.inference_mode():
            x = torch.from_numpy(observation)
            for layer in layers[:-1]:
                x = activation(layer(x))
            x = layers[-1](x)
            # Squashed actions are scaled to the bounds -1 and 1, by the operations that give the same bits.
            return (-1.0 + 0.5 * (torch.tanh(x) + 1.0) * 2.0 if form.squashed else torch.clamp(x, -1.0, 1.0)).numpy()

    return act
