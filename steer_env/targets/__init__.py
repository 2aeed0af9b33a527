"""Target bands of metrics as data files with their provenance, and the rating of a value by its band."""

import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from steer_env import metrics
from steer_env.friction.numerics import toml
from steer_env.friction.numerics.check import number
from steer_env.metrics import Value

FOLDER = Path(__file__).parent
COLOURS = ("green", "amber", "red")


class Band(NamedTuple):
    """The target band of a metric [unit of the metric]."""

    good: tuple[float, float]  # green inside
    fair: tuple[float, float]  # amber inside, red outside

    def distance(self, value: float) -> float:
        """Distance of a value from the good band over the band's width, 0 inside [1]."""
        low, high = self.good
        return max(low - value, value - high, 0.0) / (high - low)


class Targets(NamedTuple):
    """Bands by test and metric."""

    name: str
    description: str
    source: str
    bands: dict[str, dict[str, Band]]

    def of_tests(self, tests: Iterable[str]) -> dict[str, Band]:
        """The bands for the metrics of tests, by metric; ValueError where there is none."""
        names = tuple(tests)
        bands = {name: band for test in names for name, band in self.bands.get(test, {}).items()}
        if not bands:
            raise ValueError(
                f"targets {self.name!r} have no band for {', '.join(names)}: add one, or give other targets"
            )
        return bands


class Rating(NamedTuple):
    """The rating of a value."""

    colour: str  # one of COLOURS
    sure: bool | None  # whether the whole 95 % interval has this colour; None where there is no interval


def available() -> tuple[str, ...]:
    """Names of the packaged targets."""
    return tuple(sorted(path.stem for path in FOLDER.glob("*.toml")))


def load(name: str) -> Targets:
    """Targets by packaged name or from a TOML file, which may begin with the bands of a packaged ``base``.

    Raises
    ------
    ValueError
        The name, a test or a metric is unknown, a unit is wrong, or a good band is not inside its fair band. The
        message names the file and what was expected.
    """
    if not isinstance(name, str):
        raise ValueError(f"targets must be one of {', '.join(available())}, or a .toml file, got {name!r}")
    path = Path(name) if name.endswith(".toml") else FOLDER / f"{name}.toml"
    if not path.is_file():
        raise ValueError(f"no targets {name!r}; there are {', '.join(available())}, or give a .toml file")
    data = toml.read(path)
    bands = {}
    if (base := data.pop("base", None)) is not None:
        if base not in available():
            raise ValueError(f"{path}, base: expected one of {', '.join(available())}, got {base!r}")
        bands = {test: dict(entries) for test, entries in load(base).bands.items()}
    texts = {}
    for key in ("name", "description", "source"):
        texts[key] = data.pop(key, None)
        if texts[key] is None:
            raise ValueError(
                f"{path}: {key} is missing; a file of targets begins with the texts name, description, source"
            )
        if not isinstance(texts[key], str) or not texts[key]:
            raise ValueError(f"{path}, {key}: expected a text, got {texts[key]!r}")
    for test, entries in data.items():
        if test not in metrics.tests() or not isinstance(entries, dict):
            raise ValueError(f"{path}, [{test}]: expected a table of a test out of {', '.join(metrics.tests())}")
        own = {key: _band(f"{path}, [{test}] {key}", test, key, entry) for key, entry in entries.items()}
        bands[test] = bands.get(test, {}) | own
    return Targets(**texts, bands=bands)


def _band(where: str, test: str, name: str, entry: Any) -> Band:
    if name not in metrics.available(test):
        raise ValueError(f"{where}: {test} has no such metric; there are {', '.join(metrics.available(test))}")
    if not isinstance(entry, dict) or entry.keys() != {"unit", "good", "fair"}:
        raise ValueError(f"{where}: expected unit, good and fair, got {entry!r}")
    unit = metrics.definition(name).unit
    if entry["unit"] != unit:
        raise ValueError(f"{where}: expected unit {unit!r}, got {entry['unit']!r}")
    ends = []
    for key in ("good", "fair"):
        pair = entry[key]
        numbers = isinstance(pair, list) and len(pair) == 2 and all(type(x) in (int, float) for x in pair)
        if not numbers or not pair[0] < pair[1]:
            raise ValueError(f"{where}, {key}: expected [low, high], got {pair!r}")
        ends.append((number(f"{where}, {key}", pair[0]), number(f"{where}, {key}", pair[1])))
    band = Band(*ends)
    if not band.fair[0] <= band.good[0] or not band.good[1] <= band.fair[1]:
        raise ValueError(f"{where}: good {list(band.good)} must lie in fair {list(band.fair)}")
    return band


def rating(value: Value, band: Band) -> Rating | None:
    """Green inside the good band, amber inside the fair one, otherwise red; None for a refused value."""
    if value.reason:
        return None

    def colour(x: float) -> str:
        inside = [low <= x <= high for low, high in band]
        return COLOURS[inside.index(True)] if True in inside else "red"

    own = colour(value.value)
    if math.isnan(value.low):
        return Rating(own, None)
    # The good band is inside the fair one, so an interval whose ends have one colour contains a better one only where
    # its ends are on both sides of the good band.
    flanks = value.low < band.good[0] and value.high > band.good[1]
    return Rating(own, not flanks and colour(value.low) == colour(value.high) == own)


def ratings(values: Mapping[str, Value], bands: Mapping[str, Band]) -> dict[str, Rating | None]:
    """Ratings of the metrics that have a band."""
    return {name: rating(values[name], band) for name, band in bands.items() if name in values}
