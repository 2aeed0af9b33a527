"""What the benchmark of friction shift consists of: cases, laws, entries. Nothing here is slow to import."""

from collections.abc import Mapping
from typing import Any, NamedTuple

# Every law at its default parameters, and two with other micro-damping than by default, which is a stated condition.
LAWS = (
    "lugre",
    "lugre,sigma_1=0",
    "masing",
    "masing,sigma_1=2",
    "coulomb",
    "stribeck",
    "dahl",
    "bouc_wen",
    "elasto_plastic",
    "exponential_spring",
    "gms",
    "viscous",
)
SET = ("lugre", "masing", "coulomb", "viscous")  # laws of the entries that are trained on a set; as many fit each batch
SEEDS = 6  # of each entry that is trained
EPISODES = 32  # of every controller on every law
SEARCHED = 4_000_000  # first seed of the episodes by which the cases were chosen; the table has others
# Shares of the range: what the shift has to cost a policy, and what a robust entry may lose, on its worst law [1].
COST, ROBUST = 0.2, 0.05


class Case(NamedTuple):
    """A task of the benchmark, and how its policies are trained."""

    task: str
    arguments: Mapping[str, Any]  # of the environment, with ``control_dt``
    law: str  # of the training on one law
    steps: int  # of a training, summed over the sub-environments
    settings: Mapping[str, Any] = {}  # of the algorithm, in place of those of the id

    @property
    def words(self) -> str:
        """The arguments of the environment as text."""
        return ", ".join(f"{key} {value}" for key, value in self.arguments.items())


class Entry(NamedTuple):
    """A kind of policy that is trained."""

    algorithm: str
    laws: tuple[str, ...] = ()  # of the training; none stands for that of the case
    frames: int = 1  # last observations that it sees at once


WALKING = 6.0  # speed at which a steering returns little by itself [m/s]
FAST_SPEED = 25.0  # speed at which a released handwheel returns from an angle of some tenths of a radian [m/s]
DOUBLE_FRICTION = {"friction_level": (2.0, 2.0)}  # a steering with twice the friction
# Exploration that is new in every step spoils the smoothness, by which the release multiplies its quality.
CALM_SETTINGS = {"policy_kwargs": {"log_std_init": -1.5}, "learning_rate": 1e-3, "gamma": 0.97}
CALMER = {"policy_kwargs": {"log_std_init": -2.0}, "learning_rate": 1e-3, "n_steps": 256, "batch_size": 4096}

CASES = {
    "on-centre-50ms": Case("DriverOnCentre", {"control_dt": 0.05}, "lugre", 1_000_000),
    "on-centre-10ms": Case("DriverOnCentre", {"control_dt": 0.01}, "viscous", 2_000_000),
    "walking-pace-50ms": Case("DriverOnCentre", {"control_dt": 0.05, "speed": WALKING}, "viscous", 1_000_000),
    "walking-pace-10ms": Case("DriverOnCentre", {"control_dt": 0.01, "speed": WALKING}, "viscous", 2_000_000),
    "stop-and-go-50ms": Case("DriverStopAndGo", {"control_dt": 0.05}, "viscous", 1_000_000),
    "release-50ms": Case(
        "AssistRelease",
        {"control_dt": 0.05, "speed": FAST_SPEED, "randomise": DOUBLE_FRICTION},
        "viscous",
        1_000_000,
        CALM_SETTINGS,
    ),
    "release-10ms": Case(
        "AssistRelease",
        {"control_dt": 0.01, "speed": FAST_SPEED, "randomise": DOUBLE_FRICTION},
        "viscous",
        3_000_000,
        CALMER,
    ),
}
_HEAVY = {"friction_level": (3.0, 3.0)}
# What the search tried and left out, as the law costs little there.
DROPPED = {
    "lane-keeping": Case("DriverLaneKeeping", {"control_dt": 0.05, "randomise": _HEAVY}, "viscous", 500_000),
    "release-18kph": Case(
        "AssistRelease", {"control_dt": 0.05, "speed": 5.0, "randomise": _HEAVY}, "viscous", 600_000, CALM_SETTINGS
    ),
    "release-58kph": Case(
        "AssistRelease", {"control_dt": 0.05, "speed": 16.0, "randomise": _HEAVY}, "viscous", 600_000, CALM_SETTINGS
    ),
}
CANDIDATES = CASES | DROPPED
ENTRIES = {
    "one-law": Entry("ppo"),
    "set-of-laws": Entry("ppo", SET),
    "history": Entry("ppo", SET, frames=8),
    "recurrent": Entry("recurrent-ppo", SET),
}
