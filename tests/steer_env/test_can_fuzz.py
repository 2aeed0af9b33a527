"""Random logs with their truth: none is read wrong without a word, and none that is valid is refused."""

import random

import numpy as np

from steer_env.recording import can_log
from steer_env.recording.channel_mapping import Mapping, entry
from steer_env.recording.files import read
from tests.needs import needs

HEAD = 'VERSION ""\nNS_ :\nBS_:\nBU_: A\n'
FRAMES = 240


def little(raw, length):
    return raw % 2**length


class Pair:
    """A log, its database, and what is true of it."""

    def __init__(self, seed):
        draw = self.draw = random.Random(seed)
        self.said, self.keys = set(), {"from": "M.S", "unit": "Nm"}
        self.period = draw.choice([0.005, 0.01, 0.02])
        self.stamps = [k * self.period for k in range(FRAMES)]
        self.kind = draw.choice(["unsigned", "signed", "float", "magnitude"])
        self.length = 32 if self.kind == "float" else draw.randint(10, 24)
        self.big = draw.random() < 0.5
        self.scale = 1.0 if self.kind == "float" else draw.choice([0.01, 0.1, 0.0625])
        self.offset = -self.scale * 2 ** (self.length - 1) if self.kind == "unsigned" else 0.0
        self.frame_id, self.extended = draw.choice([(256, False), (0x12DD5455, True), (0x18F009FE, True)])
        self.j1939 = self.frame_id == 0x18F009FE
        self.multiplexed = draw.random() < 0.3
        wave = np.sin(np.arange(FRAMES) / 15)
        span = 2 ** (self.length - 3) if self.kind != "float" else 5.0
        self.raw = wave * span if self.kind == "float" else np.round(wave * span)
        self.truth = self.raw * self.scale
        self.gap = np.zeros(FRAMES, dtype=bool)
        self.extra = ""

    def signals(self):
        """The lines of the database."""
        start = 23 if self.big else 16
        letter = "-" if self.kind in ("signed", "float") else "+"
        mark, limits = " m1" if self.multiplexed else "", getattr(self, "limits", "[0|0]")
        place = f"{start}|{self.length}@{int(not self.big)}{letter}"
        frame_id = self.frame_id | self.extended << 31
        lines = [f"BO_ {frame_id} M: 8 A", f' SG_ KIND{" M" if self.multiplexed else ""} : 0|4@1+ (1,0) [0|0] "" A']
        lines.append(f' SG_ S{mark} : {place} ({self.scale!r},{self.offset!r}) {limits} "Nm" A')
        lines.append(' SG_ S_SIGN : 4|1@1+ (1,0) [0|1] "" A' if self.kind == "magnitude" else "")
        lines.append(f"SIG_VALTYPE_ {frame_id} S : 1;" if self.kind == "float" else "")
        return HEAD + "\n".join([*lines, self.extra.format(frame_id)]) + "\n"

    def bits(self, k):
        """The raw value that is sent."""
        if self.gap[k]:
            return self.code
        if self.kind == "float":
            return int(np.float32(self.raw[k]).view(np.uint32))
        if self.kind == "magnitude":
            return int(abs(self.raw[k]))
        return little(int(self.raw[k]) + (2 ** (self.length - 1) if self.kind == "unsigned" else 0), self.length)

    def frame(self, k):
        """The bytes of a frame."""
        negative = self.kind == "magnitude" and self.raw[k] < 0
        number = int(self.multiplexed) | negative << 4
        order = "big" if self.big else "little"
        size = -(-self.length // 8)
        bits = self.bits(k) << (8 * size - self.length if self.big else 0)
        return bytes([number, 0xAA]) + bits.to_bytes(size, order) + bytes(6 - size)

    def with_codes(self):
        """Some frames hold a code: a name of the database, a value beyond the range, or what J1939 has for it."""
        if self.kind == "float":
            return
        first = self.draw.randint(40, 160)
        self.gap[first : first + self.draw.randint(1, 20)] = True
        top = 2 ** (self.length - int(self.kind == "signed")) - 1
        self.code = top
        most = self.offset + self.scale * 0.9 * top
        if self.j1939 and self.kind != "signed":
            pass
        elif self.draw.random() < 0.5:
            name = self.draw.choice(["Invalid", "SNA", "Signal_not_available", "Error", "Fehler", "Last"])
            self.extra = f'VAL_ {{}} S {top} "{name}" 0 "Straight" ;'
        else:
            self.limits = f"[{-most!r}|{most!r}]"
        self.said.add("no_value")

    def stamped(self):
        """The time stamps, as a logger writes them."""
        case = self.draw.choice(["each", "each", "doubled", "batches"])
        if case == "doubled":
            self.lost = self.draw.randint(30, 200)
            self.stamps[self.lost] = self.stamps[self.lost + 1]
            self.said.add("doubled_stamps")
        elif case == "batches":
            self.said.add("batches")
            return [np.ceil(round(stamp / 0.05, 6)) * 0.05 for stamp in self.stamps]
        return self.stamps

    def write(self, folder):
        if self.draw.random() < 0.4:
            self.with_codes()
        stamps = self.stamped()
        sent = self.frame_id
        if self.j1939 and self.draw.random() < 0.5:
            sent = self.frame_id ^ 0xF5
            self.said.add("comes from the source address 0x0B")
        short = self.draw.random() < 0.3
        signed = self.kind == "magnitude"
        if signed:
            self.keys["sign_from"] = "M.S_SIGN"
        lines = []
        for k, stamp in enumerate(stamps):
            name = f"{sent:08X}" if self.extended else f"{sent:03X}"
            data = self.frame(k)[: 2 + -(-self.length // 8) if short else 8].hex().upper()
            lines.append(f"({1e9 + stamp:.6f}) can0 {name}#{data}")
            if self.multiplexed and k % 3 == 0:
                lines.append(f"({1e9 + stamp:.6f}) can0 {name}#{'00' * (len(data) // 2)}")
        log, dbc = folder / "drive.log", folder / "car.dbc"
        log.write_text("\n".join(lines) + "\n" * self.draw.randint(0, 1))
        dbc.write_text(self.signals())
        return log, dbc


@needs("can", "cantools")
def test_random_logs_are_read_as_they_were_made(tmp_path):
    """Values lie on the lines between the true ones, gaps are where codes are, and all that is unusual is told."""
    kinds = set()
    for seed in range(200):
        pair = Pair(seed)
        log, dbc = pair.write(tmp_path)
        mapping = Mapping({"handwheel_torque": entry("handwheel_torque", pair.keys)})
        found = read(log, mapping, can=can_log.Options(dbc))
        left_out = [key for key in ("no_value", "doubled_stamps") if key in found.meta]
        notes = " ".join([*found.meta["can"].get("notes", ()), *left_out])
        message = f"seed {seed}: {pair.kind}, {pair.said}, {notes}"
        assert all(part in notes for part in pair.said), message
        assert bool(notes) == bool(pair.said), message
        kinds |= {pair.kind, *pair.said}
        values = found["handwheel_torque"]
        late = pair.period if "batches" in pair.said else 0.0  # of all frames alike
        truth = np.where(pair.gap, np.nan, pair.truth)
        time = np.array([k * pair.period for k in range(FRAMES)])
        steepest = np.nanmax(np.abs(np.diff(pair.truth))) / pair.period
        expected = np.interp(found.time + late, time, truth)
        inside = ~np.isnan(expected) & ~np.isnan(values)
        moved = 1.01 * pair.period if pair.said & {"batches", "doubled_stamps"} else 1e-5
        assert np.abs(values - expected)[inside].max() <= moved * steepest + 1.01 * pair.scale * 0.01, message
        lost = np.count_nonzero(np.isnan(values)) - np.count_nonzero(np.isnan(expected))
        assert abs(lost) <= 2 + 2 * ("batches" in pair.said), message
    assert len(kinds) == 8
