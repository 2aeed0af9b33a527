"""A loaded unit (FMU) by the few calls that a run needs, alike for FMI 2.0 and 3.0; fmpy loads the library."""

import ctypes
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray


class Numbers:
    """Real variables of a unit that are set or read together.

    Parameters
    ----------
    references : iterable of int
        Value references.
    """

    def __init__(self, references: Iterable[int]) -> None:
        found = list(references)
        self.size = len(found)
        self.references = (ctypes.c_uint * self.size)(*found)
        self.buffer = (ctypes.c_double * self.size)()
        self.values: NDArray[np.float64] = np.ctypeslib.as_array(self.buffer)  # (N,) what is set, or was read


class Slave2:
    """A unit of FMI 2.0."""

    def __init__(self, description: Any, folder: Path) -> None:
        from fmpy import calloc, fmi2, free
        from fmpy.logging import addLoggerProxy

        self.said = ""  # the last message of the unit
        self._unit = fmi2.FMU2Slave(
            guid=description.guid,
            unzipDirectory=str(folder),
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName="vehicle",
        )
        self._callbacks = fmi2.fmi2CallbackFunctions()
        self._callbacks.logger = fmi2.fmi2CallbackLoggerTYPE(lambda *words: self._hear(words[-1]))
        self._callbacks.allocateMemory = fmi2.fmi2CallbackAllocateMemoryTYPE(calloc)
        self._callbacks.freeMemory = fmi2.fmi2CallbackFreeMemoryTYPE(free)
        addLoggerProxy(ctypes.byref(self._callbacks))  # which fills in what the unit passes beside the text

    def _hear(self, text: bytes) -> None:
        self.said = text.decode(errors="replace")

    def instantiate(self) -> None:
        """Make an instance."""
        self._unit.instantiate(callbacks=self._callbacks)

    def begin(self) -> None:
        """Initialize, up to time zero."""
        self._unit.setupExperiment(startTime=0.0)
        self._unit.enterInitializationMode()
        self._unit.exitInitializationMode()

    def set(self, numbers: Numbers) -> None:
        """Set variables."""
        unit = self._unit
        unit.fmi2SetReal(unit.component, numbers.references, numbers.size, numbers.buffer)

    def get(self, numbers: Numbers) -> None:
        """Read variables."""
        unit = self._unit
        unit.fmi2GetReal(unit.component, numbers.references, numbers.size, numbers.buffer)

    def step(self, time: float, step: float) -> None:
        """Advance by a communication step [s]."""
        self._unit.doStep(time, step)

    def terminate(self) -> None:
        """End the run."""
        self._unit.terminate()

    def end(self) -> None:
        """Free the instance."""
        self._unit.fmi2FreeInstance(self._unit.component)


class Slave3:
    """A unit of FMI 3.0."""

    def __init__(self, description: Any, folder: Path) -> None:
        from fmpy import fmi3

        self.said = ""
        self._unit = fmi3.FMU3Slave(
            guid=description.guid,
            unzipDirectory=str(folder),
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName="vehicle",
        )

    def _hear(self, environment: Any, status: int, category: bytes, message: bytes) -> None:
        self.said = message.decode(errors="replace")

    def instantiate(self) -> None:
        """Make an instance."""
        self._unit.instantiate(logMessage=self._hear)

    def begin(self) -> None:
        """Initialize, up to time zero."""
        self._unit.enterInitializationMode(startTime=0.0)
        self._unit.exitInitializationMode()

    def set(self, numbers: Numbers) -> None:
        """Set variables."""
        unit = self._unit
        unit.fmi3SetFloat64(unit.component, numbers.references, numbers.size, numbers.buffer, numbers.size)

    def get(self, numbers: Numbers) -> None:
        """Read variables."""
        unit = self._unit
        unit.fmi3GetFloat64(unit.component, numbers.references, numbers.size, numbers.buffer, numbers.size)

    def step(self, time: float, step: float) -> None:
        """Advance by a communication step [s]."""
        _, terminate, early, reached = self._unit.doStep(time, step)
        if terminate or early:
            raise RuntimeError(f"it ended a step early, at {reached:g} s")

    def terminate(self) -> None:
        """End the run."""
        self._unit.terminate()

    def end(self) -> None:
        """Free the instance."""
        self._unit.fmi3FreeInstance(self._unit.component)
