"""Modules of the user's own, on which a result depends beside the package: which they are, and their digests.

They are found by their import statements, wherever those stand, and not by what is imported at the moment: so two
processes find the same ones. Python's own modules, installed packages and this package are not among them, as their
versions and the digest of the sources stand for them; a module named by the user always is.
"""

import ast
import hashlib
import importlib.util
import sys
from collections.abc import Iterable, Iterator
from importlib.machinery import ModuleSpec, PathFinder
from pathlib import Path
from typing import NamedTuple

from steer_env.friction.law import LAWS

PACKAGE = "steer_env"
_INSTALLED = frozenset({"site-packages", "dist-packages"})  # folders of installed packages


class _Source(NamedTuple):
    spec: ModuleSpec
    digest: str
    imports: tuple[str, ...]


def digests(names: Iterable[str]) -> dict[str, str]:
    """SHA-256 of modules, of the packages that they are in, and of the own modules that they import, by dotted name.

    Of a module that is imported it is the one that was found first, as the file may have changed since.

    Raises
    ------
    ValueError
        If a named module is not there, or has no file.
    """
    roots = [name for name in names if top(name) != PACKAGE]
    found: dict[str, str] = {}
    for root in roots:
        if (spec := find_spec(root)) is None or not _has_file(spec):
            raise ValueError(
                f"the source of the module {root} cannot be read, so that its results could not be told from those of "
                "other code: write it to a file that Python imports"
            )
    named = {top(root) for root in roots}
    left, seen = [*roots], set()
    while left:
        name = left.pop()
        if name in seen or not (top(name) in named or is_own(name)):
            continue
        seen.add(name)
        if (spec := find_spec(name)) is None:
            continue  # a function or a value, or what is imported only where it is there
        left.append(name.rpartition(".")[0] or name)
        if _has_file(spec):
            source = _source(name, spec)
            found[name] = source.digest
            left += source.imports
    return dict(sorted(found.items()))


def of_laws() -> list[str]:
    """The user's own modules that have registered friction laws, which a process that knows a law by its name needs.

    A law of a notebook or of the script itself is in none that another process could import.
    """
    modules = {module for law in LAWS.registered() for module in (law.parameters.__module__, law.make.__module__)}
    return sorted(name for name in modules if name != "__main__" and is_own(name))


def is_own(name: str) -> bool:
    """Whether a module is the user's own: neither Python's, nor installed, nor of this package."""
    first = top(name)
    if not first or first == PACKAGE or first in sys.stdlib_module_names or (spec := find_spec(first)) is None:
        return False
    places = [spec.origin] if spec.origin else list(spec.submodule_search_locations or ())
    return not any(_INSTALLED & set(Path(place).parts) for place in places)


def top(name: str) -> str:
    """The outermost package of a dotted name."""
    return name.partition(".")[0]


def find_spec(name: str) -> ModuleSpec | None:
    """What ``import`` takes for a dotted name, or has taken; None if there is none. Nothing is imported by that."""
    if name in sys.modules:
        return getattr(sys.modules[name], "__spec__", None)
    first, *rest = name.split(".")
    spec = importlib.util.find_spec(first) if not rest else find_spec(first)
    for part in rest:
        if spec is None or spec.submodule_search_locations is None:
            return None
        spec = PathFinder.find_spec(part, list(spec.submodule_search_locations))
    return spec


def _has_file(spec: ModuleSpec) -> bool:
    return spec.origin is not None and Path(spec.origin).is_file()


_sources: dict[str, _Source] = {}  # of imported modules, as they were when they were first asked for


def _source(name: str, spec: ModuleSpec) -> _Source:
    """Digest and imports of a module; those of an imported one stay until it is imported anew."""
    known = _sources.get(name)
    if known and known.spec is spec:  # a module that is loaded again has another spec
        return known
    file = Path(str(spec.origin))
    raw = file.read_bytes()
    package = name if spec.submodule_search_locations is not None else name.rpartition(".")[0]
    try:
        imports = tuple(_imports(ast.parse(raw), package)) if file.suffix == ".py" else ()
    except SyntaxError:  # Python cannot import it either
        imports = ()
    _sources[name] = _Source(spec, hashlib.sha256(raw).hexdigest(), imports)
    return _sources[name]


def _imports(tree: ast.AST, package: str) -> Iterator[str]:
    """Dotted names that the import statements of a module may mean."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (each.name for each in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
            base = ".".join([*above, *([node.module] if node.module else [])])
            yield base
            yield from (f"{base}.{each.name}" for each in node.names)
