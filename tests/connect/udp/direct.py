"""A session without sockets: packets go to the kernel, and what it would send comes back."""

import numpy as np

from steer_env.connect.udp.packets import PACKET_KINDS, layout_of, packed, unpacked
from steer_env.connect.udp.session import COUNTS, NOTHING, REFUSAL, make_session_memory, respond
from steer_env.live.real_time.model import make_model
from steer_env.vehicle import cars, subsystems
from steer_env.vehicle.subsystems.machine_code import tunable


class Direct:
    """The memory of a server of a part, and a client's way to it."""

    def __init__(self, subsystem="steering", mode="lockstep", tuned=False, silence=10.0, **options):
        speed = 20.0
        self.subsystem = subsystems.make(subsystem, cars.load("compact").plant(speed=speed, **options), speed)
        self.layout = layout_of(self.subsystem)
        self.model, self.link = make_model(self.subsystem), make_session_memory(self.layout, mode, silence=silence)
        if tuned:
            made = tunable(self.subsystem)
            self.model = make_model(self.subsystem._replace(parameters=made))
            self.link = make_session_memory(self.layout, mode, made.numbers[0])
        self.inputs = np.array([signal.start for signal in self.subsystem.given])

    def send(self, packet, known=True, now=0):
        """What the server sends back, None for nothing."""
        received = self.link.received.view(np.uint8)
        received[:] = 255  # of an earlier, longer datagram
        received[: len(packet)] = np.frombuffer(packet, np.uint8)
        action = respond(self.model, self.link, len(packet), known, now)
        if action == NOTHING:
            return None
        return (self.link.refused if action == REFUSAL else self.link.sent).tobytes()

    def request(self, kind, sequence, session=7, inputs=None, **fields):
        """The bytes of a request."""
        inputs = self.inputs if inputs is None else inputs
        known = {"layout": self.layout.fingerprint, "samples": 1, "session": session, "sequence": sequence}
        return packed(inputs, kind=PACKET_KINDS[kind], **{**known, **fields})

    def ask(self, kind, sequence, known=True, now=0, **fields):
        """The header of the answer to a request; None for nothing."""
        answer = self.send(self.request(kind, sequence, **fields), known, now)
        return None if answer is None else unpacked(answer)

    def counts(self, *names):
        """Some of the counts."""
        found = dict(zip(COUNTS, self.link.counts.tolist()))
        return {name: found[name] for name in names} if names else found
