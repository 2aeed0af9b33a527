"""Old names answer with the new thing and a warning at the line that used them."""

import math

import pytest

from steer_env.friction.numerics.renamed import renamed


def test_an_old_name_warns_at_the_caller_and_gives_the_new_thing():
    lookup = renamed("somewhere", {"old": "math:pi", "gone": "math"}, known=None)
    with pytest.warns(DeprecationWarning, match=r"somewhere\.old is now math\.pi; release 1\.0") as caught:
        assert lookup("old") is math.pi
    assert caught[0].filename == __file__
    with pytest.warns(DeprecationWarning, match="is now math;"):
        assert lookup("gone") is math


def test_other_names_go_on_to_the_module():
    lookup = renamed("somewhere", {}, known={"name": 1}.__getitem__)
    assert lookup("name") == 1
    with pytest.raises(AttributeError, match="no attribute 'never'"):
        renamed("somewhere", {})("never")
