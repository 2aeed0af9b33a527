"""Former public names, which keep working with a warning until a release removes them."""

import importlib
import warnings
from collections.abc import Callable, Mapping
from typing import Any

REMOVED_IN = "1.0"  # the release of the package that drops every name listed with `renamed`


def renamed(module: str, names: Mapping[str, str], known: Callable[[str], Any] | None = None) -> Callable[[str], Any]:
    """A ``__getattr__`` for a module that also finds what former names stood for.

    Parameters
    ----------
    module : str
        ``__name__`` of the module.
    names : mapping of str to str
        Former name -> what replaced it, ``"package.module:name"``, or ``"package.module"`` for a module.
    known : callable, optional
        The ``__getattr__`` that the module would have without this one, such as that of ``lazy_loader``.

    Returns
    -------
    callable
        For a former name it issues a ``DeprecationWarning`` that names the replacement, which it returns. It raises
        ``AttributeError`` for a name that the module never had.
    """

    def lookup(name: str) -> Any:
        if name not in names:
            if known is not None:
                return known(name)
            raise AttributeError(f"module {module!r} has no attribute {name!r}")
        place, _, attribute = names[name].partition(":")
        text = f"{module}.{name} is now {names[name].replace(':', '.')}; release {REMOVED_IN} removes the old name"
        warnings.warn(text, DeprecationWarning, stacklevel=2)
        found = importlib.import_module(place)
        return getattr(found, attribute) if attribute else found

    return lookup
