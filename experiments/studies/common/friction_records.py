"""Friction laws judged by records: fitted on the first part of a record, compared on the rest.

Some are measured: that of the packaged rig, stretched to the level and the pre-sliding distance of a column, and the
hand torque of drives on roads, of which friction is a part. The synthetic ones are of each law, with noise, and tell
which law is taken for which.
"""

import math
from collections.abc import Mapping, Sequence
from importlib.resources import as_file
from importlib.resources import files as resources
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env import friction
from steer_env.friction import defaults
from steer_env.friction.identification import periods
from steer_env.friction.identification.compare import HELD_OUT
from steer_env.friction.law import LAWS
from steer_env.hand_torque import Identified, identify
from steer_env.recording import friction_checks, friction_record, read
from steer_env.recording.recording import DEGREE, Recording

Array = NDArray[np.float64]

NOISES = (0.01, 0.05)  # of the synthetic torque, over F_c [1]
BREAK_AWAY, STRIBECK_SPEED = 1.4, 0.1  # F_s over F_c, and v_s [rad/s] of the synthetic records; assumed
SYNTHETIC_STEP = 0.01  # [s]


class Judged(NamedTuple):
    """A law on the part of a record that it was not fitted to."""

    law: str
    parameters: Any  # None where the law could not be fitted
    error: float  # RMS of the residual while the record moves, over the mean friction [1]
    low: float  # 95 % interval [1]
    high: float  # [1]
    undetermined: tuple[str, ...]  # parameters that the fitted part does not determine
    remarks: tuple[str, ...]  # warnings of the fit, or why there is none
    alike: tuple[str, ...] = ()  # laws that the part that judges cannot tell from this one
    offset: float = 0.0  # of the friction, fitted with the law [N m]


def rig() -> friction_record.FrictionRecord:
    """The packaged record of a reciprocating rig, stretched to a steering column."""
    r, units = friction.records.read("rig"), {"displacement": "m", "torque": "N"}
    return friction_record.FrictionRecord(r.x, r.torque, r.dt, units, r.load).to_column()


ROADS = ("mkz_2016", "mkz_2016_traffic")  # drives of one car: a motorway with bends, and stop-and-go


def road_drive(name: str = ROADS[0]) -> Recording:
    """A packaged drive on a road, a file of ``experiments/data/road`` with its mapping."""
    with as_file(resources("steer_env.experiments").joinpath("data", "road")) as folder:
        return read(folder / f"{name}.csv.gz", folder / f"{name}.toml")


def judge_on_road(laws: Sequence[str]) -> Identified:
    """The hand torque of the packaged drives, as of one car, with each law; a job of the sweep."""
    return identify([road_drive(name) for name in ROADS], laws=laws)


def repeatability(record: friction_record.FrictionRecord) -> float:
    """RMS difference of one period from the next over the mean friction, where the record judges and moves [1]."""
    first = record.x.size - round(HELD_OUT * record.x.size)
    found = periods.repeatability(record.motion, record.friction, first)
    if found is None:
        raise ValueError("the record has no two equal periods in the part that judges")
    return found / friction_checks.mean_friction(record.motion, record.friction)


def judge(job: tuple[friction_record.FrictionRecord, Sequence[str]]) -> list[Judged]:
    """Fit laws to the first part of a record and judge them on the last, the best first; a job of the sweep."""
    record, laws = job
    mean = friction_checks.mean_friction(record.motion, record.friction)
    found = []
    for each in friction.compare(friction.Record(record.x, record.friction, record.dt), laws, held_out=HELD_OUT):
        if each.fit is None:
            found.append(Judged(each.law, None, math.nan, math.nan, math.nan, (), (each.refused,)))
            continue
        error, low, high = (value / mean for value in (each.residual, *each.interval))
        of = each.fit
        told = of.undetermined, of.warnings, each.alike, of.offset
        found.append(Judged(each.law, of.parameters, error, low, high, *told))
    return found


def true_laws(names: Sequence[str]) -> dict[str, Any]:
    """Laws with the shared calibration and, where they have one, a friction that falls with speed."""
    found = {}
    for name in names:
        p = friction.make(name)
        changed = {"F_s": BREAK_AWAY * defaults.F_C, "v_s": STRIBECK_SPEED}
        own = {key: value for key, value in changed.items() if key in p._fields}
        if {"F_s", "sigma_1", "sigma_2"} <= set(p._fields):
            own["sigma_2"] = p.sigma_1 * (BREAK_AWAY - 1.0)  # (F10)
        found[name] = friction.make(name, **(p._asdict() | own)) if own else p
    return found


# Synthetic records: amplitude [deg], frequency [Hz] and number of cycles, of the part that is fitted and of the rest.
RECORDS = {
    "one stroke at one speed": (((4.0, 0.1, 3),), ((4.0, 0.1, 3),)),
    "many strokes and speeds": (
        ((6.0, 0.1, 2), (3.0, 0.5, 4), (4.0, 0.2, 2), (1.0, 0.2, 2), (0.3, 0.5, 3)),
        ((5.0, 0.15, 2), (2.0, 0.4, 3), (0.6, 0.3, 2), (3.0, 1.0, 4)),
    ),
}


def displacement(record: str) -> tuple[Array, int]:
    """Displacement of a kind of synthetic record [rad], and the sample from which on it judges."""
    parts = [
        np.concatenate([a * np.sin(2.0 * np.pi * f * np.arange(0.0, n / f, SYNTHETIC_STEP)) for a, f, n in pieces])
        for pieces in RECORDS[record]
    ]
    return DEGREE * np.concatenate(parts), parts[0].size


class Confusion(NamedTuple):
    """Which laws remain possible for one synthetic record."""

    record: str  # of ``RECORDS``
    truth: str
    noise: float  # over F_c [1]
    seed: int
    errors: dict[str, float]  # law -> RMS on the part that judges, over F_c; NaN where it could not be fitted [1]
    remain: tuple[str, ...]  # laws that the part that judges does not tell from the best one


def confuse(job: tuple[str, Mapping[str, Any], str, float, int]) -> Confusion:
    """Fit every law to a noisy record of one law; a job of the sweep.

    A law remains where :func:`steer_env.friction.compare` cannot tell it from the best one.
    """
    record, laws, truth, noise, seed = job
    x, start = displacement(record)
    clean = friction.response(laws[truth], x, SYNTHETIC_STEP)
    rng = np.random.default_rng([seed, *map(ord, truth)])
    measured = clean + noise * defaults.F_C * rng.standard_normal(x.size)
    found = friction.compare(friction.Record(x, measured, SYNTHETIC_STEP), list(laws), held_out=slice(start, None))
    left = {each.law: each.residual / defaults.F_C if each.fit is not None else math.nan for each in found}
    remain = {found[0].law, *found[0].alike}
    return Confusion(
        record, truth, noise, seed, {law: left[law] for law in laws}, tuple(law for law in laws if law in remain)
    )


def shares(found: Sequence[Confusion], record: str, noise: float) -> dict[str, dict[str, float]]:
    """True law -> candidate -> share of the records of a kind and noise for which the candidate remains [1]."""
    mine = [each for each in found if (each.record, each.noise) == (record, noise)]
    table: dict[str, dict[str, float]] = {}
    for truth in dict.fromkeys(each.truth for each in mine):
        of = [each for each in mine if each.truth == truth]
        table[truth] = {law: sum(law in each.remain for each in of) / len(of) for law in of[0].errors}
    return table


def fittable(names: Sequence[str]) -> list[str]:
    """The laws that can be fitted to a record."""
    return [name for name in names if name in LAWS and LAWS[name].fitted]
