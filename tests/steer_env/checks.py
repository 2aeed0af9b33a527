"""What the exact checks of metrics share: every answer is found, recordings are alike, what is refused, a gap."""

import numpy as np
import pytest

from steer_env import metrics
from tests.synthetic.recordings import changed


def check(clean, answers, tolerance, without=()):
    """Every metric of the test is answered within a relative tolerance (one a name, or "rest"), but those ``without``.

    An answer that is text is part of the reason for which the metric is refused.
    """
    found = metrics.evaluate(clean)
    assert found.keys() - set(without) == answers.keys()
    for name, answer in answers.items():
        value = found[name]
        if isinstance(answer, str):
            assert answer in value.reason, name
            continue
        assert (value.reason, value.unit) == ("", metrics.definition(name).unit), name
        allowed = tolerance.get(name, tolerance["rest"])
        assert value.value == pytest.approx(answer, rel=allowed, abs=allowed * 1e-2), name
    return found


def refusals(clean, test=None, **given):
    """Reasons by name."""
    return {name: value.reason for name, value in metrics.evaluate(clean, test, **given).items() if value.reason}


def check_refused(bad, reason, test=None, **given):
    """Every metric of the test is refused for this reason."""
    found = refusals(bad, test, **given)
    assert found.keys() == set(metrics.available(test or bad.meta["manoeuvre"])), reason
    assert all(reason in text for text in found.values()), (reason, found)


def check_alike(one, other, test=None, **allowed):
    """Both recordings have the same metrics, within a tolerance of :func:`pytest.approx`."""
    found = metrics.evaluate(other, test)
    for name, value in metrics.evaluate(one, test).items():
        assert found[name].value == pytest.approx(value.value, **allowed), name


def burst(clean, name):
    """The recording with a gap in one channel."""
    values = clean[name].copy()
    values[values.size // 2 : values.size // 2 + 5] = np.nan
    return changed(clean, **{name: values})
