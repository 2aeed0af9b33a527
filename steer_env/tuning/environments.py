"""The environment classes of the tuning scenarios, with documentation generated from the scenario.

A class is made when it is first asked for.
"""

import textwrap
from functools import cache

from steer_env import targets
from steer_env.environments import table
from steer_env.episode.randomise import RANGES
from steer_env.metrics import definition
from steer_env.registration import history
from steer_env.tuning import reward, start
from steer_env.tuning.env import DETUNING, DRAWN_CONDITIONS, SETS, TOLERANCE, TuneEnv, observed_quantities
from steer_env.tuning.parameters import KNOWN
from steer_env.tuning.scenarios.common.definition import SCENARIOS, Scenario
from steer_env.tuning.vector import TuneVectorEnv
from steer_env.vehicle import cars
from steer_env.vehicle.steering.margins import TARGETS as MARGINS


def _wrap(text: str) -> str:
    return textwrap.fill(text, 118)


REWARD = (
    "The reward is minus the sum of the weighted terms. The term of a metric comes from its distance x from "
    f"its wanted band, in widths of that band: x/(1 + x/{reward.MAX_DISTANCE:g}), which is 0 inside the band "
    f"and rises everywhere, below {reward.MAX_DISTANCE:g}, that of a refused metric. The wanted band is "
    f'{TOLERANCE:g} times as wide as the target band below, which is that of `targets="compact"`; it lies '
    "about what the car's own assist gives in the context, but inside the target band, and is the whole target "
    "band where that metric is refused. The term of a margin is its shortfall below its least value over that "
    "value; it is 1 if the loop is unstable. "
    'The terms are in `info["reward_terms"]`. With '
    "`vector_reward=True` the reward is an array of the terms that weigh more than 0, for multi-objective "
    "learning and Pareto fronts, in the form of MO-Gymnasium."
)


def _documentation(scenario: Scenario) -> str:
    """A docstring in Gymnasium's form."""
    a, wanted = cars.load().assist, targets.load("compact")
    actions = []
    for i, name in enumerate(scenario.parameters):
        p = KNOWN[name]
        ends = (f"{p.value(a, at):.4g}" for at in (-1.0, 0.0, 1.0))
        actions.append((str(i), f"`{name}`: {p.meaning}", *ends, p.unit))
    observations = [
        (str(i), q.name.replace("_", " ") + f": {q.meaning}", f"{q.bound:.6g}", q.unit)
        for i, q in enumerate(observed_quantities(scenario))
    ]
    terms = [
        (f"`{name}`", f"{term.weight:g}", f"{term.band.good[0]:g} to {term.band.good[1]:g}", definition(name).unit)
        for name, term in reward.terms(scenario, wanted, None).items()
    ]
    margins = [
        (f"`{name}`", f"{reward.MARGIN_WEIGHT:g}", f"from {least:g}", unit)
        for name, least, unit in zip(reward.MARGIN_TERMS, MARGINS, ("deg", "dB"))
    ]
    drives = [
        (
            drive.manoeuvre.name,
            drive.manoeuvre.hands,
            "the context's" if drive.at_context_speed else f"{3.6 * drive.manoeuvre.speed:.4g} km/h",
        )
        for drive in scenario.drives
    ]
    sections = [
        _wrap(scenario.summary),
        "## Action",
        _wrap(
            f"`Box(-1, 1, ({len(actions)},))`. The action is a parameter set of the assist, relative to the start of "
            "the episode. The values below are those of the packaged compact car with `detuning=0`, where 0 is every "
            "car's own value. 1 multiplies and -1 divides a factor or a corner by the same number; a strength is 0 "
            "where it would be below."
        ),
        table(("index", "parameter", "at -1", "at 0", "at 1", "unit"), actions),
        "## Observation",
        f"`Box({len(observations)},)`, clipped to the bounds. What concerns the last set is 0 before the first one.",
        table(("index", "observation", "bound", "unit"), observations),
        "## Reward",
        _wrap(REWARD),
        table(("term", "weight", "band", "unit"), [*terms, *margins]),
        '## Cost\n\nFor constrained learning: `info["cost_terms"]` are the shortfalls of both margins, `info["cost"]` '
        "is their sum.",
        "## Tests",
        _wrap(
            "The tests are those of the battery with fewer events. The robot's handwheel angles are found with the "
            "car's own assist and are the same for every parameter set; each set is simulated at 1 kHz."
        ),
        table(("test", "hands", "speed"), drives),
        "## Metrics",
        _wrap(
            '`info["evaluated"]` has every metric of the tests with the last parameter set (`docs/metrics.md` defines '
            'them), `info["metrics"]` those with the best set so far; NaN where a metric is refused. The info of a '
            "reset has neither."
        ),
        "## Start",
        _wrap(
            "A context is drawn; `options` fix what would be drawn. The car's own assist is put out of tune: every "
            f"parameter by {start.LEAST_OFFSET_RATIO * DETUNING:g} to {DETUNING:g} in the unit of the action, up or "
            "down, a strength up, so that the loop keeps two thirds of the wanted margins, where 20 draws find "
            'it. The offsets are not observed, but follow from the values in `info["parameters"]`, which no controller '
            "should read; `env.unwrapped.own_action` is the action that undoes them."
        ),
        f"## End\n\nThe episode is truncated after {SETS} parameter sets, or as many as the argument `sets` says.",
        "## Arguments",
        "Those of `steer_env.tuning.TuneEnv`. `reset(options={...})` fixes what would be drawn:",
        table(("option", "meaning"), [(f"`{key}`", RANGES[key][2]) for key in DRAWN_CONDITIONS]),
        f"## Version history\n\n{history(scenario.name)}",
    ]
    return "\n\n".join(sections) + "\n"


@cache
def _make_class(name: str) -> type[TuneEnv]:
    scenario = SCENARIOS[name]
    fields = {"scenario": scenario, "__doc__": _documentation(scenario), "__module__": __name__}
    return type(name, (TuneEnv,), fields)


@cache
def _make_vector_class(name: str) -> type[TuneVectorEnv]:
    fields = {"single": _make_class(name), "__doc__": TuneVectorEnv.__doc__, "__module__": __name__}
    return type(f"{name}Vector", (TuneVectorEnv,), fields)


def __getattr__(name: str) -> type[TuneEnv] | type[TuneVectorEnv]:
    if name in SCENARIOS.available():
        return _make_class(name)
    if (single := name.removesuffix("Vector")) in SCENARIOS.available():
        return _make_vector_class(single)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
