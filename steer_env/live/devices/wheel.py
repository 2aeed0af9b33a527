"""A wheel by the joystick axes of SDL, without force."""

import time

from steer_env.friction.numerics.check import number
from steer_env.live.devices.common.commands import BUTTONS
from steer_env.live.devices.common.device import Clock, Reading, register, wheel_angle
from steer_env.live.devices.common.window_input import JoystickInput


class Wheel(JoystickInput):
    """A wheel whose angle is that of the car's handwheel; its motor gets nothing.

    Parameters
    ----------
    degrees : float
        From lock to lock, as the wheel's driver is set [deg].
    steering_axis, throttle_axis, brake_axis : int
        Numbers of the axes from 0, -1 where there is none.
    rest, device, buttons, clock
        As of :class:`JoystickInput`.
    """

    hands = "angle"

    def __init__(
        self,
        degrees: float = 900.0,
        steering_axis: int = 0,
        throttle_axis: int = 2,
        brake_axis: int = 3,
        rest: float = 1.0,
        device: str = "",
        buttons: str = BUTTONS,
        clock: Clock = time.monotonic_ns,
    ) -> None:
        axes = {"steering_axis": steering_axis, "throttle_axis": throttle_axis, "brake_axis": brake_axis}
        super().__init__(device, axes, rest, buttons, clock)
        self._degrees = number("degrees", degrees, minimum=90.0, maximum=3600.0)
        self.about = "the wheel"

    def read(self) -> Reading:
        """The angle now."""
        throttle, brake = self.pedals()
        return self.reading(wheel_angle(self.steering(), -1.0, 1.0, self._degrees), throttle=throttle, brake=brake)


register("wheel", Wheel)
