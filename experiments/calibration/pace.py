"""How much longer a tuning takes, told from the times that its kinds of work have taken so far.

The starting point is checked before the search as the best set is after it: what a margin map and a check take is known
by then, whatever the car, the machine and its load. Whether the best set misses a margin on its map, so that another
map has to be read, is not.
"""

import time
from collections.abc import Callable, Mapping

WINDOW = 8  # finished sets at least from which the time of a set is told, once there are as many; assumed


class Pace:
    """The phases of a tuning as they begin, and the time that is left.

    Parameters
    ----------
    clock : callable
        Time [s].

    Attributes
    ----------
    text : str
        The phase in words.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock, self._start = clock, clock()
        self._took = dict[str, float]()  # kind of work -> time of the last piece [s]
        self._kind, self._began = "", self._start
        self._then: Mapping[str, int] = {}
        self._finished = list[tuple[float, int]]()  # time [s], and how many sets of this search were finished then
        self._of = 0  # how many sets this search has in all
        self.text = ""

    def begin(self, kind: str, text: str, then: Mapping[str, int], sets: int = 0) -> None:
        """A phase begins, and the one before it ends.

        Parameters
        ----------
        kind : str
            Of its work; ``"set"`` for a search, whose sets are counted by :meth:`count`.
        text : str
            It in words.
        then : mapping of str to int
            Pieces of work of each kind that follow it.
        sets : int
            Of a search, those of earlier commands included.
        """
        self.end()
        self._kind, self.text, self._then, self._of = kind, text, then, sets
        self._began, self._finished = self._clock(), []

    def end(self, compiled: float = 0.0) -> None:
        """The phase ends, and its time is kept, without what was spent on compiling, which is done once [s]."""
        if self._kind == "set":
            self._took["set"] = self._each()
        elif self._kind:
            self._took[self._kind] = max(self._clock() - self._began - compiled, 0.0)
        self._kind = ""

    def scale(self, kind: str, factor: float) -> None:
        """Work of a kind takes longer from here on, by a factor [1]."""
        self._took[kind] *= factor

    def count(self, finished: int) -> None:
        """So many sets of this search are finished, those of earlier commands included."""
        if not self._finished or finished > self._finished[-1][1]:
            self._finished.append((self._clock(), finished))

    def _each(self) -> float:
        """Time of a set, of the later half of those of this command; before the second, that of a check [s]."""
        if len(self._finished) < 2:
            return self._took.get("set", self._took.get("check", 0.0))
        first, (now, done) = self._finished[0][1], self._finished[-1]
        since = max(first, done - max(WINDOW, (done - first) // 2))
        at, before = next(pair for pair in reversed(self._finished) if pair[1] <= since)
        return (now - at) / (done - before)

    @property
    def left(self) -> float | None:
        """Time until the end; None before all kinds of work that are left were measured [s]."""
        kinds = {"check" if kind == "set" else kind for kind in (self._kind, *self._then)}
        if not kinds <= self._took.keys():
            return None
        rest = sum(n * (self._each() if kind == "set" else self._took[kind]) for kind, n in self._then.items())
        if self._kind != "set":
            return rest + max(self._took[self._kind] - (self._clock() - self._began), 0.0)
        at, done = self._finished[-1] if self._finished else (self._clock(), 0)
        return rest + max((self._of - done) * self._each() - (self._clock() - at), 0.0)

    @property
    def part(self) -> float:
        """Part of the time that is over, 0 before anything was measured [1]."""
        left, over = self.left, self._clock() - self._start
        return 0.0 if left is None or over + left <= 0.0 else over / (over + left)
