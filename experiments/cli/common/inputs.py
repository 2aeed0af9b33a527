"""The files that a command reads, for the trace of its result."""

import argparse
from pathlib import Path

from steer_env.experiments.cli.common import names

KEPT_SUFFIXES = (".toml", ".json", ".dbc")  # files that say how something is done, whose text the trace keeps
LARGEST = 256_000  # of these [byte]; a larger one is looked up when the result is made again


def trace_inputs(args: argparse.Namespace) -> list[dict[str, str]]:
    """The files that a command line names, and the modules of ``--import`` with their own ones, as inputs of a trace.

    A file has a ``name``, a module a dotted name as ``module``. The files of the car are not among them, as the trace
    holds the car itself, nor is what the command writes.
    """
    from steer_env.experiments.pages import own_modules, provenance

    others = {str(getattr(args, name, None)) for name in ("vehicle", "tyre", "out")}
    words = dict.fromkeys(value for word in args.argv for value in (word, word.partition("=")[2]))
    found = []
    folders = (str(path) for word in words if word not in others for path in recordings_in(word))
    for word in dict.fromkeys((*words, *folders)):
        path = Path(word)
        if path.suffix and word not in others and path.is_file():
            # A mapping of an external vehicle names a file beside it, so that it is looked up where it lies.
            beside = word == getattr(args, "chassis", None)
            kept = path.suffix.lower() in KEPT_SUFFIXES and path.stat().st_size <= LARGEST and not beside
            found.append(provenance.input_file(word, kept))
    modules = own_modules.digests(args.modules)
    return [*found, *({"module": name, "sha256": digest} for name, digest in modules.items())]


def recordings_in(path: str) -> list[Path]:
    """The recordings in a folder, by name; none where the path is no folder."""
    if not path or not Path(path).is_dir():
        return []
    endings = (*names.FORMATS, *names.CAN_FORMATS, ".csv.gz")
    return sorted(each for each in Path(path).iterdir() if each.name.lower().endswith(endings))
