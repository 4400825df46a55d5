"""The page of the view: its title, the system's colours, and cameras that have the scene in the picture."""

from __future__ import annotations

from importlib.resources import files
from math import atan, tan

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from outrider.scene.airframe import HEXAROTOR
from outrider.view import camera, shapes
from outrider.view.bodies import blade_poses
from outrider.view.page_document import live_page, recorded_page

VISER = (files("viser") / "client" / "build" / "index.html").read_text(encoding="utf-8")


def test_the_tab_has_the_name_of_the_scenario() -> None:
    assert "<title>escort · outrider</title>" in live_page(VISER, "escort")
    assert "<title>escort · outrider</title>" in recorded_page(VISER, "escort")
    assert "<title>Viser</title>" not in live_page(VISER, "")
    # Before the first scene the page asks; a name is never a part of the page's program.
    assert 'fetch("title")' in live_page(VISER, "")
    assert 'fetch("title")' not in live_page(VISER, "escort")
    assert "<script>mine" not in live_page(VISER, "<script>mine")


def test_viser_still_has_what_is_changed() -> None:
    """In a version with other names the page would stay light, and cover the scene on a phone."""
    assert VISER.count("<title>Viser</title>") == 1
    source = files("viser") / "client" / "src"
    assert "__VISER_EMBED_CONFIG__" in (source / "App.tsx").read_text(encoding="utf-8")
    panel = (source / "ControlPanel" / "BottomPanel.tsx").read_text(encoding="utf-8")
    assert 'maxHeight: "60%"' in panel
    assert 'width: "20em"' in panel


def test_the_page_follows_the_system() -> None:
    for page in (live_page(VISER, "escort"), recorded_page(VISER, "escort")):
        head = page.partition("</head>")[0]
        assert 'matchMedia("(prefers-color-scheme: dark)")' in head
        assert "__VISER_EMBED_CONFIG__ = { darkMode: system.matches }" in head


@given(st.floats(1.0, 200.0), st.sampled_from([camera.FIELD, camera.TOP_FIELD]), st.floats(0.3, 3.0))
def test_the_scene_is_in_the_picture_and_fills_it(reach: float, field: float, aspect: float) -> None:
    away = camera.distance(reach, field, aspect)
    across = 2.0 * atan(tan(0.5 * field) * aspect)
    share = reach / (away * tan(0.5 * min(field, across)))
    assert 0.9 < share <= 1.0


@given(st.floats(4.0, 200.0), st.floats(0.3, 3.0), st.floats(-1.0, 1.0), st.floats(1.0, 4.0))
def test_from_above_height_hardly_shifts_a_vehicle(
    reach: float, aspect: float, up: float, zoom: float
) -> None:
    """Also in a picture that is enlarged: less than 1 % of the distance from the middle."""
    away = camera.distance(reach, camera.TOP_FIELD, aspect)
    height = reach * up
    assert abs(away / (away - height) - 1.0) <= 2e-3
    assert abs(away / (away - zoom * height) - 1.0) <= 1e-2


@given(st.floats(4.0, 500.0))
def test_the_first_labelled_line_of_the_ground_is_in_the_scene(reach: float) -> None:
    cell, section = shapes.ground_lines(reach)
    assert 3.0 * cell <= reach * (1.0 + 1e-9)
    assert 0.1 * reach < section <= reach
    assert section / cell == pytest.approx(round(section / cell))


@pytest.mark.parametrize("time", [0.0, 0.3, 7.0])
def test_rotors_stay_on_their_hubs_and_turn_about_them(time: float) -> None:
    half = 0.4
    attitude = np.array([[np.cos(half), 0.0, 0.0, np.sin(half)]], np.float32)
    hubs = np.array([(x, y, 0.05) for x, y in HEXAROTOR.hubs])
    places, turned = blade_poses(
        np.array([[1.0, 2.0, 3.0]], np.float32), attitude, hubs, np.array(HEXAROTOR.spins), time
    )
    c, s = np.cos(2.0 * half), np.sin(2.0 * half)
    expected = hubs @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]) + (1.0, 2.0, 3.0)
    np.testing.assert_allclose(places, expected, atol=1e-5)
    np.testing.assert_allclose(np.linalg.norm(turned, axis=1), 1.0, atol=1e-6)
    later = blade_poses(
        np.array([[1.0, 2.0, 3.0]], np.float32), attitude, hubs, np.array(HEXAROTOR.spins), time + 0.01
    )
    turns = np.arctan2(later[1][:, 3], later[1][:, 0]) - np.arctan2(turned[:, 3], turned[:, 0])
    assert (np.sign(np.arctan2(np.sin(turns), np.cos(turns))) == HEXAROTOR.spins).all()
