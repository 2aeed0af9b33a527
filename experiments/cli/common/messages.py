"""Messages of the library in the words of the command line."""

import re

KPH = 3.6  # [km/h] of 1 m/s


def in_options(text: str) -> str:
    """A message with options in place of the keywords of Python functions.

    >>> in_options("say that the test was at 80 km/h (speed_m_s=22.22)")
    'say that the test was at 80 km/h (--speed-kph 79.99)'
    """
    text = re.sub(r"\bspeed_m_s=(\d[\d.e+-]*\d|\d)", lambda found: f"--speed-kph {KPH * float(found[1]):.4g}", text)
    return re.sub(r"\bfrequency_hz=(\d)", r"--frequency-hz \1", text)
