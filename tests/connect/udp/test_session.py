"""What a session does with every kind of packet, without sockets."""

import math
import os
import random
import struct
import subprocess
import sys
import zlib
from pathlib import Path

import numpy as np
import pytest

from steer_env.connect import udp as cosimulation
from steer_env.connect.udp.packets import HEADER, HEADER_SIZE, PACKET_KINDS, REASONS, checksum, packed, unpacked
from steer_env.connect.udp.session import end_where_silent
from steer_env.live.real_time.model import make_model
from steer_env.vehicle.subsystems import advance
from tests.connect.udp.direct import Direct

REASON = {name: i for i, name in enumerate(REASONS, 1)}


@pytest.fixture
def served():
    """A server with an open session, number 7, whose last sequence number is 0."""
    direct = Direct()
    assert direct.ask("open", 0)["kind"] == PACKET_KINDS["opened"]
    return direct


def refused(header, reason, detail=0):
    """Whether a header is of a refusal for this reason."""
    return header is not None and (header["kind"], header["code"], header["detail"]) == (
        PACKET_KINDS["refused"],
        REASON[reason],
        detail,
    )


def test_checksum_is_that_of_zlib():
    data = random.Random(1).randbytes(504)
    assert checksum(np.frombuffer(data, np.int64), 63) == zlib.crc32(data[8:])


def test_header_has_no_gaps_and_is_little_endian():
    ends = [offset + dtype.itemsize for dtype, offset, *_ in HEADER.fields.values()]
    assert [HEADER.fields[name][1] for name in HEADER.names] == [0, *ends[:-1]]
    assert HEADER_SIZE == 80
    packet = packed([1.5], sequence=0x01020304)
    assert packet[24:28] == bytes([4, 3, 2, 1])
    assert packet[80:] == struct.pack("<d", 1.5)
    assert unpacked(packet)["sequence"] == 0x01020304
    assert unpacked(packet[:-1]) is None


def test_inputs_and_outputs_are_those_of_the_unit(served):
    assert served.layout.inputs == served.subsystem.given
    assert served.layout.outputs == served.subsystem.outputs
    other = served.layout._replace(inputs=(served.layout.inputs[0]._replace(unit="N mm"), *served.layout.inputs[1:]))
    assert other.fingerprint != served.layout.fingerprint


def test_steps_are_those_of_the_kernel(served):
    twin = Direct()
    given = np.zeros(twin.subsystem.given_size)
    given[: len(twin.inputs)] = twin.inputs
    for i in range(1, 200):
        given[0] = 3.0 * math.sin(0.05 * i)
        answer = served.send(served.request("step", i, inputs=given[: len(twin.inputs)], samples=1 + i % 3))
        assert advance(twin.model.subsystem, twin.model.state, given, twin.model.inputs, twin.model.outputs, 1 + i % 3)
        assert answer[HEADER_SIZE:] == twin.model.outputs.tobytes()
    assert unpacked(answer)["time"] == pytest.approx(1e-3 * sum(1 + i % 3 for i in range(1, 200)))


def tune(direct, sequence, name, value, **fields):
    """The header of the answer to a request to tune a parameter."""
    number = [parameter.name for parameter in direct.layout.parameters].index(name)
    inputs = np.array([value, *direct.inputs[1:]])
    return number, direct.ask("tune", sequence, inputs=inputs, samples=number, **fields)


def test_a_parameter_that_is_tuned_is_that_of_another_plant():
    """A torsion bar that is stiffer from the first step on is a plant made with it; a new session has the old one."""
    stiff = Direct(friction="lugre")
    p = stiff.subsystem.parameters
    stiff.model = make_model(stiff.subsystem._replace(parameters=p._replace(column=p.column._replace(K_tb=200.0))))
    plain = Direct(friction="lugre")
    direct = Direct(friction="lugre", tuned=True)
    direct.ask("open", 0), stiff.ask("open", 0), plain.ask("open", 0)
    number, answer = tune(direct, 1, "column.K_tb", 200.0)
    assert (answer["kind"], answer["samples"], answer["time"]) == (PACKET_KINDS["tuned"], number, 0.0)
    inputs = np.array([2.0, *direct.inputs[1:]])

    def rows(server, first, session=7):
        packets = (server.request("step", first + i, inputs=inputs, session=session) for i in range(300))
        return b"".join(server.send(packet)[HEADER_SIZE:] for packet in packets)

    found = rows(direct, 2)
    old = rows(plain, 1)
    assert found == rows(stiff, 1) != old
    assert direct.ask("close", 302)["kind"] == PACKET_KINDS["closed"]
    direct.ask("open", 0, session=8)
    assert rows(direct, 1, session=8) == old


@pytest.mark.parametrize("value", [math.nan, math.inf, -1.0, -1e300])
def test_a_value_beyond_its_bound_is_not_taken(value):
    direct = Direct(tuned=True)
    direct.ask("open", 0)
    numbers = direct.link.numbers.copy()
    number, answer = tune(direct, 1, "column.K_tb", value)
    assert refused(answer, "parameter", number)
    assert refused(direct.ask("tune", 1, samples=10_000), "parameter", 10_000)
    assert np.array_equal(direct.link.numbers, numbers)
    number, answer = tune(direct, 1, "level.asymmetry", -0.9)  # from here on its declared range
    assert answer["kind"] == PACKET_KINDS["tuned"]
    assert tune(direct, 1, "level.asymmetry", -0.9)[1] == answer  # the same request gets the same answer
    assert refused(tune(direct, 2, "level.asymmetry", -0.91)[1], "parameter", number)
    assert refused(tune(direct, 2, "level.asymmetry", 0.1, session=9)[1], "busy", 10)


def test_a_plant_without_code_has_no_parameters(served):
    assert refused(served.ask("tune", 1), "parameter", 1)


def test_the_same_request_gets_the_same_answer_and_nothing_moves(served):
    request = served.request("step", 1, sent=123)
    answer = served.send(request, now=5)
    assert unpacked(answer)["echo"] == 123
    state = served.model.state.copy()
    for now in (6, 7):
        assert served.send(request, now=now) == answer
    assert np.array_equal(served.model.state, state)
    assert served.counts("steps", "repeated") == {"steps": 1, "repeated": 2}
    assert refused(served.ask("step", 1, sent=124), "reused")
    assert served.send(request) == answer


def test_late_and_early_requests(served):
    first = served.request("step", 1)
    served.send(first)
    served.ask("step", 2)
    state = served.model.state.copy()
    assert served.send(first) is None
    assert refused(served.ask("step", 4), "sequence")
    assert np.array_equal(served.model.state, state)
    assert served.ask("step", 3)["kind"] == PACKET_KINDS["stepped"]
    assert served.counts("late", "refused", "steps") == {"late": 1, "refused": 1, "steps": 3}


def test_sequence_numbers_wrap_around():
    direct = Direct()
    last = 2**32 - 1
    assert direct.ask("open", last)["kind"] == PACKET_KINDS["opened"]
    assert direct.ask("step", 0)["kind"] == PACKET_KINDS["stepped"]
    assert direct.ask("step", last) is None
    assert direct.ask("step", 1)["kind"] == PACKET_KINDS["stepped"]


def test_session_0_is_a_number_like_others():
    direct = Direct()
    assert direct.ask("open", 0, session=0)["kind"] == PACKET_KINDS["opened"]
    assert direct.ask("close", 1, session=0)["kind"] == PACKET_KINDS["closed"]
    assert refused(direct.ask("open", 2, session=0), "used")


def test_a_close_that_is_ahead_is_refused(served):
    assert refused(served.ask("close", 50), "sequence")
    assert served.ask("close", 1)["kind"] == PACKET_KINDS["closed"]


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 1e300, 201.0])
def test_an_input_that_makes_no_sense_is_named(served, value):
    inputs = served.inputs.copy()
    inputs[2] = value
    assert refused(served.ask("step", 1, inputs=inputs), "value", 2)
    assert served.ask("step", 1)["kind"] == PACKET_KINDS["stepped"]


@pytest.mark.parametrize(("name", "value"), [("throttle_request", -0.01), ("coast", 1.5), ("brake_request", -1.0)])
def test_the_bounds_of_an_input_are_those_that_are_declared(name, value):
    direct = Direct("car", chassis="two_track")
    place = [signal.name for signal in direct.subsystem.given].index(name)
    direct.ask("open", 0)
    for given, expected in ((value, False), (0.5, True)):
        inputs = direct.inputs.copy()
        inputs[place] = given
        answer = direct.ask("step", 1, inputs=inputs)
        assert answer["kind"] == PACKET_KINDS["stepped"] if expected else refused(answer, "value", place)


@pytest.mark.parametrize("samples", [0, 10_001, 2**32 - 1])
def test_length_of_a_step(served, samples):
    assert refused(served.ask("step", 1, samples=samples), "samples")
    assert served.counts("samples") == {"samples": 0}


def test_a_step_that_diverges_changes_nothing(served):
    served.ask("step", 1)
    served.model.state[:] = 1e308
    state, shown = served.model.state.copy(), served.model.outputs.copy()
    assert refused(served.ask("step", 2, samples=1000), "diverged")
    assert np.array_equal(served.model.state, state)
    answer = served.send(served.request("close", 2))
    assert np.array_equal(np.frombuffer(answer[HEADER_SIZE:]), shown[0])


def test_what_is_no_packet_of_ours_is_counted_and_left_alone(served):
    packet = served.request("step", 1)
    flipped = bytearray(packet)
    flipped[70] ^= 16
    for datagram in (
        b"",
        packet[:40],
        packet[:-8],
        packet[:-3],
        packet + b"12345678",
        b"GET / HTTP/1.1\r\n" * 5,
        bytes(flipped),
    ):
        assert served.send(datagram) is None
    assert served.counts("truncated", "foreign", "damaged", "steps") == {
        "truncated": 5,
        "foreign": 1,
        "damaged": 1,
        "steps": 0,
    }
    assert served.counts("received")["received"] == 8


def test_packets_of_another_version_part_or_kind_are_refused(served):
    assert refused(served.ask("step", 1, version=2), "version")
    assert refused(served.ask("step", 1, layout=served.layout.fingerprint ^ 1), "layout")
    assert refused(served.ask("step", 1, inputs=[0.0]), "layout")
    answer = packed(served.inputs, kind=9, layout=served.layout.fingerprint, session=7, sequence=1)
    assert refused(unpacked(served.send(answer)), "kind")
    assert served.ask("step", 1)["kind"] == PACKET_KINDS["stepped"]


def test_one_client_at_a_time(served):
    state = served.model.state.copy()
    assert refused(served.ask("open", 0, known=False, session=8), "busy", 10)
    assert refused(served.ask("open", 5, session=8), "busy", 10)
    assert refused(served.ask("step", 1, known=False), "busy", 10)
    assert refused(served.ask("close", 1, session=8), "busy", 10)
    assert np.array_equal(served.model.state, state)
    assert served.ask("step", 1)["kind"] == PACKET_KINDS["stepped"]
    assert served.ask("close", 2)["kind"] == PACKET_KINDS["closed"]
    assert refused(served.ask("step", 3), "no_session")
    assert refused(served.ask("open", 3), "used")
    assert served.ask("open", 0, known=False, session=8)["kind"] == PACKET_KINDS["opened"]


def test_every_session_begins_alike(served):
    """Also after a session whose end was not acknowledged: the close comes again and gets the same answer."""
    first = served.send(served.request("step", 1, samples=50))[HEADER_SIZE:]
    close = served.request("close", 2)
    assert served.send(close) == served.send(close)
    served.ask("open", 0, session=9)
    assert served.send(served.request("step", 1, session=9, samples=50))[HEADER_SIZE:] == first


def test_busy_tells_after_how_many_seconds_the_session_of_a_dead_client_ends(served):
    second = 1_000_000_000
    served.ask("step", 1, now=0)
    for now, left in ((0.0, 10), (0.1, 10), (7.5, 3), (9.9, 1)):
        assert served.ask("open", 0, known=False, session=8, now=int(now * second))["detail"] == left
    assert not end_where_silent(served.link, int(9.9 * second) + left * second)
    assert served.ask("open", 0, known=False, session=8, now=11 * second)["kind"] == PACKET_KINDS["opened"]


def test_a_silent_session_ends(served):
    served.ask("step", 1, now=1000)
    assert end_where_silent(served.link, 10_000_001_000)
    assert not end_where_silent(served.link, 10_000_001_001)
    assert refused(served.ask("step", 2), "no_session")
    assert served.counts("silent") == {"silent": 1}


def test_random_bytes_never_move_the_plant(served):
    draw = random.Random(3)
    state = served.model.state.copy()
    packet = served.request("step", 1)
    for _ in range(20_000):
        if draw.random() < 0.5:
            datagram = draw.randbytes(draw.randrange(200))
        else:  # a packet with up to eight changed bytes
            changed = bytearray(packet)
            for _ in range(draw.randrange(1, 9)):
                changed[draw.randrange(len(packet))] = draw.randrange(256)
            datagram = bytes(changed)
        if datagram != packet:
            assert served.send(datagram) is None
    assert np.array_equal(served.model.state, state)


def test_plain_python_gives_the_same_bytes(served):
    code = (
        "from tests.connect.udp.direct import Direct\n"
        "direct = Direct()\n"
        "for kind, sequence in (('open', 0), ('step', 1), ('step', 2), ('step', 2), ('close', 3)):\n"
        "    print(direct.send(direct.request(kind, sequence)).hex())\n"
    )
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    root = Path(__file__).parents[3]
    done = subprocess.run([sys.executable, "-c", code], env=environment, cwd=root, capture_output=True, text=True)
    fresh = Direct()
    calls = (("open", 0), ("step", 1), ("step", 2), ("step", 2), ("close", 3))
    assert done.stdout.split() == [fresh.send(fresh.request(*call)).hex() for call in calls], done.stderr


def test_an_unknown_form_of_the_description_is_refused(served):
    assert cosimulation.describe(served.layout)
    with pytest.raises(ValueError, match="form must be one of text, json, c, got 'xml'"):
        cosimulation.describe(served.layout, "xml")
