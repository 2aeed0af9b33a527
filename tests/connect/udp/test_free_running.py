"""A server in free running: what every packet does, on a fake clock; that it keeps time and fades, on the real one."""

import math
import signal
import sys
import time

import numpy as np
import pytest

from steer_env.connect.udp import Server, Stream
from steer_env.connect.udp.packets import MODES, PACKET_KINDS, unpacked
from steer_env.connect.udp.session import NEVER, report
from steer_env.live.real_time import Limits, haptics
from steer_env.live.real_time.safety import SAFETY
from tests.connect.udp.direct import Direct
from tests.connect.udp.served import layout, part_of, serving


@pytest.fixture
def served():
    """A server in free running with an open session that asks for an answer every 2 ms."""
    direct = Direct(mode="free-running")
    assert direct.ask("open", 0, samples=2)["code"] == MODES["free-running"]
    return direct


def test_inputs_are_taken_in_order_and_counted(served):
    served.inputs[0] = 1.0
    assert served.ask("step", 1, now=5) is None
    assert (served.model.wanted[0], served.link.state[0].asked) == (1.0, 5)
    served.inputs[0] = 2.0
    assert served.ask("step", 4, now=6) is None  # two are lost
    served.inputs[0] = 3.0
    assert served.ask("step", 2, now=7) is None  # late
    assert served.ask("step", 4, now=8) is None  # doubled
    assert (served.model.wanted[0], served.link.state[0].asked) == (2.0, 6)
    assert served.counts("lost", "late", "repeated", "steps") == {"lost": 2, "late": 1, "repeated": 1, "steps": 2}
    for value in (math.nan, 1e300):
        served.inputs[0] = value
        assert served.ask("step", 5)["kind"] == PACKET_KINDS["refused"]
        assert served.model.wanted[0] == 2.0


def test_answers_follow_their_own_times(served):
    memory = np.zeros(1, SAFETY).view(np.recarray)[0]
    memory.phase, memory.gain = 2, 0.5
    due = [report(served.model, served.link, memory, 1.5, now) for now in range(4)]
    assert due == [False] * 4  # as no inputs have arrived
    served.ask("step", 7, sent=99)
    due = [report(served.model, served.link, memory, 1.5, now) for now in range(4)]
    assert due == [False, True, False, True]
    answer = unpacked(served.link.sent.tobytes())
    assert answer["kind"] == PACKET_KINDS["stepped"]
    assert (answer["sequence"], answer["echo"], answer["code"]) == (7, 99, 2)
    assert (answer["torque"], answer["gain"], answer["time"]) == (1.5, 0.5, pytest.approx(8e-3))
    assert served.ask("close", 8)["kind"] == PACKET_KINDS["closed"]
    assert not report(served.model, served.link, memory, 1.5, 9)


def test_a_new_session_forgets_the_inputs(served):
    served.ask("step", 1)
    served.ask("close", 2)
    served.ask("open", 0, session=8, samples=20_000)
    assert served.ask("open", 1, session=8)["kind"] == PACKET_KINDS["opened"]  # the former was refused
    assert served.link.state[0].asked == NEVER


if sys.platform != "linux":
    pytest.skip("the server needs Linux", allow_module_level=True)


def until(stream, reached, inputs):
    """The first answer for which ``reached`` is true, while inputs are sent; a machine under load may take its time."""
    end = time.monotonic() + 60.0
    while time.monotonic() < end:
        if inputs is not None:
            stream.put(inputs)
        answer = stream.get(0.002)
        if answer and reached(answer):
            return answer
    pytest.fail("this did not come about in a minute")


def test_time_goes_by_and_a_client_that_falls_silent_loses_its_torque():
    # slow, as stalls of a machine that tests share are not the matter
    limits = Limits(soft_start=0.1, hold=0.2, fade=0.2, missed=1e9)
    with Server(part_of("car", robot=True), mode="free-running", limits=limits) as server:
        with Stream(server.layout, server.address) as stream:
            inputs = np.zeros(len(server.layout.inputs))
            inputs[1] = 0.3  # a jump of the angle, at which the plant pulls back
            first = until(stream, lambda answer: True, inputs)
            start, missed = time.monotonic(), server.counts()["missed"]
            found = until(stream, lambda answer: answer.phase == "on" and answer.torque < -1.0, inputs)
            last = until(stream, lambda answer: answer.time > found.time + 0.5, inputs)
            passed = time.monotonic() - start
            missed = 1e-3 * (server.counts()["missed"] - missed)
            # an answer is as old as its delay at most; what stalls take is counted as missed and not made up
            assert passed - last.delay - missed - 0.01 < last.time - first.time < passed + first.delay + 0.01
            assert last.delay > 0.0
            end = until(stream, lambda answer: answer.phase == "off", None)
            assert end.torque == 0.0
            assert server.counts()["stale_trips"] >= 1
            until(stream, lambda answer: answer.phase == "on", inputs)
        counts = server.counts()
        assert counts["sessions"] == 1
    assert server.counts()["missed"] >= counts["missed"]


def test_the_command_ends_cleanly():
    options = "--hands", "angle", "--free-running", "--torque-limit", "3"
    with (
        serving(*options, end=signal.SIGTERM) as process,
        Stream(layout(), process.address) as stream,
    ):
        until(stream, lambda answer: answer.time > 0.3, np.zeros(7))
    assert process.returncode == 0
    assert process.counts["ticks"] > 100
    assert process.counts["steps"] > 10


def test_an_unknown_mode_is_refused():
    with pytest.raises(ValueError, match="mode must be one of lockstep, free-running, got 'fast'"):
        Server(part_of(), mode="fast")


@pytest.mark.whole
def test_a_wheel_with_much_delay_gets_less_torque():
    with serving("--hands", "angle", "--free-running", "--wheel", "0.04,0.1,30") as process:
        pass
    assert 0.0 < process.told["wheel"]["share"] < 1.0
    assert process.told["wheel"]["longest_delay_s"] < 0.03
    assert process.told["wheel"]["margin"] == haptics.MARGIN
