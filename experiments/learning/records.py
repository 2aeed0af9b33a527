"""Records of friction in the benchmark: a contact is identified from the first part, and its torque predicted after it.

A vector environment with an episode of one step, so that whoever identifies friction is a controller as any other.
"""

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from steer_env import friction
from steer_env.experiments.learning.held_out import Controller
from steer_env.experiments.studies.common.friction_records import SYNTHETIC_STEP, displacement, true_laws
from steer_env.friction import defaults
from steer_env.friction.identification.scales import Scales, scaled
from steer_env.friction.law import LAWS

Array = NDArray[np.float64]

RECORD = "FrictionRecord"  # in place of an id
RECORD_MOTION, SAMPLE_STEP = (
    "many strokes and speeds",
    0.02,
)  # of the studies of friction, and the time between samples [s]
NOISE = 0.02  # of the torque that is seen, over the level of the contact [1]
FACTOR = 2.0  # by which level, displacement and time of a contact are multiplied or divided at most, assumed
INNER = 1.5  # of the least damping sigma_2 that a law with a break-away torque has, assumed [1]
LARGEST_REWARD = 120.0  # reward at most, of a prediction that is exact [dB]


class Records:
    """Noisy records of contacts with one friction law, whose level, displacement and time are drawn by the seed.

    Observations (N, 2, T) are the displacement [rad] and the torque [N m], which is NaN in the last P samples. The
    action (N, P) is the torque there, without noise. The reward is how many decibels the error of the prediction lies
    below the torque itself, both RMS: 0 for a prediction of zero, and 20 dB more for a tenth of the error.

    Attributes
    ----------
    dt : float
        Time between samples [s].
    fitted : int
        Samples of which the torque is seen.
    """

    info_level, dt = "full", SAMPLE_STEP

    def __init__(self, law: str, num_envs: int) -> None:
        self.num_envs, self.unwrapped = num_envs, self
        x, judged = displacement(RECORD_MOTION)
        every = round(SAMPLE_STEP / SYNTHETIC_STEP)
        self._x, self.fitted = x[::every], math.ceil(judged / every)
        self._law, usual = LAWS[law], true_laws([law])[law]
        # Those of the studies lie where the law ends (F10), to which a search for them runs.
        inner = {"sigma_2": INNER * usual.sigma_2} if {"F_s", "sigma_2"} <= set(usual._fields) else {}
        self._usual = usual._replace(**inner)
        self._open = False
        self.action_space = gym.spaces.Box(-math.inf, math.inf, (num_envs, self._x.size - self.fitted), np.float32)
        self._truth = np.zeros(self.action_space.shape)

    def reset(self, *, seed: Sequence[int], options: Any = None) -> tuple[Array, dict[str, Any]]:
        """Draw a contact for each seed: the records."""
        seen = np.zeros((self.num_envs, 2, self._x.size))
        seen[:, 0] = self._x
        for row, truth, each in zip(seen, self._truth, seed, strict=True):
            rng = np.random.default_rng([each, *map(ord, self._law.name)])
            scales = Scales(*FACTOR ** rng.uniform(-1.0, 1.0, 3))
            contact = self._law.make(**scaled(self._law, self._usual._asdict(), scales, back=True))
            torque = friction.response(contact, self._x, SAMPLE_STEP)
            noise = NOISE * defaults.F_C * scales.torque * rng.standard_normal(self._x.size)
            row[1], truth[:] = torque + noise, torque[self.fitted :]
        seen[:, 1, self.fitted :] = np.nan
        self._open = True
        return seen, {}

    def step(self, action: Any) -> tuple[Array, Array, NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        """Judge the predictions; the episodes are over. RuntimeError for a second one."""
        if not self._open:
            raise RuntimeError("the episodes are over or have not begun: call reset")
        self._open = False
        error = np.sqrt(np.mean((action - self._truth) ** 2, axis=1) / np.mean(self._truth**2, axis=1))
        reward = -20.0 * np.log10(np.maximum(error, 10.0 ** (-LARGEST_REWARD / 20.0)))
        over, none = np.ones(self.num_envs, bool), np.zeros(self.num_envs)
        info = {"cost": none, "failure": none.astype(np.int64), "metrics": {"relative_error": error}}
        return np.zeros((self.num_envs, 2, self._x.size)), reward, over, ~over, info

    def close(self) -> None:
        """Nothing is held."""


class Fitted:
    """A law fitted to the torque that is seen; Dahl's where the fit is refused, as of a law that is not determined."""

    def __init__(self, env: Any, law: str) -> None:
        self._law, self._dt, self._fitted = law, env.unwrapped.dt, env.unwrapped.fitted

    def reset(self, sub_environments: Any = None) -> None:
        """Nothing is kept."""

    def act(self, observation: NDArray[Any]) -> NDArray[Any]:
        """Torque in the samples to be predicted (N, P) [N m]."""
        return np.array([self._predicted(x, torque) for x, torque in observation])

    def _predicted(self, x: Array, torque: Array) -> Array:
        n = self._fitted
        fitted = partial(friction.fit, x[:n], torque[:n], dt=self._dt)
        try:
            found = fitted(law=self._law)
        except ValueError:
            found = fitted(law="dahl")
        predicted: Array = friction.response(found.parameters, x, self._dt)[n:] + found.offset
        return predicted


BASELINES: dict[str, Callable[[Any], Controller]] = {
    law: partial(Fitted, law=law) for law in ("coulomb", "dahl", "elasto_plastic", "lugre", "masing")
}
