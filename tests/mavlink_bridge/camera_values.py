"""Any message of a camera or a gimbal, by its type."""

from __future__ import annotations

import math
from typing import Any

from hypothesis import strategies as st

from mavlink_bridge import messages as m
from tests.mavlink_bridge.wire_values import (
    boot,
    f32,
    four,
    latitude,
    longitude,
    scaled,
    signed,
    source,
    speed,
    u8,
    u16,
    u32,
    vector,
)

two = st.tuples(f32, f32)
maybe = st.none() | f32
printable = st.characters(min_codepoint=33, max_codepoint=126)
name, uri = st.text(printable, max_size=32), st.text(printable, max_size=140)
angle = st.floats(0.0, 360.0, width=32).map(math.radians)
# The greatest int32 stands for an unknown altitude.
place = st.none() | st.tuples(latitude, longitude, scaled(signed(32).filter(lambda mm: mm != 2**31 - 1), 1e3))


# Composites, for Hypothesis finds strategies that are spelt out at length too long.
@st.composite
def tracked(draw: st.DrawFn) -> m.CameraTrackingGeo:
    velocity: Any = draw(st.none() | vector(speed))
    known = [draw(maybe) for _ in range(6)]
    return m.CameraTrackingGeo(
        draw(source), draw(u8), draw(latitude), draw(longitude), draw(f32), velocity, *known, draw(u8)
    )


@st.composite
def information(draw: st.DrawFn) -> m.CameraInformation:
    numbers = [draw(one) for one in (u32, maybe, st.none() | two, st.tuples(u16, u16), u32, u8, u8, u16)]
    return m.CameraInformation(
        draw(source), draw(boot), draw(name), draw(name), *numbers, draw(uri), draw(u8)
    )


@st.composite
def views(draw: st.DrawFn) -> m.CameraFovStatus:
    return m.CameraFovStatus(*map(draw, (source, boot, place, place, four, angle, angle, u8)))


@st.composite
def in_image(draw: st.DrawFn) -> m.CameraTrackingImage:
    kinds = (source, u8, u8, u8, st.none() | two, maybe, st.none() | four, u8)
    return m.CameraTrackingImage(*map(draw, kinds))


@st.composite
def gimbals(draw: st.DrawFn) -> m.GimbalAttitude:
    kinds = (source, boot, u16, four, st.none() | vector(f32), u8, u8, u32, maybe, maybe, u8)
    return m.GimbalAttitude(*map(draw, kinds))


CAMERAS: dict[type[m.Message], st.SearchStrategy[Any]] = {
    m.CameraInformation: information(),
    m.CameraFovStatus: views(),
    m.CameraTrackingGeo: tracked(),
    m.CameraTrackingImage: in_image(),
    m.GimbalAttitude: gimbals(),
}
