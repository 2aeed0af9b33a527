"""What a server does with a packet: a session with one client, and the answer to each request.

The kernels know no sockets: :mod:`steer_env.connect.udp.server` receives and sends. A request is carried out once. The
same request again, as a client sends it that did not get the answer, gets the same answer again, to the byte.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.connect.udp.packets import (
    BAD_KIND,
    BAD_LAYOUT,
    BAD_PARAMETER,
    BAD_SAMPLES,
    BAD_SEQUENCE,
    BAD_VALUE,
    BAD_VERSION,
    BUSY,
    CLOSE,
    CLOSED,
    DIVERGED,
    FREE_RUNNING,
    HEADER,
    HEADER_SIZE,
    LARGEST,
    MAGIC,
    MODES,
    MOST_SAMPLES,
    NO_SESSION,
    OPEN,
    OPENED,
    REFUSED,
    REUSED,
    STEP,
    STEPPED,
    TUNE,
    TUNED,
    USED,
    VERSION,
    Layout,
    checksum,
)
from steer_env.friction.numerics.kernel import kernel
from steer_env.live.real_time.loop import NEVER
from steer_env.live.real_time.model import implausible, restart, step
from steer_env.vehicle.steering.eps import SAMPLE_TIME

# What is counted, and what it means.
COUNTS = {
    "received": "datagrams that arrived",
    "sessions": "sessions opened",
    "steps": "steps carried out",
    "samples": "milliseconds simulated",
    "lost": "requests that never came, in free running",
    "repeated": "requests that were answered before and got the same answer again",
    "late": "requests older than the last one, left unanswered",
    "truncated": "datagrams of another size than they tell, left unanswered",
    "foreign": "datagrams that do not begin as a packet does, left unanswered",
    "damaged": "packets whose checksum does not fit, left unanswered",
    "refused": "requests that were refused with a reason",
    "silent": "sessions that ended because the client was silent",
    "unsent": "answers that the operating system did not take",
}
(
    RECEIVED_COUNT,
    SESSION_COUNT,
    STEP_COUNT,
    SAMPLE_COUNT,
    LOST_COUNT,
    REPEATED_COUNT,
    LATE_COUNT,
    TRUNCATED_COUNT,
    FOREIGN_COUNT,
    DAMAGED_COUNT,
    REFUSAL_COUNT,
    SILENT_COUNT,
    UNSENT_COUNT,
) = range(len(COUNTS))

# What becomes of a packet.
NOTHING, ANSWER, REFUSAL, WELCOME = range(4)  # WELCOME: an answer to a client that the session begins with

_CYCLE = 2**32  # of sequence numbers
_SECOND = 1_000_000_000  # [ns]

STATE = np.dtype(
    [
        ("session", "u8"),  # number of the last session
        ("sequence", "u4"),  # of the last request that was carried out
        ("check", "u4"),  # and its checksum
        ("open", "i8"),  # whether the session is open
        ("samples", "i8"),  # simulated since it was opened
        ("heard", "i8"),  # time of the client's last packet [ns]
        ("asked", "i8"),  # in free running the time of its last inputs, NEVER before the first [ns]
        ("stamp", "i8"),  # and its own time then [ns]
        ("period", "i8"),  # samples between answers in free running
    ]
)


class Link(NamedTuple):
    """The memory of a server: the last session, buffers for packets and the counts."""

    layout: int  # fingerprint
    mode: int  # of MODES
    silence: int  # of a client, after which its session ends [ns]
    state: Any  # (1,) of STATE
    counts: NDArray[np.int64]  # (N,) in the order of COUNTS
    received: NDArray[np.int64]  # the datagram, with room for LARGEST bytes
    request: Any  # (1,) of HEADER, its header
    given: NDArray[np.float64]  # (G,) its inputs
    sent: NDArray[np.int64]  # the last answer, kept for the same request
    answer: Any  # (1,) of HEADER, its header
    shown: NDArray[np.float64]  # (C,) its outputs
    refused: NDArray[np.int64]  # a refusal
    refusal: Any  # (1,) of HEADER, the same
    numbers: NDArray[np.float64]  # (N,) of the subsystem, among which are the parameters
    begun: NDArray[np.float64]  # (N,) the same at the begin of a session
    places: NDArray[np.int64]  # (P,) of the parameters among them
    low: NDArray[np.float64]  # (P,) least value of each
    high: NDArray[np.float64]  # (P,) largest value of each


SILENCE = 10.0  # of a client, after which its session ends [s]; assumed


def make_session_memory(
    layout: Layout, mode: str = "lockstep", numbers: NDArray[np.float64] | None = None, silence: float = SILENCE
) -> Link:
    """The memory of a server in a mode of ``MODES``, before its first session; ``silence`` [s] of a client ends one.

    ``numbers`` (N,) are those of a ``steer_env.vehicle.subsystems.machine_code.Tunable``, which "tune" changes; without
    them there are no parameters.
    """
    parameters = () if numbers is None else layout.parameters
    numbers = np.zeros(0) if numbers is None else numbers
    received = np.zeros(LARGEST // 8)
    sent, refused = np.zeros(layout.answer_size // 8), np.zeros(HEADER_SIZE // 8)
    (request, given), (answer, shown), (refusal, _) = (_split_packet(packet) for packet in (received, sent, refused))
    return Link(
        layout=layout.fingerprint,
        mode=MODES[mode],
        silence=int(_SECOND * silence),
        state=np.zeros(1, STATE).view(np.recarray),
        counts=np.zeros(len(COUNTS), np.int64),
        received=received.view(np.int64),
        request=request,
        given=given[: len(layout.inputs)],
        sent=sent.view(np.int64),
        answer=answer,
        shown=shown,
        refused=refused.view(np.int64),
        refusal=refusal,
        numbers=numbers,
        begun=numbers.copy(),
        places=np.array([each.place for each in parameters], np.int64),
        low=np.array([each.low for each in parameters]),
        high=np.array([each.high for each in parameters]),
    )


def _split_packet(packet: NDArray[np.float64]) -> tuple[Any, NDArray[np.float64]]:
    """Header and values of a packet, as views."""
    end = HEADER_SIZE // 8
    return packet[:end].view(HEADER).view(np.recarray), packet[end:]


@kernel
def respond(model, link, size, known, now):
    """What becomes of the datagram of ``size`` bytes in ``link.received``.

    Parameters
    ----------
    model : Model
        Advanced where the request asks for it.
    link : Link
        Its ``sent`` or ``refused`` receives the answer.
    size : int
        Of the datagram [byte].
    known : bool
        Whether it comes from the address of the last session's client.
    now : int
        Monotonic clock [ns].

    Returns
    -------
    int
        NOTHING; ANSWER, where ``link.sent`` is to be sent back; WELCOME, where the sender is the client from now on,
        too; or REFUSAL, where ``link.refused`` is to be sent back.
    """
    counts, request, state = link.counts, link.request[0], link.state[0]
    counts[RECEIVED_COUNT] += 1
    if not _whole(link, size):
        return NOTHING
    if request.version != VERSION:
        return _refuse(link, BAD_VERSION, 0, now)
    if request.layout != link.layout or size != HEADER_SIZE + 8 * link.given.size:
        return _refuse(link, BAD_LAYOUT, 0, now)
    same = known and counts[SESSION_COUNT] > 0 and request.session == state.session
    ahead = (int(request.sequence) - int(state.sequence)) % _CYCLE
    if same and ahead == 0:
        if link.mode == FREE_RUNNING and request.kind == STEP:
            counts[REPEATED_COUNT] += 1
            return NOTHING
        if request.check != state.check:
            return _refuse(link, REUSED, 0, now)
        state.heard = now
        counts[REPEATED_COUNT] += 1
        return ANSWER
    if same and ahead > _CYCLE // 2:
        counts[LATE_COUNT] += 1
        return NOTHING
    if request.kind == OPEN:
        return _open(model, link, now)
    if not (same and state.open):
        return _busy(link, now) if state.open else _refuse(link, NO_SESSION, 0, now)
    state.heard = now
    if link.mode != FREE_RUNNING and ahead > 1:
        return _refuse(link, BAD_SEQUENCE, 0, now)
    if request.kind == CLOSE:
        state.open = 0
        return _answer(link, CLOSED, now)
    if request.kind == TUNE:
        return _tune_parameter(link, now)
    if request.kind != STEP:
        return _refuse(link, BAD_KIND, 0, now)
    return _take(model, link, ahead, now) if link.mode == FREE_RUNNING else _step(model, link, now)


@kernel
def _whole(link, size):
    """Whether the datagram is a packet that arrived as it was sent."""
    request, counts = link.request[0], link.counts
    if size < HEADER_SIZE or size % 8 != 0:
        counts[TRUNCATED_COUNT] += 1
        return False
    if request.magic != MAGIC:
        counts[FOREIGN_COUNT] += 1
        return False
    if checksum(link.received, size // 8) != request.check:
        counts[DAMAGED_COUNT if size == HEADER_SIZE + 8 * link.given.size else TRUNCATED_COUNT] += 1
        return False
    return True


@kernel
def _open(model, link, now):
    """Begin a session, unless another is open."""
    request, state = link.request[0], link.state[0]
    if state.open:
        return _busy(link, now)
    if link.counts[SESSION_COUNT] > 0 and request.session == state.session:
        return _refuse(link, USED, 0, now)
    if link.mode == FREE_RUNNING and request.samples > MOST_SAMPLES:
        return _refuse(link, BAD_SAMPLES, 0, now)
    restart(model)
    for i in range(link.numbers.size):
        link.numbers[i] = link.begun[i]
    state.session, state.open, state.samples, state.heard = request.session, 1, 0, now
    state.asked, state.period = NEVER, max(int(request.samples), 1)
    link.counts[SESSION_COUNT] += 1
    _show(model, link)
    _answer(link, OPENED, now)
    return WELCOME


@kernel
def _tune_parameter(link, now):
    """Give a parameter the value of the request."""
    parameter, value = int(link.request[0].samples), link.given[0]
    if parameter >= link.places.size:
        return _refuse(link, BAD_PARAMETER, parameter, now)
    if not (link.low[parameter] <= value <= link.high[parameter] and abs(value) < math.inf):
        return _refuse(link, BAD_PARAMETER, parameter, now)
    link.numbers[link.places[parameter]] = value
    return _answer(link, TUNED, now)


@kernel
def _take(model, link, ahead, now):
    """Take the inputs of the request, which act from the next sample on; the answers follow at their own times."""
    request, state = link.request[0], link.state[0]
    bad = implausible(model, link.given)
    if bad >= 0:
        return _refuse(link, BAD_VALUE, bad, now)
    for i in range(link.given.size):
        model.wanted[i] = link.given[i]
    state.sequence, state.check = request.sequence, request.check
    state.asked, state.stamp = now, request.sent
    link.counts[STEP_COUNT] += 1
    link.counts[LOST_COUNT] += ahead - 1
    return NOTHING


@kernel
def report(model, link, s, torque, now):
    """Make the answer of a sample in free running, once inputs have arrived; whether one is due.

    ``s`` is the memory of the watchdog and ``torque`` that of the motor [N m].
    """
    state, answer = link.state[0], link.answer[0]
    if not state.open:
        return False
    state.samples += 1
    link.counts[SAMPLE_COUNT] += 1
    if state.asked == NEVER or state.samples % state.period != 0:
        return False
    _show(model, link)
    answer.kind, answer.sequence, answer.echo = STEPPED, state.sequence, state.stamp
    answer.time = state.samples * SAMPLE_TIME
    answer.code, answer.torque, answer.gain = s.phase, torque, s.gain
    _finish(answer, link.sent, now)
    return True


@kernel
def _step(model, link, now):
    """Carry out a step with the inputs of the request."""
    request, state = link.request[0], link.state[0]
    samples = int(request.samples)
    if samples < 1 or samples > MOST_SAMPLES:
        return _refuse(link, BAD_SAMPLES, 0, now)
    bad = implausible(model, link.given)
    if bad >= 0:
        return _refuse(link, BAD_VALUE, bad, now)
    for i in range(link.given.size):
        model.given[i] = link.given[i]
    if not step(model, samples):
        return _refuse(link, DIVERGED, 0, now)
    state.samples += samples
    link.counts[STEP_COUNT] += 1
    link.counts[SAMPLE_COUNT] += samples
    _show(model, link)
    return _answer(link, STEPPED, now)


@kernel
def _show(model, link):
    for i in range(link.shown.size):
        link.shown[i] = model.outputs[0, i]


@kernel
def _answer(link, kind, now):
    """Make the answer to a request that was carried out, and keep it for the same request."""
    request, state, answer = link.request[0], link.state[0], link.answer[0]
    state.sequence, state.check = request.sequence, request.check
    _address(link, answer, kind)
    answer.samples = request.samples
    answer.code = link.mode if kind == OPENED else 0
    answer.torque, answer.gain = 0.0, 0.0
    _finish(answer, link.sent, now)
    return ANSWER


@kernel
def _refuse(link, reason, detail, now):
    """Make a refusal; nothing else changes."""
    refusal = link.refusal[0]
    link.counts[REFUSAL_COUNT] += 1
    _address(link, refusal, REFUSED)
    refusal.code, refusal.detail = reason, detail
    _finish(refusal, link.refused, now)
    return REFUSAL


@kernel
def _busy(link, now):
    """Refuse because of the open session, with the time after which it ends if its client stays silent, rounded up."""
    return _refuse(link, BUSY, max(-((now - link.state[0].heard - link.silence) // _SECOND), 1), now)


@kernel
def _address(link, header, kind):
    """Fill what an answer or refusal has of its request, and of the session."""
    request = link.request[0]
    header.magic, header.version, header.kind, header.layout = MAGIC, VERSION, kind, link.layout
    header.session, header.sequence, header.echo = request.session, request.sequence, request.sent
    header.time = link.state[0].samples * SAMPLE_TIME


@kernel
def _finish(header, packet, now):
    """Stamp a packet with the time and its checksum."""
    header.sent = now
    header.check = checksum(packet, packet.size)


@kernel
def end_where_silent(link, now):
    """End the session of a client from which nothing was heard for too long; whether a session is open."""
    state = link.state[0]
    if state.open and now - state.heard > link.silence:
        state.open = 0
        link.counts[SILENT_COUNT] += 1
    return state.open != 0
