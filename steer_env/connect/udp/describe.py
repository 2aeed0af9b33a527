"""The layout of the packets of a subsystem, for those who write the other end: as text, JSON, or a header for C."""

import json
import math
import re
from collections.abc import Iterable
from typing import Any

from steer_env.connect.udp.packets import (
    FIELDS,
    HEADER,
    HEADER_SIZE,
    MAGIC,
    MODES,
    MOST_SAMPLES,
    PACKET_KINDS,
    REASONS,
    VERSION,
    Layout,
)
from steer_env.friction.numerics.check import one_of
from steer_env.live.real_time.safety import PHASES
from steer_env.vehicle.subsystems import Signal

PLACES = {name: i for i, name in enumerate(PHASES)}  # of the phases of the watchdog
FORMATS = ("text", "json", "c")
_C_TYPES = {"<u2": "uint16_t", "<u4": "uint32_t", "<u8": "uint64_t", "<i8": "int64_t", "<f8": "double"}
_TYPE_NAMES = {"<u2": "uint16", "<u4": "uint32", "<u8": "uint64", "<i8": "int64", "<f8": "float64"}


def describe(layout: Layout, form: str = "text") -> str:
    """The layout of the packets of a subsystem.

    Parameters
    ----------
    layout : Layout
        From :func:`steer_env.connect.udp.layout_of`.
    form : {"text", "json", "c"}
        ``"c"`` is a header file with the structures, all numbers and the checksum.

    Raises
    ------
    ValueError
        For another form.
    """
    one_of("form", form, FORMATS)
    return {"text": _text, "json": _json, "c": _c}[form](layout)


def _data(layout: Layout) -> dict[str, Any]:
    """Everything about the packets, as JSON holds it."""
    return {
        "part": layout.subsystem,
        "version": VERSION,
        "layout": layout.fingerprint,
        "byte_order": "little-endian",
        "request_size": layout.request_size,
        "answer_size": layout.answer_size,
        "refusal_size": HEADER_SIZE,
        "most_samples": MOST_SAMPLES,
        "header": [
            {"offset": _offset(name), "name": name, "type": _TYPE_NAMES[kind], "meaning": text}
            for name, kind, text in FIELDS
        ],
        "kinds": PACKET_KINDS,
        "modes": MODES,
        "phases": PLACES,
        "reasons": {name: i for i, name in enumerate(REASONS, 1)},
        "inputs": [{**entry, "start": s.start} for entry, s in zip(_signals(layout.inputs), layout.inputs)],
        "outputs": _signals(layout.outputs),
        "parameters": [
            {"number": i, "name": v.name, "unit": v.unit, "meaning": v.description, "start": v.start, **_bounds(v)}
            for i, v in enumerate(layout.parameters)
        ],
    }


def _offset(name: str) -> int:
    return HEADER.fields[name][1]  # type: ignore[index]


def _signals(signals: Iterable[Signal]) -> list[dict[str, Any]]:
    return [
        {"offset": HEADER_SIZE + 8 * i, "name": s.name, "unit": s.unit, "meaning": s.description, **_bounds(s)}
        for i, s in enumerate(signals)
    ]


def _bounds(s: Any) -> dict[str, float]:
    """Least and largest value, where there are such."""
    return {name: bound for name, bound in (("low", s.low), ("high", s.high)) if math.isfinite(bound)}


def _bounds_text(entry: dict[str, Any]) -> str:
    """The bounds of an entry in words."""
    words = (("low", "at least"), ("high", "at most"))
    return "".join(f"; {text} {entry[name]:.6g}" for name, text in words if name in entry)


def _json(layout: Layout) -> str:
    return json.dumps(_data(layout), indent=1) + "\n"


def _text(layout: Layout) -> str:
    data = _data(layout)
    lines = [
        f"Packets of the subsystem {layout.subsystem}, version {VERSION} of the protocol, layout"
        f" 0x{layout.fingerprint:08x}.",
        f"Little-endian. A request has {layout.request_size} bytes, an answer {layout.answer_size}, a refusal "
        f"{HEADER_SIZE}.",
        "",
        "Header of every packet",
        *(f"{e['offset']:6d}  {e['type']:8s} {e['name']:10s} {e['meaning']}" for e in data["header"]),
    ]
    for title, entries in (("Inputs, in a request", data["inputs"]), ("Outputs, in an answer", data["outputs"])):
        width, units = (max(len(entry[key]) for entry in entries) for key in ("name", "unit"))
        lines += ["", title]
        lines += [
            f"{e['offset']:6d}  float64  {e['name']:{width}s}  {e['unit']:{units}s}  {e['meaning']}"
            + _bounds_text(e)
            + (f"; {e['start']:.6g} at the start" if e.get("start") else "")
            for e in entries
        ]
    if data["parameters"]:
        width, units = (max(len(entry[key]) for entry in data["parameters"]) for key in ("name", "unit"))
        lines += ["", "Parameters, by their numbers in tune"]
        lines += [
            f"{e['number']:6d}  {e['name']:{width}s}  {e['unit']:{units}s}  {e['meaning']}{_bounds_text(e)}"
            f"; {e['start']:.6g} at the start"
            for e in data["parameters"]
        ]
    lines += ["", "Kinds", *(f"{number:6d}  {name}" for name, number in PACKET_KINDS.items())]
    lines += ["", "Modes, in the field code of opened", *(f"{number:6d}  {name}" for name, number in MODES.items())]
    lines += ["", "Phases of the watchdog, in the field code of stepped in free running"]
    lines += [f"{number:6d}  {name}" for name, number in PLACES.items()]
    lines += ["", "Reasons, in the field code of a refusal"]
    lines += [f"{number:6d}  {name:10s} {text}" for number, (name, text) in enumerate(REASONS.items(), 1)]
    return "\n".join(lines) + "\n"


_CHECKSUM = """
/* The field check of a packet: CRC-32 with the polynomial of IEEE 802.3, from the field version on. */
static inline uint32_t steer_checksum(const void *packet, size_t size)
{
    const unsigned char *bytes = packet;
    uint32_t check = 0xffffffffu;
    for (size_t i = offsetof(struct steer_header, version); i < size; i++) {
        check ^= bytes[i];
        for (int bit = 0; bit < 8; bit++)
            check = check >> 1 ^ (check & 1u ? 0xedb88320u : 0u);
    }
    return ~check;
}

_Static_assert(sizeof(struct steer_header) == %d, "the header must have no gaps");

#endif
"""


def _c(layout: Layout) -> str:
    def numbered(what: str, prefix: str, entries: Iterable[tuple[str, str, str]]) -> list[str]:
        rows = [f"    STEER_{prefix}{name.upper()}{value}, /* {text} */" for name, value, text in entries]
        return ["", f"enum steer_{what} {{", *rows, "};"]

    def signals(entries: Iterable[Any]) -> list[tuple[str, str, str]]:
        return [(re.sub(r"\W+", "_", s.name).strip("_"), "", f"[{s.unit}] {s.description}") for s in entries]

    def values(numbers: dict[str, int], text: str) -> list[tuple[str, str, str]]:
        return [(name.replace("-", "_"), f" = {number}", text) for name, number in numbers.items()]

    fields = [f"    {_C_TYPES[kind]} {name}; /* {text} */" for name, kind, text in FIELDS]
    lines = [
        f"/* Packets of the subsystem {layout.subsystem} of steer-env, written by",
        f" * 'steer-env serve --subsystem {layout.subsystem} --describe c'. The packets are little-endian,",
        " * as the machine that this is compiled for has to be. */",
        "",
        "#ifndef STEER_PACKETS_H",
        "#define STEER_PACKETS_H",
        "",
        "#include <stddef.h>",
        "#include <stdint.h>",
        "",
        f"#define STEER_MAGIC 0x{MAGIC:08x}u",
        f"#define STEER_VERSION {VERSION}",
        f"#define STEER_LAYOUT 0x{layout.fingerprint:08x}u",
        f"#define STEER_INPUTS {len(layout.inputs)}",
        f"#define STEER_OUTPUTS {len(layout.outputs)}",
        f"#define STEER_MOST_SAMPLES {MOST_SAMPLES}",
        "",
        "struct steer_header {",
        *fields,
        "};",
        "",
        "struct steer_request {",
        "    struct steer_header header;",
        "    double inputs[STEER_INPUTS]; /* in the order of enum steer_input */",
        "};",
        "",
        "struct steer_answer { /* a refusal ends with the header */",
        "    struct steer_header header;",
        "    double outputs[STEER_OUTPUTS]; /* in the order of enum steer_output */",
        "};",
        *numbered("kind", "", values(PACKET_KINDS, "in the field kind")),
        *numbered("reason", "BAD_", ((name, f" = {i}", text) for i, (name, text) in enumerate(REASONS.items(), 1))),
        *numbered("mode", "", values(MODES, "in the field code of opened")),
        *numbered("phase", "PHASE_", values(PLACES, "of the watchdog, in the field code of stepped in free running")),
        *numbered("input", "IN_", signals(layout.inputs)),
        *numbered("output", "OUT_", signals(layout.outputs)),
        *(numbered("parameter", "TUNE_", signals(layout.parameters)) if layout.parameters else ()),
    ]
    return "\n".join(lines) + "\n" + _CHECKSUM % HEADER_SIZE
