"""Forty errors planted in the code, one after the other: the tests have to kill every one.

``python tests/tools/planted_errors.py`` copies the checkout, plants an error, and runs the tests that stand beside it
in the list until one fails. An error that no test notices is printed, and the exit code is 1. ``--only NAME`` plants
the errors whose name contains a word. ``tests/test_planted_errors.py`` keeps the list in step with the code.
"""

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[2]


class Planted(NamedTuple):
    """An error: the text that stands once in a file, what replaces it, and where the tests are that shall notice."""

    name: str
    file: str
    right: str
    wrong: str
    tests: str  # paths of tests, with blanks between them


ERRORS = (
    Planted(
        "LuGre decays with the signed speed",
        "friction/models/lugre.py",
        "X = p.sigma_0 * abs(w) * h / G  # (F8)",
        "X = p.sigma_0 * w * h / G  # (F8)",
        "tests/friction/test_contracts.py tests/friction",
    ),
    Planted(
        "the Stribeck effect has the wrong exponent",
        "friction/models/lugre.py",
        "bump = torque_scale * (p.F_s - p.F_c) * math.exp(-x * x)",
        "bump = torque_scale * (p.F_s - p.F_c) * math.exp(-abs(x))",
        "tests/friction/test_contracts.py tests/friction",
    ),
    Planted(
        "Masing's elements keep the yield of another friction scale",
        "friction/models/masing.py",
        "memory[i] = within(memory[i], -limit, limit)  # the torque scale may have fallen since the last step",
        "memory[i] = within(memory[i], -2.0 * limit, 2.0 * limit)",
        "tests/friction/test_contracts.py tests/friction",
    ),
    Planted(
        "a sticking column keeps its momentum",
        "vehicle/steering/column.py",
        "q[COLUMN_SPEED] = where(w2 != 0.0, 2.0 * w2 - q[COLUMN_SPEED], 0.0)",
        "q[COLUMN_SPEED] = 2.0 * w2 - q[COLUMN_SPEED]",
        "tests/friction/test_sites.py tests/vehicle",
    ),
    Planted(
        "the robot forgets the handwheel's damping",
        "vehicle/steering/column.py",
        "T1 = c.I1 * (hand_speed - q[HANDWHEEL_SPEED]) / h + c.C1 * w1 + torsion_bar_torque + K * (w1 - w2)",
        "T1 = c.I1 * (hand_speed - q[HANDWHEEL_SPEED]) / h + torsion_bar_torque + K * (w1 - w2)",
        "tests/vehicle/test_column.py tests/vehicle",
    ),
    Planted(
        "the rack force is extrapolated backwards",
        "vehicle/plant.py",
        "s * (state[at.rack_force] - state[at.rack_force_before]) + u[RACK_DISTURBANCE]",
        "s * (state[at.rack_force_before] - state[at.rack_force]) + u[RACK_DISTURBANCE]",
        "tests/vehicle/test_plant.py tests/vehicle",
    ),
    Planted(
        "the rack force turns the column the wrong way",
        "vehicle/plant.py",
        "T_C = T_m - p.pinion_radius * force  # (P2)",
        "T_C = T_m + p.pinion_radius * force  # (P2)",
        "tests/vehicle/test_plant.py",
    ),
    Planted(
        "roll steers the rear axle to the wrong side",
        "vehicle/chassis/single_track/derivative.py",
        "steer_rl = p.roll_steer_r * phi + p.compliance_steer_r * Fy_rl  # (V13)",
        "steer_rl = p.compliance_steer_r * Fy_rl - p.roll_steer_r * phi  # (V13)",
        "tests/vehicle/test_single_track.py tests/vehicle",
    ),
    Planted(
        "the unsprung mass is lifted by the struts",
        "vehicle/chassis/single_track/derivative.py",
        "past_l, past_r = weight - bar, weight + bar  # (S9)",
        "past_l, past_r = weight + bar, weight - bar  # (S9)",
        "tests/vehicle/test_single_track.py tests/vehicle",
    ),
    Planted(
        "the pneumatic trail ignores camber",
        "vehicle/tyre/magic_formula/forces.py",
        "(1.0 + c.QDZ3 * fabs(p.g) + c.QDZ3G * p.g + c.QDZ4 * p.g2)",
        "(1.0 + c.QDZ3 * p.g + c.QDZ3G * p.g + c.QDZ4 * p.g2)",
        "tests/vehicle/test_tyre.py tests/vehicle/test_tir.py tests/vehicle",
    ),
    Planted(
        "the lead of the assist has its corners exchanged",
        "vehicle/steering/eps.py",
        "gain = (1.0 / zero + 1.0) / (1.0 / pole + 1.0)  # (E3)",
        "gain = (1.0 / pole + 1.0) / (1.0 / zero + 1.0)  # (E3)",
        "tests/vehicle/test_eps.py tests/vehicle",
    ),
    Planted(
        "returnability is the whole width of the loop",
        "steer_env/metrics/common/on_centre.py",
        "return -loops.width(AY, TORQUE) / 2",
        "return -loops.width(AY, TORQUE)",
        "tests/steer_env/test_metrics.py tests/steer_env",
    ),
    Planted(
        "a lag has the wrong sign",
        "steer_env/metrics/common/loops.py",
        "self.fundamental(ANGLE) * self.fundamental(name).conj()",
        "self.fundamental(ANGLE).conj() * self.fundamental(name)",
        "tests/steer_env/test_measurement_truth.py tests/steer_env/test_metrics.py tests/steer_env",
    ),
    Planted(
        "the work of the assist may be negative",
        "steer_env/tasks/common/terms.py",
        "abs(step.asked * channels[_COLUMN_SPEED]) * step.dt",
        "step.asked * channels[_COLUMN_SPEED] * step.dt",
        "tests/steer_env/test_rewards.py tests/steer_env/test_vector.py tests/steer_env",
    ),
    Planted(
        "a cone is counted at every step",
        "steer_env/tasks/common/cones.py",
        "touched += 1.0 - memory[_FLAGS + k]",
        "touched += 1.0",
        "tests/steer_env/test_lane_change.py tests/steer_env/test_driver_courses.py tests/steer_env",
    ),
    Planted(
        "the car as an FMU takes its inputs one place off",
        "vehicle/subsystems/car.py",
        "u[i] = given[i + 1]",
        "u[i] = given[i]",
        "tests/connect/fmu tests/connect",
    ),
    Planted(
        "a reset FMU keeps its parameters",
        "steer_env/connect/fmu/c/core.c",
        "    memcpy(c->numbers, unit.numbers, unit.number_count * sizeof *c->numbers);\n    memcpy(c->given",
        "    memcpy(c->given",
        "tests/connect/fmu",
    ),
    Planted(
        "the torque fades too late",
        "steer_env/live/real_time/safety.py",
        "stale = not age <= limits.hold",
        "stale = not age <= 2.0 * limits.hold",
        "tests/live/real_time tests/live",
    ),
    Planted(
        "the power limit brakes instead of driving",
        "steer_env/live/real_time/safety.py",
        "drives = moved * speed > limits.power",
        "drives = moved * speed < -limits.power",
        "tests/live/real_time tests/live",
    ),
    Planted(
        "decimal commas are taken for separators",
        "steer_env/recording/csv_file.py",
        'yield number, line if layout.separator == "," else line.replace(",", ".")',
        'yield number, line if layout.separator != ";" else line.replace(",", ".")',
        "tests/steer_env/test_measured_files.py tests/steer_env/test_recording_files.py tests/steer_env",
    ),
    Planted(
        "a slipping Maxwell element follows its level over the whole step",
        "friction/models/gms.py",
        "bend = a + (bend - a) * math.exp(-p.C * (h - rising) / s)  # (F22)",
        "bend = a + (bend - a) * math.exp(-p.C * h / s)  # (F22)",
        "tests/friction/test_gms.py tests/friction",
    ),
    Planted(
        "a bristle that slips forgets how far it was bent before",
        "friction/models/elasto_plastic.py",
        "return change, elastic * (0.5 * elastic + slipping) + gap * slipping + z_c * b * math.log1p(-s * y)",
        "return change, 0.5 * elastic * elastic + gap * slipping + z_c * b * math.log1p(-s * y)",
        "tests/friction/test_contracts.py tests/friction",
    ),
    Planted(
        "a gear that is driven back loses like one that drives",
        "friction/sites.py",
        "(1.0 - efficiency.driving, 1.0 / efficiency.driven - 1.0)",
        "(1.0 - efficiency.driving, 1.0 - efficiency.driven)",
        "tests/friction/test_sites.py tests/friction",
    ),
    Planted(
        "the steps of a sensor count as twice the noise",
        "friction/identification/displacement.py",
        "return max(white_noise_deviation(x), sensor_step(x) / math.sqrt(12.0))",
        "return max(white_noise_deviation(x), sensor_step(x) / math.sqrt(3.0))",
        "tests/friction/test_identification.py tests/friction",
    ),
    Planted(
        "the motor is heated by the torque at the column",
        "vehicle/steering/motor.py",
        "((torque / m.ratio / m.continuous) ** 2 - x[0])  # (E23)",
        "((torque / m.continuous) ** 2 - x[0])  # (E23)",
        "tests/vehicle/test_motor.py tests/vehicle",
    ),
    Planted(
        "a road that rises under a wheel pulls it ahead",
        "vehicle/chassis/two_track/wheels.py",
        "side * (forces.F_x - braked - contact.F_z * contact.slope),",
        "side * (forces.F_x - braked + contact.F_z * contact.slope),",
        "tests/vehicle/test_rack_energy.py tests/vehicle",
    ),
    Planted(
        "the command changes at the wrong instant of the sample",
        "vehicle/steering/linear.py",
        "for time, acting in ((a.offset, queue[-1]), (SAMPLE_TIME - a.offset, commands[a.delay])):",
        "for time, acting in ((SAMPLE_TIME - a.offset, queue[-1]), (a.offset, commands[a.delay])):",
        "tests/vehicle/test_eps.py tests/vehicle",
    ),
    Planted(
        "the yaw moment of roll unloads both axles",
        "vehicle/analysis/linear.py",
        "front, rear = force * b - moment, force * a + moment",
        "front, rear = force * b - moment, force * a - moment",
        "tests/vehicle/test_understeer.py tests/vehicle",
    ),
    Planted(
        "a pressure without a unit is a force over a length",
        "vehicle/tyre/tir.py",
        'return self._unit("FORCE") / self._unit("LENGTH") ** 2',
        'return self._unit("FORCE") / self._unit("LENGTH")',
        "tests/vehicle/test_tir.py tests/vehicle",
    ),
    Planted(
        "the last observation of an episode is that of the reset",
        "steer_env/vector.py",
        "final[i] = observations[i].copy()",
        "final[i] = self.batch.arrays.observations[i]",
        "tests/steer_env/test_infos.py tests/steer_env",
    ),
    Planted(
        "every row draws its noise from the first generator",
        "steer_env/engine/sensor_noise.py",
        "self.blocks[i] = generators[i].standard_normal(self.blocks.shape[1:])",
        "self.blocks[i] = generators[0].standard_normal(self.blocks.shape[1:])",
        "tests/steer_env/test_vector.py tests/steer_env",
    ),
    Planted(
        "a drawn friction over the position does not change the plant",
        "steer_env/episode/randomise.py",
        'OF_FRICTION = ("friction_level", "friction_load", "friction_asymmetry", "friction_position")',
        'OF_FRICTION = ("friction_level", "friction_load", "friction_asymmetry")',
        "tests/steer_env/test_env.py tests/steer_env",
    ),
    Planted(
        "the run-in of the low-pass repeats the first sample",
        "steer_env/recording/zero_phase.py",
        "before, after = 2 * values[0] - values[run_in:0:-1], 2",
        "before, after = 2 * values[0] - values[run_in - 1 :: -1], 2",
        "tests/steer_env/test_recording.py tests/steer_env",
    ),
    Planted(
        "the median of a noise's density counts as its mean",
        "steer_env/metrics/parking.py",
        "noise = np.median(density[f > CUTOFF]) / np.log(2.0)",
        "noise = np.median(density[f > CUTOFF])",
        "tests/steer_env/test_standstill.py tests/steer_env",
    ),
    Planted(
        "a factor at standstill turns round above 100 km/h",
        "steer_env/tuning/parameters.py",
        "return np.maximum(1.0 - speeds / HIGH_SPEED, 0.0)",
        "return 1.0 - speeds / HIGH_SPEED",
        "tests/steer_env/test_tuning.py tests/steer_env",
    ),
    Planted(
        "a tolerance shrinks where its channel is negative",
        "experiments/studies/common/simulation_vs_measurement.py",
        "return self.absolute + self.relative * np.abs(values)",
        "return self.absolute + self.relative * values",
        "tests/experiments/test_tolerances.py tests/experiments",
    ),
    Planted(
        "a resumed sweep takes results of other code of the user",
        "experiments/sweep/sweep.py",
        'key = case_key(name, case, program) if store else ""',
        'key = case_key(name, case) if store else ""',
        "tests/experiments/test_sweep.py tests/experiments",
    ),
    Planted(
        "each parameter is told from none as if it were alone",
        "experiments/calibration/production.py",
        "told = bool(test.pvalue < (1.0 - LEVEL) / len(parameters))",
        "told = bool(test.pvalue < 1.0 - LEVEL)",
        "tests/experiments/test_production.py tests/experiments",
    ),
    Planted(
        "the steepest part of the boost counts one interval too late",
        "experiments/calibration/constraints.py",
        "a.torques[:-1] + boost[:-1] < reach",
        "a.torques[1:] + boost[1:] < reach",
        "tests/experiments/test_constraints.py tests/experiments",
    ),
    Planted(
        "the next episode counts with the one that has ended",
        "experiments/learning/held_out.py",
        "reward += np.where(going, rewards, 0.0)",
        "reward += rewards",
        "tests/experiments/test_held_out.py tests/experiments",
    ),
)


def place(error: Planted, root: Path) -> None:
    """Plant an error in a checkout; ValueError where its text does not stand there exactly once."""
    path = root / error.file
    text = path.read_text(encoding="utf-8")
    if text.count(error.right) != 1:
        raise ValueError(f"{error.name}: {error.right!r} stands {text.count(error.right)} times in {error.file}")
    path.write_text(text.replace(error.right, error.wrong), encoding="utf-8")


def killed(error: Planted) -> bool:
    """Whether a test fails in a copy of the checkout that holds the error."""
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "checkout"
        shutil.copytree(ROOT, copy, symlinks=True, ignore=shutil.ignore_patterns(".venv*", ".git", "report"))
        place(error, copy)
        command = [sys.executable, "-m", "pytest", "-q", "-x", "--numprocesses", "2", *error.tests.split()]
        environment = os.environ | {"PYTHONPATH": str(copy)}
        run = subprocess.run(command, cwd=copy, env=environment, capture_output=True, text=True, check=False)
        failed = [line for line in run.stdout.splitlines() if line.startswith(("FAILED", "ERROR"))]
        if run.returncode and not failed:
            raise RuntimeError(f"{error.name}: the tests did not run\n{run.stdout[-2000:]}{run.stderr[-2000:]}")
        print(f"{error.name}: {failed[0] if failed else 'NOT NOTICED'}", flush=True)
        return bool(failed)


def main() -> int:
    """Plant the errors; 1 where one is not noticed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", default="", help="a word of the names")
    args = parser.parse_args()
    results = [killed(error) for error in ERRORS if args.only in error.name]
    print(f"{sum(results)} of {len(results)} errors noticed")
    return int(not all(results))


if __name__ == "__main__":
    sys.exit(main())
