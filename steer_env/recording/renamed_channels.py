"""Notice of old names of channels, which files and mappings may use until release 1.0."""

import sys
from collections.abc import Iterable

from steer_env.friction.numerics.renamed import REMOVED_IN
from steer_env.vehicle.chassis.common.interface import RENAMED_CHANNELS


def announce(where: object, old_names: Iterable[str]) -> None:
    """Print one line on standard error that names the replacements of the old names in a file; none without names."""
    renamed = [f"{old} is now {RENAMED_CHANNELS[old]}" for old in old_names]
    if renamed:
        print(f"{where}: {', '.join(renamed)}; release {REMOVED_IN} will not know the old name", file=sys.stderr)
