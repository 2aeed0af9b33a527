"""A client and a vehicle behind a port that answers what it should not."""

import socket
import threading
from contextlib import contextmanager
from functools import cache

import numpy as np
import pytest

from steer_env.connect.external import CouplingError, UdpVehicle
from steer_env.connect.udp import Client, Stream
from steer_env.connect.udp.packets import LARGEST, MAGIC, PACKET_KINDS, packed, unpacked
from tests.connect.udp import served

ANSWERS = {
    PACKET_KINDS["open"]: PACKET_KINDS["opened"],
    PACKET_KINDS["step"]: PACKET_KINDS["stepped"],
    PACKET_KINDS["close"]: PACKET_KINDS["closed"],
}


@cache
def layout():
    """That of the chassis, made when a test needs it, as its kernels are compiled."""
    return served.layout("chassis")


@contextmanager
def answering(values=None, **changed):
    """The address of a server whose answers to steps have these values, or fields of the header that are changed."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as server:
        server.bind(("127.0.0.1", 0))

        def answer():
            while True:
                packet, client = server.recvfrom(LARGEST)
                if packet == b"end":
                    return
                asked = unpacked(packet)
                fields = {key: asked[key] for key in ("session", "sequence", "layout")}
                step = asked["kind"] == PACKET_KINDS["step"]
                fields |= {"kind": ANSWERS[asked["kind"]], "time": 1e-3 * step, **(changed if step else {})}
                outputs = np.zeros(len(layout().outputs)) if values is None or not step else values
                server.sendto(packed(outputs, **{"magic": MAGIC, **fields}), client)

        thread = threading.Thread(target=answer)
        thread.start()
        try:
            yield server.getsockname()
        finally:
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as end:
                end.sendto(b"end", server.getsockname())
            thread.join()


@pytest.mark.parametrize(
    ("faults", "message"),
    [
        ({"layout": 1}, "both ends need the same subsystem and the same version"),
        ({"version": 2}, "has version 2, .* this client expects version 1"),
        ({"values": [0.0]}, "and 88 bytes, but this client expects"),
        ({"kind": PACKET_KINDS["refused"], "values": [], "code": 99}, "for the reason 99, which this version"),
        ({"kind": PACKET_KINDS["refused"], "values": [], "code": 0}, "for the reason 0, which this version"),
        ({"kind": PACKET_KINDS["refused"], "values": [], "code": 10, "detail": 4000}, "an input is not finite"),
    ],
)
def test_answers_of_another_protocol_are_told(faults, message):
    with answering(**faults) as address:
        client = Client(layout(), address)
        with pytest.raises(ValueError, match=message):
            client.step(np.zeros(len(layout().inputs)))
        client.__exit__(None, None, None)
        vehicle = UdpVehicle(layout(), address, 20.0)
        vehicle.start(20.0)
        with pytest.raises(CouplingError, match=message):
            vehicle.step(np.zeros(len(vehicle.takes)), 1)
        vehicle.close()


def test_a_stream_refuses_another_layout():
    with answering(layout=1) as address, Stream(layout(), address) as stream:
        stream.put(np.zeros(len(layout().inputs)))
        with pytest.raises(ValueError, match="both ends need the same subsystem"):
            stream.get(1.0)


@pytest.mark.parametrize("value", [np.nan, np.inf])
@pytest.mark.parametrize("name", ["rack_force", "yaw_rate"])
def test_a_vehicle_that_gives_no_number_is_named(name, value):
    values = np.zeros(len(layout().outputs))
    values[[signal.name for signal in layout().outputs].index(name)] = value
    with answering(values) as address:
        vehicle = UdpVehicle(layout(), address, 20.0)
        vehicle.start(20.0)
        with pytest.raises(CouplingError, match=rf"127\.0\.0\.1:\d+ gave {name} = {value} at 0\.001 s"):
            vehicle.step(np.zeros(len(vehicle.takes)), 1)
        vehicle.close()
