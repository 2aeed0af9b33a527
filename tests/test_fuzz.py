"""Damaged files of every kind are read or refused in a sentence, a thousand of them."""

import subprocess
import sys
from pathlib import Path

import pytest

HARNESS = Path(__file__).parent / "tools" / "fuzz.py"


@pytest.mark.whole
def test_damaged_files_are_read_or_refused():
    done = subprocess.run([sys.executable, HARNESS, "--cases", "1000", "--seed", "0"], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
