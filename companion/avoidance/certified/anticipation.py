"""Anticipation: turns the goal aside before the planes of other vehicles push a plan back.

Planes push only once rest points are near each other. Vehicles that meet in one place turn aside there, and
stand in each other's way. So the encounter is predicted: the rest point of each vehicle goes on as its newest
plan does on average, and the own one towards the goal as fast as the own plan. Seen from above let them be
nearest after the time t, with the other one at the signed distance m on the side away from the turn, and D
the distance that is wanted. If m < D, the goal is turned by atan(share · (D − m) / (v t)), so that both
vehicles together, each by ``share``, make room for D. Only the cost of the plan changes.

Three kinds of encounters do not count: after more than ``look`` seconds or beyond the goal; one that passes
more than ``wrong_side`` · D on the side of the turn, because it would have to be crossed; and, by as much as
it flies to the side of the turn and ahead, one beside which the vehicle would stay (``DeadlockTurn``).
"""

from __future__ import annotations

from math import atan2, copysign, hypot

from companion.config.certified import AnticipationConfig
from companion.values.horizon import Array

_NEAR_GOAL_M = 0.5
"""Distance of the rest point from the goal below which nothing is anticipated."""
_LEAST_SPEED_M_S = 0.3
"""Own speed that is assumed at least, as at the beginning of a flight."""
_MOVES_M_S = 0.2
"""Speed from which another vehicle counts as moving."""
_LEAST_WAY_M = 0.5


def anticipated_turn(
    config: AnticipationConfig,
    wanted: float,
    own: Array,
    others: Array,
    goal: Array,
    seconds: float,
    *,
    sense: float,
) -> float:
    """Return the angle ≥ 0 (rad) by which to turn the ``goal`` (3,), m, to the side of ``sense``: +1 right.

    ``wanted`` (m): the least distance of plans. ``own`` (2, 3), m: where the own committed plan is at its
    beginning and where it rests, ``seconds`` later. ``others`` (M, 2, 3), m: the same of the other vehicles'
    newest plans, on the same clock.
    """
    way = goal - own[1]
    length = hypot(way[0], way[1])
    if length < _NEAR_GOAL_M:
        return 0.0
    x, y = way[0] / length, way[1] / length
    speed = max(hypot(*(own[1] - own[0])[:2]) / seconds, _LEAST_SPEED_M_S)
    distance = config.wide * wanted
    largest = 0.0
    for begin, rest in others.tolist():
        velocity = (rest[0] - begin[0]) / seconds, (rest[1] - begin[1]) / seconds
        level = abs(rest[2] - own[1, 2]) < distance
        if not level or hypot(*velocity) < _MOVES_M_S:
            continue
        u, v = velocity[0] - speed * x, velocity[1] - speed * y
        closing = u * u + v * v
        p, q = rest[0] - own[1, 0], rest[1] - own[1, 1]
        after = -(p * u + q * v) / max(closing, 1e-3)
        if not 0.0 < after <= config.look or speed * after > length + _NEAR_GOAL_M:
            continue
        p, q = p + after * u, q + after * v
        away = copysign(hypot(p, q), sense * (x * q - y * p))
        if not -config.wrong_side * distance <= away < distance:
            continue
        beside = min(max(sense * (velocity[0] * y - velocity[1] * x), 0.0), 1.0)
        ahead = min(max(velocity[0] * x + velocity[1] * y, 0.0), 1.0)
        turn = atan2(config.share * (distance - away), max(speed * after, _LEAST_WAY_M))
        largest = max(largest, (1.0 - beside * ahead) * turn)
    return min(largest, config.most)
