"""Methods that compute a result once and keep it with their object.

``functools.cache`` of a bound method refers to the object that holds it. Such a circle, with its recording, stays in
memory until the garbage collector looks for circles, which it does after so many objects, however large they are.
"""

from collections.abc import Callable
from copy import copy
from functools import wraps
from typing import Any, TypeVar

F = TypeVar("F", bound=Callable[..., Any])
T = TypeVar("T")


def kept(method: F) -> F:
    """Decorate a method whose arguments can be hashed; an error is raised anew each time."""

    @wraps(method)
    def once(self: Any, *arguments: Any, **named: Any) -> Any:
        found, key = vars(self).setdefault("_kept", {}), (method.__name__, method.__module__, arguments, *named.items())
        if key not in found:
            found[key] = method(self, *arguments, **named)
        return found[key]

    return once  # type: ignore[return-value]


def anew(reading: T, *methods: str) -> T:
    """A copy of an object without what its methods have kept, but for those of these names."""
    other = copy(reading)
    vars(other)["_kept"] = {key: each for key, each in vars(reading).get("_kept", {}).items() if key[0] in methods}
    return other
