"""The benchmark: the score of a controller in a suite of ids, and a result file that can be repeated.

The score in a drive, an id with or without a friction law that is not the car's, is what a controller gains over zero
action, as a share of what the reference of the drive gains,

    score = mean(R - R_zero) / mean(R_reference - R_zero),

over the same seeds: 0 is zero action, 1 is the reference, a baseline that stays the same whoever enters. The range
below the line is a mean, as on some seeds zero action alone does well. Its interval is Student's on the linearised
ratio, score + ((R - R_zero) - score (R_reference - R_zero)) / range, seed by seed. The score of a suite is the mean
over its drives, in which a seed counts once: its linearised scores are averaged over the drives first. A drive that a
controller does not enter counts as 0. A failed episode counts with its reward.

Source of the interval: delta method for a ratio estimator, Cochran, Sampling Techniques (1977), section 6.4.
"""

import json
import re
import sys
import traceback
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from steer_env.assists.common import definition as assist
from steer_env.experiments.learning import held_out, policy, records, script_policy, tuners
from steer_env.experiments.learning.constants import HELD_OUT, SHIPPED, SUITES
from steer_env.experiments.learning.controllers import SIMPLE, Maker, baselines
from steer_env.experiments.learning.held_out import Controller, Episodes, Estimate
from steer_env.experiments.pages import own_modules, provenance
from steer_env.experiments.sweep import Runner, run
from steer_env.friction.numerics import toml
from steer_env.friction.numerics.check import one_of, whole
from steer_env.registration import DRIVEN, TUNED, id_of
from steer_env.tasks.common.definition import COST_LIMIT

TERMS_FILE = policy.SHIPPED_IN.with_name("controllers.toml")  # terms of the controllers that are not trained
CONTROLLER_KINDS = BASELINE, POLICY, CLASS = "baseline", "policy", "class"  # of controllers
RESULT_KEYS = "suite", "controller", "seeds", "score", "parts", "episodes", "trace"  # of a result file
CONTROLLER, ZERO, REFERENCE = "controller", "zero", "reference"  # whose episodes a result holds

Array = NDArray[np.float64]


class Drive(NamedTuple):
    """A part of a suite: an id, with a friction law where it is not that of the car, or records of a law."""

    env_id: str
    reference: str  # the baseline that scores 1
    friction: str | None = None  # None is that of the car

    @property
    def name(self) -> str:
        """The id, and the law if there is one."""
        return self.env_id if self.friction is None else f"{self.env_id} {self.friction}"

    def environment(self, n: int) -> Any:
        """A vector environment of it with n rows."""
        if self.env_id == records.RECORD:
            assert self.friction is not None
            return records.Records(self.friction, n)
        arguments: dict[str, Any] = {} if self.friction is None else {"friction": self.friction}
        if self.env_id in TUNED:
            arguments |= tuners.SETTINGS
        return gym.make_vec(self.env_id, num_envs=n, **arguments)

    @property
    def baselines(self) -> dict[str, Maker]:
        """Zero and random action, and the baselines of its id, by name."""
        if self.env_id in DRIVEN:
            return {**SIMPLE, **baselines(self.env_id)}
        return {**SIMPLE, **(records.BASELINES if self.env_id == records.RECORD else tuners.BASELINES)}


class Suite(NamedTuple):
    """Drives, by their names."""

    name: str
    drives: Mapping[str, Drive]

    @property
    def ids(self) -> list[str]:
        """Its ids, each once."""
        return list(dict.fromkeys(drive.env_id for drive in self.drives.values()))

    def baselines(self) -> list[str]:
        """Zero and random action, and the names of the baselines of all ids."""
        return list(dict.fromkeys(name for drive in self.drives.values() for name in drive.baselines))


def _references() -> dict[str, str]:
    """Task -> the baseline that scores 1 in its id, with the law of the car."""
    return {**SUITES["drivers"], **SUITES["assists"], **SUITES["tuners"]}


def names() -> tuple[str, ...]:
    """Names of all suites; that of one id is called as the id, without ``steer_env/``."""
    return (*SUITES, *(id_of(task).removeprefix("steer_env/") for task in _references()))


def suite(name: str) -> Suite:
    """A suite by name, or that of one id; ValueError for an unknown one."""
    one_of("the suite", name, names())
    task = name.rpartition("-")[0]
    contents = SUITES[name] if name in SUITES else {task: _references()[task]}
    parts = [(*text.split(), reference) for text, reference in contents.items()]
    drives = [
        Drive(task if task == records.RECORD else id_of(task), reference, *law) for task, *law, reference in parts
    ]
    return Suite(name, {drive.name: drive for drive in drives})


def of_id(env_id: str) -> Suite:
    """The suite of one id; ValueError for an unknown one."""
    policy.check_id(env_id)
    return suite(env_id.removeprefix("steer_env/"))


def held_out_seeds(episodes: int) -> tuple[int, ...]:
    """The seeds of every evaluation of this package."""
    return tuple(range(HELD_OUT, HELD_OUT + episodes))


class Entry(NamedTuple):
    """A controller of a suite."""

    name: str
    kind: str  # of ``CONTROLLER_KINDS``
    makers: Mapping[str, Maker]  # by id, of those that it enters
    terms: Mapping[str, str]  # information, delay and so on, as the table tells them
    sha256: Mapping[str, str]  # of its files; none for a baseline, which is of the sources of the package
    cautions: tuple[str, ...] = ()  # to be shown before it is driven

    def about(self) -> dict[str, Any]:
        """What a result file says of it."""
        told = {key: dict(value) for key, value in (("terms", self.terms), ("sha256", self.sha256))}
        return {"name": self.name, "kind": self.kind, **told}


def entry(text: str, of: Suite) -> Entry:
    """A controller by the text that names it.

    Parameters
    ----------
    text : str
        "zero", "random", the name of a baseline, "shipped", a policy.zip, a folder with several, one for each id, or a
        class with the methods of :class:`held_out.Controller` as ``FILE.py:CLASS`` or ``MODULE:CLASS``.
    of : Suite

    Raises
    ------
    ValueError
        If it is none of these, or is of no id of the suite.
    """
    if text in of.baselines():
        known = {drive.env_id: drive.baselines for drive in of.drives.values()}
        makers = {env_id: found[text] for env_id, found in known.items() if text in found}
        return Entry(text, BASELINE, makers, _terms(text, of), {})
    if text == SHIPPED:
        return _policies(SHIPPED, policy.SHIPPED_IN, of)
    if text.endswith(".zip") or Path(text).is_dir():
        place = Path(text).resolve()
        if place.is_file() and not policy.described(place):
            return _script(place, of)
        return _policies(place.name if place.is_dir() else place.parent.name, Path(text), of)
    if ":" in text:
        return _own_entry(text, of)
    raise ValueError(
        f"{text!r} is no controller: give FILE.py:CLASS, MODULE:CLASS, a policy.zip or a folder with some, or one of "
        f"{', '.join([*of.baselines(), SHIPPED])}"
    )


def _terms(name: str, of: Suite) -> dict[str, str]:
    """Terms of a baseline, with the budget of the search for its options where there was one."""
    unknown = dict.fromkeys(("information", "tuning"), "not stated")  # a baseline that the user has registered
    told = toml.loads(TERMS_FILE.read_text(encoding="utf-8"))
    terms: dict[str, str] = told.get("fit" if name in records.BASELINES else name, unknown)
    searched = json.loads(assist.TUNED.read_text(encoding="utf-8"))
    found = [searched[env_id][name] for env_id in of.ids if name in searched.get(env_id, {})]
    if found:
        episodes = sum(each["candidates"] * each["episodes"] for each in found)
        terms["tuning"] = f"{episodes} episodes in {len(found)} of {len(of.ids)} ids"
    return terms


def _policies(name: str, place: Path, of: Suite) -> Entry:
    """The policies of a file, or of a folder and all below it, each in the id of its training."""
    paths: dict[str, Path] = {}
    for path in sorted(place.rglob("policy.zip")) if place.is_dir() else [place]:
        env_id = policy.read_description(path)["env"]
        if env_id in paths:
            raise ValueError(f"{paths[env_id]} and {path} are both of {env_id}: an entry has one policy for each id")
        paths[env_id] = path
    entered = {env_id: paths[env_id] for env_id in of.ids if env_id in paths}
    if not entered:
        raise ValueError(f"{place} holds no policy of an id of the suite {of.name}: {', '.join(of.ids)}")
    steps = 0
    for env_id, path in entered.items():
        about = policy.read_description(path)
        policy.check_observations(path, about, env_id)
        steps += whole(f"{path}: steps", about.get("steps"), 0)
    return Entry(
        name,
        POLICY,
        {env_id: policy.load(path) for env_id, path in entered.items()},
        {"information": "the observations", "tuning": f"{steps} steps of training in {len(entered)} ids"},
        {env_id: provenance.input_file(str(path))["sha256"] for env_id, path in entered.items()},
        tuple(filter(None, (policy.caution(path, policy.read_description(path)) for path in entered.values()))),
    )


def _script(path: Path, of: Suite) -> Entry:
    """A policy that a script has saved, in the only id of a suite."""
    steps = script_policy.training_steps(path)
    if len(of.ids) > 1:
        raise ValueError(f"{path} does not say of which id it is: give --env ID in place of --suite {of.name}")
    (env_id,) = of.ids
    seen = f"{path} is taken to see the observations of {env_id} at its default settings, without VecNormalize"
    return Entry(
        path.stem,
        POLICY,
        {env_id: policy.load(path)},
        {"information": "the observations", "tuning": f"{steps} steps of training in 1 id"},
        {env_id: provenance.input_file(str(path))["sha256"]},
        (seen, policy.caution(path, None)),
    )


@dataclass(frozen=True)
class OwnControllerMaker:
    """Makes a controller of the user's own class for an environment, in this process or in a worker."""

    module: str
    name: str
    folder: str  # in which the module is looked for first
    file: str = ""  # that the module must be, where a file was given
    digests: tuple[tuple[str, str], ...] = ()  # of the module and of the user's own ones that it imports

    def found(self) -> Any:
        """The class; ValueError if it cannot be imported, or another module has the name of its file."""
        if self.folder not in sys.path:
            sys.path.insert(0, self.folder)
        try:
            module = import_module(self.module)
        except (Exception, SystemExit) as error:  # whatever the module does
            raise ValueError(f"the module {self.module} cannot be imported: {_in_words(error)}") from None
        place = str(Path(module.__file__ or "").resolve())
        if self.file not in ("", place):
            raise ValueError(f"the module {self.module} is {place} already: give {self.file} another name")
        made = getattr(module, self.name, None)
        if not (isinstance(made, type) and all(callable(getattr(made, of, None)) for of in ("reset", "act"))):
            raise ValueError(f"{place} has no class {self.name} with the methods reset and act")
        return made

    def __call__(self, env: Any) -> Controller:
        """The controller; ValueError if the source is not as it was."""
        made = self.found()
        if tuple(own_modules.digests([self.module]).items()) != self.digests:
            raise ValueError(f"the module {self.module} is not as it was where it is evaluated: leave it as it is")
        controller: Controller = made(env)
        return controller


def _own_entry(text: str, of: Suite) -> Entry:
    """A class of the user's own."""
    place, _, name = text.rpartition(":")
    path = Path(place).resolve()
    if place.endswith(".py") and not path.is_file():
        raise ValueError(f"no file {place}")
    own = (
        OwnControllerMaker(path.stem, name, str(path.parent), str(path))
        if path.is_file()
        else OwnControllerMaker(place, name, str(Path.cwd()))
    )
    made = own.found()
    digests = own_modules.digests([own.module])
    about = str(made.__doc__ or "not stated").strip().partition("\n")[0].rstrip(".")
    terms = {"information": about, "tuning": str(getattr(made, "tuning", "not stated"))}
    make = replace(own, digests=tuple(digests.items()))
    return Entry(f"{own.module}:{name}", CLASS, dict.fromkeys(of.ids, make), terms, digests)


def _in_words(error: BaseException) -> str:
    """An exception of somebody else's code: its kind, what it says, and where it was raised."""
    try:
        told = " ".join(str(error).split())
    except Exception:  # its own code may fail too
        told = ""
    last = traceback.extract_tb(error.__traceback__)[-1]
    place = "" if isinstance(error, SyntaxError) else f" ({Path(last.filename).name}, line {last.lineno})"
    return f"{type(error).__name__}{told and f': {told}'}{place}"  # a syntax error says its place itself


class Case(NamedTuple):
    """A controller that a worker drives."""

    label: str
    drive: Drive
    make: Maker
    seeds: tuple[int, ...]


def run_episodes(case: Case) -> Episodes:
    """The episodes of a case, one for each seed."""
    env = case.drive.environment(len(case.seeds))
    try:
        episode = tuners.tune if case.drive.env_id in TUNED else held_out.drive
        return episode(env, _CheckedController(case, env), case.seeds)
    finally:
        env.close()


class _CheckedController:
    """A controller whose errors are told in a sentence that says whose they are, as its code may be anybody's."""

    def __init__(self, case: Case, env: Any) -> None:
        self._shape = env.action_space.shape
        self._controller = self._called("its constructor", case.make, env)

    def _called(self, what: str, function: Callable[..., Any], *arguments: Any) -> Any:
        try:
            return function(*arguments)
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # whatever its code does
            raise ValueError(f"{what} raised {_in_words(error)}") from error

    def reset(self, sub_environments: Any = slice(None)) -> None:
        """Forget the episodes of some rows of the batch, or of all."""
        self._called("its reset", self._controller.reset, sub_environments)

    def act(self, observation: NDArray[np.float32]) -> NDArray[np.float32]:
        """Actions (N, n) for observations (N, ...); ValueError for another shape, or what is no finite number."""
        action = self._called("its act", lambda: np.asarray(self._controller.act(observation)))
        if action.shape != self._shape or action.dtype.kind not in "fiu":
            raise ValueError(f"its act must give numbers {self._shape}, got {action.dtype} {action.shape}")
        with np.errstate(over="ignore"):
            single = action.astype(np.float32)
        if not np.isfinite(single).all():
            given = action[~np.isfinite(single)][0]
            raise ValueError(f"its act gave {given}, which is no finite number of single precision")
        return single


class Result(NamedTuple):
    """The raw episodes of an entry, of zero action and of the references, from which all else follows."""

    suite: Suite
    controller: Mapping[str, Any]  # of :meth:`Entry.about`
    seeds: tuple[int, ...]
    episodes: Mapping[str, Mapping[str, Episodes]]  # drive -> whose -> episodes; no own ones where it does not enter


def enter(
    entries: Sequence[Entry],
    of: Suite,
    seeds: Sequence[int],
    notify: Callable[[float, str], None] = lambda *_: None,
    sweep: Runner = run,
) -> list[Result]:
    """Drive entries, zero action and the references in a suite, each once; ValueError for two entries of one name."""
    if len({(each.kind, each.name) for each in entries}) < len(entries):
        raise ValueError(f"entries need names of their own, got {', '.join(each.name for each in entries)}: rename one")
    cases: dict[tuple[str, str, str], Case] = {}
    for drive in of.drives.values():
        entered = [each for each in entries if drive.env_id in each.makers]
        makers = {(each.kind, each.name): each.makers[drive.env_id] for each in entered}
        makers |= {(BASELINE, name): drive.baselines[name] for name in ("zero", drive.reference)}
        cases |= {(drive.name, *who): Case(who[1], drive, make, tuple(seeds)) for who, make in makers.items()}
    every = sweep(run_episodes, cases.values(), notify=notify, words=lambda case: f"{case.drive.name} {case.label}")
    found = dict(zip(cases, every))

    def episodes(each: Entry, drive: Drive) -> dict[str, Episodes]:
        who = {ZERO: (drive.name, BASELINE, "zero"), REFERENCE: (drive.name, BASELINE, drive.reference)}
        own = {CONTROLLER: (drive.name, each.kind, each.name)} if drive.env_id in each.makers else {}
        return {whose: found[key] for whose, key in (own | who).items()}

    return [
        Result(of, each.about(), tuple(seeds), {name: episodes(each, drive) for name, drive in of.drives.items()})
        for each in entries
    ]


def _linearise(found: Mapping[str, Episodes]) -> Array:
    """Scores (N,) of an id seed by seed, whose mean is the score and whose spread gives its interval."""
    zero = found[ZERO].reward
    if CONTROLLER not in found:
        return np.zeros(zero.size)
    gained, span = found[CONTROLLER].reward - zero, found[REFERENCE].reward - zero
    share = gained.mean() / span.mean()
    linearised: Array = share + (gained - share * span) / span.mean()
    return linearised


def score(result: Result) -> Estimate:
    """The score of a suite."""
    return held_out.mean(np.mean([_linearise(found) for found in result.episodes.values()], axis=0))


class Part(NamedTuple):
    """What a result says of one id."""

    reference: str
    span: Estimate  # reward of the reference less that of zero action
    score: Estimate
    summary: dict[str, Estimate]  # of :func:`held_out.summary`; empty for an id that is not entered
    failed: int  # episodes

    @property
    def beyond_limit(self) -> bool:
        """Whether the mean cost of an episode is above the limit of the id."""
        return bool(self.summary) and self.summary["cost"].value > COST_LIMIT


def parts(result: Result) -> dict[str, Part]:
    """What a result says of each id."""
    made = {}
    for name, found in result.episodes.items():
        own = found.get(CONTROLLER)
        made[name] = Part(
            result.suite.drives[name].reference,
            held_out.mean(found[REFERENCE].reward - found[ZERO].reward),
            held_out.mean(_linearise(found)),
            held_out.summary(own) if own else {},
            int((own.failure != 0).sum()) if own else 0,
        )
    return made


class Scored(NamedTuple):
    """What a result file says of an entry, but for its episodes."""

    suite: Suite
    controller: Mapping[str, Any]  # of :meth:`Entry.about`
    seeds: tuple[int, ...]
    score: Estimate
    parts: Mapping[str, Part]  # by drive


def document(result: Result) -> dict[str, Any]:
    """A result as JSON: scores, raw episodes, and the trace of the program that drove them."""
    found = Scored(result.suite, result.controller, result.seeds, score(result), parts(result))
    episodes = {name: {whose: _raw(each) for whose, each in own.items()} for name, own in result.episodes.items()}
    return {**summarise(found), "episodes": episodes, "trace": provenance.trace()}


def summarise(found: Scored) -> dict[str, Any]:
    """What a result file says of an entry, but for its episodes, as JSON."""
    return {
        "suite": found.suite.name,
        "controller": dict(found.controller),
        "seeds": [*found.seeds],
        "score": _estimate(found.score),
        "parts": {name: _part(part) for name, part in found.parts.items()},
    }


def _estimate(e: Estimate) -> dict[str, Any]:
    return {"value": e.value, "ci": [e.low, e.high]}


def _part(part: Part) -> dict[str, Any]:
    return {
        "reference": part.reference,
        "span": _estimate(part.span),
        "score": _estimate(part.score),
        "summary": {name: _estimate(each) for name, each in part.summary.items()},
        "failed": part.failed,
        "beyond_cost_limit": part.beyond_limit,
    }


def _raw(found: Episodes) -> dict[str, Any]:
    sums = {name: getattr(found, name).tolist() for name in ("reward", "cost", "failure")}
    return {**sums, "metrics": {name: each.tolist() for name, each in found.metrics.items()}}


def result_text(found: Mapping[str, Any]) -> str:
    """The text of a result file: the same for the same result, to the bit."""
    return json.dumps(found, indent=1, sort_keys=True, allow_nan=False) + "\n"


def result_file_name(result: Result) -> str:
    """The name of a result's file."""
    name = re.sub(r"[^\w.-]+", "-", result.controller["name"])
    return f"{result.suite.name}-{result.controller['kind']}-{name}.json"


def read(path: Path) -> dict[str, Any]:
    """The contents of a result file; ValueError for a file that is none, with the reason."""
    found: dict[str, Any] = toml.read(path, lambda text: _checked(json.loads(text)))
    return found


def _checked(said: Any) -> dict[str, Any]:
    if not isinstance(said, dict) or set(said) != set(RESULT_KEYS):
        raise ValueError(f"is no result of 'steer-env benchmark', which holds {', '.join(RESULT_KEYS)}")
    try:
        of = score_entry(said).suite
        there = set(_by_seed(said))
    except (AttributeError, KeyError, TypeError) as error:
        raise ValueError(f"is no result as 'steer-env benchmark' writes it: {error!r}") from None
    wanted = {(name, whose, seed) for name in of.drives for whose in (ZERO, REFERENCE) for seed in said["seeds"]}
    if set(said["parts"]) != set(of.drives) or not wanted <= there:
        raise ValueError(f"its episodes are not those of the suite {of.name} here, in {', '.join(of.drives)}")
    return said


def score_entry(said: Mapping[str, Any]) -> Scored:
    """Scores and terms of an entry, of what its result file says."""
    of, seeds = suite(said["suite"]), tuple(whole("a seed", seed, 0) for seed in said["seeds"])
    kinds = {"name": str, "kind": str, "terms": dict, "sha256": dict}
    about = {key: kind(said["controller"][key]) for key, kind in kinds.items()}
    made = {
        name: Part(
            part["reference"],
            _read_estimate(part["span"]),
            _read_estimate(part["score"]),
            {key: _read_estimate(each) for key, each in part["summary"].items()},
            part["failed"],
        )
        for name, part in said["parts"].items()
    }
    return Scored(of, about, seeds, _read_estimate(said["score"]), made)


def _read_estimate(said: Mapping[str, Any]) -> Estimate:
    return Estimate(*map(float, (said["value"], *said["ci"])))


def _by_seed(said: Mapping[str, Any]) -> dict[tuple[str, str, int], list[float]]:
    """Drive, whose and seed of every episode of a result -> its numbers."""
    found: dict[tuple[str, str, int], list[float]] = {}
    for name, each in said["episodes"].items():
        for whose, raw in each.items():
            sums = [raw[key] for key in ("reward", "cost", "failure")]
            columns = [*sums, *(raw["metrics"][key] for key in sorted(raw["metrics"]))]
            found |= {(name, whose, seed): numbers for seed, *numbers in zip(said["seeds"], *columns)}
    return found


def rerun_result(
    said: Mapping[str, Any],
    who: Entry,
    notify: Callable[[float, str], None] = lambda *_: None,
    sweep: Runner = run,
) -> dict[tuple[str, str, int], bool]:
    """Drive a result once more, with a controller that is given: drive, whose and seed -> whether it is the same."""
    (found,) = enter([who], suite(said["suite"]), said["seeds"], notify, sweep)
    then, now = _by_seed(said), _by_seed(document(found))
    return {episode: then.get(episode) == now.get(episode) for episode in {**then, **now}}
