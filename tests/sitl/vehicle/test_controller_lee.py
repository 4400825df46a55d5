"""The validation cases of Lee, Leok and McClamroch (CDC 2010); kinematics of the commanded attitude."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sitl.vehicle.airframe import airframe, airframe_record
from sitl.vehicle.body import body_axes, free_flight
from sitl.vehicle.compiled import kernel
from sitl.vehicle.config import VehicleConfig
from sitl.vehicle.controller import commanded_attitude, control, desired_force
from sitl.vehicle.vectors import dot, plus

M, D, C_TAU_F = 4.34, 0.315, 8.004e-4
LEE = VehicleConfig.model_validate(
    {
        "name": "lee2010",
        "mass": M,
        "inertia": (0.0820, 0.0845, 0.1377),
        "span": 0.9,
        "rotors": [
            {"angle_deg": 90.0 * i, "arm": D, "spin": "cw" if i % 2 else "ccw"} for i in range(4)
        ],
        "k_f": 1e-4,
        "k_m": C_TAU_F,
        "omega_max": 1000.0,
        "omega_idle": 1.0,
        "tau_up": 0.01,
        "tau_down": 0.01,
        "rotor_drag": 0.0,
        "rolling_moment": 0.0,
        "k_x": 16.0 * M,
        "k_v": 5.6 * M,
        "k_R": (8.81,) * 3,
        "k_Omega": (2.54,) * 3,
        "heading": "paper",
        "max_tilt_deg": None,
        "max_yaw_error_deg": None,
        "rest_height": 0.1,
        "gear_radius": 0.2,
        "physics_period": 1000,
    }
)  # fmt: skip


@kernel
def helix(t):
    w = math.pi
    s, c = 0.4 * math.sin(w * t), 0.6 * math.cos(w * t)
    s1, c1 = 0.4 * w * math.cos(w * t), -0.6 * w * math.sin(w * t)
    return (
        (0.4 * t, s, c),
        (0.4, s1, c1),
        (0.0, -w * w * s, -w * w * c),
        (0.0, -w * w * s1, -w * w * c1),
        (0.0, w**4 * s, w**4 * c),
    )


@kernel
def heading(yaw):
    return (math.cos(yaw), math.sin(yaw), 0.0)


@kernel
def fly(motion, airframes, steps, on_helix):
    """Errors ‖e_x‖, Ψ and the thrust at each step, the controller's wrench acting directly on the body."""
    model = airframes[0]
    history = np.empty((steps, 3))
    zero = (0.0, 0.0, 0.0)
    for i in range(steps):
        t = i * model.step
        target = helix(t) if on_helix else (zero, zero, zero, zero, zero)
        yaw_rate = math.pi if on_helix else 0.0
        axes = body_axes(motion[2])
        # The paper takes the acceleration from its model, and f does not depend on it.
        f, _ = desired_force(motion[0], motion[1], zero, axes, motion[3], target, zero, model)
        acceleration = plus((0.0, 0.0, model.gravity), -f / model.mass, axes[2])
        _, A = desired_force(motion[0], motion[1], acceleration, axes, motion[3], target, zero, model)
        R_c, _, _ = commanded_attitude(A, heading(yaw_rate * t), yaw_rate, 0.0, axes, model)
        f, moment = control(
            motion[0],
            motion[1],
            acceleration,
            axes,
            motion[3],
            target,
            yaw_rate * t,
            yaw_rate,
            0.0,
            (zero, zero),
            model,
        )
        e = (motion[0][0] - target[0][0], motion[0][1] - target[0][1], motion[0][2] - target[0][2])
        history[i, 0] = math.sqrt(e[0] ** 2 + e[1] ** 2 + e[2] ** 2)
        history[i, 1] = 0.5 * (3.0 - dot(R_c[0], axes[0]) - dot(R_c[1], axes[1]) - dot(R_c[2], axes[2]))
        history[i, 2] = f
        motion = free_flight(motion, (0.0, 0.0, -f), moment, model)
    return history


ZERO = (0.0, 0.0, 0.0)


def flown(config, attitude, steps, on_helix):
    return fly((ZERO, ZERO, attitude, ZERO), airframe_record(airframe(config, 9.81)), steps, on_helix)


def test_helix_is_followed_and_only_with_the_feed_forward():
    level = (1.0, 0.0, 0.0, 0.0)
    error = flown(LEE, level, 10_000, True)[:, 0]
    assert error[0] == pytest.approx(0.6)
    assert error[1870:].max() < 0.01
    assert error[5000:].max() < 1e-3
    without = flown(LEE.model_copy(update={"rate_feed_forward": False}), level, 10_000, True)[:, 0]
    assert without[5000:].max() > 1.0


@pytest.mark.parametrize("cosine", [-0.995, -0.9995])
def test_recovers_from_upside_down(cosine):
    """The paper prints the matrix of the second and Ψ0 = 1.995, which is that of the first."""
    roll = math.acos(cosine)
    history = flown(LEE, (math.cos(roll / 2), math.sin(roll / 2), 0.0, 0.0), 6000, False)
    error, psi, thrust = history.T
    assert psi[0] == pytest.approx(1.0 - cosine, abs=1e-9)
    assert thrust[0] == pytest.approx(M * 9.81 * cosine)
    assert error.max() == pytest.approx(1.0, abs=0.05)
    assert error[3500:].max() < 0.01
    if cosine == -0.995:
        assert 0.001 * np.argmax(psi < 1.0) == pytest.approx(0.9, abs=0.05)


def curve(t):
    """A smooth force that turns and changes its size, with its derivatives."""
    A = np.array([4.0 * np.sin(1.3 * t), 3.0 * np.cos(0.7 * t) - 1.0, -15.0 + 2.0 * np.sin(2.0 * t)])
    dA = np.array([5.2 * np.cos(1.3 * t), -2.1 * np.sin(0.7 * t), 4.0 * np.cos(2.0 * t)])
    ddA = np.array([-6.76 * np.sin(1.3 * t), -1.47 * np.cos(0.7 * t), -8.0 * np.sin(2.0 * t)])
    return tuple(map(tuple, (A, dA, ddA)))


LEVEL = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


@kernel
def command(A, yaw, yaw_rate, yaw_acceleration, axes, airframes):
    return commanded_attitude(A, heading(yaw), yaw_rate, yaw_acceleration, axes, airframes[0])


@pytest.mark.parametrize("heading", ["paper", "euler"])
def test_commanded_rates_are_the_derivatives_of_the_commanded_attitude(heading):
    record = airframe_record(airframe(LEE.model_copy(update={"heading": heading})))

    def yaw(t):
        return 0.3 + 0.8 * t + 0.25 * t * t

    def commanded(t):
        axes, rates, change = command(curve(t), yaw(t), 0.8 + 0.5 * t, 0.5, LEVEL, record)
        return np.array(axes).T, np.array(rates), np.array(change)

    h = 1e-5
    for t in np.linspace(0.0, 6.0, 13):
        R, rates, change = commanded(t)
        before, after = commanded(t - h), commanded(t + h)
        np.testing.assert_allclose(R.T @ R, np.eye(3), atol=1e-13)
        assert np.linalg.det(R) > 0.0
        np.testing.assert_allclose(R[:, 2], -np.array(curve(t)[0]) / np.linalg.norm(curve(t)[0]), atol=1e-13)
        spin = R.T @ (after[0] - before[0]) / (2.0 * h)
        np.testing.assert_allclose([spin[2, 1], spin[0, 2], spin[1, 0]], rates, atol=1e-7)
        np.testing.assert_allclose((after[1] - before[1]) / (2.0 * h), change, atol=1e-7)
        if heading == "euler":
            turned = math.remainder(math.atan2(R[1, 0], R[0, 0]) - yaw(t), math.tau)
            assert abs(turned) < 1e-12


@pytest.mark.parametrize("heading", ["paper", "euler"])
@pytest.mark.parametrize(
    "A", [(0.0, 0.0, 0.0), (0.0, 0.0, 1e-9), (-20.0, 0.0, 0.0), (0.0, -20.0, 0.0), (20.0, 0.0, -1e-3)]
)
@pytest.mark.parametrize("axes", [LEVEL, ((0.0, 0.0, -1.0), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0))])
def test_a_command_without_direction_is_still_a_rotation(heading, A, axes):
    record = airframe_record(airframe(LEE.model_copy(update={"heading": heading})))
    R, rates, change = map(
        np.array, command((A, (1.0, 2.0, 3.0), (3.0, 2.0, 1.0)), 0.0, 0.5, 0.2, axes, record)
    )
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(R) > 0.0
    assert np.all(np.isfinite(rates))
    assert np.all(np.isfinite(change))
