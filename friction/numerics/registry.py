"""The registry of everything that is chosen by name: one thing for each file of a folder, named after the file."""

import importlib
import pkgutil
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, Generic, TypeVar

T = TypeVar("T")


def _same(file: str) -> str:
    return file


def with_dashes(file: str) -> str:
    """``step_steer`` -> ``step-steer``, as the command line names manoeuvres."""
    return file.replace("_", "-")


def camel_case(file: str) -> str:
    """``assist_weave`` -> ``AssistWeave``, as in the ids of environments."""
    return "".join(part.capitalize() for part in file.split("_"))


def modules_by_name(package: str, name_of: Callable[[str], str] = _same) -> dict[str, str]:
    """Name of each thing in a folder -> name of its module, in alphabetical order; no module is imported."""
    folder = importlib.import_module(package).__path__
    files = sorted(module.name for module in pkgutil.iter_modules(folder) if module.name != "common")
    return {name_of(file): f"{package}.{file}" for file in files}


class Registry(Generic[T]):
    """Things of one kind by name.

    A folder holds one module (or package) for each thing, and ``common`` what they share. The names are those of the
    files, so that listing them imports nothing. A module is imported when its thing is first asked for, and registers
    the thing then. Other modules may register further things.

    Parameters
    ----------
    kind : str
        What the things are, for messages: ``"friction law"``.
    package : str
        Import name of the folder's package.
    name_of : callable
        File name without suffix -> name of the thing.
    """

    def __init__(self, kind: str, package: str, name_of: Callable[[str], str] = _same) -> None:
        self.kind, self.package, self._name_of = kind, package, name_of
        self._things: dict[str, T] = {}
        self._by_class: dict[type, T] = {}

    def _files(self) -> dict[str, str]:
        """Name of each thing in the folder -> name of its module."""
        return modules_by_name(self.package, self._name_of)

    def available(self) -> tuple[str, ...]:
        """Names in alphabetical order."""
        return tuple(sorted({*self._files(), *self._things}))

    def register(self, name: str, thing: T, parameters: type | None = None) -> T:
        """Make a thing known; ``parameters`` is the class by which :meth:`of` finds it.

        Raises
        ------
        ValueError
            If the name is taken, or another thing has a class of that name and module, by which compiled code is kept.
        """
        module = self._files().get(name)
        if module is not None and module not in sys.modules:  # the name belongs to a file of the folder
            importlib.import_module(module)
        known = self._things.get(name)
        if known is not None and known != thing:
            where = getattr(getattr(known, "parameters", known), "__module__", "another module")
            raise ValueError(f"{self.kind} {name!r} is already registered by {where}")
        if parameters is not None:
            self._check_class(name, thing, parameters)
            self._by_class[parameters] = thing
        self._things[name] = thing
        return thing

    def _check_class(self, name: str, thing: T, parameters: type) -> None:
        for kind, other in self._by_class.items():
            if other != thing and (kind.__module__, kind.__qualname__) == (
                parameters.__module__,
                parameters.__qualname__,
            ):
                raise ValueError(
                    f"{self.kind} {name!r}: {kind.__module__} has two classes of parameters called "
                    f"{kind.__qualname__}, which would share their compiled code: give this one another name"
                )

    def know(self, parameters: type, thing: T) -> None:
        """Make :meth:`of` find a thing by a class, without a name by which it could be chosen."""
        self._by_class[parameters] = thing

    def __getitem__(self, name: str) -> T:
        """The thing called ``name``.

        Raises
        ------
        ValueError
            Unknown name; the message lists the valid ones.
        """
        if isinstance(name, str) and name not in self._things and name in (files := self._files()):
            importlib.import_module(files[name])
            if name not in self._things:
                raise RuntimeError(f"{files[name]} registers no {self.kind} {name!r}")
        if not isinstance(name, str) or name not in self._things:
            raise ValueError(f"unknown {self.kind} {name!r}; available: {', '.join(self.available())}")
        return self._things[name]

    def __contains__(self, name: object) -> bool:
        """Whether there is a thing called ``name``; one that is imported is found without a look at the folder."""
        return isinstance(name, str) and (name in self._things or name in self._files())

    def registered(self) -> list[T]:
        """The things whose modules are imported, those from elsewhere among them."""
        return list(self._things.values())

    def of(self, parameters: Any) -> T | None:
        """The thing that was registered with the class ``parameters``; None if there is none."""
        return self._by_class.get(parameters)

    @contextmanager
    def restored(self) -> Iterator[None]:
        """A context at whose end the things from elsewhere are forgotten that were registered within, as by a test.

        Things of the folder stay, because a module registers only when it is first imported.
        """
        before = set(self._things)
        try:
            yield
        finally:
            gone = [self._things.pop(name) for name in set(self._things) - before - set(self._files())]
            self._by_class = {kind: thing for kind, thing in self._by_class.items() if thing not in gone}

    def all(self) -> dict[str, T]:
        """Every thing by name; imports them all."""
        return {name: self[name] for name in self.available()}
