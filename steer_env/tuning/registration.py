"""The registered tuning environments, with their documentation drawn from the scenario."""

import textwrap

from steer_env import targets
from steer_env.environments import table
from steer_env.metrics import definition
from steer_env.randomise import RANGES
from steer_env.tuning import reward, scenarios
from steer_env.tuning.env import KNOWN, SETS, TuneEnv, observed
from steer_env.tuning.parameters import PARAMETERS
from steer_env.tuning.scenarios import Scenario
from steer_env.vehicle import cars
from steer_env.vehicle.steering.margins import TARGETS as MARGINS


def _filled(text: str) -> str:
    return textwrap.fill(text, 118)


def _documentation(scenario: Scenario) -> str:
    """A docstring in Gymnasium's form."""
    a, wanted = cars.load().assist, targets.load("compact")
    actions = []
    for i, name in enumerate(scenario.parameters):
        p = PARAMETERS[name]
        ends = (f"{p.value(a, at):.4g}" for at in (-1.0, 0.0, 1.0))
        actions.append((str(i), f"`{name}`: {p.meaning}", *ends, p.unit))
    observations = [
        (str(i), q.name.replace("_", " ") + f": {q.meaning}", f"{q.bound:.6g}", q.unit)
        for i, q in enumerate(observed(scenario))
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
            "the context's" if drive.held else f"{3.6 * drive.manoeuvre.speed:.4g} km/h",
        )
        for drive in scenario.drives
    ]
    sections = [
        _filled(scenario.summary),
        "## Action",
        _filled(
            f"`Box(-1, 1, ({len(actions)},))`: a set of assist parameters. The values are those of the packaged "
            "compact car; 0 is any car's own, -1 divides it and 1 multiplies it by the same."
        ),
        table(("index", "parameter", "at -1", "at 0", "at 1", "unit"), actions),
        "## Observation",
        f"`Box({len(observations)},)`, clipped to the bounds. Before the first set, what is of the last one is 0.",
        table(("index", "observation", "bound", "unit"), observations),
        "## Reward",
        _filled(
            "Minus the weighted distance of each metric to its band over the band's width, 0 inside the band and at "
            f"most {reward.FAR:g}, which a refused metric costs too; and what the margins lack of their least values, "
            'over those, all of it where the loop is unstable. The terms are in `info["reward_terms"]`; the bands are '
            'those of `targets="compact"`.'
        ),
        table(("term", "weight", "band", "unit"), [*terms, *margins]),
        '## Cost\n\nFor constraint learning, in `info["cost"]` and `info["cost_terms"]`: what both margins lack.',
        "## Tests",
        _filled(
            "Those of the battery, shortened: the same events, fewer of them. The robot's angles are found with the "
            "car's own assist and are the same for every set; each set is driven at 1 kHz."
        ),
        table(("test", "hands", "speed"), drives),
        "## Metrics",
        _filled(
            'Every metric of the tests after each set in `info["evaluated"]` (`docs/metrics.md` defines them), and at '
            'the end those of the best set in `info["metrics"]`.'
        ),
        f"## Start\n\nA context is drawn, or as `options` fix it.\n\n## End\n\nTruncates after {SETS} sets.",
        "## Arguments",
        "As `steer_env.tuning.TuneEnv`. `reset(options={...})` fixes what would be drawn:",
        table(("option", "meaning"), [(f"`{key}`", RANGES[key][2]) for key in KNOWN]),
        "## Version history\n\nv0: first version.",
    ]
    return "\n\n".join(sections) + "\n"


def _made(scenario: Scenario) -> type[TuneEnv]:
    fields = {"scenario": scenario, "__doc__": _documentation(scenario), "__module__": __name__}
    return type(scenario.name, (TuneEnv,), fields)


TuneOnCentre = _made(scenarios.ON_CENTRE)
TuneAllRound = _made(scenarios.ALL_ROUND)
