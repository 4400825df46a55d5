"""Laws of the batch: each vehicle moves as it would alone, frames agree, and errors are clear."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from outrider import InputError
from outrider.sim import Batch, Vehicle
from outrider.sim.frames import enu_attitudes
from sitl.vehicle.multirotor import Reference
from sitl.vehicle.multirotor import Vehicle as Bare
from tests.outrider.shipped import FIREFLY


def commands(count: int, seed: int = 1) -> np.ndarray:
    random = np.random.default_rng(seed)
    found = random.normal(0.0, 1.0, (count, 11))
    found[:, 2] += 6.0
    return found


def test_the_others_have_no_effect_to_the_bit() -> None:
    many, wanted = Batch("firefly", 13), commands(13)
    places = many.positions
    many.step(wanted, 200)
    for k in (0, 7, 12):
        alone = Batch("firefly", 1, positions=places[k])
        alone.step(wanted[k : k + 1], 200)
        assert np.array_equal(alone.positions[0], many.positions[k])
        assert np.array_equal(alone.attitudes[0], many.attitudes[k])


def test_it_is_the_vehicle_of_the_simulated_autopilot() -> None:
    """The physics of flights, which is north-east-down, moves the same vehicle the same way."""
    ours = Vehicle("firefly", (1.0, 2.0, 5.0), yaw=0.3)
    bare = Bare(FIREFLY, (2.0, 1.0, -5.0), 0.5 * np.pi - 0.3, hovering=True)
    ours.step((2.0, 2.5, 6.0), (0.5, 0.0, 0.1), yaw=0.8, yaw_rate=0.2, steps=120, wind=(3.0, 1.0, 0.0))
    bare.advance(
        120,
        Reference(
            np.array([2.5, 2.0, -6.0]),
            np.array([0.0, 0.5, -0.1]),
            yaw=0.5 * np.pi - 0.8,
            yaw_rate=-0.2,
        ),
        (1.0, 3.0, 0.0),
    )
    true, state = bare.state, ours.state
    np.testing.assert_array_equal(state.position, true.position[[1, 0, 2]] * (1, 1, -1))
    np.testing.assert_array_equal(state.velocity, true.velocity[[1, 0, 2]] * (1, 1, -1))
    np.testing.assert_array_equal(state.rotor_speeds, true.rotor_speeds)
    assert np.cos(state.yaw - (0.5 * np.pi - bare.yaw)) == pytest.approx(1.0)


def rotation(q: np.ndarray) -> np.ndarray:
    w, x, y, z = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def test_attitudes_turn_the_same_vectors() -> None:
    """A body vector in FLU, turned to ENU, is the same vector in FRD, turned to NED."""
    random = np.random.default_rng(2)
    quaternions = random.normal(size=(50, 4))
    quaternions /= np.linalg.norm(quaternions, axis=1, keepdims=True)
    world, body = np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1]]), np.diag([1, -1, -1])
    for ned, enu in zip(quaternions, enu_attitudes(quaternions), strict=True):
        np.testing.assert_allclose(rotation(enu), world @ rotation(ned) @ body, atol=1e-12)


def test_a_saved_state_continues_to_the_bit() -> None:
    batch, wanted = Batch("firefly", 5), commands(5)
    batch.step(wanted, 40)
    kept = batch.save()
    there = batch.step(wanted, 40)
    batch.load(kept)
    assert np.array_equal(batch.step(wanted, 40), there)


def test_a_reset_touches_only_the_chosen_and_repairs_them() -> None:
    batch, wanted = Batch("firefly", 4), commands(4)
    batch.fail_rotor(2, 0, 0.0)
    before = batch.step(wanted, 40)
    batch.reset([2], positions=(1.0, 1.0, 9.0), yaws=0.5)
    assert np.array_equal(np.delete(batch.positions, 2, 0), np.delete(before, 2, 0))
    np.testing.assert_allclose(batch.positions[2], (1.0, 1.0, 9.0))
    assert batch.yaws[2] == pytest.approx(0.5)
    assert batch.rotor_speeds[2].min() > 0.0


def test_motors_off_it_falls_and_lies_on_the_ground() -> None:
    batch = Batch("firefly", 3, ground=2.0)
    assert not batch.on_ground.any()
    for _ in range(100):
        batch.step(None, 20)
    assert batch.on_ground.all()
    np.testing.assert_allclose(batch.positions[:, 2], 2.0 + batch.config.rest_height, atol=1e-6)


WRONG: dict[str, tuple[Callable[[], object], str]] = {
    "two columns": (
        lambda: Batch(count=2).step(np.zeros((2, 2))),
        "allowed: (2, c) with c one of 3, 6, 9, 10, 11",
    ),
    "rows": (lambda: Batch(count=2).step(np.zeros((3, 3))), "commands: has shape (3, 3)"),
    "NaN": (lambda: Batch(count=2).step([[0, 0, 5], [0, np.nan, 5]]), "commands: row 1 is not finite"),
    "wind": (lambda: Batch(count=2).step(np.zeros((2, 3)), wind=(1.0, 2.0)), "wind: has shape (2,)"),
    "steps": (lambda: Batch().step(np.zeros((1, 3)), 0), "steps: is 0"),
    "count": (lambda: Batch(count=0), "count: is 0"),
    "a hover in the ground": (lambda: Batch(positions=(0.0, 0.0, -1.0)), "cannot hover"),
    "a type": (lambda: Batch("firefli"), "did you mean 'firefly'?"),
    "a place of two": (lambda: Vehicle().step((0.0, 0.0), (3.0, 0.0, 0.0)), "position: has shape (2,)"),
    "a rotor": (lambda: Batch().fail_rotor(0, 9, 0.5), "its rotors are 0 to 5"),
}


@pytest.mark.parametrize("what", WRONG)
def test_wrong_arguments_are_one_clear_error(what: str) -> None:
    call, said = WRONG[what]
    with pytest.raises(InputError) as error:
        call()
    assert said in str(error.value)


def test_what_is_refused_moves_nothing() -> None:
    batch = Batch(count=2)
    before = batch.save()
    with pytest.raises(InputError):
        batch.step([[0, 0, 5], [0, np.inf, 5]])
    assert np.array_equal(batch.save(), before)
