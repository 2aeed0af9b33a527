"""The experiments of the paper that introduced LuGre, reproduced, and what the other laws do in them.

:mod:`steer_env.experiments.studies.common.mass_experiments` runs them. Expected numbers are those of an adaptive
solver at 1e-9: given to the digits printed for pre-sliding, lag and hunting, and computed here for break-away and
stick-slip.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env import friction
from steer_env.experiments.pages import friction_pictures, pages, plots
from steer_env.experiments.pages.plots import Line, Panel
from steer_env.experiments.pages.style import colours
from steer_env.experiments.pages.words import number
from steer_env.experiments.studies.common import mass_experiments as mass
from steer_env.experiments.studies.common.mass_experiments import PAPER

Array = NDArray[np.float64]

PAGE_NAME = "canudas1995"
MICRO = 1e6  # micrometres in a metre
SETTLED = 50.0  # time from which on hunting is read, and length of the last part of it [s]
# Marks of an effect, assumed: a hundredth of F_c, a tenth of the time, a twentieth of the unit step, and what has to be
# left of a swing after 50 s.
VISIBLE_FORCE, STICK_SHARE, HUNTING_SWING, LASTING_SHARE = 0.01 * PAPER.F_c, 0.1, 0.05, 0.9
# Effect in words -> in a word.
EFFECTS = {
    "pre-sliding displacement": "pre-sliding",
    "frictional lag": "lag",
    "a break-away force that falls with the force rate": "break-away",
    "stick-slip": "stick-slip",
    "hunting": "hunting",
}
AT_REST = 1e-3  # speed below which the mass counts as sticking, a hundredth of the drawn end's [m/s]


class Number(NamedTuple):
    """A number of the paper's experiments and the one found here."""

    what: str
    expected: float  # [unit]
    found: float  # [unit]
    tolerance: float  # [unit]
    unit: str

    @property
    def share(self) -> float:
        """The difference over the tolerance [1]."""
        return float(abs(self.found - self.expected) / self.tolerance)

    @property
    def agrees(self) -> bool:
        """Whether the difference is within the tolerance."""
        return self.share <= 1.0


def presliding_numbers() -> list[Number]:
    """Displacement at the corners of the force; the tolerance is the digits printed and 0.001 um of the step."""
    motion = mass.presliding(PAPER)
    times = mass.PRESLIDING_TIMES[1:]
    found = MICRO * np.interp(times, motion.t, motion.x)
    return [
        Number(f"displacement at {t:g} s", expected, float(x), 0.006, "µm")
        for t, expected, x in zip(times, (44.88, 45.18, -9.71, -10.07, 44.82), found)
    ]


def lag_numbers() -> list[Number]:
    """Friction at 1.5 mm/s while the speed falls and rises, and at constant speed; to the digits printed."""
    rows = []
    expected = {1.0: (1.05270, 1.05392), 10.0: (1.04831, 1.06109), 25.0: (1.04347, 1.07956)}
    for omega, (falling, rising) in expected.items():
        found = mass.lag(PAPER, omega)
        rows.append(Number(f"friction, speed falling, {omega:g} rad/s", falling, found.falling, 0.6e-5, "N"))
        rows.append(Number(f"friction, speed rising, {omega:g} rad/s", rising, found.rising, 0.6e-5, "N"))
    return [*rows, Number("friction, constant speed", 1.05330, mass.steady(PAPER, 1.5 * mass.LAG_SPEED), 0.6e-5, "N")]


def break_away_numbers() -> list[Number]:
    """Break-away force against force rate; second order at 1/7000 of the ramp."""
    rows = []
    for rate in mass.RATES:
        t, _, F = mass.reference(1.6 / rate, lambda t, rate=rate: rate * t, 40_001)  # type: ignore[misc]
        expected, found = mass.first_peak(t, F)[1], mass.break_away(PAPER, rate)[1]
        rows.append(Number(f"break-away force at {rate:g} N/s", expected, found, 2e-6 * expected, "N"))
    return rows


def stick_slip_numbers() -> list[Number]:
    """The first two slips; the instant of a slip hangs on creep just before it, two steps of the sampling."""
    motion = mass.stick_slip(PAPER)
    t, v, F = mass.reference(
        15.0, lambda t: mass.SPRING_STIFFNESS * mass.DRAWN_SPEED * t, 60_001, mass.SPRING_STIFFNESS
    )
    expected, found = (mass.upward_crossings(*pair, mass.SLIP_SPEED)[:2] for pair in ((t, v), (motion.t, motion.w)))
    early = motion.t <= t[-1]
    rows = [Number(f"time of slip {i + 1}", a, b, 1e-3, "s") for i, (a, b) in enumerate(zip(expected, found))]
    rows.append(Number("largest friction", F.max(), motion.F[early].max(), 1e-5 * F.max(), "N"))
    return [*rows, Number("largest speed", v.max(), motion.w[early].max(), 1e-4 * v.max(), "m/s")]


def hunting_numbers() -> list[Number]:
    """The limit cycle after 50 s; the digits printed."""
    motion = mass.hunting(PAPER)
    late = motion.t > SETTLED
    periods = np.diff(mass.upward_crossings(motion.t[late], motion.x[late], 1.0))
    return [
        Number("least position", 0.936, float(motion.x[late].min()), 0.0006, "m"),
        Number("largest position", 1.064, float(motion.x[late].max()), 0.0006, "m"),
        Number("period of the hunting", 24.4, float(periods.mean()), 0.06, "s"),
    ]


class Traits(NamedTuple):
    """What a law does in the five experiments; the saturated force of the first is F_s, of the others F_c."""

    elastic: float  # displacement when the force first reaches 95 % of F_s [m]; a sliding law goes far
    creep: float  # displacement while that force is held for 5 s [m]
    lag: float  # friction at rising less at falling speed, at the highest frequency [N]
    slow: float  # largest friction in the slowest ramp [N]
    fast: float  # largest friction in the fastest ramp before the force has passed F_s [N]
    stuck: float  # share of the time at rest in stick-slip, from the first slip on [1]
    slips: int
    swing: float  # of the position in the last 50 s under position control [m]
    before: float  # the same in the 50 s before [m]

    @property
    def presliding(self) -> bool:
        """Whether the displacement below break-away stays elastic, within ten pre-sliding distances."""
        return 0.0 < self.elastic and abs(self.elastic) + abs(self.creep) < 10.0 * PAPER.F_s / PAPER.sigma_0

    @property
    def effects(self) -> dict[str, bool]:
        """Effect in words, of ``EFFECTS`` -> whether the law shows it."""
        shown = (
            self.presliding,
            abs(self.lag) > VISIBLE_FORCE,
            self.presliding and self.slow - self.fast > VISIBLE_FORCE,
            self.slips > 1 and self.stuck > STICK_SHARE,
            self.swing > max(HUNTING_SWING, LASTING_SHARE * self.before),
        )
        return dict(zip(EFFECTS, shown))


def traits(name: str) -> Traits:
    """The five experiments with one law."""
    sliding, sticking = (mass.laws([name], F)[name] for F in (PAPER.F_c, PAPER.F_s))
    pre = mass.presliding(sticking)
    at = np.interp((15.0, 20.0), pre.t, pre.x)
    cycle = mass.lag(sliding, mass.LAG_OMEGAS[-1])
    slow, fast = (float(mass.ramp(sliding, rate).F.max()) for rate in (mass.RATES[0], mass.RATES[-1]))
    motion, controlled = mass.stick_slip(sliding), mass.hunting(sliding)
    slips = mass.upward_crossings(motion.t, motion.w, mass.SLIP_SPEED)
    after = motion.t > slips[0] if slips.size else np.ones(motion.t.size, bool)
    since = controlled.t[-1] - controlled.t
    before, last = (np.ptp(controlled.x[(since >= k * SETTLED) & (since < (k + 1) * SETTLED)]) for k in (1, 0))
    return Traits(
        elastic=float(at[0]),
        creep=float(at[1] - at[0]),
        lag=cycle.rising - cycle.falling,
        slow=slow,
        fast=fast,
        stuck=float(np.mean(np.abs(motion.w[after]) < AT_REST)),
        slips=int(slips.size),
        swing=float(last),
        before=float(before),
    )


NUMBERS: Mapping[str, Callable[[], list[Number]]] = {
    "Pre-sliding displacement": presliding_numbers,
    "Frictional lag": lag_numbers,
    "Break-away force": break_away_numbers,
    "Stick-slip": stick_slip_numbers,
    "Hunting": hunting_numbers,
}


def _lines(curves: Mapping[str, tuple[Array, Array]]) -> list[Line]:
    shades = dict(zip(curves, colours(list(curves))))
    dashes = ("solid", "dash", "dot", "dashdot", "longdash")
    return [Line(name, *xy, shades[name], dashes[i % len(dashes)]) for i, (name, xy) in enumerate(curves.items())]


def _thin(*columns: Array) -> tuple[Array, ...]:
    return tuple(column[:: max(column.size // 2000, 1)] for column in columns)


def panels(names: Sequence[str]) -> dict[str, list[Panel]]:
    """The figures by experiment: the paper's with LuGre, beside it the same with every law."""
    sliding, sticking = (mass.laws(names, F) for F in (PAPER.F_c, PAPER.F_s))
    limit = 6.0 * PAPER.F_s / PAPER.sigma_0
    pre: dict[str, tuple[Array, Array]] = {}
    for name, p in sticking.items():
        motion = mass.presliding(p)
        kept = int(np.argmax(np.abs(motion.x) > limit)) or motion.x.size
        forces = np.interp(motion.t, mass.PRESLIDING_TIMES, mass.PRESLIDING_FORCE * np.array([0, 1, 1, -1, -1, 1]))
        x, F = _thin(motion.x[:kept], forces[:kept])
        pre[name] = MICRO * x, F
    cycles = {omega: mass.lag(PAPER, omega) for omega in mass.LAG_OMEGAS}
    loops = {f"lugre, {omega:g} rad/s": _thin(1e3 * of.v, of.F) for omega, of in cycles.items()}
    others = {name: mass.lag(p, mass.LAG_OMEGAS[-1]) for name, p in sliding.items()}
    rates = np.array(mass.RATES)
    peaks = {"lugre": (rates, np.array([mass.break_away(PAPER, r)[1] for r in rates]))}
    largest = {name: (rates, np.array([mass.ramp(p, r).F.max() for r in rates])) for name, p in sliding.items()}
    slipping = {name: mass.stick_slip(p) for name, p in sliding.items()}
    hunting = {name: mass.hunting(p) for name, p in sliding.items()}

    def pair(x: str, y: str, own: Mapping[str, Any], every: Mapping[str, Any], log: bool = False) -> list[Panel]:
        return [Panel(x, y, _lines(curves), None, log) for curves in (own, every)]

    def over_time(motions: Mapping[str, mass.Motion]) -> dict[str, tuple[Array, ...]]:
        return {name: _thin(motion.t, motion.x) for name, motion in motions.items()}

    return {
        "Pre-sliding displacement": pair("displacement [µm]", "force [N]", {"lugre": pre["lugre"]}, pre),
        "Frictional lag": pair(
            "speed [mm/s]", "friction [N]", loops, {name: _thin(1e3 * of.v, of.F) for name, of in others.items()}
        ),
        "Break-away force": pair("force rate [N/s]", "break-away force [N]", peaks, largest, True),
        "Stick-slip": pair("time [s]", "position [m]", over_time({"lugre": slipping["lugre"]}), over_time(slipping)),
        "Hunting": pair("time [s]", "position [m]", over_time({"lugre": hunting["lugre"]}), over_time(hunting)),
    }


def _laws(found: Mapping[str, Traits]) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = []
    for name, of in found.items():
        held = of.presliding
        far = number(MICRO * of.elastic) if held else "slides"
        creep = number(MICRO * of.creep, 2) if held else "slides"
        row = (number(1e3 * of.lag, 2), number(of.slow), number(of.fast), str(of.slips), number(100.0 * of.stuck, 2))
        rows.append((name, far, creep, *row, number(of.swing, 2)))
    return rows


class Experiment(NamedTuple):
    """One experiment of the paper, as the page shows it."""

    numbers: Sequence[Number]
    picture: str  # SVG

    @property
    def worst(self) -> Number:
        """The number with the largest difference, in tolerances."""
        return max(self.numbers, key=lambda each: each.share)

    @property
    def missed(self) -> list[str]:
        """Numbers that do not agree."""
        return [each.what for each in self.numbers if not each.agrees]


def shown_by(found: Mapping[str, Traits]) -> dict[str, list[str]]:
    """Effect in words -> laws that show it."""
    effects = next(iter(found.values())).effects
    return {effect: [name for name, of in found.items() if of.effects[effect]] for effect in effects}


def as_page(
    numbers: Mapping[str, Sequence[Number]], found: Mapping[str, Traits], shown: Mapping[str, Sequence[Panel]]
) -> pages.Page:
    """The page of numbers, laws and figures by experiment."""
    every = [each for rows in numbers.values() for each in rows]
    values = {
        "count": len(every),
        "agreeing": sum(each.agrees for each in every),
        "effects": shown_by(found),
        "experiments": {title: Experiment(rows, plots.draw(shown[title], title)) for title, rows in numbers.items()},
        "laws": _laws(found),
        "shares": friction_pictures.strips(
            {title: {f"{len(rows)} numbers": [each.share for each in rows]} for title, rows in numbers.items()},
            1.0,
            "difference [% of the tolerance]",
            5.6,
        ),
        "short": EFFECTS.values(),
        "shown": [(law, *("yes" if of.effects[effect] else "no" for effect in EFFECTS)) for law, of in found.items()],
        "marks": {"seen": VISIBLE_FORCE, "sticks": 100 * STICK_SHARE, "hunts": HUNTING_SWING},
    }
    return pages.Page(PAGE_NAME, values)


def build_page(names: Sequence[str]) -> tuple[pages.Page, dict[str, Any]]:
    """The page and its numbers as JSON, for the named laws, of which LuGre is the first."""
    numbers = {title: of() for title, of in NUMBERS.items()}
    found = {name: traits(name) for name in names}
    data = {
        "numbers": {
            title: [{**each._asdict(), "agrees": each.agrees} for each in rows] for title, rows in numbers.items()
        },
        "laws": {name: {**of._asdict(), "effects": of.effects} for name, of in found.items()},
        "units": {"displacement": "m", "force": "N", "time": "s"},
    }
    return as_page(numbers, found, panels(names)), data


def main(argv: Sequence[str] | None = None) -> None:
    """Reproduce the experiments of the LuGre paper (1995), run every law in them, and write a page."""
    args = pages.parser(PAGE_NAME, main.__doc__).parse_args(argv)
    pages.check(args.out, PAGE_NAME)
    names = ["lugre", *(name for name in friction.available() if name != "lugre")]
    found, data = build_page(names)
    made = mass.laws(names)
    print("\n".join(found.verdict))
    print(pages.write(args.out, found, data, pages.study_trace(PAGE_NAME, argv, args.out, friction=made)))
