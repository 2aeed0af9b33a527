"""Parameters whose arrays are all of one kind, so that kernels are compiled for them once."""

from typing import Any, TypeVar

import numpy as np

T = TypeVar("T")


def frozen(parameters: T) -> T:
    """The same parameters with every array contiguous (in C order) and read-only, also in a ``NamedTuple`` within.

    numba compiles a kernel anew for an array that may be written to, such as one that was pickled or computed, even if
    no kernel writes to it. Nothing is copied but arrays that are not contiguous; what is as it should be is returned
    itself.

    Parameters
    ----------
    parameters : NamedTuple, array or anything else
        Anything else is returned as it is.
    """
    value: Any = parameters
    if isinstance(value, np.ndarray):
        if value.flags.c_contiguous and not value.flags.writeable:
            return parameters
        kept = value.view() if value.flags.c_contiguous else value.copy(order="C")
        kept.flags.writeable = False
        return kept  # type: ignore[return-value]
    if isinstance(value, tuple) and hasattr(value, "_make"):
        members = [frozen(member) for member in value]
        return parameters if all(new is old for new, old in zip(members, value)) else value._make(members)
    return parameters


def rebuilt(kind: type[T], *members: Any) -> T:
    """A ``NamedTuple`` of these members, frozen; for ``__reduce__``, since a copied array can be written to."""
    return frozen(kind(*members))
