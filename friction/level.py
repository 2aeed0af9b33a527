"""The level of friction: a factor on the saturated torque of every law, by load, position, temperature and direction.

    L = L_0 (1 + c_F |F|) (1 + b cos(n (x - x_b))) exp(-c_theta (theta - theta_0))         (F11)
    L_+ = L (1 + a) in positive motion,    L_- = L (1 - a) in negative motion              (F11)

F is the load, L_0 a factor of the episode, n the number of periods in a turn of x. A law knows one scale at a time.
Within a step the side of the motion is known before its speed: it is that to which R of the step equation (F7) exceeds
the mean torque of a step at rest, as in :func:`steer_env.friction.law.step`. So :func:`choose_scale` takes the scale of
that side beforehand, with two rules for a memory (bristle, springs) that is loaded:

* A memory holds what break-away allows in the direction in which it is loaded: it is cut back to L_+ where the torque
  at rest is positive, to L_- where it is negative.
* A motion takes the scale of its own side only where the mean torque of a step at rest is the same with both. Else it
  goes on with the scale that the memory was loaded with: where the other one could not hold the memory, until it does,
  and of a law that relaxes, until the torque at rest changes its sign. The torque is therefore continuous in R and at a
  reversal, and the only solution of the step equation lies on the side that was chosen. A set-valued law sticks for
  -L_- F_c <= R <= L_+ F_c.

A law is passive however its scale changes from step to step, and so it is with both sides. With ``a = 0`` nothing of
this is computed. The level is never negative, at any position; a step takes that of its middle, as the speed before it
predicts.

Sources: growth with the load in proportion and different levels by direction, ASME IDETC 2015, V003T01A007 (rig of an
electric power steering, abstract). The cosine is assumed: an order of the turn, as of a joint (2) or of a mesh of teeth
(their number), is the first harmonic of what repeats with it. The exponential of the temperature is that of a
lubricant's viscosity (Reynolds, Phil. Trans. 177 (1886) 157); that it acts on the saturated torque, and not on a
viscous part alone, is assumed.
"""

import math
import warnings
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from steer_env.friction import law
from steer_env.friction.law import advance, rest_torque, torque
from steer_env.friction.numerics.bounds import within
from steer_env.friction.numerics.check import not_negative, number, numbers
from steer_env.friction.numerics.kernel import kernel, plainly
from steer_env.friction.numerics.simd import all_of, any_of, where


class Level(NamedTuple):
    """How the saturated friction depends on its conditions; :func:`make` checks. The defaults leave it as it is."""

    load: float = 0.0  # c_F: relative increase by load, over its unit [1/N] in a plant, whose load is the rack force
    asymmetry: float = 0.0  # a: relative increase in positive motion, decrease in negative motion [1]
    temperature_rate: float = 0.0  # c_theta: relative decrease by temperature, at first [1/K]
    temperature_rise: float = 0.0  # theta - theta_0: temperature above that at which the law's parameters hold [K]
    position: float = 0.0  # b: relative increase by position at its peak, decrease half a period from it [1]
    order: float = 1.0  # n: periods of that in a turn, of the column in a plant [1]
    peak: float = 0.0  # x_b: where it is largest [rad]


class Scales(NamedTuple):
    """Factors on the saturated friction by the direction of motion."""

    positive: float  # L_+ [1]
    negative: float  # L_- [1]


LARGEST_INCREASE = 0.9  # of a relative increase, so that some friction is left where it decreases; assumed [1]
UNCUT = 1e15  # scale with which no memory is cut back [1]
LIMITS = {  # (low, high), so that both directions keep some friction and the exponential stays a moderate factor
    "asymmetry": (-LARGEST_INCREASE, LARGEST_INCREASE),  # [1]
    "temperature_rate": (-0.05, 0.05),  # [1/K]
    "temperature_rise": (-100.0, 100.0),  # [K]
    "position": (-LARGEST_INCREASE, LARGEST_INCREASE),  # [1]
    "order": (0.01, 1000.0),  # [1]
    "peak": (-100.0, 100.0),  # [rad]
}


def make(
    *,
    load: float = 0.0,
    asymmetry: float = 0.0,
    temperature_rate: float = 0.0,
    temperature_rise: float = 0.0,
    position: float = 0.0,
    order: float = 1.0,
    peak: float = 0.0,
) -> Level:
    """A checked :class:`Level`, from its fields.

    Warns of a temperature without its rate, which has no effect.

    Raises
    ------
    ValueError
        For a ``load`` below 0, or another value outside ``LIMITS``.
    """
    given = Level(load, asymmetry, temperature_rate, temperature_rise, position, order, peak)._asdict()
    checked = {key: number(key, given[key], minimum=low, maximum=high) for key, (low, high) in LIMITS.items()}
    level = Level(not_negative("load", load), **checked)
    if level.temperature_rise and not level.temperature_rate:
        warnings.warn(
            f"temperature_rise {level.temperature_rise:g} K has no effect: temperature_rate is 0; give the relative "
            "decrease of the friction by temperature, steering.friction_temperature_rate of a car [1/K]",
            stacklevel=2,
        )
    return level


@kernel
def scales(level, base, load, x):
    """L_+ and L_- of (F11) at a load and a position; ``base`` is L_0 [1].

    Beyond :data:`LIMITS`, as a parameter of an exported unit may be, position and asymmetry count as at their limits: a
    negative level would drive the steering.
    """
    position, asymmetry = (
        within(level.position, -LARGEST_INCREASE, LARGEST_INCREASE),
        within(level.asymmetry, -LARGEST_INCREASE, LARGEST_INCREASE),
    )
    L = base * (1.0 + level.load * abs(load))  # (F11)
    if any_of(position != 0.0):
        L *= 1.0 + position * math.cos(level.order * (x - level.peak))  # (F11)
    if any_of(level.temperature_rate != 0.0):
        L *= math.exp(-level.temperature_rate * level.temperature_rise)  # (F11)
    return Scales(L * (1.0 + asymmetry), L * (1.0 - asymmetry))  # (F11)


def largest(level: Level, base: float, load: float) -> float:
    """The largest scale at a load, over all positions and both directions of motion [1]."""
    return max(plainly(scales)(level._replace(position=abs(level.position)), base, load, level.peak))  # (F11)


def by_sample(level: Level, load: ArrayLike, x: ArrayLike, base: float = 1.0) -> NDArray[np.float64]:
    """Scales (T, 2) of positive and negative motion at the loads and positions (T,) of a record, in its units."""
    both = plainly(scales)
    return np.array([both(level, base, *each) for each in zip(numbers("load", load), numbers("x", x))])


@kernel
def choose_scale(p, scales, memory, R, h):
    """The scale with which a law takes a step that ``R`` drives; the memory is cut back to what break-away allows.

    Parameters
    ----------
    p : parameters of a law
    scales : Scales
    memory : (M,) array
    R : float
        Of the step equation [N m]; plus or minus infinity where the motion is prescribed.
    h : float
        Step [s].
    """
    if all_of(scales.positive == scales.negative):
        return scales.positive
    scale, rest = scale_at_rest(p, scales, memory, h)
    if all_of(R == rest):
        return scale
    own = own_scale(p, scales, scale, rest, memory, where(R > rest, 1.0, -1.0), h)
    return where(R == rest, scale, own)


@kernel
def scale_at_rest(p, scales, memory, h):
    """The scale with which a memory is loaded, which is cut back to what break-away allows; the mean torque at rest."""
    positive, negative = scales.positive, scales.negative
    if all_of(positive == negative):
        return positive, rest_torque(p, positive, memory, h)
    scale = where(positive > negative, positive, negative)
    loaded = torque(p, scale, memory, 0.0)
    cut = (loaded != 0.0) & (positive != negative)
    if any_of(cut):
        scale = where(cut, where(loaded > 0.0, positive, negative), scale)
        advance(p, where(cut, scale, UNCUT), memory, 0.0, 0.0)  # no motion and no time: only the cut
    return scale, rest_torque(p, scale, memory, h)


@kernel
def step(p, scales, memory, S, R, h, w_guess):
    """As :func:`steer_env.friction.law.step`, with the scale that :func:`choose_scale` takes."""
    return law.step(p, choose_scale(p, scales, memory, R, h), memory, S, R, h, w_guess)  # (F11)


@kernel
def own_scale(p, scales, held, rest, memory, side, h):
    """The scale of a motion to a side, from the one held and the mean torque of a step at rest with it."""
    own = where(side > 0.0, scales.positive, scales.negative)
    if all_of(own == held):
        return own
    return where((own == held) | (rest_torque(p, own, memory, h) == rest), own, held)
