"""A guard around a trained assist: it fades the action without hands and in quick steering, as the classical ones do.

A network that has learnt to shape the feel of slow steering may make a released handwheel oscillate. LQG and integral
control step back there by :class:`steer_env.assists.common.reference_feel.Feel`; with the guard a trained policy does
so by the same rule. A task that tells the release asks for a return, so there the guard ends with it. The guard belongs
to the policy: it acts during the training, and wherever the policy acts later.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnvWrapper
from stable_baselines3.common.vec_env.base_vec_env import VecEnvObs, VecEnvStepReturn

from steer_env.assists.common.reference_feel import Feel

_NEEDS = ("torsion_bar_torque", "handwheel_speed", "speed")


class Guard:
    """The share of the action that may act, for the rows of an assist environment.

    Parameters
    ----------
    batch : EnvironmentBatch
    scale : (O,) array
        SI value of an observation of 1.
    caution : float
        Weight of quick motions, as in :class:`steer_env.assists.common.reference_feel.Feel` [1].
    """

    def __init__(self, batch: Any, scale: NDArray[np.float64], caution: float) -> None:
        names = [quantity.name for quantity in batch.observed]
        self._feel = Feel(batch, caution)
        self._places = [names.index(name) for name in _NEEDS]
        self._units = scale[self._places]
        self._released = names.index("released") if "released" in names else None
        self._new = np.ones(batch.n, bool)

    def reset(self, rows: Any = slice(None)) -> None:
        """Forget the episodes of some rows (mask or indices), or of all."""
        self._new[rows] = True

    def get_state(self) -> tuple[Any, ...]:
        """A copy of what it remembers of all rows."""
        return self._new.copy(), self._feel.get_state()

    def set_state(self, state: tuple[Any, ...]) -> None:
        """Go on from a copy."""
        self._new[:] = state[0]
        self._feel.set_state(state[1])

    def limited(self, observations: NDArray[np.float32], actions: NDArray[np.float32]) -> NDArray[np.float32]:
        """Actions (n, 1) for observations (n, O), with the share that may act; to be called once a control step."""
        torque, speed, forward = (observations[:, self._places] * self._units).astype(float).T
        for i in np.flatnonzero(self._new).tolist():
            self._feel.begin(i, float(speed[i]))
        self._new[:] = False
        share = self._feel.shares(torque, speed, forward)
        if self._released is not None:
            share = np.where(observations[:, self._released] > 0.5, 1.0, share)
        return (np.clip(actions, -1.0, 1.0) * share[:, None]).astype(np.float32)


class GuardedVecEnv(VecEnvWrapper):
    """A :class:`steer_env.sb3.SteerVecEnv` whose actions pass the guard."""

    def __init__(self, venv: Any, caution: float) -> None:
        super().__init__(venv)
        self._guard = Guard(venv.vector.unwrapped.batch, venv.vector.unwrapped.observation_scale, caution)
        self._seen: Any = None

    def reset(self) -> VecEnvObs:
        """Start an episode in every sub-environment."""
        self._seen = self.venv.reset()
        self._guard.reset()
        return self._seen

    def step_async(self, actions: NDArray[np.float32]) -> None:
        """Keep the share of the actions (num_envs, 1) that may act."""
        self.venv.step_async(self._guard.limited(self._seen, actions))

    def step_wait(self) -> VecEnvStepReturn:
        """Observations, rewards, whether episodes ended, infos."""
        self._seen, rewards, done, infos = self.venv.step_wait()
        self._guard.reset(done)
        return self._seen, rewards, done, infos

    def get_state(self) -> tuple[Any, ...]:
        """A copy of what decides, beside the environment, how it goes on."""
        return np.copy(self._seen), self._guard.get_state()

    def set_state(self, state: tuple[Any, ...]) -> None:
        """Go on from a copy."""
        self._seen = state[0]
        self._guard.set_state(state[1])
