"""A free drive at uniform steps, checked: what is wrong with it is told in a sentence, and refused where it matters.

The torque stays as recorded, interpolated to the steps. Samples that say nothing of (H1) are left out of every fit:
gaps with what is beside them, and slow driving.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from steer_env.hand_torque.model import RATE, Array, Prior, lateral_acceleration, prior_from_meta, smoothed
from steer_env.recording.recording import Recording, low_passed
from steer_env.recording.units import COUNTS

ASSISTANCE = "assistance_active"  # channel that is not zero where something else than the hands steers
USUAL = {"vehicle_speed": ("speed", "velocity", "v"), "torsion_bar_torque": ("handwheel_torque", "torque")}
TORQUES = ("handwheel_torque", "torsion_bar_torque", "motor_torque")  # that a car which follows the drive has too
FOLLOWS = 0.3  # correlation from which on one of these follows another; that of a motor at rest does not; assumed [1]
FINE_CUTOFF = 12.0  # low-pass of the angle that shows what the stronger one of the fit takes away [Hz]
SHORTEST = 30.0  # of what is fitted and judged together; assumed [s]
GAP = 0.1  # between two rows, from which on nothing is interpolated [s]
EXCLUSION_MARGIN = 0.5  # of what is left out, on both sides, as the low-pass reaches there [s]
SLOWEST = 1.0  # below, tyres are turned on the spot and not as they roll; assumed [m/s]
STANDSTILL = 0.1  # speed up to which a car stands; assumed [m/s]
JUMP = 20.0  # change of the speed that is the sensor's and not the car's; assumed [m/s2]
FASTEST = 70.0  # that no recorded drive reaches, 99th percentile of the speed; assumed [m/s]
LARGEST = 12.0  # lateral acceleration that no passenger car reaches, 99th percentile of the drive [m/s2]
STILL = np.radians(0.15)  # standard deviation of an angle that is not steered; assumed [rad]
CORRECTION_TRAVEL = np.radians(0.5)  # travel between two reversals that counts as a correction; assumed [rad]
FEWEST = 12  # corrections from which friction is identified; assumed [1]
LIGHT, WINDOW = 0.04, 2.0  # deviation of the torque of hands that do not steer [N m], in windows of this length [s]
HANDS_OFF_SHARE = 0.7  # share of such windows from which on the hands are taken to be off; assumed [1]


class Drive(NamedTuple):
    """A drive at uniform steps."""

    time: Array  # (T,) [s]
    angle: Array  # (T,) handwheel angle, smoothed [rad]
    fine_angle: Array  # (T,) handwheel angle, smoothed at ``FINE_CUTOFF`` only [rad]
    speed: Array  # (T,) [m/s]
    torque: Array  # (T,) torque of the torsion bar, or of the hands, as recorded [N m]
    torques: Mapping[str, Array]  # (T,) each: those of ``TORQUES`` that were recorded and follow each other [N m]
    weight: Array  # (T,) 0 where a sample is left out, else 1 [1]
    prior: Prior  # of the lateral acceleration
    turns: int  # corrections: reversals of the angle after at least ``CORRECTION_TRAVEL``
    notes: tuple[str, ...]
    record_notes: tuple[str, ...]  # those that are of the recording, and not of a fit of (H1)

    @property
    def dt(self) -> float:
        """Step [s]."""
        return 1.0 / RATE

    @property
    def lateral_acceleration(self) -> Array:
        """Lateral acceleration (T,) of a steady turn [m/s2]."""
        return lateral_acceleration(self.prior, self.angle, self.speed)


def prepared(recording: Recording, prior: Prior | None = None, slowest: float = SLOWEST) -> Drive:
    """A drive from a recording with ``handwheel_angle``, ``torsion_bar_torque`` and ``vehicle_speed``.

    Where it has ``yaw_rate`` or ``lateral_acceleration``, the gain of (H2) is fitted to it. Its other ``TORQUES`` are
    kept for a car that follows the drive. What is slower than ``slowest`` [m/s] is left out.

    Raises
    ------
    ValueError
        For a missing channel, torque in counts, an angle or a torque of another unit or sign, hands that are off, or
        less than ``SHORTEST`` of use; with the remedy.
    """
    named, left_out = _channels(recording)
    time, weight, notes = uniform_samples(recording, named)
    notes += left_out
    read = {channel: at_instants(recording, name, time) for channel, name in named.items()}
    angle = smoothed(read["handwheel_angle"], 1.0 / RATE)
    speed, torque = read["vehicle_speed"], read["torsion_bar_torque"]
    jumps = np.abs(np.gradient(speed, 1.0 / RATE)) > JUMP
    for what, where in (
        ("is driven in reverse", speed < -STANDSTILL),
        ("stands still", np.abs(speed) <= STANDSTILL),
        (f"is slower than {3.6 * slowest:.3g} km/h", (speed > STANDSTILL) & (speed < slowest)),
        (f"is where the speed changes by more than {JUMP:g} m/s2, which no car does,", _widened(jumps)),
    ):
        if where.any():
            weight = np.where(where, 0.0, weight)
            notes += (f"{_share(where)} of the drive {what} and is left out",)
    if weight.sum() / RATE < SHORTEST:
        raise ValueError(
            f"{weight.sum() / RATE:.0f} s of the drive can be used ({'; '.join(notes)}), and {SHORTEST:.0f} s are "
            f"needed: a longer drive, faster than {3.6 * slowest:.3g} km/h, without gaps and steered by hands"
        )
    used = weight > 0.0
    prior = prior_from_meta(recording.meta) if prior is None else prior
    _check_unit(prior, angle[used], speed[used])
    prior, told = _measured(recording, prior, time, angle, speed, used)
    notes += _check_torque(angle, torque, used)
    torques = {}
    for channel, name in named.items():
        if name in TORQUES:
            if _follows(name, read[channel][used], torque[used]):
                torques[name] = read[channel]
            else:
                notes += (f"{name} does not follow the other torques, and is not compared with a car",)
    record_notes, notes = notes, (*notes, *told)
    turns = len(reversals(angle[used]))
    if turns < FEWEST:
        notes += (
            f"the angle turns back {turns} times after {np.degrees(CORRECTION_TRAVEL):g} deg or more, and friction "
            "shows at such "
            f"corrections: {FEWEST} are needed, so that no friction law is fitted to this drive by itself",
        )
    fine = low_passed("handwheel_angle", read["handwheel_angle"], FINE_CUTOFF, RATE)
    return Drive(
        time, angle, fine, speed, torque, torques, weight, prior, turns=turns, notes=notes, record_notes=record_notes
    )


def reversals(angle: Array, travel: float = CORRECTION_TRAVEL) -> list[float]:
    """Where an angle (T,) [rad] turns back, by at least ``travel`` and after as much [rad]."""
    found, side, end = [], 0.0, float(angle[0])
    for x in angle:
        if side * (x - end) > 0.0 or (side == 0.0 and abs(x - end) >= travel):
            side, end = side or float(np.sign(x - end)), float(x)
        elif side and abs(x - end) >= travel:
            found.append(end)
            side, end = -side, float(x)
    return found


def _channels(recording: Recording) -> tuple[dict[str, str], tuple[str, ...]]:
    """Channel that is needed, or is one of ``TORQUES`` -> its name in the recording; and what is told of it."""
    found = {}
    for channel, unit in {"handwheel_angle": "rad", "torsion_bar_torque": "N m", "vehicle_speed": "m/s"}.items():
        names = [name for name in (channel, *USUAL.get(channel, ())) if name in recording.channels]
        if not names:
            raise ValueError(
                f"the drive has no {channel} [{unit}]; it has {', '.join(recording.channels)}: name it with "
                f'--map {channel}="name in the file[unit]", or in a --mapping'
            )
        if recording.units[names[0]] == COUNTS:
            raise ValueError(
                f"{names[0]} is in counts of its sensor, and a hand torque in N m cannot be identified from it: give "
                f"its calibration, --map {channel}=NAME[Nm],scale=N_M_PER_COUNT"
            )
        if recording.units[names[0]] != unit:
            raise ValueError(f"{names[0]} is in {recording.units[names[0]]}, and {channel} is needed in {unit}")
        found[channel] = names[0]
    left_out = {}
    for name in (name for name in TORQUES if name in recording.channels and name not in found.values()):
        if recording.units[name] == COUNTS:
            left_out[name] = "is in counts of its sensor"
        elif recording.units[name] != "N m":
            left_out[name] = f"is in {recording.units[name]} and not in N m"
        elif np.isnan(recording[name]).all():
            left_out[name] = "has no values"
        else:
            found[name] = name
    return found, tuple(f"{name} {why}, and is not compared with a car" for name, why in left_out.items())


def uniform_samples(recording: Recording, named: dict[str, str]) -> tuple[Array, Array, tuple[str, ...]]:
    """Uniform instants (T,) [s], weights (T,), 0 where samples are left out, and what is told of it.

    Left out are gaps of the channels and where ``ASSISTANCE`` steers, both with ``EXCLUSION_MARGIN``.

    Parameters
    ----------
    recording : Recording
    named : dict of str to str
        Channel, in the words of a message -> its name in the recording.

    Raises
    ------
    ValueError
        For a channel without values, or with too few of them a second.
    """
    time = np.arange(recording.time[0], recording.time[-1], 1.0 / RATE)
    weight, notes = np.ones_like(time), []
    total = 0.0
    flagged = {ASSISTANCE: ASSISTANCE} if ASSISTANCE in recording.channels else {}
    for channel, name in {**named, **flagged}.items():
        there = ~np.isnan(recording[name])
        if there.sum() < 2:
            raise ValueError(f"{name} has no values: check the column of {channel}")
        step = float(np.median(np.diff(recording.time[there])))
        if channel in named and step > (1.0 - 1e-6) * GAP:
            raise ValueError(
                f"{name} has {1.0 / step:.3g} values a second, and more than {1.0 / GAP:g} are needed: record it with "
                f"{2.0 / GAP:g} or more"
            )
        at = np.concatenate([recording.time[:1], recording.time[there], recording.time[-1:]])
        for k in np.flatnonzero(np.diff(at) > GAP):
            inside = (time > at[k] - EXCLUSION_MARGIN) & (time < at[k + 1] + EXCLUSION_MARGIN)
            total = max(total, at[k + 1] - at[k])
            weight[inside] = 0.0
    if total:
        notes.append(
            f"{np.mean(weight == 0.0):.0%} of the drive is in gaps of more than {GAP:g} s or beside them, the longest "
            f"of {total:.2g} s, and is left out"
        )
    if flagged:
        active = at_instants(recording, ASSISTANCE, time) != 0.0
        weight[_widened(active)] = 0.0
        notes.append(f"an assistance steers in {_share(active)} of the drive, which is left out")
    notes.append(
        f"resampled at {RATE:g} Hz from {round((recording.time.size - 1) / np.ptp(recording.time), 1):g} rows a second"
    )
    return time, weight, tuple(notes)


def _widened(where: Any) -> Any:
    """Samples (T,) that are marked, with ``EXCLUSION_MARGIN``."""
    return np.convolve(where, np.ones(2 * round(EXCLUSION_MARGIN * RATE) + 1), "same") > 0.0


def _share(where: Any) -> str:
    """A share of samples in words."""
    return f"{where.mean():.0%}" if where.mean() >= 0.01 else "less than 1%"


def at_instants(recording: Recording, name: str, time: Array) -> Array:
    """A channel (T,) in its unit at instants (T,) [s], interpolated linearly between its samples and in its gaps."""
    there = ~np.isnan(recording[name])
    return np.interp(time, recording.time[there], recording[name][there])


def _check_unit(prior: Prior, angle: Array, speed: Array) -> None:
    """ValueError for a speed of no drive, and for an angle that would be a turn of no car, or none at all."""
    fast = float(np.quantile(speed, 0.99))
    if fast > FASTEST:
        raise ValueError(
            f"the speed reaches {fast:.4g} m/s, {3.6 * fast:.0f} km/h: is it in km/h? Give the unit, "
            "--map vehicle_speed=NAME[km/h]"
        )
    turn = float(np.quantile(np.abs(lateral_acceleration(prior, angle, speed)), 0.99))
    if turn > LARGEST:
        raise ValueError(
            f"the handwheel angle, up to {np.degrees(np.abs(angle).max()):.4g} deg at {3.6 * speed.mean():.0f} km/h, "
            f"would be a lateral acceleration of {turn:.3g} m/s2: is it in deg, or the speed in km/h? Give the unit, "
            "--map handwheel_angle=NAME[deg] or --map vehicle_speed=NAME[km/h]"
        )
    if np.std(angle) < STILL:
        raise ValueError(
            f"the handwheel angle varies by {np.degrees(np.std(angle)):.2g} deg (standard deviation) only: is it in "
            "rad and was read in deg, --map handwheel_angle=NAME[rad]? A drive without steering identifies nothing"
        )


def _measured(
    recording: Recording, prior: Prior, time: Array, angle: Array, speed: Array, used: Any
) -> tuple[Prior, tuple[str, ...]]:
    """The prior with the gain that a yaw rate or lateral acceleration shows; ValueError for an angle of other sign."""
    for name in ("yaw_rate", "lateral_acceleration"):
        if name not in recording.channels or recording.units[name] not in ("rad/s", "m/s2"):
            continue
        values = at_instants(recording, name, time) * (speed if name == "yaw_rate" else 1.0)
        x, y = lateral_acceleration(prior, angle, speed)[used], values[used]
        if not np.std(y) > 0.0:
            continue
        share = float(np.corrcoef(x, y)[0, 1])
        gain = float(np.polyfit(x, y, 1)[0])
        if share < -0.5:
            raise ValueError(
                f"{name} turns right where the handwheel angle turns left (correlation {share:.2f}): the sign of one "
                "of them is wrong, --map handwheel_angle=NAME,sign=-1"
            )
        if share > 0.7 and not 0.2 < gain < 5.0:
            raise ValueError(
                f"{name} is {gain:.3g} times what the handwheel angle gives with a ratio of {prior.ratio:g}: the unit "
                "of one of them is wrong, --map handwheel_angle=NAME[deg]"
            )
        if share > 0.7:
            return prior._replace(gain=gain), (f"the gain of the lateral acceleration is fitted to {name}: {gain:.3g}",)
    return prior, ("no yaw rate: ratio, wheelbase and understeer are the stated prior",)


def _follows(name: str, values: Array, torque: Array) -> bool:
    """Whether a torque follows that of the hands, or of the torsion bar; ValueError where it has the other sign."""
    share = float(np.corrcoef(values, torque)[0, 1]) if min(np.std(values), np.std(torque)) > 0.0 else 0.0
    if share < -FOLLOWS:
        raise ValueError(
            f"{name} pushes right where the other torques push left (correlation {share:.2f}): its sign is wrong, "
            f"--map {name}=NAME,sign=-1"
        )
    return share > FOLLOWS


def _check_torque(angle: Array, whole: Array, used: Any) -> tuple[str, ...]:
    """What is told of the torque; ValueError where it falls with the angle, or where the hands are off.

    It is compared in changes over a window, as a bank at low speed asks for a torque out of the bend.
    """
    torque, size = whole[used], int(WINDOW * RATE)
    if torque.std() > 50.0:
        raise ValueError(
            f"the torque varies by {torque.std():.3g} N m, which no hand gives: it may be in counts of its sensor; "
            "give its unit, --map torsion_bar_torque=NAME[counts], or its scale"
        )
    windows = torque[: torque.size // size * size].reshape(-1, size)
    light = float(np.mean(windows.std(axis=1) < LIGHT))
    if light >= HANDS_OFF_SHARE:
        raise ValueError(
            f"in {light:.0%} of the drive the torque varies by less than {LIGHT:g} N m: the hands are off the wheel, "
            f"or an assistance steers; a hand torque needs hands; a channel {ASSISTANCE} leaves out where one steers"
        )
    both = used[size:] & used[:-size]
    share = float(np.corrcoef((angle[size:] - angle[:-size])[both], (whole[size:] - whole[:-size])[both])[0, 1])
    if share < -0.3:
        raise ValueError(
            f"the torque falls where the handwheel turns left (correlation {share:.2f}): the sign of angle or torque "
            "is wrong, --map handwheel_angle=NAME,sign=-1 or --map torsion_bar_torque=NAME,sign=-1"
        )
    if light > 0.1:
        return (
            f"in {light:.0%} of the drive the torque hardly varies, as with hands off or an assistance that steers, "
            f"which a channel {ASSISTANCE} would leave out",
        )
    return ()
