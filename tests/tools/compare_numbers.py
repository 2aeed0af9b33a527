"""Whether two commits give the same numbers, to the bit.

``python compare_numbers.py record OUT.npz`` stores what a checkout computes: a fixed rollout of every environment id,
with nominal and with drawn conditions, alone and as a vector environment that resets its sub-environments; every
law of friction by itself and in the car, the friction of several sites, rack EPS, the limits of a motor and the
functions of an assist, on both chassis; every baseline assist and driver model; channels and metrics of every
manoeuvre; and the outputs of exported FMUs.
``python compare_numbers.py compare OLD.npz NEW.npz`` compares two such files; with ``--reports OLD.json NEW.json`` it
also compares the ``metrics.json`` of two reports, except times. Run ``record`` in a checkout of each commit with that
commit's packages installed: the script needs only gymnasium, ``steer_env`` and fmpy. The exit code is 1 if any number
differs. CONTRIBUTING.md says when to run it.
"""

import argparse
import json
import shutil
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np

STEPS = 400  # control steps of each rollout
TUNING_STEPS = 2
VARIANTS = ({"friction": "lugre"}, {"friction": "masing"}, {"friction": "coulomb", "chassis": "two_track"})
DRAWS = {
    "load": (0.0, 200.0),
    "road_friction": (0.8, 1.0),
    "friction_level": (0.7, 1.3),
    "sensor_noise": (0.5, 1.0),
    "delay": (0.0, 0.05),
    "action_gain": (0.8, 1.2),
    "action_lag": (0.0, 0.05),
    "friction": {"F_c": (0.6, 1.2)},
}  # of the conditions of every episode
SUB_ENVIRONMENTS = 3
EPISODE_STEPS = 90  # control steps after which the drawn episodes end, so that several of them are compared
LAWS = ("lugre", "masing", None)  # of the manoeuvres; None is the car's own friction
CHASSIS = ("single_track", "two_track")
WEAVE, ON_CENTRE = "steer_env/AssistWeave-v3", "steer_env/DriverOnCentre-v3"  # a robot turns; hands turn
MIXES = (
    "masing,efficiency=0.88@gear+coulomb,F_c=0.2@upper_column",
    "lugre@rack+gms@motor+bouc_wen@lower_column",
    "dahl@upper_column+stribeck@lower_column+elasto_plastic,efficiency=0.9@gear+masing_position@rack+viscous@motor",
)  # of friction at sites
MOTOR = {
    "motor_speeds": [0.0, 115.0, 150.0, 400.0],
    "motor_torques": [0.05, 0.05, 0.03, 0.0],
    "motor_power": 0.5,
    "motor_continuous": 0.02,
    "motor_thermal_time": 5.0,
}  # so small that a weave meets its limits
FUNCTIONS = Path(__file__).parents[2] / "examples" / "assist_functions.toml"
CARS: tuple[dict[str, Any], ...] = (
    {},
    *({"friction": friction} for friction in MIXES),
    {"steering": "rack_eps"},
    {"steering": "rack_eps", "friction": "masing@rack_eps"},
    {"vehicle": {"base": "compact", "assist": MOTOR}},
    {"vehicle": str(FUNCTIONS)},
)
CAR_STEPS = 200
ROWS = 6  # of a vector environment: four side by side and two more
FMUS = (("car", "lugre", 2), ("steering", "masing", 3))  # subsystem, law and version of FMI of the exported FMUs
FMU_SECONDS = 2.0

# Branches of metrics.json that hold times, dates or versions, not results.
NOT_RESULTS = ("real_time", "provenance")


def _numbers_in(info: Any) -> list[float]:
    """Every number of an info, which may hold mappings and arrays, in the order of the names."""
    if isinstance(info, dict):
        return [number for key in sorted(info) for number in _numbers_in(info[key])]
    try:
        return np.ravel(np.asarray(info, float)).tolist()
    except (TypeError, ValueError):
        return []


def _rollout(name: str, arguments: dict[str, Any], steps: int) -> dict[str, np.ndarray]:
    """Observations, rewards, costs and episode metrics of a rollout with actions drawn from a fixed generator."""
    env: Any = gym.make(name, **arguments)
    actions = np.random.default_rng(7)
    observation, info = env.reset(seed=11)
    observations, rewards, costs, metrics, drawn = [observation], [], [], [], _numbers_in(info)
    for _ in range(steps):
        action = actions.uniform(-0.3, 0.3, env.action_space.shape).astype(np.float32)
        observation, reward, terminated, truncated, info = env.step(action)
        observations.append(observation)
        rewards.append(reward)
        costs.append(info.get("cost", 0.0))
        if terminated or truncated:
            metrics += [float(value) for value in info.get("metrics", {}).values() if isinstance(value, int | float)]
            observation, info = env.reset()
            observations.append(observation)
            drawn += _numbers_in(info)
    env.close()
    arrays = {"observations": observations, "rewards": rewards, "costs": costs, "metrics": metrics, "drawn": drawn}
    return {key: np.asarray(value) for key, value in arrays.items()}


def _vector_rollout(
    name: str, arguments: dict[str, Any], steps: int, rows: int = SUB_ENVIRONMENTS
) -> dict[str, np.ndarray]:
    """Observations, rewards, ends and infos of a vector environment that resets its sub-environments itself."""
    env: Any = gym.make_vec(name, rows, "vector_entry_point", **arguments)
    actions = np.random.default_rng(7)
    observation, info = env.reset(seed=[3, 11, 29, 31, 37, 41][:rows])
    observations, rewards, ends, infos = [observation.copy()], [], [], _numbers_in(info)
    for _ in range(steps):
        action = actions.uniform(-0.3, 0.3, env.action_space.shape).astype(np.float32)
        observation, reward, terminated, truncated, info = env.step(action)
        observations.append(observation.copy())
        rewards.append(reward.copy())
        ends.append([terminated.copy(), truncated.copy()])
        infos += _numbers_in(info)
    env.close()
    arrays = {"observations": observations, "rewards": rewards, "ends": ends, "infos": infos}
    return {key: np.asarray(value) for key, value in arrays.items()}


def _environments() -> Iterator[tuple[str, dict[str, np.ndarray]]]:
    """Every id on every variant that it takes, with drawn conditions, and as a vector environment."""
    import steer_env

    for name in sorted(steer_env.REGISTERED):
        if "/Tune" in name:
            yield f"{name} lugre", _rollout(name, {"friction": "lugre"}, TUNING_STEPS)
            continue
        for arguments in VARIANTS:
            yield " ".join([name, *arguments.values()]), _rollout(name, arguments, STEPS)
        short = {"friction": "lugre", "randomise": _draws(name), "max_episode_steps": EPISODE_STEPS}
        yield f"{name} drawn", _rollout(name, short, STEPS)
        yield f"{name} vector", _vector_rollout(name, short, STEPS)


def _draws(name: str) -> dict[str, Any]:
    """Ranges of the conditions that an id draws: the speed too, of those that draw no scenario."""
    env: Any = gym.make(name)
    speed = env.unwrapped.task.speed if env.unwrapped.task.draw_scenario is None else 0.0
    env.close()
    return {**DRAWS, "speed": (0.9 * speed, 1.1 * speed)} if speed else DRAWS


def _friction() -> Iterator[tuple[str, dict[str, np.ndarray]]]:
    """Every law under a random displacement, by itself, and every car of the list and law on both chassis."""
    from steer_env import friction

    walk = 0.02 * np.cumsum(np.random.default_rng(3).normal(size=2000))
    for law in friction.available():
        yield f"response {law}", {"torque": friction.response(friction.make(law), walk, 1e-3)}
    for chassis in CHASSIS:
        for arguments in (*CARS, *({"friction": law} for law in friction.available())):
            words = " ".join(map(str, ("car", chassis, *(v for k, v in arguments.items() if k != "vehicle"))))
            if "vehicle" in arguments:
                words += " motor" if isinstance(arguments["vehicle"], dict) else " functions"
            yield words, _channels(WEAVE, {**arguments, "chassis": chassis})
            if "friction" not in arguments:
                yield f"{words} hands", _channels(ON_CENTRE, {**arguments, "chassis": chassis})
        for friction_of in (None, "lugre", "masing"):
            draws = {"load": (0.0, 200.0), "friction_level": (0.7, 1.3)}
            fours = {
                "friction": friction_of,
                "chassis": chassis,
                "randomise": draws,
                "max_episode_steps": EPISODE_STEPS,
            }
            yield f"rows {chassis} {friction_of}", _vector_rollout(WEAVE, fours, CAR_STEPS, ROWS)


def _channels(name: str, arguments: dict[str, Any]) -> dict[str, np.ndarray]:
    """Every number of the infos of a rollout."""
    env: Any = gym.make(name, **arguments)
    actions = np.random.default_rng(7)
    _, info = env.reset(seed=11)
    infos = [_numbers_in(info)]
    for _ in range(CAR_STEPS):
        infos.append(_numbers_in(env.step(actions.uniform(-0.5, 0.5, (1,)).astype(np.float32))[4]))
    env.close()
    return {"infos": np.asarray(infos)}


def _manoeuvres() -> Iterator[tuple[str, dict[str, np.ndarray]]]:
    """Channels and metrics of every manoeuvre of the default car, or the text of the error that refuses it."""
    from steer_env import manoeuvres, metrics
    from steer_env.vehicle import cars

    car = cars.load("compact")
    for name in manoeuvres.available():
        for law in LAWS:
            label = f"manoeuvre {name} {law}"
            try:
                recording = manoeuvres.drive(car, manoeuvres.make(name), law)
            except ValueError as error:
                yield label, {"refused": np.asarray(str(error))}
                continue
            channels = {f"channel {key}": values[::10] for key, values in recording.channels.items()}
            values = metrics.evaluate(recording, intervals=False) if name in metrics.tests() else {}
            yield label, channels | {f"metric {key}": np.asarray(v.value) for key, v in values.items()}


def _controllers() -> Iterator[tuple[str, dict[str, np.ndarray]]]:
    """Actions and rewards of every baseline assist and driver model."""
    from steer_env import assists, drivers

    for name in assists.available():
        for env_id in ("steer_env/AssistRelease-v4", "steer_env/AssistAllRound-v3"):
            yield f"assist {name} {env_id}", _controlled(env_id, lambda env, name=name: assists.make(name, env))
    for name in drivers.available():
        env_id = "steer_env/DriverDoubleLaneChange-v3"
        yield f"driver {name}", _controlled(env_id, lambda env, name=name: drivers.Controller(env, name))


def _controlled(env_id: str, make: Any) -> dict[str, np.ndarray]:
    """Actions and rewards of a controller over some episodes, which it forgets at each reset."""
    env: Any = gym.make(env_id, friction="lugre")
    controller = make(env)
    observation, _ = env.reset(seed=11)
    actions, rewards = [], []
    for _ in range(STEPS):
        actions.append(controller.act(observation))
        observation, reward, terminated, truncated, _ = env.step(actions[-1])
        rewards.append(reward)
        if terminated or truncated:
            controller.reset()
            observation, _ = env.reset()
    env.close()
    return {"actions": np.asarray(actions), "rewards": np.asarray(rewards)}


def _exported_fmus() -> Iterator[tuple[str, dict[str, np.ndarray]]]:
    """Outputs of exported FMUs whose first input is a sine, at every communication step."""
    import fmpy

    from steer_env.connect.fmu import export

    for subsystem, law, version in FMUS:
        folder = Path(tempfile.mkdtemp())
        path = export(folder / "exported.fmu", subsystem=subsystem, friction=law, fmi=version)
        variables = fmpy.read_model_description(str(path)).modelVariables
        first = next(v.name for v in variables if v.causality == "input")
        outputs = [v.name for v in variables if v.causality == "output" and v.type in ("Real", "Float64")]
        time = np.arange(0.0, FMU_SECONDS, 1e-3)
        sine = np.zeros(time.size, [("time", float), (first, float)])
        sine["time"], sine[first] = time, np.sin(2.0 * np.pi * time)
        found = fmpy.simulate_fmu(
            str(path),
            start_time=0.0,
            stop_time=FMU_SECONDS,
            step_size=1e-3,
            output_interval=1e-3,
            input=sine,
            output=outputs,
        )
        shutil.rmtree(folder)
        yield f"FMU {subsystem} {law} FMI {version}", {name: found[name] for name in found.dtype.names}


def record(out: Path) -> None:
    """Compute everything and store the arrays."""
    arrays: dict[str, np.ndarray] = {}
    for parts in (_friction, _environments, _controllers, _manoeuvres, _exported_fmus):
        for label, found in parts():
            print(label, sum(np.asarray(values).size for values in found.values()), file=sys.stderr)
            arrays |= {f"{label} {key}": value for key, value in found.items()}
    np.savez_compressed(out, **arrays)  # type: ignore[arg-type]  # numpy's stub sees a keyword of its own


def _leaves(node: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], float]]:
    """Numbers of a JSON document by their path."""
    if isinstance(node, dict):
        for key, value in node.items():
            if path or key not in NOT_RESULTS:
                yield from _leaves(value, (*path, str(key)))
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
        elif a.dtype.kind in "US":
            if a != b:
                lines.append(f"{key}: {a}, now {b}")
        elif not np.array_equal(a, b, equal_nan=True):
            lines.append(f"{key}: largest difference {np.nanmax(np.abs(a - b)):.3g}")
    if reports:
        left, right = (dict(_leaves(json.loads(path.read_text(encoding="utf-8")))) for path in reports)
        for place in sorted(left.keys() | right.keys()):
            if left.get(place) != right.get(place):
                lines.append(f"{'.'.join(place)}: {left.get(place)}, now {right.get(place)}")
        print(f"{len(left.keys() & right.keys())} numbers of the reports compared")
    print(f"{len({*before.files} & {*after.files})} arrays compared")
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
