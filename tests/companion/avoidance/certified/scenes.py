"""Problems of the certified mode, drawn at random: a committed plan among others near it."""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np

from companion.avoidance.certified.committed import carried_on, controls
from companion.avoidance.certified.qp import Objective, SeparationQp, State
from companion.avoidance.certified.separating_planes import AGREED, Others, Planes, agreed_planes, planes
from companion.config.certified import CertifiedConfig
from companion.config.planning import LimitsConfig
from companion.values.horizon import Array, roll_out
from mavlink_bridge.wire.plan import WirePlan
from tests.companion.avoidance.certified.plans import DT, EPOCH, STEPS, later, random_plan

CONFIG = CertifiedConfig(dt_us=DT, epoch_us=DT)
WIDE = LimitsConfig()
NARROW = LimitsConfig(
    u_max=(0.6, 1.2, 0.4), v_max=(0.8, 1.5, 0.5), box_min=(-0.5, -1.0, 4.0), box_max=(0.5, 1.0, 5.5)
)
"""Limits that most of the plans here break in several ways."""


SMOOTH = LimitsConfig(j_max=(2.0, 4.0, 1.0))
"""A bound on jerk that most of the plans here break."""


LOPSIDED = LimitsConfig(
    u_max=(1.0, 2.0, 2.4), u_min=(-1.6, -0.8, -0.8), v_max=(1.2, 0.9, 0.8), v_min=(-0.6, -2.2, -0.5)
)
"""Least values that are not those of the other direction, which most of the plans here break."""


class Scene(NamedTuple):
    """What one vehicle has to solve: ``start`` is its committed plan."""

    limits: LimitsConfig
    start: WirePlan
    state: State
    planes: Planes
    wishes: tuple[Objective, ...]

    def program(self) -> SeparationQp:
        return SeparationQp(STEPS, self.limits, CONFIG)


def scene(seed: int, limits: LimitsConfig = WIDE, *, wishes: int = 1) -> Scene:
    """Up to seven others, some of which share nothing; some plans are nearer than they may be, or collide."""
    rng = np.random.default_rng(seed)
    here = np.array([0.0, 0.0, 5.0])
    start = carried_on(random_plan(rng, here), int(rng.integers(0, 4)))
    count, spread = int(rng.integers(0, 8)), 10.0 ** rng.uniform(-0.3, 0.9)
    others = [later(random_plan(rng, here + spread * rng.normal(size=3))) for _ in range(count)]
    own = controls(start)
    d = rng.uniform(0.3, 2.0)
    agreed = rng.uniform(size=count) < 0.8
    plans = np.array(others).reshape(count, STEPS, 3, 3)
    corridor = planes(own, around(own, plans[agreed], plans[~agreed], d), CONFIG.spare)
    before = rng.uniform(-2, 2, 3)
    state = State(start.position_m, start.velocity_m_s, before, start.accelerations_m_s2)
    return Scene(limits, start, state, corridor, tuple(wish(rng, here) for _ in range(wishes)))


def around(own: Array, agreed: Array, unshared: Array, d: float) -> Others:
    """What a plan from which each other one is to be ``d`` (m) apart keeps to; control points are in m.

    ``own`` (n, 3, 3); plans with which there is an agreement, and those that share nothing, (k, n, 3, 3).
    """
    rows = np.array([agreed_planes(own, other, d) for other in agreed]).reshape(-1, STEPS, AGREED)
    count = len(unshared)
    return Others(np.broadcast_to(own, unshared.shape), unshared, np.full((count, STEPS), d), agreed=rows)


def jam(seed: int) -> Scene:
    """Others all around, as near as they may be or nearer, and flying alike: there is hardly a way, or none
    but the committed one."""
    rng = np.random.default_rng(seed)
    here, d = np.array([0.0, 0.0, 5.0]), 0.9
    start = carried_on(random_plan(rng, here), int(rng.choice([0, STEPS])))
    ways = rng.normal(size=(int(rng.integers(2, 8)), 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    ways = np.concatenate([ways, -ways])
    gap = rng.choice([rng.uniform(0.3, d), d, d + 10.0 ** rng.uniform(-9, -2)])
    own = controls(start)
    apart = around(own, own + gap * ways[:, None, None], np.empty((0, STEPS, 3, 3)), d)
    state = State(start.position_m, start.velocity_m_s, np.zeros(3), start.accelerations_m_s2)
    return Scene(WIDE, start, state, planes(own, apart, CONFIG.spare), (wish(rng, here),))


def wish(rng: np.random.Generator, here: Array) -> Objective:
    """Any place within some metres, at any speed; at rest or followed."""
    places = np.broadcast_to(here + rng.normal(size=3) * 10.0 ** rng.uniform(-1, 1.2), (STEPS, 3))
    velocities = np.broadcast_to(rng.uniform(-3, 3, 3) * rng.integers(0, 2), (STEPS, 3))
    field = rng.normal(size=(STEPS, 3)) * rng.integers(0, 2)
    return Objective(places, velocities, field, moving=bool(rng.integers(0, 2)))


def flown(scene: Scene, accelerations: Array) -> tuple[Array, Array]:
    """Control points (n, 3, 3) m and speeds (n, 3) m/s after each step, by the motion itself."""
    state = scene.state
    knots = roll_out(EPOCH, DT, state.position, state.velocity, accelerations).knots
    positions, velocities = knots[:, 0:3], knots[:, 3:6]
    between = positions[:-1] + 0.5e-6 * DT * velocities[:-1]
    return np.stack([positions[:-1], between, positions[1:]], axis=1), velocities[1:]


def residuals(scene: Scene, wish: Objective, accelerations: Array) -> Array:
    """What the plan with ``accelerations`` (n, 3) costs, as the settings say it, is the sum of their
    squares."""
    points, velocities = flown(scene, accelerations)
    weights, settings = np.full((STEPS, 1), CONFIG.omega_place), CONFIG.following if wish.moving else CONFIG
    in_space = CONFIG.for_flight(planar=False)
    jerk = CONFIG.following.omega_jerk if wish.moving else in_space.omega_jerk
    weights[-1] = CONFIG.omega_end
    # −2 Ω f·x as part of the square: it is the place that is elsewhere.
    moved = CONFIG.omega_field * wish.field / weights
    if wish.moving:
        seconds = 1e-6 * DT * np.arange(STEPS)[:, None]
        weights = CONFIG.following.omega_place * np.exp(-CONFIG.following.decay * seconds)
        weights[-1] += CONFIG.following.omega_end
        moved = CONFIG.omega_field * wish.field / CONFIG.omega_place
    change = np.diff(accelerations, axis=0, prepend=scene.state.before[None])
    parts = (
        np.sqrt(weights) * (points[:, 2] - wish.places - moved),
        sqrt(settings.omega_speed) * (velocities - wish.velocities),
        sqrt(in_space.omega_input) * accelerations,
        sqrt(jerk) * change,
    )
    return np.concatenate([part.ravel() for part in parts])


def cost(scene: Scene, wish: Objective, accelerations: Array) -> float:
    """Of the plan with ``accelerations`` (n, 3)."""
    return float((residuals(scene, wish, accelerations) ** 2).sum())


def widened(scene: Scene) -> Array:
    """How far (k,) each limit may be passed: as far as the committed plan passes it."""
    return np.maximum(beyond(scene, scene.state.committed), 0.0)


def beyond(scene: Scene, accelerations: Array) -> Array:
    """By how much (k,) the plan passes its planes and limits: m, m/s, m/s²."""
    points, speeds = flown(scene, accelerations)
    limits, corridor = scene.limits, scene.planes
    planes = corridor.wanted - np.einsum("mnk,nik->mni", corridor.normals, points)
    return np.concatenate(
        [
            planes.ravel(),
            speeds.ravel() - np.tile(limits.v_max, STEPS),
            np.tile(limits.least_v, STEPS) - speeds.ravel(),
            (limits.box_min - points[:, 1:]).ravel(),
            (points[:, 1:] - limits.box_max).ravel(),
            *_jerks(scene, accelerations),
            accelerations.ravel() - np.tile(limits.u_max, STEPS),
            np.tile(limits.least_u, STEPS) - accelerations.ravel(),
        ]
    )


def _jerks(scene: Scene, accelerations: Array) -> tuple[Array, ...]:
    """By how much (k,) each change of acceleration passes its bound; after its end a plan rests."""
    if scene.limits.j_max is None:
        return ()
    changes = np.diff(accelerations, axis=0, prepend=scene.state.before[None], append=0.0)
    most = 1e-6 * DT * np.array(scene.limits.j_max)
    return ((changes - most).ravel(), (-changes - most).ravel())
