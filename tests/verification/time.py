"""Computing time."""

import tempfile
from collections.abc import Iterator

from steer_env import tasks
from steer_env.experiments.studies.common import step_time
from steer_env.registration import DRIVEN, id_of
from tests.verification.common.rows import Row, verdict

# Limits of 1 ms of the plant over the friction law alone, twice what an idle machine shows and more. Kernels that are
# no longer inlined, or a tyre that is no longer vectorised, exceed them; the load of a busy machine does not.
ON_ONE_TRACK, ON_TWO_TRACKS = 6.0, 10.0
WEAVE = id_of("AssistWeave")


def rows() -> Iterator[Row]:
    """Environment steps relative to CartPole-v1, 1 ms of plant relative to LuGre's step alone, and the first step."""
    limits = {(name, "full"): _limit(name) for name in DRIVEN} | {(WEAVE, "full"): 2.2, (WEAVE, "none"): 1.5}
    for (name, level), ratio in step_time.ratios(limits).items():
        what = name if level == "full" else f"{name} without infos"
        yield _time(f"{what}, over CartPole-v1", ratio, limits[name, level], "x")
    times = step_time.substeps()
    for chassis, most in (("single_track", ON_ONE_TRACK), ("two_track", ON_TWO_TRACKS)):
        alone = times[f"{chassis}, lugre"]  # at one site, as the law alone
        yield _time(f"1 ms on {chassis}, over LuGre alone", alone / times["friction"], most, "x")
        yield _time(f"1 ms on {chassis}", 1e9 * alone, 700.0, "ns")
    with tempfile.TemporaryDirectory() as cache:
        for what, most in (("compiled", 15.0), ("from the cache", 2.0)):
            yield _time(f"first step, {what}", step_time.first_step(WEAVE, cache), most, "s")
    with tempfile.TemporaryDirectory() as cache:
        seconds = step_time.first_step(WEAVE, cache, chassis="two_track")
        yield Row("first step on two tracks, compiled", f"{seconds:.1f} s", "no limit", "")


def _limit(name: str) -> float:
    """Most time of a step of an id over that of CartPole-v1, by the plant, which has friction at three sites."""
    chassis = tasks.task(name.removeprefix("steer_env/").rpartition("-")[0]).chassis[0]
    return 2.6 if chassis == "single_track" else 3.2


def _time(what: str, value: float, most: float, unit: str) -> Row:
    measured = f"{value:.0f}" if unit == "ns" else f"{value:.1f}"
    return Row(what, f"{measured} {unit}", f"<= {most:g} {unit}", verdict(value <= most))
