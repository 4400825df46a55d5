"""Colours that can be told apart and read: contrasts by WCAG 2.2, distances with colour blindness."""

from __future__ import annotations

import re
from itertools import combinations

import numpy as np
import pytest

from outrider.palette import (
    BYSTANDER,
    DARK,
    GROUNDS,
    LIGHT,
    LIMIT,
    OBSTACLE,
    TARGET,
    VEHICLES,
    css,
    hex_of,
    rgb,
)
from outrider.report.page import STYLES, static, stylesheet

THEMES = {"light": LIGHT, "dark": DARK}
VIEW_GROUNDS = ("#ffffff", "#141414")
"""Grounds of the view's page, light and dark."""
# Machado, Oliveira, Fernandes 2009, severity 1: protanopia, deuteranopia, tritanopia; linear RGB.
BLIND = {
    "normal": np.eye(3),
    "protan": np.array(
        [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]]
    ),
    "deutan": np.array(
        [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]]
    ),
    "tritan": np.array(
        [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]]
    ),
}


def linear(code: str) -> np.ndarray:
    share = np.array(rgb(code)) / 255.0
    return np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)


def ratio(one: np.ndarray, other: np.ndarray) -> float:
    """Contrast of two linear colours."""
    weights = np.array([0.2126, 0.7152, 0.0722])
    low, high = sorted((float(one @ weights), float(other @ weights)))
    return (high + 0.05) / (low + 0.05)


def contrast(one: str, other: str) -> float:
    return ratio(linear(one), linear(other))


def oklab(colour: np.ndarray) -> np.ndarray:
    """Björn Ottosson, 2020."""
    to_cone = [
        [0.4122214708, 0.5363325363, 0.0514459929],
        [0.2119034982, 0.6806995451, 0.1073969566],
        [0.0883024619, 0.2817188376, 0.6299787005],
    ]
    to_lab = [
        [0.2104542553, 0.7936177850, -0.0040720468],
        [1.9779984951, -2.4285922050, 0.4505937099],
        [0.0259040371, 0.7827717662, -0.8086757660],
    ]
    found: np.ndarray = np.array(to_lab) @ np.cbrt(np.array(to_cone) @ np.clip(colour, 0.0, 1.0))
    return found


def declared(theme: str) -> dict[str, str]:
    """The variables of a page in a theme."""
    return dict(re.findall(r"--([\w-]+): ([^;]+);", css(theme == "dark")))


@pytest.mark.parametrize("theme", THEMES)
def test_every_text_is_readable_on_every_ground(theme: str) -> None:
    found = declared(theme)
    texts = ["ink", "soft", "good", "bad", "accent", *(name for name in found if name.startswith("label-"))]
    assert len(texts) == 5 + len(VEHICLES) + 1
    for text in texts:
        for ground in GROUNDS:
            assert contrast(found[text], found[ground]) >= 4.5, (text, ground)


@pytest.mark.parametrize("theme", THEMES)
def test_numbers_of_the_matrix_are_readable_on_their_shade(theme: str) -> None:
    found = declared(theme)
    shade, paper = (np.array(rgb(code)) for code in (THEMES[theme]["shade"], found["paper"]))
    opacities = [float(x) for x in re.findall(r"\.l\d \{[^}]*var\(--shade\), ([.\d]+)\)", static("page.css"))]
    assert len(opacities) == 7
    for opacity in opacities:
        red, green, blue = np.rint(opacity * shade + (1.0 - opacity) * paper).astype(int).tolist()
        assert contrast(found["ink"], f"#{red:02x}{green:02x}{blue:02x}") >= 4.5, opacity


@pytest.mark.parametrize("mark", [*VEHICLES, TARGET, OBSTACLE, BYSTANDER])
def test_marks_stand_out_from_every_ground(mark: str) -> None:
    grounds = [theme[name] for theme in THEMES.values() for name in GROUNDS]
    for ground in (*grounds, *VIEW_GROUNDS):
        assert contrast(mark, ground) >= 3.0, ground


def test_the_limit_in_a_figure_is_readable() -> None:
    assert contrast(LIMIT, "#ffffff") >= 4.5


@pytest.mark.parametrize("sight", BLIND)
def test_vehicles_are_told_apart_with_every_kind_of_sight(sight: str) -> None:
    seen = [oklab(BLIND[sight] @ linear(code)) for code in (*VEHICLES, TARGET)]
    assert min(float(np.linalg.norm(a - b)) for a, b in combinations(seen, 2)) >= 0.065


def test_colours_are_stated_in_one_place() -> None:
    """No script or style of the report has a colour of its own."""
    for name in (
        *STYLES,
        "data.js",
        "glyphs.js",
        "blocks.js",
        "order.js",
        "scene.js",
        "vehicles.js",
        "charts.js",
        "view.js",
        "sight.js",
    ):
        assert not re.search(r"#[0-9a-f]{6}\b", static(name)), name
    assert all(f"--vehicle-{k}: {code};" in stylesheet() for k, code in enumerate(VEHICLES))


def test_a_bystander_has_the_colour_of_bystanders() -> None:
    assert hex_of(2, tasked=3) == VEHICLES[2]
    assert hex_of(3, tasked=3) == BYSTANDER
    assert hex_of(len(VEHICLES)) == VEHICLES[0]
