"""A vehicle that cannot fly is refused when it is loaded."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml
from pydantic import ValidationError

from sitl.vehicle.airframe import airframe, airframe_record
from sitl.vehicle.config import VehicleConfig

CONFIG = Path(__file__).parents[3] / "config" / "vehicles" / "firefly.yaml"
FIREFLY = yaml.safe_load(CONFIG.read_text())


def test_firefly_is_the_vehicle_of_the_notes():
    config = VehicleConfig.model_validate(FIREFLY)
    weight = config.mass * 9.80665
    assert config.k_f * config.omega_max**2 == pytest.approx(6.0, abs=0.01)
    assert 6 * config.k_f * config.omega_max**2 / weight == pytest.approx(2.38, abs=0.01)
    assert np.sqrt(weight / 6 / config.k_f) == pytest.approx(544, abs=1)


def test_every_number_survives_packing():
    numbers = airframe(VehicleConfig.model_validate(FIREFLY))
    record = airframe_record(numbers)
    assert record.dtype.names == numbers._fields
    for name, value in numbers._asdict().items():
        np.testing.assert_array_equal(record[name][0], value)
    assert not record.flags.writeable


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"mas": 1.0}, "Extra inputs"),
        ({"mass": 0.0}, "greater than 0"),
        ({"mass": float("nan")}, "greater than 0|finite"),
        ({"mass": 4.0}, "less than 1.05 times the weight"),
        ({"omega_idle": 900.0}, "must be below omega_max"),
        ({"physics_period": 2501}, "multiple of 4"),
        ({"max_tilt_deg": 90.0}, "less than 90"),
        ({"rotors": [{**rotor, "spin": "cw"} for rotor in FIREFLY["rotors"]]}, "independently"),
        ({"rotors": [{**rotor, "angle_deg": 0.0} for rotor in FIREFLY["rotors"]]}, "independently"),
    ],
)
def test_refuses(change, says):
    with pytest.raises(ValidationError, match=says):
        VehicleConfig.model_validate({**FIREFLY, **change})
