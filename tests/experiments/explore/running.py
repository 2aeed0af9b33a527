"""A module of the car, run by wasmtime, with the arguments of the plant's kernels."""

import numpy as np
import wasmtime

from steer_env.friction.numerics.packing import pack
from steer_env.vehicle import plant
from steer_env.vehicle.subsystems import car


class Running:
    """An instance of a module with the parameters of a plant, in straight running."""

    def __init__(self, wasm, p):
        subsystem = car.unsettled(p)
        self.store = wasmtime.Store()
        made = wasmtime.Module(self.store.engine, wasm)
        self.imports = [f"{one.module}.{one.name}" for one in made.imports]
        self.exports = wasmtime.Instance(self.store, made, []).exports(self.store)
        self.exports["_initialize"](self.store)
        self._end = -(-self.exports["__heap_base"].value(self.store) // 16) * 16
        numbers, tables = pack(p)
        sizes = (1, 1, numbers.size, tables.size, subsystem.start.size, subsystem.given_size, subsystem.inputs)
        places = [self._place(size) for size in (*sizes, len(subsystem.outputs))]
        memory = self.exports["memory"]
        lacking = self._end - memory.data_len(self.store)
        if lacking > 0:
            memory.grow(self.store, -(-lacking // 65536))
        whole = np.frombuffer(memory.get_buffer_ptr(self.store), np.uint8)
        self.views = [
            whole[at : at + 8 * n].view(np.float64) for at, n in zip(places, (*sizes, len(subsystem.outputs)))
        ]
        self.at = places
        self.result, _, *_, self.state, self.given, self.inputs, self.outputs = self.views
        self.views[2][:], self.views[3][:] = numbers, tables
        self.subsystem = subsystem
        self.begin()

    def _place(self, floats):
        at, self._end = self._end, self._end + 8 * floats
        return at

    def begin(self):
        """Settle in straight running, as :func:`steer_env.vehicle.plant.settled`."""
        self.exports["steer_begin"](self.store, *self.at[:5])
        self.given[:] = 0.0
        self.inputs[:] = 0.0
        self.advance(int(self.result.view(np.int64)[0]))
        self.state[list(self.subsystem.zero_states)] = 0.0

    def advance(self, samples):
        """Advance by so many samples; whether the state is finite."""
        self.exports["steer_advance"](self.store, *self.at, samples)
        return bool(self.result.view(np.int32)[0])

    def run(self, inputs):
        """Channels (T, C) for the handwheel angle and speed of inputs (T, I)."""
        record = np.zeros((len(inputs), self.outputs.size))
        for row, u in zip(record, inputs):
            self.given[1:3] = u[plant.HAND], u[plant.HAND_SPEED]
            self.advance(1)
            row[:] = self.outputs
        return record
