"""Runs of a unit step by step, through fmpy's bare functions, and what the plant in Python makes of the same inputs."""

from contextlib import contextmanager
from ctypes import byref
from typing import Any

import numpy as np

from steer_env.vehicle import plant
from steer_env.vehicle.subsystems.car import NAMED

STEP = 1e-3  # [s]


@contextmanager
def opened(path: Any, folder: Any, log: list | None = None):
    """An instance of the unit in step mode, its description, and a list of what it says."""
    import fmpy
    from fmpy.fmi2 import FMU2Slave, fmi2CallbackFunctions, fmi2CallbackLoggerTYPE
    from fmpy.logging import addLoggerProxy

    description = fmpy.read_model_description(str(path))
    if not (folder / "binaries").exists():  # a binary that is loaded must not be written anew
        fmpy.extract(str(path), str(folder))
    said = [] if log is None else log
    callbacks = fmi2CallbackFunctions()
    callbacks.logger = fmi2CallbackLoggerTYPE(lambda environment, name, status, kind, text: said.append(text.decode()))
    addLoggerProxy(byref(callbacks))  # which fills in what the unit passes beside the text
    unit = FMU2Slave(
        guid=description.guid,
        unzipDirectory=str(folder),
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName="unit",
    )
    unit.instantiate(callbacks=callbacks)
    unit.callbacks = callbacks  # kept alive as long as the unit
    references = {v.name: v.valueReference for v in description.modelVariables}
    yield unit, references, said
    unit.freeInstance()


def bits(values: Any) -> np.ndarray:
    """The bits of floats, so that signs of zeros count."""
    return np.ascontiguousarray(values).view(np.int64)


def begin(unit: Any, start: float = 0.0) -> None:
    """From instantiation to step mode."""
    unit.setupExperiment(startTime=start)
    unit.enterInitializationMode()
    unit.exitInitializationMode()


def hand_names(robot: bool) -> list[str]:
    """Inputs of the unit in the order of the plant's inputs, for the hands as they are."""
    hands = ["hand_angle", "hand_speed"] if robot else ["hand_torque", None]
    return [*hands, *(NAMED[name][0] for name, _ in plant.INPUTS[2:])]


def replay(unit: Any, references: dict[str, int], u: np.ndarray, names: list, outputs: list[str]) -> np.ndarray:
    """Outputs (T, C) of the unit in steps of 1 ms with inputs (T, I), whose columns have these names."""
    used = [i for i, name in enumerate(names) if name in references]
    inputs = [references[names[i]] for i in used]
    wanted = [references[name] for name in outputs]
    record = np.zeros((len(u), len(wanted)))
    for k, row in enumerate(u):
        unit.setReal(inputs, row[used].tolist())
        unit.doStep(k * STEP, STEP)
        record[k] = unit.getReal(wanted)
    return record
