"""Damage of recorded and received bytes, for tests of what reads them."""

from __future__ import annotations

from hypothesis import strategies as st


def damaged(content: bytes, data: st.DataObject, *, times: int, inserted: int, cut: int) -> bytes:
    """``content`` with bits flipped, bytes ``inserted`` or ``cut`` (at most so many at once), at some places.

    There are 1 to ``times`` places.
    """
    broken = bytearray(content)
    for _ in range(data.draw(st.integers(1, times))):
        at = data.draw(st.integers(0, len(broken)))
        action = data.draw(st.sampled_from(["flip", "cut", "insert"]))
        if action == "insert":
            broken[at:at] = data.draw(st.binary(max_size=inserted))
        elif at < len(broken):
            if action == "flip":
                broken[at] ^= data.draw(st.integers(1, 255))
            else:
                del broken[at : at + data.draw(st.integers(1, cut))]
    return bytes(broken)
