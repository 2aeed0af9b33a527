"""Shipped policies."""

from collections.abc import Iterator
from typing import Any

from steer_env import friction
from steer_env.experiments.learning import assist_suite, policy, policy_report
from steer_env.experiments.learning.controllers import baselines
from steer_env.experiments.verification import step_time
from steer_env.experiments.verification.requirements.common.rows import Row, verdict
from steer_env.registration import VERSION

CASES = 200  # held-out episodes
CLEAN = 0.95  # least share of double lane changes without a cone
BETTER = 0.5  # least share by which the policy's feel error is below the boost table's
SHARE = 0.15  # largest share of the environment in the wall time of PPO
DRIVER, ASSIST = f"steer_env/DriverDoubleLaneChange-{VERSION}", f"steer_env/AssistWeave-{VERSION}"
ALL_ROUND = f"steer_env/AssistAllRound-{VERSION}"


def rows(cases: int = CASES) -> Iterator[Row]:
    """Shipped policies on held-out episodes beside classical controllers on the same terms, and their stability."""
    driving = _shipped(DRIVER, "informed_preview", cases)
    clean = driving.values["policy"]["clean_share"].value
    yield Row("double lane changes without a cone", f"{clean:.1%}", f">= {CLEAN:.0%}", verdict(clean >= CLEAN))
    reward = driving.gaps["informed_preview"]["reward"]
    text = f"{reward.low:.2f} at least"
    yield Row("reward less that of the preview driver told load and grip", text, "> 0", verdict(reward.low > 0.0))
    for name in friction.available():
        if name == policy.about(policy.shipped(ASSIST))["friction"]:
            continue
        feeling = _shipped(ASSIST, "boost", cases, friction=name)
        less = -feeling.gaps["boost"]["rms_feel_error"].high / feeling.values["boost"]["rms_feel_error"].value
        yield Row(
            f"feel error on {name} below the boost table's",
            f"{less:.0%} at least",
            f">= {BETTER:.0%}",
            verdict(less >= BETTER),
        )
    gap = _shipped(ASSIST, "lqg", cases).gaps["lqg"]["rms_feel_error"]
    yield Row("feel error less LQG's", f"{gap.low:.3f} to {gap.high:.3f} N m", "no limit", "pass")
    for env_id in (ASSIST, ALL_ROUND):
        found = assist_suite.examine(policy.load(policy.shipped(env_id)), env_id)
        held, name = sum(result.holds for result in found), env_id.removeprefix("steer_env/")
        text = f"{held} of {len(found)}"
        yield Row(f"conditions of the assist suite, {name}", text, "all", verdict(held == len(found)))
    share = step_time.training_share(ASSIST)
    yield Row(
        "environment in PPO's wall time, 64 sub-environments", f"{share:.1%}", f"< {SHARE:.0%}", verdict(share < SHARE)
    )


def _shipped(env_id: str, baseline: str, cases: int, **more: Any) -> policy_report.Evaluation:
    path = policy.shipped(env_id)
    controllers = {"policy": policy.load(path), baseline: baselines(env_id)[baseline]}
    return policy_report.evaluate(env_id, controllers, cases, **policy.conditions(policy.about(path)), **more)
