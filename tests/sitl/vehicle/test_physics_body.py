"""Laws of free flight: momenta, energy, the order of the integrator, and symmetry about the vertical."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml

from sitl.vehicle.airframe import Airframe, airframe, airframe_record
from sitl.vehicle.config import VehicleConfig
from sitl.vehicle.ground import GRAVITY
from sitl.vehicle.multirotor import Reference, Vehicle, advance_many, command_row, initial_states
from sitl.vehicle.pipeline import STATE_SIZE

CONFIG = Path(__file__).parents[3] / "config" / "vehicles" / "firefly.yaml"
FIREFLY = VehicleConfig.model_validate(yaml.safe_load(CONFIG.read_text()))
FAR_BELOW = 1e6


def rotation(q):
    """R(q) from its definition, independent of the code under test."""
    w, v = q[0], q[1:]
    skew = np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
    return np.eye(3) + 2.0 * w * skew + 2.0 * skew @ skew


def frozen_rotors(config: VehicleConfig = FIREFLY) -> Airframe:
    """Rotors whose speed never changes: a wrench that is held."""
    return airframe(config)._replace(half_step_decay_up=1.0, half_step_decay_down=1.0)


def tumbling(rates, speeds=0.0, velocity=(1.0, -2.0, 3.0)):
    states = initial_states(FIREFLY, [[0.0, 0.0, -100.0]], [0.3], FAR_BELOW)
    states[0, 3:6] = velocity
    states[0, 10:13] = rates
    states[0, STATE_SIZE : STATE_SIZE + 6] = speeds
    return states


@pytest.mark.parametrize("rates", [(3.0, 0.1, 0.2), (0.1, 4.0, 0.1), (2.0, -3.0, 5.0)])
def test_torque_free_tumble_keeps_angular_momentum_and_energy(rates):
    states = tumbling(rates)
    command = command_row(None, ground=FAR_BELOW)[None]
    J = np.diag(FIREFLY.inertia)

    def momentum():
        return rotation(states[0, 6:10]) @ J @ states[0, 10:13]

    def energy():
        return 0.5 * states[0, 10:13] @ J @ states[0, 10:13]

    h0, e0 = momentum(), energy()
    for _ in range(10):
        advance_many(states, command, airframe_record(airframe(FIREFLY)), 400)
        assert np.linalg.norm(momentum() - h0) < 2e-4 * np.linalg.norm(h0)
        assert energy() == pytest.approx(e0, rel=2e-4)
        assert np.linalg.norm(states[0, 6:10]) == pytest.approx(1.0, abs=1e-14)


def test_free_fall_is_a_parabola_whatever_the_tumble():
    states = tumbling((2.0, -3.0, 5.0))
    start, velocity = states[0, 0:3].copy(), states[0, 3:6].copy()
    track = advance_many(
        states, command_row(None, ground=FAR_BELOW)[None], airframe_record(airframe(FIREFLY)), 800
    )
    t = 0.0025 * np.arange(1, 801)[:, None]
    fall = np.array([0.0, 0.0, GRAVITY])
    np.testing.assert_allclose(track[0], start + velocity * t + 0.5 * fall * t**2, atol=1e-10)
    np.testing.assert_allclose(states[0, 3:6], velocity + 2.0 * fall, atol=1e-11)
    np.testing.assert_allclose(states[0, 13:16], fall, atol=1e-11)


def test_drag_without_thrust_only_takes_energy():
    model = frozen_rotors()._replace(k_f=0.0, rolling_moment=0.0)
    states = tumbling((2.0, -3.0, 5.0), speeds=600.0, velocity=(8.0, -4.0, 3.0))
    command = command_row(None, ground=FAR_BELOW)[None]
    record = airframe_record(model)
    J = np.array(FIREFLY.inertia)
    energies = []
    for _ in range(400):
        advance_many(states, command, record, 1)
        position, velocity, rates = states[0, 0:3], states[0, 3:6], states[0, 10:13]
        potential = -FIREFLY.mass * GRAVITY * position[2]
        energies.append(potential + 0.5 * FIREFLY.mass * velocity @ velocity + 0.5 * rates @ (J * rates))
    assert np.all(np.diff(energies) < 0.0)


def test_drag_takes_momentum_towards_the_wind():
    """Upright with equal rotors m dv/dt = −c Σ|ω| (v − w) in the plane: an exponential approach."""
    model = frozen_rotors()._replace(rolling_moment=0.0, rotor_z=np.zeros(6))
    states = tumbling((0.0, 0.0, 0.0), speeds=500.0, velocity=(5.0, 0.0, 0.0))
    wind = np.array([1.0, 3.0, 0.0])
    advance_many(states, command_row(None, wind=wind, ground=FAR_BELOW)[None], airframe_record(model), 2000)
    decay = np.exp(-FIREFLY.rotor_drag * 6 * 500.0 / FIREFLY.mass * 5.0)
    expected = wind[:2] + decay * (np.array([5.0, 0.0]) - wind[:2])
    np.testing.assert_allclose(states[0, 3:5], expected, atol=2e-6)


def rate_of_change(y, speeds, wind, config):
    """Newton and Euler with the rotors' wrench, written from the definitions: p, v, q, Ω → derivatives."""
    v, q, rates = y[3:6], y[6:10], y[10:13]
    R, J = rotation(q / np.linalg.norm(q)), np.array(config.inertia)
    force, moment = np.zeros(3), np.zeros(3)
    for rotor, omega in zip(config.rotors, speeds, strict=True):
        arm = np.array(rotor.position)
        hub = R.T @ (v - wind) + np.cross(rates, arm)
        hub[2] = 0.0
        thrust = config.k_f * omega**2
        push = np.array([0.0, 0.0, -thrust]) - config.rotor_drag * omega * hub
        force += push
        moment += np.cross(arm, push) - config.rolling_moment * omega * hub
        moment[2] += (1.0 if rotor.spin == "ccw" else -1.0) * config.k_m * thrust
    dq = 0.5 * np.r_[-q[1:] @ rates, q[0] * rates + np.cross(q[1:], rates)]
    acceleration = R @ force / config.mass + np.array([0.0, 0.0, GRAVITY])
    return np.r_[v, acceleration, dq, (moment - np.cross(rates, J * rates)) / J]


def runge_kutta(y, duration, steps, *model):
    h = duration / steps
    for _ in range(steps):
        k1 = rate_of_change(y, *model)
        k2 = rate_of_change(y + 0.5 * h * k1, *model)
        k3 = rate_of_change(y + 0.5 * h * k2, *model)
        k4 = rate_of_change(y + h * k3, *model)
        y = y + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    return y


def test_split_step_agrees_with_runge_kutta_and_is_of_second_order():
    speeds = np.array([545.0, 543.0, 546.0, 542.0, 544.0, 545.0])
    wind = np.array([2.0, -3.0, 0.5])
    rates = (1.0, -0.7, 0.5)
    truth = runge_kutta(tumbling(rates)[0, :13], 1.0, 500, speeds, wind, FIREFLY)
    errors = []
    for period in (5000, 2500):
        config = FIREFLY.model_copy(update={"physics_period": period})
        states = tumbling(rates, speeds=speeds)
        command = command_row(None, wind=wind, ground=FAR_BELOW)[None]
        advance_many(states, command, airframe_record(frozen_rotors(config)), 1_000_000 // period)
        turn = 2.0 * np.arccos(min(1.0, abs(states[0, 6:10] @ truth[6:10])))
        errors.append((np.linalg.norm(states[0, 0:3] - truth[0:3]), turn))
    assert errors[1][0] < 2e-5  # m
    assert np.degrees(errors[1][1]) < 1e-3
    assert 3.0 < errors[0][0] / errors[1][0] < 5.0


@pytest.mark.parametrize("angle", [0.7, np.pi / 2, -2.0])
def test_the_flight_turns_with_the_problem(angle):
    """Rotating start, references and wind about the vertical rotates the flight."""
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    start, wind = np.array([1.0, 2.0, -5.0]), np.array([3.0, 1.0, 0.2])
    plain, turned = Vehicle(FIREFLY, start, 0.2), Vehicle(FIREFLY, turn @ start, 0.2 + angle)
    for i in range(20):
        p, v, a = np.array([4.0, -3.0 + 0.1 * i, -6.0]), np.array([1.0, 0.5, -0.2]), np.array([0.3, 0, 0])
        one = plain.advance(20, Reference(p, v, a, yaw=0.5, yaw_rate=0.3), wind)
        reference = Reference(turn @ p, turn @ v, turn @ a, yaw=0.5 + angle, yaw_rate=0.3)
        other = turned.advance(20, reference, turn @ wind)
        np.testing.assert_allclose(other, one @ turn.T, atol=1e-9)
    np.testing.assert_allclose(turned.state.body_rates, plain.state.body_rates, atol=1e-8)
