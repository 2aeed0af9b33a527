"""A mapping to check: the channels that are wanted, with a guess for each, and every column with unit and range."""

import json
from collections.abc import Mapping
from difflib import SequenceMatcher
from os import PathLike

import numpy as np

from steer_env.recording import can_log, files, friction_record
from steer_env.recording.friction_record import plain
from steer_env.recording.table import Column, Table, Values, time_column
from steer_env.recording.units import file_unit

HEAD = """\
# How to read {name}.
# Names without a # before them are guessed: check them, and the signs; a left turn is positive.
# Remove the # of further lines that apply, and fill in the name that the channel has in the file.
# value in SI = sign * scale * (reading - offset) in the unit; a channel that is late by delay_ms is moved back.
# The unit "counts" is that of a sensor without a calibration; signals of a CAN message may be added, "A + B".
# sign_from names the signal of a CAN message that is 1 where the reading of another, a magnitude, is negative.
"""
SETTINGS = ("# sign = 1", "# scale = 1.0", "# offset = 0.0", "# delay_ms = 0")
# Further names that files have for a channel, in English and German.
USUAL = {
    "handwheel_angle": ("steering wheel angle", "steer angle", "angle", "SWA", "Lenkwinkel", "Lenkradwinkel", "LRW"),
    "handwheel_torque": (
        *("steering wheel torque", "steer torque", "steer torque driver", "SWT", "WhlTrq", "Lenkmoment", "LRM"),
        *(
            "SteeringColumnTorque",
            "CR Mdps StrColTq",
            "STEERING_COL_TORQUE",
            "EPAS torsionBarTorque",
            "torsionBarTorque",
        ),
    ),
    "handwheel_speed": (
        "steering wheel speed",
        "steering angle rate",
        "steer rate",
        "WhlVel",
        "Lenkwinkelgeschwindigkeit",
    ),
    "vehicle_speed": ("speed", "velocity", "v", "vx", "Geschwindigkeit", "Fahrgeschwindigkeit", "v Fzg", "v Fahrzeug"),
    "lateral_acceleration": ("lat acc", "accel y", "ay", "Querbeschleunigung", "Querbeschl", "a quer"),
    "yaw_rate": ("yaw", "yaw velocity", "gyro z", "Gierrate", "Gierwinkelgeschwindigkeit"),
    "roll_angle": ("roll", "Wankwinkel"),
    **friction_record.USUAL,
    "sideslip_angle": ("slip angle", "beta", "Schwimmwinkel"),
}
# Hand torque in databases of cars that name no unit: how much one of their values is, by the name [N m].
TORQUES = {
    "crmdpsstrcoltq": 0.01,  # Hyundai and Kia
    "steeringcoltorque": 0.01,  # the same, CAN FD
    "steeringcolumntorque": 0.0625,  # Ford
    "epastorsionbartorque": 1.0,  # Tesla and Rivian, 0.01 a bit in the database
}
AGREE = 0.5  # correlation of two channels from which on it tells their signs; assumed [1]
LEAST_LIKENESS = 0.8  # likeness of a name from which on it tells what a column is; assumed [1]


def text(
    path: str | PathLike[str], channels: Mapping[str, str | tuple[str, ...]], can: can_log.Options | None = None
) -> str:
    """The text of a mapping file; a channel whose name and unit are clear is mapped, all else is a comment.

    Parameters
    ----------
    path : str or path
        The recorded file.
    channels : mapping of str to str or tuple of str
        Name and unit in memory of the channels that are wanted, or the units that one may have.
    can : can_log.Options, optional
        As for :func:`steer_env.recording.files.read`.

    Raises
    ------
    ValueError
        If the file cannot be read; the message names it.
    OSError
        If the file cannot be opened.
    """
    try:
        table = files.open_file(path, can)
        values = _values(table)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    found = {column: _range_words(column, samples) for column, samples in zip(table.columns, values)}
    samples = dict(zip(table.columns, values))
    lines = [HEAD.format(name=path)]
    place = time_column(table.columns)
    time = [] if place is None else [table.columns[place]]
    if table.timed:
        lines += _block("time", "s", time, found, ())
    wanted = {name: (units,) if isinstance(units, str) else units for name, units in channels.items()}
    offered = _similar_columns([column for column in table.columns if not (table.timed and column in time)], wanted)
    for name, units in wanted.items():
        lines += _block(name, units[0], offered[name], found, SETTINGS)
        if name == "handwheel_angle":
            lines[-1:] = [*_agreement(offered, samples), ""]
    lines += ["# [meta]", '# manoeuvre = ""', "# speed_m_s = ", "", "# Every column of the file:"]
    lines += [f"# {_quote(entry.label)}: {told}" for entry, told in found.items()]
    return "\n".join(lines) + "\n"


def _block(
    name: str, unit: str, offered: list[Column], found: Mapping[Column, str], settings: tuple[str, ...]
) -> list[str]:
    """The lines of a channel, with the unit of the first of the columns that are offered for it.

    A column without a unit is no guess, as another quantity or a sensor's counts may stand in it.
    """
    own = _spell_unit(offered[0]) if offered and offered[0].known else None
    off = "" if own and (name == "time" or _likeness(offered[0], name) >= LEAST_LIKENESS) else "# "
    lines = [f"{'# ' if k else off}from = {_quote(entry.label)}  # {found[entry]}" for k, entry in enumerate(offered)]
    lines = [f"{off}[channels.{name}]", *(lines or ['# from = ""'])]
    if offered and offered[0].sign:
        where = f"{offered[0].negative} where the reading is negative; check it"
        lines.append(f"{off}sign_from = {_quote(offered[0].sign)}  # {where}")
    lines.append(off + f'unit = "{own or file_unit(unit)}"')
    size = TORQUES.get(plain(offered[0].name)) if offered and name == "handwheel_torque" else None
    if size and not own:
        settings = (f"# scale = {size:g}  # one of its values in N m, in databases with this name; check it", *settings)
    return [*lines, *settings, ""]


def _agreement(offered: Mapping[str, list[Column]], samples: Mapping[Column, Values]) -> list[str]:
    """Comments on the sign of the handwheel angle, by its correlation with what a left turn makes positive, too."""
    lines = []
    by_label = {column.label: values for column, values in samples.items()}
    for other in ("yaw_rate", "lateral_acceleration"):
        pair = []
        for column in offered["handwheel_angle"][:1] + offered.get(other, [])[:1]:
            signs = by_label.get(column.sign, "lost") if column.sign else np.array(1 - column.negative)
            if not isinstance(samples[column], str) and not isinstance(signs, str):
                sign = np.where(np.abs(signs - column.negative) < 0.5, -1, 1)
                pair.append(sign * np.asarray(samples[column], dtype=float))
        if len(pair) < 2:
            continue
        both = np.array(pair).T[~np.isnan(pair).any(axis=0)].T
        if both.shape[1] < 2 or not np.ptp(both, axis=1).all():
            continue
        correlation = float(np.corrcoef(both)[0, 1])
        told = "so their signs are the same" if correlation > 0 else "so one of the two needs sign = -1"
        told = told if abs(correlation) >= AGREE else "too little to tell the sign"
        lines.append(f"# correlation with {_quote(offered[other][0].label)}, {other}: {correlation:.2f}, {told}")
    return lines


def _similar_columns(columns: list[Column], channels: Mapping[str, tuple[str, ...]]) -> dict[str, list[Column]]:
    """The columns by the channel whose name is most like theirs among those of their unit; the most alike come first.

    A column without a unit that is known is offered where its name is clear.
    """
    ranked: dict[str, list[tuple[float, Column]]] = {name: [] for name in channels}
    for column in columns:
        known = column.known
        fitting = [name for name, units in channels.items() if known is None or known[0] in units]
        alike = {name: _likeness(column, name) for name in fitting}
        best = max(alike, key=lambda name: alike[name], default=None)
        if best is not None and (known is not None or alike[best] >= LEAST_LIKENESS):
            ranked[best].append((alike[best], column))
    return {name: [column for _, column in sorted(pairs, key=lambda pair: -pair[0])] for name, pairs in ranked.items()}


def _likeness(column: Column, channel: str) -> float:
    """How much the name of a column is like one of those that a channel usually has, from 0 to 1."""
    name = plain(column.name)
    return max(SequenceMatcher(None, name, plain(usual)).ratio() for usual in (channel, *USUAL.get(channel, ())))


def _spell_unit(column: Column) -> str | None:
    """The unit of a column, with a slash where it is the end of a name."""
    return column.unit if column.unit is None or column.declares_unit else column.unit.replace("_", "/")


def _values(table: Table) -> list[Values]:
    """The samples of every column."""
    every = range(len(table.columns))
    if not table.timed:
        return table.load(every)[1:]
    time_first = sorted(every, key=lambda place: place != time_column(table.columns))
    loaded = dict(zip(time_first, table.load(time_first)))
    return [loaded[place] for place in every]


def _range_words(column: Column, values: Values) -> str:
    """The unit with the smallest and the largest value, or why there is none."""
    if isinstance(values, str):
        return values
    if np.isnan(values).all():
        return "has no values"
    return f"{_spell_unit(column) or 'no unit'}, {np.nanmin(values):.6g} to {np.nanmax(values):.6g}"


def _quote(label: str) -> str:
    """A label as a TOML string, which JSON's is as well."""
    return json.dumps(label, ensure_ascii=False)
