"""An external vehicle in a process of its own, whose end does not end this one."""

import json
from multiprocessing import get_context
from multiprocessing.connection import Connection
from pathlib import Path

import numpy as np

from steer_env.coupling.fmu_vehicle import FmuVehicle
from steer_env.coupling.vehicle import Array, CouplingError
from steer_env.vehicle.steering.eps import SAMPLE_TIME

_FAILED, _VALUES = b"F", b"V"  # begin an answer: with the reason as text, or with what the vehicle gives as float64


def _answer(connection: Connection, path: str) -> None:
    """Serve a vehicle in the other process, until the connection is closed there."""
    try:
        vehicle = FmuVehicle(path)
    except (ValueError, OSError) as error:
        connection.send_bytes(_FAILED + str(error).encode())
        return
    told = {"name": vehicle.name, "takes": vehicle.takes, "gives": vehicle.gives, "meta": vehicle.meta}
    connection.send_bytes(_VALUES + json.dumps(told).encode())
    try:
        while True:
            samples, *values = np.frombuffer(connection.recv_bytes())
            try:
                given = vehicle.step(np.array(values), int(samples)) if samples else vehicle.start(values[0])
                connection.send_bytes(_VALUES + given.tobytes())
            except CouplingError as error:
                connection.send_bytes(_FAILED + str(error).encode())
    except EOFError:
        vehicle.close()


class OwnProcess:
    """A :class:`steer_env.coupling.fmu_vehicle.FmuVehicle` in its own process; the arguments and errors are the same.

    Raises
    ------
    CouplingError
        In a run also where the process ends, as by a fault of the unit.
    """

    def __init__(self, path: str | Path) -> None:
        self._time, self.name = 0, Path(path).name
        context = get_context("spawn")  # a fork would take the threads of compiled kernels along
        self._connection, other = context.Pipe()
        self._process = context.Process(target=_answer, args=(other, str(path)), daemon=True)
        self._process.start()
        other.close()
        told = json.loads(self._answered())
        self.name: str = told["name"]
        self.takes, self.gives = tuple(told["takes"]), tuple(told["gives"])
        self.meta = told["meta"]

    def start(self, speed: float) -> Array:
        """As :meth:`steer_env.coupling.fmu_vehicle.FmuVehicle.start`."""
        self._time = 0
        return self._asked(np.array([0.0, speed]))

    def step(self, taken: Array, samples: int) -> Array:
        """As :meth:`steer_env.coupling.fmu_vehicle.FmuVehicle.step`."""
        found = self._asked(np.array([samples, *taken]))
        self._time += samples
        return found

    def close(self) -> None:
        """End the process."""
        self._connection.close()
        self._process.join()

    def _asked(self, numbers: Array) -> Array:
        try:
            self._connection.send_bytes(numbers.tobytes())
        except BrokenPipeError:
            raise self._ended() from None
        return np.frombuffer(self._answered()).copy()

    def _answered(self) -> bytes:
        try:
            answer = self._connection.recv_bytes()
        except (EOFError, ConnectionResetError):
            raise self._ended() from None
        if answer[:1] == _FAILED:
            raise CouplingError(answer[1:].decode())
        return answer[1:]

    def _ended(self) -> CouplingError:
        self._process.join()
        return CouplingError(
            f"the process of {self.name} ended at {self._time * SAMPLE_TIME:.6g} s with exit code"
            f" {self._process.exitcode} (minus the number of a signal): the unit has a fault"
        )
