"""What tests of recorded files share."""

import numpy as np
import pytest

from steer_env.recording import channel_mapping
from steer_env.recording.files import read
from steer_env.recording.recording import Recording

UNITS = {"handwheel_angle": "rad", "handwheel_torque": "N m", "lateral_acceleration": "m/s2", "yaw_rate": "rad/s"}


def made_weave():
    """A weave whose torque and yaw rate lead and lag, so that there are metrics to read."""
    time = np.arange(5001) / 100
    phase = 2 * np.pi * 0.2 * time
    values = 0.3 * np.sin(phase), 3 * np.sin(phase + 0.2), 2 * np.sin(phase - 0.2), np.sin(phase - 0.1) / 10
    return Recording(time, dict(zip(UNITS, values)), UNITS)


def mapped(*entries, **meta):
    """A mapping from compact entries."""
    return channel_mapping.Mapping(meta=meta).with_entries(channel_mapping.parse_entry(text) for text in entries)


def refusal(path, given=None, **more):
    """The text with which a file is refused, which names it."""
    with pytest.raises(ValueError, match=path.name) as caught:
        read(path, given, **more)
    return str(caught.value)
