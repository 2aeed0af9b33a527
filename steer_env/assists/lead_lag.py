"""Lead-lag feedback of the torsion-bar torque, in addition to the boost curve and its own lead.

    H(s) = gain (1 + s/lag_zero)/(1 + s/lag_pole) (1 + s/lead_zero)/(1 + s/lead_pole),    request = H T_tb

The filter is the plant's own (E15), :mod:`steer_env.vehicle.steering.assist.lead_lag`, at the control step. ``gain`` is
lowered until the margins hold at every slope of the boost curve at the speed at which an episode starts, in both loops
that contain the feedback: the loop opened at the torsion bar's torque, with boost and feedback together, as
:func:`steer_env.vehicle.steering.margins.margins` opens it for the boost alone; and the loop opened at the request,
with the boost closed. The margins of the first are read from its frequency response, with the hold over a control step
taken as the mean over its samples and aliases above half the control rate neglected; the second is exact. The corners
are chosen for AssistLaneChange and AssistLaneKeeping: above 1 Hz the feedback reduces the torque that road and friction
cause at the torsion bar, below it the steering torque stays. The default has no lag (its corners are equal): a lag that
raises the gain at low frequencies makes steering lighter than the reference feel. With twice the default gain the
margins still hold, but 20 ms of delay leave a released handwheel swinging.
"""

import itertools
import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from steer_env.assists.common.definition import Array, Baseline, register
from steer_env.assists.common.linear import Response, discretise, slopes
from steer_env.friction.numerics.check import number, positive
from steer_env.friction.numerics.kernel import kernel
from steer_env.vehicle.cars import Car
from steer_env.vehicle.steering import linear
from steer_env.vehicle.steering.assist import lead_lag as filter_law
from steer_env.vehicle.steering.eps import SAMPLE_TIME
from steer_env.vehicle.steering.linear import response

if TYPE_CHECKING:
    import control

GAIN_SEARCH_STEPS = 50  # of the search for the largest gain that keeps the margins
POINTS = 2000  # of each frequency response


@kernel
def _torques(p, gains, seen, x, out):
    """The feedback's torque in every row, each with its own gain."""
    for i in range(seen.shape[0]):
        out[i] = filter_law.torque(p, gains[i], x[i], seen[i].torsion_bar_torque)


def compensator(gain: float, p: filter_law.LeadLag, dt: float) -> "control.StateSpace":
    """H with a gain at 0 Hz, at a control step ``dt`` [s]."""
    import control

    lead, lag = (control.ss(-f.a1, f.b1 - f.a1 * f.b0, 1.0, f.b0, dt) for f in (p.lead, p.lag))
    return gain * lead * lag


class Loops(NamedTuple):
    """Frequency responses (P,) at one slope of the boost curve; open loops, for negative feedback."""

    boost: Response  # opened at the torsion bar's torque, of the boost alone
    added: Response  # opened at the torsion bar's torque, what H adds to it
    request: Response  # opened at the request, with the boost closed


def loops(car: Car, H: "control.StateSpace", slope: float, speed: float) -> Loops:
    """The loops that contain a compensator, at a slope of the boost curve [1] and a speed [m/s]."""
    dt = float(H.dt)
    n = round(dt / SAMPLE_TIME)
    fast, slow = (np.exp(1j * np.geomspace(1.0, 0.999 * math.pi / step, POINTS) * step) for step in (SAMPLE_TIME, dt))
    hold = np.mean([fast**-k for k in range(n)], axis=0)
    plant = response(linear.plant(car.column, car.assist, speed), fast)
    return Loops(
        -response(linear.answer(car.assist, slope), fast) * plant,
        -response(H, fast**n) * hold * plant,
        -response(H, slow) * response(discretise(car, slope, speed, dt), slow),
    )


def margins(loop: Response) -> tuple[float, float]:
    """Phase margin [rad] and gain margin [1], upwards or downwards, from an open loop's frequency response.

    The smallest of all crossings, with straight lines between the points; infinite without a crossing.
    """
    size, phase = np.abs(loop), np.unwrap(np.angle(loop))
    at = np.flatnonzero(np.diff(size > 1.0))
    turned = phase[at] + (phase[at + 1] - phase[at]) * (1.0 - size[at]) / (size[at + 1] - size[at])
    up = np.flatnonzero(np.diff(loop.imag > 0.0))
    share = loop.imag[up] / (loop.imag[up] - loop.imag[up + 1])
    real = loop.real[up] + share * (loop.real[up + 1] - loop.real[up])
    factors = np.maximum(-real[real < 0.0], -1.0 / real[real < 0.0])
    phases = np.abs((turned % (2.0 * math.pi)) - math.pi)
    return min(phases.tolist(), default=math.inf), min(factors.tolist(), default=math.inf)


class LeadLag(Baseline):
    """Lead-lag feedback of the torsion-bar torque.

    Parameters
    ----------
    env : assist environment
    gain : float
        Gain at low frequencies, lowered as far as the margins need it; negative for heavier steering [1].
    lag, lead : (float, float)
        Zero and pole, both below half the control rate [Hz].
    phase_margin : float
        Least phase margin [rad].
    gain_margin : float
        Least gain margin, a factor [1].
    """

    needs = ("speed", "torsion_bar_torque")
    tuned = {"gain": (0.02, 1.0), "phase_margin": (0.4, 1.2)}  # noqa: RUF012

    def __init__(
        self,
        env: Any,
        *,
        gain: float = 0.1,
        lag: tuple[float, float] = (20.0, 20.0),
        lead: tuple[float, float] = (1.0, 30.0),
        phase_margin: float = math.radians(30.0),
        gain_margin: float = 2.0,
    ) -> None:
        super().__init__(env)
        self.gain = number("gain", gain)
        corners = self._corners("lag", lag), self._corners("lead", lead)
        self._law = filter_law.make(self.control_dt, lead_lag_lag=corners[0], lead_lag_lead=corners[1])
        self.phase_margin = positive("phase_margin [rad]", phase_margin)
        self.gain_margin = number("gain_margin", gain_margin, minimum=1.0)
        self._designs: dict[float, float] = {}
        self._gains, self._x = np.zeros(self.n), np.zeros((self.n, len(filter_law.STATES)))

    def _corners(self, name: str, pair: Any) -> tuple[float, float]:
        if np.shape(pair) != (2,):
            raise ValueError(f"{name} [Hz] must be a pair of zero and pole, got {pair!r}")
        zero, pole = (number(f"{name} [Hz]", f, minimum=0.01, maximum=0.49 / self.control_dt) for f in pair)
        return zero, pole

    def design(self, speed: float) -> float:
        """The gain for a speed [m/s], as large as the margins allow [1]."""
        H = compensator(self.gain, self._law, self.control_dt)
        found = [loops(self.batch.car, H, slope, speed) for slope in slopes(self.batch.car, speed)]

        def allowed(share: float) -> bool:
            opened = [loop for one in found for loop in (one.boost + share * one.added, share * one.request)]
            pairs = map(margins, opened)
            return all(phase >= self.phase_margin and factor >= self.gain_margin for phase, factor in pairs)

        # From no feedback upwards: a loop that grows from a stable one and keeps its distance from -1 stays stable.
        shares = np.linspace(0.0, 1.0, GAIN_SEARCH_STEPS + 1)
        return self.gain * max(itertools.takewhile(allowed, shares), default=0.0)

    def begin(self, i: int, seen: Any) -> None:
        """Start at rest, with the gain for the speed rounded to whole m/s."""
        speed = float(round(abs(seen.speed)))
        if speed not in self._designs:
            self._designs[speed] = self.design(speed)
        self._gains[i], self._x[i] = self._designs[speed], 0.0

    def torque(self, seen: Any) -> Array:
        """Feedback of the torsion-bar torque [N m]."""
        out = np.zeros(self.n)
        _torques(self._law, self._gains, seen, self._x, out)
        return out


register("lead_lag", LeadLag)
