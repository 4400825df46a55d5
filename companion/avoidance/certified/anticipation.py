"""Anticipation: turns the goal aside before the planes of other vehicles push a plan back.

Planes push only once rest points are near each other. Vehicles that meet in one place turn aside there, and
stand in each other's way. So encounters are predicted from what changes least, and what a lost or late
message changes least: the goals that vehicles tell each other. All are taken to fly straight to their goals
from where they are, equally fast. Seen from above let two be nearest after a vehicle has flown ℓ, with the
other one at the signed distance m on the side away from the turn, and let D be the least distance of plans
plus ``wide`` · v_max. The encounter has the weight w = 1 − m/D within [0, 1].

A vehicle on the circle gets the room that the one before it leaves once they agree on newer plans. So the
older the plans of agreements are, the wider apart vehicles must be to fly on without a stop: from an age of
two epochs on, D grows by ``wide_late`` times the least distance for each second, up to twice this age.

Vehicles that all turn to one side fly round the place where they meet. K = 1 + Σ w of them have a distance of
about D from each other on a circle of radius K D / 2π. So the goal is turned by atan(``room`` · min(1, Σ w) ·
K D / (2π ℓ)), with the weighted mean of ℓ, and by ``most`` at most. While there is an encounter, the plan
aims no further ahead than v_max flies in ``reach``, or than the vehicle needs to brake from v_max: rest
points further ahead leave the others less room and do not make the vehicle faster. That is so while
agreements rest on ``fresh`` plans: with older ones the planes follow so late that rest points must lie
further ahead.

Two vehicles need no circle: one plane between them leaves both their straight ways, or nearly so. So a
vehicle begins to anticipate when Σ w > 1, which takes two others, and goes on until it meets nobody. In space
planes lead vehicles over each other, which is shorter than a circle: so it is for planar flights alone.

A circle that reaches beyond the goal does not fit: the vehicle would fly round further out than it has to go.
So if ``room`` · min(1, Σ w) · K D / 2π exceeds the distance from the mean place of the encounters to the
goal, nothing is anticipated, and the deadlock rule (``DeadlockTurn``) resolves the encounter. The factor D of
this circle is the one without the growth; Σ w and K are those with it, so a crowd for which there is just
room with new agreements may have none with old ones. The circle that is flown is at most as large as this
distance. On the approach this distance stays as it is. K falls while vehicles pass; one that began to
anticipate among them, when a smaller circle fits, would have to pass those that are pushed already. So the
decision stays until nobody is met, or the goal is another one.

Three kinds of encounters do not count: beyond one of the goals; one that passes more than ``wrong_side`` · D
on the side of the turn, because it would have to be crossed; and, by as much as it flies to the side of the
turn and ahead, one beside which the vehicle would stay (``DeadlockTurn``).
"""

from __future__ import annotations

from math import atan2, copysign, dist, hypot, inf, pi
from typing import NamedTuple

from companion.config import CompanionConfig
from companion.config.certified import AnticipationConfig
from companion.values.horizon import Array

_AT_GOAL_M = 0.5
"""Distance from its goal below which a vehicle is not met, and beyond a goal within which it is."""
_LEAST_WAY_M = 0.5
_IN_TIME = 2.0
"""Age (epochs) of the plans of agreements up to which vehicles need no more room than with new ones."""


class Limits(NamedTuple):
    """Least distance of plans (m), and the largest speed (m/s) and acceleration (m/s²) of the own plans."""

    least: float
    speed: float
    acceleration: float


class Anticipated(NamedTuple):
    """Turn ``angle`` ≥ 0 (rad) of the goal, and the distance (m) that plans may aim ``ahead``.

    ``fits``: whether the circle that the encounters need does not reach beyond the goal. ``several``: whether
    these are encounters with more than one vehicle.
    """

    angle: float
    ahead: float
    fits: bool = True
    several: bool = False


NOBODY = Anticipated(0.0, inf)
BEYOND = Anticipated(0.0, inf, fits=False)


class Anticipation:
    """Turns of one vehicle among several; those whose circle does not fit are left to the deadlock rule.

    ``least`` (m): the least distance of plans. ``sense``: the side of the turns, +1 right.
    """

    def __init__(self, config: CompanionConfig, least: float, sense: float) -> None:
        certified, limits = config.certified, config.limits
        self._config, self._sense = certified.anticipation, sense
        self._limits = Limits(least, min(limits.v_max[:2]), min(limits.u_max[:2]))
        self._in_time = _IN_TIME * 1e-6 * certified.epoch_us
        self.restart()

    def restart(self) -> None:
        """Forget what was decided: it is not known any more who is met."""
        self._goal: list[float] | None = None
        self._begun = self._left = False

    def met(self, own: Array, others: Array, age: float) -> Anticipated:
        """Return how to avoid ``others`` (M, 2, 3), m, on the ``own`` way (2, 3), m.

        ``age`` (s): mean one of the plans of the agreements with the others. To be called for each plan.
        NOBODY before several are met, and from when a circle does not fit, until nobody is met or the goal is
        another one.
        """
        late = min(max(age - self._in_time, 0.0), self._in_time)
        found = anticipated(self._config, self._limits, own, others, sense=self._sense, late=late)
        goal = own[1].tolist()
        if found == NOBODY or self._goal is None or dist(self._goal, goal) > _AT_GOAL_M:
            self.restart()
            self._goal = goal
        self._begun |= found.several
        self._left |= not found.fits
        if not self._begun or self._left:
            return NOBODY
        return found if age <= self._config.fresh else found._replace(ahead=inf)


def anticipated(
    config: AnticipationConfig,
    limits: Limits,
    own: Array,
    others: Array,
    *,
    sense: float,
    late: float = 0.0,
) -> Anticipated:
    """Return how to avoid encounters by a turn to the side of ``sense``: +1 right.

    ``own`` (2, 3), m: where the own plan begins, and the goal. ``others`` (M, 2, 3), m: where the other
    vehicles are then, and their goals. ``late`` (s): age of agreements beyond two epochs, two epochs at most.
    BEYOND: they need a circle that does not fit.
    """
    least, speed, acceleration = limits
    place, goal = own.tolist()
    way, x, y = _direction(place, goal)
    if way < _AT_GOAL_M:
        return NOBODY
    in_time = least + config.wide * speed
    distance = in_time + config.wide_late * late * least
    weights = lengths = 0.0
    for there, its_goal in others.tolist():
        its_way, along, across = _direction(there, its_goal)
        if its_way < _AT_GOAL_M or abs(there[2] - place[2]) >= distance:
            continue
        # Places relative to the own one change by (u, v) while the own vehicle flies a metre.
        u, v = along - x, across - y
        p, q = there[0] - place[0], there[1] - place[1]
        length = -(p * u + q * v) / max(u * u + v * v, 1e-3)
        if not 0.0 < length <= min(way, its_way) + _AT_GOAL_M:
            continue
        p, q = p + length * u, q + length * v
        away = copysign(hypot(p, q), sense * (x * q - y * p))
        if not -config.wrong_side * distance <= away < distance:
            continue
        beside = max(sense * (along * y - across * x), 0.0)
        forward = max(along * x + across * y, 0.0)
        weight = min(1.0 - away / distance, 1.0) * (1.0 - beside * forward)
        weights += weight
        lengths += weight * length
    if weights <= 0.0:
        return NOBODY
    distances = config.room * min(weights, 1.0) * (1.0 + weights) / (2.0 * pi)
    length = lengths / weights
    if distances * in_time > way - length:
        return BEYOND
    radius = min(distances * distance, way - length)
    angle = atan2(radius, max(length, _LEAST_WAY_M))
    ahead = speed * max(config.reach, 0.5 * speed / acceleration)
    return Anticipated(min(angle, config.most), ahead, several=weights > 1.0)


def _direction(place: list[float], goal: list[float]) -> tuple[float, float, float]:
    """Return the horizontal distance (m) from ``place`` to ``goal`` (m), and the direction."""
    x, y = goal[0] - place[0], goal[1] - place[1]
    length = hypot(x, y)
    return (length, x / length, y / length) if length > 0.0 else (0.0, 0.0, 0.0)
