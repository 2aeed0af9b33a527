"""Shipped policies."""

from collections.abc import Iterator
from typing import Any

from steer_env import friction
from steer_env.experiments.learning import policy, policy_report
from steer_env.experiments.learning.controllers import baselines
from steer_env.experiments.verification import step_time
from steer_env.experiments.verification.requirements.common.rows import Row, verdict
from steer_env.registration import VERSION

CASES = 200  # held-out episodes
CLEAN = 0.95  # least share of double lane changes without a cone
BETTER = 0.2  # least share by which the policy's feel error is below the boost table's
SHARE = 0.15  # largest share of the environment in the wall time of PPO
DRIVER, ASSIST = f"steer_env/DriverDoubleLaneChange-{VERSION}", f"steer_env/AssistWeave-{VERSION}"


def rows(cases: int = CASES) -> Iterator[Row]:
    """Shipped policies on held-out episodes, against the preview driver and against the boost table."""
    driving = _shipped(DRIVER, "preview", cases)
    clean = driving.values["policy"]["clean_share"].value
    yield Row("double lane changes without a cone", f"{clean:.1%}", f">= {CLEAN:.0%}", verdict(clean >= CLEAN))
    cost, reward = (driving.gaps["preview"][name] for name in ("cost", "reward"))
    yield Row("cost less the preview driver's", f"{cost.high:.3f} at most", "< 0", verdict(cost.high < 0.0))
    yield Row("reward less the preview driver's", f"{reward.low:.2f} at least", "no limit", "pass")
    for name in friction.available():
        if name == policy.about(policy.shipped(ASSIST))["friction"]:
            continue
        feeling = _shipped(ASSIST, "boost", cases, friction=name)
        less = -feeling.gaps["boost"]["rms_feel_error"].high / feeling.values["boost"]["rms_feel_error"].value
        limits = feeling.values["policy"]["cost"].value
        yield Row(
            f"feel error on {name} below the boost table's",
            f"{less:.0%} at least, cost {limits:.3g}",
            f">= {BETTER:.0%}, cost 0",
            verdict(less >= BETTER and limits == 0.0),
        )
    share = step_time.training_share(ASSIST)
    yield Row(
        "environment in PPO's wall time, 64 sub-environments", f"{share:.1%}", f"< {SHARE:.0%}", verdict(share < SHARE)
    )


def _shipped(env_id: str, baseline: str, cases: int, **more: Any) -> policy_report.Evaluation:
    path = policy.shipped(env_id)
    controllers = {"policy": policy.load(path), baseline: baselines(env_id)[baseline]}
    return policy_report.evaluate(env_id, controllers, cases, **policy.conditions(policy.about(path)), **more)
