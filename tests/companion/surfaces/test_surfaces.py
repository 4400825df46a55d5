"""Destination surfaces: the nearest point is on the surface, is the nearest, and turns with the vehicle."""

from __future__ import annotations

import importlib.metadata as metadata

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from pydantic import ValidationError

from companion.config import CompanionConfig
from companion.errors import SurfaceError
from companion.surfaces import Circle, Cylinder, Ellipsoid, Parametric, Sphere, parametric
from tests.companion.rig import LAWS, numbers, vectors

RADIUS = numbers(0.5, 20.0)
HEIGHT = numbers(-5.0, 20.0)


def spheres():
    return st.builds(
        lambda r, h, share: Sphere(kind="sphere", radius=r, height=h, lowest=h - r + 1.9 * r * share),
        RADIUS,
        HEIGHT,
        numbers(0.0, 1.0),
    )


def cylinders():
    return st.builds(
        lambda r, low, tall: Cylinder(kind="cylinder", radius=r, low=low, high=low + tall),
        RADIUS,
        HEIGHT,
        numbers(0.1, 10.0),
    )


AXIS = numbers(0.3, 10.0)
SURFACES = st.one_of(
    st.builds(lambda r, h: Circle(radius=r, height=h), RADIUS, HEIGHT),
    spheres(),
    cylinders(),
    st.builds(lambda *e: Ellipsoid(kind="ellipsoid", semi_axes=e, height=6.0), AXIS, AXIS, AXIS),
)


def is_on(surface, point):
    """How far a point (3,) is from satisfying the surface's own equation."""
    flat = np.hypot(*point[:2])
    if isinstance(surface, Circle):
        return max(abs(flat - surface.radius), abs(point[2] - surface.height))
    if isinstance(surface, Sphere):
        away = np.linalg.norm(point - [0.0, 0.0, surface.height])
        return max(abs(away - surface.radius), surface.lowest - point[2])
    if isinstance(surface, Cylinder):
        return max(abs(flat - surface.radius), surface.low - point[2], point[2] - surface.high)
    share = (point - [0.0, 0.0, surface.height]) / np.array(surface.semi_axes)
    return abs(float(share @ share) - 1.0)


def samples(surface, seed):
    """Points (n, 3) of the surface, found without ``nearest``."""
    random = np.random.default_rng(seed)
    turn, rise = random.uniform(0, 2 * np.pi, 400), random.uniform(-1, 1, 400)
    ring = np.column_stack([np.cos(turn), np.sin(turn)])
    if isinstance(surface, Circle):
        return np.column_stack([surface.radius * ring, np.full(400, surface.height)])
    if isinstance(surface, Cylinder):
        middle, half = 0.5 * (surface.low + surface.high), 0.5 * (surface.high - surface.low)
        return np.column_stack([surface.radius * ring, middle + half * rise])
    ball = np.column_stack([np.sqrt(1 - rise**2)[:, None] * ring, rise])
    if isinstance(surface, Sphere):
        points = surface.radius * ball + [0.0, 0.0, surface.height]
        return points[points[:, 2] >= surface.lowest]
    return ball * surface.semi_axes + [0.0, 0.0, surface.height]


@LAWS
@given(surface=SURFACES, offset=vectors(40.0))
def test_the_nearest_point_is_on_the_surface(surface, offset):
    assert is_on(surface, surface.nearest(offset)) < 1e-6


@LAWS
@given(surface=SURFACES, offset=vectors(40.0), seed=st.integers(0, 2**32 - 1))
def test_no_point_of_the_surface_is_nearer(surface, offset, seed):
    least = np.linalg.norm(samples(surface, seed) - offset, axis=1).min(initial=np.inf)
    assert np.linalg.norm(surface.nearest(offset) - offset) <= least + 1e-6


@LAWS
@given(surface=SURFACES, offset=vectors(40.0))
def test_a_point_of_the_surface_is_its_own_nearest(surface, offset):
    there = surface.nearest(offset)
    assert_allclose(surface.nearest(there), there, atol=1e-5)


@LAWS
@given(surface=SURFACES, offset=vectors(40.0), turn=numbers(-np.pi, np.pi))
def test_turning_about_the_vertical_turns_the_destination(surface, offset, turn):
    assume(not isinstance(surface, Ellipsoid) and np.hypot(*offset[:2]) > 1e-3)
    c, s = np.cos(turn), np.sin(turn)
    R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    assert_allclose(surface.nearest(R @ offset), R @ surface.nearest(offset), atol=1e-6)


@LAWS
@given(surface=SURFACES, seed=st.integers(0, 2**32 - 1))
def test_many_at_once_are_each_alone(surface, seed):
    offsets = np.random.default_rng(seed).uniform(-20, 20, (2, 3, 3))
    together = surface.nearest(offsets)
    for index in np.ndindex(2, 3):
        assert_allclose(together[index], surface.nearest(offsets[index]), atol=1e-12)


@LAWS
@given(surface=SURFACES)
def test_what_is_drawn_is_on_the_surface(surface):
    assert max(is_on(surface, point) for point in surface.outline()) < 1e-9


def test_the_paper_is_the_default():
    config = CompanionConfig.model_validate({"surface": {"radius": 4.0, "height": 5.0}})
    assert config.surface == Circle() == CompanionConfig().surface
    assert_allclose(config.surface.nearest(np.array([-16.0, 0.0, 5.0])), [-4.0, 0.0, 5.0], atol=1e-12)


def test_a_vehicle_may_have_its_own():
    own = {"vehicle": 12, "surface": {"kind": "cylinder", "radius": 6.0}}
    config = CompanionConfig.model_validate({"surfaces": [own]})
    assert config.surface_of(11) == Circle()
    assert config.surface_of(12) == Cylinder(kind="cylinder", radius=6.0)


# A user's own


def saddle(u, v, size=5.0):
    """A saddle above the target: x and y from −size to size."""
    x, y = size * (2 * u - 1), size * (2 * v - 1)
    return np.column_stack([x, y, 6.0 + 0.05 * (x * x - y * y)])


def fails(u, v):
    raise RuntimeError("no such shape")


def holes(u, v):
    return np.column_stack([u, v, np.where(u > 0.9, np.nan, 1.0)])


def flat(u, v):
    return np.zeros(len(u))


class Offered:
    """Entry points as a package beside ours would offer them."""

    def __init__(self, functions):
        self._functions = functions
        self.names = set(functions)

    def __getitem__(self, name):
        return metadata.EntryPoint(name, f"{__name__}:{self._functions[name]}", parametric.GROUP)


@pytest.fixture
def offered(monkeypatch):
    names = {name: name for name in ("saddle", "fails", "holes", "flat")} | {"gone": "no_such_name"}
    monkeypatch.setattr(parametric, "entry_points", lambda group: Offered(names))
    caches = parametric._function, parametric._grid
    for cached in caches:
        cached.cache_clear()
    yield
    for cached in caches:
        cached.cache_clear()


@pytest.mark.usefixtures("offered")
def test_a_users_surface_is_found_by_its_entry_point():
    surface = Parametric(kind="parametric", function="saddle", parameters={"size": 6.0})
    random = np.random.default_rng(3)
    for offset in random.uniform([-5.0, -5.0, 1.0], [5.0, 5.0, 11.0], (20, 3)):
        there = surface.nearest(offset)
        assert there[2] == pytest.approx(6.0 + 0.05 * (there[0] ** 2 - there[1] ** 2), abs=1e-9)
        others = saddle(*random.uniform(0, 1, (2, 4000)), size=6.0)
        assert np.linalg.norm(there - offset) <= np.linalg.norm(others - offset, axis=1).min() + 1e-6
    assert surface.outline().shape[1] == 3


@pytest.mark.usefixtures("offered")
@pytest.mark.parametrize(
    ("function", "words"),
    [
        ("nobody", "allowed: fails, flat, gone, holes, saddle"),
        ("os:system", "no entry point"),
        ("gone", "cannot be loaded"),
        ("fails", "RuntimeError: no such shape"),
        ("holes", "not finite"),
        ("flat", "allowed is"),
    ],
)
def test_a_users_surface_that_cannot_be_used_is_refused_with_its_name(function, words):
    with pytest.raises(ValidationError, match=words) as told:
        Parametric(kind="parametric", function=function)
    assert function in str(told.value)


@pytest.mark.usefixtures("offered")
def test_a_users_surface_that_fails_later_says_so(monkeypatch):
    surface = Parametric(kind="parametric", function="saddle")
    surface.nearest(np.zeros(3))
    monkeypatch.setattr(parametric, "_function", lambda name: fails)
    with pytest.raises(SurfaceError, match="no such shape"):
        surface.nearest(np.zeros(3))
