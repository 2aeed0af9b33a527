"""The specification that Gymnasium keeps of an environment, with arguments in forms that JSON holds without loss."""

from collections.abc import Mapping
from dataclasses import replace
from enum import Enum
from os import PathLike, fspath
from typing import Any

import numpy as np
from gymnasium.envs.registration import EnvSpec

from steer_env import drivers, friction
from steer_env.friction import fitted_file
from steer_env.friction.law import LAWS
from steer_env.vehicle import road


def plain(value: Any) -> Any:
    """An argument of an environment in an equivalent form of mappings, lists, text and numbers.

    What has no such form is returned unchanged; JSON refuses it.
    """
    if LAWS.of(type(value)) is not None:
        return friction.as_mapping(value)
    if isinstance(value, drivers.Driver):
        return drivers.as_mapping(value)
    if isinstance(value, road.Road):
        return road.as_mapping(value)
    if isinstance(value, Mapping):
        return {key: plain(_law(each) if key == "friction" else each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [plain(each) for each in value]
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, type):  # of a wrapper
        return f"{value.__module__}:{value.__qualname__}"
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    return fspath(value) if isinstance(value, PathLike) else value


def _law(value: Any) -> Any:
    """A law that a file holds as its mapping, so that a specification does not depend on the file."""
    return friction.as_mapping(friction.resolve(value)) if fitted_file.is_file_name(value) else value


class PlainSpecification:
    """A base of environments: ``spec``, which ``gymnasium.make`` sets, has its arguments in :func:`plain` form.

    So ``gymnasium.make(EnvSpec.from_json(env.spec.to_json()))`` is the same environment whatever objects made it.
    """

    _spec: EnvSpec | None = None

    @property
    def spec(self) -> EnvSpec | None:
        """What Gymnasium makes the environment again from; None if it was made without ``gymnasium.make``."""
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        self._spec = spec and replace(spec, kwargs=plain(spec.kwargs))
