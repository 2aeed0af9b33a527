"""The render modes, and how many pictures of a simulated second each gives."""

from collections.abc import Sequence
from typing import Any

MODES = ("rgb_array", "rgb_array_list", "human")  # of a single environment
VECTOR_MODES = ("rgb_array", "rgb_array_list")
THINNED_RATE = 25.0  # pictures of a list or a window in a simulated second, some [1/s]


def checked_mode(mode: Any, modes: Sequence[str]) -> str | None:
    """A ``render_mode``; ValueError if it is none of ``modes``."""
    if mode is not None and mode not in modes:
        raise ValueError(f"render_mode must be None or one of {', '.join(modes)}, got {mode!r}")
    return mode


def steps_per_frame(mode: str | None, control_dt: float) -> int:
    """Control steps from one picture to the next: one, unless a list or a window thins them out."""
    return 1 if mode in (None, "rgb_array") else max(1, round(1.0 / (THINNED_RATE * control_dt)))


def frame_rate(mode: str | None, control_dt: float) -> float:
    """Pictures in a simulated second [1/s]; shown at this rate they make a video in real time."""
    return round(1.0 / (steps_per_frame(mode, control_dt) * control_dt), 6)
