"""Messages of the library in the words of the command line."""

import re

KPH = 3.6  # [km/h] of 1 m/s
_NUMBER = r"(\d[\d.e+-]*\d|\d)"
_SPEED = re.compile(rf"\bspeed \[m/s\]( must be [^;:]*, got -?{_NUMBER})")
_LONGEST = 1500  # message [characters]
# What a message says to people who write Python -> what it says at the command line.
_OPTION_WORDS = (
    (rf"\bfrequency_hz={_NUMBER}", r"--frequency-hz \1"),
    (r"\bbetween\(t0, t1\)", "--between T0 T1"),
    (rf"\bbetween\({_NUMBER}, {_NUMBER}\)", r"--between \1 \2"),
    (r"\bwithout\('([^']*)'\)", r"--without \1"),
    (r"\blongest=", ""),
    (r" raise longest, (?:or )?", " "),
    (r"; call bridged\(\) if rows are missing, else resampled\(rate\)", ": resample the file to a uniform rate before"),
    (r"\bclose gaps with bridged\(\), or leave", "leave"),
)


def in_options(text: str) -> str:
    """A message with options in place of the keywords and methods of Python.

    >>> in_options("say that the test was at 80 km/h (speed_m_s=22.22)")
    'say that the test was at 80 km/h (--speed-kph 79.99)'
    >>> in_options("speed [m/s] must be finite and at least 0 and at most 70, got 250.0")
    'speed [km/h] must be finite and at least 0 and at most 252, got 900'
    """
    if found := _SPEED.search(text):
        inside = re.sub(_NUMBER, lambda each: f"{KPH * float(each[1]):.6g}", found[1])
        text = f"{text[: found.start()]}speed [km/h]{inside}{text[found.end() :]}"
    text = re.sub(rf"\bspeed_m_s={_NUMBER}", lambda found: f"--speed-kph {KPH * float(found[1]):.4g}", text)
    for words, options in _OPTION_WORDS:
        text = re.sub(words, options, text)
    return text


def shorten(text: str) -> str:
    """A message in one line without the middle of what is too long to read, such as a damaged value of a file."""
    text = " ".join(text.splitlines())
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST // 2]} [...] {text[-_LONGEST // 2 :]}"
