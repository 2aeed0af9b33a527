"""The modules of the car, run by wasmtime, with the arguments of the plant's kernels."""

import numpy as np
import wasmtime

from steer_env.friction.numerics.packing import pack
from steer_env.vehicle import plant
from steer_env.vehicle.subsystems import car


class Instance:
    """An instance of a module, with arrays of floats in its memory; the first two hold results."""

    def __init__(self, wasm, sizes):
        self.store = wasmtime.Store()
        made = wasmtime.Module(self.store.engine, wasm)
        self.imports = [f"{one.module}.{one.name}" for one in made.imports]
        self.exports = wasmtime.Instance(self.store, made, []).exports(self.store)
        self.exports["_initialize"](self.store)
        start = -(-self.exports["__heap_base"].value(self.store) // 16) * 16
        ends = start + 8 * np.cumsum(sizes)
        self.at = [start, *map(int, ends[:-1])]
        memory = self.exports["memory"]
        lacking = int(ends[-1]) - memory.data_len(self.store)
        if lacking > 0:
            memory.grow(self.store, -(-lacking // 65536))
        whole = np.frombuffer(memory.get_buffer_ptr(self.store), np.uint8)
        self.arrays = [whole[at : at + 8 * n].view(np.float64) for at, n in zip(self.at, sizes)]


class Running:
    """The car of a plant, in straight running; ``q`` is its plant with the law of the module that begins a drive."""

    def __init__(self, advancing, beginning, p, q):
        subsystem, (numbers, tables), (own, _) = car.unsettled(p), pack(p), pack(q)
        states = subsystem.start.size
        sizes = (
            1,
            1,
            numbers.size,
            tables.size,
            states,
            subsystem.given_size,
            subsystem.inputs,
            len(subsystem.outputs),
        )
        self._instance = Instance(advancing, sizes)
        begun = Instance(beginning, (1, 1, own.size, tables.size, car.unsettled(q).start.size))
        self.imports = self._instance.imports + begun.imports
        for instance, values in ((self._instance, numbers), (begun, own)):
            instance.arrays[2][:], instance.arrays[3][:] = values, tables
        begun.exports["steer_begin"](begun.store, *begun.at)
        *_, state, self.given, inputs, self.outputs = self._instance.arrays
        state[:] = 0.0
        state[: begun.arrays[4].size] = begun.arrays[4]
        self.given[:], inputs[:] = 0.0, 0.0
        self.advance(int(begun.arrays[0].view(np.int64)[0]))
        state[list(subsystem.zero_states)] = 0.0

    def advance(self, samples):
        """Advance by so many samples."""
        self._instance.exports["steer_advance"](self._instance.store, *self._instance.at, samples)

    def run(self, inputs):
        """Channels (T, C) for the handwheel angle and speed of inputs (T, I)."""
        record = np.zeros((len(inputs), self.outputs.size))
        for row, u in zip(record, inputs):
            self.given[1:3] = u[plant.HAND], u[plant.HAND_SPEED]
            self.advance(1)
            row[:] = self.outputs
        return record
