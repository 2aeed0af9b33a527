"""Minari: what its collector stores; steer_env.experiments.learning.dataset has a test of its own."""

import gc

import numpy as np
import pytest

from tests.integrations.recorded import STEPS, check_both_ends, columns, episodes, made
from tests.needs import needs

pytestmark = needs("jax")  # which its collector needs
minari = pytest.importorskip("minari")


@pytest.mark.filterwarnings(
    "ignore:Action is not in action space", "ignore:`.*` is set to None", "ignore:Implicitly cleaning up"
)
@pytest.mark.parametrize("infos", [False, True])
def test_collected(infos, tmp_path, monkeypatch):
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    env, rng = made(), np.random.default_rng(1)
    collector = minari.DataCollector(env, record_infos=infos)
    collector.reset(seed=0)
    for k in range(STEPS):
        _, _, terminated, truncated, _ = collector.step(rng.uniform(-1.5, 1.5, 1).astype(np.float32))
        if terminated or truncated:
            collector.reset(seed=k)  # without one the collector draws its own
    kept = list(collector.create_dataset("steering/random-v0").iterate_episodes())
    del collector  # its folder warns when it is collected, which is to happen here
    gc.collect()
    true = [columns(episode) for episode in episodes(env.kept)]
    assert len(kept) == len(true)
    for stored, seen in zip(kept, true):
        np.testing.assert_array_equal(stored.observations[:-1], seen.observation)
        np.testing.assert_array_equal(stored.observations[-1], seen.next_observation[-1])
        np.testing.assert_array_equal(stored.actions, seen.action)  # also those beyond the bounds
        np.testing.assert_array_equal(stored.rewards, seen.reward)
        np.testing.assert_array_equal(stored.terminations, seen.terminated)
        broken_off = stored is kept[-1]  # the collection ended before the episode did
        np.testing.assert_array_equal(stored.truncations[:-1], seen.truncated[:-1])
        assert stored.truncations[-1] == (seen.truncated[-1] or broken_off)
        if infos:
            np.testing.assert_array_equal(stored.infos["cost"][1:], seen.cost)
        else:
            assert not stored.infos
    assert not (true[-1].terminated | true[-1].truncated).any()
    check_both_ends(env.kept)
