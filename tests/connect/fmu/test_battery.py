"""Object code against the kernels in Python over every manoeuvre of the battery: the same calls, sample by sample."""

import ctypes
import dataclasses
import shutil
import subprocess
from itertools import cycle, product

import numpy as np
import pytest

from steer_env import manoeuvres
from steer_env.connect.fmu import binary, object_code
from steer_env.friction.numerics import packing
from steer_env.manoeuvres.common import driving
from steer_env.vehicle import cars, plant
from steer_env.vehicle.subsystems import car
from tests.connect.fmu.runs import bits

if shutil.which("cc") is None:
    pytest.skip("there is no C compiler", allow_module_level=True)

pytestmark = pytest.mark.whole

_made: dict = {}


SHOWN = """
#include "unit.h"

int32_t shown(int32_t *finite, void **unused, const double *numbers, const double *tables, double *state,
              const double *given, double *inputs, double *outputs, int64_t samples)
{
    return steer_advance(finite, unused, numbers, tables, state, given, inputs, outputs, samples);
}
"""


def advance_of(p, folder):
    """The hidden function ``steer_advance`` for plants of this structure, and the sizes of its arrays."""
    state, channels = plant.state_size(p), len(plant.channels(p))
    sizes = state, len(plant.INPUTS) + 1, len(plant.INPUTS), channels
    key = (repr([(leaf.path, np.shape(leaf.value)) for leaf in packing.leaves(p)]), type(p.friction), type(p.chassis))
    if key not in _made:
        module = object_code.module_text(car.subsystem(p))
        code = object_code.object_code(module, "linux64", object_code.processor("native"))
        (folder / "kernels.o").write_bytes(code)
        library = folder / f"kernels{len(_made)}.so"
        (folder / "shown.c").write_text(SHOWN)
        sources = f"-I{binary.SOURCES}", folder / "shown.c", folder / "kernels.o"
        subprocess.run(["cc", "-shared", "-fPIC", "-o", library, *sources, "-lm"], check=True)
        _made[key] = ctypes.CDLL(str(library)).shown
    return _made[key], sizes


def replayed(p, state, u, folder):
    """Channels (T, C) of the object code, one sample at a time."""
    advance, (_, given_size, inputs, channels) = advance_of(p, folder)
    numbers, tables = packing.pack(p)
    given, scratch, record = np.zeros(given_size), np.zeros(inputs), np.zeros((len(u), channels))
    finite, unused = ctypes.c_int32(), ctypes.c_void_p()
    fixed = [ctypes.c_void_p(a.ctypes.data) for a in (numbers, tables, state, given, scratch)]
    samples = ctypes.c_int64(1)
    for row, out in zip(u, record):
        given[:3] = (0.0, row[0], row[1]) if p.robot else (row[0], 0.0, 0.0)
        given[3:] = row[2:]
        status = advance(ctypes.byref(finite), ctypes.byref(unused), *fixed, ctypes.c_void_p(out.ctypes.data), samples)
        assert (status, finite.value) == (0, 1)
    return record


def calls_of(m, law, monkeypatch):
    """Every call of the plant's kernel in a manoeuvre, without the search for its amplitude: p, state, u, record."""
    loaded = cars.load("compact")
    p = manoeuvres.build_plant(loaded, m, law)
    prepared = None if m.driver else driving.open_loop(p, m)
    calls, run = [], driving.WholeCar.run

    def kept(self, p, state, u, record, substeps):
        before = state.copy()
        finite = run(self, p, state, u, record, substeps)
        if len(record) == len(u):
            calls.append((p, before, u.copy(), record.copy()))
        return finite

    with monkeypatch.context() as patched:
        patched.setattr(driving.WholeCar, "run", kept)
        driving.drive_plant(loaded, p, m, prepared)
    return calls


MOST = 30_000  # samples of a manoeuvre; a steady circle has 170,000
# Every manoeuvre once, with the kinds of car in turn; some need two tracks.
KINDS = cycle(product(("single_track", "two_track"), ("lugre", "masing")))
RUNS = [
    (name, "two_track" if manoeuvres.make(name).chassis == "two_track" else chassis, law)
    for name, (chassis, law) in zip(manoeuvres.available(), KINDS)
]


@pytest.mark.parametrize(("name", "chassis", "law"), RUNS)
def test_every_manoeuvre(name, chassis, law, tmp_path_factory, monkeypatch):
    m = manoeuvres.make(name)
    calls = calls_of(dataclasses.replace(m, chassis=chassis), law, monkeypatch)
    assert sum(len(u) for _, _, u, _ in calls) > 1000
    left = MOST
    for p, state, u, record in calls:
        u, record = u[:left], record[:left]
        left -= len(u)
        assert np.array_equal(bits(replayed(p, state, u, tmp_path_factory.getbasetemp())), bits(record))
