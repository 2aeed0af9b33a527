"""A loop in plain torch, as CleanRL writes PPO in one file: Gymnasium's vector environments and its wrappers."""

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

import steer_env  # noqa: F401 (registers the ids)

torch = pytest.importorskip("torch")

WEAVE = "steer_env/AssistWeave-v3"
N, T = 4, 128


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
def test_ppo(mode):
    torch.manual_seed(0)
    same = mode is AutoresetMode.SAME_STEP
    envs = gym.make_vec(WEAVE, num_envs=N, control_dt=0.1, autoreset_mode=mode, normalise=same)
    envs = gym.wrappers.vector.ClipAction(gym.wrappers.vector.RecordEpisodeStatistics(envs))
    if not same:  # Gymnasium's wrappers of observations do not take this mode
        envs = gym.wrappers.vector.NormalizeObservation(envs)
    size = envs.single_observation_space.shape[0]
    actor, critic = torch.nn.Linear(size, 1), torch.nn.Linear(size, 1)
    log_std = torch.nn.Parameter(torch.zeros(1))
    parameters = [*actor.parameters(), *critic.parameters(), log_std]
    optimizer, before = torch.optim.Adam(parameters, 1e-3), actor.weight.clone()
    observation, _ = envs.reset(seed=1)
    finished = []
    for _ in range(2):
        seen, acted, rewarded, ended = [], [], [], []
        for _ in range(T):
            x = torch.as_tensor(observation, dtype=torch.float32)
            with torch.no_grad():
                action = torch.distributions.Normal(actor(x), log_std.exp()).sample()
            observation, reward, terminated, truncated, info = envs.step(action.numpy())
            for store, value in zip(
                (seen, acted, rewarded, ended), (x, action, torch.tensor(reward), torch.tensor(terminated | truncated))
            ):
                store.append(value)
            for found in (info, info.get("final_info", {})):
                if "episode" in found:
                    finished += found["episode"]["l"][found["_episode"]].tolist()
        advantage, last = torch.zeros(T, N), torch.zeros(N)
        with torch.no_grad():
            values = critic(torch.stack([*seen, torch.as_tensor(observation, dtype=torch.float32)]))[..., 0]
        for t in reversed(range(T)):
            going = 1.0 - ended[t].float()
            last = rewarded[t] + 0.98 * going * values[t + 1] - values[t] + 0.98 * 0.95 * going * last
            advantage[t] = last
        x, action, returns = torch.cat(seen), torch.cat(acted), (advantage + values[:-1]).flatten().float()
        weight = (advantage.flatten() - advantage.mean()) / (advantage.std() + 1e-8)
        with torch.no_grad():
            old = torch.distributions.Normal(actor(x), log_std.exp()).log_prob(action)[:, 0]
        for _ in range(4):
            ratio = (torch.distributions.Normal(actor(x), log_std.exp()).log_prob(action)[:, 0] - old).exp()
            gain = torch.minimum(ratio * weight, ratio.clamp(0.8, 1.2) * weight).mean()
            loss = 0.5 * (critic(x)[:, 0] - returns).square().mean() - gain
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
    envs.close()
    assert finished == [200] * N  # an episode of 20 s in each
    assert np.isfinite(loss.item())
    assert (actor.weight != before).any()


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
def test_the_scale_of_rewards_runs_over_a_truncation_in_next_step_mode(mode):
    """The sum by whose variance Gymnasium's ``NormalizeReward`` divides has the last episode in it, or begins anew."""
    envs = gym.make_vec(WEAVE, num_envs=1, max_episode_steps=3, autoreset_mode=mode)
    scaled = gym.wrappers.vector.NormalizeReward(envs, gamma=1.0)
    scaled.reset(seed=1)
    for _ in range(3 + (mode is AutoresetMode.NEXT_STEP)):
        scaled.step(np.zeros((1, 1)))
    before = scaled.accumulated_reward[0]
    assert (before == 0.0) == (mode is AutoresetMode.SAME_STEP)
    scaled.step(np.zeros((1, 1)))
    assert scaled.accumulated_reward[0] == pytest.approx(before + envs.batch.episodes["reward"][0])
    envs.close()
