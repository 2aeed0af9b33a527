"""What the browsers of the tests have in common, however they are led."""

import contextlib
import time

PATIENCE = 60.0  # [s]


class PageLeftError(AssertionError):
    """The browser left the page on which an expression was to be found."""


class Browser:
    """A page in a browser of its own, which ends with a ``with`` block. Each kind has ``open``, ``value``, ``key`` and
    ``type``, and collects in ``errors`` what its scripts throw.
    """

    def __enter__(self):
        return self

    def until(self, expression, patience=PATIENCE):
        """Wait until an expression is true, also across a link that is being followed; its value."""
        end = time.monotonic() + patience
        while time.monotonic() < end:
            with contextlib.suppress(PageLeftError):
                found = self.value(expression)
                if found:
                    return found
            time.sleep(0.01)
        raise AssertionError(f"{expression} did not become true in {patience:g} s; {self.errors}")
