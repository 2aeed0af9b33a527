"""Constants of training and evaluation that the command line also shows, without anything that is slow to import."""

# Training draws the seeds of its episodes from its own --seed; the episodes below are never among them.
HELD_OUT = 1_000_000  # first seed of the episodes of an evaluation
VALIDATION = 2_000_000  # first seed of the episodes by which training chooses the policy that it keeps

SHIPPED = "shipped"  # stands for the policy that is shipped with an id

SHIFTS = (
    "law",
    "level",
    "speed",
    "load",
    "car",
    "delay",
    "noise",
    "human",
)  # what `steer-env policy shift` replaces

ALGORITHMS = ("ppo", "sac", "recurrent-ppo")
CONSTRAINT = "constraint.csv"  # beside the curve of a training with a budget: cost and multiplier of every rollout

# Suites of the benchmark: task, and a friction law where it is not that of the car -> the baseline that scores 1 there,
# which had the largest reward when the suite was made. Another one makes another suite.
SUITES = {
    "drivers": {
        "DriverDoubleLaneChange": "macadam",
        "DriverLaneKeeping": "macadam",
        "DriverObstacleAvoidance": "macadam",
        "DriverOnCentre": "angle_servo",
        "DriverParking": "angle_servo",
        "DriverStopAndGo": "angle_servo",
        "DriverWindingRoad": "macadam",
    },
    "assists": {
        "AssistAllRound": "lqg",
        "AssistLaneChange": "friction_compensation",
        "AssistLaneKeeping": "lqg",
        "AssistParking": "lqg",
        "AssistRelease": "active_return",
        "AssistWeave": "lqg",
    },
    "friction": {
        "DriverOnCentre coulomb": "angle_servo",
        "DriverOnCentre masing": "angle_servo",
        "DriverOnCentre viscous": "angle_servo",
        "AssistWeave coulomb": "lqg",
        "AssistWeave masing": "lqg",
        "AssistWeave viscous": "lqg",
    },
    "tuners": {"TuneAllRound": "own_assist", "TuneOnCentre": "own_assist"},
    "identification": {
        "FrictionRecord elasto_plastic": "elasto_plastic",
        "FrictionRecord lugre": "lugre",
        "FrictionRecord masing": "masing",
    },
}

# Qualities of data sets: the share of random action in what acts, the rest is of the benchmark's reference of the id.
QUALITIES = {"poor": 1.0, "medium": 0.3, "good": 0.05}
