"""A message that has no value on the wire is refused with its field, or with the reason."""

from __future__ import annotations

from math import nan

import pytest

from mavlink_bridge.errors import EncodeError
from mavlink_bridge.messages import HomePosition, Source
from mavlink_bridge.wire.codec import Codec


def test_a_latitude_that_is_no_number_is_an_encode_error() -> None:
    """The conversion to degE7 fails before anything is packed."""
    values = dict.fromkeys(HomePosition._fields, 1.0)
    message = HomePosition(**{**values, "source": Source(1, 1), "latitude": nan})
    with pytest.raises(EncodeError, match=r"latitude|no value on the wire"):
        Codec().encode(message)
