"""A gamepad: its stick is the wanted angle, to which a virtual arm turns the car's handwheel."""

import math
import time

from steer_env.friction.numerics.bounds import within
from steer_env.friction.numerics.check import number
from steer_env.live.devices.common.commands import BUTTONS
from steer_env.live.devices.common.device import Clock, Reading, register
from steer_env.live.devices.common.window_input import JoystickInput


class Gamepad(JoystickInput):
    """A gamepad of SDL; the defaults are the axes of one for the Xbox under Linux (assumed).

    Parameters
    ----------
    range_deg : float
        Wanted angle at the end of the stick [deg].
    exponent : float
        1 where the angle is proportional to the stick; more makes it finer around the centre [1].
    rate_deg : float
        Largest rate of the wanted angle [deg/s].
    steering_axis, throttle_axis, brake_axis : int
        Numbers of the axes from 0, -1 where there is none.
    rest, device, buttons, clock
        As of :class:`JoystickInput`.
    """

    def __init__(
        self,
        range_deg: float = 180.0,
        exponent: float = 2.0,
        rate_deg: float = 360.0,
        steering_axis: int = 0,
        throttle_axis: int = 5,
        brake_axis: int = 2,
        rest: float = -1.0,
        device: str = "",
        buttons: str = BUTTONS,
        clock: Clock = time.monotonic_ns,
    ) -> None:
        axes = {"steering_axis": steering_axis, "throttle_axis": throttle_axis, "brake_axis": brake_axis}
        super().__init__(device, axes, rest, buttons, clock)
        self._range = math.radians(number("range_deg", range_deg, minimum=1.0, maximum=900.0))
        self._exponent = number("exponent", exponent, minimum=1.0, maximum=5.0)
        self._rate = math.radians(number("rate_deg", rate_deg, minimum=1.0, maximum=5000.0))
        self.about = "the gamepad"

    def read(self) -> Reading:
        """The wanted angle now."""
        throttle, brake = self.pedals()
        stick = -self.steering()
        target = self._range * math.copysign(abs(stick) ** self._exponent, stick)
        most = self._rate * self.elapsed()
        self.wanted += within(target - self.wanted, -most, most)
        return self.reading(self.wanted, throttle=throttle, brake=brake)


register("gamepad", Gamepad)
