"""A client of 'steer-env serve' with Python's standard library alone: one second of a sine of 3 N m at the handwheel.

    steer-env serve --subsystem car --describe json > packets.json
    steer-env serve --subsystem car --port 5005 &
    python client.py 127.0.0.1 5005     # once the server has printed "ready"; it tries for five seconds

It prints time, handwheel angle and torsion-bar torque after every millisecond. Both calls of 'serve' need the same
options of the car; with '--hands angle' the car follows the input hand_angle and not this torque.
"""

import json
import math
import secrets
import socket
import struct
import sys
import time
import zlib
from pathlib import Path

LETTERS = {"uint16": "H", "uint32": "I", "uint64": "Q", "int64": "q", "float64": "d"}


class Session:
    """A session with a server whose packets are as ``steer-env serve --describe json`` prints them."""

    def __init__(self, layout: dict, address: tuple[str, int], patience: float = 0.1, tries: int = 50) -> None:
        self.layout, self.patience, self.tries = layout, patience, tries
        self.fields = [field["name"] for field in layout["header"]]
        self.header = struct.Struct("<" + "".join(LETTERS[field["type"]] for field in layout["header"]))
        self.link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.link.settimeout(patience)
        self.link.connect(address)
        self.session, self.sequence = secrets.randbits(64), 0  # a number that was not used before
        self.exchange("open")

    def close(self) -> None:
        """End the session."""
        self.exchange("close")
        self.link.close()

    def exchange(self, kind: str, samples: int = 0, **inputs: float) -> dict[str, float]:
        """Send a request until its answer arrives, which has the time and all outputs.

        A lost packet costs time and nothing else, because the server carries out each sequence number once and gives
        the same answer again.
        """
        request, reached = self.packet(kind, samples, inputs), True
        for _ in range(self.tries):
            self.link.send(request)
            try:
                while (answer := self.understood(self.link.recv(4096))) is None:
                    pass  # an older answer
            except TimeoutError:
                reached = True
                continue
            except ConnectionRefusedError:  # the server does not receive at its port, yet
                reached = False
                time.sleep(self.patience)
                continue
            self.sequence = (self.sequence + 1) % 2**32
            return answer
        raise TimeoutError("no answer" if reached else "nothing receives there: wait until the server prints 'ready'")

    def packet(self, kind: str, samples: int, inputs: dict[str, float]) -> bytes:
        """The bytes of a request."""
        fields = {
            "magic": int.from_bytes(b"SENV", "little"),
            "version": self.layout["version"],
            "kind": self.layout["kinds"][kind],
            "layout": self.layout["layout"],
            "session": self.session,
            "sequence": self.sequence,
            "samples": samples,
            "sent": time.monotonic_ns(),
        }
        values = [inputs.get(entry["name"], entry["start"]) for entry in self.layout["inputs"]]
        body = self.header.pack(*(fields.get(name, 0) for name in self.fields))
        body += struct.pack(f"<{len(values)}d", *values)
        return body[:4] + zlib.crc32(body[8:]).to_bytes(4, "little") + body[8:]

    def understood(self, packet: bytes) -> dict[str, float] | None:
        """Time and outputs of the answer to the last request; None for any other packet."""
        if len(packet) < self.header.size:
            return None
        header = dict(zip(self.fields, self.header.unpack_from(packet)))
        if header["check"] != zlib.crc32(packet[8:]):
            return None
        if (header["session"], header["sequence"]) != (self.session, self.sequence):
            return None
        if header["kind"] == self.layout["kinds"]["refused"]:
            reasons = {number: name for name, number in self.layout["reasons"].items()}
            reason = reasons[header["code"]]
            if reason == "busy":
                raise ValueError(
                    f"another client's session is open, for {header['detail']} s more if that stays silent"
                )
            raise ValueError(f"refused: {reason}, detail {header['detail']}")
        names = (entry["name"] for entry in self.layout["outputs"])
        values = struct.unpack_from(f"<{len(self.layout['outputs'])}d", packet, self.header.size)
        return {"time": header["time"], **dict(zip(names, values))}


def main(layout: dict, address: tuple[str, int]) -> list[dict[str, float]]:
    """One second of a sine of hand torque; the outputs after each millisecond."""
    session = Session(layout, address)
    outputs = []
    for i in range(1, 1001):
        torque = 3.0 * math.sin(2.0 * math.pi * 1e-3 * i)
        outputs.append(session.exchange("step", samples=1, hand_torque=torque))
    session.close()
    return outputs


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit("usage: client.py ADDRESS PORT")
    found = main(json.loads(Path("packets.json").read_text(encoding="utf-8")), (sys.argv[1], int(sys.argv[2])))
    for row in found:
        print(f"{row['time']:.3f} {row['handwheel_angle']:.17g} {row['torsion_bar_torque']:.17g}")
