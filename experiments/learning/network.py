"""The deterministic network of a policy file from its weights alone, without unpickling, which can run code.

A file of Stable-Baselines3 has its settings pickled in the member ``data`` and the weights as tensors in
``policy.pth``. Here the layers are built from the description that ``steer-env train`` adds as JSON, and only the
tensors are read: what else a pickled file may call is refused. Reading them needs no torch.
"""

import io
import math
import pickle
import zipfile
from collections import OrderedDict
from collections.abc import Callable, Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.friction.numerics import archives

Array = NDArray[np.float32]

# What weights that were changed raise, and those of another shape.
_DAMAGED = (LookupError, RuntimeError, EOFError, ValueError, TypeError, AttributeError, zipfile.BadZipFile)


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


class Layer(NamedTuple):
    """Of the network: weight x + bias."""

    weight: Array  # (M, N)
    bias: Array  # (M,)


class _Tensors(pickle.Unpickler):
    """Tensors of 32-bit floats in an archive of torch, as arrays."""

    def __init__(self, archive: zipfile.ZipFile) -> None:
        (index,) = (name for name in archive.namelist() if name.endswith("/data.pkl"))
        super().__init__(io.BytesIO(archive.read(index)))
        self._archive, self._folder = archive, index.removesuffix("data.pkl")
        if archive.read(f"{self._folder}byteorder") != b"little":
            raise ValueError("its bytes are in another order")

    def find_class(self, module: str, name: str) -> Any:
        known = {
            "collections.OrderedDict": OrderedDict,
            "torch.FloatStorage": np.float32,
            "torch._utils._rebuild_tensor_v2": self._tensor,
        }
        if f"{module}.{name}" not in known:
            raise pickle.UnpicklingError(f"it calls {module}.{name}")
        return known[f"{module}.{name}"]

    def persistent_load(self, identity: Any) -> Array:
        _, kind, key, *_ = identity
        return np.frombuffer(self._archive.read(f"{self._folder}data/{key}"), kind)

    @staticmethod
    def _tensor(values: Array, offset: int, shape: tuple[int, ...], strides: tuple[int, ...], *_: Any) -> Array:
        found = values[offset : offset + math.prod(shape)].reshape(shape)
        if strides != tuple(step // values.itemsize for step in found.strides):
            raise ValueError("a tensor has another order")
        return found


def layers(path: Path, about: Mapping[str, Any]) -> list[Layer]:
    """The layers of the network of a policy file, the first one first.

    Parameters
    ----------
    path : Path
        A policy file of an algorithm in ``FORMS``.
    about : mapping
        Its description, from :func:`steer_env.experiments.learning.policy.read_description`.

    Raises
    ------
    ValueError
        The weights cannot be read without running code, or are not those that the description tells.
    """
    form = FORMS[about["algorithm"]]
    seen = len(about["observations"]) * about["settings"]["algorithm"].get("frames", 1)
    sizes = [seen, *about["settings"]["algorithm"]["net_arch"], 1]
    names = [*(f"{form.hidden}.{2 * k}" for k in range(len(sizes) - 2)), form.last]
    try:
        with archives.open_archive(path, "policy") as archive:
            weights = io.BytesIO(archive.read("policy.pth"))
        with zipfile.ZipFile(weights) as tensors_of:
            tensors = _Tensors(tensors_of).load()
        own = {key.rpartition(".")[0] for key in tensors if key.startswith((form.hidden, form.last))}
        if own != set(names):
            raise KeyError(f"layers {', '.join(sorted(own))}")
        found = [Layer(tensors[f"{name}.weight"], tensors[f"{name}.bias"]) for name in names]
        for (n, m), layer in zip(pairwise(sizes), found):
            if layer.weight.shape != (m, n) or layer.bias.shape != (m,):
                raise ValueError(f"size mismatch: a layer of {layer.weight.shape}, not {(m, n)}")
    except archives.DamagedError:
        raise
    except (*_DAMAGED, pickle.UnpicklingError) as error:
        raise ValueError(f"{path} does not hold the weights that it describes: {error}".splitlines()[0]) from None
    return found


def load(path: Path, about: Mapping[str, Any]) -> Callable[[Array], Array]:
    """A function of scaled observations (N, O) that gives the mean actions (N, 1) in [-1, 1].

    Its results are those of Stable-Baselines3's ``predict(..., deterministic=True)`` to the bit. Arguments and errors
    are those of :func:`layers`.
    """
    import torch

    form = FORMS[about["algorithm"]]
    # Copied, as torch takes no memory that may not be written to.
    own = [(torch.tensor(layer.weight), torch.tensor(layer.bias)) for layer in layers(path, about)]
    activation = getattr(torch.nn, form.activation)()

    def act(observation: Array) -> Array:
        with torch.inference_mode():
            x = torch.from_numpy(observation)
            for weight, bias in own[:-1]:
                x = activation(torch.nn.functional.linear(x, weight, bias))
            x = torch.nn.functional.linear(x, *own[-1])
            # Squashed actions are scaled to the bounds -1 and 1, by the operations that give the same bits.
            return (-1.0 + 0.5 * (torch.tanh(x) + 1.0) * 2.0 if form.squashed else torch.clamp(x, -1.0, 1.0)).numpy()

    return act
