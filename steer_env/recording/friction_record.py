"""A record of friction from a recording: displacement and the friction that resists it, checked, in one pair of units.

A rig measures both. A car measures neither: :mod:`steer_env.recording.column_balance` separates the friction of its
column from assist, rack force, inertia and damping. The units are rad and N m, or m and N; a lever converts the latter.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from steer_env.friction import defaults, fitted_file
from steer_env.friction.identification.displacement import displacement_noise, smoothed_motion
from steer_env.friction.identification.quality import DRIFT, clipped
from steer_env.friction.numerics.check import not_negative, positive
from steer_env.recording import friction_checks as checks
from steer_env.recording.channel_mapping import FRICTION
from steer_env.recording.friction_checks import Array
from steer_env.recording.recording import Recording, low_passed, require_moderate

# Names that columns have for a channel, in English and German, without spaces and in lower case.
USUAL = {
    "displacement": (
        *("displacement", "columnangle", "position", "travel", "stroke", "angle", "rotation", "x"),
        *("weg", "winkel", "drehwinkel"),
    ),
    "displacement_speed": ("displacementspeed", "columnspeed", "speed", "velocity", "v", "w", "drehzahl"),
    "friction": (
        *("friction", "frictiontorque", "frictionforce", "torque", "force", "t", "f"),
        *("reibmoment", "reibkraft", "drehmoment", "moment", "kraft"),
    ),
    "load": ("load", "normalforce", "rackforce", "normalkraft", "last"),
}
# Channels that hold more than friction: what a car measures.
OF_A_CAR = ("handwheel_torque", "torsion_bar_torque", "motor_torque", "rack_force")
CUTOFF = 10.0  # of the low-pass before an angle is differentiated; assumed: motion is below 3 Hz [Hz]
JITTER = 0.5  # of the median step: time steps that differ more are refused, not resampled [1]
PAIRS = {("rad", "N m"), ("m", "N")}


@dataclass(frozen=True, eq=False)
class FrictionRecord:
    """Displacement and friction at uniform steps.

    Attributes
    ----------
    x, friction : (T,) arrays
        Displacement and the friction that resists positive motion [``units``].
    load : (T,) array or None
        Load on the contact, without sign [N or N m].
    dt, start : float
        Step, and the time of the first sample [s].
    units : dict
        Of ``displacement`` and ``torque``: rad and N m, or m and N.
    notes : tuple of str
        What was done to the recording, and what a reader has to know.
    converted : str
        How :meth:`with_lever` or :meth:`to_column` changed its units; empty as recorded.
    factors : dict
        Factors on ``displacement`` and ``torque`` that :meth:`scaled` and :meth:`to_column` have applied.
    """

    x: Array
    friction: Array
    dt: float
    units: Mapping[str, str]
    load: Array | None = None
    start: float = 0.0
    notes: tuple[str, ...] = ()
    converted: str = ""
    factors: Mapping[str, float] = field(default_factory=lambda: {"displacement": 1.0, "torque": 1.0})

    @property
    def time(self) -> Array:
        """Time of the samples (T,) [s]."""
        return self.start + self.dt * np.arange(self.x.size, dtype=float)

    @cached_property
    def motion(self) -> Array:
        """The displacement (T,) without its noise; itself where the noise is too small to matter."""
        return smoothed_motion(self.x, displacement_noise(self.x))

    @property
    def of_a_column(self) -> bool:
        """Whether its laws are in rad and N m, as those that drive a steering column are."""
        return dict(self.units) == fitted_file.UNITS

    def part(self, samples: slice) -> "FrictionRecord":
        """The record of some of its samples, one after the other."""
        load = None if self.load is None else self.load[samples]
        start = float(self.time[samples][0])
        return replace(self, x=self.x[samples], friction=self.friction[samples], load=load, start=start)

    def with_lever(self, radius: float) -> "FrictionRecord":
        """The record of a force at a radius [m] as torque and angle; a load stays as it is."""
        radius = positive("lever", radius)
        told = f"travel and force became angle and torque by a lever of {1e3 * radius:g} mm"
        given = self.units
        found = self._scaled(
            1.0 / radius if given["displacement"] == "m" else 1.0, radius if given["torque"] == "N" else 1.0, told
        )
        return replace(found, units=fitted_file.UNITS)

    def to_column(
        self, level: float = defaults.F_C, distance: float = defaults.F_C / defaults.SIGMA_0
    ) -> "FrictionRecord":
        """The record stretched to the level [N m] and the pre-sliding distance [rad] of a steering column.

        It keeps the shape of its loops and its time; nothing of the column was measured. By default level and distance
        are those that the default laws share.
        """
        own = checks.scales(self.motion, self.friction)
        u = self.units
        told = (
            f"stretched to a column: level {own.level:.4g} {u['torque']} became {level:g} N m, pre-sliding distance "
            f"{own.distance:.4g} {u['displacement']} became {math.degrees(distance):.3g} deg; the time is as recorded. "
            "The level is the plateau of the record, not the saturated friction of a law, which can be larger"
        )
        found = self._scaled(positive("distance", distance) / own.distance, positive("level", level) / own.level, told)
        return replace(found, units=fitted_file.UNITS)

    def _scaled(self, displacement: float, torque: float, told: str) -> "FrictionRecord":
        old = self.factors
        return replace(
            self,
            x=displacement * self.x,
            friction=torque * self.friction,
            notes=(*self.notes, told),
            converted=told,
            factors={"displacement": old["displacement"] * displacement, "torque": old["torque"] * torque},
        )


def uniform(recording: Recording) -> tuple[Recording, tuple[str, ...]]:
    """A recording at uniform steps, and what was done to it; short gaps are closed.

    Raises
    ------
    ValueError
        For a gap that is too long, or steps that differ too much.
    """
    whole = recording.bridged()
    notes: tuple[str, ...] = ()
    closed = whole.time.size - recording.time.size
    empty = max((int(np.isnan(values).sum()) for values in recording.channels.values()), default=0)
    if closed or empty:
        notes = (f"gaps of up to 0.1 s are closed by straight lines: {closed} rows, {empty} cells of a channel",)
    try:
        whole.rate  # noqa: B018
        return whole, notes
    except ValueError:
        steps = np.diff(whole.time)
        step = float(np.median(steps))
        k = int(np.argmax(np.abs(steps - step)))
        if abs(steps[k] - step) > JITTER * step:
            raise ValueError(
                f"the time steps are not uniform: {steps[k]:.4g} s at {whole.time[k]:g} s, the median is {step:.4g} s; "
                "resample the file to a uniform rate before, or use a part with between(t0, t1)"
            ) from None
        told = f"the time steps vary ({steps.min():.4g} to {steps.max():.4g} s): resampled at {1.0 / step:.4g} Hz"
        return whole.resampled(1.0 / step), (*notes, told)


def from_recording(
    recording: Recording,
    *,
    sign: int | None = None,
    inertia: float = 0.0,
    without_drift: bool = False,
    cutoff_hz: float = CUTOFF,
) -> FrictionRecord:
    """The record of friction that a rig's recording holds.

    Parameters
    ----------
    recording : Recording
        With the channels of ``channel_mapping.FRICTION``, or some under usual names: displacement or its speed,
        friction, and perhaps a load.
    sign : 1 or -1, optional
        1 where the friction is positive when it resists positive motion; by default the work tells it.
    inertia : float
        Of what moves between the contact and the sensor of the friction; its torque is subtracted [kg m2 or kg].
    without_drift : bool
        Take a straight line out of the friction's zero.
    cutoff_hz : float
        Of the low-pass before the displacement is differentiated for the inertia [Hz].

    Raises
    ------
    ValueError
        For missing channels, units that do not fit, gaps, exchanged columns, or a sign that is not seen; with the
        remedy.
    """
    require_moderate(recording)
    named = _channels(recording)
    others = (name for name in recording.channels if name not in named.values())
    recording, notes = uniform(recording.without(*others))
    dt = 1.0 / recording.rate
    friction = recording[named["friction"]]
    if "displacement" in named:
        x, unit = recording[named["displacement"]], recording.units[named["displacement"]]
    else:
        from scipy.integrate import cumulative_trapezoid  # here, as its import takes longer than a start

        speed = named["displacement_speed"]
        x = cumulative_trapezoid(recording[speed], dx=dt, initial=0.0)
        unit = recording.units[speed].removesuffix("/s")
        notes += (f"the displacement is the integral of {speed!r}, whose offset would let it drift",)
    units = {"displacement": unit, "torque": recording.units[named["friction"]]}
    load = np.abs(recording[named["load"]]) if "load" in named else None
    told = ", ".join(f"{channel} = {name!r}" for channel, name in named.items() if channel != name)
    notes = (*([f"channels by their names: {told}"] if told else []), *notes)
    if not_negative("inertia", inertia):
        sense = checks.sign(smoothed_motion(x, displacement_noise(x)), friction) if sign is None else float(sign)
        speed = np.gradient(low_passed("displacement", x, cutoff_hz, recording.rate), dt)
        friction = friction - sense * inertia * np.gradient(speed, dt)
        unit = "kg m2" if units["torque"] == "N m" else "kg"
        notes += (
            f"the torque of {inertia:g} {unit} is subtracted, with the displacement low-passed at {cutoff_hz:g} Hz",
        )
    record = FrictionRecord(x, friction, dt, units, load, float(recording.time[0]), notes)
    return checked(record, sign, without_drift)


def checked(record: FrictionRecord, sign: int | None, without_drift: bool = False) -> FrictionRecord:
    """The record with the sign by which its friction resists positive motion, and notes of faults.

    Errors are those of :func:`from_recording`.
    """
    _check_moves(record)
    x = record.motion
    found = checks.sign(x, record.friction) if sign is None else float(sign)
    notes = record.notes
    share = found * checks.work(x, record.friction)
    if share < -checks.LEAST_WORK:
        raise ValueError(
            f"--sign {found:.0f} contradicts the work: with it, the friction would drive the motion (net work "
            f"{share:.0%} of what goes in and out) instead of resisting it; leave --sign out, or give --sign "
            f"{-found:.0f}; or check that displacement and friction are the columns they should be"
        )
    if found < 0.0:
        why = "as --sign says" if sign is not None else "as the work that it takes shows"
        notes += (f"the friction was recorded with the other sign, {why}: it is turned to resist positive motion",)
    friction = found * record.friction
    checks.check_columns(x, friction)
    if told := clipped(friction):
        notes += (told,)
    slope, share = checks.drift(record.time, x, friction)
    if abs(share) > DRIFT:
        text = f"the zero of the friction drifts by {share:.1%} of its level over the record"
        if without_drift:
            friction = friction - slope * (record.time - record.time.mean())
            text += ": a straight line is taken out"
        else:
            text += ": take it out with --without-drift, or cut the record with --between"
        notes += (text,)
    sizes = {"displacement": 0.5 * float(np.ptp(x)), "friction": checks.mean_friction(x, friction)}
    for (name, size), unit in zip(sizes.items(), record.units.values()):
        least, most = checks.USUAL[unit]
        if not least < size < most:
            what = "half the travel" if name == "displacement" else "the mean friction"
            notes += (
                f"{what} is {size:.3g} {unit}, where contacts of steerings have {least:g} to {most:g}: check the unit "
                f'of the {name}, and name it with --map {name}="name in the file[unit]"',
            )
    return replace(record, friction=friction, notes=notes)


def _check_moves(record: FrictionRecord) -> None:
    """ValueError unless both arrays vary and their units belong together or can be converted."""
    for name, values in (("displacement", record.x), ("friction", record.friction)):
        if not np.all(np.isfinite(values)) or np.ptp(values) == 0.0:
            raise ValueError(f"the {name} does not vary over the record: check the column, or use another part of it")


def check_units(record: FrictionRecord) -> None:
    """ValueError where angle and force, or travel and torque, stand side by side, which only a lever makes one law."""
    pair = record.units["displacement"], record.units["torque"]
    if pair not in PAIRS:
        raise ValueError(
            f"the displacement is in {pair[0]} and the friction in {pair[1]}, which do not fit: a friction law needs "
            "rad and N m, or m and N. Give --lever METRES, the radius at which the force acts; or correct a unit with "
            '--map, e.g. friction="name in the file[Nm]"'
        )


def _channels(recording: Recording) -> dict[str, str]:
    """Channel of ``FRICTION`` -> name in the recording; ValueError where one is missing or may be any of several."""
    named: dict[str, str] = {}
    for channel, units in FRICTION.items():
        fitting = {name: unit for name, unit in recording.units.items() if unit in units}
        if channel in fitting:
            named[channel] = channel
            continue
        for usual in USUAL[channel]:
            found = [name for name in fitting if plain(name) == usual and name not in FRICTION]
            if len(found) == 1:
                named[channel] = found[0]
                break
    if "friction" not in named or not {"displacement", "displacement_speed"} & named.keys():
        raise ValueError(_missing(recording, named))
    if "displacement" in named:
        named.pop("displacement_speed", None)
    return named


def _missing(recording: Recording, named: Mapping[str, str]) -> str:
    """What a recording lacks, what it has, and what to do."""
    lacks = "friction" if "friction" not in named else "displacement"
    units = " or ".join(FRICTION[lacks])
    has = ", ".join(f"{name!r} [{unit}]" for name, unit in [*recording.units.items()][:12]) or "no channel with a unit"
    left = f"; not read: {recording.meta['not_read']}" if "not_read" in recording.meta else ""
    remedy = (
        f'name it with --map {lacks}="name in the file[unit]", or in a --mapping, which names every channel '
        "(--template writes one)"
    )
    text = f"no channel of the recording is known as the {lacks} [{units}]; it has {has}{left}: {remedy}"
    if any(name in recording.channels for name in OF_A_CAR):
        text += (
            "; or, where this is a record of a car, give --vehicle NAME, with which the friction of the column is "
            "separated from assist, rack force and inertia"
        )
    return text


def plain(name: str) -> str:
    """The last part of a name in small letters, without spaces and marks."""
    return "".join(letter for letter in name.rpartition(".")[2].lower() if letter.isalnum())
