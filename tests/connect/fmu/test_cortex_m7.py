"""The steering's object file for a Cortex-M7: its example on an emulated board, against the kernels of this machine."""

import re

import numpy as np
import pytest

from steer_env import friction
from steer_env.connect import fmu
from steer_env.experiments.cli.main import main
from steer_env.vehicle import cars, subsystems
from tests.connect.fmu import cortex_m7


@pytest.mark.whole
@pytest.mark.skipif(bool(cortex_m7.MISSING), reason=cortex_m7.MISSING)
@pytest.mark.parametrize("law", friction.available())
def test_the_board_computes_what_this_machine_does(law, tmp_path):
    """One second of the example. Only functions of the C library may differ in the last digit."""
    found = cortex_m7.run(tmp_path, law)
    p = cars.load("compact").plant(law, cortex_m7.SPEED, robot=True)
    made = subsystems.make("steering", p, cortex_m7.SPEED)
    state, inputs, row = made.start.copy(), np.zeros((1, made.inputs)), np.zeros((1, len(made.outputs)))
    expected = np.zeros_like(found.outputs)
    assert found.inputs.shape == (1000, len(made.given))
    for k, given in enumerate(found.inputs):
        assert subsystems.advance(subsystems.Steering(p), state, np.ascontiguousarray(given), inputs, row, 1)
        expected[k] = row[0]
    span = np.ptp(expected, axis=0)
    assert (span > 0.0).all()
    worst = (np.abs(found.outputs - expected).max(axis=0) / span).max()
    print(f"{law}: {worst:.1e} of the span, {found.mean:.0f} instructions a step, {found.most:.0f} at most")
    assert worst < 1e-12
    assert found.mean <= found.most < 100_000  # a controller of 400 MHz has 400,000 cycles for a step


def test_files(tmp_path):
    assert main(["export-object", "--friction", "masing,elements=4", "--hands", "angle", "--out", str(tmp_path)]) == 0
    head = (tmp_path / "steering_kernels.o").read_bytes()[:20]
    assert (head[:5], int.from_bytes(head[18:], "little")) == (b"\x7fELF\1", 40)  # of 32 bit, ARM
    text = (tmp_path / "steering.h").read_text()
    assert "double rack_force; /* force on the rack over the step, positive where it resists a left turn [N] */" in text
    assert "double friction_k[4]; /* " in text
    members = re.search(r"struct steering_parameters \{(.*?)\}", text, re.S)[1].splitlines()[1:]
    assert all(re.fullmatch(r"    double \w+(\[\d+\])*; /\* .+ \*/", member) for member in members[:-1])
    values = re.search(r"steering_parameters = \{\n(.*?)\n\};", (tmp_path / "steering.c").read_text(), re.S)[1]
    assert len(values.splitlines()) == len(members)
    with pytest.raises(ValueError, match="unknown friction law"):
        fmu.export_object(tmp_path, friction="no-such-law")
