"""Computing times that no machine measured, for pages whose words follow from them."""

from steer_env.experiments.studies.common.computing_time import CAR, COLUMN, Cost, Estimate, Load, Measured, Times


def _about(median):
    return Estimate(median, 0.99 * median, 1.01 * median, 1.1 * median)


def faked(ns, integrated=()):
    """Times of laws, label -> time of a step of the column [ns], with LuGre's at 100 ns if it is not among them."""
    every = {"lugre": 100.0, **ns}
    costs = {
        (law, what): Cost(_about(extra + x), _about((extra + x) / (extra + every["lugre"])))
        for what, extra in ((COLUMN, 0.0), (CAR, 200.0))
        for law, x in every.items()
    }
    return Times(Measured(Load(0.02, 0.03, 0.02), costs), frozenset(integrated))


NONE = Times(Measured(Load(0.66, 0.4, 0.3), {}), frozenset())
