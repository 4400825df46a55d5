"""Values that fit the fields of messages exactly, so that what comes back is equal."""

from __future__ import annotations

import math

from hypothesis import strategies as st

from mavlink_bridge import messages as m


def unsigned(bits: int) -> st.SearchStrategy[int]:
    return st.integers(0, 2**bits - 1)


def signed(bits: int) -> st.SearchStrategy[int]:
    return st.integers(-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)


def scaled(integers: st.SearchStrategy[int], factor: float) -> st.SearchStrategy[float]:
    return integers.map(lambda value: value / factor)


def vector(of: st.SearchStrategy[float]) -> st.SearchStrategy[tuple[float, ...]]:
    return st.tuples(of, of, of)


f32 = st.floats(width=32, allow_nan=False, allow_infinity=False)
four = st.tuples(f32, f32, f32, f32)
u8, u16, u32, u64 = unsigned(8), unsigned(16), unsigned(32), unsigned(64)
source = st.builds(m.Source, u8, u8)
boot = u32.map(lambda ms: ms * 1000)
latitude = scaled(st.integers(-900_000_000, 900_000_000), 1e7)
longitude = scaled(st.integers(-1_800_000_000, 1_800_000_000), 1e7)
millimetres = scaled(signed(32), 1e3)
speed = st.floats(-1e6, 1e6, width=32)
yaw = st.none() | scaled(st.integers(0, 35999), 100).map(
    lambda deg: math.remainder(math.radians(deg), math.tau)
)
text = st.text(st.characters(min_codepoint=32, max_codepoint=126), max_size=50)
