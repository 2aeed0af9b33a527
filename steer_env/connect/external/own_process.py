"""An external vehicle in a process of its own, whose end does not end this one.

Each message in a pipe is its length as a little-endian integer of 8 bytes and its contents: a request has numbers as
float64, an answer begins with a letter that tells whether the vehicle refused.
"""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import IO

import numpy as np

from steer_env.connect.external.fmu_vehicle import FmuVehicle
from steer_env.connect.external.vehicle import Array, CouplingError
from steer_env.vehicle.steering.eps import SAMPLE_TIME

_FAILED, _DONE = b"F", b"D"  # begin an answer: with the reason as text, or with the result
_LENGTH = 8  # of the length [byte]


def _send(pipe: IO[bytes], contents: bytes) -> None:
    pipe.write(len(contents).to_bytes(_LENGTH, "little") + contents)
    pipe.flush()


def _received(pipe: IO[bytes]) -> bytes | None:
    """The contents of the next message; None where the pipe was closed."""
    length = pipe.read(_LENGTH)
    contents = pipe.read(int.from_bytes(length, "little"))
    return contents if len(length) == _LENGTH else None


def _serve(path: str) -> None:
    """Answer requests at standard input until it is closed; what the unit prints goes to standard error."""
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    try:
        vehicle = FmuVehicle(path)
    except (ValueError, OSError) as error:
        _send(answers, _FAILED + str(error).encode())
        return
    told = {"name": vehicle.name, "takes": vehicle.takes, "gives": vehicle.gives, "meta": vehicle.meta}
    _send(answers, _DONE + json.dumps(told).encode())
    while (request := _received(sys.stdin.buffer)) is not None:
        samples, *values = np.frombuffer(request)
        try:
            given = vehicle.step(np.array(values), int(samples)) if samples else vehicle.start(values[0])
            _send(answers, _DONE + given.tobytes())
        except CouplingError as error:
            _send(answers, _FAILED + str(error).encode())
    vehicle.close()


class OwnProcess:
    """A :class:`steer_env.connect.external.fmu_vehicle.FmuVehicle` in its own process; the arguments and errors are the
    same.

    Raises
    ------
    CouplingError
        In a run also where the process ends, as by a fault of the unit.
    """

    def __init__(self, path: str | Path) -> None:
        self._time, self.name = 0, Path(path).name
        command = [sys.executable, "-m", __name__, str(path)]
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        try:
            told = json.loads(self._answer())
        except CouplingError:
            self.close()
            raise
        self.name = told["name"]
        self.takes, self.gives = tuple(told["takes"]), tuple(told["gives"])
        self.meta = told["meta"]

    def start(self, speed: float) -> Array:
        """As :meth:`steer_env.connect.external.fmu_vehicle.FmuVehicle.start`."""
        self._time = 0
        return self._asked(np.array([0.0, speed]))

    def step(self, taken: Array, samples: int) -> Array:
        """As :meth:`steer_env.connect.external.fmu_vehicle.FmuVehicle.step`."""
        found = self._asked(np.array([samples, *taken]))
        self._time += samples
        return found

    def close(self) -> None:
        """End the process."""
        self._process.communicate()

    def _asked(self, numbers: Array) -> Array:
        assert self._process.stdin is not None
        try:
            _send(self._process.stdin, numbers.tobytes())
        except BrokenPipeError:
            raise self._ended() from None
        return np.frombuffer(self._answer()).copy()

    def _answer(self) -> bytes:
        assert self._process.stdout is not None
        answer = _received(self._process.stdout)
        if answer is None:
            raise self._ended()
        if answer[:1] == _FAILED:
            raise CouplingError(answer[1:].decode())
        return answer[1:]

    def _ended(self) -> CouplingError:
        return CouplingError(
            f"the process of {self.name} ended at {self._time * SAMPLE_TIME:.6g} s with exit code"
            f" {self._process.wait()} (minus the number of a signal): the unit has a fault"
        )


if __name__ == "__main__":
    _serve(sys.argv[1])
