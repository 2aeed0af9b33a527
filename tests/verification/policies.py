"""Shipped policies."""

import time
from collections.abc import Iterator, Mapping
from typing import Any

from steer_env import friction, tasks
from steer_env.experiments.learning import assist_suite, held_out, policy, policy_report, shift
from steer_env.experiments.learning.controllers import Maker, baselines
from steer_env.registration import id_of
from tests.verification.common.rows import Row, verdict

CASES = 200  # held-out episodes
CLEAN = 0.95  # least share of double lane changes without a cone
BETTER = 0.5  # least share by which the policy's feel error is below the boost table's
SHARE = 0.15  # largest share of the environment in the wall time of PPO
DRIVER, ASSIST = id_of("DriverDoubleLaneChange"), id_of("AssistWeave")
ALL_ROUND = id_of("AssistAllRound")


def rows() -> Iterator[Row]:
    """Shipped policies on held-out episodes beside classical controllers on the same terms, and their stability."""
    yield from _double_lane_change()
    for name in friction.available():
        if name == policy.read_description(policy.shipped_policy(ASSIST))["friction"]:
            continue
        feeling = _shipped(ASSIST, "boost", friction=name)
        less = -feeling.gaps["boost"]["rms_feel_error"].high / feeling.values["boost"]["rms_feel_error"].value
        yield Row(
            f"feel error on {name} below the boost table's",
            f"{less:.0%} at least",
            f">= {BETTER:.0%}",
            verdict(less >= BETTER),
        )
    gap = _shipped(ASSIST, "lqg").gaps["lqg"]["rms_feel_error"]
    yield Row("feel error less LQG's", f"{gap.low:.3f} to {gap.high:.3f} N m", "no limit", "pass")
    for env_id in (ASSIST, ALL_ROUND):
        found = assist_suite.examine(policy.load(policy.shipped_policy(env_id)), env_id)
        held, name = sum(result.holds for result in found), env_id.removeprefix("steer_env/")
        text = f"{held} of {len(found)}"
        yield Row(f"conditions of the assist suite, {name}", text, "all", verdict(held == len(found)))
    share = _training_share(ASSIST)
    yield Row(
        "environment in PPO's wall time, 64 sub-environments", f"{share:.1%}", f"< {SHARE:.0%}", verdict(share < SHARE)
    )


def _double_lane_change() -> Iterator[Row]:
    """The driver with its delay and lag drawn, and with those of a person beside a model that brings them itself."""
    path = policy.shipped_policy(DRIVER)
    person = shift.person(tasks.task("DriverDoubleLaneChange"))

    def found(make: Maker, options: Mapping[str, float] | None = None) -> held_out.Episodes:
        return held_out.collect(
            DRIVER, make, CASES, options=options, **policy.conditions(policy.read_description(path))
        )

    def clean(episodes: held_out.Episodes) -> float:
        return held_out.summary(episodes)["clean_share"].value

    drawn = clean(found(policy.load(path)))
    yield Row("double lane changes without a cone", f"{drawn:.1%}", f">= {CLEAN:.0%}", verdict(drawn >= CLEAN))
    driving, model = found(policy.load(path), person), found(baselines(DRIVER)["preview"], dict.fromkeys(person, 0.0))
    words = "double lane changes without a cone", "a person's delay and muscles"
    yield Row(f"{words[0]}, {words[1]}", f"{clean(driving):.1%}", "no limit", "pass")
    yield Row(f"{words[0]}, preview driver", f"{clean(model):.1%}", "no limit", "pass")
    gap = held_out.differences(driving, model)["reward"]
    yield Row(
        f"reward with {words[1]} less the preview driver's", f"{gap.low:.2f} to {gap.high:.2f}", "no limit", "pass"
    )


def _shipped(env_id: str, baseline: str, **more: Any) -> policy_report.Evaluation:
    path = policy.shipped_policy(env_id)
    controllers = {"policy": policy.load(path), baseline: baselines(env_id)[baseline]}
    return policy_report.evaluate(
        env_id, controllers, CASES, **policy.conditions(policy.read_description(path)), **more
    )


def _training_share(env_id: str, rollouts: int = 3) -> float:
    """Share of the environment in the wall time of PPO, at the id's settings but with 64 sub-environments.

    Needs the extra ``train``.
    """
    from stable_baselines3.common.vec_env import VecMonitor, VecNormalize

    from steer_env.experiments.learning.training import new_model, settings, time_steps

    given = settings(env_id, "ppo")
    sub_environments = time_steps(env_id, 64, **given["environment"])
    model = new_model("ppo", VecNormalize(VecMonitor(sub_environments)), given["algorithm"], seed=0)
    steps = 64 * given["algorithm"]["n_steps"]
    model.learn(steps)
    sub_environments.spent, start = 0.0, time.perf_counter()
    model.learn(rollouts * steps)
    return sub_environments.spent / (time.perf_counter() - start)
