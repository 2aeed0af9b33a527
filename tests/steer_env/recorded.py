"""What tests of recorded files share."""

import pytest

from steer_env.recording import channel_mapping
from steer_env.recording.files import read


def mapped(*entries, **meta):
    """A mapping from compact entries."""
    return channel_mapping.Mapping(meta=meta).with_entries(channel_mapping.parse_entry(text) for text in entries)


def refusal(path, given=None, **more):
    """The text with which a file is refused, which names it."""
    with pytest.raises(ValueError, match=path.name) as caught:
        read(path, given, **more)
    return str(caught.value)
