"""The packets of the co-simulation over UDP: one header, then the values of a subsystem, all little-endian.

Every request of a subsystem has one size and every answer has one size; a refusal is a header alone.
docs/cosimulation.md describes the protocol, and :func:`steer_env.connect.udp.describe` prints a layout.
"""

import struct
import zlib
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from steer_env.connect.variables import Variable, variables
from steer_env.friction.numerics.frozen import frozen
from steer_env.friction.numerics.kernel import kernel
from steer_env.vehicle.subsystems import Signal, Subsystem

VERSION = 1
MAGIC = int.from_bytes(b"SENV", "little")
# Name, type and meaning of every field of the header.
FIELDS = (
    ("magic", "<u4", "the four characters SENV"),
    ("check", "<u4", "CRC-32 (as in zlib and Ethernet) of all bytes of the packet from offset 8 on"),
    ("version", "<u2", f"of the protocol, {VERSION}"),
    ("kind", "<u2", "what the packet is"),
    ("layout", "<u4", "fingerprint of the subsystem's inputs and outputs"),
    ("session", "<u8", "number of the session, chosen by the client, a new one each time"),
    ("sequence", "<u4", "one more in each new request, modulo 2^32; in an answer that of its request"),
    (
        "samples",
        "<u4",
        "in lockstep length of the step, 1 to 10000, of open in free running time between answers [ms]; of tune the "
        "number of the parameter, from 0, whose value is the first input",
    ),
    ("code", "<u4", "of refused the reason, of opened the mode, of stepped in free running the phase of the watchdog"),
    (
        "detail",
        "<u4",
        "of the reason VALUE the number of the input, of PARAMETER that of the parameter, of BUSY the time after which "
        "the open session ends if its client stays silent [s]; else 0",
    ),
    ("time", "<f8", "simulation time of the values [s]"),
    ("sent", "<i8", "monotonic clock of the sender [ns]"),
    ("echo", "<i8", "in an answer the field sent of its request [ns]"),
    ("torque", "<f8", "in free running the torque for a motor at the handwheel, limited and faded; else 0 [N m]"),
    ("gain", "<f8", "in free running the factor of the watchdog in that torque, 0 to 1; else 0"),
)
HEADER = np.dtype([(name, kind) for name, kind, _ in FIELDS])
HEADER_SIZE = HEADER.itemsize  # [byte]
CHECKED = HEADER.fields["version"][1]  # type: ignore[index]  # offset from which on the checksum counts
_LETTERS = {"<u2": "H", "<u4": "I", "<u8": "Q", "<i8": "q", "<f8": "d"}
_STRUCT = struct.Struct("<" + "".join(_LETTERS[kind] for _, kind, _ in FIELDS))
LARGEST = 4096  # datagrams are received up to this size [byte]; every packet is smaller
MOST_SAMPLES = 10_000  # in one step

PACKET_KINDS = {
    "open": 1,  # request of a session
    "step": 2,  # request with inputs
    "close": 3,  # request to end the session
    "tune": 4,  # request to give a parameter a value, from the next step on until the session ends
    "opened": 11,
    "stepped": 12,
    "closed": 13,
    "refused": 14,
    "tuned": 15,
}
OPEN, STEP, CLOSE, TUNE, OPENED, STEPPED, CLOSED, REFUSED, TUNED = PACKET_KINDS.values()

MODES = {"lockstep": 0, "free-running": 1}
FREE_RUNNING = MODES["free-running"]

# Reason of a refusal -> what it means.
REASONS = {
    "version": "the packet is of another version of the protocol",
    "layout": "the packet is of another subsystem, or its size is another",
    "kind": "a request of this kind is not known",
    "busy": "a session of another client is open; after the seconds in the field detail it ends if that stays silent",
    "no_session": "the session is not open: it was closed, or silent for too long, or never opened",
    "used": "the number of the session was used before: take a new one",
    "sequence": "requests are missing in between: the sequence number is ahead by more than one",
    "reused": "a request with this sequence number, but other contents, was answered before",
    "samples": "the length of the step is out of range",
    "value": "an input is not finite or outside its range, docs/real_time.md; the field detail has its number",
    "diverged": "the step does not stay finite; nothing has changed",
    "parameter": "there is no such parameter, or its value is not finite or outside its bounds",
}
(
    BAD_VERSION,
    BAD_LAYOUT,
    BAD_KIND,
    BUSY,
    NO_SESSION,
    USED,
    BAD_SEQUENCE,
    REUSED,
    BAD_SAMPLES,
    BAD_VALUE,
    DIVERGED,
    BAD_PARAMETER,
) = range(1, len(REASONS) + 1)


class Layout(NamedTuple):
    """What the packets of a subsystem hold behind the header: its inputs in a request, its outputs in an answer."""

    subsystem: str
    inputs: tuple[Signal, ...]
    outputs: tuple[Signal, ...]
    parameters: tuple[Variable, ...] = ()  # that "tune" takes, of which packets hold one at a time

    @property
    def request_size(self) -> int:
        """Size of every request [byte]."""
        return HEADER_SIZE + 8 * len(self.inputs)

    @property
    def answer_size(self) -> int:
        """Size of every answer that is no refusal [byte]."""
        return HEADER_SIZE + 8 * len(self.outputs)

    @property
    def fingerprint(self) -> int:
        """A number of 32 bits that changes with the protocol, the subsystem, and the names and units of its values."""
        lists = ([f"{s.name} [{s.unit}]" for s in signals] for signals in (self.inputs, self.outputs))
        return zlib.crc32(repr((VERSION, self.subsystem, *lists)).encode())


def layout_of(subsystem: Subsystem) -> Layout:
    """The packets of a subsystem: inputs, outputs and tunable parameters are those of the unit by ``export-fmu``.

    But for the road under each wheel and the poses of the wheels, which only the unit has.
    """
    tunable = (v for v in variables(subsystem, 2) if v.use == "TUNABLE" and not v.boolean)
    return Layout(subsystem.name, subsystem.given, subsystem.outputs, tuple(tunable))


def packed(values: ArrayLike = (), **fields: Any) -> bytes:
    """The bytes of a packet with these fields of the header, others zero, and these values behind it."""
    known = {"magic": MAGIC, "version": VERSION, **fields}
    body = _STRUCT.pack(*(known.get(name, 0) for name, _, _ in FIELDS)) + np.asarray(values, "<f8").tobytes()
    return body[:4] + zlib.crc32(body[CHECKED:]).to_bytes(4, "little") + body[CHECKED:]


def unpacked(packet: bytes) -> dict[str, Any] | None:
    """The fields of the header of a packet; None for bytes that are no packet, or a damaged one."""
    if len(packet) < HEADER_SIZE:
        return None
    fields = dict(zip(HEADER.names or (), _STRUCT.unpack_from(packet)))
    return fields if fields["magic"] == MAGIC and fields["check"] == zlib.crc32(packet[CHECKED:]) else None


def _tables() -> NDArray[np.int64]:
    """Remainders (8, 256) of every byte with none to seven zero bytes behind it."""
    remainders = [np.arange(256)]
    for _ in range(8):
        values = remainders[0]
        remainders[0] = np.where(values & 1, 0xEDB88320 ^ (values >> 1), values >> 1)
    for _ in range(7):
        remainders.append(remainders[0][remainders[-1] & 255] ^ (remainders[-1] >> 8))
    return frozen(np.array(remainders))


_TABLES = _tables()


@kernel
def checksum(words, end):
    """The field ``check`` of a packet in ``words`` (N,) of int64, which ends before the word ``end``.

    It is the CRC-32 of zlib, taken eight bytes at a time: by themselves they cost more than a step of the car.
    """
    c = 0xFFFFFFFF
    for i in range(CHECKED // 8, end):
        word = int(words[i]) ^ c
        c = 0
        for k in range(8):
            c ^= _TABLES[7 - k, (word >> 8 * k) & 255]
    return c ^ 0xFFFFFFFF
