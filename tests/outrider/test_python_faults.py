"""Values from Python that no file can have."""

from __future__ import annotations

import numpy as np
import pytest

from outrider import PlannerConfig
from outrider.errors import InputError


@pytest.mark.parametrize("values", [{"limits": {"u_max": float("nan")}}, {"field": b"\xff"}])
def test_each_is_one_line_that_names_the_setting(values: dict[str, object]) -> None:
    with pytest.raises(InputError) as told:
        PlannerConfig(**values)
    assert next(iter(values)) in str(told.value)


def test_a_number_of_numpy_is_a_bound_of_each_axis() -> None:
    assert PlannerConfig(limits={"u_max": np.float32(3.0)}).limits.u_max == (3.0, 3.0, 3.0)
