"""Whether two commits give the same numbers, to the bit.

``python compare_numbers.py record OUT.npz`` drives a fixed rollout of every environment id and stores what it gave.
``python compare_numbers.py compare OLD.npz NEW.npz`` compares two such files; with ``--reports OLD.json NEW.json`` it
also compares the ``metrics.json`` of two reports, except times. Run ``record`` in a checkout of each commit with that
commit's packages installed: the script needs only gymnasium and ``steer_env``. The exit code is 1 if any number
differs. CONTRIBUTING.md says when to run it.
"""

import argparse
import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np

STEPS = 400  # control steps of each rollout
TUNING_STEPS = 2
VARIANTS = ({"friction": "lugre"}, {"friction": "masing"}, {"friction": "coulomb", "chassis": "two_track"})

# Names in a report's metrics.json that changed: old -> new. Values must not.
RENAMED: dict[str, str] = {
    "half the momentum of wheel spin": "half the angular momentum of the wheels",
    "no torsion of the contact patch": "no bore torque of the contact patch",
}
# Branches of metrics.json that hold times, dates or versions, not results.
NOT_RESULTS = ("real_time", "provenance")


def _rollout(name: str, arguments: dict[str, Any], steps: int) -> dict[str, np.ndarray]:
    """Observations, rewards, costs and episode metrics of a rollout with actions drawn from a fixed generator."""
    env: Any = gym.make(name, **arguments)
    actions = np.random.default_rng(7)
    observation, _ = env.reset(seed=11)
    observations, rewards, costs, metrics = [observation], [], [], []
    for _ in range(steps):
        action = actions.uniform(-0.3, 0.3, env.action_space.shape).astype(np.float32)
        observation, reward, terminated, truncated, info = env.step(action)
        observations.append(observation)
        rewards.append(reward)
        costs.append(info.get("cost", 0.0))
        if terminated or truncated:
            metrics += [float(value) for value in info.get("metrics", {}).values() if isinstance(value, int | float)]
            observation, _ = env.reset()
            observations.append(observation)
    env.close()
    arrays = {"observations": observations, "rewards": rewards, "costs": costs, "metrics": metrics}
    return {key: np.asarray(value) for key, value in arrays.items()}


def record(out: Path) -> None:
    """Drive every id on every variant that it takes, and store the arrays."""
    import steer_env

    arrays: dict[str, np.ndarray] = {}
    for name in sorted(steer_env.REGISTERED):
        tunes = "/Tune" in name
        for arguments in VARIANTS[:1] if tunes else VARIANTS:
            found = _rollout(name, arguments, TUNING_STEPS if tunes else STEPS)
            label = " ".join([name, *arguments.values()])
            print(label, found["rewards"].sum(), file=sys.stderr)
            arrays |= {f"{label} {key}": value for key, value in found.items()}
    np.savez(out, **arrays)  # type: ignore[arg-type]  # numpy's stub sees a keyword of its own


def _leaves(node: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], float]]:
    """Numbers of a JSON document by their path, the paths by today's names."""
    if isinstance(node, dict):
        for key, value in node.items():
            if path or key not in NOT_RESULTS:
                yield from _leaves(value, (*path, RENAMED.get(str(key), str(key))))
    elif isinstance(node, list):
        for i, value in enumerate(node):
            yield from _leaves(value, (*path, str(i)))
    elif isinstance(node, int | float) and not isinstance(node, bool):
        yield path, float(node)


def compare(old: Path, new: Path, reports: list[Path]) -> list[str]:
    """One line for each difference."""
    before, after = np.load(old), np.load(new)
    lines = [f"{key}: only in one of the files" for key in sorted({*before.files} ^ {*after.files})]
    for key in sorted({*before.files} & {*after.files}):
        a, b = before[key], after[key]
        if a.shape != b.shape:
            lines.append(f"{key}: shape {a.shape}, now {b.shape}")
        elif not np.array_equal(a, b, equal_nan=True):
            lines.append(f"{key}: largest difference {np.nanmax(np.abs(a - b)):.3g}")
    if reports:
        left, right = (dict(_leaves(json.loads(path.read_text(encoding="utf-8")))) for path in reports)
        for place in sorted(left.keys() | right.keys()):
            if left.get(place) != right.get(place):
                lines.append(f"{'.'.join(place)}: {left.get(place)}, now {right.get(place)}")
        print(f"{len(left.keys() & right.keys())} numbers of the reports compared")
    print(f"{len({*before.files} & {*after.files})} arrays of rollouts compared")
    return lines


def main() -> int:
    """Record or compare."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    commands.add_parser("record").add_argument("out", type=Path)
    both = commands.add_parser("compare")
    both.add_argument("files", type=Path, nargs=2)
    both.add_argument("--reports", type=Path, nargs=2, default=[])
    args = parser.parse_args()
    if args.command == "record":
        record(args.out)
        return 0
    lines = compare(args.files[0], args.files[1], args.reports)
    print("\n".join(lines) or "no difference")
    return int(bool(lines))


if __name__ == "__main__":
    sys.exit(main())
