"""Write docs/metrics.md, docs/environments.md and the tables of docs/car_files.md from the definitions in the code.

python -m tests.maintain glossary
"""

import inspect
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from inspect import signature
from itertools import groupby
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.envs.registration import load_env_creator

from steer_env import REGISTERED, manoeuvres, metrics, tasks
from steer_env.env import SteerEnv
from steer_env.environments import reset_options, table
from steer_env.episode.randomise import RANGES, SENSOR_NOISE
from steer_env.metrics.common import just_noticeable
from steer_env.registration import CHANGES, DRIVEN, FIRST, history
from steer_env.tuning.env import DRAWN_CONDITIONS, TuneEnv
from steer_env.tuning.scenarios.common.definition import SCENARIOS, SPEEDS
from steer_env.tuning.vector import TuneVectorEnv
from steer_env.vector import SteerVectorEnv
from steer_env.vehicle.cars import plausible
from steer_env.vehicle.cars.keys import CONSTRUCTORS
from steer_env.vehicle.keys import JUDGEMENT, Key, declared_keys

DOCS = Path(__file__).resolve().parents[2] / "docs"
_METRICS = """# Tests and metrics

`python -m tests.maintain glossary` writes this page from the definitions in `steer_env/manoeuvres/` and
`steer_env/metrics/`. No conformance with any standard is claimed. A value is the mean over the repeats in a recording
(cycles, steps, sweeps, segments), with a 95 % interval where there are several. A metric that a recording cannot
support is refused with the reason. Usual ranges are those of passenger cars, by engineering judgement. "Noticed" is the
share of a value from which on drivers notice a difference, where that is known ([report.md](report.md)). A metric of
several tests is defined in one of them, which the others name.

## What an interval holds

The interval of a metric is the 95 % interval of the mean over the repeats (Student's t, from sixteen repeats on the
bootstrap), made wider at both ends by the change of the metric

- when every low-pass is applied twice. Where the cycles of a simulation repeat themselves, this is nearly all of it;
- when a channel is shifted by `--timing-ms`, or else by `timing_error_s`, which a mapping declares [s], or which a CAN
  log that stamps frames in batches has for the channels of each message;
- when the hand torque is divided by 1 +- `torque_scale_error`, which a mapping declares: `[meta]`,
  `torque_scale_error = 0.02` for a sensor whose scale is known to 2 %;
- in weave and slow ramp, when the road is taken to bend as much as lateral acceleration and yaw rate both say;
- in weave, slow ramp and rig, by what the delay of a channel behind the handwheel angle gains in half the recording,
  where it changes significantly from cycle to cycle: the clocks of two devices drift apart, or the drive itself
  changes, as on a road banked by 2 %. Other tests do not show that; give `--timing-ms` there;
- in returnability, when the hands let go half a sample earlier or later;
- in the frequency responses, when the band over which the estimate averages is halved. With friction the phase of the
  torque at 1 Hz is some degrees apart from one estimator to the next;
- on the road, by the change with the next shorter and longer distance over which friction builds up, and, added to the
  scatter of the blocks by squares, by 15 % of the widths and 4 % of the slopes. So much the form of the regression
  leaves open between simulated cars and friction laws.

A sine of a single burst has one ratio of the first peak: its interval is that of the white noise in both channels.
Other metrics with a single value have no interval unless one of the above gives one.

Weave and slow ramp are read where the car goes straight: the mean lateral acceleration and yaw rate over whole cycles
are the readings of these sensors at zero, as on a straight road, and handwheel angle and torque have theirs on the mean
of both branches, where the lateral acceleration is zero. These zeros are subtracted, and a note tells them if they are
large: `evaluate` prints it, and the page and the JSON file hold it. A driver who steers about another angle than
straight ahead, on a road that is straight, looks the same as an offset of the sensor. A zero of the handwheel angle
that drifts linearly through these recordings, or those of a rig, is found from the means of the cycles and does not
move where they are cut; in other tests it stays. The scale of a sensor cannot be found in a recording: declare it.

Road needs no script. Its values are those of a loop that the hands sweep slowly, by a regression of the torque over the
irregular motion of a driver (`steer_env/metrics/road.py`). The repeats are blocks of ten seconds between gaps. The
handwheel angle counts from that at which the lateral acceleration is zero, if that is known, else from the sensor's
zero; the lateral acceleration from its sensor's zero. Without a lateral acceleration it is speed times yaw rate, which
is told. Against slow weaves of the same simulated car, widths come out from 18 % too small (the rear-drive saloon with
LuGre friction) to 18 % too large (the compact with Masing friction). In that saloon the intervals of the widths over
the handwheel angle hold the truth in half of the drives; in six other pairs of car and law, 98 % of all intervals do.

Other tests begin straight ahead if 0.5 to 1 s of the recording is before the first input: sine, step, transition, swept
sine, pulse, crosswind, lane changes, and circles that are entered from straight ahead. What the sensors read there is
subtracted from the cross plots of `validate`, and the angle's reading where the ramps of the transition are found; it
is told. From the other metrics of these tests an offset drops out, as they are differences of two sides or of before
and after: 2 deg, 0.05 N m, 0.1 m/s2 or 0.5 deg/s change none by more than 0.1 %, but dead bands of the transition by up
to 2 % (their intervals are +-11 %), and 0.1 m/s2 the gradients of the circles by up to 0.6 %. A torque that friction
holds before the input counts as the sensor's zero there. Random steering, release, returnability, hold, parking and
catch-up have no such part; nor has a recording that begins with the input, or in a turn above 0.5 deg/s. Then
`validate` says so and compares the readings as they are: give the offsets in a mapping.

`python -m tests.maintain verify synthetic` prints how often the intervals hold known answers behind such faults, for
weave and slow ramp metric by metric.

## What `validate` does not tell

With each agreement `validate` says which changes of the simulated car it would have shown. The default tolerances pass
an equal car whose sensors are off by 2 deg, 2 % + 0.05 N m and noise. They must therefore
pass cars that differ by less than that. With noise, the simulated compact against itself:

- a `boost_scale` of 1.1 or 0.9 passes in weave and slow ramp (largest distance 0.54 to 0.79 tolerances), and 1.1 in
  sine, step and most transitions too. It changes torques by 2 to 3 %, which `torque_at_0p1g` and
  `peak_handwheel_torque` of a weave tell, with intervals of +-0.3 %; but a torque sensor whose scale is known to 2 %
  reads as far off;
- Masing and Dahl friction with the same parameters pass as LuGre (0.15 and 0.13 in the weave);
- half the Coulomb friction, a viscous damper in its place, and Coulomb friction without presliding fail (2.2, 1.4 and
  1.2 in the weave).

Narrower tolerances in a file of one's own (`--tolerances own.toml`) tell more where the sensors are better.

## What is refused

A whole recording: without the handwheel angle (where a test needs it) or with another unit than its channel has; with
gaps above 0.1 s or uneven steps; sampled below four times the low-pass; at a speed 3 % off the prescribed one, or, in
periodic tests, with cycles whose speeds are 3 % or amplitudes 20 % apart, at a frequency 10 % off, or with fewer than
three settled cycles (slow ramp: two); with fewer steps, sweeps or segments than the test needs; with a lateral
acceleration that is not 1/4 to 4 times speed and yaw rate, a yaw rate for every handwheel angle that no car has, or an
angle that no road allows, which are the sizes of a wrong unit (weave, slow ramp, step, sine, transition, swept sine,
random steering, road, circle at constant speed). In these tests the torque bounds the angle too, if nothing tells how
the car moves: the handwheel turns by the twist of the torsion bar at least, so more than 5 N m/deg + 1 N m (twice the
stiffest bar and the friction above it, assumed) is a wrong unit. A wrong unit that stays below that is not found out
without yaw rate or lateral acceleration.

Road leaves gaps and speeds below 29 km/h out. It is refused with fewer than six blocks, with a handwheel that rests,
with an angle that at its speed no tyre holds, with a torque that hardly varies (hands off) or falls to the left, and,
but for the corrections, with fewer than 12 of them. A class of speed needs six blocks with a second within the window,
and 2 % of the samples beyond half of it on either side. Heights and widths are refused where friction seems to build up
over 2.5 deg or more, as without any friction.

`evaluate` and `validate` also refuse a recording of another test than the one asked for, two of different tests, and
two whose `speed_m_s` or `frequency_hz` are 3 % or 10 % apart ([recordings.md](recordings.md)).

A single metric: without one of its channels; where a channel has samples that are not finite or a size that no sensor
reads; where a channel opposes the handwheel angle, which is a wrong sign; at a peak lateral acceleration outside the
range in which the metric means something; where a level is not reached; where a response is not coherent (0.9); where
the doubts above make it unreadable. The reason says what to do.
"""
_ENVIRONMENTS = """# Environments

`python -m tests.maintain glossary` writes this page from the tasks in `steer_env/tasks/`.
`import steer_env` registers the ids; `gymnasium.make(id)` makes an environment, `gymnasium.make_vec(id, num_envs=N)` a
vector environment. What ids share stands once, under the group that they belong to; the section of an id has what it
has beyond that. `help(gymnasium.make(id).unwrapped)` and the page of the id in the site have all of it together. The
last sections give the versions, the sensor noise, the arguments of the driving ids, of the two tuning ids (in which a
step is a set of assist parameters with its tests) and of the vector environments, and how to copy them.
"""
_HISTORY = """
## Version history

The first version of an id is v0. A bare version is that of every id; an id with another number for the same change, or
with a change of its own, is named.
"""
_SENSORS = """
## Sensor noise

Standard deviation of the white noise that `sensor_noise=1` adds to each observation at every control step; it is that
of good production sensors, assumed. Observations that are not listed have no noise.
"""
_VECTOR = """
## Vector environments

`gymnasium.make_vec("steer_env/AssistWeave-v3", num_envs=64, threads=2, autoreset_mode="SameStep")` steps 64
sub-environments in two threads and resets a finished one in the same step. A vector environment of a tuning id drives
parameter sets in worker processes (below); `steer_env.experiments.learning.parameter_sets` drives many of them on other
machines, too. Gymnasium's own vector environments of an id (`vectorization_mode="sync"`) give the same observations,
rewards, infos and pictures to the bit.
"""
_STATE = """
## Copies: state, pickle, deepcopy

Single and vector environments of the driving ids give a copy of their state and take one:

```python
state = env.unwrapped.get_state()  # a steer_env.engine.state.State; include_rng=False leaves the generator out
env.unwrapped.set_state(state)  # continue from there, as often as wanted
vector.unwrapped.set_state(state)  # every sub-environment continues from there: branches for a planner
vector.unwrapped.get_state().row(3)  # the state of one sub-environment, which a single environment takes too
```

A state holds the plant with its friction, the drawn episode (conditions, path, wind, road surface), driver models, the
delay line of the observations, accumulated metrics, the last action, whether an episode is over and its reset pending,
and the random generator with its seed. From it an environment goes on to the bit. `state.observations` are the present
observations of the environment that gave it.

- **What it fits.** Id, car, tyre, chassis, law, driver model, road and `control_dt` must be those of the environment
  that gave the state; otherwise `set_state` raises an error that names what differs. What is drawn or set for an
  episode (speed, load, parameters of the law) comes with the state. Ranges of `randomise`, `weights`, `normalise`, the
  time limit and the autoreset mode stay those of the environment that takes it. `State.version` is that of the format:
  a state of another version is refused, so store seeds and actions for longer.
- **What a planner knows.** Wind, road surface and path are drawn at the reset, so a copy foresees them, and with the
  generator the sensors' noise too. After `get_state(include_rng=False)` each copy draws its later noise, and its next
  episodes, from its own generator. `examples/plan_by_cross_entropy.py` plans this way.
- **What is not in it.** Wrappers and spaces keep memories of their own (`TimeLimit` its count, `OrderEnforcing` whether
  there was a reset), and a picture begins its trace at the state. `copy.deepcopy` and `pickle` copy those as well, at
  any moment, for the tuning ids too; a window's copy opens a window of its own.
"""


def metrics_page() -> str:
    """Tests and metrics as Markdown: a metric of several tests is defined in one, the weave where it has it."""
    home: dict[str, str] = {}
    for test in ("weave", *metrics.tests()):
        home |= {name: test for name in metrics.available(test) if name not in home}
    parts = [_METRICS]
    for test in metrics.tests():
        parts.append(f"\n## {test}\n\n{_about(test)}")
        names = metrics.available(test)
        for other in dict.fromkeys(home[name] for name in names if home[name] != test):
            alike = ", ".join(f"`{name}`" for name in names if home[name] == other)
            parts.append(f"As in [{other}](#{other}): {alike}.\n")
        if own := [name for name in names if home[name] == test]:
            parts.append(_definitions(test, own))
    return "\n".join(parts).rstrip() + "\n"


def metrics_of(test: str) -> str:
    """What a test is, with the table of its metrics."""
    return f"{_about(test)}\n{_definitions(test, metrics.available(test))}"


def _about(test: str) -> str:
    if test not in manoeuvres.available():
        return ""
    about = manoeuvres.make(test)
    return f"{about.definition} {about.source[0].upper()}{about.source[1:]}.\n"


def _definitions(test: str, names: Sequence[str]) -> str:
    """The definitions of metrics as a table, without columns that are empty."""
    rows = []
    for name in names:
        entry = metrics.definition(name)
        usual = f"{entry.usual[0]:g} to {entry.usual[1]:g}" if entry.usual and test == "weave" else ""
        text = entry.definition.replace("+-", "±").replace("|", "\\|")
        noticed = f"{just_noticeable.SHARE:.0%}".replace("%", " %") if just_noticeable.applies(name) else ""
        rows.append((f"`{name}`", entry.unit, text, usual, noticed, entry.source))
    return _without_empty(("metric", "unit", "definition", "usual", "noticed", "source"), rows)


def _without_empty(head: tuple[str, ...], rows: Sequence[tuple[str, ...]]) -> str:
    """A table of the columns that have contents."""
    filled = [k for k in range(len(head)) if any(row[k] for row in rows)]
    return table(tuple(head[k] for k in filled), [tuple(row[k] for k in filled) for row in rows])


def _documentation(name: str) -> str:
    entry_point = gym.spec(name).entry_point
    assert isinstance(entry_point, str)
    return (load_env_creator(entry_point).__doc__ or "").strip()


def _options(name: str) -> str:
    """The reset options of an id with their ranges on its default chassis."""
    if name in DRIVEN:
        known = reset_options(tasks.task(_short(name)))
    else:
        scenario = SCENARIOS[_short(name)]
        known = {key: RANGES[key] for key in DRAWN_CONDITIONS} | {"speed": (*SPEEDS, RANGES["speed"][2])}
        known["road_friction"] = (scenario.least_road_friction, *RANGES["road_friction"][1:])
    rows = [(f"`{key}`", f"{low:g} to {high:g}", meaning) for key, (low, high, meaning) in known.items()]
    return table(("option", "range", "meaning"), rows)


def _short(name: str) -> str:
    """Name of the task or scenario of an id."""
    return name.removeprefix("steer_env/").rpartition("-")[0]


def _folded(text: str) -> str:
    """The text with one row for the points of a path or of a target, which differ in the time ahead only."""
    row = re.compile(r"^\| (\d+) \| (path|target) ([\d.]+)s: ([^|]*) \| ([^|]*) \| ([^|]*) \|(.*)\n", re.MULTILINE)
    found = list(row.finditer(text))
    if not found:
        return text
    indices, (name, *_), times, (meaning, *_), (bound, *_), usual, (unit, *_) = zip(*(each.groups() for each in found))
    told = ", ".join(times) if len(times) < 5 else f"{times[0]}, {times[1]} ... {times[-1]}"
    size = usual[0] if len(set(usual)) == 1 else f"{usual[0]} to {usual[-1]}"
    meaning = re.sub(r"[\d.]+ s (from now )?", "", meaning)
    whole = f"| {indices[0]}-{indices[-1]} | {name} at {told} s: {meaning} | {bound} | {size} |{unit}\n"
    return text[: found[0].start()] + whole + text[found[-1].end() :]


def environment(name: str) -> str:
    """Documentation of an id: its docstring with the ranges of the options and one row for the path."""
    text = _folded(_documentation(name))
    options = re.compile(r"(?<=fixes what would be drawn:\n\n)(\|.*\n)+")
    return options.sub(lambda _: _options(name) + "\n", text, count=1).replace("\n## ", "\n### ")


def _without_usual(text: str) -> str:
    """The text with the usual sizes of the observations in a sentence, so that ids share the rows."""
    row = re.compile(r"^(\| (?:index|[\d-]+) \| (?:[^|]+ \| ){2})([^|]+) \| ([^|]+ \|)$", re.MULTILINE)
    usual = [found[2] for found in row.finditer(text)][1:]
    if not usual:
        return text
    told = text.replace("in SI units.", f"in SI units. The usual sizes are {', '.join(usual)}.", 1)
    return row.sub(r"\1\3", told).replace(
        "|---|---|---|---|---|\n| 0 | handwheel", "|---|---|---|---|\n| 0 | handwheel", 1
    )


def _runs(text: str) -> str:
    """The text with one row for observations in succession that have the same meaning."""
    row = r"\| (\d+) \| ([^:|]+): ([^|]*) \| ([^|]*) \| ([^|]*) \|\n"
    run = re.compile(rf"^{row}(?:\| \d+ \| [^:|]+: \3 \| .*\n)+", re.MULTILINE)

    def folded(found: re.Match[str]) -> str:
        indices, names, _, bounds, units = zip(*re.findall(row, found[0]))
        sizes = sorted(set(bounds), key=float)
        bound = sizes[0] if len(sizes) == 1 else f"{sizes[0]} to {sizes[-1]}"
        unit = units[0] if len(set(units)) == 1 else "by name"
        return f"| {indices[0]}-{indices[-1]} | {found[3]}: {', '.join(names)} | {bound} | {unit} |\n"

    return run.sub(folded, text)


# Heading of a section -> its sentences and rows in their order, each with the head of its table ("" for a sentence).
Document = dict[str, list[tuple[str, str]]]


def document(name: str) -> Document:
    """The sections of an id's documentation but for its history, taken apart."""
    text = _runs(_without_usual(environment(name)))
    found: Document = {}
    for section in ("### \n\n" + text).partition("### Version history")[0].split("### ")[1:]:
        heading, _, rest = section.partition("\n\n")
        found[heading] = []
        for block in filter(None, rest.strip().split("\n\n")):
            if block.startswith("|"):
                head, line, *rows = block.split("\n")
                found[heading] += [(f"{head}\n{line}", row) for row in rows]
            else:
                found[heading] += [("", each) for each in re.split(r"(?<=[.:]) (?=[A-Z`])", " ".join(block.split()))]
    return found


def shared(documents: Sequence[Document]) -> Document:
    """What stands in each of the documents, in the order of the first."""
    first = documents[0].items()
    return {
        heading: [part for part in parts if all(part in each.get(heading, ()) for each in documents)]
        for heading, parts in first
    }


def besides(own: Document, common: Document) -> Document:
    """What a document has beyond another one."""
    return {heading: [part for part in parts if part not in common.get(heading, ())] for heading, parts in own.items()}


def as_text(found: Document) -> str:
    """A document put together; sections without contents are left out."""
    blocks = []
    for heading, parts in found.items():
        title = [f"**{heading}.**"] if parts and heading else []
        for head, group in groupby(parts, key=lambda part: part[0]):
            texts = [text for _, text in group]
            blocks += ["\n".join([head, *texts])] if head else [" ".join([*title, *texts])]
    return "\n\n".join(blocks) + "\n"


def kinds(name: str) -> tuple[str, ...]:
    """Titles of the groups that an id belongs to, from the widest on."""
    if name not in DRIVEN:
        return ("Tuning ids",)
    task = tasks.task(_short(name))
    role = "Driver ids" if task.action.ramped else "Assist ids"
    path = "on a path" if any(quantity.name == "lateral_offset" for quantity in task.observed) else "without a path"
    return "Driving ids", role, f"{role} {path}"


def _grouped(names: Iterable[str], level: int = 0, above: Document | None = None) -> Iterator[str]:
    """Ids by their groups: what a group shares beyond the one above it, down to what an id has alone."""
    for title, group in groupby(names, key=lambda name: kinds(name)[level]):
        documents = {name: document(name) for name in group}
        common = shared(list(documents.values()))
        yield f"\n## {title}\n\n{as_text(besides(common, above or {}))}"
        if level + 1 < len(kinds(next(iter(documents)))):
            yield from _grouped(documents, level + 1, common)
        else:
            for name, own in documents.items():
                yield f"\n### `{name}`\n\n{as_text(besides(own, common))}"


def _history() -> str:
    """What the versions of the ids changed, each change once with the version that it made."""
    names = [_short(name) for name in REGISTERED]
    lines = []
    for change in reversed(CHANGES):
        for of, text in change.items():
            if text == FIRST:
                continue
            sought = re.compile(rf"^(v\d+): .*{re.escape(text.strip())}", re.MULTILINE)
            made = {name: found[1] for name in names if of in ("", name) and (found := sought.search(history(name)))}
            usual = Counter(made.values()).most_common(1)[0][0]
            apart = [f"{name} {version}" for name, version in made.items() if of or version != usual]
            title = ", ".join(apart if of else [usual, *apart])
            lines.append(f"* {title}: {text.strip()}")
    return "\n".join(lines)


def environments_page() -> str:
    """Every id as Markdown: first what several share, then by id what differs."""
    overview = table(("id", "action at 1", "decides every", "what it asks"), [_row(name) for name in REGISTERED])
    sections = [_ENVIRONMENTS, overview, *_grouped(sorted(REGISTERED, key=kinds))]
    sections.append(f"{_HISTORY}\n{_history()}")
    units = {quantity.name: quantity.unit for task in tasks.available() for quantity in tasks.task(task).observed}
    # The points of the path have the same noise: the row of the first stands for all.
    shown = {re.sub("^path_.*", "path, each point", name): name for name in reversed(SENSOR_NOISE)}
    noise = [(label.replace("_", " "), f"{SENSOR_NOISE[name]:g}", units[name]) for label, name in shown.items()][::-1]
    sections += [_SENSORS, table(("observation", "deviation", "unit"), noise)]
    for title, made in (("driving", SteerEnv), ("tuning", TuneEnv)):
        sections.append(f"\n## Arguments of the {title} ids\n\n```text\n{inspect.getdoc(made)}\n```")
    sections += [_VECTOR, f"```text\n{inspect.getdoc(SteerVectorEnv)}\n```", "\nOf the tuning ids:\n"]
    sections += [f"```text\n{inspect.getdoc(TuneVectorEnv)}\n```", _STATE.rstrip()]
    return "\n".join(sections) + "\n"


def _row(name: str) -> tuple[str, str, str, str]:
    """An id's row in the overview."""
    link = f"[`{name}`](#{_anchor(name)})"
    asks = " ".join(_documentation(name).split("\n\n")[0].split()).split(". ")[0].rstrip(".") + "."
    if name not in DRIVEN:
        return link, f"{len(SCENARIOS[_short(name)].parameters)} parameters", "episode", asks
    task = tasks.task(_short(name))
    return link, f"{task.action.scale:g} {task.action.unit}", f"{1e3 * task.control_dt:g} ms", asks


def _anchor(name: str) -> str:
    """Anchor of a heading, as GitHub makes it."""
    return name.lower().replace("/", "")


def default(section: str, key: str) -> Any:
    """Default of a key of a car file, None where it has none."""
    make = CONSTRUCTORS.get(section)
    return signature(make).parameters[key].default if make else declared_keys()[section][key].default


def _default_in_words(section: str, key: str, about: Key) -> str:
    value = default(section, key)
    if value is None:
        return "none" if about.optional else ""
    if isinstance(value, str):
        return value
    return "table" if np.size(value) > 2 else ", ".join(f"{one:g}" for one in np.ravel(value))


def _keys(section: str) -> str:
    """The keys of a section of a car file as a table, without columns that are empty."""
    rows = []
    for key, about in declared_keys()[section].items():
        usual = "{:g} to {:g}".format(*about.usual) if about.usual else ""
        rows.append(
            (f"`{key}`", about.meaning, about.unit, _default_in_words(section, key, about), about.allowed, usual)
        )
    head = ("key", "meaning", "unit", "default", "allowed", "usual")
    return _without_empty(head, rows)


def _usual() -> str:
    """What passenger cars have of quantities that several keys determine, as a table."""
    rows = []
    for q in plausible.USUAL:
        if q.keys:
            unit = "" if q.unit == "1" else f" {q.unit}"
            rows.append((q.name, f"{q.low:g} to {q.high:g}{unit}", "" if q.source == JUDGEMENT else q.source))
    return table(("quantity", "usual", "source"), rows)


def car_files_page() -> str:
    """The page of car files with the tables of its keys."""
    made = {**{section: _keys(section) for section in declared_keys()}, "What is usual": _usual()}
    text = (DOCS / "car_files.md").read_text(encoding="utf-8")
    for title, rows in made.items():
        before, heading, rest = text.partition(f"\n## {title}\n")
        found = re.search(r"^\|(.|\n\|)*\n", rest, re.MULTILINE)
        assert found, title
        first, last = found.span()
        text = before + heading + rest[:first] + rows + "\n" + rest[last:]
    return text


PAGES: dict[Path, Callable[[], str]] = {
    DOCS / "metrics.md": metrics_page,
    DOCS / "environments.md": environments_page,
    DOCS / "car_files.md": car_files_page,
}


def write() -> list[Path]:
    """Write the pages; their files."""
    for path, page in PAGES.items():
        path.write_text(page(), encoding="utf-8")
    return list(PAGES)
