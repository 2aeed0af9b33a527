"""What wheels with a constant force of finite length have in common."""

import time

from steer_env.friction.numerics.check import flag, number
from steer_env.live.devices.common.commands import BUTTONS, parse_buttons
from steer_env.live.devices.common.device import Clock, Device

FULL_LEVEL = 0x7FFF  # largest level of a constant force
_REFRESHES = 4  # of a force within its length
_LONG_AGO = 10**12  # [ns]


class ForceWheel(Device):
    """A wheel whose motor plays one effect, a constant force that ends by itself where it is not played again.

    Parameters
    ----------
    degrees : float
        From lock to lock, as the wheel's driver is set [deg].
    force : bool
        Whether its motor gets the torque.
    timeout_ms : float
        Length of the force, after which the motor stops where nobody refreshes it [ms].
    gain : float
        Of the wheel's forces [%].
    buttons : str
        As of :func:`steer_env.live.devices.common.commands.parse_buttons`.
    max_torque, reverse, clock
        As of :class:`Device`.
    """

    def __init__(
        self,
        degrees: float,
        force: bool,
        timeout_ms: float,
        gain: float,
        buttons: str = BUTTONS,
        max_torque: float = 2.5,
        reverse: bool = False,
        clock: Clock = time.monotonic_ns,
    ) -> None:
        super().__init__(max_torque, reverse, clock)
        self.motor = flag("force", force)
        self._degrees = number("degrees", degrees, minimum=90.0, maximum=3600.0)
        self._length = round(number("timeout_ms", timeout_ms, minimum=10.0, maximum=1000.0))  # [ms]
        self._gain = number("gain", gain, minimum=0.0, maximum=100.0)
        self._commands = parse_buttons(buttons)

    def _open(self) -> None:
        self._level, self._played = 0, -_LONG_AGO  # of a wheel that is opened anew

    def _push(self, torque: float) -> None:
        """Change the level of the effect where it changes, and play it anew several times within its length."""
        now, level = self.clock(), round(FULL_LEVEL * torque / self.max_torque)
        if level != self._level:
            self._update(level)
            self._level = level
        if now - self._played >= 1e6 * self._length / _REFRESHES:
            self._play()
            self._played = now

    def _update(self, level: int) -> None:
        """Give the effect another level, positive to the left, at most ``FULL_LEVEL``."""
        raise NotImplementedError

    def _play(self) -> None:
        """Let the effect begin anew."""
        raise NotImplementedError
