"""The functions of an FMU, called in this process or in one of its own.

An FMU is foreign code, which may crash, hang or take all memory. A process of its own makes a sentence of that.

    this process -> keeper -> worker

The worker calls the FMU. The keeper, which runs no foreign code, waits for its end and for that of this process; then
it ends whatever the FMU has started and removes the unpacked files, also where this process was killed.

Each message in a pipe is its length as a little-endian integer of 8 bytes and its contents: a letter, then numbers as
float64, or JSON. This file is the program of the keeper. It imports little, as it has to fork while it has one thread.
"""

import ctypes
import json
import os
import select
import shutil
import signal
import struct
import subprocess
import sys
import time
from collections.abc import Callable, Iterable
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple


class FmuError(Exception):
    """An FMU cannot go on: what it did, and why."""

    def __init__(self, did: str, why: str) -> None:
        super().__init__(did, why)
        self.did, self.why = did, why


class Library(NamedTuple):
    """What of an FMU is loaded, and the value references that are exchanged."""

    version: str  # of FMI, "2" or "3"
    token: str  # by which the library knows its description
    identifier: str  # of the model
    folder: str  # where it is unpacked
    parameters: list[int]  # set before the start
    inputs: list[int]
    outputs: list[int]


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
        self.memory = bytearray(8 * self.size)  # float64: what is set, or was read
        self.buffer = (ctypes.c_double * self.size).from_buffer(self.memory)


class Slave2:
    """A unit of FMI 2.0."""

    def __init__(self, library: Library) -> None:
        from fmpy import calloc, fmi2, free
        from fmpy.logging import addLoggerProxy

        self.said = ""  # the last message of the unit
        self._unit = fmi2.FMU2Slave(
            guid=library.token,
            unzipDirectory=library.folder,
            modelIdentifier=library.identifier,
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

    def __init__(self, library: Library) -> None:
        from fmpy import fmi3

        self.said = ""
        self._unit = fmi3.FMU3Slave(
            guid=library.token,
            unzipDirectory=library.folder,
            modelIdentifier=library.identifier,
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


class Instance:
    """An FMU in this process.

    Attributes
    ----------
    parameters, inputs, outputs : Numbers
        What :meth:`start` and :meth:`step` set and read [units of the FMU].

    Raises
    ------
    FmuError
        Each method, where the FMU refuses; the constructor, where its library cannot be loaded.
    """

    def __init__(self, library: Library) -> None:
        self.parameters, self.inputs, self.outputs = (Numbers(each) for each in library[-3:])
        self._alive, self._running = False, False
        self._slave: Any = None
        kind = Slave2 if library.version == "2" else Slave3
        self._slave = self._call("to load", partial(kind, library))

    def start(self) -> None:
        """Make a new instance, which starts at time zero, and read its outputs."""
        self.close()
        self._call("to be instantiated", self._slave.instantiate)
        self._alive = True
        if self.parameters.size:
            self._call("a start value", partial(self._slave.set, self.parameters))
        self._call("to start", self._slave.begin)
        self._running = True
        self._read()

    def step(self, now: float, step: float) -> None:
        """Set the inputs, advance by a communication step [s] from a time [s], and read the outputs."""
        self._slave.said = ""
        try:
            self._slave.set(self.inputs)
            self._slave.step(now, step)
        except Exception as error:  # fmpy raises bare exceptions
            raise self._refused("a step", error) from None
        self._read()

    def close(self) -> None:
        """Free the instance, where there is one."""
        if self._alive:
            running, self._alive, self._running = self._running, False, False
            if running:  # a unit that has failed may only be freed
                self._call("to terminate", self._slave.terminate)
            self._slave.end()

    def _read(self) -> None:
        self._call("its outputs", partial(self._slave.get, self.outputs))

    def _call(self, what: str, call: Callable[[], Any]) -> Any:
        """Result of a call of the FMU."""
        try:
            return call()
        except Exception as error:  # fmpy raises bare exceptions
            raise self._refused(what, error) from None

    def _refused(self, what: str, error: Exception) -> FmuError:
        self._running = False
        return FmuError(f"refused {what}", getattr(self._slave, "said", "") or str(error))


_LENGTH = 8  # of the length of a message [byte]
_LOAD_REQUEST, _START_REQUEST, _STEP_REQUEST, _CLOSE_REQUEST = b"L", b"S", b"T", b"C"  # begin a request
_DONE, _FAILED = b"D", b"F"  # begin an answer: with the outputs, or with an FmuError as JSON
_CALLS = {_LOAD_REQUEST: "loading", _START_REQUEST: "its start", _STEP_REQUEST: "a step", _CLOSE_REQUEST: "its end"}
_PR_SET_PDEATHSIG, _PR_SET_CHILD_SUBREAPER = 1, 36  # of prctl
_GRACE = 10.0  # of a keeper to end what it keeps, assumed [s]
_PARENT_POLL_TIME = 0.5  # time between looks of the keeper for its parent, assumed [s]


class OwnProcess:
    """An FMU in a process of its own; methods, attributes and errors are those of :class:`Instance`.

    Parameters
    ----------
    library : Library
        Its folder is removed when the process ends.
    lock : int
        Descriptor that locks the folder, which the process keeps open.
    time_limit : float
        In which loading, a start, a step and the end have to return [s].
    memory_limit : float
        What the FMU may take of address space, on Linux [byte].

    Raises
    ------
    FmuError
        Also where the process ends, or does not answer in time.
    """

    def __init__(self, library: Library, lock: int, time_limit: float, memory_limit: float) -> None:
        self.parameters, self.inputs, self.outputs = (Numbers(each) for each in library[-3:])
        self._time_limit, self._memory_limit = time_limit, memory_limit
        self._process = subprocess.Popen(
            [sys.executable, __file__, json.dumps([sys.path, os.getpid(), int(memory_limit), library.folder])],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            bufsize=0,
            pass_fds=[lock],
            start_new_session=True,  # Ctrl-C is for this process, which ends the other
        )
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._requests, self._answers = self._process.stdin.fileno(), self._process.stdout.fileno()
        self._answered = select.poll()
        self._answered.register(self._answers, select.POLLIN)
        self._busy = False
        try:
            self._ask(_LOAD_REQUEST, json.dumps(library).encode())
        except BaseException:
            self._kill()
            raise

    def start(self) -> None:
        """As :meth:`Instance.start`."""
        self._ask(_START_REQUEST, self.parameters.memory)

    def step(self, now: float, step: float) -> None:
        """As :meth:`Instance.step`."""
        self._ask(_STEP_REQUEST, struct.pack("dd", now, step) + self.inputs.memory)

    def close(self) -> None:
        """As :meth:`Instance.close`, and end the process."""
        try:
            if not self._busy:
                self._ask(_CLOSE_REQUEST, b"")
                code = self._ended(self._time_limit)
                if code is None:
                    raise self._late(_CALLS[_CLOSE_REQUEST])
                if code:
                    raise self._fault(_CALLS[_CLOSE_REQUEST])
        finally:
            self._kill()

    def _ask(self, kind: bytes, numbers: bytes | bytearray) -> None:
        with suppress(BrokenPipeError):  # the answer tells that the process has ended
            _send(self._requests, kind + numbers)
        self._answer(_CALLS[kind])

    def _answer(self, call: str) -> None:
        """Read the next answer, to a call of the FMU, into the outputs."""
        self._busy, until, found = True, time.monotonic() + self._time_limit, b""
        while len(found) < _LENGTH or len(found) < _LENGTH + int.from_bytes(found[:_LENGTH], "little"):
            if not self._answered.poll(max(0.0, 1e3 * (until - time.monotonic()))):
                raise self._late(call)
            more = os.read(self._answers, 1 << 16)
            if not more:
                raise self._fault(call)
            found += more
        kind, told = found[_LENGTH : _LENGTH + 1], found[_LENGTH + 1 :]
        if kind != _FAILED and len(told) != len(self.outputs.memory):
            raise FmuError(f"damaged the answer to {call}", "it wrote into the pipe of its process")
        self._busy = False
        if kind == _FAILED:
            raise FmuError(*json.loads(told))
        self.outputs.memory[:] = told

    def _late(self, call: str) -> FmuError:
        return FmuError(f"did not return from {call}", f"it may take {self._time_limit:g} s (time_limit_s)")

    def _fault(self, call: str) -> FmuError:
        code = self._ended(_GRACE)
        how = f"exit code {code}" if code is None or code >= 0 else f"signal {-code} ({signal.strsignal(-code)})"
        why = f"it has a fault, or takes more than {self._memory_limit / 1e9:g} GB (memory_limit_gb)"
        return FmuError(f"ended its process in {call} with {how}", why)

    def _ended(self, limit: float) -> int | None:
        """Exit code of the process, minus the number of a signal; None where it has not ended within a time [s]."""
        with suppress(subprocess.TimeoutExpired):
            return self._process.wait(limit)
        return None

    def _kill(self) -> None:
        """End the process, which the keeper does on SIGTERM."""
        self._busy = True
        self._process.terminate()
        if self._ended(_GRACE) is None:
            self._process.kill()
        with self._process:  # closes the pipes
            pass


def _send(pipe: int, contents: bytes) -> None:
    message = memoryview(len(contents).to_bytes(_LENGTH, "little") + contents)
    while message:
        message = message[os.write(pipe, message) :]


def _receive() -> bytes:
    """The next request, at standard input; empty where that was closed."""
    length = sys.stdin.buffer.read(_LENGTH)
    return sys.stdin.buffer.read(int.from_bytes(length, "little"))


def _serve(answers: int) -> None:
    """Answer requests until the last one, or until standard input is closed."""
    instance: Any = None
    while request := _receive():
        kind, numbers = request[:1], request[1:]
        try:
            if kind == _LOAD_REQUEST:
                instance = Instance(Library(*json.loads(numbers)))
            elif kind == _START_REQUEST:
                instance.parameters.memory[:] = numbers
                instance.start()
            elif kind == _STEP_REQUEST:
                now, step = struct.unpack_from("dd", numbers)
                instance.inputs.memory[:] = numbers[16:]
                instance.step(now, step)
            else:
                instance.close()
            answer = _DONE + instance.outputs.memory
        except FmuError as error:
            answer = _FAILED + json.dumps(error.args).encode()
        _send(answers, answer)
        if kind == _CLOSE_REQUEST:
            return


def _work(memory_limit: int) -> None:
    """Serve an FMU under its limits; what it prints goes to standard error."""
    import resource

    os.setsid()  # a group for all that the FMU starts
    answers = os.dup(1)
    os.dup2(2, 1)
    import fmpy.fmi2  # noqa: F401 - what they take is not the FMU's
    import fmpy.fmi3  # noqa: F401

    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
        taken = int(Path("/proc/self/statm").read_text(encoding="utf-8").split()[0]) * resource.getpagesize()
        hard = resource.getrlimit(resource.RLIMIT_AS)[1]
        limit = taken + memory_limit if hard == resource.RLIM_INFINITY else min(taken + memory_limit, hard)
        resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    _serve(answers)


def _keep(parent: int, memory_limit: int, folder: str) -> None:
    """Start a worker; at its end, on SIGTERM or without a parent end all of it and remove the folder."""
    import resource  # which Windows does not have

    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))  # a fault leaves no file
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_CHILD_SUBREAPER, 1)  # orphans of the worker become children of this process
    worker = os.fork()
    if not worker:
        _work(memory_limit)
        return

    def look(number: int, _: Any) -> None:
        if number == signal.SIGTERM or os.getppid() != parent:
            raise SystemExit

    code = 0
    with suppress(SystemExit):
        for number in (signal.SIGTERM, signal.SIGALRM):
            signal.signal(number, look)
        signal.setitimer(signal.ITIMER_REAL, _PARENT_POLL_TIME, _PARENT_POLL_TIME)
        code = os.waitstatus_to_exitcode(os.waitpid(worker, 0)[1])
    for number in (signal.SIGTERM, signal.SIGALRM):
        signal.signal(number, signal.SIG_IGN)
    _end_all(worker)
    shutil.rmtree(folder, ignore_errors=True)
    if code < 0:  # ends as the worker did, which the parent reads
        with suppress(OSError):  # SIGKILL has no handler
            signal.signal(-code, signal.SIG_DFL)
        os.kill(os.getpid(), -code)
    sys.exit(code)


def _end_all(worker: int) -> None:
    """Kill the group of a worker and, on Linux, whatever has left the group."""
    with suppress(ProcessLookupError):
        os.killpg(worker, signal.SIGKILL)
    with suppress(ChildProcessError):  # there is none any more
        while True:
            if sys.platform == "linux":
                for child in Path(f"/proc/self/task/{os.getpid()}/children").read_text(encoding="utf-8").split():
                    os.kill(int(child), signal.SIGKILL)
            os.waitpid(-1, 0)


if __name__ == "__main__":
    path, *arguments = json.loads(sys.argv[1])
    sys.path[:] = path
    _keep(*arguments)
