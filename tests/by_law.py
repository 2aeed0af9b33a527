"""The laws that expensive tests run over: a few in every run, the others in the whole suite.

The contracts of ``steer_env.testing`` hold every law to the same in every run; what a car makes of a law takes longer.
Tests over several dimensions run over pairs, not over products.
"""

from itertools import combinations, cycle

import pytest

from steer_env import friction


def pairs(rows):
    """The first rows, in their order, with which every pair of values that occurs in ``rows`` occurs in what is left.

    ``rows`` are the combinations that are possible, for example a whole product, as tuples of one length. A row is
    taken where it has the most pairs that no row before it had.
    """
    of = {tuple(row): {frozenset(pair) for pair in combinations(enumerate(row), 2)} for row in rows}
    missing, chosen = set().union(*of.values()), []
    while missing:
        best = max(of, key=lambda row: len(of[row] & missing))
        chosen.append(best)
        missing -= of[best]
    return chosen


FEW = ("coulomb", "dahl", "lugre", "masing", "viscous")
OTHERS = tuple(law for law in friction.available() if law not in FEW)
EACH_LAW = [*FEW, *(pytest.param(law, marks=pytest.mark.whole) for law in OTHERS)]


def in_turn(*others):
    """Every law once, each beside the next value of every other dimension."""
    rows = zip((*FEW, *OTHERS), *map(cycle, others))
    return [pytest.param(*row, marks=[] if row[0] in FEW else pytest.mark.whole) for row in rows]
